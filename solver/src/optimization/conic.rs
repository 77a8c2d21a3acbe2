//! Convex quadratic programs over second-order cones, by the interior point method of Clarabel.
//!
//! minimize ½ xᵀP x + cᵀx  subject to  A_i x + b_i ∈ K_i
//!
//! Goulart & Chen 2024, *Clarabel: an interior-point solver for conic programs with quadratic objectives*.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus,
    SupportedConeT, ZeroConeT,
};

use crate::runtime::limit::Limit;

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
    let mut program = Program::default();
    for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
        program.hessian.push((i, j, hessian[i * n + j]));
    }
    for block in blocks {
        let rows = block.rows.iter();
        let sparse = |a: &[f64]| -> Vec<(usize, f64)> {
            let entries = a.iter().copied().enumerate();
            entries.filter(|&(_, a)| a != 0.0).collect()
        };
        program.add(block.set, rows.map(|(a, b)| (sparse(a), *b)));
    }
    let found = program.minimize(cost, DefaultSettings::default(), None)?;
    let mut duals = found.z.into_iter();
    (found.end == End::Solved).then(|| Solution {
        x: found.x,
        duals: (blocks.iter())
            .map(|block| duals.by_ref().take(block.rows.len()).collect())
            .collect(),
    })
}

/// The program as Clarabel takes it: minimize ½ xᵀP x + cᵀx  subject to  -A x + s = b, s ∈ K.
#[derive(Default)]
pub(crate) struct Program {
    /// The entries (row, column, value) of the upper triangle of P.
    pub hessian: Vec<(usize, usize, f64)>,
    /// Those of -A.
    rows: Vec<(usize, usize, f64)>,
    /// b.
    offsets: Vec<f64>,
    /// The factors of K, in the order of the rows.
    cones: Vec<SupportedConeT<f64>>,
}

/// The last iterate of the method.
pub(crate) struct Iterate {
    /// x.
    pub x: Vec<f64>,
    /// A multiplier for every row.
    pub z: Vec<f64>,
    /// How the method has ended there.
    pub end: End,
}

/// How the method ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// With a solution to the tolerance, or to the reduced one.
    Solved,
    /// With a proof that no x satisfies all rows.
    Infeasible,
    /// With neither.
    Failed,
}

impl Program {
    /// Adds A x + b ∈ K, with the entries of A and b row by row.
    pub fn add<R>(&mut self, set: Set, rows: impl IntoIterator<Item = (R, f64)>)
    where
        R: IntoIterator<Item = (usize, f64)>,
    {
        let first = self.offsets.len();
        for (a, b) in rows {
            let row = self.offsets.len();
            self.rows.extend(a.into_iter().map(|(j, a)| (row, j, -a)));
            self.offsets.push(b);
        }
        let n = self.offsets.len() - first;
        self.cones.push(match set {
            Set::Zero => ZeroConeT(n),
            Set::NonNegative => NonnegativeConeT(n),
            Set::SecondOrder => SecondOrderConeT(n),
        });
    }

    /// Runs the method, as long as the limit allows; `None` where Clarabel takes no such program.
    pub fn minimize(
        self,
        cost: &[f64],
        settings: DefaultSettings<f64>,
        limit: Option<&Limit>,
    ) -> Option<Iterate> {
        let n = cost.len();
        let hessian = matrix(n, n, &self.hessian);
        let rows = matrix(self.offsets.len(), n, &self.rows);
        let settings = DefaultSettings {
            verbose: false,
            presolve_enable: false,
            ..settings
        };
        let (offsets, cones) = (&self.offsets, &self.cones);
        let mut solver =
            DefaultSolver::new(&hessian, cost, &rows, offsets, cones, settings).ok()?;
        if let Some(limit) = limit.cloned() {
            solver.set_termination_callback(move |_: &_| limit.is_over());
        }
        solver.solve();
        let solution = solver.solution;
        let end = match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => End::Solved,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                End::Infeasible
            }
            _ => End::Failed,
        };
        let (x, z) = (solution.x, solution.z);
        Some(Iterate { x, z, end })
    }
}

/// A matrix of its entries (row, column, value).
fn matrix(n_rows: usize, n_columns: usize, entries: &[(usize, usize, f64)]) -> CscMatrix<f64> {
    let rows = entries.iter().map(|entry| entry.0).collect();
    let columns = entries.iter().map(|entry| entry.1).collect();
    let values = entries.iter().map(|entry| entry.2).collect();
    CscMatrix::new_from_triplets(n_rows, n_columns, rows, columns, values)
}

/// Settings with what is asked of residuals and of the duality gap, relative to the size of the problem, and what is a
/// solution too where the method stalls above it.
pub(crate) fn settings(tolerance: f64, reduced: f64) -> DefaultSettings<f64> {
    DefaultSettings {
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        reduced_tol_gap_abs: reduced,
        reduced_tol_gap_rel: reduced,
        reduced_tol_feas: reduced,
        ..DefaultSettings::default()
    }
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
