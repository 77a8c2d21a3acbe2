//! Coulomb's cones of contacts that meet: the problem of `meeting` without polygons.
//!
//! A contact is at a zero of
//!
//! min(λ - λ₀, a),   β - P(β + ρ b, λ),
//!
//! where P(z, λ) is the point of the disc of radius max(λ, 0) that is nearest to z, an interval where there is one
//! slip velocity: -b is in the normal cone of the disc at -β, which is Coulomb's law (Alart & Curnier 1991). Both are
//! differentiable but for kinks, and Newton's method starts at the solution for polygons.

use crate::contact::problem::{Meeting, norm};
use crate::linalg::DenseLu;

/// Iterations before there is no solution.
const MAX_NEWTON: usize = 60;

/// Halvings of a step that does not come closer.
const MAX_HALVINGS: usize = 8;

/// A residual that is solved, and one that rounding may leave.
const SOLVED: f64 = 4.0 * f64::EPSILON;
const ROUNDED: f64 = 1e-11;

/// A step so many times as long as the residual comes of a singular matrix, which is damped by so much.
const FAR: f64 = 1e8;
const DAMPING: f64 = 1e-10;

/// The problem in units of forces and of rates.
pub(crate) struct Cones<'m> {
    pub meeting: &'m Meeting,
    /// a and b without forces, and λ₀.
    pub rates: &'m [Vec<f64>; 3],
    /// Of λ and β by contact.
    pub unit: &'m [f64],
}

impl Cones<'_> {
    /// Moves λ and β to a solution, and returns its residual; none where there is none close by.
    pub(crate) fn refine(&self, normal: &mut [f64], friction: &mut [f64]) -> Option<f64> {
        let n = normal.len();
        let mut z: Vec<f64> = normal.iter().chain(friction.iter()).copied().collect();
        let mut lu = DenseLu::new(z.len());
        let slopes = self.slopes();
        let (mut residual, mut matrix) = self.evaluate(&slopes, &z);
        let mut error = norm(&residual);
        for _ in 0..MAX_NEWTON {
            if error <= SOLVED {
                break;
            }
            let step = step(&mut lu, &mut matrix, &residual)?;
            let mut share = 1.0;
            let mut best: Option<(f64, Vec<f64>)> = None;
            for _ in 0..MAX_HALVINGS {
                let next: Vec<f64> = z.iter().zip(&step).map(|(z, s)| z - share * s).collect();
                let found = norm(&self.evaluate(&slopes, &next).0);
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
            (residual, matrix) = self.evaluate(&slopes, &z);
            error = norm(&residual);
            if !error.is_finite() {
                return None;
            }
        }
        normal.copy_from_slice(&z[..n]);
        friction.copy_from_slice(&z[n..]);
        let slips: Vec<f64> = (n..z.len())
            .map(|row| self.rate(&slopes, &z, row))
            .collect();
        self.share(&slopes, normal, friction, &slips);
        (error <= ROUNDED).then_some(error)
    }

    /// The derivatives of all a, and behind them of all b, by λ and β, row by row.
    fn slopes(&self) -> Vec<f64> {
        let meeting = self.meeting;
        let n = meeting.contacts.len();
        let size = n + meeting.n_slips();
        let mut slopes = vec![0.0; size * size];
        for (at, row) in slopes.chunks_exact_mut(size).enumerate() {
            let [normal, friction] = match at.checked_sub(n) {
                None => [0, 1].map(|block| meeting.row(block, at)),
                Some(slip) => [2, 3].map(|block| meeting.row(block, slip)),
            };
            for i in 0..n {
                row[i] = normal[i] * self.unit[i];
                for t in meeting.entries(i) {
                    row[n + t] = -friction[t] * self.unit[i];
                }
            }
        }
        slopes
    }

    /// a of a contact, or b of an entry behind them, at λ and β.
    fn rate(&self, slopes: &[f64], z: &[f64], at: usize) -> f64 {
        let of_row = &slopes[at * z.len()..(at + 1) * z.len()];
        let by_forces = of_row.iter().zip(z).map(|(slope, z)| slope * z);
        let free = match at.checked_sub(self.meeting.contacts.len()) {
            None => self.rates[0][at],
            Some(slip) => self.rates[1][slip],
        };
        free + by_forces.sum::<f64>()
    }

    /// The residual at λ and β with its derivative, row by row.
    fn evaluate(&self, slopes: &[f64], z: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let meeting = self.meeting;
        let (n, size) = (meeting.contacts.len(), z.len());
        let (mut residual, mut matrix) = (vec![0.0; size], vec![0.0; size * size]);
        let slopes_of = |at: usize| &slopes[at * size..(at + 1) * size];
        let rate = |at: usize| self.rate(slopes, z, at);
        for i in 0..n {
            let (a, above) = (rate(i), z[i] - self.rates[2][i]);
            if a < above {
                residual[i] = a;
                matrix[i * size..(i + 1) * size].copy_from_slice(slopes_of(i));
            } else {
                residual[i] = above;
                matrix[i * size + i] = 1.0;
            }
            let entries = meeting.entries(i);
            let resistance = meeting.resistance(i) * self.unit[i];
            if resistance <= 0.0 {
                // There is no friction, and no force of it matters.
                for row in entries.map(|t| n + t) {
                    residual[row] = z[row];
                    matrix[row * size + row] = 1.0;
                }
                continue;
            }
            let radius = z[i].max(0.0);
            let beyond = |t: usize| z[n + t] + rate(n + t) / resistance;
            let target: Vec<f64> = entries.clone().map(beyond).collect();
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
                    for (column, by) in slopes_of(n + other).iter().enumerate() {
                        matrix[row * size + column] -= slope / resistance * by;
                    }
                }
            }
        }
        (residual, matrix)
    }
}

/// Newton's step; one of about the least length where contacts that stick make the matrix singular, as their forces are
/// not determined then.
fn step(lu: &mut DenseLu, matrix: &mut [f64], residual: &[f64]) -> Option<Vec<f64>> {
    let size = residual.len();
    let mut step = residual.to_vec();
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
