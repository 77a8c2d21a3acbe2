//! An adaptive method of high order that knows nothing of switches.
//!
//! x' = f(t, x), whatever jumps f makes: Gragg's modified midpoint rule with extrapolation, where
//! order and step size are chosen anew in every step (Gragg, Bulirsch and Stoer; Hairer, Nørsett &
//! Wanner 1993, section II.9). It is what a system with switches is often integrated with, and shows
//! what their detection buys: the step size falls at every switch until the jump does not matter, and
//! stays small where the state slides.

mod control;
mod dense;
mod extrapolation;
#[cfg(test)]
mod tests;

use std::time::{Duration, Instant};

use crate::simulate::dense::ElementSeries;
use crate::simulate::{Event, Observer, Outcome, Segment, Side, Stats, Status};
use control::{Control, Verdict};
use extrapolation::Extrapolation;

/// x' = f(t, x), where f looks at the signs of some functions of (t, x).
pub trait Field {
    /// Length of x.
    fn n_states(&self) -> usize;
    /// How many signs f looks at.
    fn n_switches(&self) -> usize;
    /// The signs at a point, `Plus` at zero.
    fn sides(&mut self, t: f64, x: &[f64], sides: &mut [Side]);
    /// f.
    fn rates(&mut self, t: f64, x: &[f64], rates: &mut [f64]);
    /// Takes the pieces that functions of time have from `t` on; the next breakpoint, infinity where
    /// there is none.
    fn load(&mut self, _t: f64) -> f64 {
        f64::INFINITY
    }
}

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Aim for the global error, relative to the largest magnitude of each state; in (0, 1).
    pub tolerance: f64,
    /// Largest number of steps, rejected ones included.
    pub max_steps: usize,
    /// Wall time after which the run stops.
    pub time_limit: Option<Duration>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            tolerance: 1e-8,
            max_steps: 100_000,
            time_limit: None,
        }
    }
}

/// Local tolerance over the aim for the global error.
const LOCAL: f64 = 0.01;
/// No local tolerance is below it, a few roundings.
const LEAST: f64 = 1e-15;
/// Where in a step its polynomial is compared with f, as shares of the step.
const DEFECTS: [f64; 2] = [0.3, 0.7];
/// Largest |x' - f| H over the local tolerance, and over the size of the state.
const DEFECT: f64 = 1e3;
const LEAST_DEFECT: f64 = 1e-11;
/// No state counts as smaller: below, underflow takes the digits that rows would have to agree in.
const LEAST_SCALE: f64 = 1e-280;
/// A breakpoint this close to the end, relative to time, is there.
const NEAR: f64 = 16.0 * f64::EPSILON;
/// Steps between two looks at the clock.
const STEPS: usize = 16;

/// Runs a field, keeping its memory from one run to the next.
pub struct Simulator<F> {
    field: F,
    settings: Settings,
    extrapolation: Extrapolation,
    series: ElementSeries,
}

impl<F: Field> Simulator<F> {
    /// A simulator of a field.
    pub fn new(field: F, settings: Settings) -> Self {
        Simulator {
            extrapolation: Extrapolation::new(field.n_states()),
            series: ElementSeries::default(),
            field,
            settings,
        }
    }

    /// Integrates from `x0` at `t0` to `t1`. A change of sides from one end of a step to the other is
    /// told as an event there, wherever in the step it was.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut impl Observer) -> Outcome {
        let (n, m) = (x0.len(), self.field.n_switches());
        let mut x = x0.to_vec();
        let mut scale: Vec<f64> = x0.iter().map(|x| x.abs().max(LEAST_SCALE)).collect();
        let mut rates = vec![0.0; n];
        let mut sides = vec![Side::Plus; m];
        let mut end_sides = vec![Side::Plus; m];
        let mut stats = Stats::default();
        let started = Instant::now();
        let tolerance = (LOCAL * self.settings.tolerance).max(LEAST);

        let mut t = t0;
        let mut until = self.field.load(t);
        self.field.sides(t, &x, &mut sides);
        self.field.rates(t, &x, &mut rates);
        let mut control = Control::new(tolerance, first_step(&x, &rates, t1 - t0));
        let mut has_value = true;
        let status = loop {
            if t >= t1 {
                break Status::Solved;
            }
            let attempts = stats.steps + stats.rejected;
            if attempts >= self.settings.max_steps {
                break Status::StepLimit;
            }
            let is_over = |limit| started.elapsed() > limit;
            if attempts.is_multiple_of(STEPS) && self.settings.time_limit.is_some_and(is_over) {
                break Status::TimeLimit;
            }
            let limit = if until < t1 - NEAR * t1.abs() {
                until
            } else {
                t1
            };
            let length = control.step.min(limit - t);
            if t + length == t {
                break match has_value {
                    true => Status::StepLimit,
                    false => Status::NotFinite,
                };
            }

            // Rows are added until the last two agree, or there is no hope that they will.
            let table = &mut self.extrapolation;
            table.begin(length, &x, &rates);
            let verdict = loop {
                let row = table.add_row(&mut self.field, t, &x);
                let error = table.error(&scale, tolerance);
                has_value = !error.is_nan();
                match control.judge(row, length, error) {
                    Verdict::GoOn => {}
                    verdict => break verdict,
                }
            };
            stats.rhs_evaluations += table.evaluations();
            if let Verdict::Reject = verdict {
                stats.rejected += 1;
                continue;
            }

            // Rows may agree on what is wrong where f depends on signs alone, and not on their steps.
            let (start, end) = (
                t,
                if length == limit - t {
                    limit
                } else {
                    t + length
                },
            );
            table.close(&mut self.field, end, m, &mut self.series);
            let defect = table.defect(&mut self.field, t, &scale, &self.series);
            stats.rhs_evaluations += 1 + DEFECTS.len();
            has_value = !defect.is_nan();
            if !has_value || defect > (DEFECT * tolerance).max(LEAST_DEFECT) {
                control.shorten(length);
                stats.rejected += 1;
                continue;
            }
            stats.steps += 1;
            x.copy_from_slice(table.state());
            rates.copy_from_slice(table.end_rates());
            t = end;
            for (scale, x) in scale.iter_mut().zip(&x) {
                *scale = scale.max(x.abs());
            }
            let segment = Segment {
                start,
                length: end - start,
                until: end,
                sides: &sides,
                end: &x,
                dense: &self.series,
            };
            if observer.segment(&segment).is_break() {
                break Status::Stopped;
            }
            if t == until {
                until = self.field.load(t);
                self.field.rates(t, &x, &mut rates);
            }
            self.field.sides(t, &x, &mut end_sides);
            if sides != end_sides {
                stats.events += 1;
                observer.event(&Event {
                    time: t,
                    x: &x,
                    before: &x,
                    jumps: &[],
                    decisions: &[],
                    from: &sides,
                    to: &end_sides,
                    accumulates: false,
                });
                sides.copy_from_slice(&end_sides);
            }
        };
        Outcome {
            status,
            time: t,
            x,
            alpha: sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect(),
            sides,
            activity: vec![0.0; n],
            moved: vec![0.0; n],
            drift: 0.0,
            defect: 0.0,
            complementarity: 0.0,
            notes: Vec::new(),
            approaches: Vec::new(),
            stats,
        }
    }
}

/// A hundredth of the time in which the fastest state would move by its size.
fn first_step(x: &[f64], rates: &[f64], horizon: f64) -> f64 {
    let fastest = x.iter().zip(rates).filter(|(x, _)| **x != 0.0);
    let fastest = fastest
        .map(|(x, rate)| (rate / x).abs())
        .fold(0.0, f64::max);
    (0.01 / fastest).min(0.01 * horizon)
}
