//! Names of surfaces: a name that is a switching function by itself, `c` of `c > 0` and of `sign(c)`.
//!
//! In a function, arguments are; what is given for them is then, where it is called.

use rustc_hash::FxHashSet;

use super::references::Resolver;
use crate::source::Span;
use crate::syntax::{Arg, Expr, ExprKind, Relation, Row};

/// Names that are switching functions.
#[derive(Default)]
pub(super) struct Surfaces {
    /// Where they are declared.
    found: FxHashSet<Span>,
    /// Names that are given for arguments, as they are declared, with these.
    given: Vec<(Span, Span)>,
}

impl Surfaces {
    /// All of them, through any number of calls.
    pub fn all(mut self) -> FxHashSet<Span> {
        loop {
            let n_known = self.found.len();
            let through = self.given.iter();
            let through = through.filter(|(_, argument)| self.found.contains(argument));
            let through: Vec<Span> = through.map(|&(name, _)| name).collect();
            self.found.extend(through);
            if self.found.len() == n_known {
                return self.found;
            }
        }
    }
}

/// What looks for them, where somebody looks at the text.
pub(super) struct Switching<'s, 'r, 'f> {
    pub resolver: &'s mut Resolver<'r, 'f>,
}

impl<'f> Switching<'_, '_, 'f> {
    /// A comparison, a function that switches or has a kink, or a call that gives something to one.
    pub fn expr(&mut self, expr: &'f Expr) {
        match &expr.kind {
            ExprKind::Compare(first, rest) => self.relation(first, rest),
            ExprKind::Call(function, args) => self.call(function, args),
            _ => {}
        }
    }

    /// `c > 0`, `0 < c`: what stands beside a zero.
    fn relation(&mut self, first: &'f Expr, rest: &'f [(Relation, Expr)]) {
        let mut left = first;
        for (_, right) in rest {
            self.pair(left, right);
            left = right;
        }
    }

    fn pair(&mut self, left: &'f Expr, right: &'f Expr) {
        match (left.is_zero(), right.is_zero()) {
            (false, true) => self.switching(left),
            (true, false) => self.switching(right),
            _ => {}
        }
    }

    /// The boundaries of a set.
    pub fn rows(&mut self, rows: &'f [Row]) {
        for row in rows {
            match row {
                Row::For { rows, .. } => self.rows(rows),
                Row::Relation { first, rest, .. } => self.relation(first, rest),
                Row::Bad(_) => {}
            }
        }
    }

    fn call(&mut self, function: &'f Expr, args: &'f [Arg]) {
        let positional = args.iter().filter_map(|arg| match arg {
            Arg::Positional(value, binders) if binders.is_empty() => Some(value),
            _ => None,
        });
        let args: Vec<&Expr> = positional.collect();
        if let Some(function) = self.resolver.function_of(function) {
            let params = function.params.iter().zip(args);
            let given = params.filter_map(|(param, arg)| Some((self.declared(arg)?, param.span)));
            let given: Vec<_> = given.collect();
            self.known(|surfaces| surfaces.given.extend(given));
        } else if let ExprKind::Name(name) = &function.kind {
            match (name.as_str(), &args[..]) {
                ("sign" | "step" | "abs", [psi]) => self.switching(psi),
                ("min" | "max", [left, right]) => self.pair(left, right),
                _ => {}
            }
        }
    }

    /// ψ, whose zero set is a surface; that of -ψ is the same.
    pub fn switching(&mut self, psi: &'f Expr) {
        match &psi.kind {
            ExprKind::Negate(inner) => self.switching(inner),
            ExprKind::Matrix(matrix) => {
                let entries = matrix.rows.iter().flatten();
                entries.for_each(|entry| self.switching(entry));
            }
            _ => {
                let declared = self.declared(psi);
                self.known(|surfaces| surfaces.found.extend(declared));
            }
        }
    }

    fn known(&mut self, note: impl FnOnce(&mut Surfaces)) {
        if let Some(recorder) = &mut self.resolver.recorder {
            note(&mut recorder.surfaces);
        }
    }

    /// Where a name is declared that stands alone, or with indices.
    fn declared(&self, expr: &Expr) -> Option<Span> {
        match &expr.kind {
            ExprKind::Name(name) => self.resolver.declared_at(name),
            ExprKind::Index(base, _) => self.declared(base),
            ExprKind::Field(base, field) => Some(self.resolver.member(base, field)?.0),
            _ => None,
        }
    }
}
