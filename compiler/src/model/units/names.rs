//! Units as they are written, and what is meant by those that are not coherent.

use super::dimension::{Dimension, Ratio, UNITS};
use super::error::UnitError;
use super::literal::is_unit;
use crate::diagnostics::{Applicability, Diagnostics, Help};
use crate::model::hir::reserved::did_you_mean;
use crate::source::Span;
use crate::syntax::{Unit, UnitBase, UnitFactor};

/// Units that are converted into coherent ones.
const OTHERS: [(&str, &str); 33] = [
    ("g", "kg"),
    ("t", "kg"),
    ("lb", "kg"),
    ("min", "s"),
    ("h", "s"),
    ("hr", "s"),
    ("d", "s"),
    ("sec", "s"),
    ("deg", "rad"),
    ("rpm", "rad/s"),
    ("rev", "rad"),
    ("kph", "m/s"),
    ("mph", "m/s"),
    ("inch", "m"),
    ("ft", "m"),
    ("L", "m^3"),
    ("l", "m^3"),
    ("bar", "Pa"),
    ("atm", "Pa"),
    ("psi", "Pa"),
    ("eV", "J"),
    ("Wh", "J"),
    ("kWh", "J"),
    ("cal", "J"),
    ("hp", "W"),
    ("Ah", "C"),
    ("degC", "K"),
    ("lbf", "N"),
    ("percent", "1"),
    ("meter", "m"),
    ("second", "s"),
    ("radian", "rad"),
    ("ohm", "Ohm"),
];

/// Prefixes, longer ones before those that they begin with.
pub(crate) const PREFIXES: [&str; 21] = [
    "da", "Q", "R", "Y", "Z", "E", "P", "T", "G", "M", "k", "h", "d", "c", "m", "µ", "μ", "u", "n",
    "p", "f",
];

/// The coherent unit to be written instead of one with a prefix, or of another system.
fn coherent(name: &str) -> Option<&'static str> {
    let other = |name: &str| OTHERS.iter().find(|(other, _)| *other == name);
    if let Some((_, unit)) = other(name) {
        return Some(unit);
    }
    PREFIXES.iter().find_map(|prefix| {
        let rest = name.strip_prefix(prefix)?;
        let own = UNITS.iter().find(|(unit, _)| *unit == rest);
        own.map(|(unit, _)| *unit)
            .or_else(|| other(rest).map(|(_, unit)| *unit))
    })
}

/// A word that is several coherent units in a row, as their product: `Nm` is `N*m`.
fn product(name: &str) -> Option<String> {
    const MOST: usize = 4;
    fn split(name: &str, most: usize) -> Option<Vec<&str>> {
        if UNITS.iter().any(|(unit, _)| *unit == name) {
            return Some(vec![name]);
        }
        let ends = (1..name.len())
            .rev()
            .filter(|&end| name.is_char_boundary(end));
        ends.filter(|_| most > 1).find_map(|end| {
            let (first, rest) = name.split_at(end);
            let first = UNITS.iter().find(|(unit, _)| *unit == first)?.0;
            let rest = split(rest.trim_start_matches(['.', '·', '-', '_']), most - 1)?;
            Some([vec![first], rest].concat())
        })
    }
    let units = split(name, MOST).filter(|units| units.len() > 1)?;
    Some(units.join("*"))
}

/// The dimension of a unit as it is written; none after an error.
pub(crate) fn read(unit: &Unit, diags: &mut Diagnostics) -> Option<Dimension> {
    let mut all = Some(Dimension::NUMBER);
    for factor in &unit.factors {
        let factor = read_factor(factor, diags);
        all = all
            .zip(factor)
            .and_then(|(all, factor)| all.multiply(factor));
    }
    all
}

fn read_factor(factor: &UnitFactor, diags: &mut Diagnostics) -> Option<Dimension> {
    let base = match &factor.base {
        UnitBase::Name(name) => Dimension::named(&name.name).or_else(|| {
            diags.push(unknown(&name.name, name.span));
            None
        }),
        UnitBase::Number(1.0) => Some(Dimension::NUMBER),
        UnitBase::Number(value) => {
            diags.push(UnitError::UnknownUnit {
                name: value.to_string(),
                span: factor.span,
                help: "`1` stands for a pure number; a factor stands in the number".into(),
            });
            None
        }
        UnitBase::Group(unit) => read(unit, diags),
    };
    let (numerator, denominator) = factor.power.unwrap_or((1.0, 1.0));
    let power = Ratio::from_number(numerator).zip(Ratio::from_number(denominator));
    let power = power.and_then(|(numerator, denominator)| numerator.divide(denominator));
    let sign = Ratio::whole(if factor.divides { -1 } else { 1 });
    let power = power.and_then(|power| power.multiply(sign));
    let result = base?.power(power.unwrap_or(Ratio::ZERO));
    if power.is_none() || result.is_none() {
        diags.push(UnitError::UnitPower { span: factor.span });
    }
    result.filter(|_| power.is_some())
}

fn unknown(name: &str, span: Span) -> UnitError {
    let converted = coherent(name).map(|unit| {
        let number = match is_unit(name) {
            true => format!("a number may have its own, as in `2 {name}`"),
            false => format!("the number is in `{unit}`, too"),
        };
        let text = format!("write `{unit}`; {number}");
        let is_one = unit.chars().all(char::is_alphanumeric);
        // All of it may stand below a `/` or a power.
        let written = if is_one {
            unit.to_owned()
        } else {
            format!("({unit})")
        };
        Help::edit(text, written, Applicability::Suggestion)
    });
    let multiplied = || {
        let product = product(name)?;
        let text = format!("units are multiplied with `*`: write `{product}`");
        // All of them may stand below a `/` or a power.
        let group = format!("({product})");
        Some(Help::edit(text, group, Applicability::Suggestion))
    };
    let close = || did_you_mean(name, UNITS.iter().map(|(name, _)| *name));
    let help = converted.or_else(multiplied).or_else(close);
    UnitError::UnknownUnit {
        name: name.to_owned(),
        span,
        help: help.unwrap_or_else(|| {
            "units are made of kg, m, s, A, K, mol, cd, rad, N, J, W, Pa, V, Ohm, F, H, C, .."
                .into()
        }),
    }
}
