//! What contacts do to the energy of a step.
//!
//! The midpoint rule keeps ½vᵀMv + V for constant forces, f = M(v̂ - v)/h. Impulses change ½vᵀMv, and displacements w
//! change V by -fᵀw. Where a displacement costs more than the impulses of its island have taken, the velocities of
//! the island are scaled down by what is missing. Where they have too little, the island stays where the step began,
//! without velocity: V is what it was. That is what friction may ask for that stops a body within a step: impulses act
//! at the end of it, and q + h/2 (v + v⁺) is up to h² fᵀM⁻¹f/8 higher than the speed v could lift it. Without friction,
//! from gap(q) ≥ 0 that are convex, the projection q + d has dᵀM(d - h v - h²/2 M⁻¹f) ≤ 0, and costs -fᵀd ≤ ½vᵀMv.
//!
//! Contacts that time moves, or that slip on something driven, may do work; their islands are left alone.

use super::bodies::Motion;
use super::rows::{Contact, Linear};
use crate::contact::coulomb::islands::Islands;

/// A debt below this share of the kinetic energy is rounding.
const ROUNDING: f64 = 1e-15;
/// One that velocities cannot pay is left below this share of the kinetic energy without contacts.
const SMALL: f64 = 1e-10;

/// The account of a step.
#[derive(Default)]
pub(super) struct Energy {
    /// By body: work that displacements took.
    lifted: Vec<f64>,
    /// By body: whether a contact of it may do work.
    driven: Vec<bool>,
    /// Bodies that contacts join.
    joined: Islands,
    debts: Vec<Debt>,
    /// By body: whether it has been left where the step began.
    left: Vec<bool>,
}

/// The account of an island.
#[derive(Clone, Copy, Default)]
struct Debt {
    missing: f64,
    /// Kinetic energy after the step, and without contacts.
    kinetic: f64,
    free: f64,
    driven: bool,
    /// Whether positions move by themselves.
    drifts: bool,
}

impl Energy {
    /// Opens the account of a step.
    pub fn begin(&mut self, active: &Linear, motion: &Motion) {
        let mass = &motion.bodies.mass;
        let n = mass.n_bodies();
        self.lifted.clear();
        self.lifted.resize(n, 0.0);
        self.left.clear();
        self.left.resize(n, false);
        self.driven.clear();
        self.driven.resize(n, false);
        self.joined.begin(mass);
        self.join(active, motion, |contact| {
            contact.is_driven || contact.slip != [0.0; 2]
        });
    }

    /// Joins the bodies of contacts, of which some may do work.
    fn join(&mut self, contacts: &Linear, motion: &Motion, may_work: impl Fn(&Contact) -> bool) {
        let (rows, mass) = (&contacts.rows, &motion.bodies.mass);
        self.joined.join(rows, contacts.of_contacts(), mass);
        for contact in &contacts.contacts {
            let body = mass.body_of(rows.columns(contact.rows.normal)[0] as usize);
            self.driven[body] |= may_work(contact);
        }
    }

    /// The first body of the island that a body is in.
    pub fn island_of(&mut self, body: usize) -> usize {
        self.joined.of_body(body)
    }

    /// Books that a body without velocity has not moved: it is h/2 (v̂ - v) away from where it would be without
    /// contacts.
    pub fn stay(&mut self, body: usize, motion: &Motion) {
        let change = &motion.change;
        self.lifted[body] = 0.5 * motion.bodies.mass.product(body, change, change);
    }

    /// Books a displacement s h w of contacts.
    pub fn lift(&mut self, s: f64, w: &[f64], moved: &Linear, motion: &Motion) {
        self.join(moved, motion, |contact| contact.is_driven);
        for (body, lifted) in self.lifted.iter_mut().enumerate() {
            *lifted -= s * motion.bodies.mass.product(body, &motion.change, w);
        }
    }

    /// Leaves islands where they are in x, without velocity, whose velocities cannot pay for their displacements. True if
    /// there are any: the projection is repeated then, since others may have been moved to where these are.
    pub fn leave(&mut self, x: &[f64], y: &mut [f64], motion: &mut Motion) -> bool {
        self.balance(motion);
        let mut any = false;
        for body in 0..self.lifted.len() {
            let debt = self.debts[self.joined.of_body(body)];
            let pays = debt.missing <= debt.kinetic + SMALL * debt.free;
            if pays || debt.driven || debt.drifts || self.left[body] {
                continue;
            }
            any = true;
            self.left[body] = true;
            motion.halt(body, x, y);
            let energy_of = |v: &[f64]| 0.5 * motion.bodies.mass.product(body, v, v);
            self.lifted[body] = energy_of(&motion.free) - energy_of(&motion.before);
        }
        any
    }

    /// Takes from velocities what displacements cost more than impulses have taken.
    pub fn pay(&mut self, motion: &mut Motion) {
        for body in 0..self.lifted.len() {
            let debt = self.debts[self.joined.of_body(body)];
            let Debt {
                missing, kinetic, ..
            } = debt;
            if debt.driven || missing <= ROUNDING * kinetic || kinetic == 0.0 {
                continue;
            }
            let factor = (1.0 - missing / kinetic).max(0.0).sqrt();
            for v in motion.bodies.mass.velocities_of(body) {
                motion.after[v] *= factor;
            }
        }
    }

    /// Adds up the accounts of all islands, by their first body.
    fn balance(&mut self, motion: &Motion) {
        let bodies = &motion.bodies;
        self.debts.clear();
        self.debts.resize(self.lifted.len(), Debt::default());
        for body in 0..self.lifted.len() {
            let energy_of = |v: &[f64]| 0.5 * bodies.mass.product(body, v, v);
            let (free, after) = (energy_of(&motion.free), energy_of(&motion.after));
            let debt = &mut self.debts[self.joined.of_body(body)];
            debt.missing += self.lifted[body] + after - free;
            debt.kinetic += after;
            debt.free += free;
            debt.driven |= self.driven[body];
            debt.drifts |= bodies.drifts(body);
        }
    }
}
