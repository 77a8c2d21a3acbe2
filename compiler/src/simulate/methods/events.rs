//! Runs from event to event of a system that is compiled once.

use std::sync::Arc;

use nsd_solver::event::Recording;
use nsd_solver::event::{Observer, Simulator};
use nsd_solver::hybrid as solver;
use nsd_solver::hybrid::HybridSystem;
use nsd_solver::sensitivity::{Directions, Moment, Sensitivities, adjoint, differentiate};

use super::smoothed;
use crate::limit::Limit;
use crate::lowering::hybrid;
use crate::report::{Method, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, REFINEMENT, Run};
use crate::simulate::estimate::Estimator;
use crate::system::System;
use crate::system::experiment::{self, Branch, EventOptions, MethodKind, Settings};

/// Orders by which the second run is above the first, so that its rounding errors are others.
const MORE_ORDERS: usize = 3;

/// A system as data, and what runs keep of its functions.
pub(crate) struct Events {
    hybrid: Arc<HybridSystem>,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// The last runs with the tolerance of an experiment, and with a smaller one.
    coarse: Option<Simulator>,
    fine: Option<Simulator>,
}

impl Events {
    /// Compiles a system, with some parameters open, by their numbers.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        Events {
            hybrid: hybrid::lower_open(system, settings.horizon, open),
            open: open.to_vec(),
            coarse: None,
            fine: None,
        }
    }

    /// A simulator with these settings, and the present data and values of the open parameters.
    fn ready(&mut self, problem: &Problem, accuracy: Accuracy) -> &mut Simulator {
        let (settings, limit) = (problem.settings, problem.limit.clone());
        let chosen = solver::Settings {
            kicks: settings
                .kicks
                .as_ref()
                .map(|kicks| kicks.kicks(problem.system)),
            averages: settings.numerics.averages,
            ..solver_settings(&settings.numerics.method, accuracy.tolerance, limit)
        };
        let mut simulator = renewed(&mut self.coarse, &self.hybrid, chosen);
        if accuracy.is_finer {
            let finer = finer(simulator.settings(), simulator.order(), accuracy.tolerance);
            if self.fine.is_none() {
                // What has been compiled for one serves the other.
                self.fine = Some(simulator.with(finer.clone()));
            }
            simulator = renewed(&mut self.fine, &self.hybrid, finer);
        }
        let open = self
            .open
            .iter()
            .map(|&place| problem.system.exogenous.params[place].value);
        simulator.set_parameters(&open.collect::<Vec<f64>>());
        simulator.set_data(0, &hybrid::data_of(problem.system));
        simulator
    }
}

impl<'e> Run<'e> for Events {
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let simulator = self.ready(problem, accuracy);
        let horizon = problem.settings.horizon;
        Ended::by(simulator.run(0.0, horizon, &problem.x0, observer))
    }

    fn describe(&self, problem: &Problem<'_, 'e>, ended: &Ended) -> Method {
        let numerics = &problem.settings.numerics;
        let mut method = match &numerics.method {
            experiment::Method::Smoothing(options) => smoothed::method(options),
            _ => Method::of(MethodKind::Event),
        };
        let Some(run) = &self.coarse else {
            return method;
        };
        method = (method.count("order", run.order())).number("tolerance", numerics.tolerance);
        match ended.outcome.stats.implicit_steps {
            0 => method,
            _ => method.count("implicit_order", run.implicit_order()),
        }
    }

    fn estimator(&self, _: &Settings<'e>) -> Estimator {
        Estimator::Tolerance
    }

    fn takes_numbers(&self) -> bool {
        true
    }

    fn sees_narrow(&self) -> bool {
        true
    }

    fn differentiate(
        &self,
        recording: &Recording,
        ended: &Ended,
        (directions, instants): (&Directions, &[Moment]),
    ) -> Option<Sensitivities> {
        let simulator = self.coarse.as_ref()?;
        let approaches = &ended.outcome.approaches;
        Some(differentiate(
            simulator, recording, approaches, directions, instants,
        ))
    }

    fn pull(
        &self,
        recording: &Recording,
        ended: &Ended,
        (directions, instants): (&Directions, &[Moment]),
        weigh: &mut dyn FnMut(&Sensitivities) -> Option<Vec<Vec<f64>>>,
    ) -> Option<Vec<f64>> {
        let of = (recording, &ended.outcome.approaches[..]);
        adjoint(self.coarse.as_ref()?, of, directions, instants, weigh)
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, _: &Ended, trajectory: &mut Trajectory) {
        if let experiment::Method::Smoothing(options) = &problem.settings.numerics.method {
            let warning = smoothed::warning(problem.system, options, problem.settings.span);
            trajectory.warnings.extend(warning);
        }
    }
}

/// A simulator with these settings: the last one, if it had the same but for its time.
pub(super) fn renewed<'s>(
    last: &'s mut Option<Simulator>,
    hybrid: &Arc<HybridSystem>,
    settings: solver::Settings,
) -> &'s mut Simulator {
    let simulator = match last.take() {
        Some(mut last) => {
            last.set_limit(settings.limit.clone());
            match *last.settings() == settings {
                true => last,
                false => last.with(settings),
            }
        }
        None => Simulator::new(hybrid.clone(), settings),
    };
    last.insert(simulator)
}

/// The settings of the solver that an experiment asks for.
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
        Branch::Minus => nsd_solver::hybrid::Side::Minus,
        Branch::Slide => nsd_solver::hybrid::Side::Slide,
        Branch::Plus => nsd_solver::hybrid::Side::Plus,
    };
    solver::Settings {
        order: *order,
        branch: branch.iter().map(side).collect(),
        max_events: max_events.unwrap_or(defaults.max_events),
        ..defaults
    }
}

/// A run that is more accurate, and of another order. Infinitely many events end with the same one.
pub(crate) fn finer(run: &solver::Settings, order: usize, tolerance: f64) -> solver::Settings {
    solver::Settings {
        tolerance: tolerance * REFINEMENT,
        settled: Some(tolerance),
        order: Some(order + MORE_ORDERS),
        ..run.clone()
    }
}
