//! Numbers of about 32 digits: unevaluated sums of two floating-point numbers (Dekker 1971).

use std::iter::Sum;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::integrate::two_sum::two_sum;

/// `high` + `low`, where `high` is the sum rounded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Extended {
    high: f64,
    low: f64,
}

impl Extended {
    pub(crate) const ZERO: Self = Extended {
        high: 0.0,
        low: 0.0,
    };
    pub(crate) const ONE: Self = Extended {
        high: 1.0,
        low: 0.0,
    };

    /// The nearest floating-point number.
    pub(crate) fn rounded(self) -> f64 {
        self.high
    }
}

impl From<f64> for Extended {
    fn from(value: f64) -> Self {
        Extended {
            high: value,
            low: 0.0,
        }
    }
}

impl From<usize> for Extended {
    fn from(value: usize) -> Self {
        Extended::from(value as f64)
    }
}

/// a + b without error, where |a| ≥ |b| or a = 0.
fn ordered_sum(a: f64, b: f64) -> Extended {
    let high = a + b;
    Extended {
        high,
        low: b - (high - a),
    }
}

impl Add for Extended {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (high, taken) = two_sum(self.high, other.high);
        let (low, least) = two_sum(self.low, other.low);
        let sum = ordered_sum(high, taken + low);
        ordered_sum(sum.high, sum.low + least)
    }
}

impl Neg for Extended {
    type Output = Self;

    fn neg(self) -> Self {
        Extended {
            high: -self.high,
            low: -self.low,
        }
    }
}

impl Sub for Extended {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Extended {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let high = self.high * other.high;
        let error = self.high.mul_add(other.high, -high);
        ordered_sum(
            high,
            error + (self.high * other.low + self.low * other.high),
        )
    }
}

impl Div for Extended {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        // Long division; the three digits have 53 bits each.
        let first = Extended::from(self.high / other.high);
        let left = self - first * other;
        let second = Extended::from(left.high / other.high);
        let left = left - second * other;
        first + second + Extended::from(left.high / other.high)
    }
}

impl Sum for Extended {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        terms.fold(Extended::ZERO, Add::add)
    }
}
