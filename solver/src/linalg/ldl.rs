//! Sparse A = P' L D L' P with pivots of one or two unknowns in a static order, column by column.
//!
//! Right-looking: when a column of L is known, its products with itself leave what has yet to be eliminated; where each
//! of them goes is found once. The order is that of minimum degree (Amestoy, Davis & Duff 1996), the pattern of L follows
//! from the elimination tree (Davis 2005, *Algorithm 849: a concise sparse Cholesky factorization package*). The inertia
//! is that of D.
//!
//! Pivots of one unknown need a matrix that is strongly factorizable, which regularization makes it (Vanderbei 1995,
//! *Symmetric quasidefinite matrices*). Two unknowns of a pair are eliminated together: in a saddle point system a
//! constraint with one of its variables, which is a stable pivot where neither is one by itself. For the order a pair is
//! one node (Schenk & Gärtner 2006, *On fast factorization pivoting methods for sparse symmetric indefinite systems*).
//!
//! `tests/benches/kkt.rs` has it beside faer's: columns of L in optimal control have about seven entries, with which
//! simplicial factors of faer take 2.5 to 3.4 times as long, and supernodal ones 7 to 9 times (100 to 4000 intervals).

use std::ops::Range;
use std::sync::Arc;

use super::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use crate::runtime::limit::work;

/// A pivot that cancels to less than this share of its terms has no sign.
const CANCELLED: f64 = 1e-15;

/// Memory for matrices of one pattern with its pairs.
#[derive(Clone, Debug)]
pub struct SparseLdl {
    analysis: Arc<Analysis>,
    /// L below its diagonal.
    entries: Vec<f64>,
    /// What is left on diagonals, and the sums of the absolute values of its terms.
    pivots: Vec<f64>,
    sizes: Vec<f64>,
    /// D⁻¹ of pivots of one unknown, 1 elsewhere; and of pairs, with what is beside the diagonal last.
    inverse: Vec<f64>,
    pair_inverses: Vec<[f64; 3]>,
    /// The one or two columns under elimination, before and after the division by their pivot.
    columns: [Vec<f64>; 2],
    scaled: [Vec<f64>; 2],
    work: Vec<f64>,
}

/// The symbolic factorization of one pattern with its pairs.
#[derive(Debug)]
pub(super) struct Analysis {
    /// The place in the matrix of the k-th unknown that is eliminated.
    order: Vec<u32>,
    /// Those of them that are eliminated together with the next one.
    firsts: Vec<u32>,
    /// Entries of the matrix off its diagonal, and which entries of L they become.
    sources: Vec<u32>,
    places: Vec<u32>,
    diagonal_sources: Vec<u32>,
    /// Columns of L: rows, ascending.
    starts: Vec<u32>,
    rows: Vec<u32>,
    /// Where the products of entries p > q of a column go, column by column and q by q, and where those of a column
    /// start; those of a pair are with its second column. Of columns that are long they are runs, length and first target
    /// of each: there L is nearly full, and one target for each product would take more memory than L itself.
    targets: Vec<u32>,
    target_starts: Vec<usize>,
}

const NONE: u32 = u32::MAX;

/// Columns up to this length are eliminated by unrolled loops.
const SHORT: usize = 16;

impl SparseLdl {
    /// Memory for matrices of a pattern, of which `pairs` of unknowns stay together. No unknown is in two pairs.
    pub fn new(pattern: &Pattern, pairs: &[[u32; 2]]) -> Self {
        SparseLdl::of(Arc::new(Analysis::new(pattern, pairs)))
    }

    pub(super) fn of(analysis: Arc<Analysis>) -> Self {
        let n = analysis.order.len();
        let lengths = analysis.starts.windows(2).map(|pair| pair[1] - pair[0]);
        let column = vec![0.0; lengths.max().unwrap_or(0) as usize];
        SparseLdl {
            entries: vec![0.0; analysis.rows.len()],
            pivots: vec![0.0; n],
            sizes: vec![0.0; n],
            inverse: vec![1.0; n],
            pair_inverses: vec![[0.0; 3]; analysis.firsts.len()],
            columns: [column.clone(), column.clone()],
            scaled: [column.clone(), column],
            work: vec![0.0; n],
            analysis,
        }
    }

    /// The number of entries of L below its diagonal.
    pub fn n_entries(&self) -> usize {
        self.entries.len()
    }

    /// Eliminates unknowns one by one; how many of their pivots are positive.
    fn eliminate_ones(
        &mut self,
        analysis: &Analysis,
        unknowns: Range<usize>,
    ) -> Result<usize, FactorFailure> {
        let mut positive = 0;
        let mut start = analysis.starts[unknowns.start] as usize;
        let mut first = analysis.target_starts[unknowns.start];
        for k in unknowns {
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
            let (ys, ls) = (&mut self.columns[0][..count], &mut self.scaled[0][..count]);
            let rows = &analysis.rows[start..end];
            let entries = &mut self.entries[start..end];
            for q in 0..count {
                let y = entries[q];
                let l = y * inverse;
                (ys[q], ls[q], entries[q]) = (y, l, l);
                let row = rows[q] as usize;
                self.pivots[row] -= l * y;
                self.sizes[row] += (l * y).abs();
            }
            let targets = &analysis.targets[first..last];
            eliminate(&mut self.entries, targets, [ys], [ls]);
            (start, first) = (end, last);
        }
        Ok(positive)
    }

    /// Eliminates the k-th unknown together with the next one.
    fn eliminate_pair(
        &mut self,
        analysis: &Analysis,
        k: usize,
        pair: usize,
    ) -> Result<usize, FactorFailure> {
        if !self.pivots[k..k + 2].iter().all(|pivot| pivot.is_finite()) {
            return Err(FactorFailure::NotFinite);
        }
        let [start, middle, end] = [0, 1, 2].map(|i| analysis.starts[k + i] as usize);
        let (columns, rows) = (start..end, &analysis.rows[middle..end]);
        let count = rows.len();
        work::add(2 + count * (count + 1));
        let [beside, entries @ ..] = &mut self.entries[columns] else {
            unreachable!("the first column of a pair has an entry beside the second one")
        };
        let (a, b, c) = (self.pivots[k], self.pivots[k + 1], std::mem::take(beside));
        let determinant = a * b - c * c;
        let size = self.sizes[k] * b.abs() + a.abs() * self.sizes[k + 1] + c * c;
        if determinant.abs() <= CANCELLED * size || !determinant.is_normal() {
            return Err(FactorFailure::ZeroPivot(analysis.order[k + 1] as usize));
        }
        let inverse = [b / determinant, a / determinant, -c / determinant];
        self.pair_inverses[pair] = inverse;
        // (y z) = a,  (l m) = (y z) D⁻¹,  aᵢⱼ -= lᵢ yⱼ + mᵢ zⱼ
        let (firsts, seconds) = entries.split_at_mut(count);
        let [ys, zs] = self.columns.each_mut().map(|column| &mut column[..count]);
        let [ls, ms] = self.scaled.each_mut().map(|column| &mut column[..count]);
        for q in 0..count {
            let (y, z) = (firsts[q], seconds[q]);
            let l = inverse[0] * y + inverse[2] * z;
            let m = inverse[2] * y + inverse[1] * z;
            (ys[q], ls[q], firsts[q]) = (y, l, l);
            (zs[q], ms[q], seconds[q]) = (z, m, m);
            let row = rows[q] as usize;
            self.pivots[row] -= l * y + m * z;
            self.sizes[row] += (l * y).abs() + (m * z).abs();
        }
        let targets =
            &analysis.targets[analysis.target_starts[k + 1]..analysis.target_starts[k + 2]];
        eliminate(&mut self.entries, targets, [ys, zs], [ls, ms]);
        Ok(match determinant > 0.0 {
            true if a > 0.0 => 2,
            true => 0,
            false => 1,
        })
    }
}

impl Analysis {
    /// Orders the unknowns, of which `pairs` stay together, and finds where L has entries.
    pub fn new(pattern: &Pattern, pairs: &[[u32; 2]]) -> Self {
        let n = pattern.n_rows();
        let (order, firsts) = order_of(pattern, pairs);
        let mut inverse = vec![0; n];
        for (k, &place) in (0..).zip(&order) {
            inverse[place as usize] = k;
        }
        let lower = Lower::new(pattern, &inverse, &firsts);
        let (starts, rows) = columns_of_factor(n, &lower, &firsts);
        let of_column = |column: u32| {
            let range = starts[column as usize] as usize..starts[column as usize + 1] as usize;
            range.clone().zip(&rows[range])
        };
        let place = |row: u32, column: u32| {
            let range = starts[column as usize] as usize..starts[column as usize + 1] as usize;
            let found = rows[range.clone()].binary_search(&row);
            (range.start + found.expect("L has what it fills in")) as u32
        };
        let (mut sources, mut places) = (Vec::new(), Vec::new());
        for row in 0..n as u32 {
            let known = lower.row(row).filter(|entry| entry.1 != NONE);
            for (column, source) in known {
                sources.push(source);
                places.push(place(row, column));
            }
        }
        let (mut targets, mut target_starts) = (Vec::new(), vec![0]);
        let mut pairs = firsts.iter().peekable();
        for column in 0..n as u32 {
            let is_first = pairs.next_if_eq(&&column).is_some();
            let own = starts[column as usize] as usize..starts[column as usize + 1] as usize;
            let below = if is_first { &[] } else { &rows[own] };
            for (q, &column) in below.iter().enumerate() {
                // Both lists ascend, and the rows below are among those of the column.
                let mut of_column = of_column(column);
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
            firsts,
            sources,
            places,
            diagonal_sources: lower.diagonal,
            starts,
            rows,
            targets,
            target_starts,
        }
    }

    /// How many numbers of 4 bytes it holds, about.
    pub fn size(&self) -> usize {
        let entries = self.rows.len() + 2 * self.sources.len();
        entries + self.targets.len() + 5 * self.order.len() + self.firsts.len()
    }
}

/// The permuted matrix by rows, below its diagonal: columns and numbers of entries, `NONE` where a pair has none.
struct Lower {
    starts: Vec<u32>,
    entries: Vec<(u32, u32)>,
    diagonal: Vec<u32>,
}

impl Lower {
    /// `inverse` says when an unknown of the pattern is eliminated, `firsts` which ones with the next one.
    fn new(pattern: &Pattern, inverse: &[u32], firsts: &[u32]) -> Self {
        let n = pattern.n_rows();
        let mut diagonal = vec![NONE; n];
        let mut starts = vec![0_u32; n + 1];
        let of_matrix = (0..n).flat_map(|row| {
            let columns = pattern.row(row).iter().zip(pattern.starts[row] as u32..);
            columns.map(move |(&column, source)| {
                let (i, j) = (inverse[row], inverse[column as usize]);
                (i.max(j), i.min(j), source)
            })
        });
        let all = of_matrix.chain(firsts.iter().map(|&k| (k + 1, k, NONE)));
        for (row, column, source) in all.clone() {
            match row == column {
                true => diagonal[row as usize] = source,
                false => starts[row as usize + 1] += 1,
            }
        }
        for k in 0..n {
            starts[k + 1] += starts[k];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0); starts[n] as usize];
        for (row, column, source) in all.filter(|entry| entry.0 != entry.1) {
            let place = &mut next[row as usize];
            entries[*place as usize] = (column, source);
            *place += 1;
        }
        Lower {
            starts,
            entries,
            diagonal,
        }
    }

    fn row(&self, row: u32) -> impl Iterator<Item = (u32, u32)> {
        let range = self.starts[row as usize] as usize..self.starts[row as usize + 1] as usize;
        self.entries[range].iter().copied()
    }
}

/// The unknowns in the order of their elimination, and when the first one of each pair is eliminated.
fn order_of(pattern: &Pattern, pairs: &[[u32; 2]]) -> (Vec<u32>, Vec<u32>) {
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
        let columns = pattern.row(row).iter().map(|&column| node[column as usize]);
        let row = node[row];
        columns.map(move |column| (row.max(column), row.min(column)))
    });
    let nodes = minimum_degree(&Pattern::new(members.len(), entries.collect()));
    let (mut order, mut firsts) = (Vec::with_capacity(n), Vec::with_capacity(pairs.len()));
    for node in nodes {
        let member = members[node as usize];
        let other = partner[member as usize];
        if other != NONE {
            firsts.push(order.len() as u32);
        }
        order.extend([member, other].iter().filter(|&&member| member != NONE));
    }
    (order, firsts)
}

fn minimum_degree(pattern: &Pattern) -> Vec<u32> {
    let starts: Vec<i64> = pattern.starts.iter().map(|&start| start as i64).collect();
    let columns: Vec<i64> = pattern.columns.iter().map(|&c| i64::from(c)).collect();
    let n = pattern.n_rows() as i64;
    let (order, ..) = amd::order(n, &starts, &columns, &amd::Control::default())
        .expect("the columns of a pattern are within its rows");
    order.into_iter().map(|i| i as u32).collect()
}

/// Where the columns of L start, and their rows, ascending. Row k reaches up the elimination tree from the entries of the
/// matrix in it; the first one of a pair has the rows of the second one, too.
fn columns_of_factor(n: usize, lower: &Lower, firsts: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut is_first = vec![false; n];
    for &k in firsts {
        is_first[k as usize] = true;
    }
    let mut parent = vec![NONE; n];
    let mut seen = vec![NONE; n];
    let mut entries: Vec<(usize, u32)> = Vec::new();
    for k in 0..n as u32 {
        seen[k as usize] = k;
        for (column, _) in lower.row(k) {
            let mut i = column as usize;
            while seen[i] != k {
                seen[i] = k;
                if !is_first[i] || k as usize == i + 1 {
                    entries.push((i, k));
                }
                if i > 0 && is_first[i - 1] {
                    entries.push((i - 1, k));
                }
                if parent[i] == NONE {
                    parent[i] = k;
                }
                i = parent[i] as usize;
            }
        }
    }
    let mut starts = vec![0; n + 1];
    for &(column, _) in &entries {
        starts[column + 1] += 1;
    }
    for column in 0..n {
        starts[column + 1] += starts[column];
    }
    let mut next = starts.clone();
    let mut rows = vec![0; entries.len()];
    for (column, row) in entries {
        let place = &mut next[column];
        rows[*place as usize] = row;
        *place += 1;
    }
    (starts, rows)
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

/// Subtracts the products of W columns with themselves from where they go.
fn eliminate<const W: usize>(
    entries: &mut [f64],
    targets: &[u32],
    columns: [&mut [f64]; W],
    scaled: [&mut [f64]; W],
) {
    let (columns, scaled) = (columns.map(|y| &*y), scaled.map(|l| &*l));
    macro_rules! unrolled {
        ($($count:literal)*) => {
            match columns[0].len() {
                0 | 1 => {}
                $($count => eliminate_short::<$count, W>(entries, targets, columns, scaled),)*
                _ => eliminate_long(entries, targets, columns, scaled),
            }
        };
    }
    unrolled!(2 3 4 5 6 7 8 9 10 11 12 13 14 15 16);
}

/// The same for C entries of each: loops whose ends are known to the compiler are twice as fast.
#[allow(
    clippy::needless_range_loop,
    reason = "ranges whose ends are constants are what is unrolled"
)]
fn eliminate_short<const C: usize, const W: usize>(
    entries: &mut [f64],
    targets: &[u32],
    columns: [&[f64]; W],
    scaled: [&[f64]; W],
) {
    let (columns, scaled) = (columns.map(|y| &y[..C]), scaled.map(|l| &l[..C]));
    let targets = &targets[..C * (C - 1) / 2];
    let mut t = 0;
    for q in 0..C {
        for p in q + 1..C {
            let entry = &mut entries[targets[t] as usize];
            for j in 0..W {
                *entry -= scaled[j][p] * columns[j][q];
            }
            t += 1;
        }
    }
}

fn eliminate_long<const W: usize>(
    entries: &mut [f64],
    runs: &[u32],
    columns: [&[f64]; W],
    scaled: [&[f64]; W],
) {
    let mut runs = runs.chunks_exact(2);
    let count = columns[0].len();
    for q in 0..count {
        let mut p = q + 1;
        while p < count {
            let run = runs.next().expect("runs cover the columns");
            let (length, first) = (run[0] as usize, run[1] as usize);
            let entries = &mut entries[first..first + length];
            for (y, l) in columns.iter().zip(&scaled) {
                let y = y[q];
                for (entry, &l) in entries.iter_mut().zip(&l[p..p + length]) {
                    *entry -= l * y;
                }
            }
            p += length;
        }
    }
}

impl KktSolver for SparseLdl {
    fn factor(&mut self, values: &[f64]) -> Result<Inertia, FactorFailure> {
        let analysis = self.analysis.clone();
        let n = self.pivots.len();
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
        let (mut next, mut positive) = (0, 0);
        for (pair, &k) in analysis.firsts.iter().enumerate() {
            let k = k as usize;
            positive += self.eliminate_ones(&analysis, next..k)?;
            positive += self.eliminate_pair(&analysis, k, pair)?;
            next = k + 2;
        }
        positive += self.eliminate_ones(&analysis, next..n)?;
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
        for (&k, [a, b, c]) in analysis.firsts.iter().zip(&self.pair_inverses) {
            let pair = &mut work[k as usize..k as usize + 2];
            (pair[0], pair[1]) = (a * pair[0] + c * pair[1], c * pair[0] + b * pair[1]);
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
