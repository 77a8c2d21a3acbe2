//! Steps of time, and control intervals that begin with them.

use super::problem::Given;
use crate::expr::Var;
use crate::lowering::discretize::{beginning, ends};
use crate::lowering::hybrid::variable;
use crate::simulate::schedule;
use crate::system::System;
use crate::system::experiment::{Lengths, Optimize, Settings};

/// With more control intervals than these, others come first in nested iteration.
const MOST: usize = 64;

/// Takes the least number of control intervals with which all pieces of data and all steps of time begin, where the number is
/// the default one, and there is one that is not too large.
pub(crate) fn begin_intervals(system: &System, settings: &mut Settings) {
    let Some(task) = settings.optimize.as_ref() else {
        return;
    };
    let grid = &task.discretization;
    if !grid.by_default || !has_ends(settings, task) {
        return;
    }
    let (horizon, least) = (settings.horizon, grid.intervals);
    let data = system.exogenous.data.iter();
    let mut instants: Vec<f64> = data.flat_map(|data| ends(&data.table, horizon)).collect();
    let inputs = inputs(system, task, Given::Numbers);
    instants.extend(schedule::instants(system, horizon, inputs));
    let begin = |n: &usize| {
        instants
            .iter()
            .all(|&t| beginning(t, horizon, *n).is_some())
    };
    if let (Some(n), Some(task)) = ((least..=MOST).find(begin), &mut settings.optimize) {
        task.discretization.intervals = n;
    }
}

/// The system with data in place of switches of time, as far as they change at ends of control intervals alone: there is
/// nothing to detect.
pub(super) fn held<'e>(
    system: &System<'e>,
    settings: &Settings<'e>,
    task: &Optimize<'e>,
    given: Given<'_>,
) -> System<'e> {
    if !has_ends(settings, task) {
        return system.clone();
    }
    let (inputs, steps) = (inputs(system, task, given), task.discretization.intervals);
    schedule::held(system, settings.horizon, steps, inputs)
}

/// Whether ends of control intervals are instants that are known.
fn has_ends(settings: &Settings, task: &Optimize) -> bool {
    let are_equal = task.discretization.lengths == Lengths::Equal;
    !settings.freezes() && task.horizon.is_none() && are_equal
}

/// What is no number: parameters that are open or free, and controls.
fn inputs(system: &System, task: &Optimize, given: Given<'_>) -> Vec<Var> {
    let open = match given {
        Given::Numbers => &[][..],
        Given::Inputs(params) => params,
    };
    let open = system.exogenous.chosen(open);
    let open = open.map(|param| variable(param.var));
    let free = task.params.iter().map(|free| free.var);
    let controls = system.task.iter().flat_map(|task| &task.controls);
    let controls = controls.map(|control| variable(control.var));
    open.chain(free).chain(controls).collect()
}
