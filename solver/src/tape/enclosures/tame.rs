//! Enclosures that tell whether the middle of a part speaks for all of it.
//!
//! e^u is narrow beside its argument where u moves by more than 1, and 1/v where v comes close to zero: then what a
//! function is in the middle of a part says nothing of the rest. A composition of functions none of which does so
//! within its argument's ball is *tame* there. So is v^p where v moves by less than its p-th part: products of many
//! factors are powers, whatever these are. Where a function vanishes, or tanh u has reached its limit, it is tame, too.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::tape::elementary::Rate;
use crate::tape::{Ball, Elementary, Lane};

/// Below e to this a number adds nothing to any other that a model has.
pub(crate) const VANISHED: f64 = -100.0;

/// e to that.
pub(crate) const NOTHING: f64 = 3.7e-44;

/// The inverse of a number beyond this one is nothing, too; larger ones are not told apart.
const ENORMOUS: f64 = 1e150;

/// A product of more factors is a power.
pub(crate) const FEW: u32 = 16;

/// Beyond this |u| tanh u is ±1.
pub(crate) const SATURATED: f64 = 20.0;

/// What u in e^u may rise by from the middle of a part.
const RISE: f64 = 1.5;

/// What v in 1/v may fall to, as a share of its middle.
const FALL: f64 = 0.25;

/// A ball, whether all functions on the way to it are tame, and how many factors it is a product of, or its longest term.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tame {
    pub ball: Ball,
    pub is_tame: bool,
    /// No absolute value of it is below this: of a power of v this is that of the least |v|, where the ball, whose
    /// radius doubles with each square, already holds zero.
    least: f64,
    factors: u32,
}

impl Tame {
    pub(crate) fn new(ball: Ball) -> Self {
        Tame {
            ball,
            is_tame: true,
            least: ball.least(),
            factors: 1,
        }
    }

    /// What becomes of it by a function that is tame here, or is not.
    fn becomes(self, ball: Ball, is_tame: bool) -> Self {
        Tame {
            is_tame: self.is_tame && is_tame,
            ..Tame::new(ball)
        }
    }

    /// A sum with another one. Its factors are those of the term that has more, as the degree of a polynomial is.
    fn joins(self, other: Tame, ball: Ball) -> Self {
        Tame {
            is_tame: self.is_tame && other.is_tame,
            factors: self.factors.max(other.factors),
            ..Tame::new(ball)
        }
    }
}

impl From<Ball> for Tame {
    fn from(ball: Ball) -> Self {
        Tame::new(ball)
    }
}

impl Ball {
    /// The least absolute value in it.
    fn least(self) -> f64 {
        (self.middle.abs() - self.radius).max(0.0)
    }

    /// The largest absolute value in it.
    fn most(self) -> f64 {
        self.middle.abs() + self.radius
    }

    /// Whether nothing is in it, to the last number.
    fn vanishes(self) -> bool {
        self.most() <= NOTHING
    }

    /// The same with numbers that are not told apart as one, where all are at least as large as `least`.
    fn above(self, least: f64) -> Self {
        match least >= ENORMOUS {
            true => Ball::new(ENORMOUS.copysign(self.middle), 0.0),
            false => self,
        }
    }

    /// Whether a function with a pole, or a root, at zero is tame in it.
    fn keeps_distance(self) -> bool {
        self.radius == 0.0 || self.least() >= FALL * self.middle.abs() && self.radius.is_finite()
    }
}

impl Neg for Tame {
    type Output = Tame;

    fn neg(self) -> Tame {
        Tame {
            ball: -self.ball,
            ..self
        }
    }
}

impl Add for Tame {
    type Output = Tame;

    fn add(self, other: Tame) -> Tame {
        self.joins(other, self.ball + other.ball)
    }
}

impl Sub for Tame {
    type Output = Tame;

    fn sub(self, other: Tame) -> Tame {
        self.joins(other, self.ball - other.ball)
    }
}

impl Mul for Tame {
    type Output = Tame;

    fn mul(self, other: Tame) -> Tame {
        let least = self.least * other.least;
        let ball = (self.ball * other.ball).above(least);
        let factors = self.factors.saturating_add(other.factors);
        let is_slow = factors <= FEW || ball.most() <= RISE.exp() * ball.middle.abs();
        Tame {
            ball,
            is_tame: ball.vanishes() || self.is_tame && other.is_tame && is_slow,
            least: least.min(ENORMOUS),
            factors,
        }
    }
}

impl Div for Tame {
    type Output = Tame;

    fn div(self, other: Tame) -> Tame {
        let ball = self.ball / other.ball;
        let is_near = self.is_tame && other.is_tame && other.ball.keeps_distance();
        Tame {
            ball,
            is_tame: self.ball.most() <= NOTHING * other.least || is_near,
            least: (self.least / other.ball.most()).max(0.0),
            factors: self.factors.saturating_add(other.factors),
        }
    }
}

impl Lane for Tame {
    const WIDTH: usize = 1;

    fn splat(value: f64) -> Self {
        Tame {
            factors: 0,
            ..Tame::new(Ball::splat(value))
        }
    }

    fn load(from: &[f64]) -> Self {
        Tame::splat(from[0])
    }

    fn store(self, to: &mut [f64]) {
        self.ball.store(to);
    }

    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        self.becomes(self.ball.map(f), true)
    }

    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        self.becomes(self.ball.zip(other.ball, f), other.is_tame)
    }

    fn sqrt(self) -> Self {
        self.becomes(self.ball.sqrt(), self.ball.keeps_distance())
    }

    fn apply(self, f: Elementary) -> Self {
        let (ball, rate) = (self.ball, f.rate());
        let image = ball.apply(f);
        let is_tame = match rate {
            Rate::Exponential => ball.radius <= RISE || ball.high() <= VANISHED,
            Rate::Logarithm => ball.keeps_distance(),
            // 1 - tanh u falls off as exp(-2 |u|).
            Rate::Riccati(-1.0) => 2.0 * ball.radius <= RISE || ball.least() >= SATURATED,
            Rate::Riccati(_) => image.radius.is_finite(),
            // 1 - erf u falls off as exp(-u²).
            Rate::Gauss => {
                let [least, most] = [ball.least(), ball.most()].map(|u| u * u);
                most - least <= RISE || least >= 2.0 * SATURATED
            }
            Rate::Rational(_) | Rate::Root { .. } => {
                let [middle, worst] = rate.divisor(ball.middle, [ball.least(), ball.most()]);
                worst >= FALL * middle
            }
        };
        match rate {
            Rate::Exponential => self.becomes(image.above(ball.low().exp()), is_tame),
            _ => self.becomes(image, is_tame),
        }
    }

    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = self.ball.sin_cos();
        (self.becomes(sine, true), self.becomes(cosine, true))
    }

    fn sinh_cosh(self) -> (Self, Self) {
        let (sine, cosine) = self.ball.sinh_cosh();
        let (is_tame, least) = (self.ball.radius <= RISE, self.ball.least().sinh());
        let becomes = |ball: Ball| self.becomes(ball.above(least), is_tame);
        (becomes(sine), becomes(cosine))
    }

    fn atan2(self, x: Self) -> Self {
        let square = self.ball * self.ball + x.ball * x.ball;
        let is_tame = x.is_tame && square.keeps_distance();
        self.becomes(self.ball.atan2(x.ball), is_tame)
    }

    fn pow(self, power: Self) -> Self {
        let exponent = self.ball.middle.abs().ln() * power.ball.radius;
        let relative = self.ball.radius / self.ball.middle.abs();
        let is_slow = power.ball.radius == 0.0 || exponent.abs() <= RISE;
        let is_near = self.ball.radius == 0.0 || relative * power.ball.middle.abs() <= RISE;
        let is_tame = self.ball.keeps_distance() && is_slow && is_near && power.is_tame;
        self.becomes(self.ball.pow(power.ball), is_tame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tape::Tape;

    /// exp(-((s - 3)/0.01)²) and 1/(1 + ((s - 3)/0.01)²) in a part around `middle`.
    fn bumps(middle: f64, radius: f64) -> [bool; 2] {
        let mut tape = Tape::builder(1);
        let s = tape.input(0);
        let center = tape.constant(3.0);
        let over = tape.constant(100.0);
        let far = tape.sub(s, center);
        let far = tape.mul(far, over);
        let square = tape.square(far);
        let fall = tape.neg(square);
        let gauss = tape.exp(fall);
        let one = tape.constant(1.0);
        let sum = tape.add(one, square);
        let lorentz = tape.recip(sum);
        let tape = tape.finish(&[gauss, lorentz]);
        let mut registers = vec![Tame::splat(0.0); tape.n_registers()];
        let mut results = [Tame::splat(0.0); 2];
        let part = [Tame::new(Ball::new(middle, radius))];
        tape.eval_lanes(&part, &mut results, &mut registers);
        results.map(|result| result.is_tame)
    }

    #[test]
    fn powers_are_tame_where_they_hardly_move_or_vanish() {
        let mut tape = Tape::builder(1);
        let s = tape.input(0);
        let (_, cosine) = tape.sin_cos(s);
        let high = tape.powi(cosine, 20_000);
        let low = tape.powi(cosine, 3);
        let one = tape.constant(1.0);
        let square = tape.square(s);
        let sum = tape.add(one, square);
        let power = tape.powi(sum, 20_000);
        let inverse = tape.recip(power);
        let (_, wide) = tape.sinh_cosh(s);
        let secant = tape.recip(wide);
        let tape = tape.finish(&[high, low, inverse, secant]);
        let mut registers = vec![Tame::splat(0.0); tape.n_registers()];
        let mut tame = |middle: f64, radius: f64| {
            let mut results = [Tame::splat(0.0); 4];
            let part = [Tame::new(Ball::new(middle, radius))];
            tape.eval_lanes(&part, &mut results, &mut registers);
            results.map(|result| result.is_tame)
        };
        // cos(0.1)^20000 is e^-100.
        assert_eq!(tame(0.5, 0.6), [false, true, false, true]);
        // 1.14 to this power overflows.
        assert_eq!(tame(0.5, 0.1), [true; 4]);
        assert_eq!(tame(0.1, 0.09), [false, true, false, true]);
        assert_eq!(tame(0.5, 0.0004), [true; 4]);
        assert_eq!(tame(0.01, 0.001), [true; 4]);
        assert_eq!(tame(2000.0, 1.0), [false, true, true, true]);
        assert!(tame(2000.0, 1000.0)[3]);
    }

    #[test]
    fn a_bump_is_tame_in_parts_as_narrow_as_itself_and_where_it_vanishes() {
        assert_eq!(bumps(2.0, 2.0), [false, false]);
        assert_eq!(bumps(1.0, 0.5), [true, true]);
        assert_eq!(bumps(2.995, 0.004), [true, true]);
        assert_eq!(bumps(2.95, 0.04), [false, false]);
    }
}
