//! By how much the optimality conditions of the scaled problem are missed.
//!
//! E_μ = max(‖∇L‖ / s_d, ‖r‖, ‖d z - μ‖ / s_c) in the maximum norm, Wächter & Biegler 2006, eq. (5).

use super::iterate::Iterate;
use crate::linalg::largest;

/// Multipliers above this average size scale the dual errors down.
const S_MAX: f64 = 100.0;

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors {
    pub primal: f64,
    pub dual: f64,
    /// s_d and s_c.
    dual_scale: f64,
    complementarity_scale: f64,
}

impl Errors {
    /// The errors with residuals r of the rows and the gradient ∇L without bounds.
    pub fn new(at: &Iterate, residual: &[f64], lagrangian: &[f64], mu_target: f64) -> Self {
        let (mut dual, mut sum, mut count) = (0.0_f64, 0.0, 0_usize);
        for (i, slope) in lagrangian[..at.nv].iter().enumerate() {
            let (z_l, z_u) = (at.z_l[i], at.z_u[i]);
            let error = (slope - z_l + z_u + mu_target * at.damping(i)).abs();
            if error > dual || error.is_nan() {
                dual = error;
            }
            sum += z_l + z_u;
            count += usize::from(at.lower[i].is_finite()) + usize::from(at.upper[i].is_finite());
        }
        let multipliers: f64 = at.y.iter().map(|y| y.abs()).sum();
        let scale = |sum: f64, count: usize| (sum / count.max(1) as f64).max(S_MAX) / S_MAX;
        Errors {
            primal: largest(residual),
            dual,
            dual_scale: scale(sum + multipliers, count + residual.len()),
            complementarity_scale: scale(sum, count),
        }
    }

    /// E_μ at the same iterate.
    pub fn optimality(&self, at: &Iterate, mu: f64) -> f64 {
        let complementarity = at.complementarity(mu) / self.complementarity_scale;
        (self.dual / self.dual_scale)
            .max(self.primal)
            .max(complementarity)
    }
}
