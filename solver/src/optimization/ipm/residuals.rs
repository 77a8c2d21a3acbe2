//! By how much the optimality conditions of a program are missed.

use super::solution::Residuals;
use crate::optimization::problem::Nlp;

/// Residuals of the problem itself at a point with these multipliers.
pub(crate) fn residuals(
    nlp: &mut dyn Nlp,
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
