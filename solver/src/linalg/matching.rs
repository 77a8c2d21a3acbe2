//! Rows of a sparse matrix with one column each, so that the product of the entries taken is large.
//!
//! Shortest augmenting paths (Duff & Koster 2001, *On algorithms for permuting large entries to the diagonal of a
//! sparse matrix*), with a limit of work: rows that it leaves out have no column.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No row or column.
pub const NONE: u32 = u32::MAX;
/// How often all entries may be looked at.
const PASSES: usize = 50;

/// A matrix by rows: where they start, columns, and the weights of the entries, zero or more.
#[derive(Clone, Copy, Debug)]
pub struct Weights<'a> {
    /// Where the entries of a row start; one more than there are rows.
    pub starts: &'a [u32],
    /// Columns of the entries.
    pub columns: &'a [u32],
    /// Their weights.
    pub weights: &'a [f64],
    /// The number of columns.
    pub n_columns: usize,
}

/// A length that is ordered.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Length(f64);

impl Eq for Length {}

impl PartialOrd for Length {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Length {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// The column of every row, or [`NONE`].
pub fn matching(matrix: &Weights<'_>) -> Vec<u32> {
    let Weights {
        starts,
        columns,
        weights,
        n_columns,
    } = *matrix;
    let n_rows = starts.len() - 1;
    let range = |row: usize| starts[row] as usize..starts[row + 1] as usize;
    // The cost of an entry, at least zero: the logarithm of the largest one of its row over it.
    let mut costs = vec![f64::INFINITY; columns.len()];
    for row in 0..n_rows {
        let largest = weights[range(row)].iter().fold(0.0, |m: f64, &w| m.max(w));
        for entry in range(row).filter(|&entry| weights[entry] > 0.0) {
            costs[entry] = (largest / weights[entry]).ln();
        }
    }
    let mut column_of = vec![NONE; n_rows];
    let mut row_of = vec![NONE; n_columns];
    let mut free: Vec<usize> = Vec::new();
    for (row, place) in column_of.iter_mut().enumerate() {
        let best = range(row).find(|&e| costs[e] == 0.0 && row_of[columns[e] as usize] == NONE);
        match best {
            Some(entry) => {
                *place = columns[entry];
                row_of[columns[entry] as usize] = row as u32;
            }
            None => free.push(row),
        }
    }
    // Potentials: costs less those of row and column are at least zero, and zero where matched.
    let (mut of_rows, mut of_columns) = (vec![0.0; n_rows], vec![0.0; n_columns]);
    let mut length = vec![f64::INFINITY; n_columns];
    let mut from = vec![NONE; n_columns];
    let mut is_done = vec![false; n_columns];
    let mut touched: Vec<u32> = Vec::new();
    let mut heap: BinaryHeap<(Reverse<Length>, u32)> = BinaryHeap::new();
    let mut work = PASSES * columns.len();
    for start in free {
        let (mut row, mut reached) = (start, 0.0);
        let end = loop {
            work = work.saturating_sub(range(row).len());
            for entry in range(row) {
                let column = columns[entry] as usize;
                let along = reached + costs[entry] - of_rows[row] - of_columns[column];
                if !is_done[column] && along < length[column] {
                    if length[column] == f64::INFINITY {
                        touched.push(column as u32);
                    }
                    length[column] = along;
                    from[column] = row as u32;
                    heap.push((Reverse(Length(along)), column as u32));
                }
            }
            let next = loop {
                match heap.pop() {
                    Some((_, column)) if is_done[column as usize] => {}
                    other => break other,
                }
            };
            let Some((Reverse(Length(along)), column)) = next.filter(|_| work > 0) else {
                break None;
            };
            is_done[column as usize] = true;
            if row_of[column as usize] == NONE {
                break Some((column, along));
            }
            (row, reached) = (row_of[column as usize] as usize, along);
        };
        if let Some((mut column, shortest)) = end {
            for &j in touched.iter().filter(|&&j| is_done[j as usize]) {
                let change = shortest - length[j as usize];
                of_columns[j as usize] -= change;
                if row_of[j as usize] != NONE {
                    of_rows[row_of[j as usize] as usize] += change;
                }
            }
            of_rows[start] += shortest;
            loop {
                let row = from[column as usize];
                row_of[column as usize] = row;
                let next = std::mem::replace(&mut column_of[row as usize], column);
                if row as usize == start {
                    break;
                }
                column = next;
            }
        }
        for column in touched.drain(..) {
            length[column as usize] = f64::INFINITY;
            is_done[column as usize] = false;
        }
        heap.clear();
    }
    column_of
}

#[cfg(test)]
#[path = "matching_tests.rs"]
mod tests;
