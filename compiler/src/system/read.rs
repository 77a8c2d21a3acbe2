//! What other expressions of the model mean in a system: those of `expect`, of plots, of guards.

use rustc_hash::FxHashMap;

use super::{System, surface};
use crate::expr::{Expr, Function, Node, Substitution, Var, rewrite};

/// Where names of the model went.
#[derive(Clone, Debug, Default)]
pub struct Readings<'e> {
    /// Named switches as functions of α, or of their ψ where the switch was skipped.
    pub(super) named: Substitution<'e>,
    /// Controls and inputs.
    pub(super) signals: Substitution<'e>,
    /// Canonical ψ to its switch and the scale of that one's ψ.
    pub(super) index: FxHashMap<Expr<'e>, (usize, f64)>,
    pub(super) alphas: Vec<Expr<'e>>,
    /// Values of parameters.
    pub(super) params: FxHashMap<Var, f64>,
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
        rewrite(
            e.substitute(&self.readings.named),
            &mut |e| match e.node() {
                Node::Unary(Function::Step, psi) => self.alpha_of(psi).unwrap_or(e),
                Node::Unary(Function::Sign, psi) => {
                    self.alpha_of(psi).map_or(e, |alpha| 2.0 * alpha - 1.0)
                }
                _ => e,
            },
        )
    }

    fn alpha_of(&self, psi: Expr<'e>) -> Option<Expr<'e>> {
        let (k, flipped) = self.switch_of(psi)?;
        let alpha = self.readings.alphas[k];
        Some(if flipped { 1.0 - alpha } else { alpha })
    }

    /// The switch with the surface ψ = 0, and whether ψ is positive where its α is 0.
    pub fn switch_of(&self, psi: Expr<'e>) -> Option<(usize, bool)> {
        let psi = psi.substitute(&self.readings.signals);
        let (scale, key) = surface::canonical(psi, &self.readings.params);
        let &(k, own_scale) = self.readings.index.get(&key)?;
        Some((k, scale * own_scale < 0.0))
    }
}
