//! Sliding modes of a nonlinear switch: all α in [0, 1] at which φ(α) = ∇ψ·f(α) + ∂ψ/∂t vanishes.
//!
//! They are the fixed points of the dummy system dα/dτ = φ(α), and attract where S = ∂φ/∂α < 0
//! (Jeffrey 2014, definitions 1 and 2). The interval is halved until each part is proven to hold none,
//! as an enclosure of φ or its mean value form φ(m) + S([a, b]) (α - m) excludes zero, or one at most, as an
//! enclosure of S does.

use super::selection::SlidingMode;
use crate::expansion::mode::Mode;
use crate::tape::Ball;

/// Parts of [0, 1] looked at before a search gives up.
const MAX_PARTS: usize = 20_000;

/// Parts of this width hold a double zero, as far as can be told.
const NARROW: f64 = 1e-8;

/// Zeros that are closer are one.
const SAME: f64 = 4.0 * NARROW;

/// Roundings of its terms that φ may be wrong by.
const ROUNDINGS: f64 = 16.0;

/// A part of the interval was left open: φ or S has no bound there, or vanishes all along it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unbounded;

/// φ and S of one switch as functions of its α, where a mode has the switch in focus.
pub(crate) struct ScalarRate<'a> {
    mode: &'a mut Mode,
    switch: usize,
    /// α of all switches.
    alphas: &'a mut [f64],
}

impl<'a> ScalarRate<'a> {
    /// Those of a switch in focus, where the others have these α.
    pub(crate) fn of(mode: &'a mut Mode, switch: usize, alphas: &'a mut [f64]) -> Self {
        ScalarRate {
            mode,
            switch,
            alphas,
        }
    }

    /// φ and S, and the rounding of φ.
    pub(crate) fn at(&mut self, alpha: f64) -> [f64; 3] {
        let (mode, switch) = (&mut *self.mode, self.switch);
        self.alphas[switch] = alpha;
        mode.vary(self.alphas);
        mode.linearize(&[switch]);
        let rounding = ROUNDINGS * f64::EPSILON * mode.terms_of_phi(switch);
        [mode.phi(switch), mode.coupling(switch, switch), rounding]
    }

    /// Enclosures of φ and S while α is within `radius` of `middle`.
    fn enclose(&mut self, middle: f64, radius: f64) -> [Ball; 2] {
        let (mode, switch) = (&mut *self.mode, self.switch);
        let slot = 1 + mode.n + switch;
        let inside = Ball::new(middle, radius);
        let (mut phi, mut slope) = (
            Ball::new(mode.surfaces.time_gradient(switch), 0.0),
            Ball::new(0.0, 0.0),
        );
        for at in 0..mode.surfaces.gradient(switch).len() {
            let (state, g) = mode.surfaces.gradient(switch)[at];
            let [f, by_alpha] =
                mode.field
                    .enclose(state, switch, &mode.memory.values, slot, inside);
            let g = Ball::new(g, 0.0);
            (phi, slope) = (phi + g * f, slope + g * by_alpha);
        }
        [phi, slope]
    }

    /// All sliding modes where the switch is on its surface, in order.
    pub(crate) fn sliding_modes(&mut self) -> Result<Vec<SlidingMode>, Unbounded> {
        let mut found: Vec<SlidingMode> = Vec::new();
        let mut parts = vec![(0.5, 0.5)];
        for _ in 0..MAX_PARTS {
            let Some((middle, radius)) = parts.pop() else {
                found.sort_by(|a, b| a.alpha.total_cmp(&b.alpha));
                found.dedup_by(|b, a| (a.alpha - b.alpha).abs() <= SAME);
                return Ok(found);
            };
            let [value, _, rounding] = self.at(middle);
            if value.is_nan() {
                return Err(Unbounded);
            }
            let [phi, slope] = self.enclose(middle, radius);
            let steepest = slope.middle.abs() + slope.radius;
            let nearest = (phi.middle.abs() - phi.radius).max(value.abs() - steepest * radius);
            if nearest > rounding {
                continue;
            }
            let (low, high) = (middle - radius, middle + radius);
            if slope.excludes_zero() {
                let ends = [low, high].map(|end| self.at(end));
                let has_none = ends[0][0] * ends[1][0] > 0.0
                    && ends
                        .iter()
                        .all(|[value, _, rounding]| value.abs() > *rounding);
                if !has_none {
                    found.push(self.zero_between(low, high));
                }
            } else if radius <= NARROW {
                let [_, stability, _] = self.at(middle);
                found.push(SlidingMode {
                    alpha: middle,
                    stability,
                });
            } else {
                let half = 0.5 * radius;
                parts.extend([(middle - half, half), (middle + half, half)]);
            }
        }
        Err(Unbounded)
    }

    /// The zero of φ in an interval in which it is monotonic, or the end that is closest to it: Newton's method,
    /// with bisection where that would leave the interval.
    fn zero_between(&mut self, mut low: f64, mut high: f64) -> SlidingMode {
        let [at_low, ..] = self.at(low);
        let [at_high, ..] = self.at(high);
        let rises = at_high > at_low;
        let mut alpha = 0.5 * (low + high);
        let mut stability = 0.0;
        for _ in 0..100 {
            let [value, slope, _] = self.at(alpha);
            stability = slope;
            if (value > 0.0) == rises {
                high = alpha;
            } else {
                low = alpha;
            }
            let newton = alpha - value / slope;
            let next = match low <= newton && newton <= high {
                true => newton,
                false => 0.5 * (low + high),
            };
            let change = (next - alpha).abs();
            alpha = next;
            if change <= f64::EPSILON || value == 0.0 {
                break;
            }
        }
        SlidingMode { alpha, stability }
    }
}
