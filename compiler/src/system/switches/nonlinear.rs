//! What is asked of switches that are read nonlinearly.

use crate::system::{NamedReading, State, System};

impl System<'_> {
    /// The first switch that is read nonlinearly.
    pub fn first_nonlinear(&self) -> Option<usize> {
        self.switches.iter().position(|switch| switch.is_nonlinear)
    }

    /// Whether the rate of ψ of a switch contains its α.
    pub fn drives_its_surface(&self, switch: usize) -> bool {
        let Some(alpha) = self.switches[switch].alpha.as_variable() else {
            return false;
        };
        let inside = crate::expr::variables_of(&[self.switches[switch].psi]);
        let moves = |state: &&State<'_>| {
            let var = state.var.as_variable();
            var.is_some_and(|var| inside.binary_search(&var).is_ok())
        };
        let moving = self.states.iter().filter(moves);
        let mut moving = moving.map(|state| crate::expr::variables_of(&[state.rate]));
        moving.any(|vars| vars.binary_search(&alpha).is_ok())
    }
}

impl NamedReading {
    /// Its value at an α.
    pub fn value(&self, alpha: f64) -> f64 {
        let above = if self.flipped { 1.0 - alpha } else { alpha };
        if self.is_sign {
            2.0 * above - 1.0
        } else {
            above
        }
    }
}
