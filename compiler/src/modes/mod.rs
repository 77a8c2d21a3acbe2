//! `nsdc modes`: number and stability of the sliding modes of a nonlinear switch along a line on its surface.
//!
//! One state goes from end to end of a range; the others are those of the start, moved onto the surface where it needs
//! them. Between neighbours of a fine grid that differ in their modes, the place where they change is found by
//! bisection: a *fold*, where two modes meet, or a *bound*, where one has the value of a side. Changes that undo each
//! other within one interval of the grid are not seen.

mod table;

use std::ops::Range;

use nsd_solver::simulate::{Settings, Simulator, SlidingMode};

use crate::report::{self, Boundary, Change, Map, Sample};
use crate::simulate::Switched;
use crate::system::System;

pub use table::text;

/// Intervals of the grid.
const GRID: usize = 480;

/// Bisections of an interval.
const HALVINGS: usize = 60;

/// Stability below which two modes that vanish together have met, relative to the largest of all.
const FLAT: f64 = 1e-3;

/// Follows the modes of a nonlinear switch while a state goes through a range.
pub fn map(system: &System, switch: usize, state: usize, range: Range<f64>) -> Map {
    let switched = Switched::new(system);
    let reading = system.switches[switch].named.first();
    let value = |alpha: f64| reading.map_or(alpha, |reading| reading.value(alpha));
    let share = (value(1.0) - value(0.0)).abs().recip();
    let told = |mode: SlidingMode| report::SlidingMode {
        value: value(mode.alpha),
        stability: share * mode.stability,
        taken: false,
    };
    let mut simulator = Simulator::new(&switched, Settings::default());
    let start: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let mut sample = |at: f64| {
        let mut x = start.clone();
        x[state] = at;
        let modes = simulator.sliding_modes(0.0, &mut x, switch, &[state]);
        let modes = modes.map(|modes| {
            let mut modes: Vec<_> = modes.into_iter().map(told).collect();
            modes.sort_by(|a, b| a.value.total_cmp(&b.value));
            modes
        });
        Sample { at, modes }
    };
    let width = range.end - range.start;
    let at = |k: usize| range.start + width * k as f64 / GRID as f64;
    let mut samples = vec![sample(range.start)];
    let mut boundaries: Vec<Boundary> = Vec::new();
    for k in 1..=GRID {
        let next = sample(at(k));
        let last = samples[samples.len() - 1].clone();
        if last.pattern() != next.pattern() {
            let (mut low, mut high) = (last, next.clone());
            for _ in 0..HALVINGS {
                let middle = sample(0.5 * (low.at + high.at));
                match middle.pattern() == low.pattern() {
                    true => low = middle,
                    false => high = middle,
                }
            }
            let found = boundary(&low, &high, [value(0.0), value(1.0)]);
            // A point of the grid may be the fold itself.
            let is_same = |known: &&Boundary| {
                known.change == found.change && (known.at - found.at).abs() <= 1e-9 * width
            };
            if boundaries.last().filter(is_same).is_none() {
                boundaries.push(found);
            }
            samples.extend([low, high]);
        }
        samples.push(next);
    }
    let mut sides = [value(0.0), value(1.0)];
    sides.sort_by(f64::total_cmp);
    Map {
        switch: system.switches[switch].name.clone(),
        sides,
        state: system.states[state].name.clone(),
        samples,
        boundaries,
    }
}

/// What lies between two neighbours with different modes.
fn boundary(low: &Sample, high: &Sample, sides: [f64; 2]) -> Boundary {
    let at = 0.5 * (low.at + high.at);
    let other = Boundary {
        at,
        change: Change::Other,
        value: None,
    };
    let (Some(a), Some(b)) = (&low.modes, &high.modes) else {
        return other;
    };
    let (more, fewer) = if a.len() > b.len() { (a, b) } else { (b, a) };
    let distance = |value: f64| (sides[0] - value).abs().min((sides[1] - value).abs());
    let nearest = more.iter().map(|mode| mode.value);
    let nearest = nearest.min_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    let is_bound = more.len() - fewer.len() == 1;
    if let Some(value) = nearest.filter(|value| is_bound && distance(*value) < FLAT) {
        return Boundary {
            at,
            change: Change::Bound,
            value: Some(value),
        };
    }
    // Two have met; where they do, they are found as one.
    let largest = more.iter().map(|mode| mode.stability.abs());
    let largest = largest.fold(1.0_f64, f64::max);
    let mut flat = more
        .iter()
        .filter(|mode| mode.stability.abs() <= FLAT * largest);
    match flat.next() {
        Some(mode) => Boundary {
            at,
            change: Change::Fold,
            value: Some(mode.value),
        },
        None => other,
    }
}
