//! Islands at rest.
//!
//! The positions of the θ-method are q + h/2 (v + v⁺): bodies without velocity before and after a step stay where they
//! are. Their impulses have been found, so that forces balance, and every step asks again. The projection begins there,
//! and not at q̂, from which it would come back to a place that is close by and not the same. Of an island it is all
//! bodies or none: among bodies that stay, those that are at q̂ would push the others up for nothing.

use super::bodies::{Motion, Step};
use super::detect::Detector;
use super::energy::Energy;
use super::resolution::TOUCH;
use super::strike::{Impacts, SOLVED};

/// Which islands rest.
#[derive(Default)]
pub(super) struct Rest {
    /// By the first body of an island: whether it moves.
    moves: Vec<bool>,
}

impl Rest {
    /// Leaves islands at rest where they are in x: all speeds before and after the step are below what impulses are
    /// solved to, measured by what forces change them by, and what pushes is closed.
    pub fn leave(
        &mut self,
        Step { t, h, x }: Step,
        y: &mut [f64],
        motion: &mut Motion,
        impacts: &Impacts,
        detector: &mut Detector,
        energy: &mut Energy,
    ) {
        let (bodies, moves) = (&motion.bodies, &mut self.moves);
        let mass = &bodies.mass;
        moves.clear();
        moves.resize(mass.n_bodies(), false);
        for body in 0..mass.n_bodies() {
            let square = |v: &[f64]| mass.product(body, v, v);
            let most = SOLVED * SOLVED * square(&motion.change);
            let speed = square(&motion.before).max(square(&motion.after));
            moves[energy.island_of(body)] |= bodies.drifts(body) || speed > most;
        }
        detector.go_to(t + h, x);
        for (c, contact) in impacts.active.contacts.iter().enumerate() {
            let column = impacts.active.rows.columns(contact.rows.normal)[0] as usize;
            let island = energy.island_of(mass.body_of(column));
            // Contacts that push may still be open, by less than the free motion closes.
            if !moves[island] && impacts.ladder.impulses.normal[c] > 0.0 {
                let touch = contact.resolution.share(TOUCH);
                moves[island] = detector.gap_of(contact.contact) > touch;
            }
        }
        for body in 0..motion.bodies.mass.n_bodies() {
            if !self.moves[energy.island_of(body)] {
                motion.halt(body, x, y);
                energy.stay(body, motion);
            }
        }
    }
}
