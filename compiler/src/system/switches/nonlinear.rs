//! What is asked of switches that are read nonlinearly.

use crate::system::{NamedReading, System};

impl System<'_> {
    /// The first switch that is read nonlinearly.
    pub fn first_nonlinear(&self) -> Option<usize> {
        self.switches.iter().position(|switch| switch.is_nonlinear)
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
