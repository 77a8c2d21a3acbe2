//! Elements as long as a tolerance allows.
//!
//! Between its nodes the polynomial of an element misses x' = f by a defect of order h^s, and
//! misses x by about h times that, a local error of order s + 1; at the end of the element the
//! method is of order p > s. The length keeps the defect at ε^((s+1)/(p+1)), so that what the end is
//! off by is about the local tolerance ε.

use crate::fesd::element::scheme::Scheme;

/// A hundredth of the global aim, which the growth of errors along well-conditioned runs does not
/// use up.
const LOCAL: f64 = 0.01;

/// Bounds of the change of length from one element to the next, and what it stays below the best.
const GROWTH: [f64; 2] = [0.2, 4.0];
const SAFETY: f64 = 0.85;

/// Rounding of a rate, relative to the size of its terms.
pub(crate) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// How the length of elements follows from their defect δ, which is as its power: δ ∝ h^(s+1).
#[derive(Clone, Copy)]
pub(crate) struct Control {
    /// What the defect may be.
    pub target: f64,
    exponent: f64,
}

impl Control {
    /// Lengths for this global error.
    pub fn new(scheme: &Scheme, tolerance: f64) -> Self {
        let order = scheme.tableau.order as f64;
        let local = (LOCAL * tolerance).max(f64::EPSILON);
        let exponent = (scheme.s + 1) as f64;
        Control {
            target: local.powf(exponent / (order + 1.0)),
            exponent,
        }
    }

    /// The length after an element of the length h with this defect.
    pub fn next(self, h: f64, defect: f64) -> f64 {
        let ratio = self.target / defect.max(f64::MIN_POSITIVE);
        let best = SAFETY * ratio.powf(1.0 / self.exponent);
        h * best.clamp(GROWTH[0], GROWTH[1])
    }
}
