//! The nearest feasible point of a branch that has no objective, by Newton's method.
//!
//! Rows c(w) = 0 that depend on each other, and forces that share a load in more ways than one, leave the Jacobian J
//! without full rank. Of the steps J Δw = -c that of least norm is taken,
//!
//! ( ρ   Jᵀ ) (Δw)   ( 0 )
//! ( J  -δ  ) ( y) = (-c )
//!
//! in which ρ and δ make a static order of pivots valid: along a singular value σ they leave the share ρδ / (σ² + ρδ) of
//! c, and that to the next step. Slacks that are not held are what their rows say. Variables that leave their bounds go
//! back to them. Where the rows are not met so, the point was not close to one that meets them.

use crate::linalg::analyses::Analyses;
use crate::linalg::ldl::SparseLdl;
use crate::linalg::symmetric::KktSolver;
use crate::optimization::mpcc::branch::Branch;
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::work::Work;
use crate::optimization::problem::{Member, Nlp, Pattern};

/// ρ, and δ for rows whose largest derivative is 1: ρδ is far above rounding, and far below σ².
const PRIMAL: f64 = 1e-4;
const DUAL: f64 = 1e-8;
/// Steps at most: from a close point a few are enough.
const MAX_STEPS: usize = 15;
/// A row is met to this, relative to the largest variable: a few roundings.
const ROUNDING: f64 = 1e-15;
/// What a step has to leave of a residual that is within the tolerance at most, for another one.
const PROGRESS: f64 = 0.5;

/// A feasible point of the branch with these zeros, from a point near it.
pub fn reach(
    lifted: &mut Lifted<'_>,
    zeros: &[Member],
    start: &[f64],
    work: &mut Work<'_>,
) -> Option<Vec<f64>> {
    let mut branch = Branch::new(lifted, zeros, start);
    let mut newton = Newton::new(&branch, &work.options.analyses);
    let mut w = branch.start().to_vec();
    newton.project(&branch, &mut w);
    let mut best = w.clone();
    let mut least = f64::INFINITY;
    for steps in 0..=MAX_STEPS {
        if work.is_over() {
            return None;
        }
        let residual = newton.residual(&mut branch, &mut w);
        let size = size(&branch, &w);
        let is_met = least <= work.options.tolerance * size;
        let is_last = steps == MAX_STEPS || is_met && residual >= PROGRESS * least;
        if residual < least {
            least = residual;
            best.copy_from_slice(&w);
        }
        if is_last || residual <= ROUNDING * size {
            break;
        }
        work.stats.iterations += 1;
        newton.step(&mut branch, &mut w)?;
        newton.project(&branch, &mut w);
    }
    (least <= work.options.tolerance * size(&branch, &best)).then_some(best)
}

/// The largest variable that is no slack, or 1.
fn size(branch: &Branch<'_, '_>, w: &[f64]) -> f64 {
    let variables = w[..branch.n_original()].iter();
    variables.fold(1.0, |m: f64, w| m.max(w.abs()))
}

/// The linear system of the steps of one branch.
struct Newton {
    /// The variables that are not held, and the rows that are equations with any of these, without slacks that are
    /// not held and their rows.
    variables: Vec<u32>,
    rows: Vec<u32>,
    slacks: Vec<(usize, usize)>,
    /// For each of these rows, its entries of the Jacobian of the branch, with the places where they go.
    entries: Vec<Vec<(u32, u32)>>,
    /// Places of the diagonal.
    diagonal: Vec<u32>,
    solver: SparseLdl,
    matrix: Vec<f64>,
    right: Vec<f64>,
    jacobian: Vec<f64>,
    values: Vec<f64>,
}

impl Newton {
    fn new(branch: &Branch<'_, '_>, analyses: &Analyses) -> Self {
        let slacks = branch.free_slacks();
        let is_stated = |row: usize| slacks.binary_search_by_key(&row, |slack| slack.0).is_ok();
        let bounds = branch.variable_bounds();
        let n_all = branch.n_variables() as u32;
        let n_original = branch.n_original();
        let is_free = |i: &u32| {
            let i = *i as usize;
            i < n_original && bounds.lower[i] < bounds.upper[i]
        };
        let variables: Vec<u32> = (0..n_all).filter(is_free).collect();
        let mut numbers = vec![u32::MAX; n_all as usize];
        for (number, &variable) in (0..).zip(&variables) {
            numbers[variable as usize] = number;
        }
        let bounds = branch.row_bounds();
        let jacobian = branch.jacobian_pattern();
        let takes_part = |row: &u32| {
            let row = *row as usize;
            let has_free = || {
                jacobian
                    .row(row)
                    .iter()
                    .any(|&j| numbers[j as usize] < n_all)
            };
            bounds.lower[row] == bounds.upper[row] && !is_stated(row) && has_free()
        };
        let rows: Vec<u32> = (0..branch.n_rows() as u32).filter(takes_part).collect();
        let (n, size) = (
            variables.len() as u32,
            (variables.len() + rows.len()) as u32,
        );
        let mut all: Vec<(u32, u32)> = (0..size).map(|i| (i, i)).collect();
        let of_row = |(number, &row): (u32, &u32)| {
            let first = jacobian.starts[row as usize] as u32;
            let columns = (first..).zip(jacobian.row(row as usize));
            let free = columns.filter(|(_, j)| numbers[**j as usize] < n_all);
            free.map(|(entry, &j)| (entry, (number, numbers[j as usize])))
                .collect::<Vec<_>>()
        };
        let places: Vec<Vec<(u32, (u32, u32))>> = (n..).zip(&rows).map(of_row).collect();
        all.extend(places.iter().flatten().map(|&(_, place)| place));
        let pattern = Pattern::new(size as usize, all);
        let place =
            |(i, j): (u32, u32)| pattern.place(i as usize, j).expect("the entry was put in") as u32;
        let entries = places.iter().map(|row| {
            let places = row.iter();
            places.map(|&(entry, at)| (entry, place(at))).collect()
        });
        Newton {
            entries: entries.collect(),
            diagonal: (0..size).map(|i| place((i, i))).collect(),
            solver: analyses.ldl(&pattern, &[]),
            matrix: vec![0.0; pattern.n_entries()],
            right: vec![0.0; size as usize],
            jacobian: vec![0.0; jacobian.n_entries()],
            values: vec![0.0; branch.n_rows()],
            variables,
            rows,
            slacks,
        }
    }

    /// The largest violation of a row, with slacks that are what their rows say; the values of rows are those at w then.
    fn residual(&mut self, branch: &mut Branch<'_, '_>, w: &mut [f64]) -> f64 {
        branch.rows(w, &mut self.values);
        let variables = branch.variable_bounds();
        let bounds = branch.row_bounds();
        for &(row, slack) in &self.slacks {
            let stated = w[slack] + self.values[row] - bounds.lower[row];
            let stated = stated.max(variables.lower[slack]);
            self.values[row] -= stated - w[slack];
            w[slack] = stated;
        }
        let outside = |(value, (lower, upper)): (&f64, (&f64, &f64))| {
            let violation = (lower - value).max(value - upper).max(0.0);
            if value.is_finite() {
                violation
            } else {
                f64::INFINITY
            }
        };
        let rows = self
            .values
            .iter()
            .zip(bounds.lower.iter().zip(bounds.upper));
        rows.map(outside).fold(0.0, f64::max)
    }

    /// Goes to where the linearized rows are met; nothing where there is no such step.
    fn step(&mut self, branch: &mut Branch<'_, '_>, w: &mut [f64]) -> Option<()> {
        branch.jacobian(w, &mut self.jacobian);
        let bounds = branch.row_bounds();
        let n = self.variables.len();
        self.matrix.fill(0.0);
        for &place in &self.diagonal[..n] {
            self.matrix[place as usize] = PRIMAL;
        }
        self.right[..n].fill(0.0);
        for (k, (&row, entries)) in self.rows.iter().zip(&self.entries).enumerate() {
            let slopes = entries
                .iter()
                .map(|&(entry, _)| self.jacobian[entry as usize].abs());
            let largest = slopes.fold(0.0, f64::max);
            let scale = if largest > 0.0 { 1.0 / largest } else { 1.0 };
            for &(entry, place) in entries {
                self.matrix[place as usize] = scale * self.jacobian[entry as usize];
            }
            self.matrix[self.diagonal[n + k] as usize] = -DUAL;
            let row = row as usize;
            self.right[n + k] = scale * (bounds.lower[row] - self.values[row]);
        }
        self.solver.factor(&self.matrix).ok()?;
        self.solver.solve(&mut self.right);
        for (&variable, change) in self.variables.iter().zip(&self.right) {
            w[variable as usize] += change;
        }
        w.iter().all(|w| w.is_finite()).then_some(())
    }

    /// Brings variables back to their bounds.
    fn project(&self, branch: &Branch<'_, '_>, w: &mut [f64]) {
        let bounds = branch.variable_bounds();
        for (w, (lower, upper)) in w.iter_mut().zip(bounds.lower.iter().zip(bounds.upper)) {
            *w = w.max(*lower).min(*upper);
        }
    }
}
