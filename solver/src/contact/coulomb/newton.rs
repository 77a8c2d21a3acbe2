//! Frictional contact problems by Newton's method.
//!
//! A solution is a zero of
//!
//! min(λ - λ₀, a),   β - P(β + ρ b, μλ),
//!
//! where P(z, r) is the point of the disc of radius max(r, 0) that is nearest to z, an interval where there is one
//! slip velocity: -b is in the normal cone of the disc at -β, which is Coulomb's law (Alart & Curnier 1991, *A mixed
//! formulation for frictional contact problems prone to Newton like solution methods*). Both are differentiable but for
//! kinks, and Newton's method starts close by: at the solution for polygons, or at what sweeps have come to.

use super::problem::Problem;
use crate::linalg::{DenseLu, norm};

/// Iterations before there is no solution.
const MAX_NEWTON: usize = 60;

/// Halvings of a step that does not come closer.
const MAX_HALVINGS: usize = 8;

/// A residual that is solved, and one that rounding may leave.
const SOLVED: f64 = 4.0 * f64::EPSILON;
pub(crate) const ROUNDED: f64 = 1e-11;

/// A step so many times as long as the residual comes of a singular matrix, which is damped by so much.
const FAR: f64 = 1e8;
const DAMPING: f64 = 1e-10;

/// The method, with its memory.
pub(crate) struct Newton {
    laws: Laws,
    lu: DenseLu,
    /// s, p - share s, and the one of these that has come closest.
    step: Vec<f64>,
    trial: Vec<f64>,
    closest: Vec<f64>,
    /// Matrices that were factored for the last problem.
    pub factorizations: usize,
}

impl Default for Newton {
    fn default() -> Self {
        Newton {
            laws: Laws::default(),
            lu: DenseLu::new(0),
            step: Vec::new(),
            trial: Vec::new(),
            closest: Vec::new(),
            factorizations: 0,
        }
    }
}

impl Newton {
    /// Moves p to a solution, and returns the size of the residual that is left; none where a step has no numbers. Forces
    /// and rates are in units of about their size.
    pub fn solve(&mut self, problem: &Problem, forces: &mut [f64]) -> Option<f64> {
        self.factorizations = 0;
        self.laws.resize(problem.w.size());
        let mut error = self.laws.error(problem, forces);
        for _ in 0..MAX_NEWTON {
            if error <= SOLVED {
                break;
            }
            self.laws.differentiate(problem, forces);
            self.find_step()?;
            let found = self.search(problem, forces, error);
            // What rounding leaves becomes no smaller.
            if found >= error && error <= ROUNDED {
                break;
            }
            forces.copy_from_slice(&self.closest);
            error = self.laws.error(problem, forces);
            if !error.is_finite() {
                return None;
            }
        }
        Some(error)
    }

    /// The step s, which leads from p to p - s: G s = F, where F are the values of the equations and G is one of their
    /// generalized derivatives.
    ///
    /// G is singular where the forces of sticking contacts are not unique, as W is singular there (hyperstatic contacts).
    /// After rounding, no factors exist then, or ‖s‖ > FAR ‖F‖. The regularized (G + δ 1) s = F with δ = DAMPING has,
    /// where G s = F has solutions, about one of them: for symmetric G that of least norm, up to O(δ).
    fn find_step(&mut self) -> Option<()> {
        let (residual, matrix) = (&self.laws.residual, &mut self.laws.matrix);
        let size = residual.len();
        self.lu.resize(size);
        self.step.clone_from(residual);
        self.factorizations += 1;
        if self.lu.factor(matrix).is_ok() {
            self.lu.solve(&mut self.step);
            if norm(&self.step) <= FAR * norm(residual) {
                return Some(());
            }
            self.step.copy_from_slice(residual);
        }
        (0..size).for_each(|i| matrix[i * size + i] += DAMPING);
        self.factorizations += 1;
        self.lu.factor(matrix).ok()?;
        self.lu.solve(&mut self.step);
        Some(())
    }

    /// Halves the step until the residual decreases, and keeps the point with the smallest one, which is returned.
    fn search(&mut self, problem: &Problem, forces: &[f64], error: f64) -> f64 {
        let (mut share, mut least) = (1.0, None);
        for _ in 0..MAX_HALVINGS {
            let terms = forces.iter().zip(&self.step);
            self.trial.clear();
            self.trial.extend(terms.map(|(p, s)| p - share * s));
            let found = self.laws.error(problem, &self.trial);
            if least.is_none_or(|least| found < least) {
                least = Some(found);
                std::mem::swap(&mut self.closest, &mut self.trial);
            }
            if found < (1.0 - 1e-4 * share) * error {
                break;
            }
            share *= 0.5;
        }
        least.unwrap_or(error)
    }
}

/// The equations at some p.
#[derive(Default)]
struct Laws {
    /// Their values.
    residual: Vec<f64>,
    /// a - (λ - λ₀) by contact, and β + ρ b against its direction by entry.
    targets: Vec<f64>,
    /// Their derivatives, row by row.
    matrix: Vec<f64>,
}

impl Laws {
    fn resize(&mut self, size: usize) {
        self.residual.resize(size, 0.0);
        self.targets.resize(size, 0.0);
        self.matrix.resize(size * size, 0.0);
    }

    /// The size of their values.
    fn error(&mut self, problem: &Problem, forces: &[f64]) -> f64 {
        self.evaluate(problem, forces);
        norm(&self.residual)
    }

    fn evaluate(&mut self, problem: &Problem, forces: &[f64]) {
        let w = &problem.w;
        for i in 0..w.n_contacts() {
            let (a, above) = (problem.rate(i, forces), forces[i] - problem.least[i]);
            self.targets[i] = a - above;
            self.residual[i] = if a < above { a } else { above };
            let (rows, resistance) = (w.slip_rows(i), w.resistance(i));
            if resistance <= 0.0 {
                // There is no friction, and no force of it matters.
                self.residual[rows.clone()].copy_from_slice(&forces[rows]);
                continue;
            }
            for t in rows.clone() {
                self.targets[t] = forces[t] - problem.rate(t, forces) / resistance;
            }
            let (radius, length) = (
                radius(problem, i, forces),
                norm(&self.targets[rows.clone()]),
            );
            for t in rows {
                let nearest = match length <= radius {
                    true => self.targets[t],
                    false => radius * self.targets[t] / length,
                };
                self.residual[t] = forces[t] - nearest;
            }
        }
    }

    /// The derivatives where they were evaluated.
    fn differentiate(&mut self, problem: &Problem, forces: &[f64]) {
        let w = &problem.w;
        let size = w.size();
        let matrix = &mut self.matrix;
        matrix.fill(0.0);
        for i in 0..w.n_contacts() {
            if self.targets[i] < 0.0 {
                matrix[i * size..(i + 1) * size].copy_from_slice(w.row(i));
            } else {
                matrix[i * size + i] = 1.0;
            }
            let (rows, resistance) = (w.slip_rows(i), w.resistance(i));
            let (radius, length) = (
                radius(problem, i, forces),
                norm(&self.targets[rows.clone()]),
            );
            for t in rows.clone() {
                let row = &mut matrix[t * size..(t + 1) * size];
                row[t] += 1.0;
                if resistance <= 0.0 {
                    continue;
                }
                // ∂P/∂r, and ∂P/∂z.
                let turns = length > radius;
                if turns && forces[i] > 0.0 {
                    row[i] -= problem.mu[i] * (self.targets[t] / length);
                }
                for other in rows.clone() {
                    let same = f64::from(u8::from(t == other));
                    let across = self.targets[t] * self.targets[other] / (length * length);
                    let slope = match turns {
                        true => radius / length * (same - across),
                        false => same,
                    };
                    row[other] -= slope;
                    for (place, by) in row.iter_mut().zip(w.row(other)) {
                        *place += slope / resistance * by;
                    }
                }
            }
        }
    }
}

/// max(μλ, 0)
fn radius(problem: &Problem, contact: usize, forces: &[f64]) -> f64 {
    problem.mu[contact] * forces[contact].max(0.0)
}
