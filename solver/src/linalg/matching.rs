//! Rows of a sparse matrix with one column each, so that the product of the entries taken is large.
//!
//! Shortest augmenting paths (Duff & Koster 2001, *On algorithms for permuting large entries to the diagonal of a
//! sparse matrix*), with a limit of work: rows that it leaves out have no column.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::Range;

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
    let (mut matched, free) = Matched::at_no_cost(matrix);
    let mut paths = Paths::new(matrix);
    for start in free {
        if let Some((end, length)) = paths.find(&matched, start) {
            matched.reprice(&paths, start, length);
            matched.augment(&paths, start, end);
        }
        paths.clear();
    }
    matched.column_of
}

impl Weights<'_> {
    /// Where the entries of a row are.
    fn row(&self, row: usize) -> Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// The cost of every entry, at least zero: the logarithm of the largest one of its row over it.
    fn costs(&self) -> Vec<f64> {
        let mut costs = vec![f64::INFINITY; self.columns.len()];
        for row in 0..self.starts.len() - 1 {
            let weights = &self.weights[self.row(row)];
            let largest = weights.iter().fold(0.0, |m: f64, &w| m.max(w));
            for (cost, weight) in costs[self.row(row)].iter_mut().zip(weights) {
                if *weight > 0.0 {
                    *cost = (largest / weight).ln();
                }
            }
        }
        costs
    }
}

/// Rows and columns that have each other, and potentials: costs less those of row and column are at least zero, and
/// zero where matched.
struct Matched<'m> {
    matrix: &'m Weights<'m>,
    costs: Vec<f64>,
    column_of: Vec<u32>,
    row_of: Vec<u32>,
    of_rows: Vec<f64>,
    of_columns: Vec<f64>,
}

impl<'m> Matched<'m> {
    /// Gives each row in turn a free column that costs nothing; those that find none are left.
    fn at_no_cost(matrix: &'m Weights<'m>) -> (Self, Vec<usize>) {
        let costs = matrix.costs();
        let n_rows = matrix.starts.len() - 1;
        let mut column_of = vec![NONE; n_rows];
        let mut row_of = vec![NONE; matrix.n_columns];
        let mut free = Vec::new();
        for (row, place) in column_of.iter_mut().enumerate() {
            let is_free = |e: &usize| row_of[matrix.columns[*e] as usize] == NONE;
            let mut entries = matrix.row(row);
            match entries.find(|e| costs[*e] == 0.0 && is_free(e)) {
                Some(entry) => {
                    *place = matrix.columns[entry];
                    row_of[*place as usize] = row as u32;
                }
                None => free.push(row),
            }
        }
        let matched = Matched {
            matrix,
            costs,
            column_of,
            row_of,
            of_rows: vec![0.0; n_rows],
            of_columns: vec![0.0; matrix.n_columns],
        };
        (matched, free)
    }

    /// Moves the potentials so that the shortest path from a row costs nothing.
    fn reprice(&mut self, paths: &Paths, start: usize, shortest: f64) {
        let done = paths.touched.iter().map(|&column| column as usize);
        for column in done.filter(|&column| paths.is_done[column]) {
            let change = shortest - paths.length[column];
            self.of_columns[column] -= change;
            if self.row_of[column] != NONE {
                self.of_rows[self.row_of[column] as usize] += change;
            }
        }
        self.of_rows[start] += shortest;
    }

    /// Gives every row of the path to a column the next column on it.
    fn augment(&mut self, paths: &Paths, start: usize, end: u32) {
        let mut column = end;
        loop {
            let row = paths.from[column as usize];
            self.row_of[column as usize] = row;
            let next = std::mem::replace(&mut self.column_of[row as usize], column);
            if row as usize == start {
                break;
            }
            column = next;
        }
    }
}

/// Shortest paths from a row to columns.
struct Paths {
    length: Vec<f64>,
    /// The row before each column.
    from: Vec<u32>,
    is_done: Vec<bool>,
    /// Columns with a length.
    touched: Vec<u32>,
    heap: BinaryHeap<(Reverse<Length>, u32)>,
    /// How many entries may still be looked at.
    work: usize,
}

impl Paths {
    fn new(matrix: &Weights<'_>) -> Self {
        Paths {
            length: vec![f64::INFINITY; matrix.n_columns],
            from: vec![NONE; matrix.n_columns],
            is_done: vec![false; matrix.n_columns],
            touched: Vec::new(),
            heap: BinaryHeap::new(),
            work: PASSES * matrix.columns.len(),
        }
    }

    /// The nearest column that no row has, and how far it is; none where there is none, or no work left.
    fn find(&mut self, matched: &Matched<'_>, start: usize) -> Option<(u32, f64)> {
        let Matched {
            matrix,
            costs,
            of_rows,
            of_columns,
            ..
        } = matched;
        let (mut row, mut reached) = (start, 0.0);
        loop {
            self.work = self.work.saturating_sub(matrix.row(row).len());
            for entry in matrix.row(row) {
                let column = matrix.columns[entry] as usize;
                let along = reached + costs[entry] - of_rows[row] - of_columns[column];
                if !self.is_done[column] && along < self.length[column] {
                    if self.length[column] == f64::INFINITY {
                        self.touched.push(column as u32);
                    }
                    self.length[column] = along;
                    self.from[column] = row as u32;
                    self.heap.push((Reverse(Length(along)), column as u32));
                }
            }
            let (column, along) = self.nearest().filter(|_| self.work > 0)?;
            self.is_done[column as usize] = true;
            let owner = matched.row_of[column as usize];
            if owner == NONE {
                return Some((column, along));
            }
            (row, reached) = (owner as usize, along);
        }
    }

    /// The nearest column that is not done.
    fn nearest(&mut self) -> Option<(u32, f64)> {
        loop {
            let (Reverse(Length(along)), column) = self.heap.pop()?;
            if !self.is_done[column as usize] {
                return Some((column, along));
            }
        }
    }

    /// Forgets the paths.
    fn clear(&mut self) {
        for column in self.touched.drain(..) {
            self.length[column as usize] = f64::INFINITY;
            self.is_done[column as usize] = false;
        }
        self.heap.clear();
    }
}

#[cfg(test)]
#[path = "matching_tests.rs"]
mod tests;
