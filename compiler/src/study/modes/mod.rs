//! `nsdc modes`: number and stability of the sliding modes of a nonlinear switch, along a line on its surface or over
//! two states.
//!
//! One state goes from end to end of a range; the others are those of the start, moved onto the surface where it needs
//! them. Between neighbours of a fine grid that differ in their modes, the place where they change is found by
//! bisection: a *fold*, where two modes meet, or a *bound*, where one has the value of a side. Changes that undo each
//! other within one interval of the grid are not seen.

mod plane;
mod table;

use std::ops::Range;

use nsd_solver::event::Simulator;
use nsd_solver::hybrid::Settings;

use crate::lowering::hybrid;
use crate::report::{self, Boundary, Change, Map, Sample};
use crate::system::{NamedReading, System};

pub use plane::plane;
pub use table::{plane_text, text};

/// Intervals of the grid.
const GRID: usize = 480;

/// Bisections of an interval.
const HALVINGS: usize = 60;

/// Stability below which two modes that vanish together have met, relative to the largest of all.
const FLAT: f64 = 1e-3;

/// Finds the sliding modes of a switch for values of some states.
struct Sampler<'s> {
    simulator: Simulator,
    start: Vec<f64>,
    switch: usize,
    reading: Option<&'s NamedReading>,
}

impl<'s> Sampler<'s> {
    fn new(system: &'s System, switch: usize) -> Self {
        Sampler {
            simulator: Simulator::new(hybrid::lower(system), Settings::default()),
            start: system.states.iter().map(|state| state.initial).collect(),
            switch,
            reading: system.switches[switch].named.first(),
        }
    }

    /// The value of the switch as the model has it.
    fn value(&self, alpha: f64) -> f64 {
        self.reading.map_or(alpha, |reading| reading.value(alpha))
    }

    /// Its values below and above the surface.
    fn sides(&self) -> [f64; 2] {
        [self.value(0.0), self.value(1.0)]
    }

    /// The modes where these states have these values; others are moved onto the surface where it needs them.
    fn sample(&mut self, at: f64, given: &[(usize, f64)]) -> Sample {
        let mut x = self.start.clone();
        for &(state, value) in given {
            x[state] = value;
        }
        let held: Vec<usize> = given.iter().map(|(state, _)| *state).collect();
        let modes = (self.simulator).sliding_modes(0.0, &mut x, self.switch, &held);
        let [low, high] = self.sides();
        let share = (high - low).abs().recip();
        let modes = modes.map(|modes| {
            let modes = modes.into_iter().map(|mode| report::SlidingMode {
                value: self.value(mode.alpha),
                stability: share * mode.stability,
                taken: false,
            });
            let mut modes: Vec<_> = modes.collect();
            modes.sort_by(|a, b| a.value.total_cmp(&b.value));
            modes
        });
        Sample { at, modes }
    }
}

/// Follows the modes of a nonlinear switch while a state goes through a range.
pub fn map(system: &System, switch: usize, state: usize, range: Range<f64>) -> Map {
    let mut sampler = Sampler::new(system, switch);
    let sides = sampler.sides();
    let mut sample = |at: f64| sampler.sample(at, &[(state, at)]);
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
            let found = boundary(&low, &high, sides);
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
    let mut sides = sides;
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
