//! What is told of an experiment while it runs: a line that comes and goes on a terminal, or a log of the solver.

use nsd_solver::ipm;
use nsd_solver::mpcc::{Observer, Program};

use super::iterations::Iterations;
use super::progress::Bar;
use crate::ensemble;
use crate::optimize::{self, Watch};
use crate::report::Trajectory;
use crate::simulate::{self, Request};
use crate::system::experiment::Settings;
use crate::threads;

/// Sees a run of any kind.
pub struct Watching<'w> {
    /// The line.
    pub bar: Bar,
    log: Option<Iterations<'w>>,
    /// Iterations of all programs.
    iterations: usize,
}

impl<'w> Watching<'w> {
    /// Shows the line only.
    pub fn new(bar: Bar) -> Self {
        Watching {
            bar,
            log: None,
            iterations: 0,
        }
    }

    /// Writes the log, too.
    pub fn logged(bar: Bar, log: Iterations<'w>) -> Self {
        Watching {
            log: Some(log),
            ..Watching::new(bar)
        }
    }

    /// Runs an experiment with all its seeds, and tells how many are done.
    pub fn ensemble(
        &mut self,
        trajectory: &mut Trajectory,
        source: ensemble::Source<'_>,
        settings: &Settings<'_>,
        request: &Request,
    ) {
        let threads = threads::count();
        let runs = settings.runs.unwrap_or(1);
        let mut heard = |done: usize| {
            let share = done as f64 / runs as f64;
            self.bar.show(share, || format!("{done} of {runs} runs"));
        };
        ensemble::add(trajectory, source, settings, request, threads, &mut heard);
    }

    /// How far a simulation is.
    pub fn simulation(&mut self, progress: simulate::Progress) {
        self.bar.update(progress);
    }
}

impl Observer for Watching<'_> {
    fn program(&mut self, program: &Program) {
        if let Some(log) = &mut self.log {
            log.program(program);
        }
    }

    fn iteration(&mut self, program: &Program, progress: &ipm::Progress<'_>) {
        self.iterations += 1;
        let what = match program {
            Program::Smooth => "",
            Program::Relaxed { .. } => ", relaxation",
            Program::Branch => ", branch",
        };
        self.bar.note(|| {
            format!(
                "{} iterations, objective {:.6e}, violation {:.1e}{what}",
                self.iterations, progress.objective, progress.primal
            )
        });
        if let Some(log) = &mut self.log {
            log.iteration(program, progress);
        }
    }
}

impl Watch for Watching<'_> {
    fn progress(&mut self, progress: &optimize::Progress<'_>) {
        let optimize::Progress { done, starts, last } = *progress;
        if starts > 1 {
            let share = done as f64 / starts as f64;
            self.bar
                .show(share, || format!("{done} of {starts} starts"));
        }
        if let (Some(log), Some((start, found))) = (&mut self.log, last) {
            log.start(start, starts, found);
        }
    }
}
