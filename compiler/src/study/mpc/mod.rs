//! Closed loops: a plant under a controller that solves an optimal control problem at each sample.
//!
//! u(t) = u_k(t - t_k) for t_k <= t < t_{k+1},   u_k a solution of the task from x(t_k),   t_k = k δ
//!
//! 1. The controller's experiment is compiled once, and its states and controls are those of the plant by their names
//!    (`wires`).
//! 2. The plant runs from event to event; where a sample is due, it waits for a plan (`controller`), of which it gets what
//!    comes before the next sample.
//! 3. What has happened is told as any run is, with what was planned beside it (`told`).

mod controller;
mod told;
mod wires;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use nsd_solver::hybrid::Piecewise;

pub use controller::{Controller, Memory, Step};
use wires::{Fed, Wires};

use crate::Compiled;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::limit::Limit;
use crate::optimize;
use crate::project::clock::Instant;
use crate::project::watch::{Progress, Watch};
use crate::project::{Project, launch};
use crate::report::{Kind, Trajectory};
use crate::simulate::{Decided, Request};
use crate::source::table::{Fit, Table};
use crate::system::System;
use crate::system::experiment::{ClosedLoop, ExperimentError};
use crate::system::task::Shape;

pub(crate) use wires::check;

/// Instants that differ by less than this share of them are one.
const ONE: f64 = 1e-12;

/// A plan whose end is as far behind a sample, as a share of the time between two, is over with it.
const LAST: f64 = 1e-3;

/// Runs a plant that has been compiled; afterwards its system has the controls that were decided on. What the controller's
/// first guess is simulated from may lead through `depth` more experiments.
///
/// # Errors
///
/// Where the controller does not fit to it.
pub(crate) fn run<'e>(
    (project, depth): (&Project, usize),
    compiled: &mut Compiled<'e>,
    closed_loop: &ClosedLoop,
    request: &Request,
    watch: &mut dyn Watch,
) -> Result<Trajectory, Diagnostics> {
    let started = Instant::now();
    let exprs = Exprs::new();
    let (of_controller, wires) = wires::connect(&exprs, &project.file, compiled, closed_loop)?;
    let task = of_controller.settings.optimize.as_ref();
    let task = task.expect("what decides is an optimization");
    let sampled = launch::sampled_within(project, task, request, depth)?;
    let sources = project.sources.clone();
    let prepared = optimize::Prepared::new(&of_controller, sampled, Diagnostics::new(), sources);
    let deadline = closed_loop.deadline.map(Duration::from_secs_f64);
    let made = prepared
        .and_then(|prepared| Controller::new(prepared, deadline, closed_loop.controller.clone()));
    let controller = made.map_err(|error| {
        let mut diags = Diagnostics::new();
        diags.push(ExperimentError::BadController {
            name: closed_loop.controller.name.clone(),
            why: error.to_string(),
            help: "name another `optimize` experiment, or leave that out of it",
            span: closed_loop.controller.span,
        });
        diags
    })?;
    let horizon = compiled.settings.horizon;
    let mut samples = Samples {
        fit: match controller.shape() {
            Shape::Constant => Fit::Hold,
            Shape::Linear => Fit::Linear,
        },
        controller,
        applied: vec![(Vec::new(), Vec::new()); wires.driven.len()],
        wires,
        sample: closed_loop.sample,
        horizon,
        limit: request.limit.clone(),
        steps: Vec::new(),
        end: None,
    };
    let mut system = compiled.system.clone();
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let mut trajectory = match samples.planned(&x0) {
        None => Decided::at_start(&system).told(&system, &compiled.settings, request),
        Some(pieces) => {
            samples.give(&mut system, pieces);
            let mut told = |progress| watch.progress(&Progress::Simulation(progress));
            let decide = &mut |t: f64, x: &[f64]| samples.decide(t, x);
            let settings = &mut compiled.settings;
            let run = Decided::run(&system, settings, &request.limit, decide, &mut told);
            settings.horizon = run.ends.unwrap_or(settings.horizon);
            let applied = samples.applied.iter().cloned();
            let applied = applied.map(|(starts, rows)| Arc::new(Piecewise::new(starts, rows)));
            samples.give(&mut system, applied.collect());
            run.told(&system, settings, request)
        }
    };
    compiled.system = system;
    trajectory.setup.kind = Kind::Mpc;
    told::tell(
        &samples.controller,
        samples.steps,
        closed_loop,
        &mut trajectory,
    );
    trajectory.quality.stats.solve_s = started.elapsed().as_secs_f64();
    Ok(trajectory)
}

/// The samples of a run.
struct Samples<'e> {
    controller: Controller<'e>,
    wires: Wires,
    sample: f64,
    horizon: f64,
    limit: Limit,
    /// What controls are between two instants of them.
    fit: Fit,
    /// The pieces of each control so far: when they begin, and their coefficients.
    applied: Vec<(Vec<f64>, Vec<f64>)>,
    steps: Vec<Step>,
    /// When the plan ends, where that is before the next sample.
    end: Option<f64>,
}

impl Samples<'_> {
    /// Number k of the samples.
    fn instant(&self, k: usize) -> f64 {
        k as f64 * self.sample
    }

    /// What is decided on at an instant at which controls change.
    fn decide(&mut self, t: f64, x: &[f64]) -> ControlFlow<(), Option<Vec<Arc<Piecewise>>>> {
        let is_at = |instant: f64| t >= instant * (1.0 - ONE);
        if self.end.is_some_and(is_at) {
            return ControlFlow::Break(());
        }
        if !is_at(self.instant(self.steps.len())) || is_at(self.horizon) {
            return ControlFlow::Continue(None);
        }
        if self.limit.is_over() {
            return ControlFlow::Break(());
        }
        let pieces = self.planned(x);
        // A sample that was cut off is none.
        let last = self
            .steps
            .pop_if(|step| step.why.is_some() && self.limit.is_over());
        match pieces.filter(|_| last.is_none()) {
            Some(pieces) => ControlFlow::Continue(Some(pieces)),
            None => ControlFlow::Break(()),
        }
    }

    /// Controls from the next sample on to the one behind it, from a state there; none where there has never been a plan.
    fn planned(&mut self, x: &[f64]) -> Option<Vec<Arc<Piecewise>>> {
        let k = self.steps.len();
        let (t, next) = (self.instant(k), self.instant(k + 1));
        let fed = self.wires.fed.iter().map(|fed| match *fed {
            Fed::State(place) => x[place],
            Fed::Own(value) => value,
        });
        let x0: Vec<f64> = fed.collect();
        let step = self.controller.step(t, &x0, &[], &self.limit);
        self.steps.push(step);
        let (plan, passed) = self.controller.followed(t)?;
        let left = (plan.horizon() - passed).max(0.0);
        let is_last = left <= (next - t) * (1.0 + LAST);
        // A plan of another sample does not lead to the end from here.
        let ends = self.controller.has_free_horizon() && is_last && passed == 0.0;
        self.end = ends.then_some(t + left);
        let until = self.end.unwrap_or(next);
        let shape = self.controller.shape();
        let mut all = Vec::new();
        for (wire, applied) in self.wires.driven.iter().zip(&mut self.applied) {
            let (mut starts, mut coefficients) = (Vec::new(), Vec::new());
            for (start, [value, slope]) in plan.pieces(*wire, shape, (passed, until - t)) {
                let begins = t + start;
                if begins < self.horizon {
                    starts.push(begins);
                    coefficients.push(value);
                    coefficients.extend((shape == Shape::Linear).then_some(slope));
                }
            }
            applied.0.extend_from_slice(&starts);
            applied.1.extend_from_slice(&coefficients);
            // The next decision is asked for where another piece begins.
            let n = 1 + usize::from(shape == Shape::Linear);
            let last = coefficients[coefficients.len() - n..].to_vec();
            starts.push(until);
            coefficients.extend(last);
            all.push(Arc::new(Piecewise::new(starts, coefficients)));
        }
        Some(all)
    }

    /// Gives a plant these controls, which are the last data of it.
    fn give(&self, plant: &mut System<'_>, controls: Vec<Arc<Piecewise>>) {
        let data = &mut plant.exogenous.data;
        let first = data.len() - controls.len();
        for (data, pieces) in data[first..].iter_mut().zip(controls) {
            data.table = Arc::new(Table {
                fit: self.fit,
                n_rows: 2,
                range: (0.0, self.horizon),
                pieces,
            });
        }
    }
}
