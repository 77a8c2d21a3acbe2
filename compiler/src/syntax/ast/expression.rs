//! Expressions.
//!
//! Trees are at most [`MAX_DEPTH`](crate::syntax::MAX_DEPTH) deep, so recursion over them is safe.

use super::{Binder, Ident, Relation, Unit};
use crate::source::Span;

/// An expression.
#[derive(Clone, Debug, PartialEq)]
pub struct Expr {
    /// Which one.
    pub kind: ExprKind,
    /// Where it stands.
    pub span: Span,
}

/// The expressions.
#[derive(Clone, Debug, PartialEq)]
pub enum ExprKind {
    /// `2.5`
    Number(f64),
    /// `20 kHz`: a number of units, which are not converted yet
    Quantity(f64, Unit),
    /// `"data.csv"`
    String(String),
    /// `x`
    Name(String),
    /// `b.force`
    Field(Box<Expr>, Ident),
    /// `x[2]`, `A[:, 2]`
    Index(Box<Expr>, Vec<Index>),
    /// `f(x, fit = cubic)`
    Call(Box<Expr>, Vec<Arg>),
    /// `[a, b; c, d]`
    Matrix(Matrix),
    /// `[expr for i in 1..n]`
    Comprehension(Box<Expr>, Vec<Binder>),
    /// `-x`
    Negate(Box<Expr>),
    /// `a ^ b`, `a .^ b`
    Binary(BinaryOp, Box<Expr>, Box<Expr>),
    /// `a + b - c` or `a * b / c`, applied from left to right: operators of one
    /// level side by side, so that a long sum is not a deep tree. Never empty.
    Chain(Box<Expr>, Vec<(BinaryOp, Expr)>),
    /// `-1 < x < 1`
    Compare(Box<Expr>, Vec<(Relation, Expr)>),
    /// `not c`
    Not(Box<Expr>),
    /// `a and b and c`; at least two
    And(Vec<Expr>),
    /// `a or b or c`; at least two
    Or(Vec<Expr>),
    /// `if c then a else b`
    If(Box<Expr>, Box<Expr>, Box<Expr>),
}

/// `[a, b]` is a column, `[a, b; c, d]` a matrix, `[a, b;]` a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// Rows between semicolons.
    pub rows: Vec<Vec<Expr>>,
    /// True when a semicolon was written.
    pub semicolons: bool,
}

/// An index in brackets.
#[derive(Clone, Debug, PartialEq)]
pub enum Index {
    /// `:`
    All(Span),
    /// `2`
    One(Expr),
    /// `1..3`
    Range(Expr, Expr),
}

/// An argument of a call.
#[derive(Clone, Debug, PartialEq)]
pub enum Arg {
    /// `fit = cubic`
    Named(Ident, Expr),
    /// `x`, or `x for i in 1..n` in a reduction.
    Positional(Expr, Vec<Binder>),
}

/// Binary operators.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BinaryOp {
    /// `+`
    Add,
    /// `-`
    Sub,
    /// `*`: matrix product or scaling
    Mul,
    /// `/`
    Div,
    /// `^`
    Pow,
    /// `.*`
    ElementMul,
    /// `./`
    ElementDiv,
    /// `.^`
    ElementPow,
}

impl Expr {
    /// Whether it is `0` as written.
    pub fn is_zero(&self) -> bool {
        matches!(
            self.kind,
            ExprKind::Number(0.0) | ExprKind::Quantity(0.0, _)
        )
    }

    /// Looks at the expressions directly inside, in order; at the bounds of indices before what they hold in.
    pub fn each<'a>(&'a self, look: &mut dyn FnMut(&'a Expr)) {
        match &self.kind {
            ExprKind::Number(_) | ExprKind::Quantity(..) => {}
            ExprKind::String(_) | ExprKind::Name(_) => {}
            ExprKind::Field(inner, _) | ExprKind::Negate(inner) | ExprKind::Not(inner) => {
                look(inner);
            }
            ExprKind::Index(base, indices) => {
                look(base);
                for index in indices {
                    match index {
                        Index::All(_) => {}
                        Index::One(one) => look(one),
                        Index::Range(first, last) => [first, last].into_iter().for_each(&mut *look),
                    }
                }
            }
            ExprKind::Call(function, args) => {
                look(function);
                for arg in args {
                    match arg {
                        Arg::Named(_, value) => look(value),
                        Arg::Positional(value, binders) => {
                            each_bound(binders, look);
                            look(value);
                        }
                    }
                }
            }
            ExprKind::Matrix(matrix) => matrix.rows.iter().flatten().for_each(look),
            ExprKind::Comprehension(body, binders) => {
                each_bound(binders, look);
                look(body);
            }
            ExprKind::Binary(_, a, b) => [a, b].into_iter().for_each(|side| look(side)),
            ExprKind::Chain(first, rest) => {
                look(first);
                rest.iter().for_each(|(_, operand)| look(operand));
            }
            ExprKind::Compare(first, rest) => {
                look(first);
                rest.iter().for_each(|(_, member)| look(member));
            }
            ExprKind::And(members) | ExprKind::Or(members) => members.iter().for_each(look),
            ExprKind::If(c, a, b) => [c, a, b].into_iter().for_each(|inner| look(inner)),
        }
    }

    /// Looks at this expression, and then at all inside, in order.
    pub fn visit<'a>(&'a self, look: &mut dyn FnMut(&'a Expr)) {
        look(self);
        self.each(&mut |inner| inner.visit(look));
    }

    /// Whether a name stands in this expression and is not that of an index inside.
    pub fn reads(&self, name: &str) -> bool {
        match &self.kind {
            ExprKind::Name(own) => own == name,
            ExprKind::Comprehension(body, binders) => reads_within(binders, body, name),
            ExprKind::Call(function, args) => {
                let reads = |arg: &Arg| match arg {
                    Arg::Named(_, value) => value.reads(name),
                    Arg::Positional(value, binders) => reads_within(binders, value, name),
                };
                function.reads(name) || args.iter().any(reads)
            }
            _ => {
                let mut found = false;
                self.each(&mut |inner| found |= inner.reads(name));
                found
            }
        }
    }
}

fn reads_within(binders: &[Binder], body: &Expr, name: &str) -> bool {
    for binder in binders {
        if binder.first.reads(name) || binder.last.reads(name) {
            return true;
        }
        if binder.name.name == name {
            return false;
        }
    }
    body.reads(name)
}

fn each_bound<'a>(binders: &'a [Binder], look: &mut dyn FnMut(&'a Expr)) {
    let bounds = binders
        .iter()
        .flat_map(|binder| [&binder.first, &binder.last]);
    bounds.for_each(look);
}
