//! Contacts that meet: which forces, or impulses, keep them from passing each other.
//!
//! Rates change by D λ - T β, where D = M⁻¹J_n and T = M⁻¹J_t μ over the contacts, β = λ s with s in sign(w) of
//! the slip velocities w. With the rates a of what must not be negative and b of what friction resists,
//!
//! a = a₀ + J_nᵀ(D λ - T β) ⟂ λ,   β ∈ λ sign(b),   b = b₀ + J_tᵀ(D λ - T β),
//!
//! is Coulomb's law both for forces, with accelerations a and b, and for impulses, with velocities after an
//! impact. Written with β = β⁺ - β⁻ and γ = |b| it is the linear complementarity problem of Stewart & Trinkle 1996
//! in the plane,
//!
//! a ⟂ λ,   γ - b ⟂ β⁺,   γ + b ⟂ β⁻,   λ - β⁺ - β⁻ ⟂ γ.
//!
//! Forces in the rates are those of x' = f + (1 - α_n)(D - (2α_t - 1) T), so that ∂f/∂α_n = -D at α_t = ½ and
//! ∂f/∂α_t = -2T at α_n = 0. A contact that slips has no β: its force is D - T or D + T.

use super::mode::Mode;
use super::select::BAND;
use crate::lcp;

/// Contacts with their switches, and the matrices of the problem.
pub(super) struct Meeting {
    /// (switch of the gap, switch of the slip velocity where it is zero or may become so).
    pub contacts: Vec<(usize, Option<usize>)>,
    /// J_nᵀD, J_nᵀT, J_tᵀD and J_tᵀT, row by row.
    blocks: [Vec<f64>; 4],
}

/// A solution, by contact.
pub(super) struct Forces {
    /// λ.
    pub normal: Vec<f64>,
    /// β.
    pub friction: Vec<f64>,
    /// a.
    pub rates: Vec<f64>,
    /// b.
    pub slips: Vec<f64>,
    /// Largest |min| over all complementary pairs, relative to the size of the rates.
    pub residual: f64,
}

/// Why there is none.
pub(super) enum NoForces {
    /// The force of this contact does not push it open.
    Paradox(usize),
    /// The search found none.
    NotFound,
}

impl Mode {
    /// `linearize`, and ∂f/∂α of all other rates that have these α: impulses move what gaps do not depend on, too,
    /// where a mass joins them.
    pub(super) fn linearize_impulses(&mut self, switches: &[usize]) {
        self.linearize(switches);
        for &switch in switches {
            for at in 0..self.field.of_switch(switch).len() {
                let block = self.field.of_switch(switch)[at];
                self.field.linearize_block(block, &self.memory.values);
            }
        }
    }
}

impl Meeting {
    /// Reads the directions of forces off a mode that was linearized at α_n = 0 and α_t = ½.
    pub(super) fn of(mode: &Mode, contacts: Vec<(usize, Option<usize>)>) -> Self {
        let n = contacts.len();
        let mut blocks = [const { Vec::new() }; 4];
        for block in &mut blocks {
            block.resize(n * n, 0.0);
        }
        let effect = |of: Option<usize>, by: Option<usize>, share: f64| match (of, by) {
            (Some(of), Some(by)) => -share * mode.coupling(of, by),
            _ => 0.0,
        };
        for (i, &(normal, slip)) in contacts.iter().enumerate() {
            for (k, &(by_normal, by_slip)) in contacts.iter().enumerate() {
                let at = i * n + k;
                blocks[0][at] = effect(Some(normal), Some(by_normal), 1.0);
                blocks[1][at] = effect(Some(normal), by_slip, 0.5);
                blocks[2][at] = effect(slip, Some(by_normal), 1.0);
                blocks[3][at] = effect(slip, by_slip, 0.5);
            }
        }
        Meeting { contacts, blocks }
    }

    /// Σ_k block_ik v_k
    fn times(&self, block: usize, row: usize, v: &[f64]) -> f64 {
        let n = self.contacts.len();
        let row = &self.blocks[block][row * n..(row + 1) * n];
        row.iter().zip(v).map(|(entry, v)| entry * v).sum()
    }

    /// Whether a force of this contact, with friction against slipping in this direction, pushes it open.
    fn pushes(&self, contact: usize, direction: f64) -> bool {
        let at = contact * self.contacts.len() + contact;
        let (push, drag) = (self.blocks[0][at], direction * self.blocks[1][at]);
        push - drag > BAND * (push.abs() + drag.abs())
    }

    /// λ and β for the rates `a` and `b` without forces. `slips` are slip velocities before: friction has their
    /// directions, and where it stops them or they vanish it may have either.
    pub(super) fn solve(&self, a: &[f64], b: &[f64], slips: &[f64]) -> Result<Forces, NoForces> {
        let n = self.contacts.len();
        let [nn, nt, tn, tt] = &self.blocks;
        for (i, &slip) in slips.iter().enumerate() {
            let either = slip == 0.0;
            let positive = (slip > 0.0 || either).then_some(1.0);
            let negative = (slip < 0.0 || either).then_some(-1.0);
            let mut directions = positive.into_iter().chain(negative);
            if !directions.all(|direction| self.pushes(i, direction)) {
                return Err(NoForces::Paradox(i));
            }
        }
        let rough: Vec<usize> = (0..n).filter(|&i| self.contacts[i].1.is_some()).collect();
        let m = rough.len();
        let size = n + 3 * m;
        let (mut matrix, mut q) = (vec![0.0; size * size], vec![0.0; size]);
        // Rates of one size, with γ measured as b is: λ is scaled by its own push.
        let unit: Vec<f64> = (0..n).map(|i| 1.0 / nn[i * n + i]).collect();
        let mut set = |row: usize, column: usize, value: f64| matrix[row * size + column] = value;
        for i in 0..n {
            q[i] = a[i];
            for k in 0..n {
                set(i, k, nn[i * n + k] * unit[k]);
            }
            for (r, &k) in rough.iter().enumerate() {
                set(i, n + r, -nt[i * n + k] * unit[k]);
                set(i, n + m + r, nt[i * n + k] * unit[k]);
            }
        }
        for (r, &i) in rough.iter().enumerate() {
            (q[n + r], q[n + m + r]) = (-b[i], b[i]);
            for k in 0..n {
                set(n + r, k, -tn[i * n + k] * unit[k]);
                set(n + m + r, k, tn[i * n + k] * unit[k]);
            }
            for (c, &k) in rough.iter().enumerate() {
                let entry = tt[i * n + k] * unit[k];
                set(n + r, n + c, entry);
                set(n + r, n + m + c, -entry);
                set(n + m + r, n + c, -entry);
                set(n + m + r, n + m + c, entry);
            }
            set(n + r, n + 2 * m + r, 1.0);
            set(n + m + r, n + 2 * m + r, 1.0);
            set(n + 2 * m + r, i, 1.0);
            set(n + 2 * m + r, n + r, -1.0);
            set(n + 2 * m + r, n + m + r, -1.0);
        }
        let scale = a.iter().chain(b).fold(0.0_f64, |s, v| s.max(v.abs()));
        if scale > 0.0 {
            q.iter_mut().for_each(|q| *q /= scale);
        }
        let z = lcp::lemke(&matrix, &q, &vec![1.0; size]).map_err(|_| NoForces::NotFound)?;
        let mut residual = 0.0_f64;
        for row in 0..size {
            let terms = z.iter().zip(&matrix[row * size..]).map(|(z, m)| z * m);
            let w = q[row] + terms.sum::<f64>();
            residual = residual.max(w.min(z[row]).abs());
        }
        let normal: Vec<f64> = (0..n).map(|i| scale * unit[i] * z[i]).collect();
        let mut friction = vec![0.0; n];
        for (r, &i) in rough.iter().enumerate() {
            friction[i] = scale * unit[i] * (z[n + r] - z[n + m + r]);
        }
        let turns =
            |i: usize| slips[i] * friction[i] < 0.0 && !self.pushes(i, friction[i].signum());
        if let Some(i) = (0..n).find(|&i| turns(i)) {
            return Err(NoForces::Paradox(i));
        }
        let rates = (0..n)
            .map(|i| a[i] + self.times(0, i, &normal) - self.times(1, i, &friction))
            .collect();
        let slips = (0..n)
            .map(|i| b[i] + self.times(2, i, &normal) - self.times(3, i, &friction))
            .collect();
        Ok(Forces {
            normal,
            friction,
            rates,
            slips,
            residual,
        })
    }

    /// What the rate of a contact is made of by a force λ of its own.
    pub(super) fn push(&self, contact: usize) -> f64 {
        self.blocks[0][contact * self.contacts.len() + contact]
    }

    /// The same for friction: J_tᵀT.
    pub(super) fn resistance(&self, contact: usize) -> f64 {
        self.blocks[3][contact * self.contacts.len() + contact]
    }
}
