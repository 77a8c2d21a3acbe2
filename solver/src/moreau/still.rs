//! Bodies that stand still.
//!
//! A step is a function of positions, velocities, forces, masses and the laws of contacts. Where it has left an island of
//! bodies where they stood, the next one does the same for as long as none of these changes: its impulses are those of
//! the step before, and nothing is solved for. Another body that touches the island, a force that changes, and a contact
//! that opens, that time moves, or whose law changes make it be solved for again.

use super::rows::{Bodies, Contact, Linear};
use super::scene::Free;
use super::{Stepper, Velocities};

/// A speed below this share of what the free motion of a step changes speeds by is none.
const SLOW: f64 = 1e-12;
/// Positions that a step moves by less than this share of their size are where they were.
const STAYS: f64 = 1e-12;

/// What is known of bodies that stand still.
#[derive(Default)]
pub(super) struct Still {
    /// By body: whether it stands still in the present step.
    pub bodies: Vec<bool>,
    /// The contacts that were active in the last step.
    pub last: Linear,
    /// The place of a contact among these, where it is one of them.
    places: Vec<u32>,
    /// By body: whether the last step has left it where it stood.
    rested: Vec<bool>,
    /// Where the free motion of the last step led.
    free: Vec<f64>,
    /// By the first body of an island.
    moves: Vec<bool>,
}

impl Still {
    /// Forgets all steps.
    pub fn reset(&mut self, n_bodies: usize, n_contacts: usize) {
        self.bodies.clear();
        self.bodies.resize(n_bodies, false);
        self.rested.clone_from(&self.bodies);
        self.last.clear();
        self.places.clear();
        self.places.resize(n_contacts, 0);
    }

    /// Whether a contact is one of bodies that stand still.
    pub fn holds(&self, linear: &Linear, contact: &Contact, bodies: &Bodies) -> bool {
        self.bodies[body_of(linear, contact, bodies)]
    }

    /// Whether a contact acts as it did in the last step, and nothing but bodies moves it.
    fn is_known(&self, linear: &Linear, contact: &Contact) -> bool {
        let place = self.places[contact.contact as usize] as usize;
        let Some(last) = self.last.contacts.get(place) else {
            return false;
        };
        let laws = |c: &Contact| (c.contact, c.gap, c.friction, c.slip, c.is_rough);
        let same_row = |k: usize| {
            let (row, of_last) = (contact.normal + k, last.normal + k);
            linear.rows.entries(row) == self.last.rows.entries(of_last)
        };
        laws(last) == laws(contact)
            && !contact.is_driven
            && same_row(0)
            && (!contact.is_rough || same_row(1))
    }
}

/// A body of a contact.
fn body_of(linear: &Linear, contact: &Contact, bodies: &Bodies) -> usize {
    bodies.body_of(linear.rows.columns(contact.normal)[0] as usize)
}

impl<F: Free> Stepper<F> {
    /// Finds the bodies that stand still in a step whose active contacts are known, and whose free motion leads to y.
    pub(super) fn find_still(&mut self, y: &[f64], velocities: &Velocities) {
        let Self {
            still,
            energy,
            bodies,
            active,
            ..
        } = self;
        for (place, contact) in still.last.contacts.iter().enumerate() {
            still.places[contact.contact as usize] = place as u32;
        }
        still.moves.clear();
        still.moves.resize(bodies.n_bodies(), false);
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            let stood = &velocities.before[bodies.velocities_of(body)];
            let mut states = of_body.positions.iter().chain(&of_body.velocities);
            let rests = still.rested[body]
                && stood.iter().all(|v| *v == 0.0)
                && states.all(|&state| y[state] == still.free[state]);
            if !rests {
                still.moves[energy.island_of(body)] = true;
            }
        }
        for contact in &active.contacts {
            if !still.is_known(active, contact) {
                let island = energy.island_of(body_of(active, contact, bodies));
                still.moves[island] = true;
            }
        }
        for body in 0..bodies.n_bodies() {
            still.bodies[body] = !still.moves[energy.island_of(body)];
        }
        still.free.clear();
        still.free.extend_from_slice(y);
    }

    /// Leaves bodies that stand still where they are in x.
    pub(super) fn hold(&mut self, x: &[f64], y: &mut [f64], velocities: &mut Velocities) {
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            if self.still.bodies[body] {
                of_body.positions.iter().for_each(|&q| y[q] = x[q]);
                velocities.after[self.bodies.velocities_of(body)].fill(0.0);
                self.energy.hold(body, &self.bodies);
            }
        }
    }

    /// Finds the bodies that a step from x to y has left where they were but for rounding, and leaves them exactly
    /// there.
    pub(super) fn settle(&mut self, x: &[f64], y: &mut [f64], velocities: &mut Velocities) {
        let size = self.size(y);
        let Self {
            still,
            energy,
            bodies,
            ..
        } = self;
        let Velocities { before, after, .. } = velocities;
        still.moves.fill(false);
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            let has_moved = |&q: &usize| (y[q] - x[q]).abs() > STAYS * size;
            let square = |v: &[f64]| bodies.product(body, v, v);
            let most = SLOW * SLOW * square(energy.change());
            let moves = energy.is_driven(body)
                || of_body.positions.iter().any(has_moved)
                || square(before) > most
                || square(after) > most;
            if moves {
                still.moves[energy.island_of(body)] = true;
            }
        }
        // Only what stood is the start of a step like the next one.
        still.rested.fill(true);
        for body in 0..bodies.n_bodies() {
            let stood = before[bodies.velocities_of(body)].iter().all(|v| *v == 0.0);
            still.rested[energy.island_of(body)] &= stood;
        }
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            let island = energy.island_of(body);
            if !still.moves[island] {
                of_body.positions.iter().for_each(|&q| y[q] = x[q]);
                after[bodies.velocities_of(body)].fill(0.0);
            }
            // The first body of an island comes first.
            still.rested[body] = still.rested[island] && !still.moves[island];
        }
    }
}
