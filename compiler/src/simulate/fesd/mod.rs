//! The road of finite elements: a system becomes a complementarity system, and that a trajectory.
//!
//! A second run, on a grid twice as fine or with a smaller tolerance, gives the estimate of the
//! global error.

use crate::clock::Instant;
use crate::hybrid::{self, Pulses};
use nsd_solver::simulate::HybridSystem;
use std::sync::Arc;
mod blurred;
mod complementarity;
pub(super) mod impulses;
mod kept;
pub(super) mod stepping;
mod turns;

use std::ops::ControlFlow;

use nsd_solver::fesd::{self, ComplementaritySystem, Grid, Library, Simulator, Solution};
use nsd_solver::simulate::{self as event, Event, Observer, Outcome, Segment, Status};
use nsd_solver::tableau::Family;

pub use complementarity::complementarity;
use turns::Turns;

use super::overlooked::Looking;
use super::watch::{Progress, Watched};
use super::{
    Comparison, Estimate, HELD, REFINEMENT, Recorder, Request, Touches, assemble, judge, tightened,
};
use crate::dcs::{self, Dcs};
use crate::report::{Failure, Method, MethodOption, Multipliers, Series, Trajectory, Warning};
use crate::system::System;
use crate::system::experiment::{FesdOptions, Settings};

/// An estimate above this says that the grid is too coarse for the model.
const COARSE: f64 = 0.01;

/// Tolerances below this, in relation to rounding, make no other elements, so that a finer run says nothing (chosen by
/// trial).
const FINEST: f64 = 1e-13;

/// The part of the defect that it is allowed which an element has at least, as the safety of its length leaves it.
const USED: f64 = 0.5;

/// The largest share of an error that the finer run is taken to have, too: next to rounding both runs allow the same.
const MOST_SHARE: f64 = 0.5;

/// Nodes of the largest schemes of Radau IIA and Gauss.
const MOST_NODES: usize = 9;

/// Keeps the multipliers of a run, and looks at surfaces that are touched, besides what another observer does.
struct Keeper<'s, 'e, O> {
    observer: O,
    kept: Option<Multipliers>,
    turns: Option<Turns<'s, 'e>>,
}

impl<O: Observer> Observer for Keeper<'_, '_, O> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        if let Some(turns) = &mut self.turns {
            turns.segment(segment);
        }
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }
}

impl<O: Observer> fesd::Observer for Keeper<'_, '_, O> {
    fn wants_multipliers(&self) -> bool {
        self.kept.is_some()
    }

    fn multipliers(&mut self, multipliers: &fesd::Multipliers) {
        if let Some(kept) = &mut self.kept {
            kept.time.extend_from_slice(multipliers.times);
            let rows = multipliers.z.chunks_exact(kept.values.len().max(1));
            for row in rows {
                for (series, z) in kept.values.iter_mut().zip(row) {
                    series.values.push(*z);
                }
            }
        }
    }
}

/// Integrates the system by finite elements over the horizon of the experiment.
pub(super) fn run(
    system: &System,
    settings: &Settings,
    options: &FesdOptions,
    request: &Request,
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let (dcs, mut complementarity) = lower(system, settings);
    let pulses = Pulses::of(system, settings.horizon);
    complementarity.stops = pulses.stops().to_vec();
    let guide = system.first_nonlinear().map(|_| hybrid::lower(system));
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let mut library = Library::default();
    let on = |grid: Grid, nodes: usize, library: &Library| {
        let settings = fesd::Settings {
            limit: request.limit.clone(),
            grid,
            ..fesd::Settings::new(options.scheme.0, nodes)
        };
        simulator(&complementarity, guide.as_ref(), settings).knowing(library.clone())
    };
    let (mut tolerance, mut attempt) = (settings.tolerance, 1);
    let (order, solution, recorder, kept, estimate) = loop {
        let grid = grid(options, tolerance);
        let mut first = on(grid, options.scheme.1, &library);
        let mut recorder = Recorder::new(system, settings, tolerance, request.dense);
        let mut looking = Looking::new(system, settings, &mut recorder);
        let mut keeper = Keeper {
            observer: Watched::new(&mut looking, settings.horizon, false, watch),
            kept: request.multipliers.then(|| empty(&dcs)),
            turns: request.estimate.then(|| Turns::new(system)),
        };
        let mut solution = first.run(0.0, settings.horizon, &x0, &mut keeper);
        let (kept, turns) = (keeper.kept, keeper.turns);
        solution.outcome.notes.extend(looking.notes());
        let wanted = request.estimate && !matches!(solution.outcome.status, Status::Over(_));
        let second = |recorder: &Recorder| {
            let mut comparison = Comparison::new(recorder, &x0);
            let mut keeper = Keeper {
                observer: Watched::new(&mut comparison, settings.horizon, true, watch),
                kept: None,
                turns: None,
            };
            let mut second = on(finer(grid), nodes_of_finer(options), first.library());
            let fine = second.run(0.0, settings.horizon, &x0, &mut keeper);
            let outcomes = [&solution.outcome, &fine.outcome];
            let mut found = estimate(system, &comparison, outcomes)?;
            found.error /= 1.0 - share_of_finer(&first, &second);
            if let Some(turns) = turns {
                found.touches = turns.judge(found.error, solution.outcome.time);
            }
            Some(found)
        };
        let estimate = wanted.then(|| second(&recorder)).flatten();
        // A grid is taken as it is.
        let judged = estimate.as_ref().filter(|_| options.steps.is_none());
        let next = tightened(judged, settings, tolerance, attempt).map(|next| next.max(FINEST));
        match next.filter(|next| *next < tolerance) {
            Some(next) => {
                (tolerance, attempt) = (next, attempt + 1);
                library.clone_from(first.library());
            }
            None => break (first.order(), solution, recorder, kept, estimate),
        }
    };
    let blurred = blurred::warning(system, &solution.outcome, &recorder);
    let mut trajectory = assemble(system, settings, &solution.outcome, recorder);
    trajectory.warnings.extend(blurred);
    trajectory.method = method(settings, options, order, dcs.formulation.word(), &solution);
    trajectory.certificate.max_violation = -solution.least_member;
    trajectory.multipliers = kept;
    if let Some(steps) = options.steps {
        let length = settings.horizon / (steps * options.elements) as f64;
        trajectory.warnings.extend(pulses.warning(length, settings));
    }
    if let Some(estimate) = estimate {
        tell(&mut trajectory, &estimate, system, (settings, options));
    }
    trajectory.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}

/// Tells what an estimate says of a run: whether it is accurate, and what it may have touched.
fn tell(
    trajectory: &mut Trajectory,
    estimate: &Estimate,
    system: &System,
    (settings, options): (&Settings, &FesdOptions),
) {
    match options.steps {
        None => judge(trajectory, estimate, settings),
        Some(_) => judge_grid(trajectory, estimate, settings),
    }
    let warning = estimate.touches.warning(system, settings.tolerance);
    let is_told = trajectory.failure.is_none() && estimate.same_modes;
    trajectory.warnings.extend(warning.filter(|_| is_told));
}

/// A simulator whose number of nodes has been checked. Where switches are nonlinear, complementarity does not say which
/// of several sliding modes is taken: `guide` does.
pub(super) fn simulator<'s>(
    complementarity: &'s ComplementaritySystem,
    guide: Option<&'s Arc<HybridSystem>>,
    settings: fesd::Settings,
) -> Simulator<'s> {
    let simulator = Simulator::new(complementarity, settings);
    let simulator = simulator.expect("the number of nodes has been checked");
    match guide {
        Some(hybrid) => simulator.guided(event::Simulator::new(
            hybrid.clone(),
            event::Settings::default(),
        )),
        None => simulator,
    }
}

/// The complementarity system of an experiment, with names, and as data.
fn lower<'e>(system: &System<'e>, settings: &Settings<'e>) -> (Dcs<'e>, ComplementaritySystem) {
    let dcs = dcs::lower(system, &settings.lowerings);
    let dcs = dcs.expect("compilation has checked that the system can be lowered");
    let complementarity = complementarity(system, &dcs);
    (dcs, complementarity)
}

/// No values yet of any algebraic variable.
fn empty(dcs: &Dcs) -> Multipliers {
    let series = |z: &dcs::Algebraic| Series {
        name: z.var.to_string(),
        ..Series::default()
    };
    Multipliers {
        time: Vec::new(),
        values: dcs.algebraics.iter().map(series).collect(),
    }
}

fn grid(options: &FesdOptions, tolerance: f64) -> Grid {
    match options.steps {
        Some(steps) => Grid::Steps {
            steps,
            elements: options.elements,
        },
        None => Grid::Adaptive { tolerance },
    }
}

/// The grid of the run that shows the error of another.
fn finer(grid: Grid) -> Grid {
    match grid {
        Grid::Steps { steps, elements } => Grid::Steps {
            steps: 2 * steps,
            elements,
        },
        Grid::Adaptive { tolerance } => Grid::Adaptive {
            tolerance: REFINEMENT * tolerance,
        },
    }
}

/// What the finer run may itself be off by, as a share of the error of the other. Where a rate has no derivative an
/// element has no order, and is off by about its defect.
fn share_of_finer(run: &Simulator, finer: &Simulator) -> f64 {
    let allowed = run.allowed_defect().zip(finer.allowed_defect());
    allowed.map_or(0.0, |(run, finer)| (finer / (USED * run)).min(MOST_SHARE))
}

/// Its nodes: with a tolerance one more, where the scheme has it, so that its rounding is another.
fn nodes_of_finer(options: &FesdOptions) -> usize {
    let (family, nodes) = options.scheme;
    let more = matches!(family, Family::RadauIia | Family::GaussLegendre) && nodes < MOST_NODES;
    nodes + usize::from(options.steps.is_none() && more)
}

/// What a finer run says, where differences are large compared with rounding. Algebraic states are measured by the
/// largest of them at least.
pub(super) fn estimate(
    system: &System,
    comparison: &Comparison,
    outcomes: [&Outcome; 2],
) -> Option<Estimate> {
    let scale = |i: usize| comparison.scale[i].max(outcomes[0].x[i].abs());
    let algebraic = system.algebraic_states();
    let largest = algebraic.iter().map(|&i| scale(i)).fold(0.0, f64::max);
    let least = |i: usize| match algebraic.binary_search(&i) {
        Ok(_) => fesd::NEGLIGIBLE * largest,
        Err(_) => 0.0,
    };
    estimate_with(least, comparison, outcomes)
}

/// The same with what each state is measured by at least.
pub(super) fn estimate_with(
    least: impl Fn(usize) -> f64,
    comparison: &Comparison,
    [found, fine]: [&Outcome; 2],
) -> Option<Estimate> {
    // What a second run does not get to is not known.
    if matches!(fine.status, Status::Over(_)) {
        return None;
    }
    let scale = |i: usize| comparison.scale[i].max(found.x[i].abs());
    let relative = |(i, difference): (usize, &f64)| {
        let scale = scale(i).max(least(i));
        // What rounding of its rate makes of a state is no motion to be relative to.
        let rounding = f64::EPSILON * found.activity[i] * found.time;
        if scale > HELD * rounding {
            difference / scale
        } else {
            0.0
        }
    };
    let error = comparison.difference.iter().enumerate().map(relative);
    let rounding = f64::EPSILON * (found.stats.steps as f64).sqrt();
    let error = error.fold(rounding, f64::max);
    let parted = comparison.parted(error);
    Some(Estimate {
        touches: Touches::default(),
        parted,
        error,
        same_modes: parted.is_none() && fine.status == found.status,
    })
}

fn method(
    settings: &Settings,
    options: &FesdOptions,
    order: usize,
    lowering: &str,
    solution: &Solution,
) -> Method {
    let (family, nodes) = options.scheme;
    let number = |name: &str, value: usize| (name.to_owned(), MethodOption::Number(value as f64));
    let word = |name: &str, value: &str| (name.to_owned(), MethodOption::Text(value.to_owned()));
    let mut shown = vec![
        word("scheme", &format!("{}({nodes})", family.word())),
        number("order", order),
        word("lowering", lowering),
    ];
    match options.steps {
        Some(steps) => {
            shown.push(number("steps", steps));
            shown.push(number("elements", options.elements));
        }
        None => shown.push(("tolerance".into(), MethodOption::Number(settings.tolerance))),
    }
    if solution.added_elements > 0 {
        shown.push(number("added_elements", solution.added_elements));
    }
    // How the active sets were found: by rates alone unless said.
    for (name, count) in [
        ("tried_sets", solution.rungs.tried),
        ("smoothed_sets", solution.rungs.smoothed),
        ("element_sets", solution.rungs.whole),
    ] {
        if count > 0 {
            shown.push(number(name, count));
        }
    }
    Method {
        name: "fesd".into(),
        options: shown,
    }
}

/// What a grid of the user's choice is worth: no warning for what it was chosen for, but none that
/// is too coarse to show what the model does passes for a solution.
pub(super) fn judge_grid(trajectory: &mut Trajectory, estimate: &Estimate, settings: &Settings) {
    trajectory.error_estimate = Some(estimate.error);
    if trajectory.failure.is_some() {
        return;
    }
    if !estimate.same_modes || estimate.error > COARSE {
        let failure = Failure::Coarse {
            error: format!("{:.1e}", estimate.error),
            modes: !estimate.same_modes,
            span: settings.span,
        };
        trajectory.status = failure.status();
        trajectory.failure = Some(failure);
    }
}

/// What steps without detection of switches are worth: their order is one across switches and impacts, so that large errors
/// are what they were chosen for; but steps longer than a pulse are told, and an error as large as a state is no solution.
pub(super) fn judge_steps(
    trajectory: &mut Trajectory,
    system: &System,
    settings: &Settings,
    steps: usize,
    error: Option<f64>,
) {
    let pulses = Pulses::of(system, settings.horizon);
    let unseen = pulses.warning(settings.horizon / steps as f64, settings);
    trajectory.warnings.extend(unseen);
    trajectory.error_estimate = error;
    if let Some(error) = error.filter(|&error| error > 1.0) {
        trajectory.warnings.push(Warning {
            code: "W0702".into(),
            message: format!(
                "the estimated error {error:.1e} is above the size of a state: more `steps` are needed"
            ),
            span: Some(settings.span),
        });
    }
}
