//! Islands at rest.
//!
//! The positions of the θ-method are q + h/2 (v + v⁺): bodies without velocity before and after a step stay where they
//! are. Their impulses have been found, so that forces balance, and every step asks again. The projection begins there,
//! and not at q̂, from which it would come back to a place that is close by and not the same. Of an island it is all
//! bodies or none: among bodies that stay, those that are at q̂ would push the others up for nothing.

use super::scene::Free;
use super::{SOLVED, Stepper, TOUCH, Velocities};

impl<F: Free> Stepper<F> {
    /// Leaves islands at rest where they are in x: all speeds before and after the step are below what impulses are
    /// solved to, measured by what forces change them by, and what pushes is closed.
    pub(super) fn rest(
        &mut self,
        (t, h): (f64, f64),
        x: &[f64],
        y: &mut [f64],
        velocities: &mut Velocities,
    ) {
        let (bodies, energy, moves) = (&self.bodies, &mut self.energy, &mut self.moves);
        moves.clear();
        moves.resize(bodies.mass.n_bodies(), false);
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            let square = |v: &[f64]| bodies.mass.product(body, v, v);
            let most = SOLVED * SOLVED * square(energy.change());
            let speed = square(&velocities.before).max(square(&velocities.after));
            let drifts = of_body.positions.iter().any(|&q| bodies.drift[q] != 0.0);
            moves[energy.island_of(body)] |= drifts || speed > most;
        }
        let touch = TOUCH * self.size(x);
        self.set_memory(t + h, x);
        for c in 0..self.active.contacts.len() {
            let contact = self.active.contacts[c];
            let column = self.active.rows.columns(contact.rows.normal)[0] as usize;
            let island = self.energy.island_of(self.bodies.mass.body_of(column));
            // Contacts that push may still be open, by less than the free motion closes.
            if !self.moves[island] && self.impulses.impulses.normal[c] > 0.0 {
                self.moves[island] = self.gap_of(contact.contact) > touch;
            }
        }
        let (bodies, energy, moves) = (&self.bodies, &mut self.energy, &self.moves);
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            if !moves[energy.island_of(body)] {
                of_body.positions.iter().for_each(|&q| y[q] = x[q]);
                velocities.after[bodies.mass.velocities_of(body)].fill(0.0);
                energy.stay(body, bodies);
            }
        }
    }
}
