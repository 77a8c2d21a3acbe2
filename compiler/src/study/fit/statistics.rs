//! What residuals and their derivatives say of parameters.
//!
//! With J C⁻¹ = U Σ Vᵀ, C the lengths of columns, directions C⁻¹ v_i are determined in the order of their singular values; the
//! covariance of the estimates is s² (JᵀJ)⁻¹ = s² Σ_i (C⁻¹ v_i)(C⁻¹ v_i)ᵀ/σ_i², s² = Σ r²/(m - n). A parameter whose column is
//! zero is a direction by itself, with σ = 0. With Huber's loss, s² = Σ (ω r)²/(m - n)/κ², κ = (i - n)/(m - n) being the share
//! of residuals within its bound, i of them, without the n that parameters can bring there: for n small next to m that is
//! i/m/(1 + n/m (m - i)/i) (Huber & Ronchetti 2009, section 7.6), and for small bounds it says that nothing is known.

use nalgebra::{DMatrix, DVector, SVD};
use nsd_solver::optimization::least_squares::{Linearized, Loss};

/// A parameter has a part in a direction, as it is told, where its component is at least this.
pub(super) const PART: f64 = 1e-3;
/// A parameter is determined where directions that are not, as far as they are known, add at most this part to its variance.
const ADDED: f64 = 0.01;

/// A right singular vector.
pub(super) struct Singular {
    /// σ
    pub value: f64,
    /// v, in units of C⁻¹.
    pub vector: Vec<f64>,
    pub is_determined: bool,
}

/// Directions of the columns that are open, best determined first.
pub(super) struct Directions {
    pub all: Vec<Singular>,
    /// Where not zero, lengths of columns.
    pub lengths: Vec<f64>,
    /// Singular values up to this are rounding.
    least: f64,
}

impl Directions {
    pub fn new(at: &Linearized, open: &[usize]) -> Self {
        let n = open.len();
        let lengths: Vec<f64> = open.iter().map(|&j| at.jacobian.column(j).norm()).collect();
        let (felt, still): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| lengths[k] > 0.0);
        // Rows of zeros, so that there is a right vector for every parameter.
        let m = at.jacobian.nrows().max(felt.len());
        let mut scaled = DMatrix::zeros(m, felt.len());
        for (place, &k) in felt.iter().enumerate() {
            let column = at.jacobian.column(open[k]) / lengths[k];
            scaled
                .view_mut((0, place), (column.len(), 1))
                .copy_from(&column);
        }
        let mut all = Vec::new();
        let mut least = 0.0;
        if !felt.is_empty() {
            let svd = SVD::new(scaled, false, true);
            least = at.rank * svd.singular_values.max();
            let vectors = svd.v_t.expect("it was asked for");
            all.extend(svd.singular_values.iter().enumerate().map(|(i, &value)| {
                let mut vector = vec![0.0; n];
                for (&k, &part) in felt.iter().zip(vectors.row(i).iter()) {
                    vector[k] = part;
                }
                Singular {
                    value,
                    vector,
                    is_determined: value > least,
                }
            }));
        }
        all.sort_by(|a: &Singular, b| b.value.total_cmp(&a.value));
        all.extend(still.into_iter().map(|k| {
            Singular {
                value: 0.0,
                vector: (0..n)
                    .map(|other| f64::from(u8::from(other == k)))
                    .collect(),
                is_determined: false,
            }
        }));
        Directions {
            all,
            lengths,
            least,
        }
    }

    /// How many are determined.
    pub fn rank(&self) -> usize {
        self.all.iter().filter(|one| one.is_determined).count()
    }

    /// Relative changes of the parameters along one, where these have sizes: of length one, the largest with a plus.
    pub fn relative(&self, one: &Singular, sizes: &[f64]) -> Vec<f64> {
        let parts = one.vector.iter().zip(&self.lengths).zip(sizes);
        let parts = parts.map(|((&v, &length), size)| match length {
            0.0 => v,
            length => v / (length * size),
        });
        let parts = DVector::from_iterator(sizes.len(), parts);
        let sign = parts[parts.iamax()].signum();
        (parts.normalize() * sign).as_slice().to_vec()
    }

    /// The covariance of parameters; nothing of those that are not determined.
    pub fn covariance(&self, variance: f64) -> Vec<Vec<Option<f64>>> {
        let n = self.lengths.len();
        let known: Vec<bool> = (0..n).map(|j| self.is_determined(j)).collect();
        let entry = |j: usize, k: usize| {
            let parts = self.all.iter().filter(|one| one.is_determined);
            let parts = parts.map(|one| (one.vector[j] / one.value) * (one.vector[k] / one.value));
            let units = || variance / self.lengths[j] / self.lengths[k];
            (known[j] && known[k]).then(|| units() * parts.sum::<f64>())
        };
        (0..n)
            .map(|j| (0..n).map(|k| entry(j, k)).collect())
            .collect()
    }

    /// Whether directions that are not determined cannot matter to a parameter.
    pub fn is_determined(&self, parameter: usize) -> bool {
        let (mut kept, mut left) = (0.0, 0.0);
        for one in &self.all {
            let part = one.vector[parameter];
            match one.is_determined {
                true => kept += (part / one.value).powi(2),
                false if part != 0.0 => left += (part / self.least).powi(2),
                false => {}
            }
        }
        self.lengths[parameter] > 0.0 && left <= ADDED * kept
    }
}

/// s², where there are more residuals than parameters that are determined.
pub(super) fn variance(at: &Linearized, loss: Loss, n_determined: usize) -> Option<f64> {
    let m = at.residuals.len();
    let freedom = m.checked_sub(n_determined).filter(|&freedom| freedom > 0)?;
    let squares = at.residuals.iter().map(|&r| (loss.weight(r) * r).powi(2));
    let inner = at.residuals.iter().filter(|&&r| loss.weight(r) == 1.0);
    let free = inner.count().checked_sub(n_determined)?;
    let share = free as f64 / freedom as f64;
    (free > 0).then(|| squares.sum::<f64>() / freedom as f64 / (share * share))
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
