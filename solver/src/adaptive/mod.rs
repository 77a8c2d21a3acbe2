//! An adaptive method of high order that knows nothing of switches.
//!
//! x' = f(t, x), whatever jumps f makes: Gragg's modified midpoint rule with extrapolation, where
//! order and step size are chosen anew in every step (Gragg, Bulirsch and Stoer; Hairer, Nørsett &
//! Wanner 1993, section II.9). It is what a system with switches is often integrated with, and shows
//! what their detection buys: the step size falls at every switch until the jump does not matter, and
//! stays small where the state slides.
//!
//! The method of order 5 of Dormand & Prince (section II.5), with steps of the best length, needs 1.9,
//! 5.5 and 10 times as many evaluations of f for x'' = -x as this one at the tolerances 1e-6, 1e-9 and
//! 1e-11, for the same error at t = 20, as a test asserts.

mod control;
mod dense;
mod extrapolation;
mod rounding;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;

use crate::event::{Cause, Event, Observer, Segment};
use crate::expansion::dense::ElementSeries;
use crate::hybrid::{Outcome, Side, Stats, Status};
use crate::runtime::limit::Limit;
use control::{Control, Verdict};
use extrapolation::Extrapolation;
use rounding::Rounding;

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
    /// When the run stops.
    pub limit: Limit,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            tolerance: 1e-8,
            max_steps: 100_000,
            limit: Limit::default(),
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
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut dyn Observer) -> Outcome {
        let mut run = self.begin(t0, t1, x0);
        let status = loop {
            if let Some(status) = self.limit(&run, t1) {
                break status;
            }
            let limit = if run.until < t1 - NEAR * t1.abs() {
                run.until
            } else {
                t1
            };
            let length = run.control.step.min(limit - run.t);
            if run.t + length == run.t {
                break match run.has_value {
                    true => Status::StepLimit,
                    false => Status::NotFinite,
                };
            }
            let end = if length == limit - run.t {
                limit
            } else {
                run.t + length
            };
            if !self.attempt(&mut run, length, end) {
                run.stats.rejected += 1;
            } else if self.accept(&mut run, end, observer).is_break() {
                break Status::Stopped;
            }
        };
        run.outcome(status)
    }

    fn begin(&mut self, t0: f64, t1: f64, x0: &[f64]) -> Run {
        let until = self.field.load(t0);
        let mut sides = vec![Side::Plus; self.field.n_switches()];
        let mut rates = vec![0.0; x0.len()];
        self.field.sides(t0, x0, &mut sides);
        self.field.rates(t0, x0, &mut rates);
        let tolerance = (LOCAL * self.settings.tolerance).max(LEAST);
        let step = first_step(x0, &rates, t1 - t0);
        self.extrapolation.restart();
        Run {
            t: t0,
            until,
            x: x0.to_vec(),
            measure: Measure {
                scale: x0.iter().map(|x| x.abs().max(LEAST_SCALE)).collect(),
                reach: step,
                tolerance,
            },
            rounding: Rounding::new(x0.len()),
            control: Control::new(tolerance, step),
            rates,
            end_sides: sides.clone(),
            sides,
            has_value: true,
            stats: Stats::default(),
        }
    }

    /// Why the run ends before another step, if it does.
    fn limit(&self, run: &Run, t1: f64) -> Option<Status> {
        if run.t >= t1 {
            return Some(Status::Solved);
        }
        let attempts = run.stats.steps + run.stats.rejected;
        if attempts >= self.settings.max_steps {
            return Some(Status::StepLimit);
        }
        let limit = &self.settings.limit;
        let over = match attempts.is_multiple_of(STEPS) {
            true => limit.over(),
            false => limit.canceled(),
        };
        over.map(Status::Over)
    }

    /// Whether a step is as accurate as it has to be; then the table and the series hold it.
    fn attempt(&mut self, run: &mut Run, length: f64, end: f64) -> bool {
        // Rows are added until the last two agree, or there is no hope that they will.
        let table = &mut self.extrapolation;
        table.begin(length, &run.x, &run.rates);
        let verdict = loop {
            let row = table.add_row(&mut self.field, run.t);
            let error = table.error(&run.measure);
            run.has_value = !error.is_nan();
            match run.control.judge(row, length, error) {
                Verdict::GoOn => {}
                verdict => break verdict,
            }
        };
        run.stats.rhs_evaluations += table.evaluations();
        if let Verdict::Reject = verdict {
            return false;
        }
        // Rows may agree on what is wrong where f depends on signs alone, and not on their steps.
        table.close(&mut self.field, end, run.sides.len(), &mut self.series);
        let defect = table.defect(&mut self.field, run.t, &self.series);
        run.stats.rhs_evaluations += 1 + DEFECTS.len();
        run.has_value = !defect.is_nan();
        let is_accurate =
            run.has_value && defect <= (DEFECT * run.measure.tolerance).max(LEAST_DEFECT);
        if !is_accurate {
            run.control.shorten(length);
        }
        is_accurate
    }

    /// Moves to the end of a step and hands it on.
    fn accept(&mut self, run: &mut Run, end: f64, observer: &mut dyn Observer) -> ControlFlow<()> {
        let start = std::mem::replace(&mut run.t, end);
        run.stats.steps += 1;
        self.extrapolation.advance();
        run.x.copy_from_slice(self.extrapolation.state());
        run.rates.copy_from_slice(self.extrapolation.end_rates());
        for (scale, x) in run.measure.scale.iter_mut().zip(&run.x) {
            *scale = scale.max(x.abs());
        }
        let place = (end, &run.x[..]);
        let (step, length) = (run.stats.steps, end - start);
        (run.rounding).add(&mut self.field, step, place, &run.rates, length);
        run.stats.rhs_evaluations += 1;
        observer.segment(&Segment {
            start,
            length,
            until: end,
            sides: &run.sides,
            end: &run.x,
            dense: &self.series,
        })?;
        if end == run.until {
            run.until = self.field.load(end);
            self.field.rates(end, &run.x, &mut run.rates);
        }
        self.field.sides(end, &run.x, &mut run.end_sides);
        if run.sides != run.end_sides {
            run.stats.events += 1;
            observer.event(&Event {
                time: end,
                x: &run.x,
                before: &run.x,
                jumps: &[],
                decisions: &[],
                from: &run.sides,
                to: &run.end_sides,
                accumulates: false,
                cause: Cause::default(),
            });
            run.sides.copy_from_slice(&run.end_sides);
        }
        ControlFlow::Continue(())
    }
}

/// What errors of a step are relative to.
struct Measure {
    /// Largest |x_i| so far.
    scale: Vec<f64>,
    /// Length of the first step that was tried.
    reach: f64,
    tolerance: f64,
}

/// Where a run is.
struct Run {
    t: f64,
    /// The next breakpoint.
    until: f64,
    x: Vec<f64>,
    rates: Vec<f64>,
    measure: Measure,
    rounding: Rounding,
    sides: Vec<Side>,
    end_sides: Vec<Side>,
    control: Control,
    /// Whether the last attempt has led to numbers.
    has_value: bool,
    stats: Stats,
}

impl Run {
    fn outcome(self, status: Status) -> Outcome {
        Outcome {
            stats: self.stats,
            moved: self.rounding.moved(),
            ..Outcome::at(status, self.t, self.x, self.sides)
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
