//! The figure of a run: fine curves, and switching curves in the phase plane.

use std::collections::HashMap;

use crate::Compiled;
use crate::expr::{Expr, Var, variables_of};
use crate::model::Units;
use crate::report::plot::{self, Surface};
use crate::report::{Trajectory, refine};

/// The SVG text.
pub fn draw(compiled: &Compiled<'_>, trajectory: &Trajectory) -> String {
    let system = &compiled.system;
    let params = parameters(compiled);
    // Switching curves are drawn over the states as the system has them.
    let names = trajectory
        .states
        .iter()
        .flat_map(|series| series.entry_names());
    let is_whole = names.eq(system.states.iter().map(|state| state.name.clone()));
    let surfaces = match is_whole {
        true => surfaces(compiled, &params),
        false => Vec::new(),
    };
    let units = Units::of(&compiled.model);
    plot::write(&curves(compiled, trajectory), &units, &surfaces)
}

fn parameters(compiled: &Compiled<'_>) -> HashMap<Var, f64> {
    let params = compiled.system.params.iter();
    params
        .filter_map(|param| Some((param.var.as_variable()?, param.value)))
        .collect()
}

/// The trajectory at as many instants as its curves need to look smooth.
pub fn curves(compiled: &Compiled<'_>, trajectory: &Trajectory) -> Trajectory {
    let system = &compiled.system;
    let params = parameters(compiled);
    // The row of every variable: states, α, then data.
    let state_vars: Vec<Expr<'_>> = system.states.iter().map(|state| state.var).collect();
    let alphas = system.switches.iter().map(|switch| switch.alpha);
    let data = system.data.iter().map(|data| data.var);
    let rows = state_vars.iter().copied().chain(alphas).chain(data);
    let rows = rows.enumerate();
    let rows: HashMap<Var, usize> = rows
        .filter_map(|(row, var)| Some((var.as_variable()?, row)))
        .collect();
    let time = system.time.as_variable();

    // What is reported, in time, states and α.
    let states = system.groups.iter().flat_map(|group| &group.entries);
    let recorded = system.outputs.iter().chain(&system.controls);
    let exprs: Vec<Expr<'_>> = states
        .map(|&entry| system.states[entry].var)
        .chain(recorded.flat_map(|output| output.exprs.iter().copied()))
        .collect();
    let n_states = system.states.len();
    refine(trajectory, &|t, row| {
        let mut row = row.to_vec();
        let (x, alpha) = row.split_at_mut(n_states);
        system.see(t, x, alpha);
        let number = |var: Var| match rows.get(&var) {
            Some(&place) => row[place],
            None if Some(var) == time => t,
            None => params.get(&var).copied().unwrap_or(f64::NAN),
        };
        exprs.iter().map(|expr| expr.eval(&number)).collect()
    })
}

/// The switching functions of two states alone.
fn surfaces<'c>(compiled: &'c Compiled<'_>, params: &'c HashMap<Var, f64>) -> Vec<Surface<'c>> {
    let system = &compiled.system;
    let [x, y] = &system.states[..] else {
        return Vec::new();
    };
    let (Some(x), Some(y)) = (x.var.as_variable(), y.var.as_variable()) else {
        return Vec::new();
    };
    let is_known = |var: &Var| *var == x || *var == y || params.contains_key(var);
    let fixed = system
        .switches
        .iter()
        .filter(move |switch| variables_of(&[switch.psi]).iter().all(is_known));
    fixed
        .map(|switch| Surface {
            name: switch.name.clone(),
            psi: Box::new(move |u, v| {
                let number = |var: Var| match var {
                    var if var == x => u,
                    var if var == y => v,
                    var => params.get(&var).copied().unwrap_or(f64::NAN),
                };
                switch.psi.eval(&number)
            }),
        })
        .collect()
}
