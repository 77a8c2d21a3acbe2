mod hock_schittkowski;
mod jet;
mod pivots;
mod program;
mod shapes;

use std::ops::ControlFlow;

use super::{Options, Progress, Solution, solve};
use crate::optimization::problem::Nlp;

/// Solves from the problem's own start.
fn run(nlp: &mut dyn Nlp) -> Solution {
    solve(nlp, &Options::default(), None, &mut ())
}

/// The log of a run, for messages of tests that fail.
fn log(nlp: &mut dyn Nlp, options: &Options) -> String {
    let mut text = format!("{}\n", Progress::HEADER);
    let mut observer = |progress: &Progress<'_>| {
        text += &format!("{progress}\n");
        ControlFlow::Continue(())
    };
    solve(nlp, options, None, &mut observer);
    text
}
