//! The order of series up to an instant that is known before the run.
//!
//! A step that ends there is shorter than its series allow, (h/ρ)^(p+1) ≪ tolerance. Terms above the least order q with
//! (h/ρ)^(q+1) ≤ ε, that of rounding, say nothing in it, and are not computed.

use crate::expansion::mode::Mode;
use crate::expansion::scales::Scales;
use crate::expansion::step_size::StepSize;

/// The least order that is looked at.
const LEAST: usize = 6;

/// Steps of full order from one look to the next, where the last one has shown nothing.
const PATIENCE: usize = 16;

/// Steps of a lower order before a look whether one is lower still.
const KEPT: usize = 256;

/// The order of the steps that end at known instants.
pub(crate) struct ShortOrder {
    full: usize,
    chosen: usize,
    /// Steps since the last choice.
    steps: usize,
}

impl ShortOrder {
    pub(crate) fn new(full: usize) -> Self {
        ShortOrder {
            full,
            chosen: full,
            steps: PATIENCE,
        }
    }

    /// Forgets the run before.
    pub(crate) fn reset(&mut self) {
        *self = ShortOrder::new(self.full);
    }

    /// The order of all other series.
    pub(crate) fn full(&self) -> usize {
        self.full
    }

    /// Takes the order of the next step, which is to end at a known instant or not.
    pub(super) fn take(&mut self, mode: &mut Mode, is_known: bool) {
        mode.memory.order = match is_known && mode.sliding.is_empty() {
            true => self.chosen,
            false => self.full,
        };
    }

    /// Chooses the order of later steps by one whose series allow h up to the known instant `remaining` ahead.
    pub(super) fn learn(&mut self, mode: &Mode, scales: &Scales, [h, remaining]: [f64; 2]) {
        self.steps += 1;
        let is_full = mode.memory.order == self.full;
        if h < remaining {
            (self.chosen, self.steps) = (self.full, 0);
        } else if !is_full && self.steps > KEPT {
            (self.chosen, self.steps) = (self.full, PATIENCE);
        } else if is_full && self.steps > PATIENCE {
            let tolerance = f64::EPSILON;
            let suffices = |q: &usize| {
                let step_size = StepSize { mode, tolerance };
                step_size.covers(scales, *q, remaining)
            };
            let found = (LEAST..self.full).find(suffices);
            (self.chosen, self.steps) = (found.unwrap_or(self.full), 0);
        }
    }
}
