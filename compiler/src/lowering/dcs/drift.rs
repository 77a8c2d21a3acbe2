//! Contacts that last, without drift of their velocity.
//!
//! Where gap = 0 holds at the nodes of an element alone, the error of gap' has the order of the number of nodes, and
//! either sign, which impulses at the next element would have to take. With a multiplier ν,
//!
//! q' = v + ∇gap ν,   0 = c gap' + (1 - c) ν,
//!
//! and c = 1 in an element in which the contact stays closed, both vanish at the nodes; elsewhere c = 0, and nothing
//! changes. Velocities have the order of the scheme then.
//!
//! Gear, Leimkuhler & Gupta 1985.

use super::{Algebraic, Cause, Dcs, Origin};
use crate::system::System;

/// The places of c and ν of a contact among the algebraic variables.
#[derive(Clone, Copy, Debug)]
pub struct Kept {
    /// c, which no equation determines: its bounds give it.
    pub closed: usize,
    /// ν.
    pub multiplier: usize,
}

impl<'e> Dcs<'e> {
    /// The same with c and ν of every contact, behind all other algebraic variables.
    pub fn without_drift(&self, system: &System<'e>) -> (Self, Vec<Kept>) {
        let (mut dcs, exprs) = (self.clone(), self.exprs);
        let positions: Vec<usize> = (system.jumps.bodies.iter())
            .flat_map(|body| body.positions.iter().copied())
            .collect();
        let mut kept = Vec::new();
        for (impact, contact) in self.impacts.iter().zip(&system.jumps.contacts) {
            let first = dcs.algebraics.len();
            let [closed, multiplier] = ["closed", "drift"].map(|word| {
                let var = exprs.variable(&format!("{word}({})", impact.name));
                dcs.algebraics.push(Algebraic {
                    var,
                    guess: 0.0,
                    continuous: false,
                });
                var
            });
            for &i in &positions {
                let var = self.states[i].var.as_variable();
                let slope = contact.gap.diff(var.expect("a state is a variable"));
                if !slope.is_zero() {
                    dcs.rows.rates[i] = dcs.rows.rates[i] + slope * multiplier;
                }
            }
            let row = closed * impact.speed + (1.0 - closed) * multiplier;
            let origin = Origin {
                cause: Cause::Switch(contact.switch),
                continuous: false,
                span: contact.span,
            };
            dcs.equation(row, origin);
            kept.push(Kept {
                closed: first,
                multiplier: first + 1,
            });
        }
        (dcs, kept)
    }
}
