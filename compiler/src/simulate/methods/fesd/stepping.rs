//! `method timestepping`: the complementarity system in steps of one length, without switch detection.

use nsd_solver::event::Observer;
use nsd_solver::fesd::SteppingSettings;

use super::Compiled;
use crate::limit::Limit;
use crate::lowering::hybrid::Pulses;
use crate::report::{Method, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::Estimator;
use crate::simulate::methods::branching::Branching;
use crate::simulate::record::schedule::{follows_data, scheduled};
use crate::system::System;
use crate::system::experiment::{self, MethodKind, Settings, SteppingOptions};

/// A complementarity system that is stepped.
pub(in crate::simulate) struct Stepping {
    compiled: Compiled,
    /// Whether data decide when switches of time change, which is data itself.
    follows_data: bool,
    pulses: Pulses,
    branching: Branching,
}

impl Stepping {
    /// Compiles a system, with some parameters open, by their numbers; none that moves a switch of time which leads.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        Stepping {
            compiled: prepared(system, settings, open),
            follows_data: follows_data(system),
            pulses: Pulses::of(system, settings.horizon),
            branching: Branching::new(open),
        }
    }
}

/// A system for runs in steps to the horizon, or to an earlier one.
pub(crate) fn prepared(system: &System, settings: &Settings, open: &[usize]) -> Compiled {
    Compiled::new(&scheduled(system, settings.horizon), settings, open).0
}

/// The options of the method.
pub(in crate::simulate) fn options<'s>(settings: &'s Settings) -> &'s SteppingOptions {
    match &settings.numerics.method {
        experiment::Method::Timestepping(options) => options,
        _ => panic!("the method takes steps"),
    }
}

/// The steps of a run.
pub(in crate::simulate) fn steps(settings: &Settings, accuracy: Accuracy) -> usize {
    let refinement = if accuracy.is_finer { 2 } else { 1 };
    refinement * options(settings).steps
}

/// The steps of the first run of an experiment.
pub(crate) fn first_steps(settings: &Settings) -> SteppingSettings {
    settings_of(settings, Accuracy::of(settings), Limit::default())
}

fn settings_of(settings: &Settings, accuracy: Accuracy, limit: Limit) -> SteppingSettings {
    let (family, nodes) = options(settings).scheme();
    SteppingSettings {
        family,
        nodes,
        steps: steps(settings, accuracy),
        limit,
    }
}

impl<'e> Run<'e> for Stepping {
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let settings = settings_of(problem.settings, accuracy, problem.limit.clone());
        self.compiled.load(problem.system);
        let (horizon, x0) = (problem.settings.horizon, &problem.x0);
        let run = &mut self.compiled;
        if accuracy.is_finer {
            return Ended::by(run.by_steps(settings, horizon, x0, observer));
        }
        let mut following = self.branching.follow(problem, observer);
        let outcome = run.by_steps(settings, horizon, x0, &mut following);
        following.finish();
        Ended::by(outcome)
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let options = options(problem.settings);
        let (family, nodes) = options.scheme();
        Method::of(MethodKind::Timestepping)
            .word("scheme", format!("{}({nodes})", family.word()))
            .word("lowering", self.compiled.lowering)
            .count("steps", options.steps)
    }

    fn estimator(&self, _: &Settings<'e>) -> Estimator {
        Estimator::Steps
    }

    fn compares(&self, ended: &Ended) -> bool {
        ended.is_solved()
    }

    fn takes_numbers(&self) -> bool {
        !self.follows_data
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        let settings = problem.settings;
        let length = settings.horizon / options(settings).steps as f64;
        let told = [
            self.branching.warning(problem.system),
            self.pulses.warning(length, settings),
        ];
        trajectory.warnings.extend(told.into_iter().flatten());
    }
}
