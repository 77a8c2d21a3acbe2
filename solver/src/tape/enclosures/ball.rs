//! Enclosures: what a function may be while its inputs stay within radii of their values.
//!
//! A ball m ± r holds every number within r of m. Each operation gives a ball that holds all its
//! results, but for rounding. Where a function has no simple bound the radius is infinite. A power of a
//! negative number is none: that of a ball around zero holds those of the others.

use std::f64::consts::PI;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::tape::{Elementary, Lane};

/// All numbers within `radius` of `middle`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ball {
    pub middle: f64,
    pub radius: f64,
}

impl Ball {
    pub(crate) fn new(middle: f64, radius: f64) -> Self {
        Ball { middle, radius }
    }

    /// True when every number in it has the sign of the middle.
    pub(crate) fn excludes_zero(self) -> bool {
        self.middle.abs() > self.radius
    }

    /// The image by a function that changes at most `slope` times as much as its argument, and by
    /// no more than `range`.
    fn image(self, middle: f64, slope: f64, range: f64) -> Self {
        Ball::new(middle, (slope * self.radius).min(range))
    }

    /// The least number in it.
    pub(crate) fn low(self) -> f64 {
        self.middle - self.radius
    }

    /// The largest number in it.
    pub(crate) fn high(self) -> f64 {
        self.middle + self.radius
    }

    /// How far a monotone function goes from its value at the middle.
    fn reach(self, f: impl Fn(f64) -> f64) -> f64 {
        let middle = f(self.middle);
        let (below, above) = (middle - f(self.low()), f(self.high()) - middle);
        below.abs().max(above.abs())
    }
}

impl Neg for Ball {
    type Output = Ball;

    fn neg(self) -> Ball {
        Ball::new(-self.middle, self.radius)
    }
}

impl Add for Ball {
    type Output = Ball;

    fn add(self, other: Ball) -> Ball {
        Ball::new(self.middle + other.middle, self.radius + other.radius)
    }
}

impl Sub for Ball {
    type Output = Ball;

    fn sub(self, other: Ball) -> Ball {
        Ball::new(self.middle - other.middle, self.radius + other.radius)
    }
}

impl Mul for Ball {
    type Output = Ball;

    fn mul(self, other: Ball) -> Ball {
        let radius = self.middle.abs() * other.radius
            + other.middle.abs() * self.radius
            + self.radius * other.radius;
        Ball::new(self.middle * other.middle, radius)
    }
}

impl Div for Ball {
    type Output = Ball;

    /// a/b - a₀/b₀ = ((a - a₀) - a₀/b₀ (b - b₀)) / b
    fn div(self, other: Ball) -> Ball {
        let middle = self.middle / other.middle;
        let least = other.middle.abs() - other.radius;
        if least > 0.0 {
            Ball::new(middle, (self.radius + middle.abs() * other.radius) / least)
        } else {
            Ball::new(middle, f64::INFINITY)
        }
    }
}

impl Lane for Ball {
    const WIDTH: usize = 1;

    fn splat(value: f64) -> Self {
        Ball::new(value, 0.0)
    }

    fn load(from: &[f64]) -> Self {
        Ball::splat(from[0])
    }

    fn store(self, to: &mut [f64]) {
        to[0] = self.middle;
    }

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let radius = if self.radius == 0.0 {
            0.0
        } else {
            f64::INFINITY
        };
        Ball::new(f(self.middle), radius)
    }

    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let known = self.radius == 0.0 && other.radius == 0.0;
        let radius = if known { 0.0 } else { f64::INFINITY };
        Ball::new(f(self.middle, other.middle), radius)
    }

    fn sqrt(self) -> Self {
        let root = self.middle.sqrt();
        // √a - √(a - r) is the larger of the two differences.
        Ball::new(root, root - self.low().max(0.0).sqrt()).only_if(self.low() > 0.0)
    }

    fn apply(self, f: Elementary) -> Self {
        match f {
            Elementary::Exp => self.exp(),
            Elementary::Log => self.log(),
            Elementary::Tan => {
                // Poles lie between the branches.
                let branch = |u: f64| (u / PI + 0.5).floor();
                let is_one = branch(self.low()) == branch(self.high());
                self.monotone(f).only_if(is_one)
            }
            _ => self.monotone(f),
        }
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.middle.sin_cos();
        // |sin(a + δ) - sin a| ≤ |cos a| δ + δ²/2
        let curved = 0.5 * self.radius;
        (
            self.image(sine, (cosine.abs() + curved).min(1.0), 2.0),
            self.image(cosine, (sine.abs() + curved).min(1.0), 2.0),
        )
    }

    fn sinh_cosh(self) -> (Self, Self) {
        let sine = Ball::new(self.middle.sinh(), self.reach(f64::sinh));
        // cosh is least at zero.
        let middle = self.middle.cosh();
        let below = if self.low() * self.high() < 0.0 {
            middle - 1.0
        } else {
            0.0
        };
        (sine, Ball::new(middle, self.reach(f64::cosh).max(below)))
    }

    fn atan2(self, x: Self) -> Self {
        let middle = self.middle.atan2(x.middle);
        let angle = match x.low() > 0.0 {
            true => (self / x).apply(Elementary::Atan),
            false => (x / self).apply(Elementary::Atan),
        };
        let is_smooth = x.low() > 0.0 || self.excludes_zero();
        Ball::new(middle, angle.radius).only_if(is_smooth)
    }

    fn pow(self, power: Self) -> Self {
        let middle = self.middle.powf(power.middle);
        if self.radius == 0.0 && power.radius == 0.0 {
            return Ball::splat(middle);
        }
        // From zero on it rises.
        if self.low() <= 0.0 && self.middle >= 0.0 && power.radius == 0.0 && power.middle > 0.0 {
            let above = self.high().powf(power.middle) - middle;
            return Ball::new(middle, middle.max(above));
        }
        // aᵇ = exp(b log a)
        let exponent = power * self.log();
        let largest = exponent.high().exp();
        let radius = (middle * exponent.radius.exp_m1()).min(largest);
        Ball::new(middle, radius).only_if(self.low() > 0.0)
    }
}

impl Ball {
    /// Itself where something holds, or is one number; else nothing is known.
    fn only_if(self, holds: bool) -> Self {
        let known = holds || self.radius == 0.0;
        Ball::new(self.middle, if known { self.radius } else { f64::INFINITY })
    }

    /// The image by a function that is monotone where it is defined.
    fn monotone(self, f: Elementary) -> Self {
        let (rate, value) = (f.rate(), f.value());
        let [least, most] = rate.domain();
        let image = self.image(value(self.middle), rate.steepest(), self.reach(value));
        image.only_if(least <= self.low() && self.high() <= most)
    }

    fn exp(self) -> Self {
        let middle = self.middle.exp();
        let largest = self.high().exp();
        // Where the middle underflows, the upper end may not.
        let radius = if middle.is_normal() {
            (middle * self.radius.exp_m1()).min(largest)
        } else {
            largest
        };
        Ball::new(middle, radius)
    }

    fn log(self) -> Self {
        let ratio = self.radius / self.middle;
        Ball::new(self.middle.ln(), -(-ratio).ln_1p()).only_if(self.low() > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::tape::Tape;

    #[test]
    fn a_pulse_is_flat_far_from_its_middle() {
        let pulse = Ball::new(-1e6, 9e5).apply(Elementary::Exp);
        assert_eq!(pulse, Ball::new(0.0, 0.0));
        // e^(-800) is zero, e^(-100) is not.
        let flank = Ball::new(-800.0, 700.0).apply(Elementary::Exp);
        assert!(flank.high() >= (-100.0_f64).exp(), "{flank:?}");
        let edge = Ball::new(-1e3, 9e2).apply(Elementary::Tanh);
        assert_eq!(edge, Ball::new(-1.0, 0.0));
    }

    proptest! {
        /// What a tape gives anywhere within the radii lies in its enclosure.
        #[test]
        fn holds_all_results(x in -2.0..2.0_f64, y in 0.5..2.0_f64, r in 0.0..2.5_f64, s in -1.0..1.0_f64, u in -1.0..1.0_f64) {
            let mut tape = Tape::builder(2);
            let (a, b) = (tape.input(0), tape.input(1));
            let (sine, cosine) = tape.sin_cos(a);
            let product = tape.mul(sine, b);
            let quotient = tape.div(cosine, b);
            let root = tape.sqrt(b);
            let log = tape.log(b);
            let exp = tape.exp(a);
            let (tanh, atan) = (tape.tanh(a), tape.atan(product));
            let square = tape.square(a);
            let scaled = tape.add_scaled(square, -3.0, b);
            let recip = tape.recip(b);
            let (sinh, cosh) = tape.sinh_cosh(a);
            let (tan, asin) = (tape.tan(product), tape.asin(sine));
            let (acos, angle) = (tape.acos(cosine), tape.atan2(a, b));
            let (power, powers) = (tape.power(b, -1.5), tape.pow(b, a));
            let cubic = tape.power(b, 1.0 / 3.0);
            let beyond = tape.offset(1.0, square);
            let inverses = (tape.asinh(a), tape.acosh(beyond), tape.atanh(sine));
            let error = tape.erf(a);
            let outputs = [
                product, quotient, root, log, exp, tanh, atan, scaled, recip, sinh, cosh, tan, asin, acos, angle, power,
                powers, cubic, inverses.0, inverses.1, inverses.2, error,
            ];
            let tape = tape.finish(&outputs);

            let mut balls = vec![Ball::splat(0.0); tape.n_registers()];
            let mut enclosures = vec![Ball::splat(0.0); outputs.len()];
            let around = [Ball::new(x, r), Ball::new(y, r)];
            tape.eval_lanes(&around, &mut enclosures, &mut balls);
            let mut values = vec![0.0; outputs.len()];
            tape.eval(&[x + s * r, y + u * r], &mut values, &mut tape.scratch());
            for (ball, value) in enclosures.iter().zip(&values) {
                // A root or a logarithm of a negative number is none.
                if ball.radius == f64::INFINITY || value.is_nan() {
                    continue;
                }
                prop_assert!((value - ball.middle).abs() <= ball.radius * (1.0 + 1e-12) + 1e-14, "{ball:?} and {value}");
            }
        }
    }
}
