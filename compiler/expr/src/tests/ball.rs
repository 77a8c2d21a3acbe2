//! Arithmetic that carries a bound on its own rounding errors.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::Function;

const EPSILON: f64 = f64::EPSILON;

/// A number and a bound on its error.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    pub value: f64,
    pub error: f64,
}

impl Ball {
    fn rounded(value: f64, error: f64) -> Self {
        let error = error + 2.0 * EPSILON * value.abs() + f64::MIN_POSITIVE;
        Self {
            value,
            error: if error.is_nan() || value.is_nan() {
                f64::INFINITY
            } else {
                error
            },
        }
    }

    /// A smooth function, of which the ends of the interval tell the variation.
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let value = f(self.value);
        let ends = [
            f(self.value + self.error) - value,
            f(self.value - self.error) - value,
        ];
        Self::rounded(
            value,
            ends[0].abs() + ends[1].abs() + 2.0 * EPSILON * value.abs(),
        )
    }

    /// Whether a number may be this one; rounding in another order may cost some more.
    pub fn allows(self, value: f64) -> bool {
        let sharp = self.value.is_finite() && self.error <= 1e-6 * (1.0 + self.value.abs());
        !sharp || (value - self.value).abs() <= 100.0 * self.error
    }
}

impl Add for Ball {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self::rounded(self.value + b.value, self.error + b.error)
    }
}

impl Mul for Ball {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        let error = self.value.abs() * b.error + b.value.abs() * self.error + self.error * b.error;
        Self::rounded(self.value * b.value, error)
    }
}

impl Ball {
    fn recip(self) -> Self {
        let distance = self.value.abs() - self.error;
        let error = if distance > 0.0 {
            self.error / self.value.abs() / distance
        } else {
            f64::NAN
        };
        Self::rounded(1.0 / self.value, error)
    }
}

/// A value and its derivative by one input.
#[derive(Clone, Copy, Debug)]
pub struct Dual {
    pub value: Ball,
    pub slope: Ball,
}

impl Dual {
    pub fn constant(value: f64) -> Self {
        let slope = Ball {
            value: 0.0,
            error: 0.0,
        };
        Self {
            value: Ball { value, error: 0.0 },
            slope,
        }
    }

    pub fn function(self, function: Function) -> Self {
        let x = self.value;
        let value = x.map(|x| function.value(x));
        let number = |value| Ball { value, error: 0.0 };
        let minus = |a: Ball| number(-1.0) * a;
        let factor = match function {
            Function::Sqrt => x.map(|x| 0.5 / x.sqrt()),
            Function::Exp => value,
            Function::Log => x.recip(),
            Function::Sin => x.map(f64::cos),
            Function::Cos => minus(x.map(f64::sin)),
            Function::Tan => number(1.0) + value * value,
            Function::Asin => (number(1.0) + minus(x * x)).map(|q| q.sqrt().recip()),
            Function::Acos => (number(1.0) + minus(x * x)).map(|q| -q.sqrt().recip()),
            Function::Atan => (number(1.0) + x * x).recip(),
            Function::Asinh => (number(1.0) + x * x).map(|q| q.sqrt().recip()),
            Function::Acosh => (x * x + number(-1.0)).map(|q| q.sqrt().recip()),
            Function::Atanh => (number(1.0) + minus(x * x)).recip(),
            Function::Sinh => x.map(f64::cosh),
            Function::Cosh => x.map(f64::sinh),
            Function::Tanh => number(1.0) + minus(value * value),
            Function::Erf => x.map(|x| std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp()),
            Function::Floor
            | Function::Step
            | Function::Positive
            | Function::NonNegative
            | Function::Sign
            | Function::Abs => number(f64::NAN),
        };
        Self {
            value,
            slope: factor * self.slope,
        }
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, b: Self) -> Self {
        Self {
            value: self.value + b.value,
            slope: self.slope + b.slope,
        }
    }
}

impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        self * Self::constant(-1.0)
    }
}

impl Sub for Dual {
    type Output = Self;
    fn sub(self, b: Self) -> Self {
        self + -b
    }
}

impl Mul for Dual {
    type Output = Self;
    fn mul(self, b: Self) -> Self {
        Self {
            value: self.value * b.value,
            slope: self.value * b.slope + self.slope * b.value,
        }
    }
}

impl Div for Dual {
    type Output = Self;
    fn div(self, b: Self) -> Self {
        let inverse = b.value.recip();
        let slope = b.slope
            * inverse
            * inverse
            * Ball {
                value: -1.0,
                error: 0.0,
            };
        self * Self {
            value: inverse,
            slope,
        }
    }
}
