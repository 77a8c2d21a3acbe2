//! Multipliers of least norm.
//!
//! Where multipliers are not unique, those of an interior-point method may be far from the origin, and have wrong signs
//! there. y is least with r_i = 0 for all variables strictly between their bounds: (J Jᵀ + δ) (y⁺ - y) = -J r for these
//! columns of J, from y = 0 on, where δ is taken back in every step.

use crate::linalg::analyses::Analyses;
use crate::linalg::ldl::SparseLdl;
use crate::linalg::symmetric::KktSolver;
use crate::optimization::problem::Pattern;

use crate::optimization::mpcc::local::Local;

/// δ, relative to the largest entry of J.
const PROXIMITY: f64 = 1e-8;
const STEPS: usize = 3;

/// The linear system of some variables and rows at a point, of which fewer may take part.
pub struct LeastNorm<'a> {
    local: &'a Local,
    /// The unknowns of variables and rows, where they have one, and how many these are.
    columns: Vec<Option<u32>>,
    rows: Vec<Option<u32>>,
    n: usize,
    m: usize,
    pattern: Pattern,
    ldl: SparseLdl,
}

impl<'a> LeastNorm<'a> {
    /// The system of these variables and rows.
    pub fn new(
        local: &'a Local,
        takes_variable: impl Fn(usize) -> bool,
        takes_row: impl Fn(usize) -> bool,
        analyses: &Analyses,
    ) -> Self {
        let numbers = |count: usize, takes: &dyn Fn(usize) -> bool| {
            let mut next = 0..;
            let number = |i| takes(i).then(|| next.next()).flatten();
            (0..count).map(number).collect::<Vec<Option<u32>>>()
        };
        let columns = numbers(local.w.len(), &takes_variable);
        let rows = numbers(local.rows.len(), &takes_row);
        let n = columns.iter().flatten().count();
        let m = rows.iter().flatten().count();
        let entry = |&(row, j, _): &(usize, usize, f64)| Some((n as u32 + rows[row]?, columns[j]?));
        let diagonal = (0..(n + m) as u32).map(|i| (i, i));
        let entries = diagonal.chain(local.jacobian.iter().filter_map(entry));
        let pattern = Pattern::new(n + m, entries.collect());
        let ldl = analyses.ldl(&pattern, &[]);
        LeastNorm {
            local,
            columns,
            rows,
            n,
            m,
            pattern,
            ldl,
        }
    }

    /// y that is least with r = 0 for the variables `is_zero`, and zero for the rows `is_without` and for those that
    /// have no unknown; `None` where there is no factorization.
    pub fn multipliers(&mut self, is_zero: &[bool], is_without: &[bool]) -> Option<Vec<f64>> {
        self.factor(is_zero, is_without)?;
        Some(self.nearest(vec![0.0; self.rows.len()], is_zero))
    }

    /// Prepares for these variables and rows; `None` where there is no factorization.
    pub fn factor(&mut self, is_zero: &[bool], is_without: &[bool]) -> Option<()> {
        // ( -1  Jᵀ ) ( r  )   ( -r )
        // (  J  δ  ) ( Δy ) = (  0 )
        let n = self.n;
        let mut values = vec![0.0; self.pattern.n_entries()];
        let mut largest = 1.0_f64;
        for &(row, j, value) in &self.local.jacobian {
            if let (Some(row), Some(column)) = (
                self.rows[row].filter(|_| !is_without[row]),
                self.columns[j].filter(|_| is_zero[j]),
            ) {
                values[self.pattern.place(n + row as usize, column)?] += value;
                largest = largest.max(value.abs());
            }
        }
        for i in 0..n + self.m {
            let place = self.pattern.place(i, i as u32)?;
            values[place] = if i < n { -1.0 } else { PROXIMITY * largest };
        }
        self.ldl.factor(&values).ok().map(|_| ())
    }

    /// The same that is nearest to `y`, which is zero where the result has to be, for the variables of the factorization.
    pub fn nearest(&mut self, mut y: Vec<f64>, is_zero: &[bool]) -> Vec<f64> {
        let n = self.n;
        let mut rhs = vec![0.0; n + self.m];
        for _ in 0..STEPS {
            rhs.fill(0.0);
            let reduced = self.local.reduced_gradient(&y);
            for ((column, r), &is_zero) in self.columns.iter().zip(reduced).zip(is_zero) {
                if let (Some(column), true) = (*column, is_zero) {
                    rhs[column as usize] = -r;
                }
            }
            self.ldl.solve(&mut rhs);
            for (y, &row) in y.iter_mut().zip(&self.rows) {
                if let Some(row) = row {
                    *y += rhs[n + row as usize];
                }
            }
        }
        y
    }
}

#[cfg(test)]
mod tests {
    use super::{Analyses, LeastNorm};
    use crate::optimization::mpcc::local::Local;

    #[test]
    fn rows_that_repeat_each_other_share_a_multiplier() {
        // f = 3 x + u, the rows x and x once more and 2 x + u, which is not active; u is at a bound.
        let local = Local {
            w: vec![0.0; 2],
            gradient: vec![3.0, 1.0],
            rows: vec![0.0; 3],
            jacobian: vec![(0, 0, 1.0), (1, 0, 1.0), (2, 0, 2.0), (2, 1, 1.0)],
            scale: 3.0,
        };
        let mut least = LeastNorm::new(&local, |i| i == 0, |row| row < 2, &Analyses::default());
        let y = least
            .multipliers(&[true, false], &[false; 3])
            .expect("there are some");
        for (y, exact) in y.iter().zip([-1.5, -1.5, 0.0]) {
            assert!((y - exact).abs() < 1e-12, "{y} instead of {exact}");
        }
    }
}
