//! Runs of one experiment by different methods and lowerings, side by side.
//!
//! All of them estimate their own errors, and have to come to the same end: where two differ by more than these
//! estimates explain, one of them is wrong, or the model has several solutions and says nowhere which one is meant.

mod json;
mod optima;
mod optima_text;
mod text;
mod times;

pub use json::{optima as optima_json, roads as json};
pub(crate) use optima::is_feasible;
pub use optima::{Found, Optima, Resumed};
pub use optima_text::text as optima_text;
pub use text::text;

use super::{Event, EventKind, Series, Status, Trajectory};

/// Estimates of errors are right to about this factor (chosen by trial).
const SAFETY: f64 = 10.0;
/// What they explain at most: ends that differ by more of a state are two ends, whatever the runs say of themselves.
const MOST: f64 = 0.1;
/// Series are measured by their largest value, and those that stay below this one by this.
const LEAST_SIZE: f64 = 1e-12;

/// The runs of one experiment.
#[derive(Debug)]
pub struct Roads {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the model.
    pub model: String,
    /// The difference that needs no explanation, relative to the size of each state.
    pub tolerance: f64,
    /// The runs.
    pub roads: Vec<Road>,
}

/// One of them.
#[derive(Debug)]
pub struct Road {
    /// Method and lowering.
    pub name: String,
    /// The run, or the code of what keeps the method from it.
    pub run: Result<Box<Trajectory>, String>,
}

/// By how much two runs differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The last states: the largest difference of an entry, relative to the size of its state.
    pub end: f64,
    /// The instants of events, relative to the horizon, where both runs have as many of the same kinds.
    pub times: Option<f64>,
    /// Whether both methods locate events, and do not only see that there was one in a step.
    pub locates: bool,
    /// What the tolerance and the estimated errors of both leave for the difference of the last states.
    pub allowed: f64,
}

impl Difference {
    /// Whether the two runs come to the same end, at the same instants where they have the same events.
    pub fn is_explained(&self) -> bool {
        let times = self.times.filter(|_| self.locates);
        self.end <= self.allowed && times.is_none_or(|times| times <= self.allowed)
    }
}

impl Road {
    /// By how much rows of the system are missed at most, by the run's own account.
    fn residual(run: &Trajectory) -> f64 {
        run.certificate.max_violation.max(0.0)
    }

    /// The run, where it came to the end of the horizon.
    fn solved(&self) -> Option<&Trajectory> {
        let run = self.run.as_deref().ok()?;
        (run.status == Status::Solved).then_some(run)
    }
}

impl Roads {
    /// The difference of two runs that came to their ends.
    pub fn difference(&self, a: usize, b: usize) -> Option<Difference> {
        let (a, b) = (self.roads[a].solved()?, self.roads[b].solved()?);
        let estimates = [a, b].map(|run| run.error_estimate.unwrap_or(0.0));
        Some(Difference {
            end: end(a, b),
            times: times(a, b),
            locates: ![a, b].into_iter().any(is_blind),
            allowed: self.tolerance + (SAFETY * estimates.iter().sum::<f64>()).min(MOST),
        })
    }

    /// Pairs whose difference is not explained.
    pub fn disagreements(&self) -> Vec<(usize, usize)> {
        let n = self.roads.len();
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
        let differs = |&(a, b): &(usize, usize)| {
            self.difference(a, b)
                .is_some_and(|difference| !difference.is_explained())
        };
        pairs.filter(differs).collect()
    }

    /// How many came to the end of the horizon.
    pub fn n_solved(&self) -> usize {
        let solved = self.roads.iter().filter(|road| road.solved().is_some());
        solved.count()
    }

    /// Whether the experiment as it is written came to its end, and nothing contradicts it.
    pub fn agree(&self) -> bool {
        self.roads[0].solved().is_some() && self.disagreements().is_empty()
    }
}

/// Whether the method of a run does not look for instants of events.
fn is_blind(run: &Trajectory) -> bool {
    ["timestepping", "adaptive"].contains(&&*run.method.name)
}

/// The largest difference of the last states, each relative to the largest value of its state in either run.
fn end(a: &Trajectory, b: &Trajectory) -> f64 {
    let mut largest: f64 = 0.0;
    for (a, b) in a.states.iter().zip(&b.states) {
        let values = a.values.iter().chain(&b.values);
        let size = values.fold(LEAST_SIZE, |size, value| size.max(value.abs()));
        let last = |series: &Series| {
            let first = series.values.len().saturating_sub(series.n_entries());
            series.values[first..].to_vec()
        };
        for (a, b) in last(a).iter().zip(last(b)) {
            let difference = (a - b).abs() / size;
            // A number that is none differs from all.
            largest = match difference.is_nan() {
                true => f64::INFINITY,
                false => largest.max(difference),
            };
        }
    }
    largest
}

/// What happens in a run, whatever its method has to say about choices.
fn happened(run: &Trajectory) -> impl Iterator<Item = &Event> {
    let events = run.events.iter();
    events.filter(|event| event.kind != EventKind::Branch)
}

/// The largest difference of the instants of events, relative to the horizon.
fn times(a: &Trajectory, b: &Trajectory) -> Option<f64> {
    let of = |run: &Trajectory| {
        let events = happened(run);
        let mut found: Vec<(EventKind, f64)> =
            events.map(|event| (event.kind, event.time)).collect();
        found.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        found
    };
    let (events, others) = (of(a), of(b));
    let kinds = |events: &[(EventKind, f64)]| -> Vec<EventKind> {
        events.iter().map(|&(kind, _)| kind).collect()
    };
    if kinds(&events) != kinds(&others) {
        return None;
    }
    let horizon = a.time.last()? - a.time.first()?;
    let pairs = events.iter().zip(&others);
    Some(pairs.fold(0.0, |largest: f64, (a, b)| {
        largest.max((a.1 - b.1).abs() / horizon)
    }))
}

#[cfg(test)]
mod optima_tests;
#[cfg(test)]
mod tests;
