//! Dense A = P' L D L' P with blocks of one or two rows in D: stable for every symmetric matrix.
//!
//! Bunch & Kaufman 1977, *Some stable methods for calculating inertia and solving symmetric linear systems*, with
//! partial pivoting. Takes n² memory and n³/6 operations: for tests, and where a static order fails.

use super::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use crate::runtime::limit::work;

/// Memory for one size.
#[derive(Clone, Debug)]
pub struct BunchKaufman {
    n: usize,
    /// Where the entries of the pattern are.
    places: Vec<u32>,
    /// The lower triangle, row by row; L and D in the end.
    matrix: Vec<f64>,
    /// The row that each step brought to its place.
    swaps: Vec<u32>,
    /// Whether a block of two rows starts here.
    is_double: Vec<bool>,
    /// The columns of the pivot block.
    columns: [Vec<f64>; 2],
}

impl BunchKaufman {
    /// Memory for matrices of this pattern.
    pub fn new(pattern: &Pattern) -> Self {
        let n = pattern.n_rows();
        let row = |row: usize| pattern.row(row).iter().map(move |&j| (row * n) as u32 + j);
        BunchKaufman {
            n,
            places: (0..n).flat_map(row).collect(),
            matrix: vec![0.0; n * n],
            swaps: vec![0; n],
            is_double: vec![false; n],
            columns: [vec![0.0; n], vec![0.0; n]],
        }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.matrix[i.max(j) * self.n + i.min(j)]
    }

    /// Swaps rows and columns p < q of what is left from row `from` on.
    fn swap(&mut self, p: usize, q: usize, from: usize) {
        if p == q {
            return;
        }
        let (n, a) = (self.n, &mut self.matrix);
        for j in from..p {
            a.swap(p * n + j, q * n + j);
        }
        a.swap(p * n + p, q * n + q);
        for i in p + 1..q {
            a.swap(i * n + p, q * n + i);
        }
        for i in q + 1..n {
            a.swap(i * n + p, i * n + q);
        }
    }

    /// The largest entry |a_ij| of column j among rows from `from` on, without the diagonal.
    fn largest(&self, j: usize, from: usize) -> (usize, f64) {
        let mut found = (j, 0.0);
        for i in (from..self.n).filter(|&i| i != j) {
            if self.at(i, j).abs() > found.1 {
                found = (i, self.at(i, j).abs());
            }
        }
        found
    }
}

impl KktSolver for BunchKaufman {
    fn factor(&mut self, values: &[f64]) -> Result<Inertia, FactorFailure> {
        let alpha = (1.0 + 17.0_f64.sqrt()) / 8.0;
        let n = self.n;
        work::add(n * n * n / 6);
        self.matrix.fill(0.0);
        for (&place, &value) in self.places.iter().zip(values) {
            self.matrix[place as usize] = value;
        }
        let scale = self.matrix.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        if !self.matrix.iter().all(|value| value.is_finite()) {
            return Err(FactorFailure::NotFinite);
        }
        self.is_double.fill(false);
        let (mut k, mut positive) = (0, 0);
        while k < n {
            let diagonal = self.at(k, k).abs();
            let (r, lambda) = self.largest(k, k);
            if diagonal.max(lambda) <= 1e-300 + f64::EPSILON * f64::EPSILON * scale {
                return Err(FactorFailure::ZeroPivot(k));
            }
            let sigma = if r == k { 0.0 } else { self.largest(r, k).1 };
            let is_single =
                diagonal >= alpha * lambda || diagonal * sigma >= alpha * lambda * lambda;
            let is_swapped = !is_single && self.at(r, r).abs() >= alpha * sigma;
            let size = if is_single || is_swapped { 1 } else { 2 };
            let target = k + size - 1;
            let pivot = if is_single { k } else { r };
            self.swap(target, pivot, k);
            self.swaps[k] = pivot as u32;
            self.is_double[k] = size == 2;
            if size == 1 {
                let d = self.at(k, k);
                positive += usize::from(d > 0.0);
                let [column, _] = &mut self.columns;
                for i in k + 1..n {
                    column[i] = self.matrix[i * n + k];
                    let l = column[i] / d;
                    self.matrix[i * n + k] = l;
                    let row = &mut self.matrix[i * n + k + 1..=i * n + i];
                    for (a, y) in row.iter_mut().zip(&column[k + 1..]) {
                        *a -= l * y;
                    }
                }
            } else {
                // One eigenvalue of the block has either sign: |a b| < c².
                positive += 1;
                let (a, b, c) = (self.at(k, k), self.at(k + 1, k + 1), self.at(k + 1, k));
                let det = a * b - c * c;
                let [first, second] = &mut self.columns;
                for i in k + 2..n {
                    let (p, q) = (self.matrix[i * n + k], self.matrix[i * n + k + 1]);
                    (first[i], second[i]) = (p, q);
                    let (l0, l1) = ((p * b - q * c) / det, (q * a - p * c) / det);
                    self.matrix[i * n + k] = l0;
                    self.matrix[i * n + k + 1] = l1;
                    let row = &mut self.matrix[i * n + k + 2..=i * n + i];
                    let columns = first[k + 2..].iter().zip(&second[k + 2..]);
                    for (a, (p, q)) in row.iter_mut().zip(columns) {
                        *a -= l0 * p + l1 * q;
                    }
                }
            }
            k += size;
        }
        Ok(Inertia {
            positive,
            negative: n - positive,
        })
    }

    /// Solves with A = P₁ L₁ P₂ L₂ .. D .. L₂ᵀ P₂ L₁ᵀ P₁, a swap P and the columns L of each pivot block. Swaps come
    /// between the columns, as `factor` does not swap those of earlier blocks along.
    fn solve(&mut self, rhs: &mut [f64]) {
        let n = self.n;
        // Forward: P and L⁻¹ of each block, then its D⁻¹, as no later block touches its rows.
        let mut k = 0;
        while k < n {
            let size = 1 + usize::from(self.is_double[k]);
            rhs.swap(k + size - 1, self.swaps[k] as usize);
            for i in k + size..n {
                for j in k..k + size {
                    rhs[i] -= self.matrix[i * n + j] * rhs[j];
                }
            }
            if size == 1 {
                rhs[k] /= self.at(k, k);
            } else {
                let (a, b, c) = (self.at(k, k), self.at(k + 1, k + 1), self.at(k + 1, k));
                let det = a * b - c * c;
                // | a c |⁻¹ | p |
                // | c b |   | q |
                let (p, q) = (rhs[k], rhs[k + 1]);
                rhs[k] = (p * b - q * c) / det;
                rhs[k + 1] = (q * a - p * c) / det;
            }
            k += size;
        }
        // Backward: L⁻ᵀ and P of each block, the last one first.
        while k > 0 {
            let size = if k >= 2 && self.is_double[k - 2] {
                2
            } else {
                1
            };
            k -= size;
            for i in k + size..n {
                for j in k..k + size {
                    rhs[j] -= self.matrix[i * n + j] * rhs[i];
                }
            }
            rhs.swap(k + size - 1, self.swaps[k] as usize);
        }
    }
}

#[cfg(test)]
#[path = "bunch_kaufman_tests.rs"]
mod tests;
