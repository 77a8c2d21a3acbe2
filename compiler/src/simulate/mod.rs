//! The event road: a system is integrated mode by mode, and becomes a trajectory.
//!
//! Every run is made twice, the second time a hundred times more accurately: the
//! difference is the estimate of the global error, and a different sequence of
//! modes is reported instead of being trusted.

mod adaptive;
pub(crate) mod again;
mod bench;
mod elements;
mod events;
pub mod fesd;
mod frozen;
mod limits;
mod modes;
pub mod moreau;
mod outcome;
mod overlooked;
mod parting;
mod pieces;
mod plan;
mod record;
mod rehearsal;
mod reported;
mod request;
mod rooted;
mod schedule;
mod settle;
mod smoothed;
mod steepest;
mod touches;
mod watch;

use std::ops::ControlFlow;

use nsd_solver::simulate as solver;
use solver::{Approach, Observer, Outcome, Segment, Simulator};

use crate::limit::Limit;
use crate::report::{Certificate, Failure, Kind, Stats, Status, Trajectory, Warning};
use crate::system::System;
use crate::system::experiment::{self, Branch, EventOptions, Settings};
pub use bench::{Bench, End, Variant, whole};
pub(crate) use elements::Elements;
pub(crate) use events::Events;
use modes::ModeNames;
pub use outcome::sampled;
pub use plan::Plan;
use record::{Jump, Recorder};
use record::{Points, recorded};
pub(crate) use rehearsal::{Rehearsed, cut};
pub use request::Request;
pub(crate) use settle::Consistent;
pub use settle::settle;
use touches::Touches;
pub use watch::Progress;
use watch::Watched;

/// How much more accurate the second run is.
const REFINEMENT: f64 = 1e-2;

/// Runs with a tolerance that the estimate has shown to be too loose.
const MAX_ATTEMPTS: usize = 3;

/// Integrates the system over the horizon of the experiment.
pub fn run(system: &System, settings: &Settings, request: &Request) -> Trajectory {
    run_watched(system, settings, request, &mut |_| {})
}

/// [`run`], which calls `watch` every few steps.
pub fn run_watched(
    system: &System,
    settings: &Settings,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    Plan::new(system, settings).run(system, settings, request, watch)
}

pub(crate) fn solver_settings(
    method: &experiment::Method,
    tolerance: f64,
    limit: Limit,
) -> solver::Settings {
    let defaults = solver::Settings {
        tolerance,
        limit,
        ..Default::default()
    };
    let experiment::Method::Event(EventOptions {
        order,
        branch,
        max_events,
    }) = method
    else {
        return defaults;
    };
    let side = |branch: &Branch| match branch {
        Branch::Minus => solver::Side::Minus,
        Branch::Slide => solver::Side::Slide,
        Branch::Plus => solver::Side::Plus,
    };
    solver::Settings {
        order: *order,
        branch: branch.iter().map(side).collect(),
        max_events: max_events.unwrap_or(defaults.max_events),
        ..defaults
    }
}

/// A run that is more accurate, and of another order, so that its rounding errors are others. Infinitely many events end
/// with the same one.
fn finer(run: &solver::Settings, order: usize, tolerance: f64) -> solver::Settings {
    solver::Settings {
        tolerance: tolerance * REFINEMENT,
        settled: Some(tolerance),
        order: Some(order + 3),
        ..run.clone()
    }
}

/// A smaller tolerance for another attempt, where an estimate has shown that one to be too loose.
fn tightened(
    estimate: Option<&Estimate>,
    settings: &Settings,
    tolerance: f64,
    attempt: usize,
) -> Option<f64> {
    let estimate = estimate.filter(|estimate| estimate.same_modes)?;
    let share = if estimate.error > settings.tolerance {
        0.1 * settings.tolerance / estimate.error
    } else {
        estimate.touches.share_to_tell(settings.tolerance)?
    };
    let again = attempt < MAX_ATTEMPTS && tolerance > 1e-15;
    again.then(|| tolerance * share.max(1e-4))
}

/// A state that has always been below this many roundings of the terms of its rate is at rest.
const HELD: f64 = 8.0;

/// What a more accurate run says about a run.
struct Estimate {
    /// Largest difference of a state, relative to its largest magnitude.
    error: f64,
    /// Whether both went through the same modes.
    same_modes: bool,
    /// When they first did not, event by event.
    parted: Option<f64>,
    /// What neither can tell.
    touches: Touches,
}

impl Estimate {
    /// Nothing when the time was too short.
    fn of(
        finer: &mut Simulator,
        horizon: f64,
        x0: &[f64],
        run: &Recorder,
        outcome: &Outcome,
        watch: &mut dyn FnMut(Progress),
    ) -> Option<Self> {
        let mut comparison = Comparison::new(run, x0);
        comparison.approaches = &outcome.approaches;
        let mut watched = Watched::new(&mut comparison, horizon, true, watch);
        let fine = finer.run(0.0, horizon, x0, &mut watched);
        if matches!(fine.status, solver::Status::Over(_)) {
            return None;
        }
        let events = (outcome.stats.events as f64).sqrt();
        let relative = |(i, &difference): (usize, &f64)| {
            // What the rounding of one instant moves the state by.
            let rounding = f64::EPSILON * outcome.activity[i] * outcome.time;
            let scale = comparison.scale[i].max(outcome.x[i].abs());
            if scale > HELD * rounding {
                (4.0 * events * rounding)
                    .max(outcome.moved[i])
                    .max(difference)
                    / scale
            } else {
                // Cancellation holds the state at zero: there is no motion to be relative to.
                0.0
            }
        };
        let error = comparison
            .difference
            .iter()
            .enumerate()
            .map(relative)
            .fold(0.0, f64::max);
        // Below rounding the two runs agree by chance.
        let rounding = f64::EPSILON * (outcome.stats.steps as f64).sqrt();
        let known = |i: usize| {
            let activity = (4.0 * events).max(1.0) * f64::EPSILON * outcome.activity[i];
            activity * outcome.time + outcome.moved[i] + rounding * comparison.scale[i]
        };
        let touches = Touches::find(outcome, &comparison.misses, known, &comparison.scale);
        let error = error.max(rounding);
        let parted = comparison.parted(error);
        Some(Estimate {
            touches,
            error,
            parted,
            same_modes: parted.is_none() && fine.status.is_like(&outcome.status),
        })
    }
}

/// Compares a second run with the recorded points of the first.
struct Comparison<'r> {
    points: &'r [f64],
    states: &'r [f64],
    n: usize,
    next: usize,
    horizon: f64,
    /// Jumps of the first run, and how many the second one has met.
    jumps: &'r [Jump],
    jumped: usize,
    x: Vec<f64>,
    difference: Vec<f64>,
    scale: Vec<f64>,
    approaches: &'r [Approach],
    /// The states behind events of the first run, and how many of this one have been displaced from them.
    behind: &'r [f64],
    displaced: usize,
    /// The changes of its mode, and the modes of this one with the instants at which they begin.
    changes: &'r [record::Change],
    modes: Vec<(f64, Box<[solver::Side]>)>,
    /// What the differences so far make of ψ, at the approaches that were passed.
    misses: Vec<f64>,
}

impl<'r> Comparison<'r> {
    fn new(run: &'r Recorder, x0: &[f64]) -> Self {
        let n = x0.len();
        Comparison {
            points: run.times(),
            states: run.states(),
            n,
            next: 0,
            horizon: run.horizon(),
            jumps: run.jumps(),
            jumped: 0,
            x: vec![0.0; n],
            difference: vec![0.0; n],
            scale: x0.iter().map(|x| x.abs()).collect(),
            approaches: &[],
            behind: run.behind(),
            displaced: 0,
            changes: run.changes(),
            modes: Vec::new(),
            misses: Vec::new(),
        }
    }
}

impl Comparison<'_> {
    /// When the modes were first others, as far as a run is `known`.
    fn parted(&self, known: f64) -> Option<f64> {
        let one = self.changes.iter().map(|change| (change.0, &*change.2));
        let other = self.modes.iter().map(|(time, mode)| (*time, &**mode));
        let [one, other] = [one.collect::<Vec<_>>(), other.collect()];
        let near = parting::closeness(self.horizon, known);
        parting::parted(&one, &other, near)
    }

    /// Compares the present state with a recorded one.
    fn compare(&mut self, point: usize) {
        let recorded = &self.states[point * self.n..(point + 1) * self.n];
        for (i, (&x, &other)) in self.x.iter().zip(recorded).enumerate() {
            self.scale[i] = self.scale[i].max(x.abs());
            self.difference[i] = self.difference[i].max((x - other).abs());
        }
    }
}

/// Roundings by which the second run is displaced at an event: more than the first one makes in a step.
const DISPLACED: f64 = 2.0;

/// Where in a step magnitudes are looked at: a state may be zero at every end of a step.
const BETWEEN: [f64; 3] = [0.25, 0.5, 0.75];

impl Observer for Comparison<'_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        for share in BETWEEN {
            segment.state(share * segment.length, &mut self.x);
            for (scale, x) in self.scale.iter_mut().zip(&self.x) {
                *scale = scale.max(x.abs());
            }
        }
        let end = segment.until;
        // Beyond the next jump of the first run, which this one has not met yet.
        let known = self
            .jumps
            .get(self.jumped)
            .map_or(usize::MAX, |jump| jump.n_points);
        while let Some(&t) = self.points.get(self.next).filter(|t| **t <= end) {
            if self.next >= known {
                break;
            }
            segment.state(t - segment.start, &mut self.x);
            self.compare(self.next);
            self.next += 1;
        }
        let approaches = &self.approaches[self.misses.len()..];
        for approach in approaches.iter().take_while(|a| a.time <= end) {
            segment.state(approach.time - segment.start, &mut self.x);
            for (i, (x, other)) in self.x.iter().zip(&approach.x).enumerate() {
                self.difference[i] = self.difference[i].max((x - other).abs());
            }
            let terms = approach.gradient.iter();
            let miss = terms.map(|&(j, g)| g.abs() * self.difference[j]).sum();
            self.misses.push(miss);
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &solver::Event) {
        self.modes.push((event.time, event.to.into()));
        if event.jumps.is_empty() {
            return;
        }
        // Jumps are compared one by one: next to an instant, a run may be before or after it.
        if let Some(jump) = self.jumps.get(self.jumped) {
            for (seen, other) in [(event.before, &jump.before), (event.x, &jump.after)] {
                for (i, (x, other)) in seen.iter().zip(other).enumerate() {
                    self.scale[i] = self.scale[i].max(x.abs());
                    self.difference[i] = self.difference[i].max((x - other).abs());
                }
            }
            self.next = self.next.max(jump.n_points);
        }
        self.jumped += 1;
    }

    /// Moves the state away from that of the first run. Both make the same roundings where events cut their steps alike;
    /// what a system makes of other ones grows by itself from here, and nothing takes it back.
    fn displace(&mut self, x: &mut [f64], roundings: &[f64]) {
        let other = self.behind.chunks_exact(self.n).nth(self.displaced);
        self.displaced += 1;
        for (i, (x, rounding)) in x.iter_mut().zip(roundings).enumerate() {
            let is_below = other.is_some_and(|other| *x < other[i]);
            *x += DISPLACED * rounding * if is_below { -1.0 } else { 1.0 };
        }
    }

    fn displaces(&self) -> bool {
        true
    }
}

/// Names everything and evaluates the outputs.
fn assemble(
    system: &System,
    settings: &Settings,
    outcome: &Outcome,
    recorder: Recorder,
) -> Trajectory {
    let names = ModeNames::new(system);
    let failure = outcome::failure(system, &names, outcome, settings);
    let mut trajectory = Trajectory {
        experiment: settings.name.clone(),
        model: system.name.clone(),
        kind: Kind::Simulate,
        status: failure.as_ref().map_or(Status::Solved, Failure::status),
        failure,
        switches: system
            .switches
            .iter()
            .map(|switch| switch.name.clone())
            .collect(),
        stats: Stats {
            steps: outcome.stats.steps as u64,
            rhs_evaluations: outcome.stats.rhs_evaluations as u64,
            newton_iterations: outcome.stats.newton_iterations as u64,
            factorizations: outcome.stats.factorizations as u64,
            complementarity_residual: outcome.complementarity,
            ..Stats::default()
        },
        certificate: Certificate {
            max_violation: outcome.drift.max(outcome.defect),
            ..Certificate::default()
        },
        skipped: system.skipped.clone(),
        averaged: outcome::averaged(system, outcome),
        warnings: outcome::warnings(system, outcome),
        ..Trajectory::default()
    };
    recorder.fill(system, &names, outcome, &mut trajectory);
    trajectory
}

/// Adds what the second run found.
fn judge(trajectory: &mut Trajectory, estimate: &Estimate, settings: &Settings) {
    trajectory.error_estimate = Some(estimate.error + estimate.touches.error);
    let parts = estimate.parted.map_or(String::new(), |time| {
        let mut modes = trajectory.modes.iter();
        let before = modes.find(|mode| mode.from < time && time <= mode.to);
        let mode = before.map_or(String::new(), |mode| format!(", behind `{}`", mode.mode));
        format!(" from t = {time} on{mode}")
    });
    let mut warn = |code: &str, message: String| {
        let span = Some(settings.span);
        trajectory.warnings.push(Warning {
            code: code.into(),
            message,
            span,
        });
    };
    if !estimate.same_modes {
        warn(
            "W0701",
            format!(
                "a more accurate run goes through other modes{parts}; the result may depend on the tolerance"
            ),
        );
    } else if estimate.error > settings.tolerance.max(1e-13) {
        warn(
            "W0702",
            format!(
                "the estimated error {:.1e} is above the tolerance",
                estimate.error
            ),
        );
    }
}
