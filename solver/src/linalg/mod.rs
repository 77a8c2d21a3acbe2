//! Linear algebra for the small dense systems of the simulator.
//!
//! Symbolic work and memory in `new`, numbers in `factor`, then `solve`: nothing
//! allocates in a loop.

/// LU factorization with partial pivoting of a small dense matrix.
#[derive(Clone, Debug, Default)]
pub struct DenseLu {
    n: usize,
    factors: Vec<f64>,
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

impl DenseLu {
    /// Memory for an n × n matrix.
    pub fn new(n: usize) -> Self {
        DenseLu {
            n,
            factors: vec![0.0; n * n],
            pivots: vec![0; n],
            row_scale: vec![0.0; n],
            column_scale: vec![0.0; n],
        }
    }

    /// Factors the row-major `matrix`.
    ///
    /// Rows and columns may have any size of their own: a pivot below 1e-14 of that of its row times
    /// that of its column counts as zero.
    pub fn factor(&mut self, matrix: &[f64]) -> Result<(), Singular> {
        let n = self.n;
        assert_eq!(
            matrix.len(),
            n * n,
            "the matrix has the size the factorization was made for"
        );
        self.factors.copy_from_slice(matrix);
        self.column_scale.fill(0.0);
        for row in 0..n {
            let entries = &self.factors[row * n..(row + 1) * n];
            let size = entries.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            self.row_scale[row] = size;
            for (scale, entry) in self.column_scale.iter_mut().zip(entries) {
                *scale = scale.max(if size > 0.0 { entry.abs() / size } else { 0.0 });
            }
        }
        let a = &mut self.factors;
        for col in 0..n {
            let relative = |row: usize| a[row * n + col].abs() / self.row_scale[row];
            let pivot = (col..n)
                .max_by(|&i, &j| relative(i).total_cmp(&relative(j)))
                .unwrap_or(col);
            let value = a[pivot * n + col];
            let size = self.row_scale[pivot] * self.column_scale[col];
            if !value.is_finite() || value.abs() <= 1e-14 * size {
                return Err(Singular { column: col });
            }
            self.pivots[col] = pivot;
            if pivot != col {
                self.row_scale.swap(pivot, col);
                for k in 0..n {
                    a.swap(pivot * n + k, col * n + k);
                }
            }
            for row in col + 1..n {
                let factor = a[row * n + col] / value;
                a[row * n + col] = factor;
                if factor != 0.0 {
                    for k in col + 1..n {
                        a[row * n + k] -= factor * a[col * n + k];
                    }
                }
            }
        }
        Ok(())
    }

    /// 1 or -1: the sign of the determinant of the matrix factored last.
    pub fn determinant_sign(&self) -> f64 {
        let n = self.n;
        let swapped = |(row, &pivot): (usize, &usize)| pivot != row;
        let swaps = self
            .pivots
            .iter()
            .enumerate()
            .filter(|&p| swapped(p))
            .count();
        let negative = (0..n).filter(|&i| self.factors[i * n + i] < 0.0).count();
        if (swaps + negative) % 2 == 0 {
            1.0
        } else {
            -1.0
        }
    }

    /// Overwrites `rhs` with the solution.
    pub fn solve(&self, rhs: &mut [f64]) {
        let (n, a) = (self.n, &self.factors);
        for (row, &pivot) in self.pivots.iter().enumerate() {
            rhs.swap(row, pivot);
        }
        for row in 1..n {
            let sum: f64 = (0..row).map(|k| a[row * n + k] * rhs[k]).sum();
            rhs[row] -= sum;
        }
        for row in (0..n).rev() {
            let sum: f64 = (row + 1..n).map(|k| a[row * n + k] * rhs[k]).sum();
            rhs[row] = (rhs[row] - sum) / a[row * n + row];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
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
