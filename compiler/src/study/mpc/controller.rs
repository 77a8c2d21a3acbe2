//! A controller: a state in, a plan out, one after another.

use std::time::Duration;

use crate::limit::Limit;
use crate::optimize::Prepared;
use crate::optimize::receding::Plan;
use crate::project::clock::Instant;
use crate::report::{Decision, Failure};
use crate::source::Span;
use crate::system::task::Shape;

/// An optimal control problem that is solved from one state after another.
pub(crate) struct Controller<'e> {
    prepared: Prepared<'e>,
    /// How long a solve may take, but for the first one.
    deadline: Option<Duration>,
    /// The plan that is followed, and since when.
    last: Option<(Plan, f64)>,
    /// Where it is asked for.
    span: Span,
}

/// What was decided on at a sample.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub time: f64,
    pub decision: Decision,
    /// Why it is no solution.
    pub why: Option<Failure>,
    /// The new plan; none where the last one goes on.
    pub plan: Option<Plan>,
    pub iterations: usize,
    pub seconds: f64,
}

impl<'e> Controller<'e> {
    /// One that has no plan yet.
    pub fn new(prepared: Prepared<'e>, deadline: Option<Duration>, span: Span) -> Self {
        Controller {
            prepared,
            deadline,
            last: None,
            span,
        }
    }

    pub fn prepared(&self) -> &Prepared<'e> {
        &self.prepared
    }

    pub fn shape(&self) -> Shape {
        self.prepared.shape()
    }

    pub fn has_free_horizon(&self) -> bool {
        self.prepared.has_free_horizon()
    }

    /// The plan that is followed at an instant, and for how long that has been so.
    pub fn followed(&self, t: f64) -> Option<(&Plan, f64)> {
        let (plan, since) = self.last.as_ref()?;
        Some((plan, t - since))
    }

    /// Decides at an instant, from a state there and with values of the open parameters.
    ///
    /// The first plan takes the time it needs: without one there is nothing to follow.
    pub fn step(&mut self, t: f64, x0: &[f64], parameters: &[f64], limit: &Limit) -> Step {
        let started = Instant::now();
        let limit = match (&self.last, self.deadline) {
            (Some(_), Some(deadline)) => limit.sooner(deadline),
            _ => limit.clone(),
        };
        let last = self.last.as_ref().map(|(plan, since)| (plan, t - since));
        let last = last.filter(|(plan, passed)| (0.0..plan.horizon()).contains(passed));
        let found = self.prepared.plan(parameters, x0, last, &limit, &mut ());
        let mut step = Step {
            time: t,
            decision: Decision::Kept,
            why: None,
            plan: None,
            iterations: 0,
            seconds: 0.0,
        };
        match found {
            Ok(found) => {
                step.iterations = found.iterations;
                step.decision = match (&found.plan, &found.failure) {
                    (None, _) => Decision::Kept,
                    (_, Some(_)) => Decision::Feasible,
                    _ if found.is_warm => Decision::Warm,
                    _ => Decision::Cold,
                };
                step.why = found.failure;
                step.plan = found.plan;
            }
            Err(error) => {
                step.why = Some(Failure::NoPlan {
                    time: t,
                    why: error.to_string(),
                    span: self.span,
                });
            }
        }
        if let Some(plan) = &step.plan {
            self.last = Some((plan.clone(), t));
        }
        step.seconds = started.elapsed().as_secs_f64();
        step
    }
}
