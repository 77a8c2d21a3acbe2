//! Convex quadratic programs over second-order cones, by the interior point method of Clarabel.
//!
//! minimize ½ xᵀP x + cᵀx  subject to  A_i x + b_i ∈ K_i
//!
//! Goulart & Chen 2024, *Clarabel: an interior-point solver for conic programs with quadratic objectives*.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus,
    ZeroConeT,
};

/// K: where several affine functions lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Set {
    /// All are zero.
    Zero,
    /// None is negative.
    NonNegative,
    /// The first is not less than the Euclidean norm of the others.
    SecondOrder,
}

/// A x + b ∈ K.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// The rows of A, each as long as x, with its entry of b.
    pub rows: Vec<(Vec<f64>, f64)>,
    /// K.
    pub set: Set,
}

/// A solution with the multipliers that prove it.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// x.
    pub x: Vec<f64>,
    /// z_i of every block, in the dual cone of K_i, with P x + c = Σ A_iᵀ z_i.
    pub duals: Vec<Vec<f64>>,
}

/// Solves the program; `None` where the method finds no solution.
///
/// `hessian` is P row by row, symmetric and positive semidefinite, and `cost` is c.
pub fn solve(hessian: &[f64], cost: &[f64], blocks: &[Block]) -> Option<Solution> {
    let n = cost.len();
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..n {
        for j in i..n {
            rows.push(i);
            columns.push(j);
            values.push(hessian[i * n + j]);
        }
    }
    let hessian = CscMatrix::new_from_triplets(n, n, rows, columns, values);
    // Clarabel's rows are -A x + s = b with s in the cone.
    let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let mut offsets = Vec::new();
    for (a, b) in blocks.iter().flat_map(|block| &block.rows) {
        for (j, a) in a.iter().enumerate().filter(|(_, a)| **a != 0.0) {
            rows.push(offsets.len());
            columns.push(j);
            values.push(-a);
        }
        offsets.push(*b);
    }
    let matrix = CscMatrix::new_from_triplets(offsets.len(), n, rows, columns, values);
    let cones = blocks.iter().map(|block| match block.set {
        Set::Zero => ZeroConeT(block.rows.len()),
        Set::NonNegative => NonnegativeConeT(block.rows.len()),
        Set::SecondOrder => SecondOrderConeT(block.rows.len()),
    });
    let cones: Vec<_> = cones.collect();
    let settings = DefaultSettings {
        verbose: false,
        presolve_enable: false,
        ..DefaultSettings::default()
    };
    let mut solver =
        DefaultSolver::new(&hessian, cost, &matrix, &offsets, &cones, settings).ok()?;
    solver.solve();
    let solution = &solver.solution;
    let is_solved = matches!(
        solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved
    );
    let mut duals = solution.z.iter().copied();
    is_solved.then(|| Solution {
        x: solution.x.clone(),
        duals: (blocks.iter())
            .map(|block| duals.by_ref().take(block.rows.len()).collect())
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::{Block, Set, solve};

    #[test]
    fn points_are_projected_onto_a_cone() {
        // Of (3, 4) and height -1: (5 - 1)/2 = 2 is the height of the nearest point of the cone.
        let unit = |i: usize| ((0..3).map(|j| f64::from(u8::from(i == j))).collect(), 0.0);
        let cone = Block {
            rows: vec![unit(2), unit(0), unit(1)],
            set: Set::SecondOrder,
        };
        let eye = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let found = solve(&eye, &[-3.0, -4.0, 1.0], &[cone]).expect("it is convex");
        for (x, exact) in found.x.iter().zip([1.2, 1.6, 2.0]) {
            assert!((x - exact).abs() < 1e-7, "{:?}", found.x);
        }
        // The multiplier is the point less its projection, backwards: x - (3, 4, -1).
        for (z, exact) in found.duals[0].iter().zip([3.0, -1.8, -2.4]) {
            assert!((z - exact).abs() < 1e-7, "{:?}", found.duals);
        }
    }
}
