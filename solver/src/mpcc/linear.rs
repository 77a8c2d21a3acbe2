//! Sparse linear programs: minimize cᵀx subject to rl <= A x <= ru, l <= x <= u; solved by Clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT,
};

use crate::limit::Limit;

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
    // Fixed variables are moved to the right-hand side.
    let mut columns = vec![usize::MAX; lower.len()];
    let mut n = 0;
    for (j, column) in columns.iter_mut().enumerate() {
        if lower[j] < upper[j] {
            *column = n;
            n += 1;
        }
    }
    let free = |j: usize| columns[j] != usize::MAX;
    let n_rows = program.row_lower.len();
    let mut shift = vec![0.0; n_rows];
    let mut lines = vec![Vec::new(); n_rows];
    for &(row, j, value) in &program.entries {
        if free(j) {
            lines[row].push((columns[j], value));
        } else {
            shift[row] += value * lower[j];
        }
    }

    // Clarabel's rows are A x + s = b, with s = 0 first and s >= 0 after it.
    let mut system = System::default();
    let bounds = |row: usize| {
        let [l, u] = [program.row_lower[row], program.row_upper[row]];
        (l - shift[row], u - shift[row])
    };
    for (row, line) in lines.iter().enumerate() {
        let (l, u) = bounds(row);
        if line.is_empty() && (l > REDUCED || u < -REDUCED) {
            return Outcome::Infeasible;
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
    for j in (0..lower.len()).filter(|&j| free(j)) {
        system.push(&[(columns[j], 1.0)], 1.0, upper[j]);
        system.push(&[(columns[j], 1.0)], -1.0, -lower[j]);
    }
    if n == 0 {
        return Outcome::Optimal(lower.to_vec());
    }

    let n_inequalities = system.right.len() - n_equations;
    let settings = DefaultSettings {
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
    };
    let (rows, at, values) = (system.rows, system.columns, system.values);
    let matrix = CscMatrix::new_from_triplets(system.right.len(), n, rows, at, values);
    let cost: Vec<f64> = (0..lower.len())
        .filter(|&j| free(j))
        .map(|j| program.cost[j])
        .collect();
    let cones = [ZeroConeT(n_equations), NonnegativeConeT(n_inequalities)];
    let hessian = CscMatrix::zeros((n, n));
    let solver = DefaultSolver::new(&hessian, &cost, &matrix, &system.right, &cones, settings);
    let Ok(mut solver) = solver else {
        return Outcome::Failed;
    };
    let limit = limit.clone();
    solver.set_termination_callback(move |_: &_| limit.is_over());
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved | SolverStatus::AlmostSolved => {
            let x = &solver.solution.x;
            let value = |j: usize| if free(j) { x[columns[j]] } else { lower[j] };
            let clamped = (0..lower.len()).map(|j| value(j).clamp(lower[j], upper[j]));
            Outcome::Optimal(clamped.collect())
        }
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
            Outcome::Infeasible
        }
        _ => Outcome::Failed,
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
