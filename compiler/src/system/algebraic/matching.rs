//! Which equation determines which unknown: a maximum matching, and the blocks of its triangular order.
//!
//! Where some rows cannot be matched, the rows that an alternating path reaches from one of them hold fewer unknowns
//! than they are (Dulmage & Mendelsohn 1958). A row depends on the rows of the other unknowns in it; what depends on
//! each other is a block, and blocks come after those that they depend on (Pothen & Fan 1990).

use petgraph::algo::tarjan_scc;
use petgraph::graph::{DiGraph, NodeIndex};

/// A matching of rows with unknowns.
#[derive(Clone)]
pub(crate) struct Matching {
    /// The unknown of every row.
    pub of_row: Vec<Option<usize>>,
    /// The row of every unknown.
    pub of_unknown: Vec<Option<usize>>,
}

impl Matching {
    /// A maximum matching of rows that hold these unknowns.
    pub(crate) fn of(rows: &[Vec<usize>], unknowns: usize) -> Self {
        let mut matching = Matching {
            of_row: vec![None; rows.len()],
            of_unknown: vec![None; unknowns],
        };
        for row in 0..rows.len() {
            // A row that finds none now finds none later.
            let _ = matching.augment(rows, row);
        }
        matching
    }

    /// Gives a row without an unknown one; else the rows that share too few, this one first.
    pub(crate) fn augment(&mut self, rows: &[Vec<usize>], row: usize) -> Result<(), Vec<usize>> {
        let mut reached = vec![row];
        let mut came_from: Vec<Option<usize>> = vec![None; self.of_unknown.len()];
        let mut at = 0;
        while at < reached.len() {
            let from = reached[at];
            at += 1;
            for &unknown in &rows[from] {
                if came_from[unknown].is_some() {
                    continue;
                }
                came_from[unknown] = Some(from);
                let Some(next) = self.of_unknown[unknown] else {
                    self.exchange(unknown, row, &came_from);
                    return Ok(());
                };
                reached.push(next);
            }
        }
        Err(reached)
    }

    /// Exchanges what is matched along the path that ends in a free unknown.
    fn exchange(&mut self, mut unknown: usize, first: usize, came_from: &[Option<usize>]) {
        while let Some(row) = came_from[unknown] {
            let before = self.of_row[row].replace(unknown);
            self.of_unknown[unknown] = Some(row);
            match before {
                Some(before) if row != first => unknown = before,
                _ => break,
            }
        }
    }

    /// Releases a row.
    pub(crate) fn release(&mut self, row: usize) {
        if let Some(unknown) = self.of_row[row].take() {
            self.of_unknown[unknown] = None;
        }
    }

    /// The blocks of rows that depend on each other, each after those that it depends on.
    pub(crate) fn blocks(&self, rows: &[Vec<usize>]) -> Vec<Vec<usize>> {
        let mut graph: DiGraph<usize, ()> = DiGraph::new();
        for row in 0..rows.len() {
            graph.add_node(row);
        }
        for (row, unknowns) in rows.iter().enumerate() {
            let others = unknowns
                .iter()
                .filter_map(|&unknown| self.of_unknown[unknown]);
            for other in others.filter(|&other| other != row) {
                graph.add_edge(NodeIndex::new(row), NodeIndex::new(other), ());
            }
        }
        let blocks = tarjan_scc(&graph).into_iter().map(|block| {
            let mut rows: Vec<usize> = block.into_iter().map(|node| graph[node]).collect();
            rows.sort_unstable();
            rows
        });
        blocks.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_share_too_few_unknowns_are_found() {
        let rows = vec![vec![0, 1], vec![1], vec![1], vec![2, 0]];
        let mut matching = Matching::of(&rows, 4);
        assert_eq!(matching.of_row, [Some(0), Some(1), None, Some(2)]);
        assert_eq!(matching.augment(&rows, 2), Err(vec![2, 1]));
    }

    #[test]
    fn blocks_come_after_what_they_depend_on() {
        // 0 and 2 depend on each other and on 1; 3 depends on all.
        let rows = vec![vec![0, 1, 2], vec![1], vec![0, 2], vec![3, 2]];
        let matching = Matching::of(&rows, 4);
        assert_eq!(matching.blocks(&rows), [vec![1], vec![0, 2], vec![3]]);
    }
}
