//! `method timestepping`: the complementarity system in steps of one length, without switch detection.

use nsd_solver::event::Observer;
use nsd_solver::fesd::{Stepper, SteppingSettings};

use super::Compiled;
use crate::lowering::hybrid::Pulses;
use crate::report::{Method, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::Estimator;
use crate::simulate::record::schedule::scheduled;
use crate::system::System;
use crate::system::experiment::{self, MethodKind, Settings, SteppingOptions};

/// A complementarity system that is stepped.
pub(in crate::simulate) struct Stepping {
    compiled: Compiled,
    /// Whether switches of time are data, which other parameters or another horizon would change.
    is_scheduled: bool,
    pulses: Pulses,
}

impl Stepping {
    /// Compiles a system, with some parameters open, by their numbers; none where switches of time lead.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        let scheduled = scheduled(system, settings.horizon);
        Stepping {
            compiled: Compiled::new(&scheduled, settings, open).0,
            is_scheduled: !system.leading().is_empty(),
            pulses: Pulses::of(system, settings.horizon),
        }
    }
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

impl<'e> Run<'e> for Stepping {
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        mut observer: &mut dyn Observer,
    ) -> Ended {
        let (family, nodes) = options(problem.settings).scheme();
        let settings = SteppingSettings {
            family,
            nodes,
            steps: steps(problem.settings, accuracy),
            limit: problem.limit.clone(),
        };
        self.compiled.load(problem.system);
        let library = std::mem::take(&mut self.compiled.library);
        let stepper = Stepper::new(&self.compiled.complementarity, settings);
        let stepper = stepper.expect("the number of nodes has been checked");
        let mut stepper = stepper.knowing(library);
        let horizon = problem.settings.horizon;
        let outcome = stepper.run(0.0, horizon, &problem.x0, &mut observer);
        self.compiled.library = stepper.library().clone();
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
        !self.is_scheduled
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        let settings = problem.settings;
        let length = settings.horizon / options(settings).steps as f64;
        trajectory
            .warnings
            .extend(self.pulses.warning(length, settings));
    }
}
