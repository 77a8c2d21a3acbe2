//! A task that is solved from one state after another: each plan is looked for where the last one leaves off.
//!
//! 1. The last plan, shifted by the time that has passed (`start/shift.rs`), is solved on its branch.
//! 2. Where that is no solution, so is the branch of a run with its controls from the state that there is.
//! 3. Where that is no solution, the task is solved as its experiment does it. So it may be where a plan costs more than the
//!    last one: what rests on a surface, as a body that sticks, may be a minimum beside better ones.
//!
//! What is feasible is a plan; simulations do not confirm it, as the next one is made of what will have happened.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

use nsd_solver::optimization::mpcc::{Solution, Status, Trust};

use super::start::{self, Begin, Start, reference, shift};
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

/// A plan to go on from.
pub(crate) struct Last<'p> {
    pub plan: &'p Plan,
    /// How long ago it was made.
    pub passed: f64,
    /// Whether what costs more is compared with what is found without it.
    pub compares: bool,
}

/// Controls from now on, and what they are to lead to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// The solution, to go on from.
    pub point: Point,
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
    pub plan: Option<Plan>,
    /// Why it is not known to be a minimum, or why there is none.
    pub failure: Option<Failure>,
    /// Whether it is on the branch of the last plan, or where that has led.
    pub is_warm: bool,
    /// Iterations of all programs.
    pub iterations: usize,
}

/// The places of the states whose initial values are given: neither free nor determined by equations.
pub(crate) fn given_states(system: &System<'_>) -> Vec<usize> {
    let task = system.task.as_ref();
    let n_integrals = task.map_or(0, |task| task.integrals);
    let freed = task.iter().flat_map(|task| &task.initial);
    let freed = freed.map(|free| free.place);
    let others: Vec<usize> = freed.chain(system.algebraic_states()).collect();
    let given = 0..system.states.len() - n_integrals;
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
        let n_integrals = system.task.as_ref().map_or(0, |task| task.integrals);
        let states = &system.states[..system.states.len() - n_integrals];
        states.iter().map(|state| state.name.clone()).collect()
    }

    /// Whether a plan is one of this problem.
    pub(crate) fn takes(&self, point: &Point) -> bool {
        self.problem.lifted(point).is_some()
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
        if let Some(Last { plan, passed, .. }) = &last {
            let shifted = shift::shifted(&self.problem, &plan.point, *passed);
            let mut w = self.problem.lifted(&shifted).ok_or(SolveError::Foreign)?;
            for runs in [false, true] {
                if runs && !run_with(&self.problem, &mut w, limit) {
                    break;
                }
                let begin = self.problem.begin(Start::Variables(&w), limit);
                let mut begin = begin.ok_or(SolveError::Foreign)?;
                begin.options.trust = Trust::Alone;
                begin.options.max_iterations = NEAR;
                let near_by = found(&mut self.problem, &begin, watch);
                iterations += near_by.0.stats.iterations;
                let is_there = near_by.1.is_none();
                if is_there || near.is_none() || near_by.0.is_feasible() {
                    near = Some(near_by);
                }
                if is_there || limit.is_over() {
                    break;
                }
            }
        }
        let is_enough = |(solution, failure): &(Solution, Option<Failure>)| {
            let is_dearer = last
                .as_ref()
                .is_some_and(|last| last.compares && last.costs_less(solution.objective));
            solution.is_feasible() && (limit.is_over() || failure.is_none() && !is_dearer)
        };
        let mut fresh = None;
        if !near
            .as_ref()
            .is_some_and(|near| is_enough(near) || limit.is_over())
        {
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
        let is_kept = |near: &(Solution, Option<Failure>)| {
            let Some(anew) = &fresh else { return true };
            let rank = |one: &(Solution, Option<Failure>)| (one.0.is_feasible(), one.1.is_none());
            match rank(near).cmp(&rank(anew)) {
                Ordering::Equal => {
                    near.0.objective <= anew.0.objective + SAME * anew.0.objective.abs()
                }
                other => other == Ordering::Greater,
            }
        };
        let kept = near.filter(is_kept);
        let is_warm = kept.is_some();
        let best = kept.or(fresh).expect("one of them was looked for");
        let mut told = planned(&self.problem, &best.0, best.1, is_warm, iterations);
        // What is no minimum, and costs more than what is followed, is no better than that.
        if let Some(last) = &last
            && told.failure.is_some()
            && last.costs_less(best.0.objective)
        {
            told.plan = None;
        }
        Ok(told)
    }
}

impl Last<'_> {
    /// Whether a plan costs more than it.
    fn costs_less(&self, objective: f64) -> bool {
        let more = objective - self.plan.objective;
        more > DEARER * self.plan.objective.abs().max(SAME)
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
fn found(
    problem: &mut Problem<'_>,
    begin: &Begin,
    watch: &mut dyn Watch,
) -> (Solution, Option<Failure>) {
    let found = start::solve(problem, begin, watch);
    let best = found.best.unwrap_or(0);
    let mut solution = found.solutions[best].clone();
    let has_branches = !problem.dcs.switches.branches.is_empty() && solution.is_feasible();
    let (options, limit) = (&begin.options, &begin.options.limit);
    let in_other_mode = match has_branches {
        true => branches::settle(problem, &mut solution, options, limit, watch),
        false => None,
    };
    let failure = in_other_mode.or_else(|| failure::of(problem, &solution));
    (solution, failure)
}

fn planned(
    problem: &Problem<'_>,
    solution: &Solution,
    failure: Option<Failure>,
    is_warm: bool,
    iterations: usize,
) -> Planned {
    let is_plan = failure.is_none()
        || solution.is_feasible() && !matches!(solution.status, Status::Unbounded);
    Planned {
        plan: is_plan.then(|| plan_of(problem, solution)),
        failure,
        is_warm,
        iterations,
    }
}

fn plan_of(problem: &Problem<'_>, solution: &Solution) -> Plan {
    let Layout { steps, end, .. } = problem.layout;
    let (layout, w) = (&problem.layout, &solution.w);
    let n_integrals = problem
        .system
        .task
        .as_ref()
        .map_or(0, |task| task.integrals);
    let n = problem.system.states.len() - n_integrals;
    let state = |first: usize| w[first..first + n].to_vec();
    let at_ends = (1..=steps).map(|k| state(layout.x(k, layout.elements, end)));
    let task = problem.dcs.task.as_ref();
    let n_controls = task.map_or(0, |task| task.controls.len());
    let controls = layout.control_instants();
    let controls = controls.map(|(k, _)| w[layout.u(k)..layout.u(k) + n_controls].to_vec());
    Plan {
        point: problem.point(w),
        ends: problem.at(w).ends(),
        controls: controls.collect(),
        states: [state(layout.before(1, 1))]
            .into_iter()
            .chain(at_ends)
            .collect(),
        objective: solution.objective,
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
