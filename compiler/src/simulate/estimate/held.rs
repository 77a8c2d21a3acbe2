//! Algebraic states that are zero to rounding.
//!
//! An equation 0 = g(t, y), or a member g of a pair, gives an entry y_i up to the rounding of its other terms,
//!
//! δ_i = ε max(Σ |∂g/∂y_j| |y_j|, |g - y_i ∂g/∂y_i|)/|∂g/∂y_i|,   j ≠ i,
//!
//! the least of these where several contain y_i. A multiplier that has always been below it has no size of its own.

use nsd_solver::hybrid::Outcome;

use crate::expr::variables_of;
use crate::system::{Role, System};

/// δ at the end of a run, whose states have had these sizes; zero where nothing bounds it.
pub(in crate::simulate) fn held(system: &System, outcome: &Outcome, sizes: &[f64]) -> Vec<f64> {
    let mut held = vec![0.0; sizes.len()];
    let algebraic = system.algebraic_states();
    if algebraic.is_empty() {
        return held;
    }
    let known = system.valuation(outcome.time, &outcome.x, &outcome.alpha);
    let place = |var| {
        let mut states = system.states.iter();
        states.position(|state| state.var.as_variable() == Some(var))
    };
    for switch in &system.switches {
        if switch.role == Role::Step {
            continue;
        }
        let states = variables_of(&[switch.psi]).into_iter();
        let states = states.filter_map(|var| Some((place(var)?, var)));
        let slope = |(i, var)| (i, known.value(switch.psi.diff(var)).abs());
        let slopes: Vec<(usize, f64)> = states.map(slope).collect();
        let value = known.value(switch.psi);
        for &(i, slope) in slopes.iter().filter(|(i, _)| algebraic.contains(i)) {
            let others = slopes.iter().filter(|(j, _)| *j != i);
            let terms: f64 = others.map(|(j, slope)| slope * sizes[*j]).sum();
            let terms = terms.max(value.abs() - slope * sizes[i]);
            let rounding = f64::EPSILON * terms / slope;
            if rounding > 0.0 && rounding.is_finite() && (held[i] == 0.0 || rounding < held[i]) {
                held[i] = rounding;
            }
        }
    }
    held
}
