//! A controller: a state in, a plan out, one after another.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::expr::Exprs;
use crate::limit::Limit;
use crate::optimize::receding::Last;
use crate::optimize::{Plan, PrepareError, Prepared};
use crate::project::Project;
use crate::project::clock::Instant;
use crate::project::prepared::Parameter;
use crate::report::{Decision, Failure};
use crate::source::Span;
use crate::system::task::Shape;

/// An optimal control problem that is solved from one state after another.
///
/// ```
/// use nsdc::Project;
/// use nsdc::expr::Exprs;
/// use nsdc::limit::Limit;
/// use nsdc::report::Decision;
///
/// let project = Project::from_text("brake.nsd", "
///     model brake { state x = 1; control u in [-9, 9]; x' = u; }
///     optimize o of brake { horizon 1; intervals 4; minimize integral(u^2); final { x = 0; } }");
/// let exprs = Exprs::new();
/// let mut controller = project.controller(&exprs, "o", &[], &[], None).expect("it is a program");
/// // From x to 0 within a second, again and again: u = -x.
/// let mut x = 1.0;
/// for k in 0..4 {
///     let t = 0.25 * f64::from(k);
///     let step = controller.step(t, &[x], &[], &Limit::default());
///     assert_eq!(step.decision, if k == 0 { Decision::Cold } else { Decision::Warm });
///     let u = controller.control(t).expect("there is a plan")[0];
///     assert!((u + x).abs() < 1e-9);
///     x += 0.25 * u;
/// }
/// ```
pub struct Controller<'e> {
    prepared: Prepared<'e>,
    /// How long a solve may take, but for the first one.
    deadline: Option<Duration>,
    memory: Memory,
    /// Where it is asked for.
    span: Span,
}

/// What a controller remembers from one sample to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// The plan that is followed, and since when.
    last: Option<(Plan, f64)>,
    /// For how many samples plans that cost more are not compared with others.
    waits: u32,
    /// How many these are after the next comparison in vain.
    vain: u32,
}

/// What plans that cost more are taken for at most, once comparisons are in vain again and again.
const LONGEST_WAIT: u32 = 32;

/// What was decided on at a sample.
#[derive(Clone, Debug)]
pub struct Step {
    /// When.
    pub time: f64,
    /// What is followed from there on.
    pub decision: Decision,
    /// Why it is no solution.
    pub why: Option<Failure>,
    /// The new plan; none where the last one goes on.
    pub plan: Option<Plan>,
    /// Iterations of all programs.
    pub iterations: usize,
    /// How long it took.
    pub seconds: f64,
}

impl Project {
    /// Compiles an `optimize` experiment once as a controller, with values in place of its own, and with parameters that stay
    /// open at each step.
    ///
    /// # Errors
    ///
    /// Those of [`Project::prepare_optimal`].
    pub fn controller<'e>(
        &self,
        exprs: &'e Exprs,
        experiment: &str,
        open: &[&str],
        values: &[(String, f64)],
        deadline: Option<Duration>,
    ) -> Result<Controller<'e>, PrepareError> {
        let prepared = self.prepare_optimal(exprs, experiment, open, values)?;
        let span = self.named(experiment).map_or(Span::default(), |e| e.span);
        Ok(Controller::new(prepared, deadline, span))
    }
}

impl<'e> Controller<'e> {
    /// One that has no plan yet.
    pub(crate) fn new(prepared: Prepared<'e>, deadline: Option<Duration>, span: Span) -> Self {
        Controller {
            prepared,
            deadline,
            memory: Memory::default(),
            span,
        }
    }

    /// The parameters that stay open, in the order in which steps take their values.
    pub fn parameters(&self) -> &[Parameter] {
        self.prepared.parameters()
    }

    /// The states that steps take, entry by entry.
    pub fn states(&self) -> &[String] {
        self.prepared.states()
    }

    /// The states of plans, entry by entry.
    pub fn planned_states(&self) -> Vec<String> {
        self.prepared.planned_states()
    }

    /// The controls that it decides on, entry by entry.
    pub fn controls(&self) -> Vec<String> {
        self.prepared.controls()
    }

    /// What controls are within an interval of a plan.
    pub fn shape(&self) -> Shape {
        self.prepared.shape()
    }

    /// Whether plans are as long as it takes.
    pub fn has_free_horizon(&self) -> bool {
        self.prepared.has_free_horizon()
    }

    /// The plan that is followed at an instant, and for how long that has been so.
    pub fn followed(&self, t: f64) -> Option<(&Plan, f64)> {
        let (plan, since) = self.memory.last.as_ref()?;
        Some((plan, t - since))
    }

    /// The controls of the plan that is followed at an instant.
    pub fn control(&self, t: f64) -> Option<Vec<f64>> {
        let (plan, passed) = self.followed(t)?;
        let value = |i: usize| {
            let pieces = plan.pieces(i, self.shape(), (passed, f64::INFINITY));
            pieces.first().map_or(f64::NAN, |(_, [value, _])| *value)
        };
        Some((0..self.controls().len()).map(value).collect())
    }

    /// What it remembers.
    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// Goes on from what another one of this problem has remembered; whether it is one.
    pub fn remember(&mut self, memory: Memory) -> bool {
        let plan = memory.last.as_ref();
        let is_known = plan.is_none_or(|(plan, _)| self.prepared.takes(&plan.point));
        if is_known {
            self.memory = memory;
        }
        is_known
    }

    /// Decides at an instant, from a state there and with values of the open parameters.
    ///
    /// The first plan takes the time it needs: without one there is nothing to follow.
    pub fn step(&mut self, t: f64, x0: &[f64], parameters: &[f64], limit: &Limit) -> Step {
        let started = Instant::now();
        let limit = match (&self.memory.last, self.deadline) {
            (Some(_), Some(deadline)) => limit.sooner(deadline),
            _ => limit.clone(),
        };
        let last = self.memory.last.as_ref().map(|(plan, since)| Last {
            plan,
            passed: t - since,
            compares: self.memory.waits == 0,
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
            self.memory.last = Some((plan.clone(), t));
        }
        step.seconds = started.elapsed().as_secs_f64();
        step
    }

    /// Takes note of whether a comparison was worth it.
    fn wait(&mut self, step: &Step, last: Option<f64>) {
        let plan = step.plan.as_ref();
        let rises = |(plan, last): (&Plan, f64)| plan.objective > last;
        let Memory { waits, vain, .. } = &mut self.memory;
        match step.decision {
            Decision::Cold => (*waits, *vain) = (0, 1),
            _ if *waits > 0 => *waits -= 1,
            _ if plan.zip(last).is_some_and(rises) => {
                *waits = (*vain).max(1);
                *vain = (2 * *waits).min(LONGEST_WAIT);
            }
            _ => {}
        }
    }
}
