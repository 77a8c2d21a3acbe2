//! The contact problem of an island: contacts that act on each other through bodies, with W = J D in factors.
//!
//! v⁺ = v + D_n Λ - D_t β,   0 ≤ Λ ⟂ a = J_n v⁺ + c ≥ 0,   β ∈ μΛ ∂|b|,   b = J_t v⁺ + s.

use super::law;
use super::law::{Cone, Pair};
use super::rows::{ContactRows, Rows};

/// The laws of contacts: c, s and μ, and the diagonal of W.
#[derive(Default)]
pub(crate) struct Laws {
    pub normal_rate: Vec<f64>,
    pub slip_rate: Vec<Pair>,
    pub friction: Vec<f64>,
    contacts: Vec<ContactRows>,
    /// W_nn of every contact, and the largest value of its W_tt.
    diagonals: Vec<[f64; 2]>,
    /// Of contacts with two entries, and by contact which of these would be the next.
    cones: Vec<Cone>,
    cone_of: Vec<u32>,
}

/// Λ and β of contacts.
#[derive(Default)]
pub(crate) struct Impulses {
    pub normal: Vec<f64>,
    pub tangential: Vec<Pair>,
}

/// An island of the problem: the numbers of its contacts among all.
#[derive(Clone, Copy)]
pub(crate) struct Island<'p> {
    pub rows: &'p Rows,
    pub laws: &'p Laws,
    pub members: &'p [u32],
}

/// Impulses, and the velocities with them.
pub(crate) struct Motion<'m> {
    pub impulses: &'m mut Impulses,
    pub v: &'m mut [f64],
}

impl Laws {
    /// Takes these contacts, with c, s and μ zero.
    pub fn begin(&mut self, rows: &Rows, contacts: impl Iterator<Item = ContactRows>) {
        self.contacts.clear();
        self.contacts.extend(contacts);
        let n = self.contacts.len();
        for values in [&mut self.normal_rate, &mut self.friction] {
            values.clear();
            values.resize(n, 0.0);
        }
        self.slip_rate.clear();
        self.slip_rate.resize(n, [0.0; 2]);
        self.diagonals.clear();
        self.cones.clear();
        self.cone_of.clear();
        for contact in &self.contacts {
            self.cone_of.push(self.cones.len() as u32);
            let tangential = match contact.slips {
                0 => 0.0,
                1 => rows.diagonal(contact.normal + 1),
                _ => {
                    let cone = Cone::of(rows, contact);
                    self.cones.push(cone);
                    cone.most()
                }
            };
            self.diagonals
                .push([rows.diagonal(contact.normal), tangential]);
        }
    }

    pub fn contacts(&self) -> &[ContactRows] {
        &self.contacts
    }
}

impl Impulses {
    /// No impulses of so many contacts.
    pub fn begin(&mut self, n: usize) {
        self.normal.clear();
        self.normal.resize(n, 0.0);
        self.tangential.clear();
        self.tangential.resize(n, [0.0; 2]);
    }
}

impl<'p> Island<'p> {
    /// (number, rows) of its contacts.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (usize, &'p ContactRows)> + use<'p> {
        let contacts = &self.laws.contacts;
        self.members
            .iter()
            .map(move |&c| (c as usize, &contacts[c as usize]))
    }

    /// W_nn, and the largest value of W_tt.
    pub fn diagonal(&self, c: usize) -> [f64; 2] {
        self.laws.diagonals[c]
    }

    /// W of a contact with two entries.
    pub fn cone(&self, c: usize) -> Cone {
        self.laws.cones[self.laws.cone_of[c] as usize]
    }

    /// Whether some contact has friction in two directions.
    pub fn has_cones(&self) -> bool {
        self.iter().any(|(_, contact)| contact.is_conic())
    }

    /// a = J_n v + c
    pub fn rate(&self, c: usize, v: &[f64]) -> f64 {
        self.rows.rate(self.laws.contacts[c].normal, v) + self.laws.normal_rate[c]
    }

    /// b = J_t v + s
    pub fn slip(&self, c: usize, v: &[f64]) -> Pair {
        let [x, y] = self.rows.slip(&self.laws.contacts[c], v);
        let [a, b] = self.laws.slip_rate[c];
        [x + a, y + b]
    }

    /// How much the laws are violated without impulses; NaN where the rate of a gap is.
    pub fn scale(&self, v: &[f64]) -> f64 {
        let mut scale = 0.0_f64;
        for (c, _) in self.iter() {
            let rate = self.rate(c, v);
            if rate.is_nan() {
                return rate;
            }
            scale = scale.max(-rate);
        }
        if scale > 0.0 {
            for (c, _) in self.iter().filter(|(_, contact)| contact.is_rough()) {
                scale = scale.max(law::length(self.slip(c, v)));
            }
        }
        scale
    }
}

impl Motion<'_> {
    /// Changes Λ of a contact, and the velocities with it.
    pub fn set_normal(&mut self, island: &Island, c: usize, next: f64) {
        let present = std::mem::replace(&mut self.impulses.normal[c], next);
        let row = island.laws.contacts[c].normal;
        island.rows.add_impulse(row, next - present, self.v);
    }

    /// Changes β of a contact, and the velocities with it.
    pub fn set_tangential(&mut self, island: &Island, c: usize, next: Pair) {
        let beta = std::mem::replace(&mut self.impulses.tangential[c], next);
        let contact = &island.laws.contacts[c];
        island
            .rows
            .add_friction(contact, [next[0] - beta[0], next[1] - beta[1]], self.v);
    }

    /// Takes all impulses of the island away.
    pub fn clear(&mut self, island: &Island) {
        for (c, _) in island.iter() {
            self.set_normal(island, c, 0.0);
            self.set_tangential(island, c, [0.0; 2]);
        }
    }

    /// Λ - a/W_nn, which is positive where a contact pushes.
    pub fn trial_normal(&self, island: &Island, c: usize) -> f64 {
        self.impulses.normal[c] - island.rate(c, self.v) / island.diagonal(c)[0]
    }

    /// β + b/W_tt: the friction that would stop a contact, if its diagonal were all that acts.
    pub fn trial_friction(&self, island: &Island, c: usize) -> Pair {
        let [x, y] = island.slip(c, self.v);
        let ([a, b], [_, tangential]) = (self.impulses.tangential[c], island.diagonal(c));
        [a + x / tangential, b + y / tangential]
    }

    /// Largest |min(Λ W_nn, a)|, and the same for friction; NaN where one of them is no number.
    pub fn residual(&self, island: &Island) -> f64 {
        let mut residual = 0.0_f64;
        for (c, contact) in island.iter() {
            let ([normal, tangential], impulse) = (island.diagonal(c), self.impulses.normal[c]);
            let rate = island.rate(c, self.v);
            if !(rate + impulse).is_finite() {
                return f64::NAN;
            }
            residual = residual.max(rate.min(impulse * normal).abs());
            if contact.is_rough() && tangential > 0.0 {
                let most = island.laws.friction[c] * impulse.max(0.0);
                let beta = self.impulses.tangential[c];
                let wanted = law::bounded(self.trial_friction(island, c), most);
                let missing = law::length([wanted[0] - beta[0], wanted[1] - beta[1]]);
                if !missing.is_finite() {
                    return f64::NAN;
                }
                residual = residual.max(missing * tangential);
            }
        }
        residual
    }
}

/// Impulses of an island and the velocities that they change, kept while a solver tries others.
#[derive(Default)]
pub(crate) struct Kept {
    normal: Vec<f64>,
    tangential: Vec<Pair>,
    velocities: Vec<f64>,
}

impl Kept {
    pub fn save(&mut self, island: &Island, motion: &Motion) {
        self.normal.clear();
        self.tangential.clear();
        self.velocities.clear();
        for (c, contact) in island.iter() {
            self.normal.push(motion.impulses.normal[c]);
            self.tangential.push(motion.impulses.tangential[c]);
            let columns = island.rows.columns_of(contact).iter();
            self.velocities
                .extend(columns.map(|&column| motion.v[column as usize]));
        }
    }

    pub fn restore(&self, island: &Island, motion: &mut Motion) {
        let impulses = self.normal.iter().zip(&self.tangential);
        let mut velocities = self.velocities.iter();
        for ((c, contact), (normal, tangential)) in island.iter().zip(impulses) {
            motion.impulses.normal[c] = *normal;
            motion.impulses.tangential[c] = *tangential;
            let columns = island.rows.columns_of(contact).iter();
            for (&column, value) in columns.zip(&mut velocities) {
                motion.v[column as usize] = *value;
            }
        }
    }
}
