//! Names of surfaces: a name that is a switching function by itself, `c` of `c > 0` and of `sign(c)`.
//!
//! In a function, arguments are; what is given for them is then, where it is called.

use rustc_hash::FxHashSet;

use crate::source::Span;
use crate::syntax::{Arg, Expr, ExprKind, Relation, Row};

/// Names that are switching functions.
#[derive(Default)]
pub(super) struct Surfaces {
    /// Where they are declared.
    pub found: FxHashSet<Span>,
    /// Names that are given for arguments, as they are declared, with these.
    pub given: Vec<(Span, Span)>,
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

/// The switching functions of a comparison, or of a function that switches or has a kink.
pub(super) fn switching(expr: &Expr) -> Vec<&Expr> {
    match &expr.kind {
        ExprKind::Compare(first, rest) => of_relation(first, rest),
        ExprKind::Call(function, args) => match (&function.kind, &positional(args)[..]) {
            (ExprKind::Name(name), [psi]) if matches!(&**name, "sign" | "step" | "abs") => {
                entries(psi)
            }
            (ExprKind::Name(name), [left, right]) if matches!(&**name, "min" | "max") => {
                of_pair(left, right)
            }
            _ => vec![],
        },
        _ => vec![],
    }
}

/// The boundaries of a set.
pub(super) fn boundaries(rows: &[Row]) -> Vec<&Expr> {
    let found = rows.iter().flat_map(|row| match row {
        Row::For { rows, .. } => boundaries(rows),
        Row::Relation { first, rest, .. } => of_relation(first, rest),
        Row::Bad(_) => vec![],
    });
    found.collect()
}

/// `c > 0`, `0 < c`: what stands beside a zero.
fn of_relation<'f>(first: &'f Expr, rest: &'f [(Relation, Expr)]) -> Vec<&'f Expr> {
    let others = rest.iter().map(|(_, member)| member);
    let pairs = std::iter::once(first).chain(others.clone()).zip(others);
    pairs
        .flat_map(|(left, right)| of_pair(left, right))
        .collect()
}

fn of_pair<'f>(left: &'f Expr, right: &'f Expr) -> Vec<&'f Expr> {
    match (left.is_zero(), right.is_zero()) {
        (false, true) => entries(left),
        (true, false) => entries(right),
        _ => vec![],
    }
}

/// ψ, whose zero set is a surface, entry by entry; that of -ψ is the same.
pub(super) fn entries(psi: &Expr) -> Vec<&Expr> {
    match &psi.kind {
        ExprKind::Negate(inner) => entries(inner),
        ExprKind::Matrix(matrix) => matrix.rows.iter().flatten().flat_map(entries).collect(),
        _ => vec![psi],
    }
}

/// Arguments without names and loops.
pub(super) fn positional(args: &[Arg]) -> Vec<&Expr> {
    let values = args.iter().filter_map(|arg| match arg {
        Arg::Positional(value, binders) if binders.is_empty() => Some(value),
        _ => None,
    });
    values.collect()
}
