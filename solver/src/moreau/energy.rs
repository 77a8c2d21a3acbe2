//! What contacts do to the energy of a step.
//!
//! The midpoint rule keeps ½vᵀMv + V for constant forces, f = M(v̂ - v)/h. Impulses change ½vᵀMv, and displacements w
//! change V by -fᵀw. Where a displacement costs more than the impulses of its island have taken, the velocities of
//! the island are scaled down by what is missing, in later steps where they have too little. Contacts that time moves,
//! or that slip on something driven, may do work; their islands are left alone.

use super::islands::Islands;
use super::rows::{Bodies, Linear, Rows};
use super::scene::Free;
use super::{Stepper, Velocities};

/// A debt below this share of the kinetic energy is rounding.
const ROUNDING: f64 = 1e-15;

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
    debts: Vec<[f64; 3]>,
    /// By body: what could not be paid in earlier steps.
    owed: Vec<f64>,
}

impl Energy {
    /// Forgets what is owed.
    pub fn reset(&mut self) {
        self.owed.clear();
    }

    /// Notes what the free motion of a step changes.
    pub fn observe(&mut self, velocities: &Velocities) {
        self.change.clear();
        let changes = velocities.free.iter().zip(&velocities.before);
        self.change
            .extend(changes.map(|(free, before)| free - before));
    }

    /// Opens the account of a step that was observed.
    pub fn begin(&mut self, bodies: &Bodies, active: &Linear) {
        let n = bodies.n_bodies();
        self.lifted.clear();
        self.lifted.resize(n, 0.0);
        self.owed.resize(n, 0.0);
        self.driven.clear();
        self.driven.resize(n, false);
        self.joined.begin(bodies);
        self.joined.join(active, bodies);
        for contact in &active.contacts {
            let body = bodies.body_of(active.rows.columns(contact.normal)[0] as usize);
            self.driven[body] |= contact.is_driven || contact.slip != 0.0;
        }
    }

    /// The most that the free motion of a step changes a rate by, had it the direction of this row:
    /// (J D)^½ (Δvᵀ M Δv)^½ of its bodies, or |J| |Δv|, which is less where masses are far apart.
    pub fn gain(&self, bodies: &Bodies, rows: &Rows, row: usize) -> f64 {
        let (mut last, mut sum, mut square) = (usize::MAX, 0.0, 0.0);
        for &column in rows.columns(row) {
            let body = bodies.body_of(column as usize);
            if body != last {
                let change = &self.change[bodies.velocities_of(body)];
                square += change.iter().map(|v| v * v).sum::<f64>();
                sum += bodies.product(body, &self.change, &self.change);
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
        self.lifted[body] = 0.5 * bodies.product(body, &self.change, &self.change);
    }

    /// Books a displacement s w of contacts, which are joined.
    pub fn lift(&mut self, (s, h): (f64, f64), w: &[f64], moved: &Linear, bodies: &Bodies) {
        self.joined.join(moved, bodies);
        for contact in &moved.contacts {
            let body = bodies.body_of(moved.rows.columns(contact.normal)[0] as usize);
            self.driven[body] |= contact.is_driven;
        }
        for (body, lifted) in self.lifted.iter_mut().enumerate() {
            *lifted -= s / h * bodies.product(body, &self.change, w);
        }
    }
}

impl<F: Free> Stepper<F> {
    /// Takes from velocities what displacements cost more than impulses have taken.
    pub(super) fn pay(&mut self, velocities: &mut Velocities) {
        let (energy, bodies) = (&mut self.energy, &self.bodies);
        let n = bodies.n_bodies();
        // By the first body of an island: what is missing, the kinetic energy, and whether something is driven.
        energy.debts.clear();
        energy.debts.resize(n, [0.0; 3]);
        for body in 0..n {
            let island = energy.joined.of_body(body);
            let energy_of = |v: &[f64]| 0.5 * bodies.product(body, v, v);
            let before = energy_of(&velocities.free);
            let after = energy_of(&velocities.after);
            let [missing, kinetic, driven] = &mut energy.debts[island];
            *missing += energy.lifted[body] + after - before + energy.owed[body];
            *kinetic += after;
            *driven += f64::from(u8::from(energy.driven[body]));
        }
        energy.owed.fill(0.0);
        for body in 0..n {
            let island = energy.joined.of_body(body);
            let [missing, kinetic, driven] = energy.debts[island];
            if body == island && driven == 0.0 {
                energy.owed[body] = (missing - kinetic).max(0.0);
            }
            if driven > 0.0 || missing <= ROUNDING * kinetic || kinetic == 0.0 {
                continue;
            }
            let factor = (1.0 - missing / kinetic).max(0.0).sqrt();
            for v in bodies.velocities_of(body) {
                velocities.after[v] *= factor;
            }
        }
    }
}
