//! What is told of a run while it goes on.

use std::fmt;

use nsd_solver::optimization::ipm;
use nsd_solver::optimization::mpcc::{Observer, Program};

use crate::optimize::progress;
use crate::simulate;

/// How far a run is; as text, what it is doing.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'s> {
    /// A simulation.
    Simulation(simulate::Progress),
    /// An optimization: a solver goes on.
    Iteration(Iteration),
    /// An optimization with several starts, or one of them: a start is done, or none yet.
    Starts(progress::Progress<'s>),
    /// An ensemble.
    Runs {
        /// Runs that are done.
        done: usize,
        /// All runs.
        runs: usize,
    },
}

/// Where a solver of programs is.
#[derive(Clone, Copy, Debug)]
pub struct Iteration {
    /// Iterations of all programs.
    pub count: usize,
    /// What is solved.
    pub program: Program,
    /// The objective.
    pub objective: f64,
    /// The largest violation of a constraint.
    pub violation: f64,
}

impl Progress<'_> {
    /// The share that is done; nothing where nobody knows how much is left.
    pub fn share(&self) -> Option<f64> {
        match self {
            Progress::Simulation(at) => Some(at.time / at.horizon),
            Progress::Iteration(_) => None,
            Progress::Starts(at) => Some(at.done as f64 / at.starts as f64),
            Progress::Runs { done, runs } => Some(*done as f64 / *runs as f64),
        }
    }
}

impl fmt::Display for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Progress::Simulation(at) => {
                let what = match at.estimates {
                    true => "second run, ",
                    false => "",
                };
                let simulate::Progress {
                    time,
                    horizon,
                    steps,
                    events,
                    ..
                } = at;
                write!(
                    f,
                    "{what}t = {time:.4} of {horizon}, {steps} steps, {events} events"
                )
            }
            Progress::Iteration(at) => {
                let what = match at.program {
                    Program::Smooth => "",
                    Program::Relaxed { .. } => ", relaxation",
                    Program::Branch => ", branch",
                };
                write!(
                    f,
                    "{} iterations, objective {:.6e}, violation {:.1e}{what}",
                    at.count, at.objective, at.violation
                )
            }
            Progress::Starts(at) => write!(f, "{} of {} starts", at.done, at.starts),
            Progress::Runs { done, runs } => write!(f, "{done} of {runs} runs"),
        }
    }
}

/// Sees a run of any kind while it goes on: how far it is, and of an optimization every iteration.
pub trait Watch: Observer {
    /// The run is this far.
    fn progress(&mut self, _progress: &Progress<'_>) {}
}

/// Sees nothing.
impl Watch for () {}

/// Tells a function how far a run is.
pub struct Told<F>(
    /// The function.
    pub F,
);

impl<F> Observer for Told<F> {}

impl<F: FnMut(&Progress<'_>)> Watch for Told<F> {
    fn progress(&mut self, progress: &Progress<'_>) {
        (self.0)(progress);
    }
}

/// Passes on what a solver does, and tells how many iterations there were.
pub(crate) struct Counted<'w> {
    watch: &'w mut dyn Watch,
    count: usize,
}

impl<'w> Counted<'w> {
    pub fn new(watch: &'w mut dyn Watch) -> Self {
        Counted { watch, count: 0 }
    }
}

impl Observer for Counted<'_> {
    fn program(&mut self, program: &Program) {
        self.watch.program(program);
    }

    fn stationary(&mut self, objective: f64, class: nsd_solver::optimization::mpcc::Class) {
        self.watch.stationary(objective, class);
    }

    fn iteration(&mut self, program: &Program, progress: &ipm::Progress<'_>) {
        self.count += 1;
        self.watch.progress(&Progress::Iteration(Iteration {
            count: self.count,
            program: *program,
            objective: progress.objective,
            violation: progress.primal,
        }));
        self.watch.iteration(program, progress);
    }
}

impl Watch for Counted<'_> {
    fn progress(&mut self, progress: &Progress<'_>) {
        self.watch.progress(progress);
    }
}
