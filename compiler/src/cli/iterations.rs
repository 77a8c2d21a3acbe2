//! One line per iteration of the solver.

use std::io::Write;

use nsd_solver::optimization::ipm::Progress;
use nsd_solver::optimization::mpcc::{Observer, Program, Solution, Steering};

use crate::report::forms::text::{duration, significant};
use crate::system::experiment::{relaxation_word, steering_word};

/// Writes the lines; what cannot be written is left out.
pub struct Iterations<'w> {
    out: &'w mut dyn Write,
}

impl<'w> Iterations<'w> {
    /// Lines for this writer.
    pub fn new(out: &'w mut dyn Write) -> Self {
        Iterations { out }
    }

    /// What came of one start of several.
    pub fn start(&mut self, number: usize, starts: usize, found: &Solution) {
        let what = match found.is_feasible() {
            true => format!("objective {}", significant(found.objective, 10)),
            false => format!("violation {:.1e}", found.residuals.violation),
        };
        let (iterations, seconds) = (found.stats.iterations, duration(found.stats.seconds));
        let _ = writeln!(
            self.out,
            "start {number} of {starts}: {}, {what}, {iterations} iterations, {seconds}",
            found.status
        );
    }
}

impl Observer for Iterations<'_> {
    fn program(&mut self, program: &Program) {
        let name = match program {
            Program::Smooth => "program without pairs".to_owned(),
            Program::Branch => "branch".to_owned(),
            Program::Relaxed { form, .. } if form.steering == Steering::Direct => {
                format!("relaxation: {}", relaxation_word(form.relaxation))
            }
            Program::Relaxed { form, .. } => format!(
                "relaxation: {}, {}",
                relaxation_word(form.relaxation),
                steering_word(form.steering)
            ),
        };
        let _ = writeln!(self.out, "\n{name}\n{}     sigma", Progress::HEADER);
    }

    fn iteration(&mut self, program: &Program, progress: &Progress<'_>) {
        let _ = match program.sigma(progress.mu) {
            Some(sigma) => writeln!(self.out, "{progress} {sigma:9.1e}"),
            None => writeln!(self.out, "{progress}         -"),
        };
    }
}
