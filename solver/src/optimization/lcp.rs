//! Linear complementarity problems: find z with w = Mz + q, 0 ≤ z ⟂ w ≥ 0.
//!
//! Lemke's complementary pivoting with a covering vector d > 0 (Cottle, Pang &
//! Stone 1992, algorithm 4.4.5): w = Mz + q + d z₀ starts on the ray of large
//! z₀ and pivots along complementary bases until z₀ leaves. Ties in the ratio
//! test are broken lexicographically, so the path never cycles.

/// Why no solution was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LcpError {
    /// The path ended on a ray: none exists, or M is of no class Lemke covers.
    Ray,
    /// The pivot limit was reached.
    PivotLimit,
}

/// Solves the LCP (`m`, `q`) with covering vector `cover`, returning z.
///
/// `m` is row major, `q.len()` square; every entry of `cover` is positive.
pub fn lemke(m: &[f64], q: &[f64], cover: &[f64]) -> Result<Vec<f64>, LcpError> {
    let mut memory = Lemke::default();
    memory.solve(m, q, cover)?;
    Ok(memory.z)
}

/// Memory for problems of one size after the other.
#[derive(Default)]
pub struct Lemke {
    tableau: Tableau,
    z: Vec<f64>,
}

impl Lemke {
    /// The z of [`lemke`].
    pub fn solve(&mut self, m: &[f64], q: &[f64], cover: &[f64]) -> Result<&[f64], LcpError> {
        let n = q.len();
        self.z.clear();
        self.z.resize(n, 0.0);
        if q.iter().all(|&entry| entry >= 0.0) {
            return Ok(&self.z);
        }
        let tableau = &mut self.tableau;
        tableau.fill(m, q, cover);
        let mut row = tableau.first_row(cover);
        let mut entering = tableau.pivot(row, tableau.z0());
        for _ in 0..50 * (n + 1) {
            row = tableau.ratio_test(entering).ok_or(LcpError::Ray)?;
            let leaving = tableau.pivot(row, entering);
            if leaving == tableau.z0() {
                tableau.solution(&mut self.z);
                return Ok(&self.z);
            }
            entering = tableau.complement(leaving);
        }
        Err(LcpError::PivotLimit)
    }
}

/// Matrices up to this size are tested by all their principal minors.
const MAX_MINORS: usize = 12;

/// Whether every principal minor of the row-major `m` is positive, so that the LCP has exactly one
/// solution for every q; `None` where that is not known.
pub fn is_p_matrix(m: &[f64], n: usize) -> Option<bool> {
    if (0..n).any(|i| m[i * n + i] <= 0.0) {
        return Some(false);
    }
    if is_h_matrix(m, n) || is_positive_definite(m, n) {
        return Some(true);
    }
    (n <= MAX_MINORS).then(|| has_positive_minors(m, n))
}

/// True when the comparison matrix (|m_ii|, -|m_ij|) is an M-matrix: all pivots are positive.
fn is_h_matrix(m: &[f64], n: usize) -> bool {
    let mut a: Vec<f64> = m.iter().map(|v| -v.abs()).collect();
    for i in 0..n {
        a[i * n + i] = -a[i * n + i];
    }
    has_positive_pivots(a, n)
}

/// True when the symmetric part is positive definite, after scaling to a unit diagonal.
fn is_positive_definite(m: &[f64], n: usize) -> bool {
    let scale = |i: usize, j: usize| (m[i * n + i] * m[j * n + j]).sqrt();
    let entry = |at: usize| {
        let (i, j) = (at / n, at % n);
        0.5 * (m[i * n + j] + m[j * n + i]) / scale(i, j)
    };
    has_positive_pivots((0..n * n).map(entry).collect(), n)
}

/// Gaussian elimination without exchanges; pivots that could be rounding count as zero.
fn has_positive_pivots(mut a: Vec<f64>, n: usize) -> bool {
    for col in 0..n {
        let size = a[col * n..(col + 1) * n]
            .iter()
            .fold(0.0_f64, |s, v| s.max(v.abs()));
        let pivot = a[col * n + col];
        if pivot.is_nan() || pivot <= 1e-10 * size {
            return false;
        }
        for row in col + 1..n {
            let factor = a[row * n + col] / pivot;
            for k in col + 1..n {
                a[row * n + k] -= factor * a[col * n + k];
            }
        }
    }
    true
}

/// All principal minors: those without the first row and column, and those of the Schur complement
/// of the first entry (Tsatsomeros & Li 2000).
fn has_positive_minors(m: &[f64], n: usize) -> bool {
    let mut left = vec![(m.to_vec(), n)];
    while let Some((a, n)) = left.pop() {
        if n == 0 {
            continue;
        }
        let scale = a[..n].iter().fold(0.0_f64, |s, v| s.max(v.abs()));
        if a[0].is_nan() || a[0] <= 1e-12 * scale {
            return false;
        }
        let rest = |complement: bool| -> Vec<f64> {
            let entries = (1..n).flat_map(|i| (1..n).map(move |j| (i, j)));
            let entry = |(i, j): (usize, usize)| {
                let taken = if complement {
                    a[i * n] * a[j] / a[0]
                } else {
                    0.0
                };
                a[i * n + j] - taken
            };
            entries.map(entry).collect()
        };
        left.push((rest(false), n - 1));
        left.push((rest(true), n - 1));
    }
    true
}

/// Rows are basic variables; columns are w (n), z (n), z₀ and the right side.
#[derive(Default)]
struct Tableau {
    n: usize,
    width: usize,
    rows: Vec<f64>,
    basis: Vec<usize>,
    pivot_row: Vec<f64>,
}

impl Tableau {
    /// w - Mz - d z₀ = q with w basic.
    fn fill(&mut self, m: &[f64], q: &[f64], cover: &[f64]) {
        let n = q.len();
        let width = 2 * n + 2;
        (self.n, self.width) = (n, width);
        self.rows.clear();
        self.rows.resize(n * width, 0.0);
        for (i, row) in self.rows.chunks_exact_mut(width).enumerate() {
            row[i] = 1.0;
            for j in 0..n {
                row[n + j] = -m[i * n + j];
            }
            row[2 * n] = -cover[i];
            row[2 * n + 1] = q[i];
        }
        self.basis.clear();
        self.basis.extend(0..n);
    }

    fn z0(&self) -> usize {
        2 * self.n
    }

    fn complement(&self, variable: usize) -> usize {
        if variable < self.n {
            variable + self.n
        } else {
            variable - self.n
        }
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.rows[row * self.width + column]
    }

    /// The row that stays feasible longest as z₀ falls: max -q_i/d_i.
    fn first_row(&self, cover: &[f64]) -> usize {
        let ratio = |row: usize| -self.at(row, self.width - 1) / cover[row];
        (0..self.n)
            .max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)).then(b.cmp(&a)))
            .unwrap_or(0)
    }

    /// The row that blocks `entering` first; among equals z₀, then the lexicographic least.
    fn ratio_test(&self, entering: usize) -> Option<usize> {
        let scale = (0..self.n).fold(0.0_f64, |s, row| s.max(self.at(row, entering).abs()));
        let eligible = |&row: &usize| self.at(row, entering) > 1e-12 * scale.max(1e-300);
        (0..self.n).filter(eligible).reduce(|best, row| {
            let (best_ratio, ratio) = (
                self.ratio(best, entering, self.width - 1),
                self.ratio(row, entering, self.width - 1),
            );
            if (ratio - best_ratio).abs() > 1e-13 * (1.0 + ratio.abs()) {
                return if ratio < best_ratio { row } else { best };
            }
            if self.basis[best] == self.z0() || self.basis[row] == self.z0() {
                return if self.basis[best] == self.z0() {
                    best
                } else {
                    row
                };
            }
            let order = (0..self.n)
                .map(|column| {
                    self.ratio(row, entering, column)
                        .total_cmp(&self.ratio(best, entering, column))
                })
                .find(|order| order.is_ne());
            if order.is_some_and(|order| order.is_lt()) {
                row
            } else {
                best
            }
        })
    }

    fn ratio(&self, row: usize, entering: usize, column: usize) -> f64 {
        self.at(row, column) / self.at(row, entering)
    }

    /// Makes `entering` basic in `row`; returns what left, or its complement's partner at the start.
    fn pivot(&mut self, row: usize, entering: usize) -> usize {
        let width = self.width;
        let inverse = 1.0 / self.at(row, entering);
        for value in &mut self.rows[row * width..(row + 1) * width] {
            *value *= inverse;
        }
        self.pivot_row.clear();
        self.pivot_row
            .extend_from_slice(&self.rows[row * width..(row + 1) * width]);
        for (other, values) in self.rows.chunks_exact_mut(width).enumerate() {
            let factor = values[entering];
            if other != row && factor != 0.0 {
                for (value, pivot) in values.iter_mut().zip(&self.pivot_row) {
                    *value -= factor * pivot;
                }
            }
        }
        let left = std::mem::replace(&mut self.basis[row], entering);
        if entering == self.z0() {
            self.complement(left)
        } else {
            left
        }
    }

    fn solution(&self, z: &mut [f64]) {
        for (row, &variable) in self.basis.iter().enumerate() {
            if (self.n..2 * self.n).contains(&variable) {
                z[variable - self.n] = self.at(row, self.width - 1).max(0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn residual(m: &[f64], q: &[f64], z: &[f64]) -> f64 {
        let n = q.len();
        (0..n)
            .map(|i| {
                let w = q[i] + (0..n).map(|j| m[i * n + j] * z[j]).sum::<f64>();
                z[i].min(w).abs()
            })
            .fold(0.0, f64::max)
    }

    /// The LCP of math "next mode, switches": z = (α, p), w = (n, 1 - α).
    fn box_lcp(a: &[f64], b: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let n = b.len();
        let size = 2 * n;
        let (mut m, mut q, mut cover) = (vec![0.0; size * size], vec![1.0; size], vec![1.0; size]);
        for i in 0..n {
            for j in 0..n {
                m[i * size + j] = -a[i * n + j];
                cover[i] += a[i * n + j].abs();
            }
            m[i * size + n + i] = 1.0;
            m[(n + i) * size + i] = -1.0;
            q[i] = -b[i];
        }
        (m, q, cover)
    }

    proptest! {
        #[test]
        fn box_problems_always_have_a_solution(a in prop::collection::vec(-1.0..1.0_f64, 25), b in prop::collection::vec(-1.0..1.0_f64, 5)) {
            let (m, q, cover) = box_lcp(&a, &b);
            let z = lemke(&m, &q, &cover).unwrap();
            prop_assert!(residual(&m, &q, &z) < 1e-9);
        }
    }

    #[test]
    fn one_surface_crosses_and_slides() {
        for (b, exact) in [(3.0, [1.0, 1.0]), (1.0, [0.5, 0.0]), (-1.0, [0.0, 0.0])] {
            let (m, q, cover) = box_lcp(&[-2.0], &[b]);
            let z = lemke(&m, &q, &cover).unwrap();
            assert!(
                z.iter().zip(exact).all(|(z, e)| (z - e).abs() < 1e-15),
                "{z:?}"
            );
        }
    }

    proptest! {
        #[test]
        fn p_matrices_are_told_by_their_minors(mut m in prop::collection::vec(-1.0..1.0_f64, 16)) {
            for i in 0..4 {
                m[i * 5] += 0.6;
            }
            let minor = |subset: usize| {
                let rows: Vec<usize> = (0..4).filter(|i| subset >> i & 1 == 1).collect();
                let k = rows.len();
                let entries: Vec<f64> = rows.iter().flat_map(|&i| rows.iter().map(move |&j| (i, j))).map(|(i, j)| m[i * 4 + j]).collect();
                nalgebra::DMatrix::from_row_slice(k, k, &entries).determinant()
            };
            let minors: Vec<f64> = (1..16).map(minor).collect();
            prop_assume!(minors.iter().all(|minor| minor.abs() > 1e-6));
            prop_assert_eq!(is_p_matrix(&m, 4), Some(minors.iter().all(|minor| *minor > 0.0)));
        }
    }

    #[test]
    fn an_infeasible_problem_ends_on_a_ray() {
        assert_eq!(lemke(&[0.0], &[-1.0], &[1.0]), Err(LcpError::Ray));
    }
}
