//! A trajectory by any method: a run, a finer one that shows its error, both again where that is too large; then names,
//! events and what a report says of them.

use std::sync::Arc;

use nsd_solver::event::Observer;
use nsd_solver::event::Recording;
use nsd_solver::fesd::NEGLIGIBLE;
use nsd_solver::hybrid::{Outcome, Status as End};
use nsd_solver::sensitivity::{Directions, Moment, Sensitivities};

use super::estimate::{Comparison, Estimate, Estimator, held};
use super::methods::blurred;
use super::record::Recorder;
use super::sensing::{Both, Sensing, Weigh, instants};
use super::watch::{Progress, Watched};
use super::{Request, outcome};
use crate::limit::Limit;
use crate::project::clock::Instant;
use crate::report::{Certificate, Failure, Method, Quality, Setup, Stats, Status, Trajectory};
use crate::simulate::outcome::overlooked::{Look, Looking};
use crate::simulate::record::modes::ModeNames;
use crate::simulate::record::reported::Reported;
use crate::system::System;
use crate::system::experiment::Settings;

/// How much more accurate the second run is.
pub(super) const REFINEMENT: f64 = 1e-2;

/// Runs with a tolerance that the estimate has shown to be too loose.
const MAX_ATTEMPTS: usize = 3;

/// A smaller tolerance than this is that of rounding.
const LEAST_TOLERANCE: f64 = 1e-15;

/// What is run, however accurately.
pub(super) struct Problem<'r, 'e> {
    pub system: &'r System<'e>,
    pub settings: &'r Settings<'e>,
    pub limit: &'r Limit,
    /// Whether the multipliers of the method are kept, and whether a finer run is to show the error.
    pub multipliers: bool,
    pub estimates: bool,
    pub x0: Vec<f64>,
    /// By what the run is differentiated.
    pub sensing: Option<&'r Sensing>,
}

impl<'r, 'e> Problem<'r, 'e> {
    pub fn new(
        system: &'r System<'e>,
        settings: &'r Settings<'e>,
        (request, sensing): (&'r Request, Option<&'r Sensing>),
    ) -> Self {
        Problem {
            multipliers: request.multipliers,
            estimates: request.estimate,
            sensing,
            ..Problem::of_end(system, settings, &request.limit)
        }
    }

    /// A run for its end alone.
    pub fn of_end(system: &'r System<'e>, settings: &'r Settings<'e>, limit: &'r Limit) -> Self {
        Problem {
            system,
            settings,
            limit,
            multipliers: false,
            estimates: false,
            x0: system.states.iter().map(|state| state.initial).collect(),
            sensing: None,
        }
    }
}

/// How accurate a run is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Accuracy {
    pub tolerance: f64,
    /// The number of tolerances that were tried, with this one.
    pub attempt: usize,
    /// Whether it is the second run, which shows the error of one with this tolerance.
    pub is_finer: bool,
}

impl Accuracy {
    /// That of an experiment.
    pub fn of(settings: &Settings) -> Self {
        Accuracy {
            tolerance: settings.numerics.tolerance,
            attempt: 1,
            is_finer: false,
        }
    }

    /// That of the second run.
    fn finer(self) -> Self {
        Accuracy {
            is_finer: true,
            ..self
        }
    }

    /// That of another attempt.
    pub fn next(self, tolerance: f64) -> Self {
        Accuracy {
            tolerance,
            attempt: self.attempt + 1,
            is_finer: false,
        }
    }

    /// A smaller tolerance, where an estimate has shown this one to be too loose.
    pub fn tightened(self, estimate: &Estimate, tolerance: f64) -> Option<Self> {
        if !estimate.same_modes {
            return None;
        }
        let share = if estimate.error > tolerance {
            0.1 * tolerance / estimate.error
        } else {
            estimate.touches.share_to_tell(tolerance)?
        };
        let again = self.attempt < MAX_ATTEMPTS && self.tolerance > LEAST_TOLERANCE;
        again.then(|| self.next(self.tolerance * share.max(1e-4)))
    }
}

/// How a run ended.
pub(super) struct Ended {
    pub outcome: Outcome,
    /// Why, where that is no matter of the states and switches of the system.
    pub failure: Option<Failure>,
}

impl Ended {
    /// As its outcome says.
    pub fn by(outcome: Outcome) -> Self {
        Ended {
            outcome,
            failure: None,
        }
    }

    /// Whether the horizon was reached.
    pub fn is_solved(&self) -> bool {
        self.failure.is_none() && self.outcome.status == End::Solved
    }
}

/// A method, with what it has compiled of a system. Other settings of the same method compile nothing.
pub(super) trait Run<'e> {
    /// Integrates to the horizon.
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended;

    /// Name and options, as they were in the first run.
    fn describe(&self, problem: &Problem<'_, 'e>, ended: &Ended) -> Method;

    /// How a finer run shows the error of one.
    fn estimator(&self, settings: &Settings<'e>) -> Estimator;

    /// Whether a finer run is made.
    fn compares(&self, ended: &Ended) -> bool {
        !matches!(ended.outcome.status, End::Over(_))
    }

    /// The size that each state is measured by at least, by the largest magnitudes of all: algebraic states have no size of
    /// their own.
    fn least_sizes(&self, system: &System<'e>, sizes: &[f64]) -> Vec<f64> {
        let mut least = vec![0.0; sizes.len()];
        let algebraic = system.algebraic_states();
        let largest = algebraic.iter().map(|&i| sizes[i]).fold(0.0, f64::max);
        for i in algebraic {
            least[i] = NEGLIGIBLE * largest;
        }
        least
    }

    /// States that jump within steps, of which no event tells.
    fn jumping(&self, _: &System<'e>) -> Vec<usize> {
        Vec::new()
    }

    /// Intervals of time inside of which these have jumped in one of both runs and not yet in the other.
    fn apart(&self) -> Vec<(f64, f64)> {
        Vec::new()
    }

    /// What a finer run says.
    fn estimate(
        &mut self,
        problem: &Problem<'_, 'e>,
        comparison: &Comparison,
        [found, finer]: [&Ended; 2],
    ) -> Option<Estimate> {
        let outcomes = [&found.outcome, &finer.outcome];
        if !self.estimator(problem.settings).compares(outcomes) {
            return None;
        }
        let sizes = comparison.sizes(&found.outcome.x);
        let least = self.least_sizes(problem.system, &sizes);
        let held = held(problem.system, &found.outcome, &sizes);
        let estimate = Estimate::of(comparison, outcomes, [&least, &held])?;
        Some(self.corrected(estimate, problem.system, &found.outcome))
    }

    /// The estimate with what only the method knows of its error.
    fn corrected(&mut self, estimate: Estimate, _: &System<'e>, _: &Outcome) -> Estimate {
        estimate
    }

    /// How accurate another attempt is to be, where one is needed.
    fn refined(
        &mut self,
        settings: &Settings<'e>,
        accuracy: Accuracy,
        _ended: &Ended,
        estimate: Option<&Estimate>,
    ) -> Option<Accuracy> {
        let is_open = self.estimator(settings) == Estimator::Tolerance;
        accuracy.tightened(estimate.filter(|_| is_open)?, settings.numerics.tolerance)
    }

    /// Whether initial states, signals and open parameters are numbers of a run; else they are compiled in.
    fn takes_numbers(&self) -> bool {
        false
    }

    /// Whether it counts switching functions as zero by the size of their terms alone.
    fn has_bands(&self) -> bool {
        false
    }

    /// Whether it sees by itself where functions of states are narrow.
    fn sees_narrow(&self) -> bool {
        false
    }

    /// Differentiates the last run that was no finer one, at instants; none where the method is not differentiated.
    fn differentiate(
        &self,
        _: &Recording,
        _: &Ended,
        _: (&Directions, &[Moment]),
    ) -> Option<Sensitivities> {
        None
    }

    /// The gradient of a functional of that run; none where it is not known in one pass, or the method has none.
    fn pull(
        &self,
        _: &Recording,
        _: &Ended,
        _: (&Directions, &[Moment]),
        _: &mut dyn FnMut(&Sensitivities) -> Option<Vec<Vec<f64>>>,
    ) -> Option<Vec<f64>> {
        None
    }

    /// Adds to a trajectory what only the method knows of it.
    fn tell(&mut self, _problem: &Problem<'_, 'e>, _ended: &Ended, _trajectory: &mut Trajectory) {}
}

/// A run and its record.
struct First<'r, 'e> {
    ended: Ended,
    recorder: Recorder<'r, 'e>,
    /// Its steps and events, where it is differentiated.
    recording: Recording,
}

/// Runs a problem as often as its error needs, and tells everything about it.
pub(super) fn drive<'e>(
    run: &mut dyn Run<'e>,
    (system, settings): (&System<'e>, &Settings<'e>),
    reported: &Arc<Reported>,
    (request, sensing): (&Request, Option<&Sensing>),
    watch: &mut dyn FnMut(Progress),
) -> Trajectory {
    let started = Instant::now();
    let problem = Problem::new(system, settings, (request, sensing));
    let mut accuracy = Accuracy::of(settings);
    let (first, estimate, wanted) = loop {
        let recorder = Recorder::new(
            system,
            settings,
            accuracy.tolerance,
            request.dense,
            reported.clone(),
        );
        let first = march(run, &problem, accuracy, recorder, watch);
        let wanted = problem.estimates && run.compares(&first.ended);
        let estimate = match wanted {
            true => compare(run, &problem, accuracy.finer(), &first, watch),
            false => None,
        };
        match run.refined(settings, accuracy, &first.ended, estimate.as_ref()) {
            Some(next) => accuracy = next,
            None => break (first, estimate, wanted),
        }
    };
    let First {
        ended,
        mut recorder,
        recording,
    } = first;
    let ranges = std::mem::take(&mut recorder.record.ranges);
    let mut trajectory = assemble(&problem, &ended, recorder);
    if let Some(sensing) = sensing {
        let of = (system, &**reported);
        differentiate(run, (&recording, &ended), (sensing, of), &mut trajectory);
    }
    let last = outcome::last::warning(system, &ended.outcome, &ranges);
    trajectory.warnings.extend(last);
    trajectory.setup.method = run.describe(&problem, &ended);
    if run.has_bands() {
        let blurred = blurred::warning(system, &ended.outcome, &ranges);
        trajectory.warnings.extend(blurred);
    }
    run.tell(&problem, &ended, &mut trajectory);
    match estimate {
        Some(estimate) => {
            estimate.tell(run.estimator(settings), system, settings, &mut trajectory);
        }
        None if wanted => {
            let missing = super::estimate::missing(problem.limit.over(), settings);
            trajectory.warnings.push(missing);
        }
        None => {}
    }
    trajectory.quality.stats.solve_s = started.elapsed().as_secs_f64();
    trajectory
}

/// Adds the derivatives of a run, or the gradient of what is weighed of one that has reached its end: in one pass back where
/// that serves all directions, else from the derivatives of all rows.
fn differentiate<'e>(
    run: &dyn Run<'e>,
    (recording, ended): (&Recording, &Ended),
    (sensing, of): (&Sensing, (&System<'e>, &Reported)),
    trajectory: &mut Trajectory,
) {
    let weights = sensing.weights.as_deref();
    if let Some(weights) = weights {
        if !ended.is_solved() || sensing.misfit(&trajectory.samples).is_some() {
            return;
        }
        // The sum of nothing.
        if weights.iter().all(|(_, own)| own.iter().all(|w| *w == 0.0)) {
            trajectory.samples.gradient = Some(vec![0.0; sensing.directions.len()]);
            return;
        }
    }
    let wanted = instants(&trajectory.samples.time);
    let asked = (&sensing.directions, &wanted[..]);
    let mut pull = |weigh: &mut Weigh| run.pull(recording, ended, asked, weigh);
    if weights.is_some_and(|weights| sensing.pull(weights, &mut pull, of, trajectory)) {
        return;
    }
    let Some(found) = run.differentiate(recording, ended, asked) else {
        return;
    };
    sensing.tell(&found, of, trajectory);
    if let Some(weights) = weights {
        sensing.weigh(weights, trajectory);
    }
}

/// The first run.
fn march<'r, 'e>(
    run: &mut dyn Run<'e>,
    problem: &Problem<'_, 'e>,
    accuracy: Accuracy,
    mut recorder: Recorder<'r, 'e>,
    watch: &mut dyn FnMut(Progress),
) -> First<'r, 'e> {
    let Problem {
        system, settings, ..
    } = problem;
    let horizon = settings.horizon;
    let mut recording = Recording::default();
    let ended = match run.sees_narrow() {
        true if problem.sensing.is_some() => {
            let mut both = Both(&mut recorder, &mut recording);
            let mut watched = Watched::new(&mut both, horizon, false, watch);
            run.march(problem, accuracy, &mut watched)
        }
        true => {
            let mut watched = Watched::new(&mut recorder, horizon, false, watch);
            run.march(problem, accuracy, &mut watched)
        }
        false => {
            let look = Look::new(system, settings, &recorder.reported);
            let mut looking = Looking::new(look, &mut recorder);
            let mut watched = Watched::new(&mut looking, horizon, false, watch);
            let mut ended = run.march(problem, accuracy, &mut watched);
            ended.outcome.notes.extend(looking.notes());
            ended
        }
    };
    First {
        ended,
        recorder,
        recording,
    }
}

/// What the second run says of the first.
fn compare<'e>(
    run: &mut dyn Run<'e>,
    problem: &Problem<'_, 'e>,
    accuracy: Accuracy,
    first: &First<'_, 'e>,
    watch: &mut dyn FnMut(Progress),
) -> Option<Estimate> {
    let approaches = &first.ended.outcome.approaches;
    let jumping = run.jumping(problem.system);
    let mut comparison = Comparison::new(&first.recorder.record, &problem.x0, approaches, jumping);
    let horizon = problem.settings.horizon;
    let mut watched = Watched::new(&mut comparison, horizon, true, watch);
    let finer = run.march(problem, accuracy, &mut watched);
    comparison.leave_out(run.apart());
    run.estimate(problem, &comparison, [&first.ended, &finer])
}

/// Names everything and evaluates the outputs.
fn assemble<'e>(
    problem: &Problem<'_, 'e>,
    ended: &Ended,
    recorder: Recorder<'_, 'e>,
) -> Trajectory {
    let Problem {
        system, settings, ..
    } = problem;
    let (names, outcome) = (ModeNames::new(system), &ended.outcome);
    let failure = ended.failure.clone();
    let failure = failure.or_else(|| outcome::failure(system, &names, outcome, settings));
    let mut trajectory = Trajectory {
        setup: Setup {
            experiment: settings.name.clone(),
            model: system.name.clone(),
            skipped: system.provenance.skipped.clone(),
            ..Setup::default()
        },
        status: failure.as_ref().map_or(Status::Solved, Failure::status),
        failure,
        quality: Quality {
            stats: Stats {
                steps: outcome.stats.steps as u64,
                rhs_evaluations: outcome.stats.rhs_evaluations as u64,
                newton_iterations: outcome.stats.newton_iterations as u64,
                factorizations: outcome.stats.factorizations as u64,
                complementarity_residual: outcome.complementarity,
                ..Stats::default()
            },
            certificate: Certificate {
                max_violation: outcome.violation,
                ..Certificate::default()
            },
            ..Quality::default()
        },
        warnings: outcome::warnings(system, outcome),
        ..Trajectory::default()
    };
    recorder.fill(system, &names, outcome, &mut trajectory);
    trajectory
        .warnings
        .extend(outcome::unstopped(outcome, settings));
    let without = outcome::without_value(system, &trajectory.samples);
    trajectory.warnings.extend(without);
    trajectory.history.averaged = outcome::averaged(system, outcome);
    trajectory
}
