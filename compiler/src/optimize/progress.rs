//! How far an optimization is.

use nsd_solver::optimization::mpcc::Solution;

/// How far an optimization is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'s> {
    /// Starts that are done.
    pub done: usize,
    /// All starts.
    pub starts: usize,
    /// The start that was done last, counted from 1, and what came of it.
    pub last: Option<(usize, &'s Solution)>,
}
