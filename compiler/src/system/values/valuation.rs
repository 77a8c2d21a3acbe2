//! The numbers that variables stand for at a point of a run.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::expr::{Expr, Var, variables_of};
use crate::system::System;
use crate::system::switches::terms::decided;

/// Variables with their numbers.
#[derive(Clone, Debug, Default)]
pub struct Valuation {
    numbers: FxHashMap<Var, f64>,
    /// Those that are α.
    alphas: FxHashSet<Var>,
}

impl Valuation {
    /// Gives a variable a number.
    pub fn set(&mut self, e: Expr<'_>, number: f64) {
        self.numbers
            .extend(e.as_variable().map(|var| (var, number)));
    }

    /// Where a variable has a number, that one.
    pub fn get(&self, var: Var) -> Option<f64> {
        self.numbers.get(&var).copied()
    }

    /// The number of a variable, NaN where it has none.
    pub fn number(&self, var: Var) -> f64 {
        self.get(var).unwrap_or(f64::NAN)
    }

    /// Gives an α a number.
    fn set_alpha(&mut self, alpha: Expr<'_>, number: f64) {
        self.set(alpha, number);
        self.alphas.extend(alpha.as_variable());
    }

    /// The value of an expression on the sides on which it is; not a number where a variable has none.
    pub fn value(&self, e: Expr<'_>) -> f64 {
        let number = |var| self.number(var);
        decided(e, &number, &|var| self.alphas.contains(&var)).eval(&number)
    }

    /// A variable of the expressions that has no number.
    pub fn unknown(&self, exprs: &[Expr<'_>]) -> Option<Var> {
        let mut variables = variables_of(exprs).into_iter();
        variables.find(|var| !self.numbers.contains_key(var))
    }
}

impl<'e> Extend<(Expr<'e>, f64)> for Valuation {
    fn extend<I: IntoIterator<Item = (Expr<'e>, f64)>>(&mut self, numbers: I) {
        let numbers = numbers.into_iter();
        (self.numbers).extend(numbers.filter_map(|(e, number)| Some((e.as_variable()?, number))));
    }
}

impl System<'_> {
    /// The parameters.
    pub fn parameters(&self) -> Valuation {
        let mut known = Valuation::default();
        known.extend(self.exogenous.numbers());
        known
    }

    /// Parameters, time, data, states and, as far as they are given, α.
    pub fn valuation(&self, time: f64, x: &[f64], alpha: &[f64]) -> Valuation {
        self.valuation_around([time, time], x, alpha)
    }

    /// The same at an instant that ends a piece of data, or begins one, with the pieces of another instant.
    pub fn valuation_around(
        &self,
        [time, inside]: [f64; 2],
        x: &[f64],
        alpha: &[f64],
    ) -> Valuation {
        let mut known = self.parameters();
        known.set(self.time, time);
        let data = self.exogenous.data.iter();
        known.extend(data.map(|data| (data.var, data.table.piece(inside).value(time))));
        let states = self.states.iter().map(|state| state.var);
        known.extend(states.zip(x.iter().copied()));
        for (switch, &alpha) in self.switches.iter().zip(alpha) {
            known.set_alpha(switch.alpha, alpha);
        }
        known
    }

    /// Whether data jump at an instant.
    pub fn steps_at(&self, time: f64) -> bool {
        let mut data = self.exogenous.data.iter();
        data.any(|data| data.table.steps_at(time))
    }

    /// Puts the sides of ψ for every α that is not a number, at a point with these states: those of outputs alone, of
    /// whose ψ no run has a series.
    ///
    /// `max(norm(v), 1)` has a switch on |v| - 1, which has no derivative at v = 0. Its value is all that the output
    /// needs.
    pub fn see(&self, time: f64, x: &[f64], alpha: &mut [f64]) {
        if !alpha.iter().any(|alpha| alpha.is_nan()) {
            return;
        }
        let mut known = self.valuation(time, x, alpha);
        for (switch, alpha) in self.switches.iter().zip(alpha) {
            if alpha.is_nan() {
                *alpha = f64::from(u8::from(known.value(switch.psi) >= 0.0));
                known.set_alpha(switch.alpha, *alpha);
            }
        }
    }
}
