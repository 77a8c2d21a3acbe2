//! Algebraic states at the start.

use nsd_solver::simulate::Simulator;

use super::outcome;
use super::switched::Switched;
use crate::report::Failure;
use crate::system::System;

/// Takes consistent values of the algebraic states as initial values.
///
/// # Errors
///
/// What a run by events would say of the start.
pub fn settle(system: &mut System, horizon: f64) -> Result<(), Failure> {
    let start: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let found = {
        let switched = Switched::new(system);
        let mut simulator = Simulator::new(&switched, Default::default());
        simulator.consistent(0.0, &start, horizon)
    };
    let found = found.map_err(|status| outcome::of_start(system, &status))?;
    for (state, value) in system.states.iter_mut().zip(found) {
        state.initial = value;
    }
    Ok(())
}
