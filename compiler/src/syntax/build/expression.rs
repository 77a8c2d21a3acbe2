//! Expressions: flat lists of operands and operators -> trees.
//!
//! The grammar has checked where operators stand; here they only get their
//! precedence, loosest first: `or`, `and`, `not`, comparisons, `+ -`, `* /`,
//! unary `-`, powers from right to left, calls and indices.

use nsd_grammar::Rule;
use pest::iterators::Pair;

use super::{Builder, Parts, parts};
use crate::source::Span;
use crate::syntax::ast::*;

impl Builder<'_> {
    /// An `expr` or an `arith`.
    pub(super) fn expr(&mut self, pair: Pair<Rule>) -> Expr {
        let mut parts = parts(pair);
        match parts.maybe(Rule::conditional) {
            Some(conditional) => self.conditional(conditional),
            None => self.disjunction(&mut parts),
        }
    }

    fn conditional(&mut self, pair: Pair<Rule>) -> Expr {
        let span = self.span(&pair);
        let mut branch = parts(pair).map(|pair| Box::new(self.expr(pair)));
        let mut next = || branch.next().expect("grammar: `if` has three expressions");
        let kind = ExprKind::If(next(), next(), next());
        Expr { kind, span }
    }

    fn disjunction(&mut self, parts: &mut Parts) -> Expr {
        let mut members = vec![self.conjunction(parts)];
        while parts.maybe(Rule::op_or).is_some() {
            members.push(self.conjunction(parts));
        }
        list(members, ExprKind::Or)
    }

    fn conjunction(&mut self, parts: &mut Parts) -> Expr {
        let mut members = vec![self.negation(parts)];
        while parts.maybe(Rule::op_and).is_some() {
            members.push(self.negation(parts));
        }
        list(members, ExprKind::And)
    }

    fn negation(&mut self, parts: &mut Parts) -> Expr {
        match parts.maybe(Rule::op_not) {
            Some(not) => {
                let inner = self.negation(parts);
                let span = self.span(&not).to(inner.span);
                let kind = ExprKind::Not(Box::new(inner));
                Expr { kind, span }
            }
            None => self.comparison(parts),
        }
    }

    fn comparison(&mut self, parts: &mut Parts) -> Expr {
        let first = self.sum(parts);
        let mut rest = Vec::new();
        while let Some(comparator) = parts.maybe(Rule::comparator) {
            rest.push((relation(comparator.as_str()), self.sum(parts)));
        }
        let Some((_, last)) = rest.last() else {
            return first;
        };
        let span = first.span.to(last.span);
        let kind = ExprKind::Compare(Box::new(first), rest);
        Expr { kind, span }
    }

    fn sum(&mut self, parts: &mut Parts) -> Expr {
        let first = self.product(parts);
        let mut rest = Vec::new();
        while let Some(op) = infix(parts, |op| matches!(op, BinaryOp::Add | BinaryOp::Sub)) {
            rest.push((op, self.product(parts)));
        }
        chain(first, rest)
    }

    fn product(&mut self, parts: &mut Parts) -> Expr {
        let first = self.factor(parts);
        let mut rest = Vec::new();
        let multiplies = |op| {
            use BinaryOp::{Div, ElementDiv, ElementMul, Mul};
            matches!(op, Mul | Div | ElementMul | ElementDiv)
        };
        while let Some(op) = infix(parts, multiplies) {
            rest.push((op, self.factor(parts)));
        }
        chain(first, rest)
    }

    fn factor(&mut self, parts: &mut Parts) -> Expr {
        if let Some(minus) = parts.maybe(Rule::negative) {
            let inner = self.factor(parts);
            let span = self.span(&minus).to(inner.span);
            let kind = ExprKind::Negate(Box::new(inner));
            return Expr { kind, span };
        }
        let base = self.primary(parts);
        match infix(parts, |op| {
            matches!(op, BinaryOp::Pow | BinaryOp::ElementPow)
        }) {
            Some(op) => {
                let exponent = self.factor(parts);
                let span = base.span.to(exponent.span);
                let kind = ExprKind::Binary(op, Box::new(base), Box::new(exponent));
                Expr { kind, span }
            }
            None => base,
        }
    }

    fn primary(&mut self, parts: &mut Parts) -> Expr {
        let atom = parts.next().expect("grammar: an operator has its operands");
        let mut expr = self.atom(atom);
        let start = expr.span;
        loop {
            let (kind, end) = if let Some(call) = parts.maybe(Rule::call) {
                let end = self.span(&call);
                (ExprKind::Call(Box::new(expr), self.args(call)), end)
            } else if let Some(index) = parts.maybe(Rule::index) {
                let end = self.span(&index);
                (ExprKind::Index(Box::new(expr), self.indices(index)), end)
            } else if let Some(field) = parts.maybe(Rule::field) {
                let end = self.span(&field);
                let name = self.ident(self::parts(field).one(Rule::name));
                (ExprKind::Field(Box::new(expr), name), end)
            } else {
                return expr;
            };
            let span = start.to(end);
            expr = Expr { kind, span };
        }
    }

    fn atom(&mut self, pair: Pair<Rule>) -> Expr {
        let span = self.span(&pair);
        let text = pair.as_str();
        let kind = match pair.as_rule() {
            // The scan has checked numbers, and that strings have two quotes.
            Rule::number => ExprKind::Number(text.parse().unwrap_or(f64::NAN)),
            Rule::string => ExprKind::String(text.trim_matches('"').to_owned()),
            Rule::name => ExprKind::Name(self.ident(pair).name),
            Rule::group => {
                // Parentheses leave no trace but in the span.
                let inner = self.expr(parts(pair).one(Rule::expr));
                return Expr { span, ..inner };
            }
            Rule::matrix => self.matrix(pair),
            rule => unreachable!("grammar: {rule:?} is no operand"),
        };
        Expr { kind, span }
    }

    fn matrix(&mut self, pair: Pair<Rule>) -> ExprKind {
        let mut rows = vec![Vec::new()];
        let mut binders = Vec::new();
        let mut breaks = 0;
        for part in parts(pair) {
            match part.as_rule() {
                Rule::binder => binders.push(self.binder(part)),
                Rule::row_break => {
                    breaks += 1;
                    rows.push(Vec::new());
                }
                _ => {
                    let entry = self.expr(part);
                    if let Some(row) = rows.last_mut() {
                        row.push(entry);
                    }
                }
            }
        }
        // `[a, b;]`: the last semicolon only says that this is a row.
        rows.retain(|row| !row.is_empty());
        match binders.is_empty() {
            true => ExprKind::Matrix(Matrix {
                rows,
                semicolons: breaks > 0,
            }),
            false => {
                let body = rows.pop().and_then(|mut row| row.pop());
                let body = body.expect("grammar: a comprehension has one expression");
                ExprKind::Comprehension(Box::new(body), binders)
            }
        }
    }

    fn args(&mut self, pair: Pair<Rule>) -> Vec<Arg> {
        let arg = |pair: Pair<Rule>| {
            let named = pair.as_rule() == Rule::named_arg;
            let mut parts = parts(pair);
            match named {
                true => Arg::Named(
                    self.ident(parts.one(Rule::name)),
                    self.expr(parts.one(Rule::expr)),
                ),
                false => {
                    let value = self.expr(parts.one(Rule::expr));
                    Arg::Positional(value, parts.map(|binder| self.binder(binder)).collect())
                }
            }
        };
        parts(pair).map(arg).collect()
    }

    pub(super) fn indices(&mut self, pair: Pair<Rule>) -> Vec<Index> {
        let index = |pair: Pair<Rule>| {
            let span = self.span(&pair);
            let mut parts = parts(pair);
            if parts.maybe(Rule::colon).is_some() {
                return Index::All(span);
            }
            let first = self.expr(parts.one(Rule::arith));
            match parts.maybe(Rule::arith) {
                Some(last) => Index::Range(first, self.expr(last)),
                None => Index::One(first),
            }
        };
        parts(pair).map(index).collect()
    }

    pub(super) fn binder(&mut self, pair: Pair<Rule>) -> Binder {
        let mut parts = parts(pair);
        Binder {
            name: self.ident(parts.one(Rule::name)),
            first: self.expr(parts.one(Rule::arith)),
            last: self.expr(parts.one(Rule::arith)),
        }
    }
}

/// The relation that is written `text`.
pub(super) fn relation(text: &str) -> Relation {
    match text {
        "<" => Relation::Less,
        "<=" => Relation::LessEqual,
        ">" => Relation::Greater,
        ">=" => Relation::GreaterEqual,
        _ => Relation::Equal,
    }
}

/// The next infix operator, where it is of the level that `accept` names.
fn infix(parts: &mut Parts, accept: impl Fn(BinaryOp) -> bool) -> Option<BinaryOp> {
    let pair = parts
        .0
        .peek()
        .filter(|pair| pair.as_rule() == Rule::infix)?;
    let op = match pair.as_str() {
        "+" => BinaryOp::Add,
        "-" => BinaryOp::Sub,
        "*" => BinaryOp::Mul,
        "/" => BinaryOp::Div,
        "^" => BinaryOp::Pow,
        ".*" => BinaryOp::ElementMul,
        "./" => BinaryOp::ElementDiv,
        _ => BinaryOp::ElementPow,
    };
    if !accept(op) {
        return None;
    }
    parts.next();
    Some(op)
}

fn chain(first: Expr, rest: Vec<(BinaryOp, Expr)>) -> Expr {
    let Some((_, last)) = rest.last() else {
        return first;
    };
    let span: Span = first.span.to(last.span);
    let kind = ExprKind::Chain(Box::new(first), rest);
    Expr { kind, span }
}

fn list(mut members: Vec<Expr>, kind: fn(Vec<Expr>) -> ExprKind) -> Expr {
    match (members.len(), members.pop()) {
        (1, Some(only)) => only,
        (_, Some(last)) => {
            members.push(last);
            let span = members[0].span.to(members[members.len() - 1].span);
            let kind = kind(members);
            Expr { kind, span }
        }
        (_, None) => unreachable!("a list of operands is never empty"),
    }
}
