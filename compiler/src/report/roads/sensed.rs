//! By how much derivatives of two runs differ, where both have them.
//!
//! The derivative of a state x by p is measured by its largest value in either run, and where that is small by the part of
//! x that a change of p by itself, or what p changes most, is to others: there is no more to be known of a state that
//! hardly depends on p.

use super::{LEAST_SIZE, SAME_INSTANT, common, largest_of};
use crate::report::{Moves, Sensitivity, Trajectory};

/// The part of x that counts.
const SMALL: f64 = 1e-3;

/// By how much derivatives differ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensed {
    /// Those of the last states, relative to their sizes.
    pub end: f64,
    /// The same at the instants that both runs report, but for those next to an event.
    pub along: f64,
    /// Those of the instants of events, relative to the largest of them.
    pub times: f64,
}

impl Sensed {
    /// Of two runs, where an event is known to `window` as a share of the horizon; none where they have no direction in
    /// common.
    pub fn of(a: &Trajectory, b: &Trajectory, window: f64) -> Option<Self> {
        let rows = common(a, b, window);
        let horizon = a.samples.time.last().copied().unwrap_or(0.0);
        let mut found: Option<Sensed> = None;
        for own in &a.samples.sensitivities {
            let mut others = b.samples.sensitivities.iter();
            let Some(other) = others.find(|other| other.to == own.to) else {
                continue;
            };
            let unit = unit(a, own, other);
            let all = found.get_or_insert_default();
            for ((x, own), other) in a.samples.states.iter().zip(&own.states).zip(&other.states) {
                let floor = SMALL * largest_of(&[x]) * unit;
                let size = largest_of(&[own, other]).max(floor);
                let at =
                    |&(k, other_k): &(usize, usize)| farthest(own.at(k), other.at(other_k)) / size;
                all.along = rows.iter().map(at).fold(all.along, f64::max);
                let is_last = |&&(k, _): &&(usize, usize)| {
                    (a.samples.time[k] - horizon).abs() <= SAME_INSTANT * horizon
                };
                all.end = rows.iter().filter(is_last).map(at).fold(all.end, f64::max);
            }
            let times = moved(
                (&own.events, &other.events),
                window * horizon,
                SMALL * horizon * unit,
            );
            all.times = all.times.max(times);
        }
        found
    }

    /// Whether that much is explained where this is allowed at the ends, and `between` at least on the way.
    pub fn is_explained(&self, allowed: f64, between: f64) -> bool {
        self.end <= allowed && self.times <= allowed && self.along <= allowed.max(between)
    }
}

/// The part of itself by which a state that is as sensitive as any changes with p: one over the size of p, if that is more.
fn unit(run: &Trajectory, own: &Sensitivity, other: &Sensitivity) -> f64 {
    let states = run
        .samples
        .states
        .iter()
        .zip(&own.states)
        .zip(&other.states);
    let shares = states.map(|((x, own), other)| largest_of(&[own, other]) / largest_of(&[x]));
    let value = value(run, &own.to).unwrap_or(0.0).abs();
    let share = if value > 0.0 { 1.0 / value } else { 0.0 };
    shares.fold(share, f64::max)
}

/// The number by which a run is differentiated.
fn value(run: &Trajectory, to: &str) -> Option<f64> {
    let name = to.strip_suffix(" at 0");
    let all = match name {
        Some(_) => &run.samples.states,
        None => &run.setup.parameters,
    };
    let name = name.unwrap_or(to);
    all.iter().find_map(|series| {
        let place = series
            .entry_names()
            .iter()
            .position(|entry| entry == name)?;
        series.at(0).get(place).copied()
    })
}

/// The largest difference of two rows, where both are numbers.
fn farthest(own: &[f64], other: &[f64]) -> f64 {
    let both = own.iter().zip(other).map(|(a, b)| (a - b).abs());
    both.filter(|difference| !difference.is_nan())
        .fold(0.0, f64::max)
}

/// The largest difference of derivatives of instants that both have, up to `window`, relative to the largest of them or
/// `floor`.
fn moved((own, others): (&[Moves], &[Moves]), window: f64, floor: f64) -> f64 {
    let sizes = own.iter().chain(others).map(|moves| moves.derivative.abs());
    let size = sizes
        .filter(|size| size.is_finite())
        .fold(floor.max(LEAST_SIZE), f64::max);
    let is_near = |a: &Moves, b: &Moves| (a.time - b.time).abs() <= window;
    let single =
        |all: &[Moves], one: &Moves| all.iter().filter(|other| is_near(one, other)).count() == 1;
    let pairs = own.iter().filter_map(|one| {
        let other = others.iter().find(|other| is_near(one, other))?;
        // Of several events at one instant nobody knows which is which.
        (single(own, one) && single(others, one)).then_some((one, other))
    });
    let differences = pairs.map(|(a, b)| (a.derivative - b.derivative).abs() / size);
    differences
        .filter(|difference| !difference.is_nan())
        .fold(0.0, f64::max)
}
