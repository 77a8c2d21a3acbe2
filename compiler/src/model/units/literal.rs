//! Numbers with units, `20 kHz`, as numbers of coherent units: 2e4 Hz.
//!
//! A unit is f·10ⁿ coherent ones. Powers of ten are shifts of the decimal point, so that `3 ms` is the number `3e-3`.

use std::f64::consts::PI;

use super::dimension::{Dimension, Ratio, UNITS};
use super::names::PREFIXES;
use crate::syntax::{Unit, UnitBase, UnitFactor};

/// Units that are not coherent, with n, f and the coherent one.
const CONVERTED: [(&str, i32, f64, &str); 10] = [
    ("g", -3, 1.0, "kg"),
    ("min", 0, 60.0, "s"),
    ("h", 0, 3600.0, "s"),
    ("d", 0, 86_400.0, "s"),
    ("deg", 0, PI / 180.0, "rad"),
    ("rev", 0, 2.0 * PI, "rad"),
    ("rpm", 0, PI / 30.0, "Hz"),
    ("L", -3, 1.0, "m"),
    ("l", -3, 1.0, "m"),
    ("bar", 5, 1.0, "Pa"),
];

/// The powers of ten that prefixes stand for, in the order of [`PREFIXES`].
const POWERS: [i32; PREFIXES.len()] = [
    1, 30, 27, 24, 21, 18, 15, 12, 9, 6, 3, 2, -1, -2, -3, -6, -6, -6, -9, -12, -15,
];

/// A unit as f·10ⁿ coherent ones.
#[derive(Clone, Copy)]
struct Scale {
    n: f64,
    f: f64,
    dimension: Dimension,
}

/// Whether a word behind a number is a unit.
pub(crate) fn is_unit(name: &str) -> bool {
    Scale::named(name).is_some()
}

impl Scale {
    const ONE: Scale = Scale {
        n: 0.0,
        f: 1.0,
        dimension: Dimension::NUMBER,
    };

    /// The unit of a word.
    fn named(name: &str) -> Option<Self> {
        if let Some(dimension) = Dimension::named(name) {
            return Some(Scale {
                dimension,
                ..Scale::ONE
            });
        }
        if let Some(&(_, n, f, coherent)) = CONVERTED.iter().find(|unit| unit.0 == name) {
            let dimension = Dimension::named(coherent)?;
            let dimension = match name {
                "L" | "l" => dimension.power(Ratio::whole(3))?,
                _ => dimension,
            };
            let n = f64::from(n);
            return Some(Scale { n, f, dimension });
        }
        let prefixes = PREFIXES.iter().zip(POWERS);
        let mut prefixed = prefixes.filter_map(|(prefix, n)| {
            let unit = name.strip_prefix(prefix)?;
            let is_unit = UNITS.iter().any(|(known, _)| *known == unit) && unit != "kg";
            let may_follow = is_unit || matches!(unit, "g" | "L" | "l" | "bar");
            let scale = may_follow.then(|| Scale::named(unit))??;
            Some(Scale {
                n: scale.n + f64::from(n),
                ..scale
            })
        });
        prefixed.next()
    }

    fn of(unit: &Unit) -> Option<Self> {
        let mut all = Scale::ONE;
        for factor in &unit.factors {
            let one = Scale::factor(factor)?;
            all = Scale {
                n: all.n + one.n,
                f: all.f * one.f,
                dimension: all.dimension.multiply(one.dimension)?,
            };
        }
        Some(all)
    }

    fn factor(factor: &UnitFactor) -> Option<Self> {
        let base = match &factor.base {
            UnitBase::Name(name) => Scale::named(&name.name)?,
            UnitBase::Number(_) => return None,
            UnitBase::Group(unit) => Scale::of(unit)?,
        };
        let (above, below) = factor.power.unwrap_or((1.0, 1.0));
        let sign = if factor.divides { -1.0 } else { 1.0 };
        let (ratio, power) = (Ratio::from_number(sign * above), sign * above / below);
        Some(Scale {
            n: power * base.n,
            f: base.f.powf(power),
            dimension: base
                .dimension
                .power(ratio?.divide(Ratio::from_number(below)?)?)?,
        })
    }
}

/// The dimension of a unit behind a number; none where a power is too large.
pub(crate) fn dimension(unit: &Unit) -> Option<Dimension> {
    Scale::of(unit).map(|scale| scale.dimension)
}

/// The number of coherent units that so many of a unit are; none where a power is too large.
pub(crate) fn value(number: f64, unit: &Unit) -> Option<f64> {
    let scale = Scale::of(unit)?;
    if scale.n.fract() != 0.0 {
        return Some(number * scale.f * 10_f64.powf(scale.n));
    }
    let text = format!("{number:e}");
    let (digits, exponent) = text.split_once('e')?;
    let exponent = exponent.parse::<i32>().ok()? + scale.n as i32;
    let shifted: f64 = format!("{digits}e{exponent}").parse().ok()?;
    Some(shifted * scale.f)
}

/// The words of a unit behind a number that may be values, too: none where it stands in parentheses.
pub(crate) fn words(unit: &Unit) -> Vec<&str> {
    match &unit.factors[..] {
        [only] if matches!(only.base, UnitBase::Group(_)) => vec![],
        factors => factors.iter().flat_map(all).collect(),
    }
}

fn all(factor: &UnitFactor) -> Vec<&str> {
    match &factor.base {
        UnitBase::Name(name) => vec![&name.name],
        UnitBase::Number(_) => vec![],
        UnitBase::Group(unit) => unit.factors.iter().flat_map(all).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::{POWERS, Scale};
    use crate::model::units::names::PREFIXES;

    #[test]
    fn prefixes_are_powers_of_ten() {
        let known = |name: &str| Scale::named(name).map(|scale| scale.n as i32);
        let cases = [
            ("kHz", 3),
            ("mm", -3),
            ("dam", 1),
            ("dm", -1),
            ("kg", 0),
            ("mg", -6),
            ("hPa", 2),
            ("µs", -6),
            ("mbar", 2),
            ("mL", -6),
            ("pF", -12),
            ("GOhm", 9),
            ("min", 0),
            ("mol", 0),
        ];
        for (name, n) in cases {
            assert_eq!(known(name), Some(n), "{name}");
        }
        for name in ["kkg", "mmin", "x", "kh", "Q", "mdeg"] {
            assert_eq!(known(name), None, "{name}");
        }
        assert_eq!(PREFIXES.len(), POWERS.len());
    }
}
