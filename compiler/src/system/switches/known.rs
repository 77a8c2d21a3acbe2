//! Numbers and ranges of parameters, and what they say about expressions.

use rustc_hash::FxHashMap;

use crate::expr::{Expr, Interval, Var, variables_of};

/// What is known of parameters.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Numbers of parameters, guesses of those that are free.
    pub numbers: FxHashMap<Var, f64>,
    /// Where free parameters may be.
    pub ranges: FxHashMap<Var, Interval>,
}

impl Known {
    /// The number of a parameter that is not free.
    pub fn fixed(&self, var: Var) -> Option<f64> {
        let number = self.numbers.get(&var).copied();
        number.filter(|_| !self.ranges.contains_key(&var))
    }

    /// With the numbers of parameters that are not free; only of those that occur, as there may be many of both.
    pub(crate) fn in_numbers<'e>(&self, e: Expr<'e>) -> Expr<'e> {
        if e.as_constant().is_some() {
            return e;
        }
        let numbers = variables_of(&[e]).into_iter();
        let numbers = numbers.filter_map(|var| Some((var, e.exprs().constant(self.fixed(var)?))));
        e.substitute(&numbers.collect())
    }

    /// Whether an expression is zero wherever its variables are: by its form, or else at points without special
    /// relations.
    pub(crate) fn vanishes(&self, e: Expr<'_>) -> bool {
        e.is_zero() || self.at_samples(e, |value| value.abs() < 1e-9)
    }

    /// Whether values at points without special relations have a property.
    pub(crate) fn at_samples(&self, e: Expr<'_>, holds: impl Fn(f64) -> bool) -> bool {
        let e = self.in_numbers(e);
        (1..=5).all(|point| {
            let point = f64::from(point);
            let at =
                |var: Var| 0.3 + 0.618 * point + 0.7 * (point * 1.7 * var.index() as f64).sin();
            holds(e.eval(&at))
        })
    }
}
