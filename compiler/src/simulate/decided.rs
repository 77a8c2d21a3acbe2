//! A run from event to event whose last data are decided on its way.
//!
//! What data will be is not known while it runs, so that it is recorded step by step, and told afterwards by a system that
//! has them, as any run is.

use std::ops::ControlFlow;
use std::sync::Arc;

use nsd_solver::event::{Cause, Decide, Event, Observer, Segment, Simulator, run_decided};
use nsd_solver::expansion::Polynomials;
use nsd_solver::hybrid as solver;
use nsd_solver::hybrid::{Outcome, Side, Status};
use nsd_solver::selector::Decision;

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
    parts: Vec<Part>,
    /// Where it was decided to end.
    pub ends: Option<f64>,
    outcome: Outcome,
    order: usize,
}

/// A step or an event.
enum Part {
    Step(Step),
    Event(Happened),
}

/// A step with its series.
struct Step {
    start: f64,
    length: f64,
    until: f64,
    sides: Box<[Side]>,
    end: Vec<f64>,
    n_coefficients: usize,
    /// Those of states and of all α, one after another.
    coefficients: Vec<f64>,
    unobserved: Vec<usize>,
}

/// An event that owns what it tells.
struct Happened {
    time: f64,
    x: Vec<f64>,
    before: Vec<f64>,
    jumps: Vec<usize>,
    decisions: Vec<Decision>,
    from: Box<[Side]>,
    to: Box<[Side]>,
    accumulates: bool,
    met: Vec<usize>,
    on: Vec<(usize, usize)>,
    is_scheduled: bool,
    is_in_limit: bool,
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
        let mut parts = Parts(Vec::new());
        let mut watched = Watched::new(&mut parts, settings.horizon, false, watch);
        let ends = [0.0, settings.horizon];
        let mut outcome = run_decided(&mut simulator, ends, &x0, &mut watched, decide);
        // It ends where that was decided on, or where its time is up.
        let ends = outcome.status == Status::Stopped;
        if ends {
            outcome.status = limit.over().map_or(Status::Solved, Status::from);
        }
        let ends = ends && outcome.status == Status::Solved;
        Decided {
            parts: parts.0,
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
            parts: Vec::new(),
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
        for part in &self.parts {
            let told = match part {
                Part::Step(step) => observer.segment(&step.segment()),
                Part::Event(event) => {
                    observer.event(&event.event());
                    ControlFlow::Continue(())
                }
            };
            if told.is_break() {
                break;
            }
        }
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

/// Takes a run down.
struct Parts(Vec<Part>);

impl Observer for Parts {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let mut coefficients = Vec::new();
        segment.write(&mut coefficients);
        self.0.push(Part::Step(Step {
            start: segment.start,
            length: segment.length,
            until: segment.until,
            sides: segment.sides.into(),
            end: segment.end.to_vec(),
            n_coefficients: segment.order() + 1,
            coefficients,
            unobserved: segment.unobserved().to_vec(),
        }));
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.0.push(Part::Event(Happened {
            time: event.time,
            x: event.x.to_vec(),
            before: event.before.to_vec(),
            jumps: event.jumps.to_vec(),
            decisions: event.decisions.to_vec(),
            from: event.from.into(),
            to: event.to.into(),
            accumulates: event.accumulates,
            met: event.cause.met.to_vec(),
            on: event.cause.on.to_vec(),
            is_scheduled: event.cause.is_scheduled,
            is_in_limit: event.cause.is_in_limit,
        }));
    }
}

impl Step {
    fn segment(&self) -> Segment<'_> {
        let ends = (self.start, self.length, self.until);
        Segment::new(ends.0, ends.1, ends.2, &self.sides, &self.end, self)
    }

    fn row(&self, row: usize) -> &[f64] {
        &self.coefficients[row * self.n_coefficients..][..self.n_coefficients]
    }
}

impl Polynomials for Step {
    fn degree(&self) -> usize {
        self.n_coefficients - 1
    }

    fn x(&self, i: usize) -> &[f64] {
        self.row(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        self.row(self.end.len() + switch)
    }

    fn unobserved(&self) -> &[usize] {
        &self.unobserved
    }
}

impl Happened {
    fn event(&self) -> Event<'_> {
        Event {
            time: self.time,
            x: &self.x,
            before: &self.before,
            jumps: &self.jumps,
            decisions: &self.decisions,
            from: &self.from,
            to: &self.to,
            accumulates: self.accumulates,
            cause: Cause {
                met: &self.met,
                on: &self.on,
                is_scheduled: self.is_scheduled,
                is_in_limit: self.is_in_limit,
            },
        }
    }
}
