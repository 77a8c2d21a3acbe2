//! Linear algebra: small dense systems of the simulator, and symmetric indefinite systems of the interior-point method.
//!
//! Symbolic work and memory in `new`, numbers in `factor`, then `solve`: nothing
//! allocates in a loop.

pub mod analyses;
pub mod bunch_kaufman;
pub mod envelope;
pub mod ldl;
pub mod matching;
pub(crate) mod newton;
pub(crate) mod redundancy;
pub mod symmetric;

use nalgebra::ComplexField;

use crate::runtime::limit::work;
use crate::tape::Lane;

/// A real or complex number.
pub trait Number: ComplexField<RealField = f64> + Copy {}

impl<T: ComplexField<RealField = f64> + Copy> Number for T {}

/// LU factorization with partial pivoting of a small dense matrix.
#[derive(Clone, Debug)]
pub struct DenseLu<T = f64> {
    factors: Vec<T>,
    /// 1 over the diagonal.
    inverses: Vec<T>,
    pivots: Vec<usize>,
    /// Largest entry of every row, and of every column relative to its rows.
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
}

/// The matrix has no usable pivot in this column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Singular {
    /// Column without a pivot, from 0.
    pub column: usize,
}

impl<T: Number> DenseLu<T> {
    /// Memory for an n × n matrix.
    pub fn new(n: usize) -> Self {
        DenseLu {
            factors: vec![T::zero(); n * n],
            inverses: vec![T::zero(); n],
            pivots: vec![0; n],
            row_scale: vec![0.0; n],
            column_scale: vec![0.0; n],
        }
    }

    /// Makes it one for n × n matrices, in the memory it has.
    pub fn resize(&mut self, n: usize) {
        self.factors.resize(n * n, T::zero());
        self.inverses.resize(n, T::zero());
        self.pivots.resize(n, 0);
        self.row_scale.resize(n, 0.0);
        self.column_scale.resize(n, 0.0);
    }

    /// Factors the row-major `matrix`.
    ///
    /// Rows and columns may have any size of their own: a pivot below 1e-14 of that of its row times
    /// that of its column counts as zero.
    pub fn factor(&mut self, matrix: &[T]) -> Result<(), Singular> {
        assert_eq!(
            matrix.len(),
            self.factors.len(),
            "the matrix has the size the factorization was made for"
        );
        self.factors.copy_from_slice(matrix);
        factor(
            &mut self.factors,
            &mut self.inverses,
            &mut self.pivots,
            &mut self.row_scale,
            &mut self.column_scale,
        )
    }

    /// Overwrites `rhs` with the solution.
    pub fn solve(&self, rhs: &mut [T]) {
        solve(&self.factors, &self.inverses, &self.pivots, rhs);
    }
}

impl DenseLu {
    /// Overwrites several right-hand sides, in lanes, with the solutions.
    pub fn solve_lanes<L: Lane>(&self, rhs: &mut [L]) {
        let (n, a) = (rhs.len(), &self.factors);
        work::add(n * n * L::WIDTH);
        for (row, &pivot) in self.pivots.iter().enumerate() {
            rhs.swap(row, pivot);
        }
        for row in 0..n {
            for col in 0..row {
                rhs[row] = rhs[row] - L::splat(a[row * n + col]) * rhs[col];
            }
        }
        for row in (0..n).rev() {
            for col in row + 1..n {
                rhs[row] = rhs[row] - L::splat(a[row * n + col]) * rhs[col];
            }
            rhs[row] = rhs[row] * L::splat(self.inverses[row]);
        }
    }

    /// Overwrites right-hand sides, in lanes, with the solutions for the transposed matrix.
    pub fn solve_transposed<L: Lane>(&self, rhs: &mut [L]) {
        let (n, a) = (rhs.len(), &self.factors);
        for col in 0..n {
            for row in 0..col {
                rhs[col] = rhs[col] - L::splat(a[row * n + col]) * rhs[row];
            }
            rhs[col] = rhs[col] / L::splat(a[col * n + col]);
        }
        for col in (0..n).rev() {
            for row in col + 1..n {
                rhs[col] = rhs[col] - L::splat(a[row * n + col]) * rhs[row];
            }
        }
        for (row, &pivot) in self.pivots.iter().enumerate().rev() {
            rhs.swap(row, pivot);
        }
    }

    /// 1 or -1: the sign of the determinant of the matrix factored last.
    pub fn determinant_sign(&self) -> f64 {
        determinant_sign(&self.factors, &self.pivots)
    }

    /// The determinant of the matrix factored last.
    pub fn determinant(&self) -> f64 {
        let n = self.pivots.len();
        let diagonal = (0..n).map(|i| self.factors[i * (n + 1)].abs());
        self.determinant_sign() * diagonal.product::<f64>()
    }
}

/// LU factorization with partial pivoting of dense blocks on the diagonal.
#[derive(Clone, Debug, Default)]
pub struct BlockLu {
    /// The first row of every block, and the end of the last one.
    starts: Vec<usize>,
    /// Where the entries of every block start.
    places: Vec<usize>,
    /// The blocks, row by row; their factors in the end.
    factors: Vec<f64>,
    /// 1 over the diagonals.
    inverses: Vec<f64>,
    pivots: Vec<usize>,
    /// Largest entry of every row, and of every column relative to its rows.
    row_scale: Vec<f64>,
    column_scale: Vec<f64>,
}

impl BlockLu {
    /// Memory for blocks that start at these rows; the last number is the end of the last one.
    pub fn shape(&mut self, starts: &[usize]) {
        self.starts.clear();
        self.starts.extend_from_slice(starts);
        self.places.clear();
        let mut place = 0;
        for pair in starts.windows(2) {
            self.places.push(place);
            place += (pair[1] - pair[0]).pow(2);
        }
        let n = starts.last().copied().unwrap_or(0);
        self.factors.clear();
        self.factors.resize(place, 0.0);
        self.inverses.clear();
        self.inverses.resize(n, 0.0);
        self.pivots.clear();
        self.pivots.resize(n, 0);
        self.row_scale.clear();
        self.row_scale.resize(n, 0.0);
        self.column_scale.clear();
        self.column_scale.resize(n, 0.0);
    }

    /// The entries of a block, row by row and zero, to be filled before [`BlockLu::factor`].
    pub fn matrix(&mut self, block: usize) -> &mut [f64] {
        let n = self.starts[block + 1] - self.starts[block];
        let matrix = &mut self.factors[self.places[block]..][..n * n];
        matrix.fill(0.0);
        matrix
    }

    /// Takes the entries of all blocks, one block after the other, each row by row.
    pub fn load(&mut self, entries: &[f64]) {
        self.factors.copy_from_slice(entries);
    }

    /// Factors all blocks in their place.
    pub fn factor(&mut self) -> Result<(), Singular> {
        for (pair, &place) in self.starts.windows(2).zip(&self.places) {
            let (rows, n) = (pair[0]..pair[1], pair[1] - pair[0]);
            factor(
                &mut self.factors[place..place + n * n],
                &mut self.inverses[rows.clone()],
                &mut self.pivots[rows.clone()],
                &mut self.row_scale[rows.clone()],
                &mut self.column_scale[rows],
            )
            .map_err(|singular| Singular {
                column: pair[0] + singular.column,
            })?;
        }
        Ok(())
    }

    /// 1 or -1: the sign of the determinant of a block factored last.
    pub fn determinant_sign(&self, block: usize) -> f64 {
        let (start, end) = (self.starts[block], self.starts[block + 1]);
        determinant_sign(
            &self.factors[self.places[block]..],
            &self.pivots[start..end],
        )
    }

    /// Overwrites `rhs` with the solution.
    pub fn solve(&self, rhs: &mut [f64]) {
        for (pair, &place) in self.starts.windows(2).zip(&self.places) {
            let rows = pair[0]..pair[1];
            solve(
                &self.factors[place..],
                &self.inverses[rows.clone()],
                &self.pivots[rows.clone()],
                &mut rhs[rows],
            );
        }
    }
}

fn determinant_sign(factors: &[f64], pivots: &[usize]) -> f64 {
    let n = pivots.len();
    let swaps = pivots
        .iter()
        .enumerate()
        .filter(|(row, pivot)| *pivot != row)
        .count();
    let negative = (0..n).filter(|&i| factors[i * n + i] < 0.0).count();
    if (swaps + negative) % 2 == 0 {
        1.0
    } else {
        -1.0
    }
}

fn factor<T: Number>(
    a: &mut [T],
    inverses: &mut [T],
    pivots: &mut [usize],
    row_scale: &mut [f64],
    column_scale: &mut [f64],
) -> Result<(), Singular> {
    let n = pivots.len();
    work::add(n * n * n / 3);
    column_scale.fill(0.0);
    // Until a column has its pivot: the last row that begins in it.
    pivots.fill(0);
    for row in 0..n {
        let entries = &a[row * n..(row + 1) * n];
        if let Some(begins) = entries.iter().position(|v| *v != T::zero()) {
            pivots[begins] = row;
        }
        // Unlike `max`, one instruction each; NaN is passed over by both.
        let larger = |most: f64, size: f64| if size > most { size } else { most };
        let sizes = entries.iter().map(|v| v.norm1());
        let size = sizes.fold(0.0, larger);
        row_scale[row] = size;
        if size > 0.0 {
            for (scale, entry) in column_scale.iter_mut().zip(entries) {
                *scale = larger(*scale, entry.norm1() / size);
            }
        }
    }
    let mut end = 0;
    for col in 0..n {
        // Rows from here on begin behind the column. Exchanges of rows before do not change that.
        end = end.max(pivots[col] + 1);
        let relative = |row: usize| (row, a[row * n + col].norm1() / row_scale[row]);
        let pivot = (col..end)
            .map(relative)
            .max_by(|(_, first), (_, second)| first.total_cmp(second))
            .map_or(col, |(row, _)| row);
        let value = a[pivot * n + col];
        let inverse = T::one() / value;
        let size = row_scale[pivot] * column_scale[col];
        let usable = value.is_finite() && inverse.is_finite() && value.norm1() > 1e-14 * size;
        if !usable {
            return Err(Singular { column: col });
        }
        pivots[col] = pivot;
        inverses[col] = inverse;
        if pivot != col {
            row_scale.swap(pivot, col);
            for k in 0..n {
                a.swap(pivot * n + k, col * n + k);
            }
        }
        let (above, below) = a[..n * n].split_at_mut((col + 1) * n);
        // Behind its last entry the row changes nothing.
        let eliminated = &above[col * n + col + 1..];
        let width = eliminated.iter().rposition(|v| *v != T::zero());
        let eliminated = &eliminated[..width.map_or(0, |last| last + 1)];
        for row in below.chunks_exact_mut(n).take(end - col - 1) {
            let factor = row[col] * inverse;
            row[col] = factor;
            if factor != T::zero() {
                for (entry, above) in row[col + 1..].iter_mut().zip(eliminated) {
                    *entry -= factor * *above;
                }
            }
        }
    }
    Ok(())
}

fn solve<T: Number>(a: &[T], inverses: &[T], pivots: &[usize], rhs: &mut [T]) {
    let n = pivots.len();
    work::add(n * n);
    for (row, &pivot) in pivots.iter().enumerate() {
        rhs.swap(row, pivot);
    }
    for row in 1..n {
        let sum = dot(&a[row * n..row * n + row], rhs);
        rhs[row] -= sum;
    }
    for row in (0..n).rev() {
        let sum = dot(&a[row * n + row + 1..(row + 1) * n], &rhs[row + 1..]);
        rhs[row] = (rhs[row] - sum) * inverses[row];
    }
}

/// |v|, without overflow.
pub(crate) fn norm(v: &[f64]) -> f64 {
    match v {
        [one] => one.abs(),
        _ => v.iter().copied().fold(0.0, f64::hypot),
    }
}

/// max |v_i|; NaN if one is.
pub(crate) fn largest(v: &[f64]) -> f64 {
    let worse = |most: f64, v: f64| v > most || v.is_nan();
    let magnitudes = v.iter().map(|v| v.abs());
    magnitudes.fold(0.0, |most, v| if worse(most, v) { v } else { most })
}

/// Σ a_i b_i over the shorter of the two.
fn dot<T: Number>(a: &[T], b: &[T]) -> T {
    let n = a.len().min(b.len());
    if n < 8 {
        let terms = a.iter().zip(b);
        return terms.fold(T::zero(), |sum, (a, b)| sum + *a * *b);
    }
    // Four sums do not wait for each other.
    let (a, b) = (a[..n].chunks_exact(4), b[..n].chunks_exact(4));
    let rest = a.remainder().iter().zip(b.remainder());
    let rest = rest.fold(T::zero(), |sum, (a, b)| sum + *a * *b);
    let mut sums = [T::zero(); 4];
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += *a * *b;
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn solves_what_it_multiplied(entries in prop::collection::vec(-1.0..1.0_f64, 16), x in prop::collection::vec(-1.0..1.0_f64, 4)) {
            let mut matrix = entries;
            for i in 0..4 {
                matrix[i * 5] += 4.0;
            }
            let mut rhs: Vec<f64> = (0..4).map(|i| (0..4).map(|j| matrix[i * 4 + j] * x[j]).sum()).collect();
            let mut lu = DenseLu::new(4);
            lu.factor(&matrix).unwrap();
            lu.solve(&mut rhs);
            for (found, exact) in rhs.iter().zip(&x) {
                prop_assert!((found - exact).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn solves_the_transposed_system() {
        let matrix = [0.0, 2.0, 1.0, 3.0, 1.0, -1.0, 1.0, 4.0, 2.0];
        let x = [1.0, -2.0, 0.5];
        let sum = |col: usize| -> f64 { (0..3).map(|row| matrix[row * 3 + col] * x[row]).sum() };
        let mut rhs = [0, 1, 2].map(sum);
        let mut lu = DenseLu::new(3);
        lu.factor(&matrix).unwrap();
        lu.solve_transposed(&mut rhs);
        for (found, exact) in rhs.iter().zip(&x) {
            assert!((found - exact).abs() < 1e-14);
        }
    }

    #[test]
    fn solves_several_systems_in_lanes() {
        let matrix = [0.0, 2.0, 1.0, 3.0, 1.0, -1.0, 1.0, 4.0, 2.0];
        // Of lane l, x = (1, -2, l).
        let x = |lane: usize| [1.0, -2.0, lane as f64];
        let of = |lane: usize, row: usize| -> f64 {
            (0..3).map(|col| matrix[row * 3 + col] * x(lane)[col]).sum()
        };
        let mut rhs =
            [0, 1, 2].map(|row| wide::f64x4::from([0, 1, 2, 3].map(|lane| of(lane, row))));
        let mut lu = DenseLu::new(3);
        lu.factor(&matrix).unwrap();
        lu.solve_lanes(&mut rhs);
        for (row, found) in rhs.iter().enumerate() {
            for (lane, found) in found.to_array().into_iter().enumerate() {
                assert!((found - x(lane)[row]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn rows_and_columns_may_have_any_size() {
        let mut lu = DenseLu::new(3);
        lu.factor(&[4e-12, 0.0, 1e-20, 0.0, 6e9, 0.0, 1.0, 1.0, -3e-9])
            .unwrap();
        let mut rhs = [4e-12, 6e9, 2.0];
        lu.solve(&mut rhs);
        assert_eq!(rhs, [1.0, 1.0, 0.0]);
        assert!(
            lu.factor(&[1.0, 2.0, 0.0, 2e9, 4e9, 0.0, 0.0, 0.0, 1.0])
                .is_err()
        );
        assert!(lu.factor(&[0.0; 9]).is_err());
    }

    #[test]
    fn the_determinant_has_its_sign() {
        for (matrix, sign) in [
            ([1.0, 0.0, 0.0, 1.0], 1.0),
            ([0.0, 1.0, 1.0, 0.0], -1.0),
            ([1.0, 2.0, 3.0, 4.0], -1.0),
            ([-1.0, 0.0, 0.0, -2.0], 1.0),
        ] {
            let mut lu = DenseLu::new(2);
            lu.factor(&matrix).unwrap();
            assert_eq!(lu.determinant_sign(), sign, "{matrix:?}");
        }
    }

    #[test]
    fn entries_may_be_complex() {
        // (1 i; i 1)⁻¹ (1 + i, 1 + i) = (1, 1)
        let (one, i) = (Complex::new(1.0, 0.0), Complex::new(0.0, 1.0));
        let mut lu = DenseLu::new(2);
        lu.factor(&[one, i, i, one]).unwrap();
        let mut rhs = [one + i; 2];
        lu.solve(&mut rhs);
        assert_eq!(rhs, [one; 2]);
    }

    #[test]
    fn permutes_rows() {
        let mut lu = DenseLu::new(3);
        lu.factor(&[0.0, 2.0, 0.0, 0.0, 0.0, 4.0, 1.0, 0.0, 0.0])
            .unwrap();
        let mut rhs = [2.0, 4.0, 3.0];
        lu.solve(&mut rhs);
        assert_eq!(rhs, [3.0, 1.0, 1.0]);
    }

    #[test]
    fn names_the_singular_column() {
        let mut lu = DenseLu::new(2);
        assert_eq!(
            lu.factor(&[1.0, 2.0, 2.0, 4.0]),
            Err(Singular { column: 1 })
        );
    }
}
