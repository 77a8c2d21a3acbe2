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

use super::rows::{Bodies, Linear};
use super::scene::Free;
use super::{Stepper, Velocities};
use crate::contact::coulomb::islands::Islands;
use crate::contact::coulomb::rows::Rows;

/// A debt below this share of the kinetic energy is rounding.
const ROUNDING: f64 = 1e-15;
/// One that velocities cannot pay, below this share of what impulses have taken.
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
    change: Vec<f64>,
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
    /// Notes what the free motion of a step changes.
    pub fn observe(&mut self, velocities: &Velocities) {
        self.change.clear();
        let changes = velocities.free.iter().zip(&velocities.before);
        self.change
            .extend(changes.map(|(free, before)| free - before));
    }

    /// Opens the account of a step that was observed.
    pub fn begin(&mut self, bodies: &Bodies, active: &Linear) {
        let n = bodies.mass.n_bodies();
        self.lifted.clear();
        self.lifted.resize(n, 0.0);
        self.left.clear();
        self.left.resize(n, false);
        self.driven.clear();
        self.driven.resize(n, false);
        self.joined.begin(&bodies.mass);
        self.joined
            .join(&active.rows, active.of_contacts(), &bodies.mass);
        for contact in &active.contacts {
            let body = bodies
                .mass
                .body_of(active.rows.columns(contact.rows.normal)[0] as usize);
            self.driven[body] |= contact.is_driven || contact.slip != [0.0; 2];
        }
    }

    /// The most that the free motion of a step changes a rate by, had it the direction of this row:
    /// (J D)^½ (Δvᵀ M Δv)^½ of its bodies, or |J| |Δv|, which is less where masses are far apart.
    pub fn gain(&self, bodies: &Bodies, rows: &Rows, row: usize) -> f64 {
        let (mut last, mut sum, mut square) = (usize::MAX, 0.0, 0.0);
        for &column in rows.columns(row) {
            let body = bodies.mass.body_of(column as usize);
            if body != last {
                let change = &self.change[bodies.mass.velocities_of(body)];
                square += change.iter().map(|v| v * v).sum::<f64>();
                sum += bodies.mass.product(body, &self.change, &self.change);
                last = body;
            }
        }
        (rows.diagonal(row) * sum)
            .min(rows.square(row) * square)
            .sqrt()
    }

    /// The first body of the island that a body is in.
    pub fn island_of(&mut self, body: usize) -> usize {
        self.joined.of_body(body)
    }

    /// v̂ - v of the step.
    pub fn change(&self) -> &[f64] {
        &self.change
    }

    /// Books that a body without velocity has not moved: it is h/2 (v̂ - v) away from where it would be without
    /// contacts.
    pub fn stay(&mut self, body: usize, bodies: &Bodies) {
        self.lifted[body] = 0.5 * bodies.mass.product(body, &self.change, &self.change);
    }

    /// Books a displacement s w of contacts, which are joined.
    pub fn lift(&mut self, (s, h): (f64, f64), w: &[f64], moved: &Linear, bodies: &Bodies) {
        self.joined
            .join(&moved.rows, moved.of_contacts(), &bodies.mass);
        for contact in &moved.contacts {
            let body = bodies
                .mass
                .body_of(moved.rows.columns(contact.rows.normal)[0] as usize);
            self.driven[body] |= contact.is_driven;
        }
        for (body, lifted) in self.lifted.iter_mut().enumerate() {
            *lifted -= s / h * bodies.mass.product(body, &self.change, w);
        }
    }
}

impl<F: Free> Stepper<F> {
    /// Leaves islands where they are in x whose velocities cannot pay for their displacements. Whether there are any:
    /// others may have come where they were.
    pub(super) fn leave(&mut self, x: &[f64], y: &mut [f64], velocities: &mut Velocities) -> bool {
        self.balance(velocities);
        let (energy, bodies) = (&mut self.energy, &self.bodies);
        let mut any = false;
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            let debt = energy.debts[energy.joined.of_body(body)];
            let pays = debt.missing <= debt.kinetic + SMALL * debt.free;
            if pays || debt.driven || debt.drifts || energy.left[body] {
                continue;
            }
            any = true;
            energy.left[body] = true;
            of_body.positions.iter().for_each(|&q| y[q] = x[q]);
            velocities.after[bodies.mass.velocities_of(body)].fill(0.0);
            let energy_of = |v: &[f64]| 0.5 * bodies.mass.product(body, v, v);
            energy.lifted[body] = energy_of(&velocities.free) - energy_of(&velocities.before);
        }
        any
    }

    /// Takes from velocities what displacements cost more than impulses have taken.
    pub(super) fn pay(&mut self, velocities: &mut Velocities) {
        let (energy, bodies) = (&mut self.energy, &self.bodies);
        for body in 0..bodies.mass.n_bodies() {
            let debt = energy.debts[energy.joined.of_body(body)];
            let Debt {
                missing, kinetic, ..
            } = debt;
            if debt.driven || missing <= ROUNDING * kinetic || kinetic == 0.0 {
                continue;
            }
            let factor = (1.0 - missing / kinetic).max(0.0).sqrt();
            for v in bodies.mass.velocities_of(body) {
                velocities.after[v] *= factor;
            }
        }
    }

    /// Adds up the accounts of all islands, by their first body.
    fn balance(&mut self, velocities: &Velocities) {
        let (energy, bodies) = (&mut self.energy, &self.bodies);
        energy.debts.clear();
        energy.debts.resize(bodies.mass.n_bodies(), Debt::default());
        for (body, of_body) in self.scene.bodies.iter().enumerate() {
            let island = energy.joined.of_body(body);
            let energy_of = |v: &[f64]| 0.5 * bodies.mass.product(body, v, v);
            let (free, after) = (energy_of(&velocities.free), energy_of(&velocities.after));
            let debt = &mut energy.debts[island];
            debt.missing += energy.lifted[body] + after - free;
            debt.kinetic += after;
            debt.free += free;
            let drifts = of_body.positions.iter().any(|&q| bodies.drift[q] != 0.0);
            debt.driven |= energy.driven[body];
            debt.drifts |= drifts;
        }
    }
}
