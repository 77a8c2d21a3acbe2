//! A frictional contact problem of numbers, its solution and its residual.
//!
//! r = q + W p with p = (λ, -β) and r = (a, b), contacts first and behind them all entries of slip velocities. W need
//! not be symmetric: where J_t of the friction has μ in it, which is 1 then, D_t = M⁻¹J_tμ.

use crate::linalg::norm;
use std::ops::Range;

/// A force that changes its own rate by less than this share of its parts does not push.
const PUSH: f64 = 1e-12;

/// W, with the tangential dimensions of the contacts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Delassus {
    /// Where the entries of the slip velocities of each contact are among all, and their end.
    starts: Vec<usize>,
    /// W row by row.
    entries: Vec<f64>,
}

impl Delassus {
    /// W with these tangential dimensions and this entry (row, column).
    pub fn new(dims: impl Iterator<Item = usize>, entry: impl FnMut(usize, usize) -> f64) -> Self {
        let mut w = Delassus::default();
        w.fill(dims, entry);
        w
    }

    /// The same in the memory of another one.
    pub fn fill(
        &mut self,
        dims: impl Iterator<Item = usize>,
        mut entry: impl FnMut(usize, usize) -> f64,
    ) {
        self.starts.clear();
        self.starts.push(0);
        let mut end = 0;
        self.starts.extend(dims.map(|dim| {
            end += dim;
            end
        }));
        let size = self.size();
        self.entries.clear();
        for row in 0..size {
            self.entries
                .extend((0..size).map(|column| entry(row, column)));
        }
    }

    pub fn n_contacts(&self) -> usize {
        self.starts.len() - 1
    }

    /// Entries of all slip velocities.
    pub fn n_slips(&self) -> usize {
        self.starts[self.n_contacts()]
    }

    /// Rows and columns of W.
    pub fn size(&self) -> usize {
        self.n_contacts() + self.n_slips()
    }

    /// Where the entries of the slip velocity of a contact are among all.
    pub fn slips(&self, contact: usize) -> Range<usize> {
        self.starts[contact]..self.starts[contact + 1]
    }

    /// Their rows of W.
    pub fn slip_rows(&self, contact: usize) -> Range<usize> {
        let n = self.n_contacts();
        n + self.starts[contact]..n + self.starts[contact + 1]
    }

    pub fn row(&self, row: usize) -> &[f64] {
        let size = self.size();
        &self.entries[row * size..(row + 1) * size]
    }

    /// (W p)_row
    pub fn times(&self, row: usize, forces: &[f64]) -> f64 {
        let terms = self.row(row).iter().zip(forces);
        terms.map(|(w, p)| w * p).sum()
    }

    /// W_nn of a contact: what its rate is made of by its own λ.
    pub fn push(&self, contact: usize) -> f64 {
        self.row(contact)[contact]
    }

    /// The largest diagonal entry of W_tt of a contact.
    pub fn resistance(&self, contact: usize) -> f64 {
        let rows = self.slip_rows(contact);
        rows.fold(0.0, |most, t| f64::max(most, self.row(t)[t]))
    }

    /// W of some of its rows, one of the rows after the other.
    pub fn part(&self, rows: &[usize]) -> Vec<f64> {
        let of_row = |&row: &usize| rows.iter().map(move |&column| self.row(row)[column]);
        rows.iter().flat_map(of_row).collect()
    }
}

/// A frictional contact problem.
#[derive(Clone, Debug, Default)]
pub(crate) struct Problem {
    pub w: Delassus,
    /// μ of every contact.
    pub mu: Vec<f64>,
    /// λ₀ of every contact.
    pub least: Vec<f64>,
    /// The rates without forces.
    pub q: Vec<f64>,
}

/// Forces and the rates that they give, by contact and by entry of all slip velocities.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solution {
    /// λ.
    pub normal: Vec<f64>,
    /// β.
    pub tangential: Vec<f64>,
    /// a.
    pub rates: Vec<f64>,
    /// b.
    pub slips: Vec<f64>,
    /// Largest violation of the laws, relative to the size of q and of what λ₀ pushes with.
    pub residual: f64,
}

/// Why there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoSolution {
    /// The force of this contact does not push it open.
    Paradox(usize),
    /// The search found none.
    NotFound,
}

impl Problem {
    /// A problem without least forces.
    pub fn new(w: Delassus, mu: Vec<f64>, q: Vec<f64>) -> Self {
        let least = vec![0.0; w.n_contacts()];
        Problem { w, mu, least, q }
    }

    /// The same with forces measured in a unit for each contact, and rates in one for all.
    pub fn scaled(&self, units: &[f64], size: f64) -> Self {
        let w = &self.w;
        let mut unit_of = units.to_vec();
        for (contact, unit) in units.iter().enumerate() {
            unit_of.extend(w.slips(contact).map(|_| unit));
        }
        let dims = (0..w.n_contacts()).map(|i| w.slips(i).len());
        let least = self.least.iter().zip(units);
        Problem {
            w: Delassus::new(dims, |row, column| w.row(row)[column] * unit_of[column]),
            mu: self.mu.clone(),
            least: least.map(|(least, unit)| least / unit / size).collect(),
            q: self.q.iter().map(|rate| rate / size).collect(),
        }
    }

    /// Whether a force of this contact, with friction against slipping in this direction, or in any, pushes it open.
    pub fn pushes(&self, contact: usize, slip: &[f64]) -> bool {
        let drags = &self.w.row(contact)[self.w.slip_rows(contact)];
        let speed = norm(slip);
        let drag = match speed > 0.0 {
            true => {
                let terms = drags.iter().zip(slip);
                terms.map(|(drag, w)| drag * w).sum::<f64>() / speed
            }
            false => norm(drags),
        };
        let (push, drag) = (self.w.push(contact), self.mu[contact] * drag);
        push - drag > PUSH * (push.abs() + drag.abs())
    }

    /// The rate a of a contact, or b of an entry, with the forces p.
    pub fn rate(&self, row: usize, forces: &[f64]) -> f64 {
        self.q[row] + self.w.times(row, forces)
    }

    /// The solution with the forces p.
    pub fn solution(&self, forces: &[f64], residual: f64) -> Solution {
        let n = self.w.n_contacts();
        let rates = |rows: Range<usize>| rows.map(|row| self.rate(row, forces)).collect();
        Solution {
            normal: forces[..n].to_vec(),
            tangential: forces[n..].iter().map(|force| -force).collect(),
            rates: rates(0..n),
            slips: rates(n..forces.len()),
            residual,
        }
    }

    /// The largest violation of the laws by the forces p: |min(a, (λ - λ₀) W_nn)|, and |β - P(β + b/W_tt, μλ)| W_tt, where
    /// P is the nearest point of the disc. Infinite where a rate is no number.
    pub fn residual(&self, forces: &[f64]) -> f64 {
        let w = &self.w;
        if !(0..w.size()).all(|row| self.rate(row, forces).is_finite()) {
            return f64::INFINITY;
        }
        let mut residual = 0.0_f64;
        for i in 0..w.n_contacts() {
            let pair = self
                .rate(i, forces)
                .min((forces[i] - self.least[i]) * w.push(i));
            residual = residual.max(pair.abs());
            let (rows, resistance) = (w.slip_rows(i), w.resistance(i));
            if resistance <= 0.0 {
                continue;
            }
            let beyond = |t: usize| forces[t] - self.rate(t, forces) / resistance;
            let target: Vec<f64> = rows.clone().map(beyond).collect();
            let (radius, length) = (self.mu[i] * forces[i].max(0.0), norm(&target));
            let share = if length > radius {
                radius / length
            } else {
                1.0
            };
            let missing: Vec<f64> = (rows.zip(target))
                .map(|(t, target)| forces[t] - share * target)
                .collect();
            residual = residual.max(norm(&missing) * resistance);
        }
        residual
    }
}

/// The work Σ ½ p (r⁻ + r⁺) of impulses p between the rates before and after them, which is what they change the energy
/// of a mass M with W = J M⁻¹Jᵀ by.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Work {
    /// The energy that is gained.
    pub gain: f64,
    /// Σ |p r⁻|.
    pub exchanged: f64,
}

impl Work {
    /// Adds that of an impulse p between the rates before and after it.
    pub fn add(&mut self, impulse: f64, before: f64, after: f64) {
        self.gain += 0.5 * impulse * (before + after);
        self.exchanged += (impulse * before).abs();
    }
}
