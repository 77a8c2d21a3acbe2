//! `method timestepping`: the complementarity system in steps of one length, without switch detection.

use nsd_solver::fesd::{Stepper, SteppingSettings};
use nsd_solver::simulate::Observer;

use super::{Complementarity, lower};
use crate::dcs::Formulation;
use crate::hybrid::Pulses;
use crate::report::{Method, MethodOption, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::Estimator;
use crate::simulate::schedule::scheduled;
use crate::system::System;
use crate::system::experiment::{self, MethodKind, Settings, SteppingOptions};

/// A complementarity system that is stepped.
pub(in crate::simulate) struct Stepping<'e> {
    complementarity: Complementarity<'e>,
    formulation: Formulation,
    pulses: Pulses,
}

impl<'e> Stepping<'e> {
    /// Compiles a system.
    pub fn new(system: &System<'e>, settings: &Settings<'e>) -> Self {
        let (formulation, complementarity) = lower(&scheduled(system, settings.horizon), settings);
        Stepping {
            complementarity,
            formulation,
            pulses: Pulses::of(system, settings.horizon),
        }
    }
}

/// The options of the method.
pub(in crate::simulate) fn options<'s>(settings: &'s Settings) -> &'s SteppingOptions {
    match &settings.method {
        experiment::Method::Timestepping(options) => options,
        _ => panic!("the method takes steps"),
    }
}

/// The steps of a run.
pub(in crate::simulate) fn steps(settings: &Settings, accuracy: Accuracy) -> usize {
    let refinement = if accuracy.is_finer { 2 } else { 1 };
    refinement * options(settings).steps
}

impl<'e> Run<'e> for Stepping<'e> {
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
        let stepper = Stepper::new(&self.complementarity, settings);
        let mut stepper = stepper.expect("the number of nodes has been checked");
        let horizon = problem.settings.horizon;
        Ended::by(stepper.run(0.0, horizon, &problem.x0, &mut observer))
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let options = options(problem.settings);
        let (family, nodes) = options.scheme();
        let text = |word: String| MethodOption::Text(word);
        Method {
            name: MethodKind::Timestepping.word().into(),
            options: vec![
                ("scheme".into(), text(format!("{}({nodes})", family.word()))),
                ("lowering".into(), text(self.formulation.word().into())),
                ("steps".into(), MethodOption::Number(options.steps as f64)),
            ],
        }
    }

    fn estimator(&self, _: &Settings<'e>) -> Estimator {
        Estimator::Steps
    }

    fn compares(&self, ended: &Ended) -> bool {
        ended.is_solved()
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        let settings = problem.settings;
        let length = settings.horizon / options(settings).steps as f64;
        trajectory
            .warnings
            .extend(self.pulses.warning(length, settings));
    }
}
