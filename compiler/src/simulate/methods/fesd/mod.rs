//! The road of finite elements: a system becomes a complementarity system, and that a trajectory.
//!
//! A second run, on a grid twice as fine or with a smaller tolerance, gives the estimate of the
//! global error.

mod compiled;
mod complementarity;
pub(crate) mod impulses;
mod kept;
pub(crate) mod stepping;
mod turns;

use std::ops::ControlFlow;

use nsd_solver::event::{self, Event, Observer, Segment};
use nsd_solver::fesd::{self, Elements, Grid, Recorded, Recording, Rungs};
use nsd_solver::hybrid::Outcome;
use nsd_solver::integrate::tableau::Family;
use nsd_solver::sensitivity::{Directions, Moment, Sensitivities};

pub(crate) use compiled::{Compiled, Ran};
pub use complementarity::complementarity;
pub(crate) use complementarity::complementarity_open;
pub use impulses::prepared as with_impulses;
use turns::{Surfaces, Turned, Turns};

use crate::limit::Limit;
use crate::lowering::hybrid::Pulses;
use crate::report::{Method, Multipliers, Series, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, REFINEMENT, Run};
use crate::simulate::estimate::{Estimate, Estimator};
use crate::system::System;
use crate::system::experiment::{self, FesdOptions, MethodKind, Settings};

/// Tolerances below this, in relation to rounding, make no other elements, so that a finer run says nothing (chosen by
/// trial).
const FINEST: f64 = 1e-13;

/// The part of the defect that it is allowed which an element has at least, as the safety of its length leaves it.
const USED: f64 = 0.5;

/// The largest share of an error that the finer run is taken to have, too: next to rounding both runs allow the same.
const MOST_SHARE: f64 = 0.5;

/// Nodes of the largest schemes of Radau IIA and Gauss.
const MOST_NODES: usize = 9;
/// Derivatives that a finer run changes by more than this share of the largest one are not known.
const CONFIRMED: f64 = 1e-4;

/// Keeps the multipliers and elements of a run, and looks at surfaces that are touched, besides what another observer does.
pub(in crate::simulate) struct Keeper<'s, 'e, 'o> {
    observer: &'o mut dyn Observer,
    kept: Option<Multipliers>,
    /// Where the run is differentiated.
    pub recording: Option<Recording>,
    turns: Option<Turns<'s, 'e>>,
}

impl<'o> Keeper<'_, '_, 'o> {
    /// Keeps elements alone.
    pub fn recording(observer: &'o mut dyn Observer) -> Self {
        Keeper {
            observer,
            kept: None,
            recording: Some(Recording::default()),
            turns: None,
        }
    }
}

impl Observer for Keeper<'_, '_, '_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        if let Some(turns) = &mut self.turns {
            turns.segment(segment);
        }
        if let Some(recording) = &mut self.recording {
            recording.segment(segment)?;
        }
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        if let Some(recording) = &mut self.recording {
            recording.event(event);
        }
        self.observer.event(event);
    }
}

impl fesd::Observer for Keeper<'_, '_, '_> {
    fn wants_multipliers(&self) -> bool {
        self.kept.is_some()
    }

    fn elements(&mut self, elements: &Elements) {
        if let Some(recording) = &mut self.recording {
            recording.elements(elements);
        }
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

/// A complementarity system that finite elements run.
pub(crate) struct ByElements {
    compiled: Compiled,
    /// The names of its algebraic variables.
    algebraics: Vec<String>,
    surfaces: Surfaces,
    pulses: Pulses,
    /// What the first run has left.
    left: Left,
    /// The defect that an element of the second run may have.
    allowed: Option<f64>,
    /// The elements of that run, where it is differentiated.
    finer: Option<Recorded>,
}

/// What a run leaves besides its end.
#[derive(Default)]
struct Left {
    order: usize,
    least_member: f64,
    added_elements: usize,
    rungs: Rungs,
    /// The defect that an element may have.
    allowed: Option<f64>,
    multipliers: Option<Multipliers>,
    /// Where it is differentiated.
    recorded: Option<Recorded>,
    turned: Turned,
}

impl ByElements {
    /// Compiles a system, with some parameters open, by their numbers.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        let pulses = Pulses::of(system, settings.horizon);
        let (compiled, algebraics) = Compiled::for_elements(system, settings, open, &pulses);
        ByElements {
            compiled,
            algebraics,
            surfaces: Surfaces::of(system, open),
            pulses,
            left: Left::default(),
            allowed: None,
            finer: None,
        }
    }

    /// What the finer run may itself be off by, as a share of the error of the other. Where a rate has no derivative an
    /// element has no order, and is off by about its defect.
    fn share_of_finer(&self) -> f64 {
        let allowed = self.left.allowed.zip(self.allowed);
        allowed.map_or(0.0, |(run, finer)| (finer / (USED * run)).min(MOST_SHARE))
    }
}

/// The options of the method.
pub(crate) fn options<'s>(settings: &'s Settings) -> &'s FesdOptions {
    match &settings.numerics.method {
        experiment::Method::Fesd(options) => options,
        _ => panic!("the method has finite elements"),
    }
}

impl<'e> Run<'e> for ByElements {
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let settings = elements(options(problem.settings), accuracy, problem.limit.clone());
        self.compiled.load(problem.system);
        let is_kept = problem.multipliers && !accuracy.is_finer;
        // A grid is taken as it is, and so are its derivatives.
        let is_adaptive = options(problem.settings).steps.is_none();
        let is_recorded = problem.sensing.is_some() && (is_adaptive || !accuracy.is_finer);
        let mut keeper = Keeper {
            observer,
            kept: is_kept.then(|| empty(&self.algebraics)),
            recording: is_recorded.then(Recording::default),
            turns: (problem.estimates && !accuracy.is_finer || is_recorded)
                .then(|| Turns::new(problem.system, &mut self.surfaces)),
        };
        let horizon = problem.settings.horizon;
        let run = (self.compiled).by_elements(settings.clone(), horizon, &problem.x0, &mut keeper);
        let Ran {
            solution,
            order,
            allowed,
        } = run;
        let (kept, recording) = (keeper.kept, keeper.recording);
        let turned = keeper.turns.map(Turns::done).unwrap_or_default();
        let recorded = recording.map(|recording| Recorded {
            settings,
            recording,
            turns: turned.told(problem.system, &mut self.surfaces, horizon),
            clock: None,
        });
        if accuracy.is_finer {
            (self.allowed, self.finer) = (allowed, recorded);
        } else {
            self.finer = None;
            self.left = Left {
                order,
                least_member: solution.least_member,
                added_elements: solution.added_elements,
                rungs: solution.rungs,
                allowed,
                multipliers: kept,
                recorded,
                turned,
            };
        }
        Ended::by(solution.outcome)
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let (settings, left) = (problem.settings, &self.left);
        let steps = options(settings).steps;
        let method = method(settings, Some(left.order), self.compiled.lowering, steps);
        // How the active sets were found: by rates alone unless said.
        let counts = [
            ("added_elements", left.added_elements),
            ("tried_sets", left.rungs.tried),
            ("smoothed_sets", left.rungs.smoothed),
            ("element_sets", left.rungs.whole),
        ];
        counted(method, counts)
    }

    fn estimator(&self, settings: &Settings<'e>) -> Estimator {
        Estimator::of_elements(settings)
    }

    fn corrected(&mut self, estimate: Estimate, system: &System<'e>, found: &Outcome) -> Estimate {
        let error = estimate.error / (1.0 - self.share_of_finer());
        Estimate {
            error,
            touches: (self.left.turned).judge(system, &mut self.surfaces, error, found.time),
            ..estimate
        }
    }

    fn refined(
        &mut self,
        settings: &Settings<'e>,
        accuracy: Accuracy,
        _: &Ended,
        estimate: Option<&Estimate>,
    ) -> Option<Accuracy> {
        // A grid is taken as it is.
        let is_open = options(settings).steps.is_none();
        let next =
            accuracy.tightened(estimate.filter(|_| is_open)?, settings.numerics.tolerance)?;
        let tolerance = next.tolerance.max(FINEST);
        (tolerance < accuracy.tolerance).then(|| accuracy.next(tolerance))
    }

    fn takes_numbers(&self) -> bool {
        true
    }

    fn has_bands(&self) -> bool {
        true
    }

    fn differentiate(
        &self,
        _: &event::Recording,
        _: &Ended,
        (directions, instants): (&Directions, &[Moment]),
    ) -> Option<Sensitivities> {
        let recorded = self.left.recorded.as_ref()?;
        let system = self.compiled.system();
        let by = |run: &Recorded| fesd::differentiate(system, run, directions, instants).ok();
        confirmed(by, [Some(recorded), self.finer.as_ref()], directions)
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        let settings = problem.settings;
        trajectory.quality.certificate.max_violation = -self.left.least_member;
        trajectory.multipliers = self.left.multipliers.take();
        let options = options(settings);
        if let Some(steps) = options.steps {
            let length = settings.horizon / (steps * options.elements) as f64;
            let unseen = self.pulses.warning(length, settings);
            trajectory.warnings.extend(unseen);
        }
    }
}

/// The derivatives of a run, where those of a finer one are the same.
pub(crate) fn confirmed(
    by: impl Fn(&Recorded) -> Option<Sensitivities>,
    [run, finer]: [Option<&Recorded>; 2],
    directions: &Directions,
) -> Option<Sensitivities> {
    let mut found = by(run?)?;
    let n_states = directions.initial.first().map_or(0, Vec::len);
    if let Some(finer) = finer.and_then(by) {
        found.confirm(&finer, n_states, CONFIRMED);
    }
    Some(found)
}

/// No values yet of any algebraic variable.
fn empty(names: &[String]) -> Multipliers {
    let series = |name: &String| Series {
        name: name.clone(),
        ..Series::default()
    };
    Multipliers {
        time: Vec::new(),
        values: names.iter().map(series).collect(),
    }
}

/// The elements of the first run of an experiment.
pub(crate) fn first_elements(settings: &Settings) -> fesd::Settings {
    let accuracy = Accuracy::of(settings);
    elements(options(settings), accuracy, Limit::default())
}

/// The elements of a run.
fn elements(options: &FesdOptions, accuracy: Accuracy, limit: Limit) -> fesd::Settings {
    let nodes = match accuracy.is_finer {
        true => nodes_of_finer(options),
        false => options.scheme.1,
    };
    fesd::Settings {
        limit,
        grid: grid(options, accuracy),
        ..fesd::Settings::new(options.scheme.0, nodes)
    }
}

/// The grid of a run; that of a finer one shows its error.
pub(in crate::simulate) fn grid(options: &FesdOptions, accuracy: Accuracy) -> Grid {
    match (options.steps, accuracy.is_finer) {
        (Some(steps), finer) => Grid::Steps {
            steps: if finer { 2 * steps } else { steps },
            elements: options.elements,
        },
        (None, finer) => Grid::Adaptive {
            tolerance: if finer { REFINEMENT } else { 1.0 } * accuracy.tolerance,
        },
    }
}

/// The nodes of the finer run: with a tolerance one more, where the scheme has it, so that its rounding is another.
fn nodes_of_finer(options: &FesdOptions) -> usize {
    let (family, nodes) = options.scheme;
    let more = matches!(family, Family::RadauIia | Family::GaussLegendre) && nodes < MOST_NODES;
    nodes + usize::from(options.steps.is_none() && more)
}

/// What a method says of itself, with the order of its elements where that is known, and the steps of its grid.
pub(crate) fn method(
    settings: &Settings,
    order: Option<usize>,
    lowering: &str,
    steps: Option<usize>,
) -> Method {
    let options = options(settings);
    let (family, nodes) = options.scheme;
    let mut method = Method::of(MethodKind::Fesd);
    method = method.word("scheme", format!("{}({nodes})", family.word()));
    if let Some(order) = order {
        method = method.count("order", order);
    }
    method = method.word("lowering", lowering);
    match steps {
        Some(steps) => (method.count("steps", steps)).count("elements", options.elements),
        None => method.number("tolerance", settings.numerics.tolerance),
    }
}

/// With what there was any of.
fn counted<const N: usize>(method: Method, counts: [(&str, usize); N]) -> Method {
    let counts = counts.into_iter().filter(|(_, count)| *count > 0);
    counts.fold(method, |method, (name, count)| method.count(name, count))
}
