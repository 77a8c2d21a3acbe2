//! Newton steps of the barrier problem.
//!
//! With g = ∇f + Eᵀy the gradient of the Lagrangian without bounds and d = v - l, e = u - v,
//!
//! (W + z_l/d + z_u/e) Δv + Eᵀ Δy = -(g - μ/d + μ/e),   E Δv = -r,
//! Δz_l = μ/d - z_l - z_l/d Δv,   Δz_u = μ/e - z_u + z_u/e Δv.
//!
//! Infinite distances drop out by themselves.

use super::Run;
use super::kkt::Entries;
use super::solution::Failure;
use crate::linalg::largest;

/// Weight of the distance of a variable from its only bound, so that it does not run away.
/// Wächter & Biegler 2006, section 3.7.
pub(crate) const DAMPING: f64 = 1e-5;

/// A change of all variables and multipliers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Step {
    pub v: Vec<f64>,
    pub y: Vec<f64>,
    pub z_l: Vec<f64>,
    pub z_u: Vec<f64>,
}

impl Step {
    pub fn new(n_all: usize, m: usize) -> Self {
        Step {
            v: vec![0.0; n_all],
            y: vec![0.0; m],
            z_l: vec![0.0; n_all],
            z_u: vec![0.0; n_all],
        }
    }
}

impl Run<'_> {
    /// Factors the linear system at the point.
    pub(crate) fn factor(&mut self) -> Result<(), Failure> {
        for i in 0..self.nv() {
            self.sigma[i] = self.z_l[i] / (self.v[i] - self.lower[i])
                + self.z_u[i] / (self.upper[i] - self.v[i]);
        }
        self.add_proximity_curvature();
        let nv = self.nv();
        self.kkt.factor(
            &mut self.form,
            &mut self.hessian,
            &self.jacobian,
            &self.sigma[..nv],
            self.mu,
        )
    }

    /// Solves the linear system for the right-hand side by the matrix factored last.
    pub(crate) fn solve_reduced(&mut self) -> Result<(), Failure> {
        let entries = |sparse, values| Entries { sparse, values };
        let blocks = [
            entries(&self.form.hessian, &self.hessian[..]),
            entries(&self.form.jacobian, &self.jacobian[..]),
        ];
        self.kkt.solve(blocks, &self.rhs, &mut self.reduced)
    }

    /// The derivative of the barrier terms of variable i with μ.
    pub(crate) fn barrier_slope(&self, i: usize) -> f64 {
        let (lower, upper) = (self.v[i] - self.lower[i], self.upper[i] - self.v[i]);
        upper.recip() - lower.recip() + self.damping(i)
    }

    /// The derivative of the damping of variable i with μ and v_i.
    pub(crate) fn damping(&self, i: usize) -> f64 {
        match (self.lower[i].is_finite(), self.upper[i].is_finite()) {
            (true, false) => DAMPING,
            (false, true) => -DAMPING,
            _ => 0.0,
        }
    }

    /// The step for `mu` with residuals of the rows in `self.target`, by the matrix factored last.
    ///
    /// `share` of the residuals is taken: with 0 the step depends on μ alone, linearly.
    pub(crate) fn direction(
        &mut self,
        mu: f64,
        share: f64,
        step: &mut Step,
    ) -> Result<(), Failure> {
        let (n, nv) = (self.form.n, self.nv());
        let delta = self.kkt.regularization;
        for i in 0..n {
            self.rhs[i] = -(share * self.lagrangian[i] + mu * self.barrier_slope(i));
        }
        for (rhs, residual) in self.rhs[n..].iter_mut().zip(&self.target) {
            *rhs = -share * residual;
        }
        for i in n..nv {
            let attached = self.form.attached[i - n];
            let slope = share * self.lagrangian[i] + mu * self.barrier_slope(i);
            step.v[i] = slope;
            self.rhs[n + attached.row as usize] += attached.sign * slope / (self.sigma[i] + delta);
        }
        self.solve_reduced()?;
        step.v[..n].copy_from_slice(&self.reduced[..n]);
        step.y.copy_from_slice(&self.reduced[n..]);
        for i in n..nv {
            let attached = self.form.attached[i - n];
            let dy = step.y[attached.row as usize];
            step.v[i] = -(step.v[i] + attached.sign * dy) / (self.sigma[i] + delta);
        }
        for i in 0..nv {
            let (d, e, dv) = (
                self.v[i] - self.lower[i],
                self.upper[i] - self.v[i],
                step.v[i],
            );
            step.z_l[i] = (mu - self.z_l[i] * dv) / d - share * self.z_l[i];
            step.z_u[i] = (mu + self.z_u[i] * dv) / e - share * self.z_u[i];
        }
        if largest(&step.v[..nv]).is_finite() && largest(&step.y).is_finite() {
            Ok(())
        } else {
            Err(Failure::LinearSystem)
        }
    }

    /// The longest step in (0, 1] along which no variable comes nearer to its bound than (1 - τ) of the distance.
    pub(crate) fn primal_length(&self, step: &Step, tau: f64) -> f64 {
        let mut length: f64 = 1.0;
        for i in 0..self.nv() {
            let dv = step.v[i];
            let distance = if dv < 0.0 {
                self.v[i] - self.lower[i]
            } else {
                self.upper[i] - self.v[i]
            };
            if length * dv.abs() > tau * distance {
                length = tau * distance / dv.abs();
            }
        }
        length
    }

    /// The same for the multipliers of bounds.
    pub(crate) fn dual_length(&self, step: &Step, tau: f64) -> f64 {
        let mut length: f64 = 1.0;
        let nv = self.nv();
        for (z, dz) in [(&self.z_l, &step.z_l), (&self.z_u, &step.z_u)] {
            for (&z, &dz) in z[..nv].iter().zip(dz) {
                if -length * dz > tau * z {
                    length = -tau * z / dz;
                }
            }
        }
        length
    }
}
