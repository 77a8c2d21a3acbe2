//! Sparse linear programs: minimize cᵀx subject to rl <= A x <= ru, l <= x <= u; solved by Clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT,
};

use crate::runtime::limit::Limit;

/// A linear program, its rows as entries (row, column, value).
#[derive(Clone, Debug, Default)]
pub struct LinearProgram {
    /// c.
    pub cost: Vec<f64>,
    /// l, perhaps minus infinity.
    pub lower: Vec<f64>,
    /// u, perhaps infinity.
    pub upper: Vec<f64>,
    /// A.
    pub entries: Vec<(usize, usize, f64)>,
    /// rl, perhaps minus infinity.
    pub row_lower: Vec<f64>,
    /// ru, perhaps infinity.
    pub row_upper: Vec<f64>,
}

/// What came of it.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// A minimizer.
    Optimal(Vec<f64>),
    /// No x satisfies all rows and bounds.
    Infeasible,
    /// The method has found neither.
    Failed,
}

/// Residuals and duality gap that are asked for, and those that are accepted when no more can be had.
const TOLERANCE: f64 = 1e-9;
const REDUCED: f64 = 1e-7;

/// Solves the program, with these bounds on x instead of its own, as long as the limit allows.
pub fn solve(program: &LinearProgram, lower: &[f64], upper: &[f64], limit: &Limit) -> Outcome {
    if lower.iter().zip(upper).any(|(l, u)| l > u) {
        return Outcome::Infeasible;
    }
    let free: Vec<usize> = (0..lower.len()).filter(|&j| lower[j] < upper[j]).collect();
    let Some((system, n_equations)) = System::of(program, lower, upper, &free) else {
        return Outcome::Infeasible;
    };
    let n = free.len();
    if n == 0 {
        return Outcome::Optimal(lower.to_vec());
    }
    let n_inequalities = system.right.len() - n_equations;
    let (rows, at, values) = (system.rows, system.columns, system.values);
    let matrix = CscMatrix::new_from_triplets(system.right.len(), n, rows, at, values);
    let cost: Vec<f64> = free.iter().map(|&j| program.cost[j]).collect();
    let cones = [ZeroConeT(n_equations), NonnegativeConeT(n_inequalities)];
    let hessian = CscMatrix::zeros((n, n));
    let solver = DefaultSolver::new(&hessian, &cost, &matrix, &system.right, &cones, settings());
    let Ok(mut solver) = solver else {
        return Outcome::Failed;
    };
    let limit = limit.clone();
    solver.set_termination_callback(move |_: &_| limit.is_over());
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => {
            let mut x = lower.to_vec();
            for (&j, &value) in free.iter().zip(&solver.solution.x) {
                x[j] = value.clamp(lower[j], upper[j]);
            }
            Outcome::Optimal(x)
        }
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
            Outcome::Infeasible
        }
        _ => Outcome::Failed,
    }
}

fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_iter: 100,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        reduced_tol_gap_abs: REDUCED,
        reduced_tol_gap_rel: REDUCED,
        reduced_tol_feas: REDUCED,
        presolve_enable: false,
        ..DefaultSettings::default()
    }
}

/// The rows of A x <= b as triplets.
#[derive(Default)]
struct System {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    right: Vec<f64>,
}

impl System {
    /// Clarabel's rows A x + s = b, with s = 0 for the first, whose number comes with them, and s >= 0 for the others; fixed
    /// variables are moved to the right-hand side. None where a row without variables is violated.
    fn of(
        program: &LinearProgram,
        lower: &[f64],
        upper: &[f64],
        free: &[usize],
    ) -> Option<(Self, usize)> {
        let mut columns = vec![None; lower.len()];
        for (column, &j) in free.iter().enumerate() {
            columns[j] = Some(column);
        }
        let n_rows = program.row_lower.len();
        let mut shift = vec![0.0; n_rows];
        let mut lines = vec![Vec::new(); n_rows];
        for &(row, j, value) in &program.entries {
            match columns[j] {
                Some(column) => lines[row].push((column, value)),
                None => shift[row] += value * lower[j],
            }
        }
        let bounds = |row: usize| {
            let [l, u] = [program.row_lower[row], program.row_upper[row]];
            (l - shift[row], u - shift[row])
        };
        let mut system = System::default();
        for (row, line) in lines.iter().enumerate() {
            let (l, u) = bounds(row);
            if line.is_empty() && (l > REDUCED || u < -REDUCED) {
                return None;
            }
            if l == u && !line.is_empty() {
                system.push(line, 1.0, u);
            }
        }
        let n_equations = system.right.len();
        for (row, line) in lines.iter().enumerate() {
            let (l, u) = bounds(row);
            if l < u && !line.is_empty() {
                system.push(line, 1.0, u);
                system.push(line, -1.0, -l);
            }
        }
        for (column, &j) in free.iter().enumerate() {
            system.push(&[(column, 1.0)], 1.0, upper[j]);
            system.push(&[(column, 1.0)], -1.0, -lower[j]);
        }
        Some((system, n_equations))
    }

    /// Adds `sign` times the line, at most `right`; nothing when that is infinite.
    fn push(&mut self, line: &[(usize, f64)], sign: f64, right: f64) {
        if right == f64::INFINITY {
            return;
        }
        for &(column, value) in line {
            self.rows.push(self.right.len());
            self.columns.push(column);
            self.values.push(sign * value);
        }
        self.right.push(right);
    }
}
