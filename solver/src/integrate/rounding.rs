//! Rates that are rounding: terms that cancel within an expression, which no change of its inputs shows.
//!
//! A rate f_i is zero within rounding where |f_i| is no larger than its running error δ_i. What it makes of a state
//! that is zero is noise, without digits to be relative to: in a step h no more than δ_i h is known of it, and the size
//! of the terms of f_i is that of numbers whose rounding is δ_i.

use super::probes::Probes;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{Scales, refill};
use crate::expansion::step_size::StepSize;
use crate::tape::{Ball, Rounded};

/// Chains of states that pass on each other's rounding, at most this long.
const PASSES: usize = 4;

/// A series has its roundings, and so has the function that it is compared with.
const SHARED: f64 = 4.0;

/// Terms are larger than was known of them by more than this: the sizes that derivatives show fall short by less.
const LARGER: f64 = 8.0;

/// Roundings of the terms of its rate, up to which a state is nothing but rounding.
const HELD: f64 = 8.0;

/// A step that is shorter than this share of the one before may be so for rounding.
const SHRINKS: f64 = 0.5;

/// A point of a step: the inputs of functions there, and the rates that a series has instead.
#[derive(Default)]
pub(super) struct Inputs {
    pub values: Vec<f64>,
    pub rates: Vec<f64>,
}

/// Running errors of rates.
#[derive(Default)]
pub(crate) struct Rounding {
    registers: Vec<Rounded>,
    points: [Inputs; 4],
    /// Of every rate that is zero within its running error, that error; 0 of others.
    errors: Vec<f64>,
    /// How far that moves states that are nothing but rounding.
    moved: Vec<f64>,
    /// The errors in the pass at hand.
    next: Vec<f64>,
    /// The states whose rates are in doubt.
    doubted: Vec<bool>,
}

impl Rounding {
    /// The step size, where it is known whether rates are rounding: a first step, and one that is much shorter than the
    /// one before, take a look.
    pub(crate) fn step_size(
        &mut self,
        mode: &Mode,
        tolerance: f64,
        scales: &mut Scales,
        [remaining, longest]: [f64; 2],
    ) -> f64 {
        let step_size = StepSize { mode, tolerance };
        let mut h = step_size.of_states(scales, longest);
        if scales.last_step > 0.0 && h >= SHRINKS * scales.last_step.min(remaining) {
            return h;
        }
        // Rounding of a state moves those that follow it by what a step is long.
        for _ in 0..PASSES {
            if !self.starts_at_rounding(mode, scales, h) {
                break;
            }
            h = step_size.of_states(scales, longest);
        }
        h
    }

    /// Whether rates are zero within rounding at the expansion point, and their terms larger than was known of them. A
    /// step from there has length h.
    fn starts_at_rounding(&mut self, mode: &Mode, scales: &mut Scales, h: f64) -> bool {
        let start = &mut self.points[0];
        start.values.clone_from(&mode.memory.values);
        refill(&mut start.rates, mode.n, 0.0);
        refill(&mut self.doubted, mode.n, true);
        self.raise(mode, scales, h, 1)
    }

    /// The same along the step probed last: there the rates of the series are those of the functions, but for rounding.
    pub(crate) fn differs(
        &mut self,
        mode: &Mode,
        probes: &Probes,
        scales: &mut Scales,
        h: f64,
        allowed: f64,
    ) -> bool {
        for (k, point) in self.points.iter_mut().enumerate() {
            probes.copy(k, point);
        }
        self.doubted.clear();
        let doubted = (0..mode.n).map(|i| probes.differs(mode, i, h, allowed));
        self.doubted.extend(doubted);
        self.raise(mode, scales, h, self.points.len())
    }

    /// Raises the activity of states in doubt whose rates are the given ones within rounding at all of some points.
    fn raise(&mut self, mode: &Mode, scales: &mut Scales, h: f64, n_points: usize) -> bool {
        refill(&mut self.errors, mode.n, 0.0);
        refill(&mut self.moved, mode.n, 0.0);
        self.pass(mode, n_points);
        // A state with digits of its own is as well known as these, however fast it is pulled back.
        for (i, moved) in self.moved.iter_mut().enumerate() {
            let noise = self.errors[i] * h;
            let is_noise = scales.largest[i] <= HELD * (f64::EPSILON * scales.work[i] + noise);
            *moved = if is_noise { noise } else { 0.0 };
        }
        if self.moved.iter().any(|moved| *moved > 0.0) {
            self.pass(mode, n_points);
        }
        let mut raised = false;
        let known = scales.activity.iter_mut().zip(&self.errors);
        let known = known.zip(&self.doubted).filter(|(_, doubted)| **doubted);
        for ((activity, error), _) in known {
            let terms = error / f64::EPSILON;
            if terms > LARGER * *activity {
                *activity = terms;
                raised = true;
            }
        }
        raised
    }

    /// Running errors of all rates, where rounding has moved states.
    fn pass(&mut self, mode: &Mode, n_points: usize) {
        let Rounding {
            registers,
            points,
            errors,
            moved,
            next,
            ..
        } = self;
        refill(next, mode.n, 0.0);
        for Inputs { values, rates } in &points[..n_points] {
            let input = |slot: usize| {
                let moved = match slot {
                    1.. if slot <= mode.n => moved[slot - 1],
                    _ => 0.0,
                };
                Ball::new(values[slot], moved)
            };
            for block in 0..mode.field.n_blocks() {
                let see = |state: usize, rate: Rounded| {
                    let rate = rate.ball();
                    let differs = (rate.middle - rates[state]).abs();
                    let is_zero = rate.radius.is_finite() && differs <= SHARED * rate.radius;
                    next[state] = match is_zero {
                        true => rate.radius.max(next[state]),
                        false => f64::INFINITY,
                    };
                };
                mode.field.examine(block, input, registers, see);
            }
        }
        for (error, next) in errors.iter_mut().zip(next) {
            *error = if next.is_finite() { *next } else { 0.0 };
        }
    }
}
