//! Elements as long as a tolerance allows.
//!
//! Between its nodes the polynomial of an element misses x' = f by O(h^s). Its defect δ = h ‖x' - f‖, relative to the
//! sizes of the states, is (Ch)^(s+1); the local error at the end of the element, where the method has order p > s, is
//! taken to be (Ch)^(p+1) with the same C. So the end is off by the local tolerance ε where δ = ε^((s+1)/(p+1)).

use crate::fesd::element::scheme::Scheme;

/// A hundredth of the global aim, which the growth of errors along well-conditioned runs does not
/// use up.
const LOCAL: f64 = 0.01;

/// Bounds of the change of length from one element to the next, and what it stays below the best.
const GROWTH: [f64; 2] = [0.2, 4.0];
const SAFETY: f64 = 0.85;

/// Rounding of a rate, relative to the size of its terms.
pub(crate) const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// The control of the length h of elements by their defect δ = h ‖x' - f‖ ∝ h^(s+1).
#[derive(Clone, Copy)]
pub(crate) struct Control {
    /// The largest δ of an element that is kept.
    pub target: f64,
    /// s + 1.
    exponent: f64,
}

impl Control {
    /// The control for a global error: δ ≤ ε^((s+1)/(p+1)), where ε is a hundredth of it, and no less than rounding.
    pub fn new(scheme: &Scheme, tolerance: f64) -> Self {
        let p = scheme.tableau.order as f64;
        let local = (LOCAL * tolerance).max(f64::EPSILON);
        let exponent = (scheme.s + 1) as f64;
        Control {
            target: local.powf(exponent / (p + 1.0)),
            exponent,
        }
    }

    /// The length after one with this defect: h · `SAFETY` (target/δ)^(1/(s+1)), within `GROWTH` of h.
    pub fn next(self, h: f64, defect: f64) -> f64 {
        let ratio = self.target / defect.max(f64::MIN_POSITIVE);
        let best = SAFETY * ratio.powf(1.0 / self.exponent);
        h * best.clamp(GROWTH[0], GROWTH[1])
    }
}
