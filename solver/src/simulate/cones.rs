//! Coulomb's cones of contacts that meet: the problem of `meeting` without polygons.
//!
//! A contact is at a zero of
//!
//! min(λ, a),   β - P(β + ρ b, λ),
//!
//! where P(z, λ) is the point of the disc of radius max(λ, 0) that is nearest to z, an interval where there is one
//! slip velocity: -b is in the normal cone of the disc at -β, which is Coulomb's law (Alart & Curnier 1991). Both are
//! differentiable but for kinks, and Newton's method starts at the solution for polygons.

use super::meeting::{Meeting, norm};
use crate::linalg::DenseLu;

/// Iterations before there is no solution.
const MAX_NEWTON: usize = 60;

/// Halvings of a step that does not come closer.
const MAX_HALVINGS: usize = 8;

/// A residual that is solved, and one that rounding may leave.
const SOLVED: f64 = 4.0 * f64::EPSILON;
const ROUNDED: f64 = 1e-11;

/// The problem in units of forces and of rates.
pub(super) struct Cones<'m> {
    pub meeting: &'m Meeting,
    /// a and b without forces.
    pub rates: &'m [Vec<f64>; 2],
    /// Of λ and β by contact.
    pub unit: &'m [f64],
}

impl Cones<'_> {
    /// Moves λ and β to a solution, and returns its residual; none where there is none close by.
    pub(super) fn refine(&self, normal: &mut [f64], friction: &mut [f64]) -> Option<f64> {
        let n = normal.len();
        let mut z: Vec<f64> = normal.iter().chain(friction.iter()).copied().collect();
        let mut lu = DenseLu::new(z.len());
        let (mut residual, mut matrix) = self.evaluate(&z);
        let mut error = norm(&residual);
        for _ in 0..MAX_NEWTON {
            if error <= SOLVED {
                break;
            }
            lu.factor(&matrix).ok()?;
            let mut step = residual.clone();
            lu.solve(&mut step);
            let mut share = 1.0;
            let mut best: Option<(f64, Vec<f64>)> = None;
            for _ in 0..MAX_HALVINGS {
                let next: Vec<f64> = z.iter().zip(&step).map(|(z, s)| z - share * s).collect();
                let found = norm(&self.evaluate(&next).0);
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
            z = next;
            (residual, matrix) = self.evaluate(&z);
            error = norm(&residual);
            if !error.is_finite() {
                return None;
            }
        }
        normal.copy_from_slice(&z[..n]);
        friction.copy_from_slice(&z[n..]);
        (error <= ROUNDED).then_some(error)
    }

    /// The residual at λ and β with its derivative, row by row.
    fn evaluate(&self, z: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let meeting = self.meeting;
        let (n, size) = (meeting.contacts.len(), z.len());
        let (mut residual, mut matrix) = (vec![0.0; size], vec![0.0; size * size]);
        // A rate, and its derivative by λ and β.
        let rate = |of_slip: bool, at: usize| -> (f64, Vec<f64>) {
            let blocks = if of_slip { [2, 3] } else { [0, 1] };
            let mut slopes = vec![0.0; size];
            for i in 0..n {
                slopes[i] = meeting.row(blocks[0], at)[i] * self.unit[i];
                for t in meeting.entries(i) {
                    slopes[n + t] = -meeting.row(blocks[1], at)[t] * self.unit[i];
                }
            }
            let by_forces: f64 = slopes.iter().zip(z).map(|(slope, z)| slope * z).sum();
            (self.rates[usize::from(of_slip)][at] + by_forces, slopes)
        };
        for i in 0..n {
            let (a, slopes) = rate(false, i);
            if a < z[i] {
                residual[i] = a;
                matrix[i * size..(i + 1) * size].copy_from_slice(&slopes);
            } else {
                residual[i] = z[i];
                matrix[i * size + i] = 1.0;
            }
            let entries = meeting.entries(i);
            let resistance = meeting.resistance(i) * self.unit[i];
            // Without resistance there is no friction, and no force of it matters.
            let weight = if resistance > 0.0 {
                1.0 / resistance
            } else {
                0.0
            };
            let radius = z[i].max(0.0);
            let slips: Vec<(f64, Vec<f64>)> = entries.clone().map(|t| rate(true, t)).collect();
            let beyond = |(t, (b, _)): (usize, &(f64, Vec<f64>))| z[n + t] + weight * b;
            let target: Vec<f64> = entries.clone().zip(&slips).map(beyond).collect();
            let length = norm(&target);
            for (k, t) in entries.clone().enumerate() {
                let row = n + t;
                matrix[row * size + row] += 1.0;
                // ∂P/∂z of the nearest point, and ∂P/∂λ.
                let (nearest, by_radius) = match length <= radius {
                    true => (target[k], 0.0),
                    false => (radius * target[k] / length, target[k] / length),
                };
                residual[row] = z[row] - nearest;
                if z[i] > 0.0 {
                    matrix[row * size + i] -= by_radius;
                }
                for (l, other) in entries.clone().enumerate() {
                    let same = f64::from(u8::from(k == l));
                    let slope = match length <= radius {
                        true => same,
                        false => {
                            radius / length * (same - target[k] * target[l] / (length * length))
                        }
                    };
                    matrix[row * size + n + other] -= slope;
                    for (column, by) in slips[l].1.iter().enumerate() {
                        matrix[row * size + column] -= slope * weight * by;
                    }
                }
            }
        }
        (residual, matrix)
    }
}
