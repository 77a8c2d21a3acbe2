//! The order of series up to an instant that is known before the run.
//!
//! Where laws jump at instants t_0 + k T, steps are shorter than their series allow, (h/ρ)^(p+1) ≪ tolerance. Terms above
//! the least order q with (h/ρ)^(q+1) ≤ ε √tolerance say nothing in them, and are not computed: that is far below the
//! rounding ε, so that two runs of one order are not blind to what both leave out.
//!
//! Where states and ψ are polynomials in time, as of a body that falls, all terms above their degree are zero. So are the
//! last terms of series a little longer than that, which allow steps of any length.

use crate::expansion::mode::Mode;
use crate::expansion::scales::Scales;
use crate::expansion::step_size::StepSize;
use crate::hybrid::{Few, HybridSystem, Side};
use crate::tape::UNBOUNDED;

/// The least order that is looked at.
const LEAST: usize = 6;

/// Terms behind the last of a polynomial that show that it ends: those that the size of a step follows from.
const ENDS: usize = 3;

/// Steps of full order from one look to the next, where the last one has shown nothing.
const PATIENCE: usize = 16;

/// Steps of a lower order before a look whether one is lower still.
const KEPT: usize = 256;

/// The order of the steps that end at known instants.
pub(crate) struct ShortOrder {
    full: usize,
    /// That of the present mode, and its sides: below the full one where all of it are polynomials.
    here: usize,
    sides: Option<Few<Side>>,
    chosen: usize,
    /// (h/ρ)^(q+1) at most; zero where no law jumps at known instants.
    tolerance: f64,
    /// Steps since the last choice.
    steps: usize,
}

impl ShortOrder {
    /// That of a system with series of full order, and the tolerance of a step.
    pub(crate) fn new(system: &HybridSystem, full: usize, tolerance: f64) -> Self {
        let is_periodic = system.periodic().next().is_some();
        ShortOrder {
            full,
            here: full,
            sides: None,
            chosen: full,
            tolerance: match is_periodic {
                true => f64::EPSILON * tolerance.sqrt(),
                false => 0.0,
            },
            steps: PATIENCE,
        }
    }

    /// Forgets the run before.
    pub(crate) fn reset(&mut self) {
        (self.chosen, self.steps) = (self.full, PATIENCE);
        self.sides = None;
    }

    /// The order of all other series.
    pub(crate) fn full(&self) -> usize {
        self.full
    }

    /// Takes the order of the next step, which is to end at a known instant or not, and starts in the present mode or sets
    /// off from rest.
    pub(super) fn take(&mut self, mode: &mut Mode, is_known: bool, sets_off: bool) {
        if self.sides.as_deref() != Some(&*mode.sides) {
            let degree = degree(mode).map(|degree| degree.saturating_add(ENDS));
            self.here = degree.map_or(self.full, |order| order.min(self.full));
            self.sides = Some(Few::from_slice(&mode.sides));
        }
        mode.memory.order = match sets_off {
            true => self.full,
            false if is_known && mode.sliding.is_empty() => self.chosen.min(self.here),
            false => self.here,
        };
    }

    /// Whether the order of a step suffices whose series allow h, up to the known instant `remaining` ahead. It chooses
    /// that of later steps.
    pub(super) fn suffices(
        &mut self,
        mode: &mut Mode,
        scales: &Scales,
        [h, remaining]: [f64; 2],
    ) -> bool {
        let tolerance = self.tolerance;
        if tolerance == 0.0 {
            return true;
        }
        let covers = |mode: &Mode, order: usize| {
            let step_size = StepSize { mode, tolerance };
            h >= remaining && step_size.covers(scales, order, remaining)
        };
        self.steps += 1;
        if mode.memory.order < self.here {
            let suffices = covers(mode, mode.memory.order);
            if !suffices || self.steps > KEPT {
                self.chosen = self.full;
                self.steps = if suffices { PATIENCE } else { 0 };
            }
            if !suffices {
                mode.memory.order = self.here;
            }
            return suffices;
        }
        if self.steps > PATIENCE {
            let found = (LEAST..self.here).find(|&q| covers(mode, q));
            (self.chosen, self.steps) = (found.unwrap_or(self.full), 0);
        }
        true
    }
}

/// The degree as polynomials in time of all states and of every ψ, where nothing slides and they are that.
fn degree(mode: &mut Mode) -> Option<usize> {
    if !mode.sliding.is_empty() {
        return None;
    }
    let states = mode.field.degrees()?;
    let switches = 0..mode.sides.len();
    let psi = switches.map(|i| mode.surfaces.now(i).degree(&states));
    let degree = psi.chain(states.iter().copied()).max().unwrap_or(0);
    (degree < UNBOUNDED).then_some(degree as usize)
}
