//! Runs from event to event of a system that is compiled once.

use std::sync::Arc;

use nsd_solver::simulate::{self as solver, HybridSystem, Outcome, Piecewise, Simulator};

use super::reported::Reported;
use super::watch::{Progress, Watched};
use super::{
    Estimate, Recorder, Request, assemble, finer, judge, smoothed, solver_settings, tightened,
};
use crate::clock::Instant;
use crate::hybrid;
use crate::report::{Method, MethodOption, Trajectory};
use crate::system::System;
use crate::system::experiment::{self, Settings};

/// A system as data, and what runs keep of its functions.
pub struct Events {
    hybrid: Arc<HybridSystem>,
    reported: Arc<Reported>,
    /// The last runs with the tolerance of an experiment, and with a smaller one.
    coarse: Option<Simulator>,
    fine: Option<Simulator>,
}

impl Events {
    /// Compiles a system, with some parameters open, by their numbers.
    pub(crate) fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        Events {
            hybrid: hybrid::lower_open(system, settings.horizon, open),
            reported: Arc::new(Reported::new(system, open)),
            coarse: None,
            fine: None,
        }
    }

    /// Integrates the system, which may have other initial states, data and values of the open parameters than the one that
    /// was compiled, over the horizon of the experiment.
    pub(crate) fn run(
        &mut self,
        system: &System,
        settings: &Settings,
        request: &Request,
        watch: &mut dyn FnMut(Progress),
    ) -> Trajectory {
        let started = Instant::now();
        let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
        let parameters: Vec<f64> = self.reported.parameters(system).collect();
        let numbers = (&parameters[..], &hybrid::data_of(system)[..]);
        let mut tolerance: f64 = settings.tolerance;
        let mut attempt = 1;
        let (outcome, recorder, estimate) = loop {
            let solver_settings = solver::Settings {
                kicks: settings.kicks.as_ref().map(|kicks| kicks.kicks(system)),
                averages: settings.averages,
                ..solver_settings(&settings.method, tolerance, request.limit.clone())
            };
            let simulator = ready(&mut self.coarse, &self.hybrid, numbers, solver_settings);
            let reported = self.reported.clone();
            let mut recorder = Recorder::of(system, settings, tolerance, request.dense, reported);
            let mut watched = Watched::new(&mut recorder, settings.horizon, false, watch);
            let outcome = simulator.run(0.0, settings.horizon, &x0, &mut watched);
            let wanted = request.estimate && !matches!(outcome.status, solver::Status::Over(_));
            let estimate = wanted.then(|| {
                let finer = finer(simulator.settings(), simulator.order(), tolerance);
                if self.fine.is_none() {
                    // What has been compiled for one serves the other.
                    self.fine = Some(simulator.with(finer.clone()));
                }
                let fine = ready(&mut self.fine, &self.hybrid, numbers, finer);
                Estimate::of(fine, settings.horizon, &x0, &recorder, &outcome, watch)
            });
            let estimate = estimate.flatten();
            match tightened(estimate.as_ref(), settings, tolerance, attempt) {
                Some(next) => (tolerance, attempt) = (next, attempt + 1),
                None => break (outcome, recorder, estimate),
            }
        };
        let mut trajectory = assemble(system, settings, &outcome, recorder);
        trajectory.method = self.method(settings, &outcome);
        if let experiment::Method::Smoothing(options) = &settings.method {
            let warning = smoothed::warning(system, options, settings.span);
            trajectory.warnings.extend(warning);
        }
        if let Some(estimate) = estimate {
            judge(&mut trajectory, &estimate, settings);
            let touches = &estimate.touches;
            let warning = touches.warning(system, settings.tolerance);
            trajectory
                .warnings
                .extend(warning.filter(|_| estimate.same_modes));
        }
        trajectory.stats.solve_s = started.elapsed().as_secs_f64();
        trajectory
    }

    /// What the last run was made by.
    fn method(&self, settings: &Settings, outcome: &Outcome) -> Method {
        let mut method = match &settings.method {
            experiment::Method::Smoothing(options) => smoothed::method(options),
            _ => Method {
                name: "event".into(),
                options: Vec::new(),
            },
        };
        let orders = self.coarse.iter();
        let orders =
            orders.map(|run| [run.order(), run.implicit_order()].map(|order| order as f64));
        for [order, implicit_order] in orders {
            let mut add = |name: &str, value| {
                let option = (name.to_owned(), MethodOption::Number(value));
                method.options.push(option);
            };
            add("order", order);
            add("tolerance", settings.tolerance);
            if outcome.stats.implicit_steps > 0 {
                add("implicit_order", implicit_order);
            }
        }
        method
    }
}

/// A simulator with these values of parameters, data and settings: the last one, if it had the same settings but for its time.
fn ready<'s>(
    last: &'s mut Option<Simulator>,
    hybrid: &Arc<HybridSystem>,
    (parameters, data): (&[f64], &[Arc<Piecewise>]),
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
    let simulator = last.insert(simulator);
    simulator.set_parameters(parameters);
    simulator.set_data(0, data);
    simulator
}
