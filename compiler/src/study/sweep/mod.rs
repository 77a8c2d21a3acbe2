//! `nsdc sweep`: one experiment at many values of parameters, initial values or inputs.
//!
//! A point of the grid is a row, whatever became of its run, and rows come in the order of the grid, whatever the number of
//! threads is.

mod axis;
#[cfg(feature = "parquet")]
mod parquet;
mod table;

use std::ops::Range;

pub use axis::{Axis, Grid, SweepError};
pub use table::Table;

use crate::limit::Cancel;
use crate::report::{Samples, Series, Status, Trajectory, Warning};
use crate::threads::{self, Share};

/// What is kept of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// How it ended; none where the experiment does not compile with these values.
    pub status: Option<Status>,
    /// The code of why it did not end as it should, or of the first warning.
    pub code: Option<String>,
    /// States and outputs at the end, entry by entry; nothing where the run did not come to it.
    pub end: Vec<f64>,
    /// The value of the cost.
    pub objective: Option<f64>,
    /// How many events there were.
    pub events: usize,
    /// Estimate of the error.
    pub error_estimate: Option<f64>,
    /// How many expectations of the experiment do not hold, where it has any and the run came to its end.
    pub missed: Option<usize>,
}

impl Row {
    /// One without a run.
    pub fn refused(code: Option<String>) -> Self {
        Row {
            code,
            ..Row::default()
        }
    }

    /// What a run came to, and how many expectations it misses; one that fails has no end.
    pub fn of(run: &Trajectory, missed: Option<usize>) -> Self {
        let ends = matches!(run.status, Status::Solved | Status::Feasible);
        let last = ends.then(|| run.samples.end());
        let values = |end: Samples| {
            let series = end.states.into_iter().chain(end.outputs);
            series.flat_map(|series| series.values).collect()
        };
        let failure = run
            .failure
            .as_ref()
            .map(|failure| Warning::of(failure).code);
        let warning = || run.warnings.first().map(|warning| warning.code.clone());
        Row {
            status: Some(run.status),
            code: failure.or_else(warning),
            end: last.map(values).unwrap_or_default(),
            objective: run.objective.filter(|_| ends),
            events: run.history.events.len(),
            error_estimate: run.quality.error_estimate.filter(|_| ends),
            missed: missed.filter(|_| ends),
        }
    }
}

/// The names of what [`Row::end`] holds.
pub fn columns(run: &Trajectory) -> Vec<String> {
    let end = run.samples.end();
    let series = end.states_and_outputs();
    series.flat_map(Series::entry_names).collect()
}

/// Calls `work` with the share of each of up to `n_threads` threads in some points of a grid, by their numbers, until it is
/// told to stop; rows in the order of the grid, none where there was no more time. `heard` is told how many are done.
pub fn over(
    (grid, points): (&Grid, Range<usize>),
    n_threads: usize,
    stop: &Cancel,
    work: impl Fn(Points<'_>) + Sync,
    heard: &mut dyn FnMut(usize),
) -> Vec<Option<Row>> {
    let first = points.start;
    let each = |share: Share<'_, Row>| work(Points { grid, first, share });
    threads::in_order(points.len(), n_threads, stop, each, heard)
}

/// The points of a grid that a thread gets to.
pub struct Points<'g> {
    grid: &'g Grid,
    first: usize,
    share: Share<'g, Row>,
}

impl Points<'_> {
    /// Makes a row of every point, by its number; none of what was not brought to its end.
    pub fn each(self, mut row: impl FnMut((usize, &[f64])) -> Option<Row>) {
        while let Some(k) = self.share.next() {
            let number = self.first + k;
            if let Some(row) = row((number, &self.grid.point(number))) {
                self.share.finish(k, row);
            }
        }
    }
}
