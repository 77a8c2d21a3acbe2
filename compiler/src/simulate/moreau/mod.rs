//! `method timestepping` of a model with contacts: Moreau-Jean steps.
//!
//! A second run with twice as many steps gives the estimate of the error.

use crate::clock::Instant;
use crate::hybrid::Pulses;
use crate::limit::Limit;
mod free;
mod record;
mod scene;

use nsd_solver::moreau::{Settings as StepSettings, Solution, Stepper};
use nsd_solver::simulate::Status as End;

use self::free::Free;
use self::record::Told;
use super::adaptive::Inputs;
use super::fesd::{estimate_with, judge_steps};
use super::outcome::outside;
use super::overlooked::Looking;
use super::watch::{Progress, Watched};
use super::{Comparison, Recorder, Request, assemble};
use crate::report::{Failure, Method, MethodOption, Trajectory, Warning};
use crate::system::System;
use crate::system::experiment::{Settings, SteppingOptions};

/// An entry of a vector has this share of the largest one as its size at least: that of a place on a floor which
/// nothing leaves is rounding.
const SMALL: f64 = 1e-9;

/// Integrates bodies and their contacts step by step over the horizon of the experiment.
pub(super) fn run(
    system: &System,
    settings: &Settings,
    options: &SteppingOptions,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let stepper = |steps: usize| stepper(system, settings.horizon, steps, request.limit.clone());
    let mut recorder = Recorder::new(system, settings, settings.tolerance, request.dense);
    let mut looking = Looking::new(system, settings, &mut recorder);
    let mut told = Told {
        watched: Watched::new(&mut looking, settings.horizon, false, watch),
        changes: Vec::new(),
    };
    let solution = stepper(options.steps).run(0.0, settings.horizon, &x0, &mut told);
    let changes = told.changes;
    let overlooked = looking.notes();
    let solved = solution.outcome.status == End::Solved;
    let error = (request.estimate && solved).then(|| {
        let mut comparison = Comparison::new(&recorder, &x0);
        let mut told = Told {
            watched: Watched::new(&mut comparison, settings.horizon, true, watch),
            changes: Vec::new(),
        };
        let fine = stepper(2 * options.steps).run(0.0, settings.horizon, &x0, &mut told);
        let least = least_sizes(system, |i| {
            comparison.scale[i].max(solution.outcome.x[i].abs())
        });
        let outcomes = [&solution.outcome, &fine.outcome];
        // The order is one: halving the steps removes half of the error.
        Some(2.0 * estimate_with(|i| least[i], &comparison, outcomes)?.error)
    });
    let failure = failure(system, &solution);
    let mut outcome = solution.outcome.clone();
    outcome.notes.extend(overlooked);
    if failure.is_some() {
        outcome.status = End::Stopped;
    }
    let mut trajectory = assemble(system, settings, &outcome, recorder);
    if let Some(failure) = failure {
        trajectory.status = failure.status();
        trajectory.failure = Some(failure);
    }
    record::write(system, &changes, outcome.time, &mut trajectory);
    trajectory.certificate.max_violation = solution.penetration;
    let number = |name: &str, value: usize| (name.into(), MethodOption::Number(value as f64));
    trajectory.method = Method {
        name: "timestepping".into(),
        options: vec![
            ("scheme".into(), MethodOption::Text("moreau_jean".into())),
            number("steps", options.steps),
            number("impulses", solution.impulses),
            number("gaps", solution.gaps),
        ],
    };
    if solution.plastic > 0 {
        trajectory.warnings.push(Warning {
            code: "W0713".into(),
            message: format!(
                "in {} steps impacts were taken without rebound: their restitutions contradict each other",
                solution.plastic
            ),
            span: Some(settings.span),
        });
    }
    judge_steps(
        &mut trajectory,
        system,
        settings,
        options.steps,
        error.flatten(),
    );
    trajectory.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}

/// What each state is measured by at least: a share of the largest entry of its vector.
fn least_sizes(system: &System, size: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut least = vec![0.0; system.states.len()];
    for group in &system.groups {
        let sizes = group.entries.iter().map(|&i| size(i));
        let largest = sizes.fold(0.0, f64::max);
        for &i in &group.entries {
            least[i] = SMALL * largest;
        }
    }
    least
}

/// What steps through a system to a horizon.
pub fn stepper(
    system: &System,
    horizon: f64,
    steps: usize,
    limit: Limit,
) -> Stepper<impl nsd_solver::moreau::Free> {
    let inputs = Inputs::new(system);
    let free = Free::new(system, &inputs, Pulses::of(system, horizon));
    let scene = scene::scene(system, &inputs);
    Stepper::new(scene, free, StepSettings { steps, limit })
}

/// What a contact has ended a run by.
fn failure(system: &System, solution: &Solution) -> Option<Failure> {
    let contact = &system.impulsive[solution.stuck?];
    let time = solution.outcome.time;
    let name = contact.name.clone();
    let label = miette::LabeledSpan::new_with_span(Some(format!("contact `{name}`")), contact.span);
    Some(match &solution.outcome.status {
        End::Penetrates { .. } => Failure::Penetrates {
            time,
            name,
            surfaces: vec![label],
        },
        &End::Coefficient {
            coefficient, value, ..
        } => outside((coefficient, value), (time, name), vec![label]),
        _ => Failure::Impulses {
            time,
            name,
            surfaces: vec![label],
        },
    })
}
