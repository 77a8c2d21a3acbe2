//! What a second, finer run says about a run.

mod comparison;
mod held;
mod parting;
mod touches;

use nsd_solver::hybrid::{Outcome, Status};

pub use comparison::Comparison;
pub(super) use held::held;
pub use touches::{Touch, Touches};

use crate::limit::Over;
use crate::report::forms::text::significant;
use crate::report::{Failure, Trajectory, Warning};
use crate::system::System;
use crate::system::experiment::Settings;

/// A state that has always been below this many roundings of the terms of its rate is at rest.
const HELD: f64 = 8.0;

/// An estimate above this says that a grid is too coarse for the model.
const COARSE: f64 = 0.01;

/// Roundings below which errors are not told.
const ROUNDING: f64 = 1e-13;

/// That a run ends without an estimate of its error, as the second one had to end before, or did not get as far.
pub(super) fn missing(over: Option<Over>, settings: &Settings) -> Warning {
    let message = match over {
        Some(Over::Canceled) => {
            "the run was canceled before a second run could show the error of this one"
        }
        Some(Over::TimeLimit) => {
            "the time limit was reached before a second run could show the error of this one"
        }
        None => {
            "a second run, in twice as many steps, fails: it does not show the error of this one"
        }
    };
    Warning {
        code: "W0738".into(),
        message: message.into(),
        span: Some(settings.span),
    }
}

/// How a second run shows the error of a first one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Estimator {
    /// It has a smaller tolerance, and so has a third one where the error is too large.
    Tolerance,
    /// It is on a finer grid. What was chosen is not refined.
    Grid,
    /// It has twice as many steps. Across switches the order is one, so that it removes half of the error.
    Steps,
}

impl Estimator {
    /// That of finite elements, which are on a grid where they are told how many steps to take.
    pub fn of_elements(settings: &Settings) -> Self {
        match settings.numerics.method.has_steps() {
            false => Estimator::Tolerance,
            true => Estimator::Grid,
        }
    }

    /// Whether a finer run shows the error of another one. Steps are not told apart by the modes that they come through,
    /// but one of both may fail.
    pub fn compares(self, [found, finer]: [&Outcome; 2]) -> bool {
        self != Estimator::Steps || finer.status.is_like(&found.status)
    }
}

/// What a more accurate run says about a run.
pub(super) struct Estimate {
    /// Largest difference of a state, relative to its largest magnitude.
    pub error: f64,
    /// Whether both went through the same modes.
    pub same_modes: bool,
    /// When they first did not, event by event.
    pub parted: Option<f64>,
    /// What neither can tell.
    pub touches: Touches,
}

/// How far two runs that a condition ends are apart there, each at its own instant, and by how much these differ.
fn stop_error(comparison: &Comparison, [outcome, fine]: [&Outcome; 2]) -> f64 {
    if outcome.stats.stopped_by.is_none() {
        return 0.0;
    }
    let sizes = comparison.sizes(&outcome.x);
    let ends = outcome.x.iter().zip(&fine.x).zip(sizes);
    let states = ends.filter(|(_, size)| *size > 0.0);
    let states = states.map(|((x, other), size)| (x - other).abs() / size);
    let time = (outcome.time - fine.time).abs() / outcome.time;
    states.fold(time, f64::max)
}

impl Estimate {
    /// How far a finer run is from another one, whose states are measured by so much at least, and are zero up to so much.
    /// Nothing where the time was too short.
    pub fn of(
        comparison: &Comparison,
        [outcome, fine]: [&Outcome; 2],
        [least, held]: [&[f64]; 2],
    ) -> Option<Self> {
        if matches!(fine.status, Status::Over(_)) {
            return None;
        }
        // Instants that are known before the run move nothing.
        let events = outcome.stats.events - outcome.stats.scheduled;
        let events = (events as f64).sqrt();
        let relative = |(i, &difference): (usize, &f64)| {
            // What the rounding of one instant moves the state by.
            let rounding = f64::EPSILON * outcome.activity[i] * outcome.time;
            let scale = comparison.scale[i].max(outcome.x[i].abs()).max(least[i]);
            if scale > (HELD * rounding).max(held[i]) {
                (4.0 * events * rounding)
                    .max(outcome.moved[i])
                    .max(difference)
                    / scale
            } else {
                // Cancellation holds the state at zero: there is no motion to be relative to.
                0.0
            }
        };
        let error = comparison.difference.iter().enumerate().map(relative);
        let error = error.fold(stop_error(comparison, [outcome, fine]), f64::max);
        // Below rounding the two runs agree by chance.
        let rounding = f64::EPSILON * (outcome.stats.steps as f64).sqrt();
        let known = |i: usize| {
            let activity = (4.0 * events).max(1.0) * f64::EPSILON * outcome.activity[i];
            activity * outcome.time + outcome.moved[i] + rounding * comparison.scale[i]
        };
        let touches = Touches::find(outcome, &comparison.misses, known, &comparison.scale);
        let error = error.max(rounding);
        let parted = match outcome.stats.stopped_by == fine.stats.stopped_by {
            true => comparison.parted(error),
            false => Some(outcome.time.min(fine.time)),
        };
        Some(Estimate {
            touches,
            error,
            parted,
            same_modes: parted.is_none() && fine.status.is_like(&outcome.status),
        })
    }

    /// Tells what it says of a run: whether that is accurate, and what it may have touched.
    pub fn tell(
        &self,
        by: Estimator,
        system: &System,
        settings: &Settings,
        trajectory: &mut Trajectory,
    ) {
        match by {
            Estimator::Tolerance => self.judge(settings, trajectory),
            Estimator::Grid => self.judge_grid(settings, trajectory),
            Estimator::Steps => self.judge_steps(settings, trajectory),
        }
        let warning = self.touches.warning(system, settings.numerics.tolerance);
        let is_told = self.same_modes && trajectory.failure.is_none();
        trajectory.warnings.extend(warning.filter(|_| is_told));
    }

    /// Whether a tolerance is kept.
    fn judge(&self, settings: &Settings, trajectory: &mut Trajectory) {
        trajectory.quality.error_estimate = Some(self.error + self.touches.error);
        let warning = if !self.same_modes {
            let parts = self.parted.map_or(String::new(), |time| {
                let mut modes = trajectory.history.modes.iter();
                let before = modes.find(|mode| mode.from < time && time <= mode.to);
                let mode = before.map_or(String::new(), |mode| format!(", behind `{}`", mode.mode));
                format!(" from t = {} on{mode}", significant(time, 12))
            });
            let message = format!(
                "a more accurate run goes through other modes{parts}; the result may depend on the tolerance"
            );
            Some(("W0701", message))
        } else if self.error > settings.numerics.tolerance.max(ROUNDING) {
            let message = format!(
                "the estimated error {:.1e} is above the tolerance",
                self.error
            );
            Some(("W0702", message))
        } else {
            None
        };
        trajectory
            .warnings
            .extend(warning.map(|(code, message)| Warning {
                code: code.into(),
                message,
                span: Some(settings.span),
            }));
    }

    /// What a grid of the user's choice is worth: no warning for what it was chosen for, but none that
    /// is too coarse to show what the model does passes for a solution.
    fn judge_grid(&self, settings: &Settings, trajectory: &mut Trajectory) {
        trajectory.quality.error_estimate = Some(self.error);
        if trajectory.failure.is_some() || self.same_modes && self.error <= COARSE {
            return;
        }
        let failure = Failure::Coarse {
            error: format!("{:.1e}", self.error),
            modes: !self.same_modes,
            span: settings.span,
        };
        trajectory.status = failure.status();
        trajectory.failure = Some(failure);
    }

    /// What steps without detection of switches are worth: large errors are what they were chosen for, but an error as
    /// large as a state is no solution.
    fn judge_steps(&self, settings: &Settings, trajectory: &mut Trajectory) {
        let error = 2.0 * self.error;
        trajectory.quality.error_estimate = Some(error);
        if error > 1.0 {
            trajectory.warnings.push(Warning {
                code: "W0702".into(),
                message: format!(
                    "the estimated error {error:.1e} is above the size of a state: more `steps` are needed"
                ),
                span: Some(settings.span),
            });
        }
    }
}
