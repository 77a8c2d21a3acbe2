//! Symmetric positive semidefinite A = L Lᵀ within an envelope, in memory that is kept from one matrix to the next.
//!
//! Row i of L is stored from the first column on in which row i of A has an entry (George & Liu 1981, chapter 4). The
//! order is that of Cuthill & McKee 1969, reversed: matrices of neighbours in the plane stay narrow. A pivot that is
//! rounding is replaced by a small share of its diagonal.

use super::dot;
use crate::runtime::limit::work;

/// Memory for a factorization.
#[derive(Clone, Debug, Default)]
pub struct Envelope {
    /// The unknown that is eliminated k-th, and when each one is.
    order: Vec<u32>,
    place: Vec<u32>,
    /// Where the rows of L start, diagonals last, and the end of the last one.
    starts: Vec<usize>,
    entries: Vec<f64>,
    work: Vec<f64>,
}

/// Pivots are no smaller than this share of their diagonal.
const LEAST: f64 = 1e-12;

const NONE: u32 = u32::MAX;

impl Envelope {
    /// Orders unknowns, of which i is beside `list[starts[i]..starts[i + 1]]`, and makes room for A = 0.
    pub fn arrange(&mut self, starts: &[usize], list: &[u32]) {
        let n = starts.len() - 1;
        let beside = |i: u32| &list[starts[i as usize]..starts[i as usize + 1]];
        let degree = |i: &u32| beside(*i).len();
        self.order.clear();
        self.place.clear();
        self.place.resize(n, NONE);
        for seed in 0..n as u32 {
            if self.place[seed as usize] != NONE {
                continue;
            }
            // The unknown that is reached last from any one is at an end.
            let first = self.order.len();
            for start in [Some(seed), None] {
                let start = start.unwrap_or_else(|| self.order[self.order.len() - 1]);
                for &i in &self.order[first..] {
                    self.place[i as usize] = NONE;
                }
                self.order.truncate(first);
                self.order.push(start);
                self.place[start as usize] = 0;
                let mut at = first;
                while at < self.order.len() {
                    let end = self.order.len();
                    for &other in beside(self.order[at]) {
                        if self.place[other as usize] == NONE {
                            self.place[other as usize] = 0;
                            self.order.push(other);
                        }
                    }
                    self.order[end..].sort_unstable_by_key(degree);
                    at += 1;
                }
            }
        }
        self.order.reverse();
        for (place, &i) in self.order.iter().enumerate() {
            self.place[i as usize] = place as u32;
        }
        self.starts.clear();
        self.starts.push(0);
        for (row, &i) in self.order.iter().enumerate() {
            let places = beside(i).iter().map(|&other| self.place[other as usize]);
            let first = places.fold(row as u32, u32::min) as usize;
            self.starts.push(self.starts[row] + row + 1 - first);
        }
        self.entries.clear();
        self.entries.resize(self.starts[n], 0.0);
        self.work.clear();
        self.work.resize(n, 0.0);
    }

    /// Sets A_ij and A_ji.
    pub fn set(&mut self, i: usize, j: usize, value: f64) {
        let (i, j) = (self.place[i] as usize, self.place[j] as usize);
        let (row, column) = (i.max(j), i.min(j));
        self.entries[self.starts[row + 1] - 1 - (row - column)] = value;
    }

    /// Factors A; false where a diagonal is not positive.
    pub fn factor(&mut self) -> bool {
        for i in 0..self.order.len() {
            let (done, rest) = self.entries.split_at_mut(self.starts[i]);
            let row = &mut rest[..self.starts[i + 1] - self.starts[i]];
            let first = i + 1 - row.len();
            work::add(row.len() * row.len() / 2);
            for j in first..i {
                let of_j = &done[self.starts[j]..self.starts[j + 1]];
                let of_first = j + 1 - of_j.len();
                let from = first.max(of_first);
                let known = dot(
                    &row[from - first..j - first],
                    &of_j[from - of_first..j - of_first],
                );
                row[j - first] = (row[j - first] - known) / of_j[of_j.len() - 1];
            }
            let (before, diagonal) = row.split_at_mut(i - first);
            let pivot = (diagonal[0] - dot(before, before)).max(LEAST * diagonal[0]);
            if pivot.is_nan() || pivot <= 0.0 || !pivot.is_finite() {
                return false;
            }
            diagonal[0] = pivot.sqrt();
        }
        true
    }

    /// Overwrites `rhs` with the solution for the matrix factored last.
    pub fn solve(&mut self, rhs: &mut [f64]) {
        let x = &mut self.work;
        for (x, &i) in x.iter_mut().zip(&self.order) {
            *x = rhs[i as usize];
        }
        let rows = || {
            self.starts
                .windows(2)
                .map(|ends| &self.entries[ends[0]..ends[1]])
        };
        for (i, row) in rows().enumerate() {
            let (before, diagonal) = row.split_at(row.len() - 1);
            x[i] = (x[i] - dot(before, &x[i - before.len()..i])) / diagonal[0];
        }
        for (i, row) in rows().enumerate().rev() {
            let (before, diagonal) = row.split_at(row.len() - 1);
            x[i] /= diagonal[0];
            let value = x[i];
            for (x, l) in x[i - before.len()..i].iter_mut().zip(before) {
                *x -= l * value;
            }
        }
        for (x, &i) in x.iter().zip(&self.order) {
            rhs[i as usize] = *x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Envelope;

    /// Neighbours in a grid of this width, numbered in another order, with 4.1 on the diagonal and -1 beside it.
    fn grid(width: usize, envelope: &mut Envelope) -> Vec<Vec<(usize, f64)>> {
        let n = width * width;
        let number = |x: usize, y: usize| (7 * (x + width * y) + 3) % n;
        let mut rows = vec![Vec::new(); n];
        for (x, y) in (0..width).flat_map(|x| (0..width).map(move |y| (x, y))) {
            let row = &mut rows[number(x, y)];
            row.push((number(x, y), 4.1));
            for (dx, dy) in [(0, 1), (1, 0), (2, 1), (1, 2)] {
                let (x, y) = (x + dx, y + dy);
                if (1..=width).contains(&x) && (1..=width).contains(&y) {
                    row.push((number(x - 1, y - 1), -1.0));
                }
            }
        }
        let (mut starts, mut list) = (vec![0], Vec::new());
        for row in &rows {
            list.extend(row.iter().map(|entry| entry.0 as u32));
            starts.push(list.len());
        }
        envelope.arrange(&starts, &list);
        for (i, row) in rows.iter().enumerate() {
            row.iter().for_each(|&(j, value)| envelope.set(i, j, value));
        }
        rows
    }

    #[test]
    fn a_grid_is_solved_in_a_narrow_envelope_and_memory_serves_again() {
        let mut envelope = Envelope::default();
        for width in [10, 4, 9] {
            let rows = grid(width, &mut envelope);
            let n = width * width;
            assert!(envelope.entries.len() <= n * (2 * width), "{width}");
            assert!(envelope.factor());
            let x: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
            let product = |row: &Vec<(usize, f64)>| row.iter().map(|&(j, a)| a * x[j]).sum();
            let mut rhs: Vec<f64> = rows.iter().map(product).collect();
            envelope.solve(&mut rhs);
            for (found, exact) in rhs.iter().zip(&x) {
                assert!((found - exact).abs() <= 1e-13, "{found}, not {exact}");
            }
        }
    }

    #[test]
    fn what_depends_on_others_gets_a_small_pivot() {
        // Rank one, with a right side in its range.
        let mut envelope = Envelope::default();
        envelope.arrange(&[0, 2, 4], &[0, 1, 0, 1]);
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            envelope.set(i, j, 1.0);
        }
        assert!(envelope.factor());
        let mut rhs = [2.0, 2.0];
        envelope.solve(&mut rhs);
        assert!((rhs[0] + rhs[1] - 2.0).abs() <= 1e-9, "{rhs:?}");
        envelope.arrange(&[0, 1], &[0]);
        envelope.set(0, 0, -1.0);
        assert!(!envelope.factor());
    }
}
