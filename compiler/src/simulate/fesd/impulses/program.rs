//! The program of a step of so many elements: made once, and started from any instant and state.
//!
//! What a step starts from are values of variables: t and x at its start, the z that are continuous there, and c of
//! every contact in every element (`dcs/drift.rs`). Whether a member of a pair is a variable or a row depends on bounds,
//! which these variables therefore have none of until they get their values.

use std::sync::Arc;

use super::StepStart;
use crate::dcs::{Dcs, Kept};
use crate::discretize::{Grid, Layout, Options, discretize};
use crate::mpcc::{self, Bounds};
use crate::system::System;

/// The program of a step, as the solver sees it.
pub(super) struct StepProgram {
    pub program: mpcc::Program,
    pub layout: Arc<Layout>,
    /// Bounds and guesses of its variables for the start that it was given last.
    pub bounds: Vec<Bounds>,
    /// The mean length of its elements.
    mean: f64,
    /// The variables of the states at the start, and of the z that are continuous there, with their places.
    states: usize,
    continuous: Vec<(usize, usize)>,
    /// c of every contact.
    closed: Vec<usize>,
}

impl StepProgram {
    /// For steps of the grid with these options; nothing where it cannot be made.
    pub fn new(system: &System, dcs: &Dcs, grid: Grid, options: &Options) -> Option<Self> {
        let (dcs, kept) = dcs.without_drift(system);
        let (mut mpcc, layout) = discretize(&dcs, grid, options).ok()?;
        let continuous: Vec<(usize, usize)> = layout.fixed_at_start().collect();
        let closed: Vec<usize> = kept.iter().map(|&Kept { closed, .. }| closed).collect();
        for &(index, _) in &continuous {
            mpcc.free(index);
        }
        Some(StepProgram {
            program: mpcc.program().expect("kernels are smooth"),
            bounds: mpcc.bounds(),
            mean: grid.horizon / layout.elements as f64,
            states: layout.before(1, 1),
            continuous,
            closed,
            layout: Arc::new(layout),
        })
    }

    /// Gives it a start, and says where its solution is looked for as long as no other run is known.
    pub fn start_from(&mut self, from: &StepStart, closed: &[Vec<bool>]) -> Vec<f64> {
        let layout = self.layout.clone();
        for (k, j) in layout.all_elements() {
            if let Some(t) = layout.t(k, j) {
                let guess = from.time + (j - 1) as f64 * self.mean;
                self.guess(t, guess);
            }
            for m in 0..=layout.end {
                for (i, &x) in from.x.iter().enumerate() {
                    self.guess(layout.x(k, j, m) + i, x);
                }
                for i in 0..layout.n_algebraics() {
                    if let Some(index) = layout.z(k, j, m, i) {
                        self.guess(index, from.z.get(i).copied().unwrap_or(0.0));
                    }
                }
            }
            for c in 0..self.closed.len() {
                let is_closed = closed.get(j - 1).is_some_and(|closed| closed[c]);
                for m in 1..=layout.nodes {
                    let index = layout.z(k, j, m, self.closed[c]);
                    let index = index.expect("it is there at nodes");
                    self.fix(index, f64::from(u8::from(is_closed)));
                }
            }
        }
        if let Some(t) = layout.t(1, 1) {
            self.fix(t, from.time);
        }
        for (i, &x) in from.x.iter().enumerate() {
            self.fix(self.states + i, x);
        }
        for place in 0..self.continuous.len() {
            let (index, i) = self.continuous[place];
            self.fix(index, from.z[i]);
        }
        self.bounds.iter().map(|bounds| bounds.guess).collect()
    }

    fn guess(&mut self, index: usize, guess: f64) {
        let Bounds { lower, upper, .. } = self.bounds[index];
        self.bounds[index] = Bounds::between(lower, upper, guess);
    }

    fn fix(&mut self, index: usize, value: f64) {
        self.bounds[index] = Bounds::fixed(value);
        self.program.fix(index, value);
    }
}
