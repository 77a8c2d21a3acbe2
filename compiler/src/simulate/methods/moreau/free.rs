//! The motion without contacts, with its derivatives and the masses of the bodies.

use nsd_solver::adaptive::Field;
use nsd_solver::hybrid::Side;
use nsd_solver::moreau;
use nsd_solver::tape::{Scratch, Tape};

use crate::expr::{self, Expr};
use crate::lowering::hybrid::{Pulses, data_of, tape};
use crate::simulate::methods::adaptive::{Inputs, Jumping};
use crate::system::System;

/// f, ∂f/∂x and M.
#[derive(Clone, Debug)]
pub(crate) struct Free {
    field: Jumping,
    slopes: Vec<(usize, usize)>,
    jacobian: Tape,
    masses: Tape,
    masses_are_constant: bool,
    jacobian_scratch: Scratch,
    masses_scratch: Scratch,
}

impl Free {
    pub(crate) fn new<'e>(system: &System<'e>, inputs: &Inputs<'e>, pulses: Pulses) -> Self {
        let rates: Vec<Expr<'e>> = system.states.iter().map(|state| state.rate).collect();
        let rates = inputs.numbers.apply(&rates);
        let states = &inputs.vars[1..=system.states.len()];
        let entries = expr::jacobian(&rates, states).entries;
        let values: Vec<Expr<'e>> = entries.iter().map(|&(.., value)| value).collect();
        let bodies = system.jumps.bodies.iter();
        let masses = bodies.flat_map(|body| &body.mass).copied();
        let masses = inputs.numbers.apply(&masses.collect::<Vec<_>>());
        let (jacobian, mass_tape) = (tape(&inputs.vars, &values), tape(&inputs.vars, &masses));
        Free {
            field: Jumping::of(system, inputs, pulses),
            slopes: entries.iter().map(|&(i, j, _)| (i, j)).collect(),
            jacobian_scratch: jacobian.scratch(),
            masses_scratch: mass_tape.scratch(),
            masses_are_constant: inputs.are_constant(&masses),
            jacobian,
            masses: mass_tape,
        }
    }

    /// Gives the open parameters other values.
    pub(crate) fn set_parameters(&mut self, values: &[f64]) {
        self.field.set_parameters(values);
    }

    /// Takes the data of a system, of the same fits.
    pub(crate) fn set_data(&mut self, system: &System) {
        self.field.set_data(&data_of(system));
    }
}

impl Field for Free {
    fn n_states(&self) -> usize {
        self.field.n_states()
    }

    fn n_switches(&self) -> usize {
        self.field.n_switches()
    }

    fn sides(&mut self, t: f64, x: &[f64], sides: &mut [Side]) {
        self.field.sides(t, x, sides);
    }

    fn rates(&mut self, t: f64, x: &[f64], rates: &mut [f64]) {
        self.field.rates(t, x, rates);
    }

    fn load(&mut self, t: f64) -> f64 {
        self.field.load(t)
    }
}

impl moreau::Free for Free {
    fn slopes(&self) -> &[(usize, usize)] {
        &self.slopes
    }

    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        let inputs = self.field.at(t, x);
        self.jacobian
            .eval(inputs, values, &mut self.jacobian_scratch);
    }

    fn masses(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        let inputs = self.field.at(t, x);
        self.masses.eval(inputs, values, &mut self.masses_scratch);
    }

    fn masses_are_constant(&self) -> bool {
        self.masses_are_constant
    }

    fn coefficients(&self) -> &[f64] {
        self.field.coefficients()
    }
}
