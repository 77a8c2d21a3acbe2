//! The drift off the surfaces that a mode slides on, projected away after each step.

use super::mode::Mode;
use super::state::State;

impl Mode {
    /// Projects x onto ψ and its lower derivatives of sliding switches of higher relative degree, one
    /// after the other.
    fn project_lower(&mut self, state: &mut State) {
        for at in 0..self.sliding.len() {
            let i = self.sliding[at];
            let order = self.surfaces.n_derivatives(i);
            for lower in 0..order {
                self.set(state.t, &state.x, &state.alpha);
                self.surfaces.stand_for(i, lower);
                self.surfaces.linearize(i, &self.memory.values);
                let psi = self.psi(i);
                let gradient = self.surfaces.gradient(i).iter();
                let square: f64 = gradient.map(|&(j, g)| (g * state.size(j)).powi(2)).sum();
                if square > 0.0 {
                    for &(j, g) in self.surfaces.gradient(i) {
                        state.x[j] -= g * psi / square * state.size(j).powi(2);
                    }
                }
            }
            self.surfaces.stand_for(i, order);
        }
    }

    /// Projects x onto the sliding surfaces, in the norm of the states' sizes, and returns the
    /// largest |ψ| found, relative to the size of its terms.
    pub(crate) fn project(&mut self, state: &mut State) -> f64 {
        let mut drift = 0.0_f64;
        if self.sliding.is_empty() {
            return drift;
        }
        for round in 0..3 {
            self.project_lower(state);
            self.set(state.t, &state.x, &state.alpha);
            self.linearize_surfaces();
            let mut worst = 0.0_f64;
            for at in 0..self.sliding.len() {
                let i = self.equations.switches[at];
                let psi = self.psi(i);
                let terms = self.gradient(i).iter();
                let size: f64 = terms.map(|&(j, g)| g.abs() * state.size(j)).sum();
                self.equations.rhs[at] = if self.equations.tie(at).is_some() {
                    0.0
                } else {
                    psi
                };
                if size > 0.0 {
                    worst = worst.max(psi.abs() / size);
                }
            }
            if round == 0 {
                drift = worst;
            }
            if worst <= f64::EPSILON {
                break;
            }
            let mut equations = std::mem::take(&mut self.equations);
            let factored = equations.factor_gram(&self.surfaces, |j| self.mobility(state, j));
            self.equations = equations;
            if factored.is_err() {
                break;
            }
            self.equations.solve();
            for (&i, multiplier) in self.equations.switches.iter().zip(&self.equations.rhs) {
                for &(j, g) in self.surfaces.gradient(i) {
                    state.x[j] -= g * multiplier * self.mobility(state, j).powi(2);
                }
            }
        }
        drift
    }
}
