//! A run from event to event whose last data are decided on its way.
//!
//! What data will be is not known while it runs, so that it is recorded step by step, and told afterwards by a system that
//! has them, as any run is.

use std::sync::Arc;

use nsd_solver::event::{Decide, Observer, Recording, Simulator, run_decided};
use nsd_solver::hybrid as solver;
use nsd_solver::hybrid::{Outcome, Side, Status};

use super::driver::{self, Accuracy, Ended, Problem, Run};
use super::estimate::Estimator;
use super::methods::solver_settings;
use super::record::reported::Reported;
use super::watch::Watched;
use super::{Progress, Request};
use crate::limit::Limit;
use crate::lowering::hybrid;
use crate::report::{Method, Trajectory};
use crate::system::System;
use crate::system::experiment::{MethodKind, Settings};

/// A run that has been recorded.
pub(crate) struct Decided {
    recording: Recording,
    /// Where it was decided to end.
    pub ends: Option<f64>,
    outcome: Outcome,
    order: usize,
}

impl Decided {
    /// Runs a system with the data that it begins with, and asks `decide` wherever these go on.
    pub fn run(
        system: &System<'_>,
        settings: &Settings<'_>,
        limit: &Limit,
        decide: &mut Decide<'_>,
        watch: &mut dyn FnMut(Progress),
    ) -> Self {
        let numerics = &settings.numerics;
        let kicks = settings.kicks.as_ref();
        let chosen = solver::Settings {
            kicks: kicks.map(|kicks| kicks.kicks(system)),
            averages: numerics.averages,
            ..solver_settings(&numerics.method, numerics.tolerance, limit.clone())
        };
        let hybrid = hybrid::lower_open(system, settings.horizon, &[]);
        let mut simulator = Simulator::new(hybrid, chosen);
        let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
        let mut recording = Recording::default();
        let mut watched = Watched::new(&mut recording, settings.horizon, false, watch);
        let ends = [0.0, settings.horizon];
        let mut outcome = run_decided(&mut simulator, ends, &x0, &mut watched, decide);
        // It ends where that was decided on, or where its time is up.
        let ends = outcome.status == Status::Stopped;
        if ends {
            outcome.status = limit.over().map_or(Status::Solved, Status::from);
        }
        let ends = ends && outcome.status == Status::Solved;
        Decided {
            recording,
            ends: ends.then_some(outcome.time),
            outcome,
            order: simulator.order(),
        }
    }

    /// One that does not begin.
    pub fn at_start(system: &System<'_>) -> Self {
        let x0 = system.states.iter().map(|state| state.initial).collect();
        let sides = vec![Side::Plus; system.switches.len()];
        Decided {
            recording: Recording::default(),
            ends: None,
            outcome: Outcome::at(Status::Solved, 0.0, x0, sides),
            order: 0,
        }
    }

    /// The trajectory, by the system with the data that were decided on.
    pub fn told<'e>(
        mut self,
        system: &System<'e>,
        settings: &Settings<'e>,
        request: &Request,
    ) -> Trajectory {
        let reported = Arc::new(Reported::new(system, &[]));
        let of = (system, settings);
        driver::drive(&mut self, of, &reported, (request, None), &mut |_| {})
    }
}

impl<'e> Run<'e> for Decided {
    fn march(&mut self, _: &Problem<'_, 'e>, _: Accuracy, observer: &mut dyn Observer) -> Ended {
        self.recording.replay(observer);
        Ended::by(self.outcome.clone())
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        let tolerance = problem.settings.numerics.tolerance;
        let method = Method::of(MethodKind::Event).count("order", self.order);
        method.number("tolerance", tolerance)
    }

    fn estimator(&self, _: &Settings<'e>) -> Estimator {
        Estimator::Tolerance
    }

    /// Another run would have other plans.
    fn compares(&self, _: &Ended) -> bool {
        false
    }

    fn sees_narrow(&self) -> bool {
        true
    }
}
