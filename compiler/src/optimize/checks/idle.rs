//! What no control moves in an optimum, though it could.
//!
//! Where nothing touches and nothing switches, bodies that only contacts move stay where they are, and to first order no
//! change of a control does anything about it: such a point is stationary, however far the bodies are from where the
//! objective wants them. That shows in a run without events: changes of all free quantities leave a state what it is,
//! another initial value of it changes the objective, and by the structure of the system a control gets to it through a
//! switch.

use rustc_hash::FxHashSet;

use super::descent::LARGE;
use super::reduced::Reduced;
use crate::expr::{Expr, Var, variables_of};
use crate::limit::Limit;
use crate::optimize::Problem;
use crate::report::{Trajectory, Warning};
use crate::system::System;
use crate::system::experiment::Settings;

/// Changes of states that are none, and of the objective, relative to their sizes or 1.
const SAME: f64 = 1e-9;
const NO_SLOPE: f64 = 1e-6;
/// By how much initial values are changed, relative to their sizes or 1.
const CHANGE: f64 = 1e-3;
/// States that are named.
const MOST_NAMES: usize = 4;

/// That an optimum leaves states alone that only switches and contacts could move; `None` where it does not.
pub(crate) fn left_alone(
    problem: &Problem,
    trajectory: &Trajectory,
    w: &[f64],
    limit: &Limit,
) -> Option<Warning> {
    if problem.system.switches.is_empty() || !trajectory.history.events.is_empty() {
        return None;
    }
    let mut reduced = Reduced::new(problem, w, limit)?;
    let base = reduced.at(w).filter(|base| base.events == 0)?;
    let n = problem.system.states.len();
    let is_decided = |alpha: &f64| *alpha == 0.0 || *alpha == 1.0;
    if base.end.len() == n || !base.end[n..].iter().all(is_decided) {
        return None;
    }
    let mut changed = w.to_vec();
    for (number, quantity) in reduced.quantities.iter().enumerate() {
        let value = w[quantity.index];
        // Different for all of them, so that nothing cancels.
        let step = LARGE * quantity.size * (1.0 + 0.1 * (number as f64).sin());
        let next = if value + step <= quantity.upper {
            value + step
        } else {
            value - step
        };
        changed[quantity.index] = next.max(quantity.lower);
    }
    let other = reduced.at(&changed).filter(|other| other.events == 0)?;
    let size = |value: f64| value.abs().max(1.0);
    let within_reach = within_reach(&problem.system);
    let integrals = problem
        .system
        .task
        .as_ref()
        .map_or(0, |task| task.integrals);
    let states = problem.system.states[..n - integrals].iter().enumerate();
    let left = states.filter(|&(i, state)| {
        let is_moved = (base.end[i] - other.end[i]).abs() > SAME * size(base.end[i]);
        let is_reached = (state.var.as_variable()).is_some_and(|var| within_reach.contains(&var));
        if is_moved || !is_reached {
            return false;
        }
        let mut from = |sign: f64| {
            let values = reduced.at_from(w, (i, sign * CHANGE * size(state.initial)))?;
            (values.events == 0).then_some(values.cost)
        };
        let costs = from(1.0).zip(from(-1.0));
        costs.is_some_and(|(up, down)| (up - down).abs() > NO_SLOPE * size(base.cost))
    });
    let names: Vec<&str> = left.map(|(_, state)| state.name.as_str()).collect();
    (!names.is_empty()).then(|| warning(&names, &problem.settings))
}

fn warning(names: &[&str], settings: &Settings) -> Warning {
    let shown = names.iter().take(MOST_NAMES);
    let mut shown: Vec<String> = shown.map(|name| format!("`{name}`")).collect();
    if names.len() > MOST_NAMES {
        shown.push(format!("{} more", names.len() - MOST_NAMES));
    }
    Warning {
        code: "W0728".into(),
        message: format!(
            "nothing touches and nothing switches in this optimum, so that no control moves {}, which the objective depends \
             on; a `guess` of controls that make it happen, or several `starts`, may lead to a better one",
            shown.join(", ")
        ),
        span: Some(settings.span),
    }
}

/// The states that controls, free parameters, initial values and a free horizon get to, be it through a switch.
fn within_reach(system: &System) -> FxHashSet<Var> {
    let Some(task) = &system.task else {
        return FxHashSet::default();
    };
    let var = |e: Expr<'_>| e.as_variable();
    let controls = task.controls.iter().filter_map(|control| var(control.var));
    let params = task.params.iter();
    let params = params.filter_map(|free| var(system.exogenous.params[free.place].var));
    let initial = (task.initial.iter()).filter_map(|free| var(system.states[free.place].var));
    let mut reached: FxHashSet<Var> = controls.chain(params).chain(initial).collect();
    let states = system.states.iter().map(|state| (state.var, state.rate));
    let switches = system
        .switches
        .iter()
        .map(|switch| (switch.alpha, switch.psi));
    let all: Vec<(Var, FxHashSet<Var>)> = (states.chain(switches))
        .filter_map(|(value, of)| Some((var(value)?, variables_of(&[of]).into_iter().collect())))
        .collect();
    loop {
        let before = reached.len();
        for (value, of) in &all {
            if of.iter().any(|var| reached.contains(var)) {
                reached.insert(*value);
            }
        }
        if reached.len() == before {
            return reached;
        }
    }
}
