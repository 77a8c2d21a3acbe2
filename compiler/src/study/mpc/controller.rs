//! A controller: a state in, a plan out, one after another.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::expr::Exprs;
use crate::limit::Limit;
use crate::optimize::receding::{Compares, Followed, Last, Planned};
use crate::optimize::{Plan, PrepareError, Prepared};
use crate::project::Project;
use crate::project::clock::Instant;
use crate::project::prepared::Parameter;
use crate::report::{Decision, Failure};
use crate::source::Span;
use crate::syntax::Ident;
use crate::system::System;
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
    /// The experiment, where it is asked for.
    name: Ident,
}

/// What a controller remembers from one sample to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// Whose it is: the experiment, its states and controls.
    of: (String, Vec<String>, Vec<String>),
    /// The plan that is followed, and since when.
    last: Option<(Followed, f64)>,
    /// What is ready for the next sample.
    ahead: Option<Ahead>,
    /// Samples until a plan is compared with what is found without the last one, whatever it costs.
    waits: u32,
    /// How many these are from one comparison to the next one.
    gap: u32,
}

/// A sample that is prepared: when it is, and the plan from the state that the last one leads to there, if there is one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Ahead {
    time: f64,
    plan: Option<Followed>,
}

/// Samples from one comparison to the next one at most, where they are in vain again and again.
const LONGEST_GAP: u32 = 32;

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
    /// Those of [`Project::prepare_optimal`], and where the experiment changes with time.
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
        let name = experiment.to_owned();
        Controller::new(prepared, deadline, Ident { name, span })
    }
}

/// Finds out whether plans of a system are the same whenever they begin.
///
/// Time may only move the cost: ∂φ/∂t is a number.
pub(super) fn recedes(system: &System<'_>) -> Result<(), PrepareError> {
    let Some(time) = system.time.as_variable() else {
        return Ok(());
    };
    let rates = system.states.iter().map(|state| state.rate);
    let surfaces = system.switches.iter().map(|switch| switch.psi);
    let rows = system.task.iter().flat_map(|task| task.in_rows());
    let contacts = system.jumps.contacts.iter();
    let contacts = contacts.flat_map(|contact| contact.exprs());
    let costs = system.task.iter().map(|task| task.cost.value.diff(time));
    let moves_cost = costs.clone().all(|change| change.as_constant().is_some());
    let mut all = rates.chain(surfaces).chain(rows).chain(contacts);
    match system.exogenous.data.is_empty() && moves_cost && !all.any(|e| e.depends_on(time)) {
        true => Ok(()),
        false => Err(PrepareError::ChangesWithTime),
    }
}

impl Memory {
    /// The plan that is followed at an instant, as long as it is not over.
    fn last(&self, t: f64, compares: Compares) -> Option<Last<'_>> {
        let (followed, since) = self.last.as_ref()?;
        let passed = t - since;
        let is_going_on = (0.0..followed.plan.horizon()).contains(&passed);
        is_going_on.then_some(Last {
            followed,
            passed,
            compares,
        })
    }
}

impl<'e> Controller<'e> {
    /// One that has no plan yet.
    ///
    /// # Errors
    ///
    /// Where the experiment changes with time.
    pub(crate) fn new(
        prepared: Prepared<'e>,
        deadline: Option<Duration>,
        name: Ident,
    ) -> Result<Self, PrepareError> {
        recedes(prepared.system())?;
        let states = prepared.planned_states();
        let memory = Memory {
            of: (name.name.clone(), states, prepared.controls()),
            ..Memory::default()
        };
        Ok(Controller {
            prepared,
            deadline,
            memory,
            name,
        })
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
        let (followed, since) = self.memory.last.as_ref()?;
        Some((&followed.plan, t - since))
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
        let last = memory.last.iter().map(|(followed, _)| followed);
        let ahead = memory.ahead.iter().filter_map(|ahead| ahead.plan.as_ref());
        let is_known = memory.of == self.memory.of
            && last
                .chain(ahead)
                .all(|followed| self.prepared.takes(followed));
        if is_known {
            self.memory = memory;
        }
        is_known
    }

    /// Decides at an instant, from a state there and with values of the open parameters.
    ///
    /// The first plan takes the time it needs: without one there is nothing to follow.
    pub fn step(&mut self, t: f64, x0: &[f64], parameters: &[f64], limit: &Limit) -> Step {
        self.memory.ahead = None;
        let compares = self.compares();
        let (step, found) = self.decide((t, x0), parameters, compares, limit);
        found.iter().for_each(|found| self.wait(found));
        step
    }

    /// Solves from the state that the plan leads to at the next sample, before that is measured: [`Controller::feedback`] then
    /// has the difference between the two to solve for (Zavala & Biegler 2009, advanced-step control). What is followed until
    /// then stays as it is, and no deadline ends it.
    ///
    /// Without a plan that leads there, nothing is known of the state, and all is left to the feedback.
    pub fn prepare(&mut self, t: f64, parameters: &[f64], limit: &Limit) {
        self.memory.ahead = None;
        let compares = self.compares();
        let found = self.memory.last(t, compares).and_then(|last| {
            let x0 = self.prepared.predicted(&last);
            let found = self
                .prepared
                .plan(parameters, &x0, Some(last), limit, &mut ());
            // What is wrong with the numbers, the feedback says.
            found.ok()
        });
        // Canceled work is no plan.
        if limit.is_over() {
            return;
        }
        found.iter().for_each(|found| self.wait(found));
        self.memory.ahead = Some(Ahead {
            time: t,
            plan: found.and_then(|found| found.followed),
        });
    }

    /// Decides at the instant that was prepared, from the state that is there; none where nothing is prepared.
    ///
    /// The plan that was prepared is followed where no better one is found before the deadline. It is compared with others
    /// when the next one is prepared, where what is found costs more, or does not follow from it.
    pub fn feedback(&mut self, x0: &[f64], parameters: &[f64], limit: &Limit) -> Option<Step> {
        let Ahead { time, plan } = self.memory.ahead.take()?;
        if let Some(plan) = plan {
            self.memory.last = Some((plan, time));
        }
        let (step, found) = self.decide((time, x0), parameters, Compares::Never, limit);
        let is_near = |found: Planned| found.is_warm && !found.is_dearer && found.failure.is_none();
        if !found.is_some_and(is_near) {
            (self.memory.waits, self.memory.gap) = (0, 1);
        }
        Some(step)
    }

    /// Whether the next plan is compared with others whatever it costs.
    fn compares(&self) -> Compares {
        match self.memory.waits {
            0 => Compares::Always,
            _ => Compares::Dearer,
        }
    }

    /// What is followed from a state at an instant on, and what was found there.
    fn decide(
        &mut self,
        (t, x0): (f64, &[f64]),
        parameters: &[f64],
        compares: Compares,
        limit: &Limit,
    ) -> (Step, Option<Planned>) {
        let started = Instant::now();
        let limit = match (&self.memory.last, self.deadline) {
            (Some(_), Some(deadline)) => limit.sooner(deadline),
            _ => limit.clone(),
        };
        let mut step = Step {
            time: t,
            decision: Decision::Kept,
            why: None,
            plan: None,
            iterations: 0,
            seconds: 0.0,
        };
        let last = self.memory.last(t, compares);
        let found = self.prepared.plan(parameters, x0, last, &limit, &mut ());
        let found = match found {
            Ok(found) => Some(found),
            Err(error) => {
                step.why = Some(Failure::NoPlan {
                    time: t,
                    why: error.to_string(),
                    span: self.name.span,
                });
                None
            }
        };
        if let Some(found) = &found {
            step.iterations = found.iterations;
            step.decision = match (&found.followed, &found.failure) {
                (None, _) => Decision::Kept,
                (_, Some(_)) => Decision::Feasible,
                _ if found.is_warm => Decision::Warm,
                _ => Decision::Cold,
            };
            step.why = found.failure.clone();
            step.plan = found.followed.as_ref().map(|new| new.plan.clone());
            if let Some(new) = &found.followed {
                self.memory.last = Some((new.clone(), t));
            }
        }
        step.seconds = started.elapsed().as_secs_f64();
        (step, found)
    }

    /// Puts the next comparison off, the longer the more of them were in vain.
    fn wait(&mut self, found: &Planned) {
        let Memory { waits, gap, .. } = &mut self.memory;
        if !found.is_warm {
            *gap = 1;
        } else if found.is_compared {
            *gap = gap.saturating_mul(2).clamp(1, LONGEST_GAP);
        } else {
            *waits = waits.saturating_sub(1);
            return;
        }
        *waits = *gap;
    }
}
