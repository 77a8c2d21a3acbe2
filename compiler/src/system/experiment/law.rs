//! Laws of smoothing: the functions in the place of the sign.

use super::error::ExperimentError;
use super::reader::{Reader, unknown_choice};
use crate::expr::{CompileError, Expr, Var, compile};
use crate::syntax::{self, Arg, ExprKind, Ident};

/// A function that goes from -1 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law<'e> {
    /// tanh y
    Tanh,
    /// y/√(1 + y²)
    Rational,
    /// (15 y - 10 y³ + 3 y⁵)/8 up to |y| = 1
    Polynomial,
    /// A function of the file.
    Own {
        /// y, under the name of the function.
        argument: Var,
        /// s(y)
        value: Expr<'e>,
    },
}

impl Law<'_> {
    /// Those that need no function of the file.
    pub const BUILT_IN: [Law<'static>; 3] = [Law::Tanh, Law::Rational, Law::Polynomial];

    /// The word of the language.
    pub fn word(&self) -> String {
        match self {
            Law::Tanh => "tanh".into(),
            Law::Rational => "rational".into(),
            Law::Polynomial => "polynomial".into(),
            Law::Own { argument, value } => value.exprs().name(*argument),
        }
    }
}

/// Where a function is looked at: at ± these, and the last one is far away.
const SAMPLES: [f64; 10] = [0.0, 0.1, 0.3, 0.7, 1.0, 1.6, 3.0, 10.0, 100.0, 1e9];
/// How close to -1 and 1 it is far away.
const FAR: f64 = 1e-6;
/// What rounding may take it beyond them.
const ROUNDING: f64 = 1e-9;

/// `tanh`, or a function of the file.
pub(crate) fn law<'e>(reader: &mut Reader<'_, 'e>, option: &syntax::Expr) -> Option<Law<'e>> {
    let name = match &option.kind {
        ExprKind::Name(name) => name.clone(),
        ExprKind::Field(_, name) => name.name.clone(),
        _ => "..".into(),
    };
    let is_own = match &option.kind {
        ExprKind::Name(name) => reader.model.scope.has_function(name),
        kind => matches!(kind, ExprKind::Field(..)),
    };
    if is_own {
        return own(reader, option, name);
    }
    let known = Law::BUILT_IN.into_iter().find(|law| law.word() == name);
    if known.is_none() {
        let span = option.span;
        let words = Law::BUILT_IN.map(|law| law.word());
        let mut choices: Vec<&str> = words.iter().map(String::as_str).collect();
        choices.push("a `fn` of the file");
        reader.error(unknown_choice("law", &Ident { name, span }, &choices));
    }
    known
}

/// The law that a function of the file is.
fn own<'e>(reader: &mut Reader<'_, 'e>, function: &syntax::Expr, name: String) -> Option<Law<'e>> {
    const ARGUMENT: &str = "the argument";
    let span = function.span;
    let exprs = reader.model.exprs;
    let y = exprs.variable(&name);
    let argument = y.as_variable()?;
    let expr = |kind| syntax::Expr { kind, span };
    let given = Arg::Positional(expr(ExprKind::Name(ARGUMENT.into())), Vec::new());
    let call = expr(ExprKind::Call(Box::new(function.clone()), vec![given]));
    let hook = |e: &syntax::Expr| match &e.kind {
        ExprKind::Name(name) if name == ARGUMENT => Some(crate::model::Tensor::scalar(y)),
        _ => None,
    };
    let Some(value) = reader.model.scope.expr(&call, Some(&hook), reader.diags) else {
        reader.failed = true;
        return None;
    };
    let mut wrong = |what: String| {
        let name = name.clone();
        reader.error(ExperimentError::NoLaw { name, what, span });
        None
    };
    let Some(value) = value.as_scalar() else {
        return wrong(format!("gives {} instead of a number", value.shape));
    };
    match compile(&[argument], &[value]) {
        Err(CompileError::Nonsmooth(part)) => return wrong(format!("is not smooth: `{part}`")),
        Err(CompileError::NotAnInput(name)) => return wrong(format!("depends on `{name}`")),
        Ok(_) => {}
    }
    let at = |y: f64| value.eval(&|_| y);
    let points = SAMPLES.iter().flat_map(|&y| [y, -y]);
    for y in points {
        let s = at(y);
        if s.is_nan() || s.abs() > 1.0 + ROUNDING {
            return wrong(format!("is {s} at {y}, outside of -1 to 1"));
        }
    }
    for end in [-1.0, 1.0] {
        let far = end * SAMPLES[SAMPLES.len() - 1];
        let s = at(far);
        if (s - end).abs() > FAR {
            return wrong(format!("is {s} at {far}, not {end}"));
        }
    }
    Some(Law::Own { argument, value })
}
