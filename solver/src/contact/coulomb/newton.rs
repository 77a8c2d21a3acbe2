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

use super::law::norm;
use super::problem::Problem;
use crate::linalg::DenseLu;

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

/// Moves p to a solution, and returns the size of the residual that is left; none where a step has no numbers. Forces
/// and rates are in units of about their size.
pub(crate) fn refine(problem: &Problem, forces: &mut Vec<f64>) -> Option<f64> {
    let mut lu = DenseLu::new(forces.len());
    let mut laws = Laws::new(problem);
    laws.evaluate(forces);
    let mut error = norm(&laws.residual);
    for _ in 0..MAX_NEWTON {
        if error <= SOLVED {
            break;
        }
        laws.differentiate(forces);
        let step = step(&mut lu, &mut laws)?;
        let mut share = 1.0;
        let mut best: Option<(f64, Vec<f64>)> = None;
        for _ in 0..MAX_HALVINGS {
            let terms = forces.iter().zip(&step);
            let next: Vec<f64> = terms.map(|(force, s)| force - share * s).collect();
            laws.evaluate(&next);
            let found = norm(&laws.residual);
            let improves = found < (1.0 - 1e-4 * share) * error;
            if best.as_ref().is_none_or(|best| found < best.0) {
                best = Some((found, next));
            }
            if improves {
                break;
            }
            share *= 0.5;
        }
        let (found, next) = best?;
        // What rounding leaves becomes no smaller.
        if found >= error && error <= ROUNDED {
            break;
        }
        *forces = next;
        laws.evaluate(forces);
        error = norm(&laws.residual);
        if !error.is_finite() {
            return None;
        }
    }
    Some(error)
}

/// The equations at some p.
struct Laws<'p> {
    problem: &'p Problem,
    /// Their values.
    residual: Vec<f64>,
    /// a - (λ - λ₀) by contact, and β + ρ b against its direction by entry.
    targets: Vec<f64>,
    /// Their derivatives, row by row.
    matrix: Vec<f64>,
}

impl<'p> Laws<'p> {
    fn new(problem: &'p Problem) -> Self {
        let size = problem.w.size();
        Laws {
            problem,
            residual: vec![0.0; size],
            targets: vec![0.0; size],
            matrix: vec![0.0; size * size],
        }
    }

    /// max(μλ, 0)
    fn radius(&self, contact: usize, forces: &[f64]) -> f64 {
        self.problem.mu[contact] * forces[contact].max(0.0)
    }

    fn evaluate(&mut self, forces: &[f64]) {
        let (problem, w) = (self.problem, &self.problem.w);
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
            let (radius, length) = (self.radius(i, forces), norm(&self.targets[rows.clone()]));
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
    fn differentiate(&mut self, forces: &[f64]) {
        let (problem, w) = (self.problem, &self.problem.w);
        let size = w.size();
        let mut matrix = std::mem::take(&mut self.matrix);
        matrix.fill(0.0);
        for i in 0..w.n_contacts() {
            if self.targets[i] < 0.0 {
                matrix[i * size..(i + 1) * size].copy_from_slice(w.row(i));
            } else {
                matrix[i * size + i] = 1.0;
            }
            let (rows, resistance) = (w.slip_rows(i), w.resistance(i));
            let (radius, length) = (self.radius(i, forces), norm(&self.targets[rows.clone()]));
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
        self.matrix = matrix;
    }
}

/// Newton's step s, which leads from p to p - s: G s = F, where F are the values of the equations and G is one of their
/// generalized derivatives.
///
/// G is singular where the forces of sticking contacts are not unique, as W is singular there (hyperstatic contacts).
/// After rounding, no factors exist then, or ‖s‖ > FAR ‖F‖. The regularized (G + δ 1) s = F with δ = DAMPING has,
/// where G s = F has solutions, about one of them: for symmetric G that of least norm, up to O(δ).
fn step(lu: &mut DenseLu, laws: &mut Laws) -> Option<Vec<f64>> {
    let Laws {
        residual, matrix, ..
    } = laws;
    let size = residual.len();
    let mut step = residual.clone();
    if lu.factor(matrix).is_ok() {
        lu.solve(&mut step);
        if norm(&step) <= FAR * norm(residual) {
            return Some(step);
        }
        step.copy_from_slice(residual);
    }
    (0..size).for_each(|i| matrix[i * size + i] += DAMPING);
    lu.factor(matrix).ok()?;
    lu.solve(&mut step);
    Some(step)
}
