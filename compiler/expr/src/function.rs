//! The functions an expression is made of: the table of those of one argument, and those of two.

use std::f64::consts::{FRAC_2_SQRT_PI, PI};

use nsd_solver::tape::{Elementary, TapeBuilder, Value};

use super::{Expr, Interval};

/// All that a function w = f(a) of one argument is to the passes.
pub struct Definition {
    /// The name in the language.
    pub name: &'static str,
    /// The value at a number.
    pub value: fn(f64) -> f64,
    /// ∂w/∂a from w and a.
    pub(crate) slope: for<'e> fn(Expr<'e>, Expr<'e>) -> Expr<'e>,
    /// An enclosure of the values.
    pub(crate) image: fn(Interval) -> Interval,
    /// Its instruction, none where it has a kink or a jump.
    pub(crate) code: Option<fn(&mut TapeBuilder, Value) -> Value>,
    /// The number of its operator in AMPL files (Gay 2005, table 2).
    pub opcode: Option<u32>,
    /// What stands before and behind the argument in TeX.
    pub tex: (&'static str, &'static str),
    /// Where a narrow change of it comes from.
    pub steep: Steep,
    /// The unit of w.
    pub unit: Unit,
}

/// Where a function of a changes much within a narrow change of a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Steep {
    /// Nowhere, beside other functions.
    Nowhere,
    /// Where a is large: e^a vanishes everywhere else.
    Exponential,
    /// Where |a| is large.
    Hyperbolic,
    /// Near these a, where it has no derivative.
    At(&'static [f64]),
    /// Near 0, beside larger a.
    Flank,
}

/// The unit of a function by that of its argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// Neither has one.
    Number,
    /// The argument may have any, the value has none.
    Dropped,
    /// Both have the same.
    Kept,
    /// That of the value is the square root of that of the argument.
    SquareRoot,
}

macro_rules! functions {
    ($($(#[$doc:meta])* $Name:ident $method:ident {
        value: $value:expr, slope: $slope:expr, image: $image:expr, code: $code:expr, opcode: $opcode:expr,
        tex: $tex:expr, steep: $steep:expr, unit: $unit:expr $(,)?
    })*) => {
        /// A function of one argument.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Function {
            $($(#[$doc])* $Name,)*
        }

        impl Function {
            /// All of them, in order: the smooth ones, then those with a kink or a jump.
            pub const ALL: &'static [Self] = &[$(Self::$Name),*];
        }

        static TABLE: &[Definition] = &[$(Definition {
            name: stringify!($method),
            value: $value,
            slope: $slope,
            image: $image,
            code: $code,
            opcode: $opcode,
            tex: $tex,
            steep: $steep,
            unit: $unit,
        }),*];

        impl<'e> Expr<'e> {
            $($(#[$doc])* pub fn $method(self) -> Expr<'e> {
                self.apply(Function::$Name)
            })*
        }
    };
}

/// A function that TeX has a name for.
macro_rules! tex {
    ($name:literal) => {
        (concat!("\\", $name, "\\left("), "\\right)")
    };
}

/// The numbers from 0 on.
const POSITIVE: Interval = Interval {
    low: 0.0,
    high: f64::INFINITY,
};

/// The numbers from 1 on.
const BEYOND_ONE: Interval = Interval {
    low: 1.0,
    high: f64::INFINITY,
};

/// The numbers from -1 to 1.
const UNIT: Interval = Interval {
    low: -1.0,
    high: 1.0,
};

functions! {
    /// The square root.
    Sqrt sqrt {
        value: f64::sqrt,
        slope: |w, _| 0.5 / w,
        image: |a| a.rising(POSITIVE, f64::sqrt).above(0.0),
        code: Some(TapeBuilder::sqrt),
        opcode: Some(39),
        tex: ("\\sqrt{", "}"),
        steep: Steep::At(&[0.0]),
        unit: Unit::SquareRoot,
    }
    /// The exponential.
    Exp exp {
        value: f64::exp,
        slope: |w, _| w,
        image: |a| a.rising(Interval::ALL, f64::exp).above(0.0),
        code: Some(TapeBuilder::exp),
        opcode: Some(44),
        tex: tex!("exp"),
        steep: Steep::Exponential,
        unit: Unit::Number,
    }
    /// The natural logarithm.
    Log log {
        value: f64::ln,
        slope: |_, a| 1.0 / a,
        image: |a| a.rising(POSITIVE, f64::ln),
        code: Some(TapeBuilder::log),
        opcode: Some(43),
        tex: tex!("log"),
        steep: Steep::At(&[0.0]),
        unit: Unit::Number,
    }
    /// The sine.
    Sin sin {
        value: f64::sin,
        slope: |_, a| a.cos(),
        image: Interval::sin,
        code: Some(|b, a| b.sin_cos(a).0),
        opcode: Some(41),
        tex: tex!("sin"),
        steep: Steep::Nowhere,
        unit: Unit::Number,
    }
    /// The cosine.
    Cos cos {
        value: f64::cos,
        slope: |_, a| -a.sin(),
        image: Interval::cos,
        code: Some(|b, a| b.sin_cos(a).1),
        opcode: Some(46),
        tex: tex!("cos"),
        steep: Steep::Nowhere,
        unit: Unit::Number,
    }
    /// The tangent.
    Tan tan {
        value: f64::tan,
        slope: |w, _| 1.0 + w * w,
        image: |a| match a.cos().contains(0.0) || a.width() >= PI {
            true => Interval::ALL,
            false => a.rising(Interval::ALL, f64::tan),
        },
        code: Some(TapeBuilder::tan),
        opcode: Some(38),
        tex: tex!("tan"),
        steep: Steep::Nowhere,
        unit: Unit::Number,
    }
    /// The inverse sine.
    Asin asin {
        value: f64::asin,
        slope: |_, a| 1.0 / (1.0 - a * a).sqrt(),
        image: |a| a.rising(UNIT, f64::asin),
        code: Some(TapeBuilder::asin),
        opcode: Some(51),
        tex: tex!("arcsin"),
        steep: Steep::At(&[-1.0, 1.0]),
        unit: Unit::Number,
    }
    /// The inverse cosine.
    Acos acos {
        value: f64::acos,
        slope: |_, a| -1.0 / (1.0 - a * a).sqrt(),
        image: |a| a.neg().rising(UNIT, |x| (-x).acos()),
        code: Some(TapeBuilder::acos),
        opcode: Some(53),
        tex: tex!("arccos"),
        steep: Steep::At(&[-1.0, 1.0]),
        unit: Unit::Number,
    }
    /// The inverse tangent.
    Atan atan {
        value: f64::atan,
        slope: |_, a| 1.0 / (1.0 + a * a),
        image: |a| a.rising(Interval::ALL, f64::atan),
        code: Some(TapeBuilder::atan),
        opcode: Some(49),
        tex: tex!("arctan"),
        steep: Steep::Flank,
        unit: Unit::Number,
    }
    /// The inverse hyperbolic sine.
    Asinh asinh {
        value: f64::asinh,
        slope: |_, a| 1.0 / (1.0 + a * a).sqrt(),
        image: |a| a.rising(Interval::ALL, f64::asinh),
        code: Some(TapeBuilder::asinh),
        opcode: Some(50),
        tex: tex!("operatorname{arsinh}"),
        steep: Steep::Flank,
        unit: Unit::Number,
    }
    /// The inverse hyperbolic cosine.
    Acosh acosh {
        value: |a| Elementary::Acosh.value()(a),
        slope: |_, a| 1.0 / ((a - 1.0) * (a + 1.0)).sqrt(),
        image: |a| a.rising(BEYOND_ONE, Elementary::Acosh.value()).above(0.0),
        code: Some(TapeBuilder::acosh),
        opcode: Some(52),
        tex: tex!("operatorname{arcosh}"),
        steep: Steep::At(&[1.0]),
        unit: Unit::Number,
    }
    /// The inverse hyperbolic tangent.
    Atanh atanh {
        value: |a| Elementary::Atanh.value()(a),
        slope: |_, a| 1.0 / ((1.0 - a) * (1.0 + a)),
        image: |a| a.rising(UNIT, Elementary::Atanh.value()),
        code: Some(TapeBuilder::atanh),
        opcode: Some(47),
        tex: tex!("operatorname{artanh}"),
        steep: Steep::At(&[-1.0, 1.0]),
        unit: Unit::Number,
    }
    /// The hyperbolic sine.
    Sinh sinh {
        value: f64::sinh,
        slope: |_, a| a.cosh(),
        image: |a| a.rising(Interval::ALL, f64::sinh),
        code: Some(|b, a| b.sinh_cosh(a).0),
        opcode: Some(40),
        tex: tex!("sinh"),
        steep: Steep::Hyperbolic,
        unit: Unit::Number,
    }
    /// The hyperbolic cosine.
    Cosh cosh {
        value: f64::cosh,
        slope: |_, a| a.sinh(),
        image: |a| a.abs().rising(Interval::ALL, f64::cosh).above(1.0),
        code: Some(|b, a| b.sinh_cosh(a).1),
        opcode: Some(45),
        tex: tex!("cosh"),
        steep: Steep::Hyperbolic,
        unit: Unit::Number,
    }
    /// The hyperbolic tangent.
    Tanh tanh {
        value: f64::tanh,
        slope: |w, _| 1.0 - w * w,
        image: |a| a.rising(Interval::ALL, f64::tanh),
        code: Some(TapeBuilder::tanh),
        opcode: Some(37),
        tex: tex!("tanh"),
        steep: Steep::Flank,
        unit: Unit::Number,
    }
    /// The error function, 2/√π ∫ exp(-s²) ds from 0 to it.
    Erf erf {
        value: |a| Elementary::Erf.value()(a),
        slope: |_, a| FRAC_2_SQRT_PI * (-(a * a)).exp(),
        image: |a| a.rising(Interval::ALL, Elementary::Erf.value()),
        code: Some(TapeBuilder::erf),
        opcode: None,
        tex: tex!("operatorname{erf}"),
        steep: Steep::Flank,
        unit: Unit::Number,
    }
    /// The largest integer that is not above it.
    Floor floor {
        value: f64::floor,
        slope: |w, _| 0.0 * w,
        image: |a| Interval::new(a.low.floor(), a.high.floor()),
        code: None,
        opcode: None,
        tex: ("\\left\\lfloor ", "\\right\\rfloor"),
        steep: Steep::Nowhere,
        unit: Unit::Number,
    }
    /// 0 for negative, 1 for positive values; set-valued at 0, where a number has 1/2.
    Step step {
        value: |x| 0.5 + 0.5 * signum(x),
        slope: |w, _| 0.0 * w,
        image: |a| Interval::new(0.5 + 0.5 * signum(a.low), 0.5 + 0.5 * signum(a.high)),
        code: None,
        opcode: None,
        tex: ("\\operatorname{step}\\left(", "\\right)"),
        steep: Steep::Nowhere,
        unit: Unit::Dropped,
    }
    /// What a > 0 says: 1 for positive values, 0 for others. A step, where 0 is not looked at.
    Positive positive {
        value: |a| indicator(a, a > 0.0),
        slope: |w, _| 0.0 * w,
        image: |a| Interval::new(indicator(a.low, a.low > 0.0), indicator(a.high, a.high > 0.0)),
        code: None,
        opcode: None,
        tex: ("\\operatorname{step}\\left(", "\\right)"),
        steep: Steep::Nowhere,
        unit: Unit::Dropped,
    }
    /// What a >= 0 says: 0 for negative values, 1 for others. A step, where 0 is not looked at.
    NonNegative nonnegative {
        value: |a| indicator(a, a >= 0.0),
        slope: |w, _| 0.0 * w,
        image: |a| Interval::new(indicator(a.low, a.low >= 0.0), indicator(a.high, a.high >= 0.0)),
        code: None,
        opcode: None,
        tex: ("\\operatorname{step}\\left(", "\\right)"),
        steep: Steep::Nowhere,
        unit: Unit::Dropped,
    }
    /// -1 for negative, 1 for positive values; set-valued at 0, where a number has 0.
    Sign sign {
        value: signum,
        slope: |w, _| 0.0 * w,
        image: |a| Interval::new(signum(a.low), signum(a.high)),
        code: None,
        opcode: None,
        tex: ("\\operatorname{sign}\\left(", "\\right)"),
        steep: Steep::Nowhere,
        unit: Unit::Dropped,
    }
    /// The absolute value.
    Abs abs {
        value: f64::abs,
        slope: |_, a| a.sign(),
        image: Interval::abs,
        code: None,
        opcode: Some(15),
        tex: ("\\left|", "\\right|"),
        steep: Steep::Nowhere,
        unit: Unit::Kept,
    }
}

impl Function {
    /// Its row of the table.
    pub fn definition(self) -> &'static Definition {
        &TABLE[self as usize]
    }

    /// Those that the language has by name: comparisons are operators.
    pub fn named() -> impl Iterator<Item = Self> {
        let all = Self::ALL.iter().copied();
        all.filter(|function| !matches!(function, Self::Positive | Self::NonNegative))
    }

    /// The function with a name of the language.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::named().find(|function| function.name() == name)
    }

    /// Whether the function has a kink or a jump; `system` replaces these.
    pub fn is_nonsmooth(self) -> bool {
        self.definition().code.is_none()
    }

    /// The name in the language, where comparisons are steps.
    pub fn name(self) -> &'static str {
        match self {
            Self::Positive | Self::NonNegative => Self::Step.name(),
            _ => self.definition().name,
        }
    }

    /// Of a function that is 0 below and 1 above 0, its value there.
    pub fn on_surface(self) -> Option<f64> {
        match self {
            Self::Step | Self::Positive | Self::NonNegative => Some(self.value(0.0)),
            _ => None,
        }
    }

    /// The value at a number. At 0, `sign` is 0 and `step` is 1/2.
    pub fn value(self, x: f64) -> f64 {
        (self.definition().value)(x)
    }
}

/// A function of two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names are the functions")]
pub enum BinaryFunction {
    /// A power that is no integer; integer powers are products.
    Pow,
    Atan2,
    Min,
    Max,
}

impl BinaryFunction {
    /// Whether the function has a kink; `system` replaces these.
    pub fn is_nonsmooth(self) -> bool {
        matches!(self, Self::Min | Self::Max)
    }

    /// The name in the language.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pow => "pow",
            Self::Atan2 => "atan2",
            Self::Min => "min",
            Self::Max => "max",
        }
    }

    /// The value at two numbers.
    pub fn value(self, x: f64, y: f64) -> f64 {
        match self {
            Self::Pow => x.powf(y),
            Self::Atan2 => x.atan2(y),
            Self::Min if x.is_nan() || y.is_nan() => f64::NAN,
            Self::Max if x.is_nan() || y.is_nan() => f64::NAN,
            Self::Min => x.min(y),
            Self::Max => x.max(y),
        }
    }
}

/// 1 where a comparison of `a` holds, else 0.
fn indicator(a: f64, holds: bool) -> f64 {
    match a.is_nan() {
        true => a,
        false => f64::from(holds),
    }
}

/// The sign with `sign(0) = 0`; `f64::signum` gives 1 there.
fn signum(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}
