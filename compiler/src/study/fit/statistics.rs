//! What residuals and their derivatives say of parameters.
//!
//! With J S = U Σ Vᵀ, S the sizes of parameters, directions S v_i are determined in the order of their singular values; the
//! covariance of the estimates is s² (JᵀJ)⁻¹ = s² Σ_i (S v_i)(S v_i)ᵀ/σ_i², s² = Σ r²/(m - n). With Huber's loss,
//! s² = Σ (ω r)²/(m - n)/κ², κ being the share of residuals within its bound (Huber & Ronchetti 2009, chapter 7).

use nalgebra::{DMatrix, SVD};
use nsd_solver::optimization::least_squares::{Linearized, Loss};

/// Directions whose singular value is this part of the largest one, or less, are not determined: derivatives of runs, and
/// differences of runs, are no more accurate.
const RANK: f64 = 1e-6;
const RANK_OF_DIFFERENCES: f64 = 1e-4;
/// A parameter has a part in a direction where its component is at least this.
pub(super) const PART: f64 = 1e-3;

/// A right singular vector.
pub(super) struct Singular {
    pub value: f64,
    /// Relative changes of the parameters.
    pub vector: Vec<f64>,
    pub is_determined: bool,
}

/// Singular values of the columns that are open, in units of sizes, largest first.
pub(super) fn directions(
    at: &Linearized,
    sizes: &[f64],
    open: &[usize],
    has_differences: bool,
) -> Vec<Singular> {
    let columns = open.iter().map(|&j| at.jacobian.column(j) * sizes[j]);
    let columns: Vec<_> = columns.collect();
    if columns.is_empty() {
        return Vec::new();
    }
    // Rows of zeros, so that there is a right vector for every parameter.
    let m = at.jacobian.nrows().max(open.len());
    let mut scaled = DMatrix::zeros(m, open.len());
    for (k, column) in columns.iter().enumerate() {
        scaled.view_mut((0, k), (column.len(), 1)).copy_from(column);
    }
    let svd = SVD::new(scaled, false, true);
    let largest = svd.singular_values.max();
    let rank = if has_differences {
        RANK_OF_DIFFERENCES
    } else {
        RANK
    };
    let vectors = svd.v_t.expect("it was asked for");
    let all = svd.singular_values.iter().enumerate();
    let mut all: Vec<Singular> = all
        .map(|(i, &value)| {
            let row = vectors.row(i);
            // The largest component has a plus.
            let sign = row[row.iamax_full().1].signum();
            Singular {
                value,
                vector: row.iter().map(|v| sign * v).collect(),
                is_determined: value > rank * largest,
            }
        })
        .collect();
    all.sort_by(|a, b| b.value.total_cmp(&a.value));
    all
}

/// s², where there are more residuals than parameters that are determined.
pub(super) fn variance(at: &Linearized, loss: Loss, n_determined: usize) -> Option<f64> {
    let m = at.residuals.len();
    let freedom = m.checked_sub(n_determined).filter(|&freedom| freedom > 0)?;
    let squares = at.residuals.iter().map(|&r| (loss.weight(r) * r).powi(2));
    let inner = at.residuals.iter().filter(|&&r| loss.weight(r) == 1.0);
    let share = inner.count() as f64 / m as f64;
    (share > 0.0).then(|| squares.sum::<f64>() / freedom as f64 / (share * share))
}

/// The covariance of parameters that are open, in that order; nothing of those that are not determined.
pub(super) fn covariance(
    directions: &[Singular],
    sizes: &[f64],
    variance: f64,
) -> Vec<Vec<Option<f64>>> {
    let n = sizes.len();
    let known: Vec<bool> = (0..n).map(|j| is_determined(directions, j)).collect();
    let entry = |j: usize, k: usize| {
        let parts = directions.iter().filter(|one| one.is_determined);
        let parts = parts.map(|one| one.vector[j] * one.vector[k] / (one.value * one.value));
        let value = variance * sizes[j] * sizes[k] * parts.sum::<f64>();
        (known[j] && known[k]).then_some(value)
    };
    (0..n)
        .map(|j| (0..n).map(|k| entry(j, k)).collect())
        .collect()
}

/// Whether no direction that is not determined moves a parameter.
pub(super) fn is_determined(directions: &[Singular], parameter: usize) -> bool {
    let mut open = directions.iter().filter(|one| !one.is_determined);
    open.all(|one| one.vector[parameter].abs() < PART)
}

/// The quantile of Student's t: P(|T| <= t) = 0.95 with this many degrees of freedom.
pub(super) fn student(freedom: usize) -> f64 {
    let v = freedom as f64;
    if freedom > 1000 {
        // From the normal quantile (Abramowitz & Stegun 1964, 26.7.5).
        let z: f64 = 1.959_963_984_540_054;
        let first = (z.powi(3) + z) / 4.0;
        let second = (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0;
        return z + first / v + second / (v * v);
    }
    let (mut low, mut high) = (1.0, 20.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match within(middle, freedom) < 0.95 {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

/// P(|T| <= t), a finite sum in θ = atan(t/√v) (Abramowitz & Stegun 1964, 26.7.3 and 26.7.4).
fn within(t: f64, freedom: usize) -> f64 {
    let angle = (t / (freedom as f64).sqrt()).atan();
    let (sine, cosine) = angle.sin_cos();
    let is_odd = freedom % 2 == 1;
    let (mut term, mut sum) = (if is_odd { cosine } else { 1.0 }, 0.0);
    // The exponents of the cosine, up to v - 2.
    let mut exponent = if is_odd { 1 } else { 0 };
    while exponent + 2 <= freedom {
        sum += term;
        let k = exponent as f64;
        term *= cosine * cosine * (k + 1.0) / (k + 2.0);
        exponent += 2;
    }
    match is_odd {
        true => (angle + sine * sum) * std::f64::consts::FRAC_2_PI,
        false => sine * sum,
    }
}

#[cfg(test)]
mod tests {
    use super::student;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let table = [
            (1, 12.706_204_736),
            (2, 4.302_652_730),
            (3, 3.182_446_305),
            (10, 2.228_138_852),
            (29, 2.045_229_642),
            (200, 1.971_896_224),
            (1000, 1.962_339_081),
            (10_000, 1.960_201_240),
        ];
        for (freedom, t) in table {
            assert!(
                (student(freedom) - t).abs() < 1e-8,
                "{freedom}: {}",
                student(freedom)
            );
        }
    }
}
