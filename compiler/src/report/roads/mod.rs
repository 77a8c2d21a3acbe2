//! Runs of one experiment by different methods and lowerings, side by side.
//!
//! All of them estimate their own errors, and have to go the same way to the same end: where two differ by more than
//! these estimates explain, one of them is wrong, or the model has several solutions and says nowhere which one is
//! meant. A run that knows of itself that it is far off confirms nothing.

mod json;
mod optima;
mod optima_text;
mod sensed;
mod text;
mod times;

pub use json::{optima as optima_json, roads as json};
pub use optima::is_feasible;
pub use optima::{Found, Optima, Resumed};
pub use optima_text::text as optima_text;
pub use sensed::Sensed;
pub use text::text;

use super::{Event, EventKind, Series, Status, Trajectory};
use crate::system::experiment::MethodKind;

/// Estimates of errors are right to about this factor (chosen by trial).
const SAFETY: f64 = 10.0;
/// What they explain at most: ends that differ by more of a state are two ends, whatever the runs say of themselves.
const MOST: f64 = 0.1;
/// Series are measured by their largest value, and those that stay below this one by this.
const LEAST_SIZE: f64 = 1e-12;
/// A run whose estimate is above this says nothing about others; one on steps that are given may know less of itself.
const MOST_ESTIMATED: f64 = 1e-2;
const MOST_ON_STEPS: f64 = 0.5;
/// An error of the order p changes with the lengths of steps, by which it is a power, p times as much: what states leave
/// to be explained is so many times less than what derivatives do.
const STEEPER: f64 = 10.0;
/// Between the points of a method states are less accurate than at these, to which estimates belong: by this at most.
const BETWEEN: f64 = 1e-3;
/// Instants this close are one, as a share of the horizon.
const SAME_INSTANT: f64 = 1e-13;
/// A run misses its own equations by this much at most.
const MOST_MISSED: f64 = 1e-3;

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
    /// The run, or why there is none to be had.
    pub run: Result<Box<Trajectory>, Refusal>,
}

/// Why an experiment is not for a method or lowering.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The codes of what keeps the method from it.
    pub codes: String,
    /// What these say.
    pub reason: String,
}

/// `E0904: jumps and contacts are not lowered by `stewart``
impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {}", self.codes, self.reason)
    }
}

/// By how much two runs differ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The last states: the largest difference of an entry, relative to the size of its state.
    pub end: f64,
    /// The same at the instants that both runs report, but for those next to an event.
    pub along: f64,
    /// The instants of events, relative to the horizon, where both runs have as many of the same kinds.
    pub times: Option<f64>,
    /// When something happens in one run first and nothing in the other one.
    pub alone: Option<f64>,
    /// Whether both methods locate events, and do not only see that there was one in a step.
    pub locates: bool,
    /// What the tolerance and the estimated errors of both leave for the difference of states.
    pub allowed: f64,
    /// The derivatives of both, where both are differentiated.
    pub sensed: Option<Sensed>,
}

impl Difference {
    /// Whether the two runs go the same way, with events at the same instants.
    pub fn is_explained(&self) -> bool {
        let times = self.times.filter(|_| self.locates);
        let alone = self.alone.filter(|_| self.locates);
        self.end <= self.allowed
            && self.along <= self.allowed.max(BETWEEN)
            && times.is_none_or(|times| times <= self.allowed)
            && alone.is_none()
            && self.has_derivatives_explained()
    }

    /// What is left for the difference of derivatives.
    pub fn allowed_of_derivatives(&self) -> f64 {
        (STEEPER * self.allowed).min(self.allowed.max(MOST))
    }

    /// Whether derivatives differ by no more.
    pub fn has_derivatives_explained(&self) -> bool {
        let allowed = self.allowed_of_derivatives();
        let sensed = self.sensed.filter(|_| self.locates);
        sensed.is_none_or(|sensed| sensed.is_explained(allowed, BETWEEN))
    }
}

impl Road {
    /// By how much rows of the system are missed at most, by the run's own account.
    fn residual(run: &Trajectory) -> f64 {
        run.quality.certificate.max_violation.max(0.0)
    }

    /// The run, where it came to the end of the horizon.
    fn solved(&self) -> Option<&Trajectory> {
        let run = self.run.as_deref().ok()?;
        (run.status == Status::Solved).then_some(run)
    }

    /// The run, where it came to the end of the horizon and vouches for it.
    fn sound(&self) -> Option<&Trajectory> {
        self.solved().filter(|_| self.doubt().is_none())
    }

    /// Whether a run came to the end and misses its own equations on the way.
    pub fn misses(&self) -> bool {
        let run = self.solved().filter(|run| !is_blind(run));
        run.is_some_and(|run| is_above(Road::residual(run), MOST_MISSED))
    }

    /// What a run that came to the end says against itself.
    pub fn doubt(&self) -> Option<&'static str> {
        let run = self.solved()?;
        let most = match is_blind(run) {
            true => MOST_ON_STEPS,
            false => MOST_ESTIMATED,
        };
        if self.misses() {
            return Some("misses its own equations");
        }
        let estimate = run.quality.error_estimate.unwrap_or(0.0);
        is_above(estimate, most).then_some("estimates that it is far off")
    }
}

/// Whether a number is above a bound, as what is no number is above every one.
fn is_above(value: f64, most: f64) -> bool {
    value.is_nan() || value > most
}

impl Roads {
    /// The difference of two runs that came to their ends. One that estimates that it is far off is believed to be no
    /// farther.
    pub fn difference(&self, a: usize, b: usize) -> Option<Difference> {
        let roads = [&self.roads[a], &self.roads[b]];
        let vouch = roads.iter().all(|road| road.sound().is_some());
        if roads.iter().any(|road| road.misses()) {
            return None;
        }
        let (a, b) = (roads[0].solved()?, roads[1].solved()?);
        let estimates = [a, b].map(|run| run.quality.error_estimate.unwrap_or(0.0));
        let estimated = SAFETY * estimates.iter().sum::<f64>();
        let allowed = match vouch {
            true => self.tolerance + estimated.min(MOST),
            false if estimated < 1.0 => self.tolerance + estimated,
            false => return None,
        };
        Some(Difference {
            end: end(a, b),
            along: along(a, b, allowed),
            times: times(a, b),
            alone: alone(a, b, allowed),
            locates: ![a, b].into_iter().any(is_blind),
            allowed,
            sensed: Sensed::of(a, b, allowed),
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

    /// How many came to the end of the horizon and vouch for it.
    pub fn n_sound(&self) -> usize {
        let sound = self.roads.iter().filter(|road| road.sound().is_some());
        sound.count()
    }

    /// How many others vouch for the experiment as it is written. A method with other options makes the mistakes of that
    /// method and confirms nothing.
    pub fn n_confirming(&self) -> usize {
        let others = (1..self.roads.len()).filter(|other| !self.is_as_written(*other));
        let confirms = |other: &usize| {
            let difference = self.difference(0, *other);
            let difference = difference.filter(|_| self.roads[*other].sound().is_some());
            difference.is_some_and(|difference| difference.is_explained())
        };
        others.filter(confirms).count()
    }

    /// Whether no other method or lowering takes the experiment.
    pub fn is_alone(&self) -> bool {
        let mut others = 1..self.roads.len();
        others.all(|other| self.roads[other].run.is_err() || self.is_as_written(other))
    }

    /// Whether a road is by the method and with the lowering of the experiment as it is written.
    fn is_as_written(&self, other: usize) -> bool {
        let run = |road: usize| self.roads[road].run.as_deref().ok();
        let pair = run(0).zip(run(other));
        pair.is_some_and(|(written, other)| {
            let (written, other) = (&written.setup.method, &other.setup.method);
            written.name == other.name && written.lowering() == other.lowering()
        })
    }

    /// How many miss their own equations.
    pub fn n_missing(&self) -> usize {
        self.roads.iter().filter(|road| road.misses()).count()
    }

    /// Whether the experiment as it is written came to its end and vouches for it, nothing contradicts it or itself, and
    /// another road confirms it if there is one.
    pub fn agree(&self) -> bool {
        self.roads[0].sound().is_some()
            && self.disagreements().is_empty()
            && self.n_missing() == 0
            && (self.n_confirming() > 0 || self.is_alone())
    }
}

/// Whether the method of a run does not look for instants of events.
fn is_blind(run: &Trajectory) -> bool {
    let method = MethodKind::named(&run.setup.method.name);
    method.is_some_and(|method| !method.locates())
}

/// The largest difference of the last states, each relative to the largest value of its state in either run.
fn end(a: &Trajectory, b: &Trajectory) -> f64 {
    let mut largest: f64 = 0.0;
    for (a, b) in a.samples.states.iter().zip(&b.samples.states) {
        let size = largest_of(&[a, b]);
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

/// The rows of instants that both runs report; next to an event both may be on different sides of it, up to `window` as a
/// share of the horizon.
fn common(a: &Trajectory, b: &Trajectory, window: f64) -> Vec<(usize, usize)> {
    let horizon = a.samples.time.last().copied().unwrap_or(0.0);
    let events: Vec<f64> = (happened(a).chain(happened(b)))
        .map(|event| event.time)
        .collect();
    let is_next = |time: f64| {
        events
            .iter()
            .any(|event| (event - time).abs() <= window * horizon)
    };
    let mut common: Vec<(usize, usize)> = Vec::new();
    let mut other = 0;
    for (k, &time) in a.samples.time.iter().enumerate() {
        let before =
            b.samples.time[other..].partition_point(|t| *t < time - SAME_INSTANT * horizon);
        other += before;
        let is_same = |t: &&f64| (**t - time).abs() <= SAME_INSTANT * horizon;
        if b.samples.time.get(other).filter(is_same).is_some() && !is_next(time) {
            common.push((k, other));
        }
    }
    common
}

/// The largest value of series.
fn largest_of(all: &[&Series]) -> f64 {
    let values = all.iter().flat_map(|series| &series.values);
    values.fold(LEAST_SIZE, |size, value| size.max(value.abs()))
}

/// The largest difference of states at instants that both runs report, relative to the largest value of its state in
/// either.
fn along(a: &Trajectory, b: &Trajectory, window: f64) -> f64 {
    let common = common(a, b, window);
    let mut largest: f64 = 0.0;
    for (a, b) in a.samples.states.iter().zip(&b.samples.states) {
        let size = largest_of(&[a, b]);
        for &(k, other) in &common {
            for (a, b) in a.at(k).iter().zip(b.at(other)) {
                let difference = (a - b).abs() / size;
                largest = match difference.is_nan() {
                    true => f64::INFINITY,
                    false => largest.max(difference),
                };
            }
        }
    }
    largest
}

/// When something happens in one of two runs first and nothing in the other one, up to `window` as a share of the
/// horizon. Events that accumulate end where their limit is known well enough, which is not the same in all runs.
fn alone(a: &Trajectory, b: &Trajectory, window: f64) -> Option<f64> {
    let horizon = a.samples.time.last().copied().unwrap_or(0.0);
    let of = |run: &Trajectory| -> Vec<f64> { happened(run).map(|event| event.time).collect() };
    let all = [of(a), of(b)];
    let is_near =
        |times: &[f64], time: f64| times.iter().any(|t| (t - time).abs() <= window * horizon);
    let found = [0, 1].into_iter().flat_map(|k| {
        let others = &all[1 - k];
        all[k]
            .iter()
            .copied()
            .filter(move |&time| !is_near(others, time))
    });
    let found = found.filter(|&time| !accumulates(a, time) && !accumulates(b, time));
    found.min_by(f64::total_cmp)
}

/// Whether an instant is within the last part of a run of events that accumulate.
fn accumulates(run: &Trajectory, time: f64) -> bool {
    let limits = run
        .history
        .events
        .iter()
        .filter(|event| event.kind == EventKind::Zeno);
    let mut limits = limits.map(|event| event.time);
    limits.any(|limit| {
        let before = happened(run).map(|event| event.time).filter(|t| *t < limit);
        let last = before.fold(f64::NEG_INFINITY, f64::max);
        time > last && time <= limit
    })
}

/// What happens in a run, whatever its method has to say about choices.
fn happened(run: &Trajectory) -> impl Iterator<Item = &Event> {
    let events = run.history.events.iter();
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
    let horizon = a.samples.time.last()? - a.samples.time.first()?;
    let pairs = events.iter().zip(&others);
    Some(pairs.fold(0.0, |largest: f64, (a, b)| {
        largest.max((a.1 - b.1).abs() / horizon)
    }))
}

#[cfg(test)]
mod optima_tests;
#[cfg(test)]
mod tests;
