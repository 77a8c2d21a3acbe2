//! Rates that are rounding: terms that cancel within an expression, which no change of its inputs shows.
//!
//! A rate f_i is zero within rounding where |f_i| is no larger than its running error δ_i. What it makes of a state
//! that is zero is noise, without digits to be relative to: in a step h no more than δ_i h is known of it, and the size
//! of the terms of f_i is that of numbers whose rounding is δ_i.

use super::mode::Mode;
use super::terms::{Inputs, Rounding};
use crate::expansion::scales::Scales;
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

impl Mode {
    /// The step size, where it is known whether rates are rounding: a first step, and one that is much shorter than the
    /// one before, take a look.
    pub(crate) fn step_size_above_rounding(
        &mut self,
        tolerance: f64,
        scales: &mut Scales,
        [remaining, longest]: [f64; 2],
    ) -> f64 {
        let mut h = self.step_size(tolerance, scales, longest);
        if scales.last_step > 0.0 && h >= SHRINKS * scales.last_step.min(remaining) {
            return h;
        }
        // Rounding of a state moves those that follow it by what a step is long.
        for _ in 0..PASSES {
            if !self.starts_at_rounding(scales, h) {
                break;
            }
            h = self.step_size(tolerance, scales, longest);
        }
        h
    }

    /// Whether rates are zero within rounding at the expansion point, and their terms larger than was known of them. A
    /// step from there has length h.
    fn starts_at_rounding(&mut self, scales: &mut Scales, h: f64) -> bool {
        let mut rounding = std::mem::take(&mut self.rounding);
        let start = &mut rounding.points[0];
        start.values.clone_from(&self.memory.values);
        start.rates.clear();
        start.rates.resize(self.n, 0.0);
        rounding.doubted.clear();
        rounding.doubted.resize(self.n, true);
        let raised = self.raise(scales, h, 1, &mut rounding);
        self.rounding = rounding;
        raised
    }

    /// The same along the step probed last: there the rates of the series are those of the functions, but for rounding.
    pub(crate) fn differs_by_rounding(
        &mut self,
        scales: &mut Scales,
        h: f64,
        allowed: f64,
    ) -> bool {
        let mut rounding = std::mem::take(&mut self.rounding);
        for (k, point) in rounding.points.iter_mut().enumerate() {
            self.probed_point(k, &mut point.values, &mut point.rates);
        }
        rounding.doubted.clear();
        let doubted = (0..self.n).map(|i| self.differs(i, h, allowed));
        rounding.doubted.extend(doubted);
        let raised = self.raise(scales, h, rounding.points.len(), &mut rounding);
        self.rounding = rounding;
        raised
    }

    /// Raises the activity of states in doubt whose rates are the given ones within rounding at all of some points.
    fn raise(&self, scales: &mut Scales, h: f64, points: usize, rounding: &mut Rounding) -> bool {
        rounding.errors.clear();
        rounding.errors.resize(self.n, 0.0);
        rounding.moved.clear();
        rounding.moved.resize(self.n, 0.0);
        self.pass(rounding, points);
        // A state with digits of its own is as well known as these, however fast it is pulled back.
        for (i, moved) in rounding.moved.iter_mut().enumerate() {
            let noise = rounding.errors[i] * h;
            let is_noise = scales.largest[i] <= HELD * (f64::EPSILON * scales.work[i] + noise);
            *moved = if is_noise { noise } else { 0.0 };
        }
        if rounding.moved.iter().any(|moved| *moved > 0.0) {
            self.pass(rounding, points);
        }
        let mut raised = false;
        let known = scales.activity.iter_mut().zip(&rounding.errors);
        let known = known
            .zip(&rounding.doubted)
            .filter(|(_, doubted)| **doubted);
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
    fn pass(&self, rounding: &mut Rounding, points: usize) {
        let Rounding {
            registers,
            errors,
            moved,
            next,
            ..
        } = rounding;
        next.clear();
        next.resize(self.n, 0.0);
        for Inputs { values, rates } in &rounding.points[..points] {
            let input = |slot: usize| {
                let moved = match slot {
                    1.. if slot <= self.n => moved[slot - 1],
                    _ => 0.0,
                };
                Ball::new(values[slot], moved)
            };
            for block in 0..self.field.n_blocks() {
                let see = |state: usize, rate: Rounded| {
                    let rate = rate.ball();
                    let differs = (rate.middle - rates[state]).abs();
                    let is_zero = rate.radius.is_finite() && differs <= SHARED * rate.radius;
                    next[state] = match is_zero {
                        true => rate.radius.max(next[state]),
                        false => f64::INFINITY,
                    };
                };
                self.field.examine(block, input, registers, see);
            }
        }
        for (error, next) in errors.iter_mut().zip(next) {
            *error = if next.is_finite() { *next } else { 0.0 };
        }
    }
}
