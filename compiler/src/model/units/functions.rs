//! Dimensions of calls of built-in functions.

use super::dimension::{Dimension, Ratio};
use super::{Checker, Dim};
use crate::syntax::{Arg, Expr};

impl<'f> Checker<'f, '_> {
    /// The dimension of a call of a built-in function.
    pub fn builtin(&mut self, name: &str, args: &'f [Arg]) -> Dim {
        let values: Vec<&'f Expr> = args
            .iter()
            .map(|arg| match arg {
                Arg::Positional(value, _) | Arg::Named(_, value) => value,
            })
            .collect();
        match name {
            "sin" | "cos" | "tan" | "asin" | "acos" | "atan" | "sinh" | "cosh" | "tanh" | "exp"
            | "log" => {
                let what = format!("the argument of `{name}`");
                let dims: Vec<Dim> = values
                    .iter()
                    .map(|value| self.pure_dim(&what, value))
                    .collect();
                match dims[..] {
                    [Dim::Number] => Dim::Number,
                    _ => Dim::PURE,
                }
            }
            "atan2" => {
                self.agree("the arguments of `atan2`", values);
                Dim::PURE
            }
            "sign" | "step" => {
                self.each(&values);
                Dim::PURE
            }
            "hysteresis" => {
                let compared = args.iter().filter(|arg| match arg {
                    Arg::Positional(..) => true,
                    Arg::Named(option, _) => option.name == "on" || option.name == "off",
                });
                let compared = compared.map(|arg| match arg {
                    Arg::Positional(value, _) | Arg::Named(_, value) => value,
                });
                self.agree("the input of `hysteresis` and its thresholds", compared);
                Dim::PURE
            }
            "abs" | "norm" | "sum" | "transpose" | "diag" => self.first(&values),
            "min" => self.agree("the arguments of `min`", values),
            "max" => self.agree("the arguments of `max`", values),
            "sat" => self.agree("the arguments of `sat`", values),
            "deadzone" => self.agree("the arguments of `deadzone`", values),
            "sqrt" => match Ratio::new(1, 2) {
                Some(half) => self.first(&values).power(half),
                None => Dim::Unknown,
            },
            "dot" | "cross" => {
                let dims = self.each(&values);
                dims.into_iter().fold(Dim::Number, Dim::multiply)
            }
            "inv" => self.first(&values).power(Ratio::whole(-1)),
            // solve(A, b) is A⁻¹b.
            "solve" => match self.each(&values)[..] {
                [matrix, right] => right.divide(matrix),
                _ => Dim::Unknown,
            },
            "grad" | "jacobian" => match self.each(&values)[..] {
                [value, by] => value.divide(by),
                _ => Dim::Unknown,
            },
            "len" => {
                self.each(&values);
                Dim::Number
            }
            "eye" | "zeros" | "ones" => Dim::Number,
            // Words and texts; the data has the unit that its signal declares.
            "table" => Dim::Unknown,
            // Instants of a run.
            "switches" | "events" => Dim::Known(Dimension::TIME),
            _ => {
                self.each(&values);
                Dim::Unknown
            }
        }
    }

    fn each(&mut self, values: &[&'f Expr]) -> Vec<Dim> {
        values.iter().map(|value| self.expr(value)).collect()
    }

    fn first(&mut self, values: &[&'f Expr]) -> Dim {
        let dims = self.each(values);
        dims.first().copied().unwrap_or(Dim::Unknown)
    }
}
