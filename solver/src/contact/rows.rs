//! J of contacts and D = M⁻¹Jᵀ, as the functions of a mode have them.
//!
//! Forces in the rates are those of x' = f + (1 - α_n)(D λ - (2α_t - 1) T λ), T = M⁻¹J_tμ, so that ∂f/∂α_n = -D at α_t = ½
//! and ∂f/∂α_t = -2T at α_n = 0, and J = ∇ψ. A contact that slips has no β: its force is D - T or D + T.

use super::coulomb::problem::Delassus;
use crate::expansion::mode::Mode;

/// The switches of a contact.
pub(crate) struct ContactSwitches {
    /// That of its gap.
    pub normal: usize,
    /// Those of the entries of its slip velocity, where that is zero or may become so.
    pub slips: Vec<usize>,
}

impl ContactSwitches {
    /// All its switches.
    pub(crate) fn all(&self) -> impl Iterator<Item = usize> + '_ {
        std::iter::once(self.normal).chain(self.slips.iter().copied())
    }
}

/// The switches of contacts in the order of a problem: of all gaps, and then of all slip velocities.
pub(crate) fn in_order(contacts: &[ContactSwitches]) -> Vec<usize> {
    let slips = contacts.iter().flat_map(|contact| &contact.slips);
    let normals = contacts.iter().map(|contact| contact.normal);
    normals.chain(slips.copied()).collect()
}

/// The rows J of switches, with -D or -2T, where a mode was linearized at α_n = 0 and α_t = ½.
pub(crate) struct Rows<'m> {
    mode: &'m Mode,
}

impl<'m> Rows<'m> {
    /// Those that were linearized for accelerations of gaps and slips.
    pub(crate) fn of(mode: &'m Mode) -> Self {
        Rows { mode }
    }

    /// Linearizes all rates that have these α: impulses move what gaps do not depend on, too, where a mass joins them.
    pub(crate) fn linearize(mode: &'m mut Mode, switches: &[usize]) -> Self {
        mode.linearize(switches);
        for &switch in switches {
            for at in 0..mode.field.of_switch(switch).len() {
                let block = mode.field.of_switch(switch)[at];
                mode.field.linearize_block(block, &mode.memory.values);
            }
        }
        Rows { mode }
    }

    /// ∂φ/∂α of these switches, row by row.
    pub(crate) fn couplings(&self, switches: &[usize]) -> Vec<f64> {
        let of_row = |&of: &usize| switches.iter().map(move |&by| self.mode.coupling(of, by));
        switches.iter().flat_map(of_row).collect()
    }

    /// W = J (D, T).
    pub(crate) fn delassus(&self, contacts: &[ContactSwitches]) -> Delassus {
        let switches = in_order(contacts);
        let dims = contacts.iter().map(|contact| contact.slips.len());
        Delassus::new(dims, |of, by| {
            let share = if by < contacts.len() { 1.0 } else { 0.5 };
            -share * self.mode.coupling(switches[of], switches[by])
        })
    }

    /// x - Σ ∂f/∂α_i δ_i of the switches that have a δ.
    pub(crate) fn take(&self, x: &mut [f64], delta: impl Fn(usize) -> Option<f64>) {
        for (j, x) in x.iter_mut().enumerate() {
            for (switch, slope) in self.mode.field.slopes(j) {
                if let Some(delta) = delta(switch) {
                    *x -= slope * delta;
                }
            }
        }
    }
}
