//! Events that are close together, but not one.
//!
//! Rounding does not tell apart events at a distance of some ε, so that those below `TOGETHER` are one.
//! The mode between them is skipped, which is no matter unless its field moves a state even in such a
//! short time: then the later ones are left to the next step.

use super::state::State;
use super::{Side, Simulator, SwitchedSystem};

/// Roundings of its terms below which ψ is zero.
const ROUNDINGS: f64 = 64.0;

impl<S: SwitchedSystem> Simulator<'_, S> {
    /// Takes out of `triggers`, which meet here, those whose surfaces are reached later, where that makes
    /// a difference to a state above its tolerance.
    pub(super) fn tell_apart(&mut self, state: &State, triggers: &mut Vec<usize>) {
        let is_relay = |&i: &usize| self.system.relay(i).is_some();
        if triggers.len() < 2 || triggers.iter().any(is_relay) {
            return;
        }
        let mode = &mut self.mode;
        mode.set(state.t, &state.x, &state.alpha);
        let mut is_ahead = |i: usize| {
            let psi = mode.psi(i) * state.sides[i].sign();
            psi > ROUNDINGS * f64::EPSILON * state.terms[i]
        };
        let (later, now): (Vec<usize>, Vec<usize>) = triggers.iter().partition(|&&i| is_ahead(i));
        if later.is_empty() || now.is_empty() {
            return;
        }

        // The mode between: what is reached now has changed sides.
        let mut sides = state.sides.clone();
        let mut alpha = state.alpha.clone();
        for &i in &now {
            sides[i] = match state.sides[i] {
                Side::Minus => Side::Plus,
                Side::Plus => Side::Minus,
                Side::Slide if alpha[i] < 0.5 => Side::Minus,
                Side::Slide => Side::Plus,
            };
            alpha[i] = if sides[i] == Side::Plus { 1.0 } else { 0.0 };
        }
        mode.eval(state.t, &state.x, &state.alpha);
        let before = mode.f().to_vec();
        mode.enter(self.system, &sides);
        mode.eval(state.t, &state.x, &alpha);
        mode.linearize(&later);
        let lasts = later.iter().map(|&i| {
            let (psi, approach) = (mode.psi(i).abs(), -mode.phi(i) * sides[i].sign());
            if approach > 0.0 { psi / approach } else { 0.0 }
        });
        let lasts = lasts.fold(0.0, f64::max);
        let matters = (mode.f().iter().zip(&before))
            .enumerate()
            .any(|(j, (f, before))| {
                let size = state.scale[j].max(state.x[j].abs());
                (f - before).abs() * lasts > self.settings.tolerance * size
            });
        mode.enter(self.system, &state.sides);
        if matters {
            *triggers = now;
        }
    }
}
