//! Whether the Lagrangian curves down along the rows and active bounds of a solution.
//!
//! The system of a step has n positive and m negative eigenvalues without a correction δ_w where, and only where, the
//! Lagrangian is convex on the null space of the rows, with Σ for the bounds (Nocedal & Wright 2006, theorem 16.3). Where
//! it needs one, inverse iteration with the corrected system,
//!
//! ( H + Σ_x + δ_w   Jᵀ ) (d⁺)   (d)
//! ( J            -Σ 1/w ) (· ) = (0),
//!
//! tends to the direction of the least curvature.

use super::direction::NewtonSystem;
use super::problem::BarrierProblem;
use crate::linalg::largest;

/// Curvature, in the scaled problem, that is not told apart from none.
const FLAT: f64 = 1e-6;
/// The largest number of inverse iterations: the first correction may be a hundred times what is missing.
const MAX_ITERATIONS: usize = 200;
/// A quotient that changes by less than this, relative to itself, has settled.
const SETTLED: f64 = 1e-3;
/// By how much a direction of negative curvature has outgrown any other one that an iteration has settled on.
const OUTGROWN: f64 = 1e6;

/// A direction of negative curvature at a solution, in the units of the variables, with a largest entry of 1.
pub(crate) fn falling(
    problem: &mut BarrierProblem<'_>,
    newton: &mut NewtonSystem,
) -> Option<Vec<f64>> {
    newton.kkt.forget_correction();
    newton.factor(problem).ok()?;
    if !newton.kkt.is_corrected() {
        return None;
    }
    let n = problem.form.shape.n;
    newton.rhs.fill(0.0);
    // Generic, and the same in every run.
    for (i, d) in newton.rhs[..n].iter_mut().enumerate() {
        *d = 1.0 + (i as f64 * 0.618_033_988_749_895).fract();
    }
    let (mut quotient, mut growth) = (f64::INFINITY, 1.0);
    for _ in 0..MAX_ITERATIONS {
        if problem.options.limit.is_over() {
            return None;
        }
        newton.solve(problem).ok()?;
        // K (d⁺, ·) = (d, 0): the quotient of d⁺ is dᵀd⁺ / d⁺ᵀd⁺ - δ_w.
        let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let next = &newton.reduced[..n];
        let delta = newton.kkt.regularization;
        let now = product(&newton.rhs[..n], next) / product(next, next) - delta;
        let size = largest(next);
        for (d, next) in newton.rhs[..n].iter_mut().zip(next) {
            *d = next / size;
        }
        let has_settled = (now - quotient).abs() <= SETTLED * now.abs();
        quotient = now;
        // One that is not negative may stay where it is for long: d⁺ grows by 1/(δ_w + the curvature) in each.
        growth *= (quotient + delta) / (delta - FLAT).max(0.0);
        if has_settled && (quotient < -FLAT || growth > OUTGROWN) {
            break;
        }
    }
    if quotient.is_nan() || quotient >= -FLAT {
        return None;
    }
    let mut falling = vec![0.0; problem.form.w.len()];
    for (&variable, d) in problem.form.shape.variables.iter().zip(&newton.rhs) {
        falling[variable as usize] = *d;
    }
    Some(falling)
}
