//! Sparse linear programs: minimize cᵀx subject to rl <= A x <= ru, l <= x <= u, by the method of
//! [`conic`].

use crate::optimization::conic::{self, End, Program, Set};
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
    let Some(rows) = rows(program, lower, upper, &free) else {
        return Outcome::Infeasible;
    };
    if free.is_empty() {
        return Outcome::Optimal(lower.to_vec());
    }
    let cost: Vec<f64> = free.iter().map(|&j| program.cost[j]).collect();
    let mut settings = conic::settings(TOLERANCE, REDUCED);
    settings.max_iter = 100;
    match rows.minimize(&cost, settings, Some(limit)) {
        Some(found) if found.end == End::Solved => {
            let mut x = lower.to_vec();
            for (&j, &value) in free.iter().zip(&found.x) {
                x[j] = value.clamp(lower[j], upper[j]);
            }
            Outcome::Optimal(x)
        }
        Some(found) if found.end == End::Infeasible => Outcome::Infeasible,
        _ => Outcome::Failed,
    }
}

/// The rows over the free variables: equations, then inequalities, then bounds. Fixed variables are moved to the right-hand
/// side. None where a row without variables is violated.
fn rows(program: &LinearProgram, lower: &[f64], upper: &[f64], free: &[usize]) -> Option<Program> {
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
    let bounds = program.row_lower.iter().zip(&program.row_upper);
    let bounds = bounds
        .zip(&shift)
        .map(|((l, u), shift)| [l - shift, u - shift]);
    let (lines, empty): (Vec<_>, Vec<_>) =
        (lines.into_iter().zip(bounds)).partition(|(line, _)| !line.is_empty());
    if empty.iter().any(|&(_, [l, u])| l > REDUCED || u < -REDUCED) {
        return None;
    }
    let mut rows = Program::default();
    let equations = lines.iter().filter(|(_, [l, u])| l == u);
    rows.add(
        Set::Zero,
        equations.map(|(line, [_, u])| at_most(line, 1.0, *u)),
    );
    let inside = lines.iter().filter(|(_, [l, u])| l < u);
    let inside = inside.map(|(line, bounds)| (&line[..], *bounds));
    let units: Vec<_> = (0..free.len()).map(|column| [(column, 1.0)]).collect();
    let boxes = free.iter().zip(&units);
    let boxes = boxes.map(|(&j, unit)| (&unit[..], [lower[j], upper[j]]));
    let inequalities = inside.chain(boxes).flat_map(|(line, [l, u])| {
        let sides = [(1.0, u), (-1.0, -l)].into_iter();
        let finite = sides.filter(|&(_, right)| right != f64::INFINITY);
        finite.map(|(sign, right)| at_most(line, sign, right))
    });
    rows.add(Set::NonNegative, inequalities);
    Some(rows)
}

/// `right` less `sign` times the line.
fn at_most(
    line: &[(usize, f64)],
    sign: f64,
    right: f64,
) -> (impl Iterator<Item = (usize, f64)>, f64) {
    let entries = line
        .iter()
        .map(move |&(column, value)| (column, -sign * value));
    (entries, right)
}
