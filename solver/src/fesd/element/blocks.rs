//! Linear equations that fall into blocks which share no variable, as those of switches do that act on nothing in
//! common: a chain of n relays costs n small factorizations, not one of size n.

use std::collections::BTreeMap;
use std::ops::Range;

use petgraph::unionfind::UnionFind;

use crate::linalg::{BlockLu, Singular};

/// A square matrix and its factors, block by block.
pub(crate) struct Blocks {
    /// The entries of each row, which are the columns of its block.
    rows: Vec<Range<usize>>,
    /// The place of each column in its block.
    columns: Vec<usize>,
    /// The places of rows and columns where blocks follow each other.
    order: [Vec<usize>; 2],
    entries: Vec<f64>,
    permuted: Vec<f64>,
    lu: BlockLu,
}

impl Blocks {
    /// Memory for an n × n matrix with entries nowhere but at these (row, column).
    pub fn new(n: usize, entries: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut sets = UnionFind::<usize>::new(2 * n);
        for (row, column) in entries {
            sets.union(n + row, column);
        }
        // The columns and rows of each.
        let mut blocks: BTreeMap<usize, [Vec<usize>; 2]> = BTreeMap::new();
        for (i, set) in sets.into_labeling().into_iter().enumerate() {
            blocks.entry(set).or_default()[i / n].push(i % n);
        }
        if blocks
            .values()
            .any(|[columns, rows]| columns.len() != rows.len())
        {
            // No numbers make it regular, which its factorization will say.
            blocks = BTreeMap::from([(0, [(0..n).collect(), (0..n).collect()])]);
        }
        let (mut rows, mut columns) = (vec![0..0; n], vec![0; n]);
        let mut order = [vec![0; n], vec![0; n]];
        let (mut starts, mut first) = (vec![0], 0);
        for [of_columns, of_rows] in blocks.into_values() {
            let (start, width) = (starts[starts.len() - 1], of_columns.len());
            for (at, column) in of_columns.into_iter().enumerate() {
                (columns[column], order[1][column]) = (at, start + at);
            }
            for (at, row) in of_rows.into_iter().enumerate() {
                rows[row] = first + at * width..first + (at + 1) * width;
                order[0][row] = start + at;
            }
            first += width * width;
            starts.push(start + width);
        }
        let mut lu = BlockLu::default();
        lu.shape(&starts);
        Blocks {
            rows,
            columns,
            order,
            entries: vec![0.0; first],
            permuted: vec![0.0; n],
            lu,
        }
    }

    /// Sets all entries to zero.
    pub fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// Sets the entries of a row to zero.
    pub fn clear_row(&mut self, row: usize) {
        self.entries[self.rows[row].clone()].fill(0.0);
    }

    /// An entry at one of the places it was made for.
    pub fn entry(&mut self, row: usize, column: usize) -> &mut f64 {
        &mut self.entries[self.rows[row].clone()][self.columns[column]]
    }

    /// Overwrites `rhs` with the solution.
    pub fn solve(&mut self, rhs: &mut [f64]) -> Result<(), Singular> {
        self.lu.load(&self.entries);
        self.lu.factor()?;
        for (value, &place) in rhs.iter().zip(&self.order[0]) {
            self.permuted[place] = *value;
        }
        self.lu.solve(&mut self.permuted);
        for (value, &place) in rhs.iter_mut().zip(&self.order[1]) {
            *value = self.permuted[place];
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Solves for the row sums, so that all unknowns are one.
    fn solved(n: usize, entries: &[(usize, usize, f64)]) -> (usize, Result<Vec<f64>, Singular>) {
        let mut blocks = Blocks::new(n, entries.iter().map(|&(row, column, _)| (row, column)));
        let mut rhs = vec![0.0; n];
        blocks.clear();
        for &(row, column, value) in entries {
            *blocks.entry(row, column) = value;
            rhs[row] += value;
        }
        let found = blocks.solve(&mut rhs);
        (blocks.entries.len(), found.map(|()| rhs))
    }

    #[test]
    fn blocks_are_found_and_solved() {
        // Rows 0 and 3 share columns 1 and 4, row 1 has column 2, and rows 2 and 4 columns 0 and 3.
        let entries = [
            (0, 1, 2.0),
            (0, 4, -3.0),
            (3, 4, 5.0),
            (1, 2, 0.5),
            (2, 0, 1.0),
            (2, 3, 7.0),
            (4, 0, 4.0),
            (4, 3, 1.0),
        ];
        let (size, found) = solved(5, &entries);
        assert_eq!(size, 4 + 1 + 4);
        for one in found.expect("it is regular") {
            assert!((one - 1.0).abs() < 1e-15, "{one}");
        }
    }

    #[test]
    fn a_block_with_more_rows_than_columns_is_singular() {
        let entries = [(0, 0, 1.0), (1, 0, 2.0), (2, 1, 3.0), (2, 2, 4.0)];
        assert!(solved(3, &entries).1.is_err());
    }
}
