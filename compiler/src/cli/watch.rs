//! What is told of an experiment while it runs: a line that comes and goes on a terminal, or a log of the solver.

use nsd_solver::optimization::ipm;
use nsd_solver::optimization::mpcc::{Observer, Program};

use super::iterations::Iterations;
use super::progress::Bar;
use crate::optimize;
use crate::project::watch::{Progress, Watch};

/// Sees a run of any kind.
pub struct Watching<'w> {
    /// The line.
    pub bar: Bar,
    log: Option<Iterations<'w>>,
}

impl<'w> Watching<'w> {
    /// Shows the line only.
    pub fn new(bar: Bar) -> Self {
        Watching { bar, log: None }
    }

    /// Writes the log, too.
    pub fn logged(bar: Bar, log: Iterations<'w>) -> Self {
        let log = Some(log);
        Watching { bar, log }
    }
}

impl Observer for Watching<'_> {
    fn program(&mut self, program: &Program) {
        if let Some(log) = &mut self.log {
            log.program(program);
        }
    }

    fn iteration(&mut self, program: &Program, progress: &ipm::Progress<'_>) {
        if let Some(log) = &mut self.log {
            log.iteration(program, progress);
        }
    }
}

impl Watch for Watching<'_> {
    fn progress(&mut self, progress: &Progress<'_>) {
        let several = match progress {
            Progress::Starts(at) => at.starts > 1,
            _ => true,
        };
        match progress.share().filter(|_| several) {
            Some(share) => self.bar.show(share, || progress.to_string()),
            None if several => self.bar.note(|| progress.to_string()),
            None => {}
        }
        if let Progress::Starts(optimize::Progress { starts, last, .. }) = *progress
            && let (Some(log), Some((start, found))) = (&mut self.log, last)
        {
            log.start(start, starts, found);
        }
    }
}
