//! Sparse A = P' L D L' P with pivots of one or two unknowns in a static order, row by row.
//!
//! Up-looking: row k of L solves a triangular system with the rows above it. Two unknowns of a pair are eliminated
//! together: in a saddle point system a constraint with one of its variables, which is a stable pivot where neither is
//! one by itself. The order is that of minimum degree of the graph in which pairs are one node (Schenk & Gärtner 2006,
//! *On fast factorization pivoting methods for sparse symmetric indefinite systems*).

use std::sync::Arc;

use super::ldl::{CANCELLED, NONE, columns_of_factor, minimum_degree, rows_of_factor};
use super::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use crate::runtime::limit::work;

/// Memory for matrices of one pattern with its pairs.
#[derive(Clone, Debug)]
pub struct PairedLdl {
    analysis: Arc<Analysis>,
    /// L below its diagonal.
    entries: Vec<f64>,
    /// D⁻¹: its diagonal, and what is beside it at the first one of a pair.
    inverse: Vec<f64>,
    coupling: Vec<f64>,
    work: Vec<f64>,
}

/// The symbolic factorization of one pattern with its pairs.
#[derive(Debug)]
pub(super) struct Analysis {
    /// The place in the matrix of the k-th unknown that is eliminated.
    order: Vec<u32>,
    /// Columns of the permuted upper triangle: row and number of the entry, `NONE` for a zero that a partner brings.
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
    /// Whether an unknown is eliminated together with the next one.
    is_first: Vec<bool>,
}

/// What is left on a diagonal, and the size of its terms.
#[derive(Clone, Copy, Default)]
struct Pivot {
    value: f64,
    size: f64,
}

impl PairedLdl {
    /// Memory for matrices of a pattern, of which `pairs` of unknowns stay together. No unknown is in two pairs.
    pub fn new(pattern: &Pattern, pairs: &[[u32; 2]]) -> Self {
        PairedLdl::of(Arc::new(Analysis::new(pattern, pairs)))
    }

    pub(super) fn of(analysis: Arc<Analysis>) -> Self {
        let n = analysis.order.len();
        PairedLdl {
            entries: vec![0.0; analysis.row_columns.len()],
            inverse: vec![0.0; n],
            coupling: vec![0.0; n],
            work: vec![0.0; n],
            analysis,
        }
    }

    /// yᵢ, and what it takes from the unknowns between i and the row of the entry.
    fn eliminate(&mut self, i: usize, place: usize) -> f64 {
        let y = std::mem::take(&mut self.work[i]);
        let known = self.analysis.column_starts[i] as usize..place;
        for (&row, &l) in self.analysis.column_rows[known.clone()]
            .iter()
            .zip(&self.entries[known])
        {
            self.work[row as usize] -= l * y;
        }
        y
    }

    /// Eliminates what is before a column from it; what is left on its diagonal.
    fn column(&mut self, analysis: &Analysis, k: usize, values: &[f64]) -> Pivot {
        let value = |source: u32| match source {
            NONE => 0.0,
            source => values[source as usize],
        };
        let column = analysis.starts[k] as usize..analysis.starts[k + 1] as usize;
        work::add(1 + column.len() * column.len());
        let sources = &analysis.sources[column.clone()];
        for (&row, &source) in analysis.rows[column].iter().zip(sources) {
            self.work[row as usize] = value(source);
        }
        let diagonal = value(analysis.diagonal_sources[k]);
        let mut pivot = Pivot {
            value: diagonal,
            size: diagonal.abs(),
        };
        let mut entry = analysis.row_starts[k] as usize;
        let end = analysis.end_of_row(k);
        while entry < end {
            let i = analysis.row_columns[entry] as usize;
            let place = analysis.places[entry] as usize;
            let y = self.eliminate(i, place);
            if analysis.is_first[i] {
                let other_place = analysis.places[entry + 1] as usize;
                let other = self.eliminate(i + 1, other_place);
                let l = self.inverse[i] * y + self.coupling[i] * other;
                let other_l = self.coupling[i] * y + self.inverse[i + 1] * other;
                self.entries[place] = l;
                self.entries[other_place] = other_l;
                pivot.value -= l * y + other_l * other;
                pivot.size += (l * y).abs() + (other_l * other).abs();
                entry += 2;
            } else {
                let l = y * self.inverse[i];
                self.entries[place] = l;
                pivot.value -= l * y;
                pivot.size += (l * y).abs();
                entry += 1;
            }
        }
        pivot
    }

    /// Inverts a pivot of one unknown; how many positive eigenvalues it has, none where it is lost.
    fn invert(&mut self, k: usize, Pivot { value, size }: Pivot) -> Option<usize> {
        if value.abs() <= CANCELLED * size || value.abs() < f64::MIN_POSITIVE {
            return None;
        }
        self.inverse[k] = value.recip();
        Some(usize::from(value > 0.0))
    }

    /// The same of a pair, k - 1 and k.
    fn invert_pair(
        &mut self,
        analysis: &Analysis,
        k: usize,
        [held, pivot]: [Pivot; 2],
    ) -> Option<usize> {
        let beside = std::mem::take(&mut self.work[k - 1]);
        self.entries[analysis.places[analysis.end_of_row(k)] as usize] = 0.0;
        let determinant = held.value * pivot.value - beside * beside;
        let sizes = held.size * pivot.value.abs() + held.value.abs() * pivot.size + beside * beside;
        if determinant.abs() <= CANCELLED * sizes || determinant.abs() < f64::MIN_POSITIVE {
            return None;
        }
        self.inverse[k - 1] = pivot.value / determinant;
        self.inverse[k] = held.value / determinant;
        self.coupling[k - 1] = -beside / determinant;
        Some(match determinant > 0.0 {
            true if held.value > 0.0 => 2,
            true => 0,
            false => 1,
        })
    }
}

impl Analysis {
    /// Orders the unknowns, of which `pairs` stay together, and finds where L has entries.
    ///
    /// No unknown is in two pairs.
    pub fn new(pattern: &Pattern, pairs: &[[u32; 2]]) -> Self {
        let n = pattern.n_rows();
        let (order, is_first) = order_of(pattern, pairs);
        let mut inverse = vec![0; n];
        for (k, &place) in order.iter().enumerate() {
            inverse[place as usize] = k as u32;
        }
        let partner = |k: u32| match (is_first[k as usize], k > 0 && is_first[k as usize - 1]) {
            (true, _) => Some(k + 1),
            (_, true) => Some(k - 1),
            _ => None,
        };
        let mut diagonal_sources = vec![NONE; n];
        // (column, row, source): where an entry is twice, the one with a source comes first.
        let mut upper: Vec<(u32, u32, u32)> = Vec::with_capacity(2 * pattern.n_entries());
        for (k, _) in is_first.iter().enumerate().filter(|first| *first.1) {
            upper.push((k as u32 + 1, k as u32, NONE));
        }
        for row in 0..n {
            let range = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, source) in pattern.row(row).iter().zip(range) {
                let (i, j) = (inverse[row], inverse[column as usize]);
                if i == j {
                    diagonal_sources[i as usize] = source as u32;
                    continue;
                }
                upper.push((i.max(j), i.min(j), source as u32));
                if partner(i) == Some(j) {
                    continue;
                }
                let others = [
                    (partner(i), Some(j)),
                    (Some(i), partner(j)),
                    (partner(i), partner(j)),
                ];
                for (i, j) in others {
                    if let (Some(i), Some(j)) = (i, j) {
                        upper.push((i.max(j), i.min(j), NONE));
                    }
                }
            }
        }
        upper.sort_unstable();
        upper.dedup_by_key(|entry| (entry.0, entry.1));
        let mut starts = vec![0; n + 1];
        for entry in &upper {
            starts[entry.0 as usize + 1] += 1;
        }
        for k in 0..n {
            starts[k + 1] += starts[k];
        }
        let rows: Vec<u32> = upper.iter().map(|entry| entry.1).collect();
        let sources = upper.iter().map(|entry| entry.2).collect();
        let (row_starts, row_columns) = rows_of_factor(n, &starts, &rows);
        let (column_starts, column_rows, places) = columns_of_factor(n, &row_starts, &row_columns);
        Analysis {
            order,
            starts,
            rows,
            sources,
            diagonal_sources,
            row_starts,
            places,
            column_starts,
            row_columns,
            column_rows,
            is_first,
        }
    }

    /// Where the entries of a row end: what the second one of a pair has in the column of its first one belongs to D.
    fn end_of_row(&self, k: usize) -> usize {
        let is_second = k > 0 && self.is_first[k - 1];
        self.row_starts[k + 1] as usize - usize::from(is_second)
    }

    /// How many numbers of 4 bytes it holds, about.
    pub fn size(&self) -> usize {
        2 * self.rows.len() + 3 * self.row_columns.len() + 6 * self.order.len()
    }
}

/// The unknowns in the order of their elimination, and which of them are the first of a pair.
fn order_of(pattern: &Pattern, pairs: &[[u32; 2]]) -> (Vec<u32>, Vec<bool>) {
    let n = pattern.n_rows();
    let mut partner = vec![NONE; n];
    for &[a, b] in pairs {
        (partner[a as usize], partner[b as usize]) = (b, a);
    }
    // Nodes are numbered by their smaller member.
    let mut node = vec![NONE; n];
    let mut members: Vec<u32> = Vec::with_capacity(n);
    for i in 0..n as u32 {
        let other = partner[i as usize];
        if other == NONE || i < other {
            node[i as usize] = members.len() as u32;
            members.push(i);
        } else {
            node[i as usize] = node[other as usize];
        }
    }
    let entries = (0..n).flat_map(|row| {
        let row_node = node[row];
        let columns = pattern.row(row).iter();
        columns.map(move |&column| (row_node, column))
    });
    let entries = entries.map(|(i, column)| {
        let j = node[column as usize];
        (i.max(j), i.min(j))
    });
    let (nodes, _) = minimum_degree(&Pattern::new(members.len(), entries.collect()));
    let (mut order, mut is_first) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for place in nodes {
        let member = members[place as usize];
        let other = partner[member as usize];
        order.push(member);
        is_first.push(other != NONE);
        if other != NONE {
            order.push(other);
            is_first.push(false);
        }
    }
    (order, is_first)
}

impl KktSolver for PairedLdl {
    fn factor(&mut self, values: &[f64]) -> Result<Inertia, FactorFailure> {
        let analysis = self.analysis.clone();
        let n = analysis.order.len();
        let mut positive = 0;
        let mut held = Pivot::default();
        self.work.fill(0.0);
        for k in 0..n {
            let pivot = self.column(&analysis, k, values);
            if !pivot.value.is_finite() {
                return Err(FactorFailure::NotFinite);
            }
            if analysis.is_first[k] {
                held = pivot;
                continue;
            }
            let found = match k > 0 && analysis.is_first[k - 1] {
                true => self.invert_pair(&analysis, k, [held, pivot]),
                false => self.invert(k, pivot),
            };
            let lost = FactorFailure::ZeroPivot(analysis.order[k] as usize);
            positive += found.ok_or(lost)?;
        }
        Ok(Inertia {
            positive,
            negative: n - positive,
        })
    }

    fn solve(&mut self, rhs: &mut [f64]) {
        work::add(2 * self.entries.len());
        let (analysis, work) = (&*self.analysis, &mut self.work);
        let n = analysis.order.len();
        for (value, &place) in work.iter_mut().zip(&analysis.order) {
            *value = rhs[place as usize];
        }
        let column =
            |k: usize| analysis.column_starts[k] as usize..analysis.column_starts[k + 1] as usize;
        for k in 0..n {
            let value = work[k];
            for (&row, &l) in analysis.column_rows[column(k)]
                .iter()
                .zip(&self.entries[column(k)])
            {
                work[row as usize] -= l * value;
            }
        }
        let mut k = 0;
        while k < n {
            if analysis.is_first[k] {
                let (a, b) = (work[k], work[k + 1]);
                work[k] = self.inverse[k] * a + self.coupling[k] * b;
                work[k + 1] = self.coupling[k] * a + self.inverse[k + 1] * b;
                k += 2;
            } else {
                work[k] *= self.inverse[k];
                k += 1;
            }
        }
        for k in (0..n).rev() {
            let mut value = work[k];
            for (&row, &l) in analysis.column_rows[column(k)]
                .iter()
                .zip(&self.entries[column(k)])
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
#[path = "paired_ldl_tests.rs"]
mod tests;
