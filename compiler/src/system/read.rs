//! What other expressions of the model mean in a system: those of `expect`, of plots, of guards.

use rustc_hash::{FxHashMap, FxHashSet};

use super::System;
use super::switches::entries::Entry;
use crate::expr::{Expr, Substitution, Var, rewrite, variables_of};
use crate::system::switches::Switches;
use crate::system::switches::known::Known;
use crate::system::switches::surface;
use crate::system::switches::terms::{at_alpha, compared};

/// Where names of the model went.
#[derive(Clone, Debug, Default)]
pub struct Readings<'e> {
    /// Named switches as functions of α, or of their ψ where the switch was skipped.
    pub(crate) named: Substitution<'e>,
    /// Controls and inputs.
    pub(crate) signals: Substitution<'e>,
    /// Canonical ψ to its switch and the scale of that one's ψ.
    pub(crate) index: FxHashMap<Expr<'e>, (usize, f64)>,
    /// What takes the place of step(ψ): those of the switches of the system, and behind them steep functions
    /// of switches that were smoothed.
    pub(crate) alphas: Vec<Expr<'e>>,
    /// Values of parameters.
    pub(crate) params: Known,
}

impl<'e> Readings<'e> {
    /// How expressions of the model are read once only the switches `kept` are left.
    pub(crate) fn of(
        switches: &Switches<'e>,
        kept: &[usize],
        signals: Substitution<'e>,
        named: impl IntoIterator<Item = (Var, Expr<'e>, Expr<'e>)>,
    ) -> Self {
        let alphas: FxHashSet<Var> = kept.iter().map(|&k| switches.list[k].alpha).collect();
        let is_kept = |e: Expr<'e>| {
            switches
                .entries
                .alphas_of(e)
                .iter()
                .all(|alpha| alphas.contains(alpha))
        };
        let named = named.into_iter().map(|(var, value, direct)| {
            let value = switches.entries.merged(value);
            (
                var,
                if is_kept(value) {
                    value
                } else {
                    direct.substitute(&signals)
                },
            )
        });
        let index = switches.index.iter().filter_map(|(&key, k)| {
            let place = kept.iter().position(|kept| kept == k)?;
            Some((key, (place, switches.list[*k].scale)))
        });
        let alphas = kept
            .iter()
            .map(|&k| switches.exprs().expr(switches.list[k].alpha));
        Readings {
            named: named.collect(),
            signals,
            index: index.collect(),
            alphas: alphas.collect(),
            params: switches.params.clone(),
        }
    }

    /// An expression of the model without named switches, controls and inputs.
    fn resolve(&self, e: Expr<'e>) -> Expr<'e> {
        let e = e.substitute(&self.named).substitute(&self.signals);
        e.substitute(&self.named)
    }

    /// What takes the place of step(ψ).
    fn alpha_of(&self, psi: Expr<'e>) -> Option<Expr<'e>> {
        let (k, flipped) = self.switch_of(psi)?;
        let alpha = self.alphas[k];
        Some(if flipped { 1.0 - alpha } else { alpha })
    }

    /// Its place, and whether ψ is positive where it is 0.
    fn switch_of(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        let (scale, key) = surface::canonical(psi, &self.params);
        let &(k, own_scale) = self.index.get(&key)?;
        Some((k, scale * own_scale < 0.0))
    }
}

impl<'e> System<'e> {
    /// An expression of the model in time, parameters, states and α.
    ///
    /// `sign` and `step` of a switching function of the system become its α, so that they have a
    /// value on the surface; other nonsmooth terms stay as they are.
    pub fn read(&self, e: Expr<'e>) -> Expr<'e> {
        let readings = &self.provenance.readings;
        rewrite(readings.resolve(e), &mut |e| match compared(e) {
            Some((psi, Entry::Condition | Entry::Term)) => {
                (readings.alpha_of(psi)).map_or(e, |alpha| at_alpha(e, alpha))
            }
            _ => e,
        })
    }

    /// Whether steep functions have taken the place of switches.
    pub fn is_smoothed(&self) -> bool {
        self.provenance.readings.alphas.len() > self.switches.len()
    }

    /// The switch that an entry of a named switch stands for, whatever its ψ has become, and whether it is flipped.
    pub fn named_switch(&self, entry: Expr<'e>) -> Option<(usize, bool)> {
        let value = self.provenance.readings.named.get(entry.as_variable()?)?;
        let [alpha] = variables_of(&[value])[..] else {
            return None;
        };
        let mut switches = self.switches.iter();
        let k = switches.position(|switch| switch.alpha.as_variable() == Some(alpha))?;
        Some((k, value.eval(&|_| 1.0) < value.eval(&|_| 0.0)))
    }

    /// The switch with the surface ψ = 0, and whether ψ is positive where its α is 0.
    pub fn switch_of(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        // Nonsmooth terms inside ψ are in α.
        let psi = rewrite(self.provenance.readings.resolve(psi), &mut |e| {
            let alpha = compared(e).and_then(|(psi, _)| self.provenance.readings.alpha_of(psi));
            alpha.map_or(e, |alpha| at_alpha(e, alpha))
        });
        let found = self.provenance.readings.switch_of(psi);
        found.filter(|(k, _)| *k < self.switches.len())
    }
}
