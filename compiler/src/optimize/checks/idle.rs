//! What no control moves in an optimum, though it could.
//!
//! Where nothing touches and nothing switches, bodies that only contacts move stay where they are, and to first order no
//! change of a control does anything about it: such a point is stationary, however far the bodies are from where the
//! objective wants them. That shows in a run without events: changes of all free quantities leave a state what it is,
//! another initial value of it changes the objective, and by the structure of the system they get to it through a switch
//! and not without one.

use rustc_hash::FxHashSet;

use super::descent::LARGE;
use super::reduced::{Kind, Quantity, Reduced};
use crate::expr::{Expr, Var, variables_of};
use crate::limit::Limit;
use crate::optimize::Problem;
use crate::optimize::problem::{size_of_objective, size_of_state};
use crate::report::{Trajectory, Warning};
use crate::system::experiment::Settings;
use crate::system::task::Control;
use crate::system::{State, System};

/// Changes of states that are none, and of the objective, relative to their sizes or 1.
const SAME: f64 = 1e-9;
const NO_SLOPE: f64 = 1e-6;
/// By how much initial values are changed, relative to their sizes or 1.
const CHANGE: f64 = 1e-3;
/// States that are named.
const MOST_NAMES: usize = 4;

/// That an optimum leaves states alone that free quantities move through switches alone; `None` where it does not, where
/// some control has a finite set of values, which has no small changes, and where simulations would take too long.
pub(crate) fn left_alone(
    problem: &Problem,
    trajectory: &Trajectory,
    w: &[f64],
    limit: &Limit,
) -> Option<Warning> {
    let (system, task) = (&problem.system, problem.system.task.as_ref()?);
    let is_finite = |control: &Control| control.values().is_some();
    if task.controls.iter().any(is_finite) || !trajectory.history.events.is_empty() {
        return None;
    }
    let mut reduced = Reduced::new(problem, w, limit)?;
    let through_switches = through_switches(system, &reduced.quantities);
    let n = system.states.len();
    let states = system.states[..system.n_model_states()].iter().enumerate();
    let states: Vec<(usize, &State)> = (states)
        .filter(|(_, state)| {
            (state.var.as_variable()).is_some_and(|var| through_switches.contains(&var))
        })
        .collect();
    if states.is_empty() {
        return None;
    }
    let base = reduced.at(w).filter(|base| base.events.is_empty())?;
    let is_decided = |alpha: &f64| *alpha == 0.0 || *alpha == 1.0;
    let is_on_surface = base.end.len() == n || !base.end[n..].iter().all(is_decided);
    // One with all quantities changed, and two for each state.
    if is_on_surface || reduced.is_too_much(1 + 2 * states.len(), base.steps) {
        return None;
    }
    let other = reduced.at(&changed(&reduced, w));
    let other = other.filter(|other| other.events.is_empty())?;
    let size = |i: usize, value: f64| value.abs().max(size_of_state(problem, i));
    let left = states.iter().filter(|&&(i, state)| {
        if (base.end[i] - other.end[i]).abs() > SAME * size(i, base.end[i]) {
            return false;
        }
        let mut from = |sign: f64| {
            let values = reduced.at_from(w, (i, sign * CHANGE * size(i, state.initial)))?;
            (values.events.is_empty()).then_some(values.cost)
        };
        let costs = from(1.0).zip(from(-1.0));
        costs.is_some_and(|(up, down)| {
            (up - down).abs() > NO_SLOPE * size_of_objective(problem, base.cost)
        })
    });
    let names = left.map(|(_, state)| state.name.as_str());
    let names: Vec<&str> = names.take(MOST_NAMES + 1).collect();
    (!names.is_empty()).then(|| warning(&names, &problem.settings))
}

/// A point with changes of all free quantities, different for all of them, so that nothing cancels.
fn changed(reduced: &Reduced<'_, '_>, w: &[f64]) -> Vec<f64> {
    let mut changed = w.to_vec();
    for (number, quantity) in reduced.quantities.iter().enumerate() {
        let value = w[quantity.index];
        let step = LARGE * quantity.size * (1.0 + 0.1 * (number as f64).sin());
        let next = if value + step <= quantity.upper {
            value + step
        } else {
            value - step
        };
        changed[quantity.index] = next.max(quantity.lower);
    }
    changed
}

fn warning(names: &[&str], settings: &Settings) -> Warning {
    let shown = names.iter().take(MOST_NAMES);
    let mut shown: Vec<String> = shown.map(|name| format!("`{name}`")).collect();
    if names.len() > MOST_NAMES {
        shown.push("others".to_owned());
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

/// The variables that free quantities get to through a switch and not without one.
fn through_switches(system: &System, quantities: &[Quantity]) -> FxHashSet<Var> {
    let Some(task) = &system.task else {
        return FxHashSet::default();
    };
    let var = |quantity: &Quantity| match quantity.kind {
        Kind::Control(i) => task.controls[i].var.as_variable(),
        Kind::Param(place) => system.exogenous.params[place].var.as_variable(),
        Kind::Initial(place) => system.states[place].var.as_variable(),
        // With a time of their own, states and controls are what they are.
        Kind::Horizon | Kind::Length => None,
    };
    let free: FxHashSet<Var> = quantities.iter().filter_map(var).collect();
    let states = system.states.iter().map(|state| (state.var, state.rate));
    let switches = (system.switches.iter()).map(|switch| (switch.alpha, switch.psi));
    let without = reached(free.clone(), states.clone());
    let with = reached(free, states.chain(switches));
    with.difference(&without).copied().collect()
}

/// What variables get to, from those that functions are of to the values of these.
fn reached<'e>(
    mut reached: FxHashSet<Var>,
    functions: impl Iterator<Item = (Expr<'e>, Expr<'e>)>,
) -> FxHashSet<Var> {
    let functions: Vec<(Var, Vec<Var>)> = functions
        .filter_map(|(value, of)| {
            Some((
                value.as_variable()?,
                variables_of(&[of]).into_iter().collect(),
            ))
        })
        .collect();
    loop {
        let before = reached.len();
        for (value, of) in &functions {
            if of.iter().any(|var| reached.contains(var)) {
                reached.insert(*value);
            }
        }
        if reached.len() == before {
            return reached;
        }
    }
}
