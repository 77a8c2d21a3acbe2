//! What other expressions of the model mean in a system: those of `expect`, of plots, of guards.

use rustc_hash::FxHashMap;

use super::System;
use super::switches::Entry;
use crate::expr::{Expr, Substitution, rewrite};
use crate::system::switches::surface;
use crate::system::switches::surface::Known;
use crate::system::switches::terms::{at_alpha, compared};

/// Where names of the model went.
#[derive(Clone, Debug, Default)]
pub struct Readings<'e> {
    /// Named switches as functions of α, or of their ψ where the switch was skipped.
    pub(super) named: Substitution<'e>,
    /// Controls and inputs.
    pub(super) signals: Substitution<'e>,
    /// Canonical ψ to its switch and the scale of that one's ψ.
    pub(super) index: FxHashMap<Expr<'e>, (usize, f64)>,
    /// What takes the place of step(ψ): those of the switches of the system, and behind them steep functions
    /// of switches that were smoothed.
    pub(super) alphas: Vec<Expr<'e>>,
    /// Values of parameters.
    pub(super) params: Known,
}

impl<'e> System<'e> {
    /// An expression of the model in time, parameters, states and α.
    ///
    /// `sign` and `step` of a switching function of the system become its α, so that they have a
    /// value on the surface; other nonsmooth terms stay as they are.
    pub fn read(&self, e: Expr<'e>) -> Expr<'e> {
        let e = e
            .substitute(&self.readings.named)
            .substitute(&self.readings.signals);
        let e = e.substitute(&self.readings.named);
        rewrite(e, &mut |e| match compared(e) {
            Some((psi, Entry::Condition | Entry::Term)) => {
                (self.alpha_of(psi)).map_or(e, |alpha| at_alpha(e, alpha))
            }
            _ => e,
        })
    }

    /// Whether steep functions have taken the place of switches.
    pub fn is_smoothed(&self) -> bool {
        self.readings.alphas.len() > self.switches.len()
    }

    /// A nonsmooth term inside a switching function, in α.
    fn inner(&self, e: Expr<'e>) -> Option<Expr<'e>> {
        let (psi, _) = compared(e)?;
        Some(at_alpha(e, self.alpha_of(psi)?))
    }

    fn alpha_of(&self, psi: Expr<'e>) -> Option<Expr<'e>> {
        let (k, flipped) = self.switch_of_smooth(psi)?;
        let alpha = self.readings.alphas[k];
        Some(if flipped { 1.0 - alpha } else { alpha })
    }

    /// The relay that an entry of a named switch stands for.
    pub fn relay_of(&self, entry: Expr<'e>) -> Option<usize> {
        let alpha = self.readings.named.get(entry.as_variable()?)?;
        let k = (self.readings.alphas.iter()).position(|other| *other == alpha)?;
        self.switches[k].relay.map(|_| k)
    }

    /// The switch with the surface ψ = 0, and whether ψ is positive where its α is 0.
    pub fn switch_of(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        let psi = psi
            .substitute(&self.readings.named)
            .substitute(&self.readings.signals)
            .substitute(&self.readings.named);
        let psi = rewrite(psi, &mut |e| self.inner(e).unwrap_or(e));
        let found = self.switch_of_smooth(psi);
        found.filter(|(k, _)| *k < self.switches.len())
    }

    fn switch_of_smooth(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        let (scale, key) = surface::canonical(psi, &self.readings.params);
        let &(k, own_scale) = self.readings.index.get(&key)?;
        Some((k, scale * own_scale < 0.0))
    }
}
