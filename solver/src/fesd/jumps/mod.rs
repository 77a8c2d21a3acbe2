//! Contacts by finite elements with jumps between them (FESD-J), one step of a grid after the other.
//!
//! A step is a program without an objective: elements, impulses where they meet, and complementarity. What it starts
//! from are values of variables: t and x at its start, the z that are continuous there, and c of every contact in every
//! element, which is 1 where the rate of the gap vanishes at the nodes, too. So one program serves all steps.
//!
//! A point of a program that satisfies it is a step if gaps are not below zero between the nodes, and forces have not
//! absorbed a bounce (`checks.rs`).
//!
//! Nurkanović, Frey, Pozharskiy & Diehl 2024.

mod checks;
mod march;
mod path;
mod points;
mod program;
mod reference;
mod shape;
mod simulator;
mod sound;

use crate::linalg::analyses::Analyses;
use crate::linalg::largest;
use crate::optimization::mpcc;
use crate::optimization::mpcc::Options;
use crate::optimization::problem::Mpcc;
use crate::runtime::limit::Limit;

use checks::CLOSED;
pub use march::{Grid, Make, Reached};
pub use path::Piece;
pub use points::{Contacts, Points};
pub use program::{Element, Program, StepProgram, StepStart};
pub use reference::{Impact, Lowered, Reference, Slip, Slips, Target, cut};
pub use shape::{Kind, Shape};
pub use simulator::{Simulator, System};

/// Other ways that are tried, and iterations of each, where the predicted branch is none.
const MOST_WAYS: usize = 1;
const MOST_ITERATIONS: usize = 500;
/// What a program may violate, relative to its largest value.
const FEASIBLE: f64 = 1e-9;
/// Elements shorter than this, as a share of the horizon, have no mode of their own.
const SHORTEST: f64 = 1e-11;

/// Solves steps, and knows which contacts are open.
#[derive(Debug)]
pub struct Stepper {
    /// What is known at points.
    pub points: Points,
    horizon: f64,
    /// Symbolic factorizations of the programs of steps.
    analyses: Analyses,
    /// The contacts that were open in the last element, or come together at the start.
    open: Vec<bool>,
    /// Iterations, relaxed programs, and the largest violation of what was taken.
    pub work: Work,
}

/// What steps have taken.
#[derive(Clone, Copy, Debug, Default)]
pub struct Work {
    /// Iterations of Newton's method.
    pub iterations: usize,
    /// Relaxed programs.
    pub relaxed: usize,
    /// The largest violation of a program.
    pub violation: f64,
}

/// An element of a step that was taken.
#[derive(Clone, Debug)]
pub struct Passed {
    /// When it begins.
    pub from: f64,
    /// When it ends.
    pub to: f64,
    /// The contacts that strike where it begins.
    pub struck: Vec<usize>,
    /// Whether it is long enough to have a mode of its own.
    pub is_long: bool,
}

impl Stepper {
    /// At t = 0 and a state, for a horizon, with the symbolic factorizations of runs before.
    pub fn new(points: Points, analyses: Analyses, horizon: f64, x: &[f64]) -> Self {
        let mut stepper = Stepper {
            points,
            horizon,
            analyses,
            open: Vec::new(),
            work: Work::default(),
        };
        stepper.open = stepper.come_together(x);
        stepper
    }

    /// A step from where the program has been started, with a point to look near; none where there is no such step in
    /// the time that is left.
    pub fn solve<P: Program>(
        &mut self,
        step: &mut StepProgram<P>,
        near: &[f64],
        start: f64,
        limit: &Limit,
    ) -> Option<Vec<f64>> {
        let options = Options {
            trust: mpcc::Trust::First,
            effort: 0,
            feasibility: FEASIBLE,
            max_restarts: MOST_WAYS,
            iterations: mpcc::Iterations {
                run: MOST_ITERATIONS,
                ..mpcc::Iterations::default()
            },
            limit: limit.clone(),
            analyses: self.analyses.clone(),
            ..Options::default()
        };
        let program: &mut dyn Mpcc = &mut step.program;
        let found = mpcc::solve_from(program, near, &options);
        self.work.iterations += found.stats.iterations;
        self.work.relaxed += found.stats.relaxed;
        let residuals = &found.residuals;
        let violation = residuals.violation.max(residuals.complementarity);
        let size = largest(step.before(&found.w, 0)).max(1.0);
        let is_feasible = found.is_feasible() && violation <= FEASIBLE * size;
        let holds = is_feasible
            && self.stays_above(step, &found.w)
            && self.comes_to_rest(step, &found.w, start);
        if !holds {
            return None;
        }
        self.work.violation = self.work.violation.max(violation);
        Some(found.w)
    }

    /// Goes over a step, element by element.
    pub fn pass<P: Program>(
        &mut self,
        step: &StepProgram<P>,
        w: &[f64],
        (start, end): (f64, f64),
    ) -> Vec<Passed> {
        let mut t = start;
        let mut pass = |j: usize| {
            let h = w[step.elements[j].length].max(0.0);
            let from = t;
            let is_last = j + 1 == step.elements.len();
            t = if is_last { end } else { (t + h).min(end) };
            let struck = self.struck(step, w, j, &self.open);
            self.open = self.opened(step, w, j, &self.open);
            Passed {
                from,
                to: t,
                struck,
                is_long: t - from > SHORTEST * self.horizon,
            }
        };
        (0..step.elements.len()).map(&mut pass).collect()
    }

    /// α of all switches at a node of an element.
    pub fn alphas<P>(&self, step: &StepProgram<P>, w: &[f64], j: usize, m: usize) -> Vec<f64> {
        let z = &step.elements[j].algebraics[m];
        let z = z.iter().map(|z| z.map_or(f64::NAN, |z| w[z]));
        self.points.alphas(&z.collect::<Vec<_>>())
    }
}
