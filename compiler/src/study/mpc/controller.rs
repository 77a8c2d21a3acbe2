//! A controller: a state in, a plan out, one after another.

use std::time::Duration;

use crate::limit::Limit;
use crate::optimize::Prepared;
use crate::optimize::receding::{Last, Plan};
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
    /// For how many samples plans that cost more are not compared with others, and how many that is next.
    waits: u32,
    vain: u32,
    /// Where it is asked for.
    span: Span,
}

/// What plans that cost more are taken for at most, once comparisons are in vain again and again.
const LONGEST_WAIT: u32 = 32;

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
            waits: 0,
            vain: 1,
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
        let last = self.last.as_ref().map(|(plan, since)| Last {
            plan,
            passed: t - since,
            compares: self.waits == 0,
        });
        let last = last.filter(|last| (0.0..last.plan.horizon()).contains(&last.passed));
        let cost = last.as_ref().map(|last| last.plan.objective);
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
        self.wait(&step, cost);
        if let Some(plan) = &step.plan {
            self.last = Some((plan.clone(), t));
        }
        step.seconds = started.elapsed().as_secs_f64();
        step
    }

    /// Takes note of whether a comparison was worth it.
    fn wait(&mut self, step: &Step, last: Option<f64>) {
        let plan = step.plan.as_ref();
        let rises = |(plan, last): (&Plan, f64)| plan.objective > last;
        match step.decision {
            Decision::Cold => (self.waits, self.vain) = (0, 1),
            _ if self.waits > 0 => self.waits -= 1,
            _ if plan.zip(last).is_some_and(rises) => {
                self.waits = self.vain;
                self.vain = (2 * self.vain).min(LONGEST_WAIT);
            }
            _ => {}
        }
    }
}
