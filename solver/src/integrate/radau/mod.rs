//! Radau IIA: an implicit method of order 2s - 1 for stiff modes.
//!
//! x' = f(t, x, α),   0 = φ(t, x, α),   y = (x, α),   F = (f, φ),   M = diag(I, 0)
//!
//! The step is the polynomial u of degree s that satisfies both equations at the nodes c_i h. With
//! z_i = u(c_i h) - y₀ that is
//!
//! R_i = F(y₀ + z_i) - M Σ_j (A⁻¹)_ij z_j / h = 0,
//!
//! solved by simplified Newton iterations with the Jacobian J = ∂(f, φ)/∂(x, α) of an earlier point.
//! The error of u shows in its filtered defect,
//!
//! (γ/h M - J)⁻¹ (F(u(τ)) - M u'(τ)).
//!
//! At the start that is the embedded formula of order s of Hairer & Wanner 1996, section IV.8: its
//! weights there are those of the Lagrange polynomials of the nodes at 0. It does not see what stiff
//! components do between the nodes, so a few points there are looked at too.

mod blocks;
mod newton;
mod tableau;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use crate::expansion::series;
use newton::{Accuracy, Newton, largest};
pub(crate) use tableau::Tableau;

/// x' = f(t, x, α) and 0 = φ(t, x, α).
pub(crate) trait Implicit {
    /// Writes f and φ at t and y = (x, α).
    fn eval(&mut self, t: f64, y: &[f64], values: &mut [f64]);
    /// Writes ∂(f, φ)/∂(x, α), row major.
    fn jacobian(&mut self, t: f64, y: &[f64], matrix: &mut [f64]);
}

/// Lengths of x and α.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shape {
    pub states: usize,
    pub algebraic: usize,
}

impl Shape {
    /// Length of y.
    pub(crate) fn unknowns(&self) -> usize {
        self.states + self.algebraic
    }
}

/// Where a step starts, and what its error is relative to.
#[derive(Default)]
pub(crate) struct Start {
    pub t: f64,
    /// (x, α) with φ = 0.
    pub y: Vec<f64>,
    /// Magnitudes of y.
    pub scales: Vec<f64>,
    /// Sizes of the terms of f and φ, which may cancel.
    pub terms: Vec<f64>,
}

/// No step is small enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stuck;

/// Counts of what was done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    pub rejected: usize,
    pub evaluations: usize,
    pub iterations: usize,
    pub factorizations: usize,
}

/// The polynomials of the step solved last.
struct Polynomials {
    /// Series of y around the start, one after another.
    series: Vec<f64>,
    /// Coefficients of each.
    n: usize,
    /// Where the series start, and how far they reach; 0 when there are none.
    origin: f64,
    reach: f64,
}

impl Polynomials {
    /// That of an entry of y.
    fn row(&self, row: usize) -> &[f64] {
        &self.series[row * self.n..][..self.n]
    }

    /// All of them, one after another.
    fn rows(&self) -> impl Iterator<Item = &[f64]> {
        self.series.chunks(self.n)
    }
}

/// Memory and history of a run of steps on one problem.
pub(crate) struct Radau {
    tableau: Arc<Tableau>,
    tolerance: f64,
    newton: Newton,
    /// f and φ at the start.
    start: Vec<f64>,
    polynomials: Polynomials,
    /// What the errors of the last solved step are relative to.
    sizes: Vec<f64>,
    error: Vec<f64>,
    y: Vec<f64>,
    values: Vec<f64>,
    /// Length to try next.
    next: f64,
    /// Length and error of the last accepted step, for the prediction of the next length.
    accepted: Option<(f64, f64)>,
    pub counts: Counts,
}

/// Attempts at one step before it counts as impossible.
const MAX_ATTEMPTS: usize = 60;

/// What a step may be longer, or shorter after its error was too large, than the one before
/// (Hairer & Wanner 1996, section IV.8).
const MAX_GROWTH: f64 = 8.0;
const MAX_SHRINKAGE: f64 = 0.125;

/// Below this the defect is rounding, relative to the magnitude of the states.
const FINEST: f64 = 1e-13;

/// An extrapolated polynomial is a good guess this many times its own reach.
const EXTRAPOLATED: f64 = 3.0;

impl Radau {
    /// Memory for a problem; errors of a step are kept below `tolerance` times the scales.
    pub(crate) fn new(tableau: Arc<Tableau>, shape: Shape, tolerance: f64) -> Self {
        let unknowns = shape.unknowns();
        Radau {
            newton: Newton::new(&tableau, shape),
            start: vec![0.0; unknowns],
            polynomials: Polynomials {
                series: vec![0.0; unknowns * (tableau.s + 1)],
                n: tableau.s + 1,
                origin: 0.0,
                reach: 0.0,
            },
            sizes: vec![0.0; unknowns],
            error: vec![0.0; unknowns],
            y: vec![0.0; unknowns],
            values: vec![0.0; unknowns],
            next: 0.0,
            accepted: None,
            counts: Counts::default(),
            tolerance: tolerance.max(FINEST),
            tableau,
        }
    }

    /// Forgets the steps before: the next one is tried with length `h`.
    pub(crate) fn restart(&mut self, h: f64) {
        self.polynomials.reach = 0.0;
        self.accepted = None;
        self.next = h;
        self.newton.forget();
    }

    /// Takes a point that stays for what the next step goes on from: of another problem with the same Jacobian.
    pub(crate) fn hold(&mut self, start: &Start, h: f64) {
        let rows = self.polynomials.series.chunks_mut(self.polynomials.n);
        for (row, &y) in rows.zip(&start.y) {
            row.fill(0.0);
            row[0] = y;
        }
        self.polynomials.origin = start.t;
        self.polynomials.reach = h;
    }

    /// Degree of the polynomials.
    pub(crate) fn degree(&self) -> usize {
        self.tableau.s
    }

    /// Tries at most this length next.
    pub(crate) fn limit_next(&mut self, h: f64) {
        self.next = self.next.min(h);
    }

    /// Series of an entry of y around the start of the step solved last.
    pub(crate) fn series(&self, row: usize) -> &[f64] {
        self.polynomials.row(row)
    }

    /// An entry of y at the end of the step solved last.
    pub(crate) fn end(&self, start: &Start, row: usize) -> f64 {
        start.y[row] + self.newton.displacement(self.tableau.s - 1)[row]
    }

    /// y - y₀ at a node of the step solved last.
    pub(crate) fn displacement(&self, node: usize) -> &[f64] {
        self.newton.displacement(node)
    }

    /// What rounding of f and φ does to an entry of y within the step solved last, over ε.
    pub(crate) fn noise(&self, row: usize) -> f64 {
        self.newton.noise[row]
    }

    /// Error of the last accepted step, relative to the magnitudes.
    pub(crate) fn error(&self) -> f64 {
        self.accepted
            .map_or(0.0, |(_, error)| error * self.tolerance)
    }

    /// Length of the step solved last, within which its polynomials hold.
    pub(crate) fn reach(&self) -> f64 {
        self.polynomials.reach
    }

    pub(crate) fn shape(&self) -> Shape {
        self.newton.shape
    }

    /// Solves the step of the largest length up to `longest` that passes the error test, and gives
    /// that length.
    pub(crate) fn step(
        &mut self,
        problem: &mut impl Implicit,
        start: &Start,
        longest: f64,
    ) -> Result<f64, Stuck> {
        problem.eval(start.t, &start.y, &mut self.start);
        self.counts.evaluations += 1;
        let mut h = self.next.min(longest);
        // A step that ends early says nothing against longer ones.
        let wanted = if h == longest { self.next } else { 0.0 };
        let mut first = self.accepted.is_none();
        for _ in 0..MAX_ATTEMPTS {
            if h.is_nan() || start.t + h <= start.t {
                return Err(Stuck);
            }
            if self.solve(problem, start, h).is_err() {
                self.counts.rejected += 1;
                first = true;
                h *= if self.newton.is_current(start.t) {
                    0.5
                } else {
                    1.0
                };
                continue;
            }
            let error = self.measure(problem, start, first);
            let proposed = self.propose(h, error);
            if error < 1.0 {
                self.accepted = Some((h, error.max(1e-2)));
                self.next = if h == longest {
                    proposed.max(wanted)
                } else {
                    proposed
                };
                return Ok(h);
            }
            self.counts.rejected += 1;
            first = true;
            h = proposed.min(0.9 * h);
        }
        Err(Stuck)
    }

    /// Solves the step of this length without an error test.
    pub(crate) fn solve(
        &mut self,
        problem: &mut impl Implicit,
        start: &Start,
        h: f64,
    ) -> Result<(), Stuck> {
        self.guess(start, h);
        let accuracy = Accuracy {
            tolerance: self.tolerance,
            sizes: &mut self.sizes,
        };
        let counts = &mut self.counts;
        let solved = self.newton.solve(problem, start, h, accuracy, counts);
        solved.map_err(|_| Stuck)?;
        self.interpolate(start, h);
        Ok(())
    }

    /// The error of the step solved last, relative to the tolerance: the largest filtered defect. One
    /// that is too large at the start is looked at a second time where the length is a guess (Hairer &
    /// Wanner 1996, section IV.8).
    fn measure(&mut self, problem: &mut impl Implicit, start: &Start, guessed: bool) -> f64 {
        self.values.copy_from_slice(&self.start);
        let mut error = self.filtered_defect(0.0);
        if error >= 1.0 && guessed {
            for ((y, start), error) in self.y.iter_mut().zip(&start.y).zip(&self.error) {
                *y = start + error;
            }
            problem.eval(start.t, &self.y, &mut self.values);
            self.counts.evaluations += 1;
            error = self.filtered_defect(0.0);
        }
        for probe in 0..self.tableau.probes.len() {
            let at = self.tableau.probes[probe] * self.polynomials.reach;
            error = error.max(self.error_at(problem, start, at));
        }
        error
    }

    /// The filtered defect of the step solved last, at an instant of it.
    pub(crate) fn error_at(&mut self, problem: &mut impl Implicit, start: &Start, tau: f64) -> f64 {
        for (row, y) in self.y.iter_mut().enumerate() {
            *y = series::value(self.polynomials.row(row), tau);
        }
        problem.eval(start.t + tau, &self.y, &mut self.values);
        self.counts.evaluations += 1;
        self.filtered_defect(tau)
    }

    /// (γ/h M - J)⁻¹ (values - M u'(τ)), relative to the tolerance.
    fn filtered_defect(&mut self, tau: f64) -> f64 {
        let states = self.newton.shape.states;
        self.error
            .copy_from_slice(&self.values[..self.newton.shape.unknowns()]);
        let errors = self.error[..states].iter_mut();
        for (error, row) in errors.zip(self.polynomials.rows()) {
            *error -= series::slope(row, tau);
        }
        self.newton.filter(&mut self.error);
        let relative = self
            .error
            .iter()
            .zip(&self.sizes)
            .map(|(e, size)| e.abs() / size);
        largest(relative) / self.tolerance
    }

    /// The length that makes the error a little smaller than the tolerance, by the last error and by
    /// the trend of the last two (Gustafsson 1994), less where Newton's method had to work hard.
    fn propose(&self, h: f64, error: f64) -> f64 {
        let power = -1.0 / (self.degree() + 1) as f64;
        let (took, most) = self.newton.effort();
        let safety = 0.9 * (2 * most + 1) as f64 / (2 * most + took) as f64;
        let mut factor = safety * error.powf(power);
        if let Some((last, last_error)) = self.accepted
            && error < 1.0
        {
            factor = factor.min(0.9 * h / last * (error * error / last_error).powf(power));
        }
        let factor = factor.clamp(MAX_SHRINKAGE, MAX_GROWTH);
        // A new factorization costs more than a slightly longer step gains.
        if (1.0..1.2).contains(&factor) && error < 1.0 {
            h
        } else {
            h * factor
        }
    }

    /// Displacements at the nodes as the series of the step before, or of a longer one, has them.
    fn guess(&mut self, start: &Start, h: f64) {
        let shift = start.t - self.polynomials.origin;
        let reach = self.polynomials.reach;
        let known = reach > 0.0 && shift >= 0.0 && shift <= (1.0 + 1e-9) * reach;
        if !known {
            self.newton.forget();
        }
        let usable = known && shift + h <= EXTRAPOLATED * reach;
        for (i, node) in self.tableau.nodes.iter().enumerate() {
            let z = self.newton.displacement_mut(i);
            if !usable {
                z.fill(0.0);
                continue;
            }
            for ((z, row), y) in z.iter_mut().zip(self.polynomials.rows()).zip(&start.y) {
                *z = series::value(row, shift + node * h) - y;
            }
        }
    }

    /// Turns the displacements into series.
    fn interpolate(&mut self, start: &Start, h: f64) {
        let rows = self.polynomials.series.chunks_mut(self.polynomials.n);
        for (row, (series, &y)) in rows.zip(&start.y).enumerate() {
            let displacement = |i: usize| self.newton.displacement(i)[row];
            self.tableau.interpolate(y, displacement, h, series);
        }
        self.polynomials.origin = start.t;
        self.polynomials.reach = h;
    }

    /// The nodes and probes of the method, as fractions of a step.
    pub(crate) fn tableau(&self) -> &Tableau {
        &self.tableau
    }
}
