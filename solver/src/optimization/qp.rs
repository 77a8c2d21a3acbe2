//! Convex quadratic programs with a diagonal Hessian, by the interior point method of Clarabel.
//!
//! minimize ½ Σ d_j x_j² + cᵀx  subject to  a_i·x + b_i >= 0
//!
//! Goulart & Chen 2024, *Clarabel: an interior-point solver for conic programs with quadratic objectives*.
//! Linear programs have d = 0.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus};

/// The half-space a·x + b >= 0, a by its entries that are not zero.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfSpace {
    /// (j, a_j), ascending in j.
    pub normal: Vec<(usize, f64)>,
    /// b.
    pub offset: f64,
}

/// A solution with the multipliers that prove it.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// x.
    pub x: Vec<f64>,
    /// A multiplier z_i >= 0 per row: d∘x + c = Σ z_i a_i.
    pub multipliers: Vec<f64>,
}

/// What is asked of residuals and of the duality gap, relative to the size of the problem.
const TOLERANCE: f64 = 1e-11;

/// Solves the program; `None` where the method finds no solution.
///
/// `curvature` is d and `cost` is c, both with an entry per variable.
pub fn solve(curvature: &[f64], cost: &[f64], rows: &[HalfSpace]) -> Option<Solution> {
    let (solution, is_solved) = approach(curvature, cost, rows)?;
    is_solved.then_some(solution)
}

/// The last iterate, and whether it is a solution to the tolerance.
pub fn approach(curvature: &[f64], cost: &[f64], rows: &[HalfSpace]) -> Option<(Solution, bool)> {
    let n = cost.len();
    let settings = DefaultSettings {
        verbose: false,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        // What stalls just above the tolerance is a solution too, within this.
        reduced_tol_gap_abs: 1e3 * TOLERANCE,
        reduced_tol_gap_rel: 1e3 * TOLERANCE,
        reduced_tol_feas: 1e3 * TOLERANCE,
        presolve_enable: false,
        ..DefaultSettings::default()
    };
    let entries = |d: &[f64]| -> Vec<usize> { (0..d.len()).filter(|&j| d[j] != 0.0).collect() };
    let curved = entries(curvature);
    let hessian = CscMatrix::new_from_triplets(
        n,
        n,
        curved.clone(),
        curved.clone(),
        curved.iter().map(|&j| curvature[j]).collect(),
    );
    // Clarabel's rows are A x + s = b with s >= 0, that is -a·x + s = b.
    let (mut at_row, mut at_column, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for (i, row) in rows.iter().enumerate() {
        for &(j, a) in &row.normal {
            at_row.push(i);
            at_column.push(j);
            values.push(-a);
        }
    }
    let matrix = CscMatrix::new_from_triplets(rows.len(), n, at_row, at_column, values);
    let offsets: Vec<f64> = rows.iter().map(|row| row.offset).collect();
    let cones = [NonnegativeConeT(rows.len())];
    let mut solver =
        DefaultSolver::new(&hessian, cost, &matrix, &offsets, &cones, settings).ok()?;
    solver.solve();
    let solution = &solver.solution;
    let is_solved = matches!(
        solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved
    );
    let found = Solution {
        x: solution.x.clone(),
        multipliers: solution.z.iter().map(|z| z.max(0.0)).collect(),
    };
    Some((found, is_solved))
}

impl HalfSpace {
    /// a·x + b.
    pub fn value(&self, x: &[f64]) -> f64 {
        let products = self.normal.iter().map(|&(j, a)| a * x[j]);
        products.sum::<f64>() + self.offset
    }

    /// The other side: -a·x - b >= 0.
    pub fn opposite(&self) -> Self {
        HalfSpace {
            normal: self.normal.iter().map(|&(j, a)| (j, -a)).collect(),
            offset: -self.offset,
        }
    }

    /// The same with |a| = 1; `None` without a direction.
    pub fn normalized(mut self) -> Option<Self> {
        let squares = self.normal.iter().map(|&(_, a)| a * a);
        let length = squares.sum::<f64>().sqrt();
        if !(length.is_normal() && self.offset.is_finite()) {
            return None;
        }
        self.normal.iter_mut().for_each(|(_, a)| *a /= length);
        self.offset /= length;
        Some(self)
    }
}

#[cfg(test)]
mod tests {
    use super::{HalfSpace, solve};

    fn row(normal: &[f64], offset: f64) -> HalfSpace {
        HalfSpace {
            normal: normal.iter().copied().enumerate().collect(),
            offset,
        }
    }

    #[test]
    fn the_nearest_point_of_a_triangle() {
        // x + y >= 2, x <= 3, y <= 3 from the origin: (1, 1), with multiplier 1.
        let rows = [
            row(&[1.0, 1.0], -2.0),
            row(&[-1.0, 0.0], 3.0),
            row(&[0.0, -1.0], 3.0),
        ];
        let found = solve(&[1.0, 1.0], &[0.0, 0.0], &rows).expect("the triangle is not empty");
        let expected = ([1.0, 1.0], [1.0, 0.0, 0.0]);
        for (a, b) in found.x.iter().zip(expected.0) {
            assert!((a - b).abs() < 1e-9, "{found:?}");
        }
        for (a, b) in found.multipliers.iter().zip(expected.1) {
            assert!((a - b).abs() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn what_has_no_point_has_no_solution() {
        let rows = [row(&[1.0], -1.0), row(&[-1.0], 0.0)];
        assert_eq!(solve(&[0.0], &[1.0], &rows), None);
        // Unbounded.
        assert_eq!(solve(&[0.0], &[-1.0], &rows[..1]), None);
    }
}
