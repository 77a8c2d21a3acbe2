//! Running errors: a value, and how far rounding may have taken it from what exact arithmetic gives.
//!
//! Each operation passes on the errors of its operands and adds one rounding of its own result (Higham 2002,
//! section 3.3). Terms that cancel within an expression leave their roundings behind, which no change of its inputs
//! shows.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::{Ball, Lane};

/// A value with its running error as radius.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounded(pub Ball);

impl From<Ball> for Rounded {
    fn from(ball: Ball) -> Self {
        Rounded(ball)
    }
}

/// A result with one more rounding.
fn rounded(ball: Ball) -> Rounded {
    let radius = ball.radius + f64::EPSILON * ball.middle.abs();
    Rounded(Ball::new(ball.middle, radius))
}

impl Neg for Rounded {
    type Output = Rounded;

    fn neg(self) -> Rounded {
        Rounded(-self.0)
    }
}

impl Add for Rounded {
    type Output = Rounded;

    fn add(self, other: Rounded) -> Rounded {
        rounded(self.0 + other.0)
    }
}

impl Sub for Rounded {
    type Output = Rounded;

    fn sub(self, other: Rounded) -> Rounded {
        rounded(self.0 - other.0)
    }
}

impl Mul for Rounded {
    type Output = Rounded;

    fn mul(self, other: Rounded) -> Rounded {
        rounded(self.0 * other.0)
    }
}

impl Div for Rounded {
    type Output = Rounded;

    fn div(self, other: Rounded) -> Rounded {
        rounded(self.0 / other.0)
    }
}

impl Lane for Rounded {
    const WIDTH: usize = 1;

    /// A constant has been rounded, too.
    fn splat(value: f64) -> Self {
        rounded(Ball::splat(value))
    }

    fn load(from: &[f64]) -> Self {
        Rounded(Ball::splat(from[0]))
    }

    fn store(self, to: &mut [f64]) {
        self.0.store(to);
    }

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        rounded(self.0.map(f))
    }

    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        rounded(self.0.zip(other.0, f))
    }

    fn sqrt(self) -> Self {
        rounded(self.0.sqrt())
    }

    fn exp(self) -> Self {
        rounded(self.0.exp())
    }

    fn log(self) -> Self {
        rounded(self.0.log())
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.0.sin_cos();
        (rounded(sine), rounded(cosine))
    }

    fn sinh_cosh(self) -> (Self, Self) {
        let (sine, cosine) = self.0.sinh_cosh();
        (rounded(sine), rounded(cosine))
    }

    fn tan(self) -> Self {
        rounded(self.0.tan())
    }

    fn tanh(self) -> Self {
        rounded(self.0.tanh())
    }

    fn asin(self) -> Self {
        rounded(self.0.asin())
    }

    fn acos(self) -> Self {
        rounded(self.0.acos())
    }

    fn atan(self) -> Self {
        rounded(self.0.atan())
    }

    fn atan2(self, x: Self) -> Self {
        rounded(self.0.atan2(x.0))
    }

    fn pow(self, power: Self) -> Self {
        // A constant power is the number that stands there.
        let power = match power.0.radius <= f64::EPSILON * power.0.middle.abs() {
            true => Ball::splat(power.0.middle),
            false => power.0,
        };
        rounded(self.0.pow(power))
    }
}
