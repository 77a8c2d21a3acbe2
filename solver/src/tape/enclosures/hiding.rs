//! Operations that may hide from a Taylor series what they do within a step.
//!
//! Far from its middle a pulse e^u vanishes with all its derivatives, and 1/(1 + v²) is as small as rounding: the series
//! at the start of a step know nothing of it. Whether u rises, or v falls towards zero, within the step is seen from
//! their own series; polynomials and sines hide nothing, but their high powers do.

use std::ops::Range;

use super::tame::{FEW, SATURATED, VANISHED};
use crate::tape::elementary::Rate;
use crate::tape::taylor::steps::{Kind, Step};
use crate::tape::{Slot, Tape, UNUSED};

/// What an exponent may rise by within a step: beyond, the series of e^u shows at its start in spite of its size.
const RISE: f64 = 25.0;

/// The logarithm of what a power may grow by as its base falls towards zero; its series shows 2^p of that.
const GROWTH: f64 = 4.6;

/// The least and the largest value of Σ c_k τᵏ in [0, h], or beyond.
fn range(c: &[f64], h: f64) -> [f64; 2] {
    let mut range = [0.0, 0.0];
    for &c in c.iter().rev() {
        let [low, high]: [f64; 2] = range;
        range = [c + h * low.min(0.0), c + h * high.max(0.0)];
    }
    range
}

/// The least and the largest |Σ c_k τᵏ| in [0, h], or beyond.
fn distances(c: &[f64], h: f64) -> [f64; 2] {
    let [low, high] = range(c, h);
    let least = low.max(-high).max(0.0);
    [least, low.abs().max(high.abs())]
}

impl Kind {
    /// Whether it may hide something of what it reads, a divisor in a division, where its terms have so many factors.
    fn can_hide(self, factors: f64) -> bool {
        match self {
            Kind::Mul | Kind::Square => factors > f64::from(FEW),
            Kind::Div | Kind::Recip | Kind::Sqrt | Kind::Power | Kind::Pow => true,
            Kind::SinhCosh | Kind::Atan2 => true,
            Kind::Apply(f) => f.rate() != Rate::Riccati(1.0),
            _ => false,
        }
    }
}

impl Tape {
    /// Whether an operation may hide something that depends on some of the inputs.
    pub fn can_hide(&self, of: Range<usize>) -> bool {
        let mut depends = vec![false; self.n_values];
        depends[of].fill(true);
        let mut factors = vec![1.0; self.n_values];
        self.values.iter().any(|instruction| {
            let ([a, b], _) = instruction.op.parts();
            let moves = |value: Slot| value != UNUSED && depends[value as usize];
            let of = |value: Slot| match value {
                UNUSED => 0.0,
                _ => factors[value as usize],
            };
            let (kind, reads) = (Kind::of(instruction.op), [moves(a), moves(b)]);
            let count = kind.factors([of(a), of(b)]);
            let depends_on = reads.contains(&true);
            let is_read = match kind {
                Kind::Div => reads[1],
                _ => depends_on,
            };
            for result in [instruction.out, instruction.second] {
                if result != UNUSED {
                    depends[result as usize] = depends_on;
                    factors[result as usize] = count;
                }
            }
            kind.can_hide(count) && is_read
        })
    }
}

impl Step {
    /// Whether any function of its kind may hide something.
    pub(crate) fn can_hide(&self) -> bool {
        match self.kind {
            Kind::Div => self.short > 0,
            kind => kind.can_hide(self.c),
        }
    }

    /// Whether it may hide something within a step h, from the first `n` coefficients of what it reads.
    pub(crate) fn may_hide(&self, data: &[f64], h: f64, n: usize, stride: usize) -> bool {
        let row = |start: usize| &data[start..start + n];
        let rises = |start: usize, by: f64| {
            let [_, high] = range(row(start), h);
            let is_low = high <= VANISHED || high - data[start] <= by;
            !is_low
        };
        // |v|^-power grows as |v| falls.
        let nears = |start: usize, power: f64| {
            let [least, _] = distances(row(start), h);
            let is_far = power * (data[start].abs() / least).ln() <= GROWTH;
            !is_far && data[start] != 0.0
        };
        let growth = |start: usize| {
            let [_, most] = distances(row(start), h);
            (most / data[start].abs()).ln()
        };
        match self.kind {
            Kind::Mul | Kind::Square => {
                let other = match self.kind {
                    Kind::Mul => self.b,
                    _ => self.a,
                };
                let is_slow = growth(self.a) + growth(other) <= RISE;
                !is_slow
            }
            Kind::Div => nears(self.b, 1.0),
            Kind::Recip | Kind::Sqrt => nears(self.a, 1.0),
            Kind::Power if self.c > 0.0 => {
                let is_slow = self.c * growth(self.a) <= RISE;
                nears(self.a, 1.0) || !is_slow
            }
            Kind::Power => nears(self.a, self.c.abs().max(1.0)),
            Kind::Pow => nears(self.a, 1.0) || rises(self.out + 2 * stride, RISE),
            Kind::SinhCosh => {
                let [_, most] = distances(row(self.a), h);
                let is_slow = most - data[self.a].abs() <= RISE;
                !is_slow
            }
            Kind::Apply(f) => match f.rate() {
                Rate::Exponential => rises(self.a, RISE),
                Rate::Logarithm => nears(self.a, 1.0),
                // 1 - tanh u falls off as exp(-2 |u|).
                Rate::Riccati(-1.0) => {
                    let [least, _] = distances(row(self.a), h);
                    let is_slow = least >= SATURATED || 2.0 * (data[self.a].abs() - least) <= RISE;
                    !is_slow
                }
                Rate::Riccati(_) => false,
                // 1 - erf u falls off as exp(-u²).
                Rate::Gauss => {
                    let [least, _] = distances(row(self.a), h);
                    let (square, now) = (least * least, data[self.a] * data[self.a]);
                    let is_slow = square >= 2.0 * SATURATED || now - square <= RISE;
                    !is_slow
                }
                rate => {
                    let range = distances(row(self.a), h);
                    let [now, worst] = rate.divisor(data[self.a], range);
                    let is_slow = (now / worst).ln() <= GROWTH;
                    !is_slow
                }
            },
            // [a² + b²]
            Kind::Atan2 => nears(self.out + stride, 1.0),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_all_values() {
        // 1 - 2τ + τ² falls to 0 at 1.
        let [low, high] = range(&[1.0, -2.0, 1.0], 1.5);
        assert!(low <= 0.0 && high >= 1.0, "{low} {high}");
        assert_eq!(range(&[1.0, 2.0], 1.5), [1.0, 4.0]);
        assert_eq!(distances(&[-1.0, -2.0], 1.5), [1.0, 4.0]);
        assert_eq!(distances(&[-1.0, 2.0], 1.5)[0], 0.0);
    }
}
