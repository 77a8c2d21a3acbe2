//! Nodes of the quadrature formulas on [0, 1], as zeros of shifted Legendre polynomials.
//!
//! With P_s orthogonal on [0, 1] and P_s(1) = 1, the nodes are the zeros of
//!
//! Gauss: P_s,   Radau: P_s + P_{s-1} (left), P_s - P_{s-1} (right),   Lobatto: P_s - P_{s-2}
//!
//! (Hairer & Wanner 1996, section IV.5, which writes the last three as derivatives.)

use super::extended::Extended;
use super::polynomials::{value_and_slope, without_factor};

/// A quadrature formula of highest order with ends of the interval among its nodes, or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quadrature {
    /// No end: order 2s.
    Gauss,
    /// The start: order 2s - 1.
    RadauLeft,
    /// The end: order 2s - 1.
    RadauRight,
    /// Both ends: order 2s - 2, with at least two nodes.
    Lobatto,
}

impl Quadrature {
    /// The nodes, ascending.
    pub(crate) fn nodes(self, s: usize) -> Vec<Extended> {
        let (lower, sign) = match self {
            Quadrature::Gauss => (s, 0.0),
            Quadrature::RadauLeft => (s - 1, 1.0),
            Quadrature::RadauRight => (s - 1, -1.0),
            Quadrature::Lobatto => (s - 2, -1.0),
        };
        let mut polynomial = legendre(s);
        for (c, other) in polynomial.iter_mut().zip(legendre(lower)) {
            *c += sign * other;
        }
        // Coefficients are integers, so that the ends are divided out without error.
        let mut inner: Vec<Extended> = polynomial.into_iter().map(Extended::from).collect();
        let starts = matches!(self, Quadrature::RadauLeft | Quadrature::Lobatto);
        let ends = matches!(self, Quadrature::RadauRight | Quadrature::Lobatto);
        let start = starts.then_some(Extended::ZERO);
        let end = ends.then_some(Extended::ONE);
        for root in start.into_iter().chain(end) {
            inner = without_factor(&inner, root);
        }
        let ascending = zeros(&inner).into_iter().rev();
        start.into_iter().chain(ascending).chain(end).collect()
    }
}

/// Coefficients (-1)^(n+k) C(n, k) C(n + k, k) of cᵏ in P_n on [0, 1].
fn legendre(n: usize) -> Vec<f64> {
    let first = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
    let next =
        |last: f64, k: usize| -last * ((n - k) * (n + k + 1)) as f64 / ((k + 1) * (k + 1)) as f64;
    let mut coefficients = vec![first];
    for k in 0..n {
        coefficients.push(next(coefficients[k], k));
    }
    coefficients
}

/// The zeros of a polynomial that has all of them, distinct, in (0, 1): descending.
fn zeros(polynomial: &[Extended]) -> Vec<Extended> {
    let mut left = polynomial.to_vec();
    let mut zeros = Vec::new();
    while left.len() > 1 {
        // From the right of all zeros Newton's method descends to the largest one.
        let guess = newton(&left, Extended::ONE);
        let zero = newton(polynomial, guess);
        left = without_factor(&left, zero);
        zeros.push(zero);
    }
    zeros
}

/// Newton's method until nothing is gained.
fn newton(polynomial: &[Extended], mut at: Extended) -> Extended {
    for _ in 0..MAX_ITERATIONS {
        let [value, slope] = value_and_slope(polynomial, at);
        let step = value / slope;
        at = at - step;
        if step.rounded().abs() < SMALLEST_STEP {
            break;
        }
    }
    at
}

/// Far from the largest of n zeros an iteration reduces the distance by 1 - 1/n at least.
const MAX_ITERATIONS: usize = 200;

/// Its square is below what 32 digits resolve.
const SMALLEST_STEP: f64 = 1e-18;
