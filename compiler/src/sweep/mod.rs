//! `nsdc sweep`: one experiment at many values of parameters, initial values or inputs.
//!
//! A point of the grid is a row, whatever became of its run, and rows come in the order of the grid, whatever the number of
//! threads is.

mod axis;
mod table;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread;

pub use axis::{Axis, Grid, SweepError};
pub use table::Table;

use crate::report::{Series, Status, Trajectory, Warning};

/// What is kept of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// How it ended; none where the experiment does not compile with these values.
    pub status: Option<Status>,
    /// The code of why it did not end as it should, or of its first warning.
    pub code: Option<String>,
    /// States and outputs at the end, entry by entry; nothing where the run did not start.
    pub end: Vec<f64>,
    /// The value of the cost.
    pub objective: Option<f64>,
    /// How many events there were.
    pub events: usize,
    /// Estimate of the error.
    pub error_estimate: Option<f64>,
}

impl Row {
    /// One without a run.
    pub fn refused(code: Option<String>) -> Self {
        Row {
            code,
            ..Row::default()
        }
    }

    /// What a run came to.
    pub fn of(run: &Trajectory) -> Self {
        let last = run.time.len().checked_sub(1);
        let reported = || run.states.iter().chain(&run.outputs);
        let end = last.map(|last| {
            reported()
                .flat_map(|series| series.at(last).to_vec())
                .collect()
        });
        let failure = run
            .failure
            .as_ref()
            .map(|failure| Warning::of(failure).code);
        let warning = || run.warnings.first().map(|warning| warning.code.clone());
        Row {
            status: Some(run.status),
            code: failure.or_else(warning),
            end: end.unwrap_or_default(),
            objective: run.objective,
            events: run.events.len(),
            error_estimate: run.error_estimate,
        }
    }
}

/// The names of what [`Row::end`] holds.
pub fn columns(run: &Trajectory) -> Vec<String> {
    let reported = run.states.iter().chain(&run.outputs);
    reported.flat_map(Series::entry_names).collect()
}

/// Calls `work` with every point of a grid, on up to `n_threads` threads, until it is told to stop; rows in the order of
/// the grid, none where there was no more time. `heard` is told how many are done.
pub fn over(
    grid: &Grid,
    n_threads: usize,
    stop: &AtomicBool,
    work: impl Fn(&[f64]) -> Row + Sync,
    heard: &mut dyn FnMut(usize),
) -> Vec<Option<Row>> {
    let count = grid.len();
    let next = AtomicUsize::new(0);
    let each = |found: mpsc::Sender<(usize, Row)>| {
        while !stop.load(Ordering::Relaxed)
            && let point = next.fetch_add(1, Ordering::Relaxed)
            && point < count
        {
            if found.send((point, work(&grid.point(point)))).is_err() {
                return;
            }
        }
    };
    let mut rows = vec![None; count];
    thread::scope(|scope| {
        let (sender, found) = mpsc::channel();
        for _ in 0..n_threads.clamp(1, count.max(1)) {
            let sender = sender.clone();
            scope.spawn(|| each(sender));
        }
        drop(sender);
        for (done, (point, row)) in found.into_iter().enumerate() {
            rows[point] = Some(row);
            heard(done + 1);
        }
    });
    rows
}
