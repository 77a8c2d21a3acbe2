//! Vertical form: rows c of an MPCC that are sides of pairs -> variables.
//!
//! c(w) - cl = s,   s >= 0   for every such row, so that both sides of every pair are variables with finite lower
//! bounds. A row that belongs to several pairs has one slack.

use crate::optimization::mpcc::branch::forcing::Forcing;
use crate::optimization::problem::{
    HeldStructure, Intervals, Member, Mpcc, Nlp, Other, Pattern, Side, Structure,
};

/// A problem in vertical form: its variables are those of the original one, then the slacks.
///
/// ```
/// use nsd_solver::optimization::mpcc::Lifted;
/// use nsd_solver::optimization::problem::{Nlp, Side};
/// use nsd_solver::optimization::quadratic::{Function, Quadratic};
///
/// // minimize w² subject to 0 <= w ⟂ 1 - w >= 0: the row -w >= -1 becomes a variable.
/// let row = (Function::default().linear(0, -1.0), -1.0, f64::INFINITY);
/// let objective = Function::default().product(0, 0, 1.0);
/// let mut problem = Quadratic::new(1, objective, vec![row])
///     .bound(0, 0.0, f64::INFINITY)
///     .complement(Side::Variable(0), Side::Row(0));
///
/// let lifted = Lifted::new(&mut problem);
/// assert_eq!((lifted.n_variables(), lifted.pairs()), (2, [[0, 1]].as_slice()));
/// ```
pub struct Lifted<'p> {
    problem: &'p mut dyn Mpcc,
    /// The rows that have a slack, ascending.
    lifted_rows: Vec<usize>,
    pairs: Vec<[u32; 2]>,
    structure: HeldStructure,
    /// Values of the original Jacobian.
    entries: Vec<f64>,
    forcing: Forcing,
}

impl<'p> Lifted<'p> {
    /// The vertical form of a problem.
    ///
    /// # Panics
    ///
    /// When a side of a pair has no finite lower bound.
    pub fn new(problem: &'p mut dyn Mpcc) -> Self {
        let n = problem.n_variables();
        let rows = problem.pairs().iter().flat_map(|pair| [pair.a, pair.b]);
        let mut lifted_rows: Vec<usize> = rows
            .filter_map(|side| match side {
                Side::Row(row) => Some(row as usize),
                Side::Variable(_) => None,
            })
            .collect();
        lifted_rows.sort_unstable();
        lifted_rows.dedup();
        let variable = |side| match side {
            Side::Variable(variable) => variable,
            Side::Row(row) => {
                let slack = lifted_rows.binary_search(&(row as usize));
                (n + slack.expect("every row of a pair is lifted")) as u32
            }
        };
        let sides = problem.pairs().iter();
        let pairs = sides
            .map(|pair| [variable(pair.a), variable(pair.b)])
            .collect();

        let n_slacks = lifted_rows.len();
        let bounds = problem.variable_bounds();
        let variables = Intervals::extended(bounds, n_slacks, [0.0, f64::INFINITY]);
        let mut rows = Intervals::extended(problem.row_bounds(), 0, [0.0; 2]);
        for &row in &lifted_rows {
            rows.upper[row] = rows.lower[row];
        }

        let original = problem.jacobian_pattern();
        let (mut starts, mut columns) = (vec![0], Vec::new());
        let mut slacks = lifted_rows.iter().zip(n..).peekable();
        for row in 0..problem.n_rows() {
            columns.extend_from_slice(original.row(row));
            if let Some((_, slack)) = slacks.next_if(|(lifted, _)| **lifted == row) {
                columns.push(slack as u32);
            }
            starts.push(columns.len());
        }
        let entries = vec![0.0; original.n_entries()];
        let jacobian = Pattern { starts, columns };
        let mut hessian = problem.hessian_pattern().clone();
        hessian.starts.resize(n + n_slacks + 1, hessian.n_entries());

        let structure = HeldStructure {
            variables,
            rows,
            start: problem.start().to_vec(),
            jacobian,
            hessian,
        };
        let mut lifted = Lifted {
            problem,
            lifted_rows,
            pairs,
            structure,
            entries,
            forcing: Forcing::default(),
        };
        for &side in lifted.pairs.iter().flatten() {
            let is_bounded = lifted.structure.variables.lower[side as usize].is_finite();
            assert!(is_bounded, "both sides of a pair have finite lower bounds");
        }
        lifted.structure.start = lifted.extend(&lifted.structure.start.clone());
        lifted.forcing = Forcing::new(&mut lifted);
        lifted
    }

    /// The pairs, by their variables.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// How many variables the original problem has.
    pub fn n_original(&self) -> usize {
        self.structure.variables.lower.len() - self.lifted_rows.len()
    }

    /// The rows that have a slack, with it.
    pub fn slacks(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.lifted_rows.iter().copied().zip(self.n_original()..)
    }

    /// A point of the original problem with its slacks, which are not negative.
    pub fn extend(&mut self, w: &[f64]) -> Vec<f64> {
        let mut rows = vec![0.0; self.structure.rows.lower.len()];
        self.problem.rows(w, &mut rows);
        let slacks = self.lifted_rows.iter().map(|&row| {
            let distance = rows[row] - self.structure.rows.lower[row];
            if distance.is_finite() {
                distance.max(0.0)
            } else {
                0.0
            }
        });
        w.iter().copied().chain(slacks).collect()
    }

    /// Settles the problem on members that are held at zero, or on none, and takes over its bounds.
    pub fn settle(&mut self, zeros: Option<&[Member]>) {
        if !self.problem.settle(zeros) {
            return;
        }
        let n = self.n_original();
        let HeldStructure {
            variables, rows, ..
        } = &mut self.structure;
        let bounds = self.problem.variable_bounds();
        variables.lower[..n].copy_from_slice(bounds.lower);
        variables.upper[..n].copy_from_slice(bounds.upper);
        let bounds = self.problem.row_bounds();
        rows.lower.copy_from_slice(bounds.lower);
        rows.upper.copy_from_slice(bounds.upper);
        for &row in &self.lifted_rows {
            rows.upper[row] = rows.lower[row];
        }
    }

    /// Bounds of the variables when these members of pairs are held at zero, and with them what they force.
    pub fn hold(&self, members: impl Iterator<Item = (usize, Member)>) -> Intervals {
        let mut bounds = self.structure.variables.clone();
        for (pair, member) in members {
            let side = self.pairs[pair][member as usize];
            for &j in self.problem.terms(pair, member).iter().chain([&side]) {
                bounds.upper[j as usize] = bounds.lower[j as usize];
            }
        }
        let rows = self.structure.rows.view();
        self.forcing.propagate(rows, &mut bounds);
        bounds
    }

    /// Points of other branches that mean the same.
    pub fn others(&mut self, w: &[f64], zeros: &[Member], y: &[f64]) -> Vec<Other> {
        let n = self.n_original();
        self.problem.others(&w[..n], zeros, y)
    }

    /// The point w with the values that `other` has in place of its own, and with slacks that follow from these; and the
    /// members that the branch of `other` holds at zero.
    pub fn moved(&mut self, other: &Other, w: &[f64], zeros: &[Member]) -> (Vec<f64>, Vec<Member>) {
        let mut w = w[..self.n_original()].to_vec();
        for &(variable, value) in &other.w {
            w[variable as usize] = value;
        }
        let mut zeros = zeros.to_vec();
        for &(pair, zero) in &other.zeros {
            zeros[pair as usize] = zero;
        }
        (self.extend(&w), zeros)
    }

    /// Distances a and b of a pair from their lower bounds.
    pub fn distances(&self, pair: usize, w: &[f64]) -> [f64; 2] {
        self.pairs[pair]
            .map(|side| w[side as usize] - self.structure.variables.lower[side as usize])
    }
}

impl Nlp for Lifted<'_> {
    fn structure(&self) -> Structure<'_> {
        self.structure.view()
    }

    fn has_objective(&self) -> bool {
        self.problem.has_objective()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        let n = self.n_original();
        self.problem.objective(&w[..n])
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        let n = self.n_original();
        let (original, slacks) = gradient.split_at_mut(n);
        self.problem.gradient(&w[..n], original);
        slacks.fill(0.0);
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        let (original, slacks) = w.split_at(self.n_original());
        self.problem.rows(original, rows);
        for (&row, slack) in self.lifted_rows.iter().zip(slacks) {
            rows[row] -= slack;
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        let n = self.n_original();
        self.problem.jacobian(&w[..n], &mut self.entries);
        // Rows keep their entries; that of the slack is the last one.
        let (mut from, mut to) = (0, 0);
        let total = self.entries.len();
        for &row in &self.lifted_rows {
            let end = self.structure.jacobian.starts[row + 1] - 1;
            let length = end - to;
            entries[to..end].copy_from_slice(&self.entries[from..from + length]);
            entries[end] = -1.0;
            (from, to) = (from + length, end + 1);
        }
        entries[to..].copy_from_slice(&self.entries[from..total]);
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        let n = self.n_original();
        self.problem.hessian(&w[..n], factor, y, entries);
    }
}
