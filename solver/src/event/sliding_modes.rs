//! The sliding modes of one switch at a point that is moved onto its surface.

use super::Simulator;
use crate::hybrid::Side;
use crate::selector::nonlinear::ScalarRate;
use crate::selector::selection::SlidingMode;

/// Newton iterations onto the surface.
const MAX_MOVES: usize = 50;

impl Simulator {
    /// All sliding modes of a switch where the state is on its surface, other switches being on the sides that their ψ
    /// have. States that are not `held` are moved onto the surface first; none where that does not succeed, or where
    /// the modes cannot be told apart.
    pub fn sliding_modes(
        &mut self,
        t: f64,
        x: &mut [f64],
        switch: usize,
        held: &[usize],
    ) -> Option<Vec<SlidingMode>> {
        self.pieces.until = self.mode.memory.load(&self.system, t);
        let mut alphas = vec![1.0; self.system.n_switches()];
        let mut sides = vec![Side::Plus; alphas.len()];
        sides[switch] = Side::Slide;
        for _ in 0..MAX_MOVES {
            self.mode.enter(&sides);
            self.mode.memory.set(t, x, &alphas);
            for i in 0..sides.len() {
                if i != switch {
                    sides[i] = Side::of(self.mode.psi(i));
                    alphas[i] = 0.5 + 0.5 * sides[i].sign();
                }
            }
            self.mode.enter(&sides);
            self.mode.focus(t, x, &alphas, &[switch]);
            self.mode.linearize(&[switch]);
            let psi = self.mode.psi(switch);
            let free = self.mode.surfaces.gradient(switch).iter();
            let free: Vec<(usize, f64)> = free
                .copied()
                .filter(|(state, _)| !held.contains(state))
                .collect();
            let size: f64 = free.iter().map(|(_, g)| g * g).sum();
            let change = psi / size;
            if psi == 0.0
                || free
                    .iter()
                    .all(|&(j, g)| (change * g).abs() <= 1e-15 * x[j].abs())
            {
                let mut rate = ScalarRate::of(&mut self.mode, switch, &mut alphas);
                return rate.sliding_modes().ok();
            }
            if !change.is_finite() {
                return None;
            }
            for (state, g) in free {
                x[state] -= change * g;
            }
        }
        None
    }
}
