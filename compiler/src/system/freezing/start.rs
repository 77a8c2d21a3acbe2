//! Values at the start of a run, while all contacts are open.

use super::{along, alpha, numbers};
use crate::expr::{Expr, Substitution, Var};
use crate::system::System;
use crate::system::verify::alphas_of;

/// What is known of the start; controls that are decided count as zero.
pub(super) struct Start<'s, 'e> {
    system: &'s System<'e>,
    numbers: Substitution<'e>,
    alphas: Vec<Var>,
    contacts: Vec<Var>,
}

impl<'s, 'e> Start<'s, 'e> {
    pub fn of(system: &'s System<'e>) -> Self {
        let contacts = system.switches.iter().enumerate();
        let contacts = contacts.filter(|(_, switch)| switch.unilateral);
        Start {
            system,
            numbers: numbers(system),
            alphas: alphas_of(&system.switches),
            contacts: contacts.map(|(k, _)| alpha(system, k)).collect(),
        }
    }

    /// A value, in the middle between the sides of switches.
    pub fn value(&self, e: Expr<'e>) -> f64 {
        e.eval(&|var| {
            let mut states = self.system.states.iter();
            match states.find(|state| state.var.as_variable() == Some(var)) {
                Some(state) => state.initial,
                None if self.contacts.contains(&var) => 1.0,
                None if self.alphas.contains(&var) => 0.5,
                None => (self.numbers.get(var).and_then(Expr::as_constant)).unwrap_or(0.0),
            }
        })
    }

    /// Its rate.
    pub fn acceleration(&self, speed: Expr<'e>) -> f64 {
        self.value(along(self.system, speed, |state| {
            self.system.states[state].rate
        }))
    }
}
