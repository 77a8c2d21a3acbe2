//! What a run tells while it goes on.

use std::ops::ControlFlow;

use super::relaxed::{Coupling, Form};
use crate::optimization::ipm;
use crate::optimization::mpcc::certificate::class::Class;

/// A program that the interior-point method is given on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Program {
    /// The problem itself: it has no pairs.
    Smooth,
    /// A relaxation.
    Relaxed {
        /// Its functions.
        form: Form,
        /// The parameter σ of the relaxation as a function of the barrier parameter μ.
        coupling: Coupling,
    },
    /// A branch: one side of every pair is held at zero.
    Branch,
}

impl Program {
    /// The parameter σ of a relaxation at the barrier parameter μ; none for other programs.
    pub fn sigma(&self, mu: f64) -> Option<f64> {
        match self {
            Program::Relaxed { coupling, .. } => Some(coupling.sigma(mu)),
            Program::Smooth | Program::Branch => None,
        }
    }
}

/// Sees every program and every iteration.
pub trait Observer {
    /// A program is going to be solved.
    fn program(&mut self, _program: &Program) {}

    /// A stationary point with this objective has been found; the search for better ones goes on.
    fn stationary(&mut self, _objective: f64, _class: Class) {}

    /// An iteration of the program named last.
    fn iteration(&mut self, _program: &Program, _progress: &ipm::Progress<'_>) {}
}

/// Sees nothing.
impl Observer for () {}

/// Shows an interior-point run to an observer, and ends it where another one asks for that.
pub(crate) struct Shown<'w> {
    pub program: Program,
    pub observer: &'w mut dyn Observer,
    pub inner: &'w mut dyn ipm::Observer,
}

impl ipm::Observer for Shown<'_> {
    fn iteration(&mut self, progress: &ipm::Progress<'_>) -> ControlFlow<()> {
        self.observer.iteration(&self.program, progress);
        self.inner.iteration(progress)
    }
}
