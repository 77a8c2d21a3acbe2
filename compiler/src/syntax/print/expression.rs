//! Expressions, with parentheses only where precedence asks for them.

use std::fmt::Write;

use super::join;
use crate::syntax::ast::*;

/// How tightly an expression holds together, loosest first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Conditional,
    Or,
    And,
    Not,
    Compare,
    Sum,
    Product,
    Negate,
    Power,
    Atom,
}

/// Any expression.
pub(super) fn text(expr: &Expr) -> String {
    at_level(expr, Level::Conditional)
}

/// An expression where neither logic nor comparisons may stand.
pub(super) fn arith(expr: &Expr) -> String {
    at_level(expr, Level::Sum)
}

pub(super) fn indices(indices: &[Index]) -> String {
    let index = |index: &Index| match index {
        Index::All(_) => ":".to_owned(),
        Index::One(index) => arith(index),
        Index::Range(first, last) => format!("{}..{}", arith(first), arith(last)),
    };
    join(indices.iter().map(index), ", ")
}

pub(super) fn binders(binders: &[Binder]) -> String {
    let binder = |binder: &Binder| {
        format!(
            "{} in {}..{}",
            binder.name,
            arith(&binder.first),
            arith(&binder.last)
        )
    };
    join(binders.iter().map(binder), ", ")
}

pub(super) fn relation(relation: Relation) -> &'static str {
    match relation {
        Relation::Less => "<",
        Relation::LessEqual => "<=",
        Relation::Greater => ">",
        Relation::GreaterEqual => ">=",
        Relation::Equal => "=",
    }
}

fn at_level(expr: &Expr, level: Level) -> String {
    let mut out = String::new();
    write(&mut out, expr, level);
    out
}

fn level(expr: &Expr) -> Level {
    match &expr.kind {
        ExprKind::If(..) => Level::Conditional,
        ExprKind::Or(_) => Level::Or,
        ExprKind::And(_) => Level::And,
        ExprKind::Not(_) => Level::Not,
        ExprKind::Compare(..) => Level::Compare,
        ExprKind::Chain(_, rest) => match rest.first() {
            Some((BinaryOp::Add | BinaryOp::Sub, _)) => Level::Sum,
            _ => Level::Product,
        },
        ExprKind::Negate(_) => Level::Negate,
        ExprKind::Binary(..) => Level::Power,
        _ => Level::Atom,
    }
}

fn write(out: &mut String, expr: &Expr, least: Level) {
    if level(expr) < least {
        out.push('(');
        write_kind(out, expr);
        out.push(')');
    } else {
        write_kind(out, expr);
    }
}

fn write_kind(out: &mut String, expr: &Expr) {
    match &expr.kind {
        ExprKind::Number(value) => out.push_str(&number(*value)),
        ExprKind::String(text) => {
            let _ = write!(out, "\"{text}\"");
        }
        ExprKind::Name(name) => out.push_str(name),
        ExprKind::Field(base, name) => {
            // `2.x` would be a malformed number.
            match base.kind {
                ExprKind::Number(_) => {
                    let _ = write!(out, "({base})");
                }
                _ => write(out, base, Level::Atom),
            }
            let _ = write!(out, ".{name}");
        }
        ExprKind::Index(base, list) => {
            write(out, base, Level::Atom);
            let _ = write!(out, "[{}]", indices(list));
        }
        ExprKind::Call(function, args) => {
            write(out, function, Level::Atom);
            let _ = write!(out, "({})", join(args.iter().map(arg), ", "));
        }
        ExprKind::Matrix(matrix) => {
            let rows = matrix.rows.iter().map(|row| super::list(row));
            let end = if matrix.semicolons && matrix.rows.len() == 1 {
                ";"
            } else {
                ""
            };
            let _ = write!(out, "[{}{end}]", join(rows, "; "));
        }
        ExprKind::Comprehension(body, list) => {
            let _ = write!(out, "[{body} for {}]", binders(list));
        }
        ExprKind::Negate(inner) => {
            out.push('-');
            write(out, inner, Level::Negate);
        }
        ExprKind::Binary(op, base, exponent) => {
            write(out, base, Level::Atom);
            out.push_str(operator(*op));
            write(out, exponent, Level::Negate);
        }
        ExprKind::Chain(first, rest) => {
            let operands = match level(expr) {
                Level::Sum => Level::Product,
                _ => Level::Negate,
            };
            write(out, first, operands);
            for (op, operand) in rest {
                out.push_str(operator(*op));
                write(out, operand, operands);
            }
        }
        ExprKind::Compare(first, rest) => {
            write(out, first, Level::Sum);
            for (op, operand) in rest {
                let _ = write!(out, " {} ", relation(*op));
                write(out, operand, Level::Sum);
            }
        }
        ExprKind::Not(inner) => {
            out.push_str("not ");
            write(out, inner, Level::Not);
        }
        ExprKind::And(members) => separated(out, members, " and ", Level::Not),
        ExprKind::Or(members) => separated(out, members, " or ", Level::And),
        ExprKind::If(condition, then, otherwise) => {
            out.push_str("if ");
            write(out, condition, Level::Conditional);
            out.push_str(" then ");
            write(out, then, Level::Conditional);
            out.push_str(" else ");
            write(out, otherwise, Level::Conditional);
        }
    }
}

fn separated(out: &mut String, members: &[Expr], separator: &str, least: Level) {
    for (position, member) in members.iter().enumerate() {
        if position > 0 {
            out.push_str(separator);
        }
        write(out, member, least);
    }
}

fn arg(arg: &Arg) -> String {
    match arg {
        Arg::Named(name, value) => format!("{name} = {value}"),
        Arg::Positional(value, list) if list.is_empty() => value.to_string(),
        Arg::Positional(value, list) => format!("{value} for {}", binders(list)),
    }
}

fn operator(op: BinaryOp) -> &'static str {
    match op {
        BinaryOp::Add => " + ",
        BinaryOp::Sub => " - ",
        BinaryOp::Mul => "*",
        BinaryOp::Div => "/",
        BinaryOp::Pow => "^",
        BinaryOp::ElementMul => ".*",
        BinaryOp::ElementDiv => "./",
        BinaryOp::ElementPow => ".^",
    }
}

/// The shortest text that reads back as the same number.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
