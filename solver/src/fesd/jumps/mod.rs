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
mod program;

use crate::linalg::largest;
use crate::optimization::mpcc;
use crate::optimization::mpcc::Options;
use crate::optimization::problem::Mpcc;
use crate::runtime::limit::Limit;
use crate::tape::{Scratch, Tape};

pub use checks::CLOSED;
pub use program::{Element, Program, StepProgram, StepStart};

/// Other ways that are tried, and iterations of each, where the predicted branch is none.
const MOST_WAYS: usize = 1;
const MOST_ITERATIONS: usize = 500;
/// What a program may violate, relative to its largest value.
const FEASIBLE: f64 = 1e-9;
/// Elements shorter than this, as a share of the horizon, have no mode of their own.
const SHORTEST: f64 = 1e-11;

/// The contacts of a system.
#[derive(Clone, Debug)]
pub struct Contacts {
    /// The places of their gaps among z.
    pub gaps: Vec<usize>,
    /// The places of their forces.
    pub forces: Vec<usize>,
    /// The rate of the gap, the restitution and the friction of every contact, in t, x and parameters.
    pub laws: Tape,
    /// These.
    pub parameters: Vec<f64>,
}

/// Solves steps, and knows which contacts are open.
#[derive(Debug)]
pub struct Stepper {
    contacts: Contacts,
    horizon: f64,
    /// The contacts that were open in the last element, or come together at the start.
    open: Vec<bool>,
    inputs: Vec<f64>,
    values: Vec<f64>,
    scratch: Scratch,
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
    /// At t = 0 and a state, for a horizon.
    pub fn new(contacts: Contacts, horizon: f64, x: &[f64]) -> Self {
        let mut stepper = Stepper {
            horizon,
            open: Vec::new(),
            inputs: Vec::with_capacity(1 + x.len() + contacts.parameters.len()),
            values: vec![0.0; contacts.laws.n_outputs()],
            scratch: contacts.laws.scratch(),
            contacts,
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
            trusts_start: true,
            effort: 0,
            feasibility: FEASIBLE,
            max_restarts: MOST_WAYS,
            max_iterations: MOST_ITERATIONS,
            limit: limit.clone(),
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

    /// The rate of the gap, the restitution and the friction of every contact at an instant and a state.
    fn laws(&mut self, t: f64, x: &[f64]) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.inputs.clear();
        self.inputs.push(t);
        self.inputs.extend_from_slice(x);
        self.inputs.extend_from_slice(&self.contacts.parameters);
        let (inputs, scratch) = (&self.inputs, &mut self.scratch);
        self.contacts.laws.eval(inputs, &mut self.values, scratch);
        let laws = self.values.chunks_exact(3);
        laws.map(|law| [law[0], law[1], law[2]])
    }
}
