//! Expressions: flat lists of operands and operators -> trees.
//!
//! The grammar has checked where operators stand; here they only get their
//! precedence, loosest first: `or`, `and`, `not`, comparisons, `+ -`, `* /`,
//! unary `-`, powers from right to left, calls and indices.

use nsd_grammar::Rule;
use pest::iterators::Pair;

use super::reading::{Parts, Reading, parts};
use super::statement::unit_of;
use crate::source::Span;
use crate::syntax::ast::*;

/// An `expr` or an `arith`.
pub(crate) fn expr(reading: &mut Reading, pair: Pair<Rule>) -> Expr {
    let mut parts = parts(pair);
    match parts.maybe(Rule::conditional) {
        Some(pair) => conditional(reading, pair),
        None => disjunction(reading, &mut parts),
    }
}

fn conditional(reading: &mut Reading, pair: Pair<Rule>) -> Expr {
    let span = reading.span(&pair);
    let mut branch = parts(pair).map(|pair| Box::new(expr(reading, pair)));
    let mut next = || branch.next().expect("grammar: `if` has three expressions");
    let kind = ExprKind::If(next(), next(), next());
    Expr { kind, span }
}

fn disjunction(reading: &mut Reading, parts: &mut Parts) -> Expr {
    let mut members = vec![conjunction(reading, parts)];
    while parts.maybe(Rule::op_or).is_some() {
        members.push(conjunction(reading, parts));
    }
    list(members, ExprKind::Or)
}

fn conjunction(reading: &mut Reading, parts: &mut Parts) -> Expr {
    let mut members = vec![negation(reading, parts)];
    while parts.maybe(Rule::op_and).is_some() {
        members.push(negation(reading, parts));
    }
    list(members, ExprKind::And)
}

fn negation(reading: &mut Reading, parts: &mut Parts) -> Expr {
    match parts.maybe(Rule::op_not) {
        Some(not) => {
            let inner = negation(reading, parts);
            let span = reading.span(&not).to(inner.span);
            let kind = ExprKind::Not(Box::new(inner));
            Expr { kind, span }
        }
        None => comparison(reading, parts),
    }
}

fn comparison(reading: &mut Reading, parts: &mut Parts) -> Expr {
    let first = sum(reading, parts);
    let mut rest = Vec::new();
    while let Some(comparator) = parts.maybe(Rule::comparator) {
        rest.push((relation(comparator.as_str()), sum(reading, parts)));
    }
    let Some((_, last)) = rest.last() else {
        return first;
    };
    let span = first.span.to(last.span);
    let kind = ExprKind::Compare(Box::new(first), rest);
    Expr { kind, span }
}

fn sum(reading: &mut Reading, parts: &mut Parts) -> Expr {
    let first = product(reading, parts);
    let mut rest = Vec::new();
    while let Some(op) = infix(parts, |op| matches!(op, BinaryOp::Add | BinaryOp::Sub)) {
        rest.push((op, product(reading, parts)));
    }
    chain(first, rest)
}

fn product(reading: &mut Reading, parts: &mut Parts) -> Expr {
    let first = factor(reading, parts);
    let mut rest = Vec::new();
    let multiplies = |op| {
        use BinaryOp::{Div, ElementDiv, ElementMul, Mul};
        matches!(op, Mul | Div | ElementMul | ElementDiv)
    };
    while let Some(op) = infix(parts, multiplies) {
        rest.push((op, factor(reading, parts)));
    }
    chain(first, rest)
}

fn factor(reading: &mut Reading, parts: &mut Parts) -> Expr {
    if let Some(minus) = parts.maybe(Rule::negative) {
        let inner = factor(reading, parts);
        let span = reading.span(&minus).to(inner.span);
        let kind = ExprKind::Negate(Box::new(inner));
        return Expr { kind, span };
    }
    let base = primary(reading, parts);
    match infix(parts, |op| {
        matches!(op, BinaryOp::Pow | BinaryOp::ElementPow)
    }) {
        Some(op) => {
            let exponent = factor(reading, parts);
            let span = base.span.to(exponent.span);
            let kind = ExprKind::Binary(op, Box::new(base), Box::new(exponent));
            Expr { kind, span }
        }
        None => base,
    }
}

fn primary(reading: &mut Reading, parts: &mut Parts) -> Expr {
    let pair = parts.next().expect("grammar: an operator has its operands");
    let mut expr = atom(reading, pair);
    if let Some(unit) = parts.maybe(Rule::literal_unit)
        && let ExprKind::Number(value) = expr.kind
    {
        let unit = unit_of(reading, unit);
        expr = Expr {
            span: expr.span.to(unit.span),
            kind: ExprKind::Quantity(value, unit),
        };
    }
    let start = expr.span;
    loop {
        let (kind, end) = if let Some(call) = parts.maybe(Rule::call) {
            let end = reading.span(&call);
            (ExprKind::Call(Box::new(expr), args(reading, call)), end)
        } else if let Some(index) = parts.maybe(Rule::index) {
            let end = reading.span(&index);
            (
                ExprKind::Index(Box::new(expr), indices(reading, index)),
                end,
            )
        } else if let Some(field) = parts.maybe(Rule::field) {
            let end = reading.span(&field);
            let name = reading.ident(self::parts(field).one(Rule::name));
            (ExprKind::Field(Box::new(expr), name), end)
        } else {
            return expr;
        };
        let span = start.to(end);
        expr = Expr { kind, span };
    }
}

fn atom(reading: &mut Reading, pair: Pair<Rule>) -> Expr {
    let span = reading.span(&pair);
    let text = pair.as_str();
    let kind = match pair.as_rule() {
        // The scan has checked numbers, and that strings have two quotes.
        Rule::number => ExprKind::Number(text.parse().unwrap_or(f64::NAN)),
        Rule::string => ExprKind::String(text.trim_matches('"').to_owned()),
        Rule::name => ExprKind::Name(reading.ident(pair).name),
        Rule::group => {
            // Parentheses leave no trace but in the span.
            let inner = expr(reading, parts(pair).one(Rule::expr));
            return Expr { span, ..inner };
        }
        Rule::matrix => matrix(reading, pair),
        rule => unreachable!("grammar: {rule:?} is no operand"),
    };
    Expr { kind, span }
}

fn matrix(reading: &mut Reading, pair: Pair<Rule>) -> ExprKind {
    let mut rows = vec![Vec::new()];
    let mut binders = Vec::new();
    let mut breaks = 0;
    for part in parts(pair) {
        match part.as_rule() {
            Rule::binder => binders.push(binder(reading, part)),
            Rule::row_break => {
                breaks += 1;
                rows.push(Vec::new());
            }
            _ => {
                let entry = expr(reading, part);
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

fn args(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Arg> {
    let arg = |pair: Pair<Rule>| {
        let named = pair.as_rule() == Rule::named_arg;
        let mut parts = parts(pair);
        match named {
            true => Arg::Named(
                reading.ident(parts.one(Rule::name)),
                expr(reading, parts.one(Rule::expr)),
            ),
            false => {
                let value = expr(reading, parts.one(Rule::expr));
                Arg::Positional(value, parts.map(|pair| binder(reading, pair)).collect())
            }
        }
    };
    parts(pair).map(arg).collect()
}

pub(crate) fn indices(reading: &mut Reading, pair: Pair<Rule>) -> Vec<Index> {
    let index = |pair: Pair<Rule>| {
        let span = reading.span(&pair);
        let mut parts = parts(pair);
        if parts.maybe(Rule::colon).is_some() {
            return Index::All(span);
        }
        let first = expr(reading, parts.one(Rule::arith));
        match parts.maybe(Rule::arith) {
            Some(last) => Index::Range(first, expr(reading, last)),
            None => Index::One(first),
        }
    };
    parts(pair).map(index).collect()
}

pub(crate) fn binder(reading: &mut Reading, pair: Pair<Rule>) -> Binder {
    let mut parts = parts(pair);
    Binder {
        name: reading.ident(parts.one(Rule::name)),
        first: expr(reading, parts.one(Rule::arith)),
        last: expr(reading, parts.one(Rule::arith)),
    }
}

/// A `path`.
pub(crate) fn path(reading: &mut Reading, pair: Pair<Rule>) -> Path {
    let span = reading.span(&pair);
    let mut parts = parts(pair);
    let head = reading.ident(parts.one(Rule::name));
    let segment = |pair: Pair<Rule>| match pair.as_rule() {
        Rule::field => Segment::Field(reading.ident(self::parts(pair).one(Rule::name))),
        _ => Segment::Index(indices(reading, pair)),
    };
    let rest = parts.map(segment).collect();
    Path { head, rest, span }
}

/// The relation that is written `text`.
pub(crate) fn relation(text: &str) -> Relation {
    match text {
        "<" => Relation::Less,
        "<=" => Relation::LessEqual,
        ">" => Relation::Greater,
        ">=" => Relation::GreaterEqual,
        "perp" => Relation::Perp,
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
