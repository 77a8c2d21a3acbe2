//! Running errors: a value, and how far rounding may have taken it from what exact arithmetic gives.
//!
//! Each operation passes on the errors of its operands and adds one rounding of its own result (Higham 2002,
//! section 3.3). Terms that cancel within an expression leave their roundings behind, which no change of its inputs
//! shows.
//!
//! That bound adds up errors that undo each other: of a + sin(a) again and again it doubles, also where the function
//! has no slope. So the same operations are made a few times more with other roundings, and an error is not believed to
//! be far above what these do.

use std::array::from_fn;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::runtime::random::mix;
use crate::tape::{Ball, Elementary, Lane};

/// Evaluations with other roundings.
const DISTURBED: usize = 4;

/// An error is at most so many times what the largest of these shows.
const SHOWN: f64 = 16.0;

/// A value with its running error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounded {
    /// The bound is the radius.
    bound: Ball,
    disturbed: [f64; DISTURBED],
}

impl Rounded {
    /// The value with its running error as radius.
    pub(crate) fn ball(self) -> Ball {
        let Ball { middle, radius } = self.bound;
        let moved = self.disturbed.map(|other| (other - middle).abs());
        let shown = moved.into_iter().fold(0.0_f64, |most, moved| {
            if moved > most || moved.is_nan() {
                moved
            } else {
                most
            }
        });
        // A disturbance out of the domain of a function shows nothing.
        Ball::new(
            middle,
            if SHOWN * shown < radius {
                SHOWN * shown
            } else {
                radius
            },
        )
    }

    /// A result with one more rounding of each, told apart by what it is the result of.
    fn of(bound: Ball, disturbed: [f64; DISTURBED], from: [f64; 2]) -> Self {
        let seed = from[0].to_bits() ^ from[1].to_bits().rotate_left(23);
        Rounded {
            bound: Ball::new(
                bound.middle,
                bound.radius + f64::EPSILON * bound.middle.abs(),
            ),
            disturbed: from_fn(|k| disturbed[k] + f64::EPSILON * disturbed[k] * share(seed, k)),
        }
    }

    fn unary(self, bound: Ball, f: impl Fn(f64) -> f64) -> Self {
        let from = [self.bound.middle, bound.middle];
        Rounded::of(bound, self.disturbed.map(f), from)
    }

    fn binary(self, other: Self, bound: Ball, f: impl Fn(f64, f64) -> f64) -> Self {
        let from = [self.bound.middle, other.bound.middle];
        let disturbed = from_fn(|k| f(self.disturbed[k], other.disturbed[k]));
        Rounded::of(bound, disturbed, from)
    }
}

/// Between a half and all of a rounding, up or down: the same for the same seed, else as if at random.
fn share(seed: u64, k: usize) -> f64 {
    let unit = (mix(seed.wrapping_add(k as u64)) >> 11) as f64 / (1_u64 << 53) as f64;
    if unit < 0.5 { unit - 1.0 } else { unit }
}

impl From<Ball> for Rounded {
    fn from(ball: Ball) -> Self {
        let seed = ball.middle.to_bits();
        Rounded {
            bound: ball,
            disturbed: from_fn(|k| ball.middle + ball.radius * share(seed, k)),
        }
    }
}

impl Neg for Rounded {
    type Output = Rounded;

    fn neg(self) -> Rounded {
        Rounded {
            bound: -self.bound,
            disturbed: self.disturbed.map(Neg::neg),
        }
    }
}

impl Add for Rounded {
    type Output = Rounded;

    fn add(self, other: Rounded) -> Rounded {
        self.binary(other, self.bound + other.bound, Add::add)
    }
}

impl Sub for Rounded {
    type Output = Rounded;

    fn sub(self, other: Rounded) -> Rounded {
        self.binary(other, self.bound - other.bound, Sub::sub)
    }
}

impl Mul for Rounded {
    type Output = Rounded;

    fn mul(self, other: Rounded) -> Rounded {
        self.binary(other, self.bound * other.bound, Mul::mul)
    }
}

impl Div for Rounded {
    type Output = Rounded;

    fn div(self, other: Rounded) -> Rounded {
        self.binary(other, self.bound / other.bound, Div::div)
    }
}

impl Lane for Rounded {
    const WIDTH: usize = 1;

    /// A constant has been rounded, too.
    fn splat(value: f64) -> Self {
        Rounded::of(Ball::splat(value), [value; DISTURBED], [value, 1.0])
    }

    fn load(from: &[f64]) -> Self {
        Rounded::from(Ball::splat(from[0]))
    }

    fn store(self, to: &mut [f64]) {
        self.bound.store(to);
    }

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        self.unary(self.bound.map(&f), f)
    }

    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        self.binary(other, self.bound.zip(other.bound, &f), f)
    }

    fn sqrt(self) -> Self {
        self.unary(self.bound.sqrt(), f64::sqrt)
    }

    fn apply(self, f: Elementary) -> Self {
        self.unary(self.bound.apply(f), f.value())
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.bound.sin_cos();
        (self.unary(sine, f64::sin), self.unary(cosine, f64::cos))
    }

    fn sinh_cosh(self) -> (Self, Self) {
        let (sine, cosine) = self.bound.sinh_cosh();
        (self.unary(sine, f64::sinh), self.unary(cosine, f64::cosh))
    }

    fn atan2(self, x: Self) -> Self {
        self.binary(x, self.bound.atan2(x.bound), f64::atan2)
    }

    fn pow(self, power: Self) -> Self {
        // A constant power is the number that stands there.
        let Ball { middle, radius } = power.bound;
        match radius <= f64::EPSILON * middle.abs() {
            true => self.unary(self.bound.pow(Ball::splat(middle)), |x| x.powf(middle)),
            false => self.binary(power, self.bound.pow(power.bound), f64::powf),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The running error of a function at a number.
    fn error(x: f64, f: impl Fn(Rounded) -> Rounded) -> f64 {
        f(Rounded::load(&[x])).ball().radius
    }

    #[test]
    fn what_cancels_is_within_its_error() {
        for k in 0..1000 {
            let x = 0.1 + 0.017 * f64::from(k);
            let number = |c: f64| Rounded::splat(c);
            let circle = |x: Rounded| {
                let (sine, cosine) = x.sin_cos();
                sine * sine + cosine * cosine - number(1.0)
            };
            let value = x.sin() * x.sin() + x.cos() * x.cos() - 1.0;
            let known = error(x, circle);
            assert!(
                value.abs() <= known && known <= 1e-14,
                "{x}: {value:e} {known:e}"
            );
            // Every evaluation has the same -x.
            let absorbed = |x: Rounded| (x + number(1e18)) - number(1e18) - x;
            let known = error(x, absorbed);
            assert!(x <= known && known <= 1e4, "{x}: {known:e}");
        }
    }

    #[test]
    fn errors_that_undo_each_other_do_not_add_up() {
        // a + sin(a) goes to π, whatever a is.
        let chain = |x: Rounded| (0..60).fold(x, |a, _| a + a.sin_cos().0);
        assert!(error(0.5, chain) <= 1e-13);
        // From 0 it grows by 2⁶⁰, and so does an error.
        let known = error(1e-25, chain) / 1e-25;
        let exact = 2_f64.powi(60) * f64::EPSILON;
        assert!(known >= exact / 64.0, "{known:e}");
    }
}
