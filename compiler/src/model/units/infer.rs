//! Dimensions of expressions.

use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::dimension::{Dim, Dimension, Ratio};
use super::error::UnitError;
use super::instances::{Instances, Place};
use super::literal;
use super::names::read;
use crate::diagnostics::Diagnostics;
use crate::model::hir::import::own;
use crate::model::hir::{Definition, Global, Reference};
use crate::source::Span;
use crate::syntax::{Arg, BinaryOp, Decl, Expr, ExprKind, File, Function, Index, Named};

/// Expressions inside each other, through functions, names and parts: what the stack bears.
/// Further down, dimensions are unknown.
const MAX_DEPTH: usize = 300;
/// Expressions that are looked at; beyond, dimensions are unknown. Models that reach it are refused
/// for their size, unless they repeat a call in vain.
const BUDGET: usize = 4_000_000;

/// What a name or a field leads to.
enum Found<'f> {
    /// An index or an argument: its dimension, and its value where that is a plain number.
    Local(Dim, Option<Ratio>),
    /// Something an instance declares.
    Own(usize, Definition<'f>),
    /// Something a file declares.
    Global(Global<'f>),
}

/// Dimensions of expressions, and of what is declared.
pub(crate) struct Inference<'f, 'd> {
    pub instances: Instances<'f>,
    /// Dimensions of what instances declare; `None` while one is being looked at.
    known: FxHashMap<(usize, Span), Option<Dim>>,
    pub place: Place<'f>,
    depth: usize,
    left: usize,
    pub diags: &'d mut Diagnostics,
}

impl<'f, 'd> Inference<'f, 'd> {
    /// In the model itself.
    pub fn new(instances: Instances<'f>, diags: &'d mut Diagnostics) -> Self {
        Inference {
            place: instances.place(0, None),
            instances,
            known: FxHashMap::default(),
            depth: 0,
            left: BUDGET,
            diags,
        }
    }

    /// Runs `look` in another place.
    pub fn within<T>(&mut self, place: Place<'f>, look: impl FnOnce(&mut Self) -> T) -> T {
        let outside = std::mem::replace(&mut self.place, place);
        let result = look(self);
        self.place = outside;
        result
    }

    /// The dimension of what an instance declares.
    pub fn declared(&mut self, instance: usize, definition: Definition<'f>) -> Dim {
        let span = match definition {
            Definition::Decl(decl) => decl.span,
            Definition::Named(named) => named.span,
            Definition::Switch(_) => return Dim::PURE,
            // A structural constant has no unit of its own.
            _ => return Dim::Unknown,
        };
        // What is asked for while it is looked at depends on itself through parts.
        if let Some(known) = self.known.get(&(instance, span)) {
            return known.unwrap_or(Dim::Unknown);
        }
        self.known.insert((instance, span), None);
        let place = self.instances.place(instance, self.place.call);
        let dim = self.within(place, |dims| match definition {
            Definition::Decl(decl) => dims.quantity(instance, decl),
            Definition::Named(named) => dims.named(named),
            _ => Dim::Unknown,
        });
        self.known.insert((instance, span), Some(dim));
        dim
    }

    /// The dimension of a quantity: that of its unit, or of what a part is given for it.
    pub fn quantity(&mut self, instance: usize, decl: &'f Decl) -> Dim {
        if let Some(unit) = &decl.unit {
            return Dim::of(read(unit, self.diags));
        }
        let given = self.instances.given(instance, decl);
        let given = given.map(|(value, outer)| {
            let place = self.instances.place(outer, self.place.call);
            self.within(place, |dims| dims.expr(value))
        });
        match given {
            Some(Dim::Known(dimension)) => Dim::Known(dimension),
            _ => Dim::Unknown,
        }
    }

    /// The dimension of a `let`, `output` or `signal`; one that is declared is compared with it.
    pub fn named(&mut self, named: &'f Named) -> Dim {
        let value = self.expr(&named.value);
        let Some(unit) = &named.unit else {
            return value;
        };
        let dim = Dim::of(read(unit, self.diags));
        let what = format!("`{}`", named.name.name);
        self.fits(what, dim, (value, &named.value), Some(unit.span));
        dim
    }

    /// The dimension of an expression; what does not fit in it is reported.
    pub fn expr(&mut self, expr: &'f Expr) -> Dim {
        if self.depth >= MAX_DEPTH || self.left == 0 {
            return Dim::Unknown;
        }
        self.left -= 1;
        self.depth += 1;
        let dim = self.any(expr);
        self.depth -= 1;
        dim
    }

    fn any(&mut self, expr: &'f Expr) -> Dim {
        match &expr.kind {
            ExprKind::Number(_) => Dim::Number,
            ExprKind::Quantity(_, unit) => Dim::of(literal::dimension(unit)),
            ExprKind::String(_) => Dim::Unknown,
            ExprKind::Name(_) | ExprKind::Field(..) => match self.find(expr) {
                Some(Found::Local(dim, _)) => dim,
                Some(Found::Own(instance, definition)) => self.declared(instance, definition),
                Some(Found::Global(_)) => Dim::Unknown,
                None => self.builtin_value(expr),
            },
            ExprKind::Index(base, indices) => {
                for index in indices {
                    match index {
                        Index::All(_) => {}
                        Index::One(one) => {
                            self.pure("an index", one);
                        }
                        Index::Range(first, last) => {
                            self.pure("an index", first);
                            self.pure("an index", last);
                        }
                    }
                }
                self.expr(base)
            }
            ExprKind::Call(function, args) => self.call(function, args, expr.span),
            ExprKind::Matrix(matrix) => self.stack(matrix.rows.iter().flatten()),
            ExprKind::Comprehension(inner, _) | ExprKind::Negate(inner) => self.expr(inner),
            ExprKind::Binary(_, base, exponent) => self.power(base, exponent),
            ExprKind::Chain(first, rest) => self.chain(first, rest),
            ExprKind::Compare(first, rest) => {
                let members = std::iter::once(&**first).chain(rest.iter().map(|(_, side)| side));
                self.agree("the sides of this comparison", members);
                Dim::Number
            }
            ExprKind::Not(inner) => {
                self.expr(inner);
                Dim::Number
            }
            ExprKind::And(members) | ExprKind::Or(members) => {
                for member in members {
                    self.expr(member);
                }
                Dim::Number
            }
            ExprKind::If(condition, a, b) => {
                self.expr(condition);
                self.agree("the branches of this `if`", [&**a, &**b])
            }
        }
    }

    /// What a name, or a field of a part or a file, stands for.
    fn find(&mut self, expr: &Expr) -> Option<Found<'f>> {
        match &expr.kind {
            ExprKind::Name(_) => {
                let reference = *self.place.names.get(&expr.span)?;
                let instance = self.place.instance;
                match reference {
                    Reference::Index => Some(Found::Local(Dim::Number, None)),
                    Reference::Argument(position) => {
                        let &(dim, value) = self.place.arguments.get(position)?;
                        Some(Found::Local(dim, value))
                    }
                    Reference::Let(named) => Some(Found::Own(instance?, Definition::Named(named))),
                    Reference::Own(index) => {
                        let declared = &self.instances.of(instance?).declared[index];
                        Some(Found::Own(instance?, declared.item))
                    }
                    Reference::Global(index) => {
                        let global = self.place.file.globals[index].global;
                        Some(Found::Global(match global {
                            Global::Import(import) => import.target().unwrap_or(global),
                            _ => global,
                        }))
                    }
                    Reference::BuiltIn => None,
                }
            }
            ExprKind::Field(base, field) => match self.find(base)? {
                Found::Own(instance, part) => {
                    let (instance, found) = self.instances.field((instance, part), field)?;
                    Some(Found::Own(instance, found))
                }
                Found::Global(Global::Import(module)) => {
                    own(module.file?, &field.name).map(Found::Global)
                }
                _ => None,
            },
            // The members of an array of parts have the same units.
            ExprKind::Index(base, _) => self.find(base),
            _ => None,
        }
    }

    fn builtin_value(&self, expr: &Expr) -> Dim {
        match &expr.kind {
            ExprKind::Name(name) => match name.as_str() {
                "pi" | "inf" | "true" | "false" => Dim::Number,
                "time" if self.place.has_units => Dim::Known(Dimension::TIME),
                _ => Dim::Unknown,
            },
            _ => Dim::Unknown,
        }
    }

    /// The common dimension of expressions that must have one.
    pub fn agree(
        &mut self,
        what: &'static str,
        members: impl IntoIterator<Item = &'f Expr>,
    ) -> Dim {
        let members = members.into_iter();
        let members: Vec<(Dim, Span)> = members
            .map(|member| (self.expr(member), member.span))
            .collect();
        let mut known = members.iter().filter_map(|&(dim, span)| match dim {
            Dim::Known(dimension) => Some((dimension, span)),
            _ => None,
        });
        let Some((first, first_span)) = known.next() else {
            let is_number = members.iter().all(|&(dim, _)| dim == Dim::Number);
            return if is_number { Dim::Number } else { Dim::Unknown };
        };
        match known.find(|&(second, _)| second != first) {
            None => Dim::Known(first),
            Some((second, second_span)) => {
                self.diags.push(UnitError::Different {
                    what,
                    first: is(first),
                    second: is(second),
                    help: factor(first, second),
                    first_span,
                    second_span,
                    call: self.place.call,
                });
                Dim::Unknown
            }
        }
    }

    /// Entries side by side: their dimension where they have one in common.
    fn stack(&mut self, entries: impl Iterator<Item = &'f Expr>) -> Dim {
        let all: Vec<Dim> = entries.map(|entry| self.expr(entry)).collect();
        let mut known = all.iter().filter(|dim| matches!(dim, Dim::Known(_)));
        let first = known.next().copied();
        match first {
            _ if all.contains(&Dim::Unknown) => Dim::Unknown,
            None => Dim::Number,
            Some(first) if known.all(|&dim| dim == first) => first,
            Some(_) => Dim::Unknown,
        }
    }

    fn chain(&mut self, first: &'f Expr, rest: &'f [(BinaryOp, Expr)]) -> Dim {
        let is_sum = matches!(rest.first(), Some((BinaryOp::Add | BinaryOp::Sub, _)));
        if is_sum {
            let terms = std::iter::once(first).chain(rest.iter().map(|(_, term)| term));
            return self.agree("the terms of this sum", terms);
        }
        let mut dim = self.expr(first);
        for (op, factor) in rest {
            let factor = self.expr(factor);
            dim = match op {
                BinaryOp::Div | BinaryOp::ElementDiv => dim.divide(factor),
                _ => dim.multiply(factor),
            };
        }
        dim
    }

    fn power(&mut self, base: &'f Expr, exponent: &'f Expr) -> Dim {
        let dim = self.expr(base);
        let exponent_dim = self.pure("an exponent", exponent);
        if let Some(value) = self.ratio(exponent) {
            return dim.power(value);
        }
        match (dim.unit(), exponent_dim) {
            (Some(unit), Dim::Known(_)) => {
                self.diags.push(UnitError::VariablePower {
                    base: is(unit),
                    base_span: base.span,
                    exponent: exponent.span,
                    call: self.place.call,
                });
                Dim::Unknown
            }
            (Some(_), _) => Dim::Unknown,
            (None, Dim::Known(_)) if dim == Dim::Number => Dim::PURE,
            (None, _) => dim,
        }
    }

    /// The value of an expression of numbers.
    pub fn ratio(&mut self, expr: &'f Expr) -> Option<Ratio> {
        match &expr.kind {
            ExprKind::Number(value) => Ratio::from_number(*value),
            ExprKind::Negate(inner) => self.ratio(inner)?.negate(),
            ExprKind::Name(_) => match self.find(expr)? {
                Found::Local(_, value) => value,
                Found::Own(..) | Found::Global(_) => None,
            },
            ExprKind::Chain(first, rest) => {
                let mut value = self.ratio(first)?;
                for (op, operand) in rest {
                    let operand = self.ratio(operand)?;
                    value = match op {
                        BinaryOp::Add => value.add(operand)?,
                        BinaryOp::Sub => value.add(operand.negate()?)?,
                        BinaryOp::Mul => value.multiply(operand)?,
                        BinaryOp::Div => value.divide(operand)?,
                        _ => return None,
                    };
                }
                Some(value)
            }
            _ => None,
        }
    }

    /// The dimension of an expression; one that is not a pure number is reported.
    pub fn pure(&mut self, what: &str, expr: &'f Expr) -> Dim {
        let dim = self.expr(expr);
        let Some(unit) = dim.unit() else {
            return dim;
        };
        self.diags.push(UnitError::NotPure {
            what: what.to_owned(),
            found: is(unit),
            span: expr.span,
            call: self.place.call,
        });
        Dim::Unknown
    }

    /// The dimension of a call.
    fn call(&mut self, function: &'f Expr, args: &'f [Arg], span: Span) -> Dim {
        if let Some(Found::Global(Global::Function(file, function))) = self.find(function) {
            return self.inline(file, function, args, span);
        }
        match (&function.kind, args) {
            (ExprKind::Name(_), [Arg::Positional(body, binders)]) if !binders.is_empty() => {
                self.expr(body)
            }
            (ExprKind::Name(name), _) => self.builtin(name, args),
            _ => Dim::Unknown,
        }
    }

    /// A function is followed with what it is given.
    fn inline(
        &mut self,
        file: &'f File,
        function: &'f Function,
        args: &'f [Arg],
        span: Span,
    ) -> Dim {
        let mut values = vec![];
        for arg in args {
            if let Arg::Positional(value, _) = arg {
                values.push((self.expr(value), self.ratio(value)));
            }
        }
        let file = self.instances.file(file);
        let place = Place {
            names: Rc::clone(&file.references),
            file,
            instance: None,
            arguments: values,
            has_units: self.place.has_units,
            call: self.place.call.or(Some(span)),
        };
        self.within(place, |dims| dims.expr(&function.body))
    }

    /// Reports a value that does not have the declared dimension.
    pub fn fits(
        &mut self,
        what: String,
        expected: Dim,
        (found, value): (Dim, &Expr),
        declared: Option<Span>,
    ) {
        if let (Dim::Known(expected), Dim::Known(found)) = (expected, found)
            && expected != found
        {
            self.diags.push(UnitError::WrongUnit {
                what,
                expected: is(expected),
                found: is(found),
                help: factor(expected, found),
                span: value.span,
                declared,
            });
        }
    }

    /// [`Inference::fits`] of an expression.
    pub fn expect(&mut self, what: &str, expected: Dim, value: &'f Expr, declared: Option<Span>) {
        let found = self.expr(value);
        self.fits(what.to_owned(), expected, (found, value), declared);
    }
}

/// What a quantity is: "in m/s", "a pure number".
pub(crate) fn is(dimension: Dimension) -> String {
    match dimension {
        Dimension::NUMBER => "a pure number".to_owned(),
        unit => format!("in {unit}"),
    }
}

/// What would make a value fit.
pub(crate) fn factor(expected: Dimension, found: Dimension) -> String {
    match expected.divide(found) {
        Some(missing) if found == Dimension::NUMBER => {
            // A unit behind a number begins with a name.
            let unit = missing.to_string();
            let written = match unit.strip_prefix("1/") {
                Some(below) => format!("2/(1 {below})"),
                None => format!("2 ({unit})"),
            };
            format!(
                "a number in a product is a pure number; write its unit behind it, as in `{written}`, or give the factor a name: `param a : {unit} = ..;`"
            )
        }
        Some(missing) => format!("a factor in {missing} is missing, or one of the units is wrong"),
        None => "one of the units is wrong".to_owned(),
    }
}
