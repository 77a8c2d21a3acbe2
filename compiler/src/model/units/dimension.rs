//! Dimensions: products of powers of the seven bases of the SI, with rational exponents.
//!
//! They form a vector space over the rationals: the product of two quantities adds their exponents,
//! a power multiplies them (Kock 1989; Kennedy 1996, chapter 2).

use std::fmt;

/// Coherent units of the SI (BIPM 2019, tables 2 and 4) with their exponents of kg, m, s, A, K, mol, cd.
pub(crate) const UNITS: [(&str, [i32; 7]); 29] = [
    ("kg", [1, 0, 0, 0, 0, 0, 0]),
    ("m", [0, 1, 0, 0, 0, 0, 0]),
    ("s", [0, 0, 1, 0, 0, 0, 0]),
    ("A", [0, 0, 0, 1, 0, 0, 0]),
    ("K", [0, 0, 0, 0, 1, 0, 0]),
    ("mol", [0, 0, 0, 0, 0, 1, 0]),
    ("cd", [0, 0, 0, 0, 0, 0, 1]),
    ("rad", [0, 0, 0, 0, 0, 0, 0]),
    ("sr", [0, 0, 0, 0, 0, 0, 0]),
    ("Hz", [0, 0, -1, 0, 0, 0, 0]),
    ("N", [1, 1, -2, 0, 0, 0, 0]),
    ("Pa", [1, -1, -2, 0, 0, 0, 0]),
    ("J", [1, 2, -2, 0, 0, 0, 0]),
    ("W", [1, 2, -3, 0, 0, 0, 0]),
    ("C", [0, 0, 1, 1, 0, 0, 0]),
    ("V", [1, 2, -3, -1, 0, 0, 0]),
    ("F", [-1, -2, 4, 2, 0, 0, 0]),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0]),
    // As it is after normalization: the sign of the unit and the capital letter are one.
    ("Ω", [1, 2, -3, -2, 0, 0, 0]),
    ("S", [-1, -2, 3, 2, 0, 0, 0]),
    ("Wb", [1, 2, -2, -1, 0, 0, 0]),
    ("T", [1, 0, -2, -1, 0, 0, 0]),
    ("H", [1, 2, -2, -2, 0, 0, 0]),
    ("lm", [0, 0, 0, 0, 0, 0, 1]),
    ("lx", [0, -2, 0, 0, 0, 0, 1]),
    ("Bq", [0, 0, -1, 0, 0, 0, 0]),
    ("Gy", [0, 2, -2, 0, 0, 0, 0]),
    ("Sv", [0, 2, -2, 0, 0, 0, 0]),
    ("kat", [0, 0, -1, 0, 0, 1, 0]),
];

/// A rational number in lowest terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ratio {
    numerator: i32,
    /// Positive.
    denominator: i32,
}

impl Ratio {
    /// Zero.
    pub const ZERO: Ratio = Ratio::whole(0);
    /// One.
    pub const ONE: Ratio = Ratio::whole(1);

    /// A whole number.
    pub const fn whole(value: i32) -> Self {
        Ratio {
            numerator: value,
            denominator: 1,
        }
    }

    /// A fraction; none for a denominator of zero, and where a part is too large.
    pub fn new(numerator: i64, denominator: i64) -> Option<Self> {
        let divisor = gcd(numerator.unsigned_abs(), denominator.unsigned_abs());
        let divisor = i64::try_from(divisor).ok().filter(|_| denominator != 0)?;
        let sign = denominator.signum();
        Some(Ratio {
            numerator: i32::try_from(sign * (numerator / divisor)).ok()?,
            denominator: i32::try_from(sign * (denominator / divisor)).ok()?,
        })
    }

    /// The fraction that a number with few digits stands for: 0.5, 1.25, -2.
    pub fn from_number(value: f64) -> Option<Self> {
        // Powers of ten are tried up to a millionth: what is written as an exponent has few digits.
        let scales = (0..=6).map(|digits| 10_i64.pow(digits));
        let mut scaled = scales.map(|scale| (value * scale as f64, scale));
        let (numerator, scale) =
            scaled.find(|(numerator, _)| (numerator - numerator.round()).abs() < 1e-9)?;
        (numerator.abs() < 1e9).then_some(())?;
        Ratio::new(numerator.round() as i64, scale)
    }

    fn pair(self) -> (i64, i64) {
        (self.numerator.into(), self.denominator.into())
    }

    /// The sum.
    pub fn add(self, other: Self) -> Option<Self> {
        let ((a, b), (c, d)) = (self.pair(), other.pair());
        Ratio::new(a * d + c * b, b * d)
    }

    /// The negative.
    pub fn negate(self) -> Option<Self> {
        Ratio::new(-i64::from(self.numerator), self.denominator.into())
    }

    /// The product.
    pub fn multiply(self, other: Self) -> Option<Self> {
        let ((a, b), (c, d)) = (self.pair(), other.pair());
        Ratio::new(a * c, b * d)
    }

    /// The quotient.
    pub fn divide(self, other: Self) -> Option<Self> {
        let ((a, b), (c, d)) = (self.pair(), other.pair());
        Ratio::new(a * d, b * c)
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a.max(1) } else { gcd(b, a % b) }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.pair() {
            (numerator, 1) => write!(f, "{numerator}"),
            (numerator, denominator) => write!(f, "({numerator}/{denominator})"),
        }
    }
}

/// The bases, in the order in which a unit is written.
const BASES: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];

/// A dimension: an exponent for each base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Dimension([Ratio; BASES.len()]);

/// Names that a dimension is shown by. Where several units have one dimension, the most usual one.
const SHOWN: [&str; 13] = [
    "N", "J", "W", "Pa", "V", "Ohm", "F", "H", "C", "T", "Wb", "S", "lx",
];

impl Dimension {
    /// The dimension of a pure number.
    pub const NUMBER: Dimension = Dimension([Ratio::ZERO; BASES.len()]);
    /// The dimension of time.
    pub const TIME: Dimension = Dimension::of([0, 0, 1, 0, 0, 0, 0]);

    /// The dimension with these exponents, in the order of the bases.
    pub const fn of(exponents: [i32; BASES.len()]) -> Self {
        let mut dimension = Dimension::NUMBER;
        let mut base = 0;
        while base < BASES.len() {
            dimension.0[base] = Ratio::whole(exponents[base]);
            base += 1;
        }
        dimension
    }

    fn with(self, f: impl Fn(usize, Ratio) -> Option<Ratio>) -> Option<Self> {
        let mut result = self;
        for (base, exponent) in result.0.iter_mut().enumerate() {
            *exponent = f(base, *exponent)?;
        }
        Some(result)
    }

    /// The dimension of a coherent unit.
    pub fn named(name: &str) -> Option<Self> {
        let unit = UNITS.iter().find(|(unit, _)| *unit == name);
        unit.map(|(_, exponents)| Dimension::of(*exponents))
    }

    /// The dimension of a product; none where an exponent is too large.
    pub fn multiply(self, other: Self) -> Option<Self> {
        self.with(|base, exponent| exponent.add(other.0[base]))
    }

    /// The dimension of a quotient; none where an exponent is too large.
    pub fn divide(self, other: Self) -> Option<Self> {
        self.with(|base, exponent| exponent.add(other.0[base].negate()?))
    }

    /// The dimension of a power; none where an exponent is too large.
    pub fn power(self, exponent: Ratio) -> Option<Self> {
        self.with(|_, own| own.multiply(exponent))
    }
}

/// `N` where the unit has a name, else powers of the bases: `kg*m/s^3`.
impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Dimension::NUMBER {
            return write!(f, "1");
        }
        let named = |name: &&str| Dimension::named(name) == Some(*self);
        if let Some(name) = SHOWN.into_iter().find(named) {
            return write!(f, "{name}");
        }
        let factor = |base: &str, exponent: Ratio| match exponent {
            Ratio::ONE => base.to_owned(),
            other => format!("{base}^{other}"),
        };
        let all = || BASES.into_iter().zip(self.0);
        let above = all().filter(|(_, exponent)| exponent.numerator > 0);
        let above: Vec<String> = above.map(|(base, n)| factor(base, n)).collect();
        let below = all().filter(|(_, exponent)| exponent.numerator < 0);
        let below: Vec<String> = below
            .map(|(base, n)| factor(base, n.negate().unwrap_or(n)))
            .collect();
        let above = match above.is_empty() {
            true => "1".to_owned(),
            false => above.join("*"),
        };
        match &below[..] {
            [] => write!(f, "{above}"),
            [only] => write!(f, "{above}/{only}"),
            several => write!(f, "{above}/({})", several.join("*")),
        }
    }
}

/// What is known about the unit of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dim {
    /// Nothing: it fits everywhere.
    Unknown,
    /// It is made of numbers alone: pure in products, of any unit beside others.
    Number,
    /// Its dimension.
    Known(Dimension),
}

impl Dim {
    pub const PURE: Dim = Dim::Known(Dimension::NUMBER);

    pub fn of(dimension: Option<Dimension>) -> Dim {
        dimension.map_or(Dim::Unknown, Dim::Known)
    }

    /// The dimension, where it is known and not that of a pure number.
    pub fn unit(self) -> Option<Dimension> {
        match self {
            Dim::Known(dimension) if dimension != Dimension::NUMBER => Some(dimension),
            _ => None,
        }
    }

    pub fn multiply(self, other: Dim) -> Dim {
        match (self, other) {
            (Dim::Unknown, _) | (_, Dim::Unknown) => Dim::Unknown,
            (Dim::Number, other) | (other, Dim::Number) => other,
            (Dim::Known(a), Dim::Known(b)) => Dim::of(a.multiply(b)),
        }
    }

    pub fn divide(self, other: Dim) -> Dim {
        self.multiply(other.power(Ratio::whole(-1)))
    }

    pub fn power(self, exponent: Ratio) -> Dim {
        match self {
            Dim::Known(dimension) => Dim::of(dimension.power(exponent)),
            other => other,
        }
    }
}
