//! By how much the optimality conditions are missed.
//!
//! E_μ = max(‖∇L‖ / s_d, ‖r‖, ‖d z - μ‖ / s_c) in the maximum norm, Wächter & Biegler 2006, eq. (5).

use super::Run;
use super::solution::Residuals;
use crate::linalg::largest;

/// Multipliers above this average size scale the dual errors down.
const S_MAX: f64 = 100.0;

/// Errors in the scaled problem.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors {
    pub primal: f64,
    pub dual: f64,
    /// s_d and s_c.
    pub dual_scale: f64,
    pub complementarity_scale: f64,
}

impl Run<'_> {
    pub(crate) fn errors(&self) -> Errors {
        let nv = self.nv();
        let (mut dual, mut sum, mut count) = (0.0_f64, 0.0, 0_usize);
        for i in 0..nv {
            let (z_l, z_u) = (self.z_l[i], self.z_u[i]);
            let error =
                (self.lagrangian[i] - z_l + z_u + self.options.mu_target * self.damping(i)).abs();
            if error > dual || error.is_nan() {
                dual = error;
            }
            sum += z_l + z_u;
            count +=
                usize::from(self.lower[i].is_finite()) + usize::from(self.upper[i].is_finite());
        }
        let multipliers: f64 = self.y.iter().map(|y| y.abs()).sum();
        let scale = |sum: f64, count: usize| (sum / count.max(1) as f64).max(S_MAX) / S_MAX;
        Errors {
            primal: largest(&self.residual),
            dual,
            dual_scale: scale(sum + multipliers, count + self.form.m),
            complementarity_scale: scale(sum, count),
        }
    }

    /// max |d z - μ|.
    pub(crate) fn complementarity(&self, mu: f64) -> f64 {
        let mut error = 0.0_f64;
        for i in 0..self.nv() {
            if self.lower[i].is_finite() {
                error = error.max((self.z_l[i] * (self.v[i] - self.lower[i]) - mu).abs());
            }
            if self.upper[i].is_finite() {
                error = error.max((self.z_u[i] * (self.upper[i] - self.v[i]) - mu).abs());
            }
        }
        error
    }

    /// E_μ.
    pub(crate) fn optimality_error(&self, errors: &Errors, mu: f64) -> f64 {
        let complementarity = self.complementarity(mu) / errors.complementarity_scale;
        (errors.dual / errors.dual_scale)
            .max(errors.primal)
            .max(complementarity)
    }

    /// What the absolute tolerances look at: whatever the scaling, a solution misses no condition by more.
    pub(crate) fn is_within(
        &self,
        errors: &Errors,
        dual: f64,
        primal: f64,
        complementarity: f64,
    ) -> bool {
        let scale = self.form.objective_scale;
        let residuals = self.residual.iter().zip(&self.form.row_scale);
        let violation = residuals.fold(0.0_f64, |m, (r, scale)| m.max(r.abs() / scale));
        errors.dual / scale <= dual
            && violation <= primal
            && self.complementarity(self.options.mu_target) / scale <= complementarity
    }
}

/// Residuals of the problem itself at a point with these multipliers.
pub(crate) fn residuals(
    nlp: &mut dyn crate::optimization::problem::Nlp,
    w: &[f64],
    y: &[f64],
    z_l: &[f64],
    z_u: &[f64],
) -> Residuals {
    let (n, m) = (nlp.n_variables(), nlp.n_rows());
    let mut gradient = vec![0.0; n];
    nlp.gradient(w, &mut gradient);
    let mut jacobian = vec![0.0; nlp.jacobian_pattern().n_entries()];
    nlp.jacobian(w, &mut jacobian);
    let mut rows = vec![0.0; m];
    nlp.rows(w, &mut rows);
    let pattern = nlp.jacobian_pattern();
    for (row, &y) in y.iter().enumerate() {
        let range = pattern.starts[row]..pattern.starts[row + 1];
        for (&column, &entry) in pattern.row(row).iter().zip(&jacobian[range]) {
            gradient[column as usize] += entry * y;
        }
    }
    let (mut primal, mut dual, mut complementarity) = (0.0_f64, 0.0_f64, 0.0_f64);
    let keep = |m: &mut f64, value: f64| {
        if value > *m || value.is_nan() {
            *m = value;
        }
    };
    // A multiplier of a bound that is not there is an error of the gradient.
    let mut pair = |z: f64, distance: f64| {
        if distance == f64::INFINITY {
            keep(&mut dual, z);
        } else {
            keep(&mut complementarity, z * distance.max(0.0));
            keep(&mut primal, -distance);
        }
    };
    let bounds = nlp.variable_bounds();
    for i in 0..n {
        pair(z_l[i], w[i] - bounds.lower[i]);
        pair(z_u[i], bounds.upper[i] - w[i]);
    }
    let bounds = nlp.row_bounds();
    for i in 0..m {
        pair((-y[i]).max(0.0), rows[i] - bounds.lower[i]);
        pair(y[i].max(0.0), bounds.upper[i] - rows[i]);
    }
    for i in 0..n {
        keep(&mut dual, (gradient[i] - z_l[i] + z_u[i]).abs());
    }
    Residuals {
        primal,
        dual,
        complementarity,
    }
}
