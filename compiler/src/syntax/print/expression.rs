//! Expressions, with parentheses only where precedence asks for them.

use super::join;
use crate::syntax::ast::*;

/// How tightly an expression holds together, loosest first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Level {
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

/// The text of a name, where it is not the name itself.
pub(crate) type Names<'w> = dyn Fn(&str) -> Option<String> + 'w;

/// How expressions are written.
#[derive(Clone, Copy)]
pub(crate) struct Writer<'w> {
    /// What stands for names in a text that people read; none where it must read back as the same tree.
    pub names: Option<&'w Names<'w>>,
}

/// Text for the parser.
const SOURCE: Writer<'static> = Writer { names: None };

/// Any expression.
pub(super) fn text(expr: &Expr) -> String {
    SOURCE.text(expr)
}

/// An expression where neither logic nor comparisons may stand.
pub(super) fn arith(expr: &Expr) -> String {
    SOURCE.at_level(expr, Level::Sum)
}

pub(super) fn indices(indices: &[Index]) -> String {
    SOURCE.indices(indices)
}

pub(super) fn binders(binders: &[Binder]) -> String {
    SOURCE.binders(binders)
}

pub(super) fn relation(relation: Relation) -> &'static str {
    match relation {
        Relation::Less => "<",
        Relation::LessEqual => "<=",
        Relation::Greater => ">",
        Relation::GreaterEqual => ">=",
        Relation::Equal => "=",
        Relation::Perp => "perp",
    }
}

impl Writer<'_> {
    /// Any expression.
    pub fn text(self, expr: &Expr) -> String {
        self.at_level(expr, Level::Conditional)
    }

    /// An expression, in parentheses unless it holds together as tightly as this.
    pub fn at_level(self, expr: &Expr, least: Level) -> String {
        let (text, level) = self.plain(expr);
        if level < least {
            format!("({text})")
        } else {
            text
        }
    }

    pub fn indices(self, indices: &[Index]) -> String {
        let index = |index: &Index| match index {
            Index::All(_) => ":".to_owned(),
            Index::One(index) => self.bound(index),
            Index::Range(first, last) => format!("{}..{}", self.bound(first), self.bound(last)),
        };
        let separator = self.names.map_or(", ", |_| ",");
        join(indices.iter().map(index), separator)
    }

    fn binders(self, binders: &[Binder]) -> String {
        let binder = |binder: &Binder| {
            let (first, last) = (self.bound(&binder.first), self.bound(&binder.last));
            format!("{} in {first}..{last}", binder.name)
        };
        join(binders.iter().map(binder), ", ")
    }

    /// An index or the end of a range.
    fn bound(self, expr: &Expr) -> String {
        let level = self.names.map_or(Level::Sum, |_| Level::Conditional);
        self.at_level(expr, level)
    }

    fn list(self, members: &[Expr], separator: &str, least: Level) -> String {
        let members = members.iter().map(|member| self.at_level(member, least));
        join(members, separator)
    }

    fn plain(self, expr: &Expr) -> (String, Level) {
        let sub = |expr: &Expr, level| self.at_level(expr, level);
        // What is read back must say which of two signs or powers is inside.
        let signed = self.names.map_or(Level::Negate, |_| Level::Power);
        match &expr.kind {
            ExprKind::Number(value) => (self.number(*value), Level::Atom),
            // Behind `5 m`, a `/` would go on with the unit.
            ExprKind::Quantity(value, unit) => {
                (format!("{} {unit}", self.number(*value)), Level::Product)
            }
            ExprKind::String(text) => (format!("\"{text}\""), Level::Atom),
            ExprKind::Name(name) => self.name(name),
            ExprKind::Field(base, name) => {
                let base = match base.kind {
                    // `2.x` would be a malformed number.
                    ExprKind::Number(value) => format!("({})", self.number(value)),
                    _ => sub(base, Level::Atom),
                };
                (format!("{base}.{name}"), Level::Atom)
            }
            ExprKind::Index(base, indices) => {
                let (base, indices) = (sub(base, Level::Atom), self.indices(indices));
                (format!("{base}[{indices}]"), Level::Atom)
            }
            ExprKind::Call(function, args) => {
                let args = join(args.iter().map(|arg| self.arg(arg)), ", ");
                (
                    format!("{}({args})", sub(function, Level::Atom)),
                    Level::Atom,
                )
            }
            ExprKind::Matrix(matrix) => {
                let rows = matrix.rows.iter();
                let rows = rows.map(|row| self.list(row, ", ", Level::Conditional));
                let is_row = matrix.semicolons && matrix.rows.len() == 1;
                let end = if is_row { ";" } else { "" };
                (format!("[{}{end}]", join(rows, "; ")), Level::Atom)
            }
            ExprKind::Comprehension(body, binders) => {
                let (body, binders) = (self.text(body), self.binders(binders));
                (format!("[{body} for {binders}]"), Level::Atom)
            }
            ExprKind::Negate(inner) => (format!("-{}", sub(inner, signed)), Level::Negate),
            ExprKind::Binary(op, base, exponent) => {
                let (base, exponent) = (sub(base, Level::Atom), sub(exponent, signed));
                (
                    format!("{base}{}{exponent}", self.operator(*op)),
                    Level::Power,
                )
            }
            ExprKind::Chain(first, rest) => self.chain(first, rest),
            ExprKind::Compare(first, rest) => {
                let mut text = sub(first, Level::Sum);
                for (op, operand) in rest {
                    text += &format!(" {} {}", relation(*op), sub(operand, Level::Sum));
                }
                (text, Level::Compare)
            }
            ExprKind::Not(inner) => (format!("not {}", sub(inner, Level::Not)), Level::Not),
            ExprKind::And(members) => (self.list(members, " and ", Level::Not), Level::And),
            ExprKind::Or(members) => (self.list(members, " or ", Level::And), Level::Or),
            ExprKind::If(condition, a, b) => {
                let (condition, a, b) = (self.text(condition), self.text(a), self.text(b));
                let text = format!("if {condition} then {a} else {b}");
                (text, Level::Conditional)
            }
        }
    }

    fn chain(self, first: &Expr, rest: &[(BinaryOp, Expr)]) -> (String, Level) {
        let (level, operands) = match rest.first() {
            Some((BinaryOp::Add | BinaryOp::Sub, _)) => (Level::Sum, Level::Product),
            _ => (Level::Product, Level::Negate),
        };
        // People need no parentheses around a sum that a sum begins with.
        let mut text = self.at_level(first, self.names.map_or(operands, |_| level));
        for (op, operand) in rest {
            text += self.operator(*op);
            text += &self.at_level(operand, operands);
        }
        (text, level)
    }

    fn name(self, name: &str) -> (String, Level) {
        match self.names.and_then(|names| names(name)) {
            Some(text) => {
                let is_name = |c: char| c.is_alphanumeric() || "_[],.".contains(c);
                let is_simple = text.chars().all(is_name);
                (
                    text,
                    if is_simple {
                        Level::Atom
                    } else {
                        Level::Conditional
                    },
                )
            }
            None => (name.to_owned(), Level::Atom),
        }
    }

    fn arg(self, arg: &Arg) -> String {
        match arg {
            Arg::Named(name, value) => format!("{name} = {}", self.text(value)),
            Arg::Positional(value, list) if list.is_empty() => self.text(value),
            Arg::Positional(value, list) => {
                format!("{} for {}", self.text(value), self.binders(list))
            }
        }
    }

    fn operator(self, op: BinaryOp) -> &'static str {
        let tight = self.names.is_none();
        match op {
            BinaryOp::Add => " + ",
            BinaryOp::Sub => " - ",
            BinaryOp::Mul => "*",
            BinaryOp::Div => "/",
            BinaryOp::Pow => "^",
            BinaryOp::ElementMul if tight => ".*",
            BinaryOp::ElementDiv if tight => "./",
            BinaryOp::ElementPow if tight => ".^",
            BinaryOp::ElementMul => " .* ",
            BinaryOp::ElementDiv => " ./ ",
            BinaryOp::ElementPow => " .^ ",
        }
    }

    /// A number in full, or the shortest text that reads back as the same number.
    fn number(self, value: f64) -> String {
        if self.names.is_some() {
            return value.to_string();
        }
        let text = format!("{value:?}");
        text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
    }
}
