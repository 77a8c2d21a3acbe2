//! Sparse A = P' L D L' P with D diagonal in a static order, column by column.
//!
//! Right-looking: when column j of L is known, its products with itself leave what has yet to be eliminated; where
//! each of them goes is found once. There is no pivoting: the matrix has to be strongly factorizable, which
//! regularization makes it (Vanderbei 1995, *Symmetric quasidefinite matrices*). The inertia is that of D. The pattern
//! of L follows from the elimination tree (Davis 2005, *Algorithm 849: a concise sparse Cholesky factorization
//! package*), the order is that of minimum degree (Amestoy, Davis & Duff 1996).

use std::sync::Arc;

use super::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use crate::runtime::limit::work;

/// A pivot that cancels to less than this share of its terms has no sign.
pub(super) const CANCELLED: f64 = 1e-15;

/// Memory for matrices of one pattern.
#[derive(Clone, Debug)]
pub struct SparseLdl {
    analysis: Arc<Analysis>,
    /// L below its diagonal.
    entries: Vec<f64>,
    pivots: Vec<f64>,
    inverse: Vec<f64>,
    /// The sums of the absolute values of the terms of pivots.
    sizes: Vec<f64>,
    /// The column under elimination, before and after the division by its pivot; or a right-hand side.
    column: Vec<f64>,
    scaled: Vec<f64>,
    work: Vec<f64>,
}

/// The symbolic factorization of one pattern.
#[derive(Debug)]
pub(super) struct Analysis {
    /// The place in the matrix of the k-th unknown that is eliminated.
    order: Vec<u32>,
    /// Entries of the matrix off its diagonal, and which entries of L they become.
    sources: Vec<u32>,
    places: Vec<u32>,
    diagonal_sources: Vec<u32>,
    /// Columns of L: rows, ascending.
    starts: Vec<u32>,
    rows: Vec<u32>,
    /// Where the products of entries p > q of a column go, column by column and q by q, and where those of a column
    /// start. Of columns that are long they are runs, length and first target of each: there L is nearly full, and one
    /// target for each product would take more memory than L itself.
    targets: Vec<u32>,
    target_starts: Vec<usize>,
}

pub(super) const NONE: u32 = u32::MAX;

/// Columns up to this length are eliminated by unrolled loops.
const SHORT: usize = 16;

impl SparseLdl {
    /// Memory for matrices of a pattern.
    pub fn new(pattern: &Pattern) -> Self {
        SparseLdl::of(Arc::new(Analysis::new(pattern)))
    }

    pub(super) fn of(analysis: Arc<Analysis>) -> Self {
        let n = analysis.order.len();
        let lengths = analysis.starts.windows(2).map(|pair| pair[1] - pair[0]);
        let column = vec![0.0; lengths.max().unwrap_or(0) as usize];
        SparseLdl {
            entries: vec![0.0; analysis.rows.len()],
            pivots: vec![0.0; n],
            inverse: vec![0.0; n],
            sizes: vec![0.0; n],
            scaled: column.clone(),
            column,
            work: vec![0.0; n],
            analysis,
        }
    }

    /// The number of entries of L below its diagonal.
    pub fn n_entries(&self) -> usize {
        self.entries.len()
    }
}

impl Analysis {
    /// Orders the unknowns and finds where L has entries.
    pub fn new(pattern: &Pattern) -> Self {
        let n = pattern.n_rows();
        let (order, inverse) = minimum_degree(pattern);
        let mut diagonal_sources = vec![NONE; n];
        // Columns of the upper triangle.
        let mut upper_starts = vec![0_u32; n + 1];
        let entries = || {
            (0..n).flat_map(|row| {
                let sources = pattern.starts[row] as u32..;
                let columns = pattern.row(row).iter().zip(sources);
                columns.map(move |(&column, source)| (row, column as usize, source))
            })
        };
        for (row, column, source) in entries() {
            let (i, j) = (inverse[row], inverse[column]);
            if i == j {
                diagonal_sources[i as usize] = source;
            } else {
                upper_starts[i.max(j) as usize + 1] += 1;
            }
        }
        for k in 0..n {
            upper_starts[k + 1] += upper_starts[k];
        }
        let mut next = upper_starts.clone();
        let mut upper = vec![(0, 0); upper_starts[n] as usize];
        for (row, column, source) in entries() {
            let (i, j) = (inverse[row], inverse[column]);
            if i != j {
                let place = &mut next[i.max(j) as usize];
                upper[*place as usize] = (i.min(j), source);
                *place += 1;
            }
        }
        let upper_rows: Vec<u32> = upper.iter().map(|entry| entry.0).collect();
        let (row_starts, row_columns) = rows_of_factor(n, &upper_starts, &upper_rows);
        let (starts, rows, _) = columns_of_factor(n, &row_starts, &row_columns);
        let place = |row: u32, column: u32| {
            let range = starts[column as usize] as usize..starts[column as usize + 1] as usize;
            let found = rows[range.clone()].binary_search(&row);
            (range.start + found.expect("L has what it fills in")) as u32
        };
        let (mut sources, mut places) = (Vec::new(), Vec::new());
        for row in 0..n {
            let range = upper_starts[row] as usize..upper_starts[row + 1] as usize;
            for &(column, source) in &upper[range] {
                sources.push(source);
                places.push(place(row as u32, column));
            }
        }
        let (mut targets, mut target_starts) = (Vec::new(), vec![0]);
        for column in 0..n {
            let below = &rows[starts[column] as usize..starts[column + 1] as usize];
            for (q, &column) in below.iter().enumerate() {
                let range = starts[column as usize] as usize..starts[column as usize + 1] as usize;
                let mut of_column = range.clone().zip(&rows[range]);
                // Both lists ascend, and the rows below are among those of the column.
                let found = below[q + 1..].iter().map(|row| {
                    let found = of_column.find(|(_, other)| *other == row);
                    found.expect("L has what it fills in").0 as u32
                });
                match below.len() <= SHORT {
                    true => targets.extend(found),
                    false => extend_with_runs(&mut targets, found),
                }
            }
            target_starts.push(targets.len());
        }
        Analysis {
            order,
            sources,
            places,
            diagonal_sources,
            starts,
            rows,
            targets,
            target_starts,
        }
    }

    /// How many numbers of 4 bytes it holds, about.
    pub fn size(&self) -> usize {
        let entries = self.rows.len() + 2 * self.sources.len();
        entries + self.targets.len() + 5 * self.order.len()
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

/// Appends length and first number of each run of consecutive numbers.
fn extend_with_runs(runs: &mut Vec<u32>, numbers: impl Iterator<Item = u32>) {
    let first_run = runs.len();
    for number in numbers {
        match runs[first_run..].last_chunk_mut() {
            Some([length, first]) if *first + *length == number => *length += 1,
            _ => runs.extend([1, number]),
        }
    }
}

/// Subtracts the products of a column with itself from where they go.
fn eliminate(entries: &mut [f64], targets: &[u32], column: &[f64], scaled: &[f64]) {
    macro_rules! unrolled {
        ($($count:literal)*) => {
            match column.len() {
                0 | 1 => {}
                $($count => eliminate_short::<$count>(entries, targets, column, scaled),)*
                _ => eliminate_long(entries, targets, column, scaled),
            }
        };
    }
    unrolled!(2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);
}

/// The same for C entries: loops whose ends are known to the compiler are twice as fast.
#[allow(
    clippy::needless_range_loop,
    reason = "ranges whose ends are constants are what is unrolled"
)]
fn eliminate_short<const C: usize>(
    entries: &mut [f64],
    targets: &[u32],
    column: &[f64],
    scaled: &[f64],
) {
    let (column, scaled) = (&column[..C], &scaled[..C]);
    let targets = &targets[..C * (C - 1) / 2];
    let mut t = 0;
    for q in 0..C {
        for p in q + 1..C {
            entries[targets[t] as usize] -= scaled[p] * column[q];
            t += 1;
        }
    }
}

fn eliminate_long(entries: &mut [f64], runs: &[u32], column: &[f64], scaled: &[f64]) {
    let mut runs = runs.chunks_exact(2);
    for (q, &y) in column.iter().enumerate() {
        let mut below = &scaled[q + 1..];
        while !below.is_empty() {
            let run = runs.next().expect("runs cover the column");
            let (length, first) = (run[0] as usize, run[1] as usize);
            let (now, later) = below.split_at(length);
            for (entry, &l) in entries[first..first + length].iter_mut().zip(now) {
                *entry -= l * y;
            }
            below = later;
        }
    }
}

impl KktSolver for SparseLdl {
    fn factor(&mut self, values: &[f64]) -> Result<Inertia, FactorFailure> {
        let (n, analysis) = (self.pivots.len(), &*self.analysis);
        self.entries.fill(0.0);
        for (&source, &place) in analysis.sources.iter().zip(&analysis.places) {
            self.entries[place as usize] = values[source as usize];
        }
        for k in 0..n {
            let pivot = match analysis.diagonal_sources[k] {
                NONE => 0.0,
                source => values[source as usize],
            };
            self.pivots[k] = pivot;
            self.sizes[k] = pivot.abs();
        }
        let mut positive = 0;
        let (mut start, mut first) = (0, 0);
        for k in 0..n {
            let pivot = self.pivots[k];
            if !pivot.is_finite() {
                return Err(FactorFailure::NotFinite);
            }
            if pivot.abs() <= CANCELLED * self.sizes[k] || pivot.abs() < f64::MIN_POSITIVE {
                return Err(FactorFailure::ZeroPivot(analysis.order[k] as usize));
            }
            positive += usize::from(pivot > 0.0);
            let inverse = pivot.recip();
            self.inverse[k] = inverse;
            // y = a,  l = y / d,  aᵢⱼ -= lᵢ yⱼ for all pairs of rows of the column
            let end = analysis.starts[k + 1] as usize;
            let last = analysis.target_starts[k + 1];
            let count = end - start;
            work::add(1 + count * (count + 1) / 2);
            let (column, scaled) = (&mut self.column[..count], &mut self.scaled[..count]);
            let rows = &analysis.rows[start..end];
            let entries = &mut self.entries[start..end];
            for q in 0..count {
                let y = entries[q];
                let l = y * inverse;
                (column[q], scaled[q], entries[q]) = (y, l, l);
                let row = rows[q] as usize;
                self.pivots[row] -= l * y;
                self.sizes[row] += (l * y).abs();
            }
            eliminate(
                &mut self.entries,
                &analysis.targets[first..last],
                column,
                scaled,
            );
            (start, first) = (end, last);
        }
        Ok(Inertia {
            positive,
            negative: n - positive,
        })
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        work::add(2 * self.entries.len());
        let (analysis, work) = (&*self.analysis, &mut self.work);
        for (value, &place) in work.iter_mut().zip(&analysis.order) {
            *value = rhs[place as usize];
        }
        let mut start = 0;
        for (k, &end) in analysis.starts[1..].iter().enumerate() {
            let value = work[k];
            let column = start..end as usize;
            start = end as usize;
            for (&row, &l) in analysis.rows[column.clone()]
                .iter()
                .zip(&self.entries[column])
            {
                work[row as usize] -= l * value;
            }
        }
        for (k, &next) in analysis.starts[..self.inverse.len()]
            .iter()
            .enumerate()
            .rev()
        {
            let column = next as usize..start;
            start = next as usize;
            let mut value = work[k] * self.inverse[k];
            for (&row, &l) in analysis.rows[column.clone()]
                .iter()
                .zip(&self.entries[column])
            {
                value -= l * work[row as usize];
            }
            work[k] = value;
        }
        for (&value, &place) in work.iter().zip(&analysis.order) {
            rhs[place as usize] = value;
        }
    }
}

#[cfg(test)]
#[path = "ldl_tests.rs"]
pub(super) mod tests;
