//! Expressions back to text, with loop indices and arguments put in: the names of surfaces.

use crate::model::expressions::{Local, Lowering};
use crate::syntax::{Arg, BinaryOp, Binder, Expr, ExprKind, Index, Path, Relation, Segment};

/// Binding strength, loosest first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Any,
    Or,
    And,
    Not,
    Compare,
    Sum,
    Product,
    Unary,
    Power,
    Atom,
}

/// The text of an expression; `local` gives the text of local names.
pub(crate) fn text(expr: &Expr, local: &dyn Fn(&str) -> Option<String>) -> String {
    write(expr, Level::Any, local)
}

/// The text, in parentheses unless it can be a factor of anything.
pub(crate) fn atom(expr: &Expr, local: &dyn Fn(&str) -> Option<String>) -> String {
    write(expr, Level::Atom, local)
}

/// The text as the first term of a difference.
pub(crate) fn term(expr: &Expr, local: &dyn Fn(&str) -> Option<String>) -> String {
    write(expr, Level::Sum, local)
}

/// The text as what a difference takes away.
pub(crate) fn operand(expr: &Expr, local: &dyn Fn(&str) -> Option<String>) -> String {
    write(expr, Level::Product, local)
}

/// `[1,2..3,:]`
pub(crate) fn brackets(indices: &[Index], local: &dyn Fn(&str) -> Option<String>) -> String {
    let indices: Vec<String> = indices
        .iter()
        .map(|index| index_text(index, local))
        .collect();
    format!("[{}]", indices.join(","))
}

impl Lowering<'_, '_> {
    /// The text of an expression, with the current indices and arguments in it.
    pub fn text(&self, expr: &Expr) -> String {
        text(expr, &|name| self.local_text(name))
    }

    /// [`Lowering::text`] as a factor.
    pub fn atom_text(&self, expr: &Expr) -> String {
        atom(expr, &|name| self.local_text(name))
    }

    /// [`Lowering::text`] with names as the whole knows them: `a.v` for `v` in part `a`.
    pub fn whole_text(&self, expr: &Expr) -> String {
        text(expr, &|name| self.whole_name(name))
    }

    /// [`Lowering::whole_text`] as a factor.
    pub fn whole_atom_text(&self, expr: &Expr) -> String {
        atom(expr, &|name| self.whole_name(name))
    }

    /// [`Lowering::whole_text`] as the first term of a difference.
    pub fn whole_sum_text(&self, expr: &Expr) -> String {
        term(expr, &|name| self.whole_name(name))
    }

    /// [`Lowering::whole_text`] as what a difference takes away.
    pub fn whole_operand_text(&self, expr: &Expr) -> String {
        operand(expr, &|name| self.whole_name(name))
    }

    fn whole_name(&self, name: &str) -> Option<String> {
        let is_own = || !self.in_function && self.scope.own(name).is_some();
        let is_let = self.locals.iter().any(|local| local.name() == name);
        self.local_text(name).or_else(|| {
            (!self.scope.prefix.is_empty() && !is_let && is_own())
                .then(|| format!("{}{name}", self.scope.prefix))
        })
    }

    /// A path as written, with the current indices in it.
    pub fn path_text(&self, path: &Path) -> String {
        let local = |name: &str| self.local_text(name);
        path.rest
            .iter()
            .fold(path.head.name.clone(), |text, segment| match segment {
                Segment::Field(field) => format!("{text}.{}", field.name),
                Segment::Index(indices) => {
                    format!("{text}{}", brackets(indices, &local))
                }
            })
    }

    fn local_text(&self, name: &str) -> Option<String> {
        self.locals
            .iter()
            .rev()
            .find(|local| local.name() == name)
            .and_then(|local| match local {
                Local::Value { text, .. } => Some(text.clone()),
                Local::Let { .. } => None,
            })
    }
}

fn write(expr: &Expr, at_least: Level, local: &dyn Fn(&str) -> Option<String>) -> String {
    let (text, level) = plain(expr, local);
    if level < at_least {
        format!("({text})")
    } else {
        text
    }
}

fn plain(expr: &Expr, local: &dyn Fn(&str) -> Option<String>) -> (String, Level) {
    let sub = |e: &Expr, level| write(e, level, local);
    let join = |members: &[Expr], word: &str, level| {
        let members = members.iter().map(|member| sub(member, level));
        members.collect::<Vec<_>>().join(word)
    };
    match &expr.kind {
        ExprKind::Number(value) => (format!("{value}"), Level::Atom),
        ExprKind::String(value) => (format!("{value:?}"), Level::Atom),
        ExprKind::Name(name) => match local(name) {
            Some(text) => {
                let is_name = |c: char| c.is_alphanumeric() || "_[],.".contains(c);
                let simple = text.chars().all(is_name);
                (text, if simple { Level::Atom } else { Level::Any })
            }
            None => (name.clone(), Level::Atom),
        },
        ExprKind::Field(base, field) => (
            format!("{}.{}", sub(base, Level::Atom), field.name),
            Level::Atom,
        ),
        ExprKind::Index(base, indices) => (
            format!("{}{}", sub(base, Level::Atom), brackets(indices, local)),
            Level::Atom,
        ),
        ExprKind::Call(function, args) => {
            let args: Vec<String> = args.iter().map(|arg| argument(arg, local)).collect();
            (
                format!("{}({})", sub(function, Level::Atom), args.join(", ")),
                Level::Atom,
            )
        }
        ExprKind::Matrix(matrix) => {
            let rows = matrix.rows.iter();
            let rows: Vec<String> = rows.map(|row| join(row, ", ", Level::Any)).collect();
            let is_row = matrix.semicolons && rows.len() == 1;
            let end = if is_row { ";" } else { "" };
            (format!("[{}{end}]", rows.join("; ")), Level::Atom)
        }
        ExprKind::Comprehension(body, binders) => {
            let (body, binders) = (sub(body, Level::Any), binders_text(binders, local));
            (format!("[{body} for {binders}]"), Level::Atom)
        }
        ExprKind::Negate(inner) => (format!("-{}", sub(inner, Level::Power)), Level::Unary),
        ExprKind::Binary(op, left, right) => {
            let (left, right) = (sub(left, Level::Atom), sub(right, Level::Power));
            (format!("{left}{}{right}", symbol(*op)), Level::Power)
        }
        ExprKind::Chain(first, rest) => {
            let mut operators = rest.iter().map(|(op, _)| op);
            let is_sum = operators.all(|op| matches!(op, BinaryOp::Add | BinaryOp::Sub));
            let (level, above) = match is_sum {
                true => (Level::Sum, Level::Product),
                false => (Level::Product, Level::Unary),
            };
            let mut text = sub(first, level);
            for (op, operand) in rest {
                text += symbol(*op);
                text += &sub(operand, above);
            }
            (text, level)
        }
        ExprKind::Compare(first, rest) => {
            let mut text = sub(first, Level::Sum);
            for (relation, member) in rest {
                text += relation_text(*relation);
                text += &sub(member, Level::Sum);
            }
            (text, Level::Compare)
        }
        ExprKind::Not(inner) => (format!("not {}", sub(inner, Level::Not)), Level::Not),
        ExprKind::And(members) => (join(members, " and ", Level::Not), Level::And),
        ExprKind::Or(members) => (join(members, " or ", Level::And), Level::Or),
        ExprKind::If(c, a, b) => {
            let (c, a, b) = (sub(c, Level::Any), sub(a, Level::Any), sub(b, Level::Any));
            (format!("if {c} then {a} else {b}"), Level::Any)
        }
    }
}

fn symbol(op: BinaryOp) -> &'static str {
    match op {
        BinaryOp::Add => " + ",
        BinaryOp::Sub => " - ",
        BinaryOp::Mul => "*",
        BinaryOp::Div => "/",
        BinaryOp::ElementMul => " .* ",
        BinaryOp::ElementDiv => " ./ ",
        BinaryOp::Pow => "^",
        BinaryOp::ElementPow => " .^ ",
    }
}

fn relation_text(relation: Relation) -> &'static str {
    match relation {
        Relation::Less => " < ",
        Relation::LessEqual => " <= ",
        Relation::Greater => " > ",
        Relation::GreaterEqual => " >= ",
        Relation::Equal => " = ",
    }
}

fn index_text(index: &Index, local: &dyn Fn(&str) -> Option<String>) -> String {
    match index {
        Index::All(_) => ":".to_owned(),
        Index::One(expr) => text(expr, local),
        Index::Range(first, last) => format!("{}..{}", text(first, local), text(last, local)),
    }
}

fn argument(arg: &Arg, local: &dyn Fn(&str) -> Option<String>) -> String {
    match arg {
        Arg::Named(name, value) => format!("{} = {}", name.name, text(value, local)),
        Arg::Positional(value, binders) if binders.is_empty() => text(value, local),
        Arg::Positional(value, binders) => {
            format!(
                "{} for {}",
                text(value, local),
                binders_text(binders, local)
            )
        }
    }
}

fn binders_text(binders: &[Binder], local: &dyn Fn(&str) -> Option<String>) -> String {
    let one = |binder: &Binder| {
        format!(
            "{} in {}..{}",
            binder.name.name,
            text(&binder.first, local),
            text(&binder.last, local)
        )
    };
    binders.iter().map(one).collect::<Vec<_>>().join(", ")
}
