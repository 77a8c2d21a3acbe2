//! α of switches that a run has not watched: those of outputs alone, where no series of their ψ exists.
//!
//! `max(norm(v), 1)` has a switch on |v| - 1, which has no derivative at v = 0. Its value is all that the output needs.

use crate::expr::Var;
use crate::system::System;

impl System<'_> {
    /// Puts the sides of ψ for every α that is not a number, at a point with these states.
    pub fn see(&self, time: f64, x: &[f64], alpha: &mut [f64]) {
        for i in 0..alpha.len().min(self.switches.len()) {
            if alpha[i].is_nan() {
                let psi = self.switches[i].psi;
                let psi = psi.eval(&|var| self.number(var, time, x, alpha));
                alpha[i] = f64::from(u8::from(psi >= 0.0));
            }
        }
    }

    /// What a variable stands for at a point.
    fn number(&self, var: Var, time: f64, x: &[f64], alpha: &[f64]) -> f64 {
        let states = self
            .states
            .iter()
            .map(|state| state.var)
            .zip(x.iter().copied());
        let switches = self.switches.iter().map(|switch| switch.alpha);
        let switches = switches.zip(alpha.iter().copied());
        let params = self.params.iter().map(|param| (param.var, param.value));
        let data = self.data.iter();
        let data = data.map(|data| (data.var, data.table.value(time)));
        let all = [(self.time, time)]
            .into_iter()
            .chain(states)
            .chain(switches);
        let mut all = all.chain(params).chain(data);
        let known = all.find(|(e, _)| e.as_variable() == Some(var));
        known.map_or(f64::NAN, |(_, number)| number)
    }
}
