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

    /// Whether terms add up to zero wherever their variables are: by their form, or else at points without special relations,
    /// to rounding.
    pub(crate) fn cancel<'e>(&self, terms: &[Expr<'e>]) -> bool {
        const ROUNDING: f64 = 1e-9;
        let Some(first) = terms.first() else {
            return true;
        };
        if first.exprs().sum(terms.iter().copied()).is_zero() {
            return true;
        }
        let terms: Vec<Expr> = terms.iter().map(|&term| self.in_numbers(term)).collect();
        (1..=5).all(|point| {
            let values = terms.iter().map(|term| value_at(*term, point));
            let (sum, size) = values.fold((0.0, 0.0), |(sum, size), v| (sum + v, size + v.abs()));
            sum.abs() <= ROUNDING * size
        })
    }

    /// Whether values at points without special relations have a property.
    pub(crate) fn at_samples(&self, e: Expr<'_>, holds: impl Fn(f64) -> bool) -> bool {
        let e = self.in_numbers(e);
        (1..=5).all(|point| holds(value_at(e, point)))
    }
}

/// The value at one of some points without special relations.
fn value_at(e: Expr<'_>, point: u32) -> f64 {
    let point = f64::from(point);
    e.eval(&|var: Var| 0.3 + 0.618 * point + 0.7 * (point * 1.7 * var.index() as f64).sin())
}
