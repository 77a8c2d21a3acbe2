//! Dimensions of calls of built-in functions.

use super::dimension::{Dim, Dimension, Ratio};
use super::infer::Inference;
use crate::expr::{Function, Unit};
use crate::syntax::{Arg, Expr};

impl<'f> Inference<'f, '_> {
    /// The dimension of a call of a built-in function.
    pub fn builtin(&mut self, name: &str, args: &'f [Arg]) -> Dim {
        let values: Vec<&'f Expr> = args
            .iter()
            .map(|arg| match arg {
                Arg::Positional(value, _) | Arg::Named(_, value) => value,
            })
            .collect();
        if let Some(function) = Function::of_name(name) {
            return self.elementary(function, &values);
        }
        match name {
            "atan2" => {
                self.agree("the arguments of `atan2`", values);
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
            "cbrt" => self.root(3, &values),
            "norm" | "sum" | "transpose" | "diag" => self.first(&values),
            "min" => self.agree("the arguments of `min`", values),
            "max" => self.agree("the arguments of `max`", values),
            "mod" => self.agree("the arguments of `mod`", values),
            "hypot" => self.agree("the arguments of `hypot`", values),
            "clamp" => self.agree("the arguments of `clamp`", values),
            "ceil" | "round" | "frac" | "log2" | "log10" | "exp2" => self.number(name, &values),
            "sawtooth" | "triangle" | "pulse" => {
                let (times, duty) = values.split_at(values.len().min(2));
                self.agree("time and period", times.to_vec());
                for duty in duty {
                    self.pure("the duty of `pulse`", duty);
                }
                Dim::PURE
            }
            "sat" => self.agree("the arguments of `sat`", values),
            "deadzone" => self.agree("the arguments of `deadzone`", values),
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

    /// The dimension of a function of one argument.
    fn elementary(&mut self, function: Function, values: &[&'f Expr]) -> Dim {
        match function.definition().unit {
            Unit::Number => self.number(function.name(), values),
            Unit::Dropped => {
                self.each(values);
                Dim::PURE
            }
            Unit::Kept => self.first(values),
            Unit::SquareRoot => self.root(2, values),
        }
    }

    /// The dimension of a function of pure numbers.
    fn number(&mut self, name: &str, values: &[&'f Expr]) -> Dim {
        let what = format!("the argument of `{name}`");
        let dims: Vec<Dim> = values.iter().map(|value| self.pure(&what, value)).collect();
        match dims[..] {
            [Dim::Number] => Dim::Number,
            _ => Dim::PURE,
        }
    }

    /// The dimension of the n-th root of the first value.
    fn root(&mut self, n: i64, values: &[&'f Expr]) -> Dim {
        match Ratio::new(1, n) {
            Some(power) => self.first(values).power(power),
            None => Dim::Unknown,
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
