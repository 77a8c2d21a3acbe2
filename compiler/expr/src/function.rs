//! The functions an expression is made of, and their values.

/// A function of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names are the functions")]
pub enum Function {
    Sqrt,
    Exp,
    Log,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    /// 0 for negative, 1 for positive arguments.
    Step,
    /// -1 for negative, 1 for positive arguments.
    Sign,
    Abs,
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

impl Function {
    /// All of them, in order: the smooth ones, then those with a kink or a jump.
    pub const ALL: [Self; 15] = [
        Self::Sqrt,
        Self::Exp,
        Self::Log,
        Self::Sin,
        Self::Cos,
        Self::Tan,
        Self::Asin,
        Self::Acos,
        Self::Atan,
        Self::Sinh,
        Self::Cosh,
        Self::Tanh,
        Self::Step,
        Self::Sign,
        Self::Abs,
    ];

    /// Whether the function has a kink or a jump; `system` replaces these.
    pub fn is_nonsmooth(self) -> bool {
        matches!(self, Self::Step | Self::Sign | Self::Abs)
    }

    /// The name in the language.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sqrt => "sqrt",
            Self::Exp => "exp",
            Self::Log => "log",
            Self::Sin => "sin",
            Self::Cos => "cos",
            Self::Tan => "tan",
            Self::Asin => "asin",
            Self::Acos => "acos",
            Self::Atan => "atan",
            Self::Sinh => "sinh",
            Self::Cosh => "cosh",
            Self::Tanh => "tanh",
            Self::Step => "step",
            Self::Sign => "sign",
            Self::Abs => "abs",
        }
    }

    /// The value at a number. At 0, `sign` is 0 and `step` is 1/2.
    pub fn value(self, x: f64) -> f64 {
        match self {
            Self::Sqrt => x.sqrt(),
            Self::Exp => x.exp(),
            Self::Log => x.ln(),
            Self::Sin => x.sin(),
            Self::Cos => x.cos(),
            Self::Tan => x.tan(),
            Self::Asin => x.asin(),
            Self::Acos => x.acos(),
            Self::Atan => x.atan(),
            Self::Sinh => x.sinh(),
            Self::Cosh => x.cosh(),
            Self::Tanh => x.tanh(),
            Self::Step => 0.5 + 0.5 * sign(x),
            Self::Sign => sign(x),
            Self::Abs => x.abs(),
        }
    }
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

/// The sign with `sign(0) = 0`; `f64::signum` gives 1 there.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}
