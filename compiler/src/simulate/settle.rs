//! Algebraic states at the start.

use crate::lowering::hybrid;
use nsd_solver::event::Simulator;

use super::outcome;
use crate::expr::Substitution;
use crate::report::Failure;
use crate::system::System;

/// The system with guesses of the controls that are decided.
fn with_guesses<'e>(system: &System<'e>) -> System<'e> {
    let mut known = system.clone();
    let controls = known.task.take().map(|task| task.controls);
    let guesses = controls.iter().flatten().filter_map(|control| {
        let guess = system.exprs.constant(control.guess());
        Some((control.var.as_variable()?, guess))
    });
    let guesses: Substitution<'e> = guesses.collect();
    for state in &mut known.states {
        state.rate = state.rate.substitute(&guesses);
    }
    for switch in &mut known.switches {
        switch.psi = switch.psi.substitute(&guesses);
    }
    known
}

/// Finds consistent values of algebraic states.
pub(crate) struct Consistent {
    simulator: Simulator,
    open: Vec<usize>,
}

impl Consistent {
    /// Compiles the equations of a system, whatever its initial values and those of the parameters that are open, by their
    /// numbers.
    pub fn new(system: &System, open: &[usize]) -> Self {
        let known = hybrid::lower_at(&with_guesses(system), open);
        Consistent {
            simulator: Simulator::new(known, Default::default()),
            open: open.to_vec(),
        }
    }

    /// Takes them as initial values of the same system, from those that it has.
    ///
    /// # Errors
    ///
    /// What a run by events would say of the start.
    pub fn settle(&mut self, system: &mut System, horizon: f64) -> Result<(), Failure> {
        let start: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
        self.simulator.set_parameters(&system.values_of(&self.open));
        let found = self.simulator.consistent(0.0, &start, horizon);
        let found = found.map_err(|status| outcome::of_start(system, &status))?;
        for (state, value) in system.states.iter_mut().zip(found) {
            state.initial = value;
        }
        Ok(())
    }
}

/// Takes consistent values of the algebraic states as initial values.
///
/// # Errors
///
/// What a run by events would say of the start.
pub fn settle(system: &mut System, horizon: f64) -> Result<(), Failure> {
    Consistent::new(system, &[]).settle(system, horizon)
}
