//! Arithmetic on the values of a tape under construction that knows zero, one and other numbers.

use super::{Elementary, TapeBuilder, Value};

/// A number, or a multiple of a value: factors are collected and multiplied once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Term {
    Number(f64),
    /// The factor is not zero.
    Multiple(f64, Value),
}

use Term::{Multiple, Number};

/// Factors come out of products as far as this: what they come out of neither overflows nor vanishes, where the whole does
/// not, as (x/5000)^100 = 5000^-100 x^100 would.
const WIDE: f64 = 1e32;

/// A product, of which nothing is left where a factor is zero, as that of a side that is not taken: whatever the other one is.
pub(super) fn product(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

/// Whether a factor is within that.
pub fn is_moderate(factor: f64) -> bool {
    (1.0 / WIDE..=WIDE).contains(&factor.abs())
}

impl Term {
    pub(crate) const ZERO: Self = Number(0.0);
    pub(crate) const ONE: Self = Number(1.0);

    pub(crate) fn value(value: Value) -> Self {
        Multiple(1.0, value)
    }

    pub(crate) fn is_zero(self) -> bool {
        self == Self::ZERO
    }

    /// `c * self`.
    pub(crate) fn times(self, c: f64) -> Self {
        match self {
            Number(number) => Number(product(c, number)),
            Multiple(..) if c == 0.0 => Self::ZERO,
            Multiple(factor, value) => Multiple(c * factor, value),
        }
    }

    pub(crate) fn neg(self) -> Self {
        self.times(-1.0)
    }

    /// The value of a term in the tape.
    pub(crate) fn place(self, b: &mut TapeBuilder) -> Value {
        match self {
            Number(number) => b.constant(number),
            Multiple(factor, value) => b.scale(factor, value),
        }
    }

    pub(crate) fn add(self, other: Self, b: &mut TapeBuilder) -> Self {
        match (self, other) {
            (Number(x), Number(y)) => Number(x + y),
            (Number(0.0), term) | (term, Number(0.0)) => term,
            (Number(x), term) | (term, Number(x)) => {
                let value = match term {
                    Multiple(-1.0, value) => b.subtract_from(x, value),
                    term => {
                        let value = term.place(b);
                        b.offset(x, value)
                    }
                };
                Self::value(value)
            }
            (Multiple(c, v), Multiple(d, w)) if v == w && c + d == 0.0 => Self::ZERO,
            (Multiple(c, v), Multiple(d, w)) if v == w => Multiple(c + d, v),
            (Multiple(c, v), Multiple(d, w)) if c == d => Multiple(c, b.add(v, w)),
            (Multiple(c, v), Multiple(d, w)) if c == -d => Multiple(c, b.sub(v, w)),
            (Multiple(c, v), Multiple(1.0, w)) => Self::value(b.add_scaled(w, c, v)),
            (Multiple(c, v), Multiple(d, w)) => {
                let v = b.scale(c, v);
                Self::value(b.add_scaled(v, d, w))
            }
        }
    }

    pub(crate) fn sub(self, other: Self, b: &mut TapeBuilder) -> Self {
        self.add(other.neg(), b)
    }

    pub(crate) fn mul(self, other: Self, b: &mut TapeBuilder) -> Self {
        match (self, other) {
            (Number(x), term) | (term, Number(x)) => term.times(x),
            (Multiple(c, v), Multiple(d, w)) if is_moderate(c * d) => Multiple(c * d, b.mul(v, w)),
            (factor, other) => {
                let (factor, other) = (factor.place(b), other.place(b));
                Self::value(b.mul(factor, other))
            }
        }
    }

    pub(crate) fn square(self, b: &mut TapeBuilder) -> Self {
        self.mul(self, b)
    }

    pub(crate) fn recip(self, b: &mut TapeBuilder) -> Self {
        match self {
            Number(x) => Number(1.0 / x),
            Multiple(c, v) if is_moderate(c) => Multiple(1.0 / c, b.recip(v)),
            term => {
                let term = term.place(b);
                Self::value(b.recip(term))
            }
        }
    }

    pub(crate) fn div(self, other: Self, b: &mut TapeBuilder) -> Self {
        match (self, other) {
            (term, Number(x)) => term.times(1.0 / x),
            (Number(x), term) => term.recip(b).times(x),
            (Multiple(c, v), Multiple(d, w)) if v == w => Number(c / d),
            (Multiple(c, v), Multiple(d, w)) if is_moderate(c / d) => Multiple(c / d, b.div(v, w)),
            (numerator, denominator) => {
                let (numerator, denominator) = (numerator.place(b), denominator.place(b));
                Self::value(b.div(numerator, denominator))
            }
        }
    }

    pub(crate) fn sqrt(self, b: &mut TapeBuilder) -> Self {
        self.apply(b, f64::sqrt, TapeBuilder::sqrt)
    }

    pub(crate) fn log(self, b: &mut TapeBuilder) -> Self {
        self.function(Elementary::Log, b)
    }

    /// An elementary function of it.
    pub(crate) fn function(self, f: Elementary, b: &mut TapeBuilder) -> Self {
        self.apply(b, f.value(), |b, value| b.apply(f, value))
    }

    /// A function of it with constants folded: of a number by `number` at once, of all else by `value`, which records it on
    /// the tape.
    pub(crate) fn apply(
        self,
        b: &mut TapeBuilder,
        number: impl Fn(f64) -> f64,
        value: impl Fn(&mut TapeBuilder, Value) -> Value,
    ) -> Self {
        match self {
            Number(x) => Number(number(x)),
            term => {
                let term = term.place(b);
                Self::value(value(b, term))
            }
        }
    }

    /// `self ^ power` for any number.
    pub(crate) fn power(self, power: f64, b: &mut TapeBuilder) -> Self {
        /// Above this a power is cheaper by the function than by squaring.
        const SQUARED: f64 = 64.0;
        if power == 0.0 {
            Self::ONE
        } else if power.fract() == 0.0 && power.abs() <= SQUARED {
            let exponent = power.abs() as u32;
            let term = self.apply(b, |x| x.powi(exponent as i32), |b, v| b.powi(v, exponent));
            if power < 0.0 { term.recip(b) } else { term }
        } else {
            self.apply(b, |x| x.powf(power), |b, v| b.power(v, power))
        }
    }

    pub(crate) fn pow(self, exponent: Self, b: &mut TapeBuilder) -> Self {
        match (self, exponent) {
            (base, Number(power)) => base.power(power, b),
            (base, exponent) => {
                let (base, exponent) = (base.place(b), exponent.place(b));
                Self::value(b.pow(base, exponent))
            }
        }
    }

    /// The angle of the point (x, self).
    pub(crate) fn atan2(self, x: Self, b: &mut TapeBuilder) -> Self {
        match (self, x) {
            (Number(y), Number(x)) => Number(y.atan2(x)),
            (y, x) => {
                let (y, x) = (y.place(b), x.place(b));
                Self::value(b.atan2(y, x))
            }
        }
    }
}
