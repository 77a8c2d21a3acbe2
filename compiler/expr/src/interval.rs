//! Interval arithmetic: enclosures of everything that an expression is, over a box of its variables.
//!
//! Ends are moved outwards by a few units in the last place, which covers the rounding of the operations and of the
//! functions of the standard library. Where a function is not defined on a part of its argument, that part is left out.

use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::{Add, Mul};

use super::{BinaryFunction, Function};

/// All numbers from `low` to `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The lower end, -∞ where there is none.
    pub low: f64,
    /// The upper end, ∞ where there is none.
    pub high: f64,
}

/// Units in the last place by which one operation may be wrong.
const ULPS: f64 = 4.0;

impl Interval {
    /// Every number.
    pub const ALL: Interval = Interval {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// Zero.
    pub const ZERO: Interval = Interval {
        low: 0.0,
        high: 0.0,
    };

    /// From one number to another; every number where that says nothing.
    pub fn new(low: f64, high: f64) -> Self {
        if low <= high {
            Interval { low, high }
        } else {
            Interval::ALL
        }
    }

    /// A number as it is written in decimals, of which `value` is the closest one: whole ones are exact.
    pub fn rounded(value: f64) -> Self {
        match value.fract() == 0.0 {
            true => Interval::new(value, value),
            false => Interval::outwards(value, value, 1.0),
        }
    }

    /// The ends moved outwards by some units in the last place.
    fn outwards(low: f64, high: f64, ulps: f64) -> Self {
        let by = |end: f64| match end.is_finite() {
            true => ulps * f64::EPSILON * end.abs() + f64::MIN_POSITIVE,
            false => 0.0,
        };
        Interval::new(low - by(low), high + by(high))
    }

    /// The largest magnitude.
    pub fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Whether a number is inside.
    pub fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The width.
    pub fn width(self) -> f64 {
        self.high - self.low
    }

    /// What both hold; none where they are apart.
    fn within(self, other: Interval) -> Option<Interval> {
        let (low, high) = (self.low.max(other.low), self.high.min(other.high));
        (low <= high).then_some(Interval { low, high })
    }

    /// A function that rises where it is defined; every number where that is nowhere.
    pub(crate) fn rising(self, domain: Interval, f: impl Fn(f64) -> f64) -> Self {
        match self.within(domain) {
            Some(inside) => Interval::outwards(f(inside.low), f(inside.high), ULPS),
            None => Interval::ALL,
        }
    }

    pub(crate) fn neg(self) -> Self {
        Interval::new(-self.high, -self.low)
    }

    fn recip(self) -> Self {
        match self {
            Interval { low, high } if low > 0.0 || high < 0.0 => {
                Interval::outwards(high.recip(), low.recip(), ULPS)
            }
            Interval { low: 0.0, high } if high > 0.0 => {
                Interval::outwards(high.recip(), f64::INFINITY, ULPS)
            }
            Interval { low, high: 0.0 } if low < 0.0 => {
                Interval::outwards(f64::NEG_INFINITY, low.recip(), ULPS)
            }
            _ => Interval::ALL,
        }
    }

    /// A whole power.
    pub fn powi(self, power: i32) -> Self {
        if power < 0 {
            return self.powi(power.saturating_neg()).recip();
        }
        let ulps = ULPS * f64::from(power);
        let [at_low, at_high] = [self.low, self.high].map(|end| end.powi(power));
        if power % 2 == 1 {
            Interval::outwards(at_low, at_high, ulps)
        } else if self.contains(0.0) {
            Interval::new(0.0, Interval::outwards(0.0, at_low.max(at_high), ulps).high)
        } else {
            let positive = Interval::outwards(at_low.min(at_high), at_low.max(at_high), ulps);
            Interval::new(positive.low.max(0.0), positive.high)
        }
    }

    /// sin, whose largest values are at π/2 + 2πk.
    pub(crate) fn sin(self) -> Self {
        let full = Interval::new(-1.0, 1.0);
        // Far out the distance to the next extremum is not known well.
        if self.width() >= 2.0 * PI || self.magnitude() > 1e8 {
            return full;
        }
        let slack = 1e-14 * (1.0 + self.magnitude());
        let holds = |place: f64| {
            let turns = ((self.low - slack - place) / (2.0 * PI)).ceil();
            place + 2.0 * PI * turns <= self.high + slack
        };
        let ends = [self.low.sin(), self.high.sin()];
        let inner = Interval::outwards(ends[0].min(ends[1]), ends[0].max(ends[1]), ULPS);
        let low = if holds(-FRAC_PI_2) { -1.0 } else { inner.low };
        let high = if holds(FRAC_PI_2) { 1.0 } else { inner.high };
        Interval::new(low.max(-1.0), high.min(1.0))
    }

    /// cos a = sin(a + π/2)
    pub(crate) fn cos(self) -> Self {
        (self + Interval::outwards(FRAC_PI_2, FRAC_PI_2, 1.0)).sin()
    }

    pub(crate) fn abs(self) -> Self {
        let (least, most) = (self.low.abs().min(self.high.abs()), self.magnitude());
        Interval::new(if self.contains(0.0) { 0.0 } else { least }, most)
    }

    /// The same without what rounding leaves below a number that no value is below.
    pub(crate) fn above(self, least: f64) -> Self {
        Interval::new(self.low.max(least), self.high)
    }

    /// An enclosure of a function.
    pub fn unary(self, function: Function) -> Self {
        (function.definition().image)(self)
    }

    /// An enclosure of a function of two arguments.
    pub fn binary(self, function: BinaryFunction, other: Interval) -> Self {
        match function {
            BinaryFunction::Min => {
                Interval::new(self.low.min(other.low), self.high.min(other.high))
            }
            BinaryFunction::Max => {
                Interval::new(self.low.max(other.low), self.high.max(other.high))
            }
            // x^y = exp(y log x) for x > 0, and 0 at 0.
            BinaryFunction::Pow if self.low >= 0.0 && other.low > 0.0 => {
                let log = self.unary(Function::Log);
                // Rounding of the exponent is multiplied by its size.
                let exponent = log * other;
                let power = exponent.unary(Function::Exp);
                let ulps = ULPS * (1.0 + finite(exponent.magnitude()));
                let power = Interval::outwards(power.low, power.high, ulps);
                Interval::new(power.low.max(0.0), power.high)
            }
            BinaryFunction::Pow => Interval::ALL,
            BinaryFunction::Atan2 => Interval::outwards(-PI, PI, ULPS),
        }
    }
}

fn finite(x: f64) -> f64 {
    if x.is_finite() { x } else { 0.0 }
}

impl Add for Interval {
    type Output = Interval;

    fn add(self, other: Interval) -> Interval {
        // An infinite end stays one: the other summand is a number.
        let low = self.low + other.low;
        let high = self.high + other.high;
        let slack = ULPS * f64::EPSILON * (finite(self.magnitude()) + finite(other.magnitude()));
        Interval::new(low - slack, high + slack)
    }
}

impl Mul for Interval {
    type Output = Interval;

    fn mul(self, other: Interval) -> Interval {
        if self == Interval::ZERO || other == Interval::ZERO {
            return Interval::ZERO;
        }
        // 0 times an end at infinity is 0: every value inside is a number.
        let times = |a: f64, b: f64| if a == 0.0 || b == 0.0 { 0.0 } else { a * b };
        let products = [
            times(self.low, other.low),
            times(self.low, other.high),
            times(self.high, other.low),
            times(self.high, other.high),
        ];
        let low = products.iter().copied().fold(f64::INFINITY, f64::min);
        let high = products.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Interval::outwards(low, high, ULPS)
    }
}

#[cfg(test)]
mod tests {
    use super::Interval;
    use crate::{BinaryFunction, Function};

    /// Numbers of [0, 1) without a pattern.
    fn noise(k: usize) -> f64 {
        ((k as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0)
    }

    #[test]
    fn values_lie_in_their_enclosures() {
        for k in 0..20_000 {
            let middle = 12.0 * (noise(k) - 0.5);
            let radius = [1e-9, 0.1, 1.0, 5.0][k % 4] * noise(k + 1_000_000);
            let interval = Interval::new(middle - radius, middle + radius);
            let other = Interval::new(middle - 1.0, middle + radius);
            let x = interval.low + noise(k + 2_000_000) * interval.width();
            let y = other.low + noise(k + 3_000_000) * other.width();
            let holds = |found: Interval, value: f64, what: &dyn std::fmt::Debug| {
                let is_inside = value.is_nan() || found.contains(value);
                assert!(
                    is_inside,
                    "{what:?}: {value} of {interval:?} {other:?} not in {found:?}"
                );
            };
            for &function in Function::ALL {
                holds(interval.unary(function), function.value(x), &function);
            }
            for power in -4..=5 {
                holds(interval.powi(power), x.powi(power), &power);
            }
            for function in [
                BinaryFunction::Pow,
                BinaryFunction::Atan2,
                BinaryFunction::Min,
                BinaryFunction::Max,
            ] {
                let found = interval.binary(function, other);
                holds(found, function.value(x, y), &function);
            }
            holds(interval + other, x + y, &"+");
            holds(interval * other, x * y, &"*");
        }
    }

    #[test]
    fn enclosures_are_narrow_where_arguments_are() {
        for k in 0..1000 {
            let x = 0.05 + 0.9 * noise(k);
            let interval = Interval::new(x, x);
            let is_number = |function: &&Function| !function.value(x).is_nan();
            for &function in Function::ALL.iter().filter(is_number) {
                let found = interval.unary(function);
                assert!(found.width() < 1e-13, "{function:?} of {x}: {found:?}");
            }
        }
    }
}
