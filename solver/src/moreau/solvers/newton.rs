//! All laws of an island at once, by Newton's method.
//!
//! With Λ̂ = Λ - (J_n v + c)/W_nn and β̂ = β + (J_t v + s)/W_tt, W = J D, contacts with Λ̂ > 0 push and have
//!
//! J_n v⁺ + c = 0,   and J_t v⁺ + s = 0 where |β̂| ≤ μΛ̂, else β = μΛ β̂/|β̂|;
//!
//! all others have neither impulse. Each is linearized where it is differentiable (Alart & Curnier 1991, *A mixed
//! formulation for frictional contact problems prone to Newton like solution methods*). A step is halved while it leaves
//! more than there was.

use crate::linalg::DenseLu;
use crate::moreau::impulse::{Impulses, Island};
use crate::moreau::rows::{Pair, Rows};

/// Unknowns up to which it is worth its matrix.
const MOST: usize = 300;
/// Halvings of a step.
const HALVINGS: usize = 5;
/// Added to the diagonal of contacts that push and of those that stick, relative to it, since they may depend on each
/// other.
const SHARE: f64 = 1e-12;

/// Memory for such systems.
#[derive(Default)]
pub(crate) struct Newton {
    /// Places of the contacts that push, with the first of their unknowns.
    pushing: Vec<(u32, usize)>,
    /// The row of every unknown, and how its impulse acts: friction acts against it.
    rows: Vec<(usize, f64)>,
    matrix: Vec<f64>,
    rhs: Vec<f64>,
    before: Vec<(f64, Pair)>,
}

impl Newton {
    /// One step; false where there is none, or there are too many unknowns.
    pub fn solve(&mut self, island: &Island, impulses: &mut Impulses, v: &mut [f64]) -> bool {
        let residual = impulses.residual_of(island, v);
        self.choose(island, impulses, v);
        let n = self.rows.len();
        if n == 0 || n > MOST {
            return false;
        }
        self.linearize(island, impulses, v);
        let mut lu = DenseLu::new(n);
        if lu.factor(&self.matrix).is_err() {
            return false;
        }
        lu.solve(&mut self.rhs);
        if !self.rhs.iter().all(|z| z.is_finite()) {
            return false;
        }
        let contacts = &island.linear.contacts;
        self.before.clear();
        let present = |&(c, _): &(u32, usize)| {
            let c = c as usize;
            (impulses.normal[c], impulses.tangential[c])
        };
        self.before.extend(self.pushing.iter().map(present));
        let mut share = 1.0;
        for halving in 0..=HALVINGS {
            for (&(c, first), &(normal, beta)) in self.pushing.iter().zip(&self.before) {
                let (c, contact) = (c as usize, &contacts[c as usize]);
                let rows = &island.linear.rows;
                let next = normal + share * self.rhs[first];
                rows.push_by(contact.normal, next - impulses.normal[c], v);
                impulses.normal[c] = next;
                let mut rubs = beta;
                for (k, rubs) in rubs.iter_mut().take(contact.slips).enumerate() {
                    *rubs += share * self.rhs[first + 1 + k];
                }
                impulses.rub_to(rows, c, contact, rubs, v);
            }
            if halving == HALVINGS || impulses.residual_of(island, v) < residual {
                break;
            }
            share *= 0.5;
        }
        true
    }

    /// Takes the impulses of all contacts away that do not push.
    fn choose(&mut self, island: &Island, impulses: &mut Impulses, v: &mut [f64]) {
        let rows = &island.linear.rows;
        self.pushing.clear();
        self.rows.clear();
        for (c, contact) in island.iter() {
            let rate = rows.rate(contact.normal, v) + impulses.normal_rate[c];
            if impulses.normal[c] - rate / impulses.diagonal(c)[0] > 0.0 {
                self.pushing.push((c as u32, self.rows.len()));
                self.rows.push((contact.normal, 1.0));
                self.rows.extend(contact.slip_rows().map(|row| (row, -1.0)));
            }
        }
        let mut pushing = self.pushing.iter().peekable();
        for (c, contact) in island.iter() {
            if pushing.next_if(|(at, _)| *at as usize == c).is_none() {
                rows.push_by(contact.normal, -impulses.normal[c], v);
                impulses.normal[c] = 0.0;
                impulses.rub_to(rows, c, contact, [0.0; 2], v);
            }
        }
    }

    /// The linear system for the changes of Λ and β of the contacts that push.
    fn linearize(&mut self, island: &Island, impulses: &Impulses, v: &[f64]) {
        let rows = &island.linear.rows;
        let n = self.rows.len();
        self.matrix.clear();
        self.matrix.resize(n * n, 0.0);
        self.rhs.clear();
        self.rhs.resize(n, 0.0);
        for p in 0..self.pushing.len() {
            let (c, first) = self.pushing[p];
            let (c, contact) = (c as usize, &island.linear.contacts[c as usize]);
            let [normal, tangential] = impulses.diagonal(c);
            let rate = rows.rate(contact.normal, v) + impulses.normal_rate[c];
            self.rhs[first] = -rate;
            self.add(rows, first, first, 1.0);
            self.matrix[first * n + first] *= 1.0 + SHARE;
            if contact.slips == 0 {
                continue;
            }
            let (slip, beta) = (impulses.slip(rows, c, contact, v), impulses.tangential[c]);
            if tangential == 0.0 {
                for k in first + 1..=first + contact.slips {
                    self.matrix[k * n + k] = 1.0;
                }
                continue;
            }
            let most = impulses.friction[c] * (impulses.normal[c] - rate / normal);
            let stopping = impulses.stopping(rows, c, contact, v);
            let length = stopping[0].hypot(stopping[1]);
            if length <= most {
                for (k, slip) in slip.iter().enumerate().take(contact.slips) {
                    let row = first + 1 + k;
                    self.rhs[row] = -slip;
                    self.add(rows, row, row, 1.0);
                    self.matrix[row * n + row] -= SHARE * tangential;
                }
                continue;
            }
            let along = stopping.map(|entry| entry / length);
            let share = most / length;
            for k in 0..contact.slips {
                let row = first + 1 + k;
                let bound = impulses.friction[c] * along[k];
                self.rhs[row] = bound * impulses.normal[c] - beta[k];
                self.matrix[row * n + first] -= bound;
                self.matrix[row * n + row] += 1.0;
                // What turns the direction.
                for l in 0..contact.slips {
                    let across = f64::from(u8::from(k == l)) - along[k] * along[l];
                    let weight = share * across;
                    self.matrix[row * n + first + 1 + l] -= weight;
                    self.add(rows, row, first + 1 + l, -weight / tangential);
                }
            }
        }
    }

    /// Adds the change of what an unknown's row is, times a weight, to a row of the matrix.
    fn add(&mut self, rows: &Rows, row: usize, of: usize, weight: f64) {
        if weight == 0.0 {
            return;
        }
        let n = self.rows.len();
        for (unknown, &(other, sign)) in self.rows.iter().enumerate() {
            let entry = rows.coupling(self.rows[of].0, other);
            self.matrix[row * n + unknown] += weight * sign * entry;
        }
    }
}
