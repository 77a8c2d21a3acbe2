//! Sparse A = P' L D L' P with D diagonal in a static order, row by row.
//!
//! Up-looking: row k of L solves L₁..ₖ₋₁ D₁..ₖ₋₁ l = a, the part of column k above the diagonal (Davis 2005,
//! *Algorithm 849: a concise sparse Cholesky factorization package*). There is no pivoting: the matrix has to be
//! strongly factorizable, which regularization makes it (Vanderbei 1995, *Symmetric quasidefinite matrices*). The
//! inertia is that of D. The order is that of minimum degree (Amestoy, Davis & Duff 1996).

use super::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::problem::Pattern;

/// A pivot that cancels to less than this share of its terms has no sign.
pub(super) const CANCELLED: f64 = 1e-15;

/// Memory and symbolic factorization for one pattern.
#[derive(Clone, Debug)]
pub struct SparseLdl {
    /// The place in the matrix of the k-th unknown that is eliminated.
    order: Vec<u32>,
    /// Columns of the permuted upper triangle: row and number of the entry. The diagonal is apart.
    starts: Vec<u32>,
    rows: Vec<u32>,
    sources: Vec<u32>,
    diagonal_sources: Vec<u32>,
    /// Rows of L: columns, ascending, and where the entry is among the columns of L.
    row_starts: Vec<u32>,
    row_columns: Vec<u32>,
    places: Vec<u32>,
    /// Columns of L.
    column_starts: Vec<u32>,
    column_rows: Vec<u32>,
    entries: Vec<f64>,
    pivots: Vec<f64>,
    inverse: Vec<f64>,
    work: Vec<f64>,
}

pub(super) const NONE: u32 = u32::MAX;

impl SparseLdl {
    /// Orders the unknowns and finds where L has entries.
    pub fn new(pattern: &Pattern) -> Self {
        let n = pattern.n_rows();
        let (order, inverse) = minimum_degree(pattern);
        let mut columns: Vec<Vec<(u32, u32)>> = vec![Vec::new(); n];
        let mut diagonal_sources = vec![NONE; n];
        for row in 0..n {
            let range = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, entry) in pattern.row(row).iter().zip(range) {
                let (i, j) = (inverse[row], inverse[column as usize]);
                if i == j {
                    diagonal_sources[i as usize] = entry as u32;
                } else {
                    columns[i.max(j) as usize].push((i.min(j), entry as u32));
                }
            }
        }
        let mut starts = vec![0];
        let (mut rows, mut sources) = (Vec::new(), Vec::new());
        for column in &columns {
            rows.extend(column.iter().map(|entry| entry.0));
            sources.extend(column.iter().map(|entry| entry.1));
            starts.push(rows.len() as u32);
        }
        let (row_starts, row_columns) = rows_of_factor(n, &starts, &rows);
        let (column_starts, column_rows, places) = columns_of_factor(n, &row_starts, &row_columns);
        SparseLdl {
            order,
            starts,
            rows,
            sources,
            diagonal_sources,
            row_starts,
            places,
            column_starts,
            entries: vec![0.0; row_columns.len()],
            row_columns,
            column_rows,
            pivots: vec![0.0; n],
            inverse: vec![0.0; n],
            work: vec![0.0; n],
        }
    }

    /// The number of entries of L below its diagonal.
    pub fn n_entries(&self) -> usize {
        self.entries.len()
    }
}

pub(super) fn minimum_degree(pattern: &Pattern) -> (Vec<u32>, Vec<u32>) {
    let starts: Vec<i64> = pattern.starts.iter().map(|&start| start as i64).collect();
    let columns: Vec<i64> = pattern.columns.iter().map(|&c| i64::from(c)).collect();
    let n = pattern.n_rows();
    let (order, inverse, _) = amd::order(n as i64, &starts, &columns, &amd::Control::default())
        .expect("the columns of a pattern are within its rows");
    let narrow = |list: Vec<i64>| list.into_iter().map(|i| i as u32).collect();
    (narrow(order), narrow(inverse))
}

/// Row k of L reaches up the elimination tree from the entries of column k.
pub(super) fn rows_of_factor(n: usize, starts: &[u32], rows: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut parent = vec![NONE; n];
    let mut seen = vec![NONE; n];
    let mut row_starts = vec![0];
    let mut row_columns: Vec<u32> = Vec::new();
    for k in 0..n {
        seen[k] = k as u32;
        let first = row_columns.len();
        for &row in &rows[starts[k] as usize..starts[k + 1] as usize] {
            let mut i = row as usize;
            while seen[i] != k as u32 {
                seen[i] = k as u32;
                row_columns.push(i as u32);
                if parent[i] == NONE {
                    parent[i] = k as u32;
                }
                i = parent[i] as usize;
            }
        }
        row_columns[first..].sort_unstable();
        row_starts.push(row_columns.len() as u32);
    }
    (row_starts, row_columns)
}

/// The same entries column by column, and where each is there.
pub(super) fn columns_of_factor(
    n: usize,
    row_starts: &[u32],
    row_columns: &[u32],
) -> (Vec<u32>, Vec<u32>, Vec<u32>) {
    let mut starts = vec![0; n + 1];
    for &column in row_columns {
        starts[column as usize + 1] += 1;
    }
    for column in 0..n {
        starts[column + 1] += starts[column];
    }
    let mut next = starts.clone();
    let mut rows = vec![0; row_columns.len()];
    let mut places = vec![0; row_columns.len()];
    for k in 0..n {
        for entry in row_starts[k] as usize..row_starts[k + 1] as usize {
            let place = &mut next[row_columns[entry] as usize];
            rows[*place as usize] = k as u32;
            places[entry] = *place;
            *place += 1;
        }
    }
    (starts, rows, places)
}

impl KktSolver for SparseLdl {
    fn factor(&mut self, values: &[f64]) -> Result<Inertia, FactorFailure> {
        let n = self.pivots.len();
        let mut positive = 0;
        self.work.fill(0.0);
        for k in 0..n {
            let column = self.starts[k] as usize..self.starts[k + 1] as usize;
            for (&row, &source) in self.rows[column.clone()].iter().zip(&self.sources[column]) {
                self.work[row as usize] = values[source as usize];
            }
            let mut pivot = match self.diagonal_sources[k] {
                NONE => 0.0,
                source => values[source as usize],
            };
            let mut size = pivot.abs();
            // yᵢ = aᵢ - Σ lᵢⱼ yⱼ,  lₖᵢ = yᵢ / dᵢ,  dₖ = aₖₖ - Σ lₖᵢ yᵢ
            for entry in self.row_starts[k] as usize..self.row_starts[k + 1] as usize {
                let i = self.row_columns[entry] as usize;
                let place = self.places[entry] as usize;
                let y = std::mem::take(&mut self.work[i]);
                let known = self.column_starts[i] as usize..place;
                for (&row, &l) in self.column_rows[known.clone()]
                    .iter()
                    .zip(&self.entries[known])
                {
                    self.work[row as usize] -= l * y;
                }
                let l = y * self.inverse[i];
                self.entries[place] = l;
                pivot -= l * y;
                size += (l * y).abs();
            }
            if !pivot.is_finite() {
                return Err(FactorFailure::NotFinite);
            }
            if pivot.abs() <= CANCELLED * size || pivot.abs() < f64::MIN_POSITIVE {
                return Err(FactorFailure::ZeroPivot(self.order[k] as usize));
            }
            positive += usize::from(pivot > 0.0);
            self.pivots[k] = pivot;
            self.inverse[k] = pivot.recip();
        }
        Ok(Inertia {
            positive,
            negative: n - positive,
        })
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        let n = self.pivots.len();
        let work = &mut self.work;
        for (value, &place) in work.iter_mut().zip(&self.order) {
            *value = rhs[place as usize];
        }
        for k in 0..n {
            let value = work[k];
            let column = self.column_starts[k] as usize..self.column_starts[k + 1] as usize;
            for (&row, &l) in self.column_rows[column.clone()]
                .iter()
                .zip(&self.entries[column])
            {
                work[row as usize] -= l * value;
            }
        }
        for k in (0..n).rev() {
            let column = self.column_starts[k] as usize..self.column_starts[k + 1] as usize;
            let mut value = work[k] / self.pivots[k];
            for (&row, &l) in self.column_rows[column.clone()]
                .iter()
                .zip(&self.entries[column])
            {
                value -= l * work[row as usize];
            }
            work[k] = value;
        }
        for (&value, &place) in work.iter().zip(&self.order) {
            rhs[place as usize] = value;
        }
    }
}

#[cfg(test)]
#[path = "ldl_tests.rs"]
pub(super) mod tests;
