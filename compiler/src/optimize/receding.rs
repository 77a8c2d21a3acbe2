//! A task that is solved from one state after another: each plan is looked for where the last one leaves off.
//!
//! 1. The last plan, shifted by the time that has passed (`start/shift.rs`), is solved on its branch.
//! 2. Where that is no solution, so is the branch of a run with its controls from the state that there is.
//! 3. Where that is no solution, the task is solved as its experiment does it. So it is where a plan costs more than the last
//!    one, and from time to time whatever it costs: what rests on a surface, as a body that sticks, costs the same again and
//!    again, and may be a minimum beside better ones.
//!
//! What is feasible is a plan; simulations do not confirm it, as the next one is made of what will have happened.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use nsd_solver::optimization::mpcc::{Solution, Status, Trust};

use super::checks::reduced::Reduced;
use super::start::{self, Begin, Start, reference, shift, transfer};
use super::{Point, Prepared, Problem, SolveError, branches, failure};
use crate::limit::Limit;
use crate::lowering::discretize::Layout;
use crate::project::watch::Watch;
use crate::report::Failure;
use crate::system::System;
use crate::system::task::Shape;

/// Iterations of one program near the last plan.
const NEAR: usize = 300;
/// What is shorter than this share of an interval is rounding.
const SHORTEST: f64 = 1e-9;
/// Other ways that are tried behind the first plan, where one ends without a feasible point.
const RESTARTS: usize = 2;
/// Objectives that differ by a smaller share are one.
const SAME: f64 = 1e-6;
/// A plan is dearer than the last one where it costs more by this share.
const DEARER: f64 = 1e-2;
/// Constraints of a run with the controls of the last plan that are violated by less are kept.
const KEPT: f64 = 1e-3;

/// A plan to go on from.
pub(crate) struct Last<'p> {
    pub followed: &'p Followed,
    /// How long ago it was made.
    pub passed: f64,
    pub compares: Compares,
}

/// When what is found from the last plan is compared with what is found without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compares {
    /// Whatever it costs.
    Always,
    /// Where it costs more than the last plan.
    Dearer,
    /// Only where it is no solution.
    Never,
}

/// A plan with the solution that it is, to go on from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Followed {
    pub plan: Plan,
    point: Point,
}

/// Controls from now on, and what they are to lead to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// When control intervals begin, from 0 on, and the last one ends.
    pub ends: Vec<f64>,
    /// Controls: of intervals, or at their ends where they are straight lines.
    pub controls: Vec<Vec<f64>>,
    /// The states of the model at these ends.
    pub states: Vec<Vec<f64>>,
    /// What it is to cost.
    pub objective: f64,
}

/// What came of a solve.
pub(crate) struct Planned {
    /// None where nothing feasible was found.
    pub followed: Option<Followed>,
    /// Why it is not known to be a minimum, or why there is none.
    pub failure: Option<Failure>,
    /// Whether it is on the branch of the last plan, or where that has led.
    pub is_warm: bool,
    /// Whether it was compared with what is found without the last plan.
    pub is_compared: bool,
    /// Whether it costs more than the last plan.
    pub is_dearer: bool,
    /// Iterations of all programs.
    pub iterations: usize,
}

/// The places of the states whose initial values are given: neither free nor determined by equations.
pub(crate) fn given_states(system: &System<'_>) -> Vec<usize> {
    let task = system.task.as_ref();
    let freed = task.iter().flat_map(|task| &task.initial);
    let freed = freed.map(|free| free.place);
    let others: Vec<usize> = freed.chain(system.algebraic_states()).collect();
    let given = 0..system.n_model_states();
    given.filter(|place| !others.contains(place)).collect()
}

impl<'e> Prepared<'e> {
    /// What controls are within an interval.
    pub(crate) fn shape(&self) -> Shape {
        let task = self.problem.dcs.task.as_ref();
        task.map_or(Shape::Constant, |task| task.shape)
    }

    /// Whether plans are as long as it takes.
    pub(crate) fn has_free_horizon(&self) -> bool {
        self.problem.layout.horizon().is_some()
    }

    /// The names of what a plan decides on, entry by entry.
    pub(crate) fn controls(&self) -> Vec<String> {
        let task = self.problem.dcs.task.iter();
        let controls = task.flat_map(|task| &task.controls);
        controls.map(|control| control.name.clone()).collect()
    }

    /// The names of the states of plans, entry by entry.
    pub(crate) fn planned_states(&self) -> Vec<String> {
        let system = &self.problem.system;
        let states = &system.states[..system.n_model_states()];
        states.iter().map(|state| state.name.clone()).collect()
    }

    /// Whether a plan may be one of this problem, by its sizes and lengths.
    pub(crate) fn takes(&self, Followed { plan, point }: &Followed) -> bool {
        let (problem, layout) = (&self.problem, &self.problem.layout);
        let rows = |rows: &[Vec<f64>], n: usize, width: usize| {
            rows.len() == n && rows.iter().all(|row| row.len() == width)
        };
        let n_controls = self.controls().len();
        let n_instants = layout.control_instants().count();
        let is_forward = plan.ends.windows(2).all(|ends| ends[0] < ends[1]);
        plan.ends.len() == layout.steps + 1
            && is_forward
            && rows(&plan.controls, n_instants, n_controls)
            && rows(&plan.states, layout.steps + 1, self.planned_states().len())
            && transfer::fits(problem, point)
    }

    /// A plan from an initial state, in the order of [`Prepared::states`], with these values of the open parameters, from
    /// the last one where there is one.
    ///
    /// # Errors
    ///
    /// For numbers that it was not prepared for, or with which the model does not begin.
    pub(crate) fn plan(
        &mut self,
        parameters: &[f64],
        x0: &[f64],
        last: Option<Last<'_>>,
        limit: &Limit,
        watch: &mut dyn Watch,
    ) -> Result<Planned, SolveError> {
        self.restart(parameters, Some(x0))?;
        let (mut iterations, mut near) = (0, None);
        if let Some(last) = &last {
            let found = self.near(last, limit, watch)?;
            (near, iterations) = (Some(found.0), found.1);
        }
        let is_enough = |(solution, failure): &Found| {
            let compares = last.as_ref().is_some_and(|last| match last.compares {
                Compares::Always => true,
                Compares::Dearer => last.costs_less(solution.objective),
                Compares::Never => false,
            });
            solution.is_feasible() && failure.is_none() && !compares
        };
        let is_over = near.is_some() && limit.is_over();
        let mut fresh = None;
        if !is_over && !near.as_ref().is_some_and(is_enough) {
            let begin = self.problem.begin(Start::Task(&self.sampled), limit);
            let mut begin = begin.expect("a task has a start");
            if last.is_some() {
                begin.options.max_restarts = RESTARTS;
                begin.options.patience = 0;
            }
            let anew = found(&mut self.problem, &begin, watch);
            iterations += anew.0.stats.iterations;
            fresh = Some(anew);
        }
        let is_compared = near.is_some() && fresh.is_some();
        let kept = near.filter(|near| fresh.as_ref().is_none_or(|anew| is_no_worse(near, anew)));
        let is_warm = kept.is_some();
        let (solution, failure) = kept.or(fresh).expect("one of them was looked for");
        let is_dearer = (last.as_ref()).is_some_and(|last| last.costs_less(solution.objective));
        let mut followed =
            is_plan(&solution, failure.as_ref()).then(|| followed_from(&self.problem, &solution));
        // What is no minimum, and costs more than what is followed does from here, is no better than that.
        if let (Some(last), Some(_), Some(_)) = (&last, &failure, &followed) {
            let costs = self.costs(last, limit);
            if costs.is_some_and(|costs| costs_more(solution.objective, costs)) {
                followed = None;
            }
        }
        Ok(Planned {
            followed,
            failure,
            is_warm,
            is_compared,
            is_dearer,
            iterations,
        })
    }

    /// The initial state that the last plan leads to, in the order of [`Prepared::states`].
    pub(crate) fn predicted(&self, last: &Last<'_>) -> Vec<f64> {
        let there = shift::shifted(&self.problem, &last.followed.point, last.passed);
        let start = there.start();
        self.given.iter().map(|&place| start[place]).collect()
    }

    /// What is found from the last plan, and in how many iterations.
    fn near(
        &mut self,
        last: &Last<'_>,
        limit: &Limit,
        watch: &mut dyn Watch,
    ) -> Result<(Found, usize), SolveError> {
        let shifted = shift::shifted(&self.problem, &last.followed.point, last.passed);
        let mut w = self.problem.lifted(&shifted).ok_or(SolveError::Foreign)?;
        let (mut iterations, mut near) = (0, None);
        for runs in [false, true] {
            if runs && !run_with(&self.problem, &mut w, limit) {
                break;
            }
            let begin = self.problem.begin(Start::Variables(&w), limit);
            let mut begin = begin.ok_or(SolveError::Foreign)?;
            begin.options.trust = Trust::Alone;
            begin.options.iterations.run = NEAR;
            let near_by: Found = found(&mut self.problem, &begin, watch);
            iterations += near_by.0.stats.iterations;
            let is_there = near_by.1.is_none();
            if is_there || near.is_none() || near_by.0.is_feasible() {
                near = Some(near_by);
            }
            if is_there || limit.is_over() {
                break;
            }
        }
        Ok((near.expect("the first start is solved"), iterations))
    }

    /// What the last plan costs from here; none where it does not keep the constraints, or that is not known in time.
    fn costs(&self, last: &Last<'_>, limit: &Limit) -> Option<f64> {
        let shifted = shift::shifted(&self.problem, &last.followed.point, last.passed);
        let w = self.problem.lifted(&shifted)?;
        let mut reduced = Reduced::new(&self.problem, &w, limit)?;
        let values = reduced.at(&w)?;
        let mut rows = values.rows.iter().zip(reduced.bounds());
        let is_kept = rows.all(|(&value, (lower, upper))| {
            let tolerance = KEPT * value.abs().max(1.0);
            lower - tolerance <= value && value <= upper + tolerance
        });
        is_kept.then_some(values.cost)
    }
}

/// A solution, and why it is none.
type Found = (Solution, Option<Failure>);

/// Whether what was found near the last plan is as good as what was found without it.
fn is_no_worse(near: &Found, anew: &Found) -> bool {
    let rank = |one: &Found| (one.0.is_feasible(), one.1.is_none());
    match rank(near).cmp(&rank(anew)) {
        Ordering::Equal => near.0.objective <= anew.0.objective + SAME * anew.0.objective.abs(),
        other => other == Ordering::Greater,
    }
}

/// Whether an objective is more than another by a share that counts.
fn costs_more(objective: f64, than: f64) -> bool {
    objective - than > DEARER * than.abs().max(SAME)
}

impl Last<'_> {
    /// Whether a plan costs more than it.
    fn costs_less(&self, objective: f64) -> bool {
        costs_more(objective, self.followed.plan.objective)
    }
}

/// Gives a point the states and modes of a run with its controls, where that comes to its end.
fn run_with(problem: &Problem<'_>, w: &mut [f64], limit: &Limit) -> bool {
    for (index, value) in problem.layout.given(&problem.dcs) {
        w[index] = value;
    }
    let run = problem.simulated(w, limit);
    reference::in_modes(problem, &run, w)
}

/// The best solution from a start, and why it is none.
fn found(problem: &mut Problem<'_>, begin: &Begin, watch: &mut dyn Watch) -> Found {
    let found = start::solve(problem, begin, watch);
    let best = found.best.unwrap_or(0);
    let mut solution = found.solutions[best].clone();
    let has_other_modes = solution.is_feasible() && branches::has_other_modes(problem, &solution.w);
    let (options, limit) = (&begin.options, &begin.options.limit);
    let in_other_mode = match has_other_modes {
        true => branches::settle(problem, &mut solution, options, limit, watch),
        false => None,
    };
    let failure = in_other_mode.or_else(|| failure::of(problem, &solution));
    (solution, failure)
}

/// Whether there is something to follow.
fn is_plan(solution: &Solution, failure: Option<&Failure>) -> bool {
    let is_bounded = !matches!(solution.status, Status::Unbounded);
    failure.is_none() || solution.is_feasible() && is_bounded
}

fn followed_from(problem: &Problem<'_>, solution: &Solution) -> Followed {
    let Layout { steps, end, .. } = problem.layout;
    let (layout, w) = (&problem.layout, &solution.w);
    let n = problem.system.n_model_states();
    let state = |first: usize| w[first..first + n].to_vec();
    let at_ends = (1..=steps).map(|k| state(layout.x(k, layout.elements, end)));
    let task = problem.dcs.task.as_ref();
    let n_controls = task.map_or(0, |task| task.controls.len());
    let controls = layout.control_instants();
    let controls = controls.map(|(k, _)| w[layout.u(k)..layout.u(k) + n_controls].to_vec());
    let plan = Plan {
        ends: problem.at(w).ends(),
        controls: controls.collect(),
        states: [state(layout.before(1, 1))]
            .into_iter()
            .chain(at_ends)
            .collect(),
        objective: solution.objective,
    };
    Followed {
        plan,
        point: problem.point(w),
    }
}

impl Plan {
    /// How long it is.
    pub fn horizon(&self) -> f64 {
        self.ends.last().copied().unwrap_or(0.0)
    }

    /// The pieces of control i within a time from when the plan has been followed for so long: when each begins, measured
    /// from there, and its value and slope. Behind the plan the last value is kept.
    pub fn pieces(
        &self,
        i: usize,
        shape: Shape,
        (from, length): (f64, f64),
    ) -> Vec<(f64, [f64; 2])> {
        let steps = self.ends.len() - 1;
        let mut pieces = Vec::new();
        for k in 0..steps {
            let (begins, ends) = (self.ends[k] - from, self.ends[k + 1] - from);
            // Instants of samples and intervals are rounded.
            let tiny = SHORTEST * (ends - begins);
            if ends <= tiny || begins >= length - tiny {
                continue;
            }
            let start = begins.max(0.0);
            pieces.push(match shape {
                Shape::Constant => (start, [self.controls[k][i], 0.0]),
                Shape::Linear => {
                    let [a, b] = [self.controls[k][i], self.controls[k + 1][i]];
                    let slope = (b - a) / (ends - begins);
                    (start, [a + slope * (start - begins), slope])
                }
            });
        }
        let end = self.horizon() - from;
        if end < length * (1.0 - SHORTEST) {
            let last = self.controls.last().map_or(0.0, |last| last[i]);
            pieces.push((end.max(0.0), [last, 0.0]));
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Project;
    use crate::expr::Exprs;

    /// Costs whose integrals are sums, are states of the program, or are none; controls of both shapes, a switch, a free end.
    const TASKS: [(&str, &str); 7] = [
        (
            "x' = v; v' = u;",
            "horizon 1; minimize integral(x^2 + u^2);",
        ),
        (
            "x' = v; v' = u;",
            "horizon 1; minimize exp(integral(u^2)) + final(x^2);",
        ),
        (
            "x' = v; v' = u;",
            "horizon 1; minimize integral(x^2) + integral(u^2) + final(v^2);",
        ),
        ("x' = v; v' = u;", "horizon 1; minimize final(x^2 + v^2);"),
        (
            "x' = v; v' = u;",
            "horizon 1; controls linear; minimize integral(x^2 + u^2);",
        ),
        (
            "x' = v; v' = u - 0.2*sign(v + 2);",
            "horizon 1; minimize integral(x^2 + u^2);",
        ),
        (
            "x' = v; v' = u;",
            "horizon free in [0.1, 10] = 3; minimize final(time); final { x = 0; v = 0; }",
        ),
    ];

    /// Shifted by some of its intervals, a plan begins where it is then.
    #[test]
    fn shifted_plans_begin_where_the_plan_is() {
        for (rates, task) in TASKS {
            let text = format!(
                "model m {{ state x = 1; state v = 0; control u in [-3, 3]; {rates} }}
                optimize o of m {{ intervals 4; elements 1; {task} }}"
            );
            let (exprs, limit) = (Exprs::new(), Limit::default());
            let project = Project::from_text("m.nsd", &text);
            let prepared = project.prepare_optimal(&exprs, "o", &[], &[]);
            let mut prepared = prepared.unwrap_or_else(|error| panic!("{task}: {error}"));
            let planned = prepared.plan(&[], &[1.0, 0.0], None, &limit, &mut ());
            let followed = planned.expect("numbers that it takes").followed;
            let followed = followed.unwrap_or_else(|| panic!("{task}: no plan"));
            for (k, state) in followed.plan.states[..4].iter().enumerate() {
                let last = Last {
                    followed: &followed,
                    passed: followed.plan.ends[k],
                    compares: Compares::Never,
                };
                let begins = prepared.predicted(&last);
                let mut pairs = begins.iter().zip(state);
                let is_there = pairs.all(|(a, b)| (a - b).abs() < 1e-9);
                assert!(is_there, "{task}: {begins:?} is not {state:?}");
            }
        }
    }
}
