//! The table of elementary functions w = f(a), each with the differential equation that it satisfies.
//!
//! Derivatives, Taylor coefficients, enclosures and where a series hides something follow from that equation.

use std::f64::consts::FRAC_2_SQRT_PI;

use serde::{Deserialize, Serialize};

use super::term::Term;
use super::{TapeBuilder, Value};

/// The equation of a function w of a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Rate {
    /// w' = w a'
    Exponential,
    /// a w' = a'
    Logarithm,
    /// w' = q a' with q = 1 + s w²
    Riccati(f64),
    /// q w' = a' with q = 1 + s a²
    Rational(f64),
    /// q w' = r a' with q² = p = c + s a²
    Root { c: f64, s: f64, r: f64 },
    /// w' = q a' with q = 2/√π exp(-a²)
    Gauss,
}

macro_rules! elementary {
    ($($(#[$doc:meta])* $Name:ident $method:ident: $value:expr, $rate:expr, $opcode:expr;)*) => {
        /// A function of one number; the names are the functions.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum Elementary {
            $($(#[$doc])* $Name,)*
        }

        impl Elementary {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$Name),*];

            /// The function of numbers.
            pub fn value(self) -> fn(f64) -> f64 {
                match self {
                    $(Self::$Name => $value,)*
                }
            }

            /// The differential equation.
            pub(crate) fn rate(self) -> Rate {
                match self {
                    $(Self::$Name => $rate,)*
                }
            }

            /// The number of the operator in AMPL files (Gay 2005, table 2), where there is one.
            pub(crate) fn opcode(self) -> Option<i64> {
                match self {
                    $(Self::$Name => $opcode,)*
                }
            }
        }

        impl TapeBuilder {
            $($(#[$doc])* pub fn $method(&mut self, a: Value) -> Value {
                self.apply(Elementary::$Name, a)
            })*
        }
    };
}

elementary! {
    /// The exponential.
    Exp exp: f64::exp, Rate::Exponential, Some(44);
    /// The natural logarithm.
    Log log: f64::ln, Rate::Logarithm, Some(43);
    /// The tangent.
    Tan tan: f64::tan, Rate::Riccati(1.0), Some(38);
    /// The hyperbolic tangent.
    Tanh tanh: f64::tanh, Rate::Riccati(-1.0), Some(37);
    /// The inverse sine.
    Asin asin: f64::asin, Rate::Root { c: 1.0, s: -1.0, r: 1.0 }, Some(51);
    /// The inverse cosine.
    Acos acos: f64::acos, Rate::Root { c: 1.0, s: -1.0, r: -1.0 }, Some(53);
    /// The inverse tangent.
    Atan atan: f64::atan, Rate::Rational(1.0), Some(49);
    /// The inverse hyperbolic sine.
    Asinh asinh: f64::asinh, Rate::Root { c: 1.0, s: 1.0, r: 1.0 }, Some(50);
    /// The inverse hyperbolic cosine.
    Acosh acosh: acosh, Rate::Root { c: -1.0, s: 1.0, r: 1.0 }, Some(52);
    /// The inverse hyperbolic tangent.
    Atanh atanh: atanh, Rate::Rational(-1.0), Some(47);
    /// The error function, 2/√π ∫ exp(-s²) ds from 0 to a.
    Erf erf: libm::erf, Rate::Gauss, None;
}

/// log(1 + d + √(d (d + 2))) with d = a - 1: no digit is lost near 1, and no square overflows.
fn acosh(a: f64) -> f64 {
    let d = a - 1.0;
    (d + d.sqrt() * (d + 2.0).sqrt()).ln_1p()
}

/// ½ log(1 + 2|a| / (1 - |a|)), with the sign of a: no digit is lost near 0 and ±1.
fn atanh(a: f64) -> f64 {
    let size = a.abs();
    (0.5 * (2.0 * size / (1.0 - size)).ln_1p()).copysign(a)
}

/// c + s x² where c and s are ±1; differences of squares are products, in which nothing cancels.
fn quadratic(c: f64, s: f64, x: f64) -> f64 {
    match c == s {
        true => c + s * (x * x),
        false => c * ((1.0 - x) * (1.0 + x)),
    }
}

fn quadratic_term(c: f64, s: f64, x: Term, b: &mut TapeBuilder) -> Term {
    let one = Term::ONE;
    if c == s {
        return x.square(b).add(one, b).times(c);
    }
    let (below, above) = (one.sub(x, b), one.add(x, b));
    below.mul(above, b).times(c)
}

impl Rate {
    /// q at a, where w is the value.
    pub fn helper(self, a: f64, w: f64) -> Option<f64> {
        match self {
            Self::Exponential | Self::Logarithm => None,
            Self::Riccati(s) => Some(quadratic(1.0, s, w)),
            Self::Rational(s) => Some(quadratic(1.0, s, a)),
            Self::Root { c, s, .. } => Some(quadratic(c, s, a).sqrt()),
            Self::Gauss => Some(FRAC_2_SQRT_PI * (-a * a).exp()),
        }
    }

    /// First and second derivative of v = f(x).
    pub fn derivatives(self, v: Term, x: Term, b: &mut TapeBuilder) -> [Term; 2] {
        match self {
            Self::Exponential => [v, v],
            Self::Logarithm => {
                let r = x.recip(b);
                [r, r.square(b).neg()]
            }
            Self::Riccati(s) => {
                let slope = quadratic_term(1.0, s, v, b);
                [slope, v.mul(slope, b).times(2.0 * s)]
            }
            Self::Rational(s) => {
                let slope = quadratic_term(1.0, s, x, b).recip(b);
                [slope, x.mul(slope.square(b), b).times(-2.0 * s)]
            }
            Self::Root { c, s, r } => {
                let square = quadratic_term(c, s, x, b);
                let slope = square.sqrt(b).recip(b).times(r);
                [slope, x.mul(slope, b).div(square, b).times(-s)]
            }
            Self::Gauss => {
                let square = x.square(b).neg();
                let slope = square.function(Elementary::Exp, b).times(FRAC_2_SQRT_PI);
                [slope, x.mul(slope, b).times(-2.0)]
            }
        }
    }

    /// Where the function is defined.
    pub fn domain(self) -> [f64; 2] {
        match self {
            Self::Logarithm => [0.0, f64::INFINITY],
            Self::Root { c: -1.0, .. } => [1.0, f64::INFINITY],
            Self::Rational(-1.0) | Self::Root { s: -1.0, .. } => [-1.0, 1.0],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// The largest absolute value of the derivative.
    pub fn steepest(self) -> f64 {
        match self {
            Self::Riccati(-1.0) | Self::Rational(1.0) | Self::Root { c: 1.0, s: 1.0, .. } => 1.0,
            Self::Gauss => FRAC_2_SQRT_PI,
            _ => f64::INFINITY,
        }
    }

    /// The divisor q, or p, of the derivative at a, and its least value where |a| is in a range; 1 where there is none.
    pub fn divisor(self, a: f64, [least, most]: [f64; 2]) -> [f64; 2] {
        let (c, s) = match self {
            Self::Rational(s) => (1.0, s),
            Self::Root { c, s, .. } => (c, s),
            _ => return [1.0; 2],
        };
        let nearest = if s > 0.0 { least } else { most };
        [a, nearest].map(|a| quadratic(c, s, a))
    }
}

#[cfg(test)]
mod tests {
    use super::Elementary;

    /// Values of 20 digits (mpmath).
    #[test]
    fn the_error_function_is_right_to_the_last_digit() {
        let cases = [
            (1e-9, 1.128_379_167_095_512_6e-9),
            (0.5, 0.520_499_877_813_046_5),
            (-1.0, -0.842_700_792_949_714_9),
            (2.5, 0.999_593_047_982_555),
            (6.5, 1.0),
        ];
        for (at, exact) in cases {
            let found = Elementary::Erf.value()(at);
            let error = (found / exact - 1.0).abs();
            assert!(error <= 4e-16, "erf({at}): {found}, not {exact}");
        }
    }

    /// Values of 20 digits at the numbers that stand here (mpmath).
    #[test]
    fn inverse_hyperbolic_functions_lose_no_digit() {
        use Elementary::{Acosh, Asinh, Atanh};
        let cases = [
            (Asinh, -1e-8, -1e-8),
            (Asinh, -1e8, -19.113_827_924_512_31),
            (Asinh, 0.5, 0.481_211_825_059_603_47),
            (Acosh, 1.0 + 1e-10, 1.414_213_620_867_586_2e-5),
            (Acosh, 1.5, 0.962_423_650_119_206_9),
            (Acosh, 1e200, 461.210_165_779_369_1),
            (Atanh, 1e-9, 1e-9),
            (Atanh, -0.999_999, -7.254_328_619_247_669),
            (Atanh, 0.3, 0.309_519_604_203_111_7),
        ];
        for (function, at, exact) in cases {
            let found = function.value()(at);
            let error = (found / exact - 1.0).abs();
            assert!(error <= 1e-15, "{function:?} at {at}: {found}, not {exact}");
        }
        assert!(Acosh.value()(1.0 - 1e-15).is_nan() && Atanh.value()(1.0 + 1e-15).is_nan());
    }
}
