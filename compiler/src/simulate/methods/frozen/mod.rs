//! Runs in numerical time: a system is frozen, run event by event or by finite elements, and told in physical time.

mod back_map;
mod law;
mod physical_time;
mod runner;
mod stretch;

use nsd_solver::event::{Observer, Recording, Simulator};
use nsd_solver::fesd::Recorded;
use nsd_solver::hybrid::Outcome;
use nsd_solver::sensitivity::{Directions, Moment, Sensitivities};
use physical_time::End;
pub(crate) use runner::FrozenRunner;

use super::fesd::options;
use crate::lowering::hybrid::Pulses;
use crate::report::{Failure, Method, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::Estimator;
use crate::simulate::outcome;
use crate::simulate::record::modes::ModeNames;
use crate::system::experiment::{self, MethodKind, Settings};
use crate::system::freezing::{Frozen, freeze, freeze_open};
use crate::system::{System, SystemError};

/// A system in numerical time.
pub(crate) struct InNumericalTime<'e> {
    /// The frozen system, which has the names.
    system: System<'e>,
    runner: FrozenRunner,
    /// The last run from event to event.
    kept: Option<Simulator>,
    /// Where the system varies fast in physical time.
    pulses: Pulses,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// Order of the method, and the least member of a pair of complementarity, of the first run.
    order: usize,
    least_member: f64,
    /// The elements of that run, where it is differentiated.
    recorded: Option<Recorded>,
    /// Those of the finer run.
    finer: Option<Recorded>,
}

/// A system for runs with other values of some parameters, by their numbers.
pub(crate) fn prepared<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    open: &[usize],
) -> FrozenRunner {
    let frozen = checked(freeze_open(system, settings.pace(), open));
    FrozenRunner::new(system, &frozen, settings, open)
}

fn checked<'e>(frozen: Result<Frozen<'e>, SystemError>) -> Frozen<'e> {
    frozen.expect("compilation has checked that the system can be frozen")
}

impl<'e> InNumericalTime<'e> {
    /// Freezes and compiles a system, with some parameters open, by their numbers. Where none is, the equations of elements
    /// have numbers for its measures: more of them are eliminated then.
    pub fn new(system: &System<'e>, settings: &Settings<'e>, open: &[usize]) -> Self {
        let (by_elements, pace) = (settings.numerics.method.kind().needs_dcs(), settings.pace());
        let frozen = checked(match by_elements && open.is_empty() {
            true => freeze(system, pace),
            false => freeze_open(system, pace, open),
        });
        InNumericalTime {
            runner: FrozenRunner::new(system, &frozen, settings, open),
            system: frozen.system,
            kept: None,
            pulses: Pulses::of(system, settings.horizon),
            open: open.to_vec(),
            order: 0,
            least_member: 0.0,
            recorded: None,
            finer: None,
        }
    }

    /// Why a run has ended before its horizon.
    fn failure(&self, settings: &Settings, outcome: &Outcome, end: Option<End>) -> Option<Failure> {
        let (system, time) = (&self.system, outcome.time);
        let of = |contact: usize| {
            let name = system.switches[contact].name.clone();
            (name, outcome::labels(system, &[contact]))
        };
        let stops = |what: String| Failure::Standstill {
            time,
            what,
            span: settings.span,
        };
        Some(match end {
            Some(End::Limit(limit)) => stops(format!("bounces accumulate towards t = {limit:.6}")),
            Some(End::Closed) => stops("a contact stays closed".to_owned()),
            Some(End::Unlawful) => {
                let what = "forces act at once, which one after the other are another impact";
                stops(what.to_owned())
            }
            Some(End::Locked(contact)) => {
                let (name, surfaces) = of(contact);
                Failure::Painleve {
                    time,
                    name,
                    surfaces,
                }
            }
            Some(End::Below(contact)) => {
                let (name, surfaces) = of(contact);
                Failure::Penetrates {
                    time,
                    name,
                    surfaces,
                }
            }
            Some(End::Outside(contact, coefficient, value)) => {
                let (name, surfaces) = of(contact);
                outcome::outside((coefficient, value), (time, name), surfaces)
            }
            None => return outcome::failure(system, &ModeNames::new(system), outcome, settings),
        })
    }
}

impl<'e> Run<'e> for InNumericalTime<'e> {
    /// Integrates the frozen system until its clock has reached the horizon of the experiment.
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let (settings, runner) = (problem.settings, &mut self.runner);
        runner.set_parameters(&problem.system.values_of(&self.open));
        runner.choose(settings, accuracy, problem.limit.clone());
        // As of `method fesd`.
        let is_adaptive = matches!(&settings.numerics.method, experiment::Method::Fesd(options) if options.steps.is_none());
        runner.records = problem.sensing.is_some() && (is_adaptive || !accuracy.is_finer);
        let run = runner.run(settings.horizon, &problem.x0, &mut self.kept, observer);
        if accuracy.is_finer {
            self.finer = run.recorded;
        } else {
            (self.order, self.least_member) = (run.order, run.least_member);
            (self.recorded, self.finer) = (run.recorded, None);
        }
        Ended {
            failure: self.failure(settings, &run.outcome, run.end),
            outcome: run.outcome,
        }
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let settings = problem.settings;
        match self.runner.formulation() {
            None => Method::of(MethodKind::Event)
                .count("order", self.order)
                .word("lowering", "timefreezing")
                .number("tolerance", settings.numerics.tolerance),
            Some(formulation) => {
                let lowering = format!("timefreezing, {formulation}");
                let steps = options(settings).steps;
                super::fesd::method(settings, Some(self.order), &lowering, steps)
            }
        }
    }

    fn estimator(&self, settings: &Settings<'e>) -> Estimator {
        Estimator::of_elements(settings)
    }

    fn takes_numbers(&self) -> bool {
        self.runner.takes_measures()
    }

    fn has_bands(&self) -> bool {
        self.runner.formulation().is_some()
    }

    fn differentiate(
        &self,
        _: &Recording,
        _: &Ended,
        (directions, instants): (&Directions, &[Moment]),
    ) -> Option<Sensitivities> {
        let by = |run: &Recorded| (self.runner).differentiate(run, directions, instants);
        let runs = [self.recorded.as_ref(), self.finer.as_ref()];
        super::fesd::confirmed(by, runs, directions)
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, ended: &Ended, trajectory: &mut Trajectory) {
        if self.runner.formulation().is_some() {
            // Elements end where numerical time says, and not where physical time has a pulse.
            let settings = problem.settings;
            let length = settings.horizon / ended.outcome.stats.steps.max(1) as f64;
            let unseen = self.pulses.warning(length, settings);
            trajectory.warnings.extend(unseen);
            // As of `method fesd`.
            trajectory.quality.certificate.max_violation = -self.least_member;
        }
    }
}
