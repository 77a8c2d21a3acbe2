//! Printed forms: one line per block, or one line per row.

use std::fmt;

use super::flat::{Row, Value};
use super::{Bounds, Flat, Kind, Mpcc, Sizes, Span, Variables};
use crate::diagnostics::counted;

/// Definitions, blocks of variables, blocks of rows, sizes.
impl fmt::Display for Mpcc<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for remark in &self.remarks {
            writeln!(f, "// {remark}")?;
        }
        for definition in &self.definitions {
            writeln!(f, "{}:", definition.head)?;
            for line in &definition.lines {
                writeln!(f, "  {line}")?;
            }
        }
        writeln!(f, "variables:")?;
        for block in &self.variables {
            writeln!(f, "  {block}")?;
        }
        for (kind, head) in [
            (Kind::Objective, "minimize the sum of:"),
            (Kind::Steering, "plus, while pairs are relaxed:"),
            (Kind::Equation, "equations:"),
            (Kind::Inequality, "inequalities:"),
            (Kind::Pair, "pairs:"),
            (Kind::Conditional, "equations for some choices of pairs:"),
        ] {
            let mut blocks = self.blocks.iter().filter(|b| b.kind == kind).peekable();
            if blocks.peek().is_some() {
                writeln!(f, "{head}")?;
            }
            for block in blocks {
                let places = ranges(&block.ranges);
                writeln!(f, "  {}{places}: {}", block.name, block.text)?;
            }
        }
        writeln!(f, "// {}", self.sizes())
    }
}

/// `x[k in 1..10, m in 1..2] = (q, 0 <= v <= 1)`
impl fmt::Display for Variables {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let n = self.components.len();
        let components = self.components.iter().enumerate().map(|(i, component)| {
            let bounds: Vec<Bounds> = self.bounds.iter().skip(i).step_by(n).copied().collect();
            bounded(component, &bounds)
        });
        let components: Vec<String> = components.collect();
        let places = ranges(&self.ranges);
        write!(f, "{}{places} = ({})", self.name, components.join(", "))
    }
}

/// A component with bounds that hold at all its places.
fn bounded(name: &str, bounds: &[Bounds]) -> String {
    let same = |side: fn(&Bounds) -> f64| {
        let mut values = bounds.iter().map(side);
        let first = values.next().unwrap_or(f64::NAN);
        values.all(|value| value == first).then_some(first)
    };
    match (same(|b| b.lower), same(|b| b.upper)) {
        (Some(lower), Some(upper)) if lower == upper => format!("{name} = {lower}"),
        (Some(f64::NEG_INFINITY), Some(f64::INFINITY)) => name.to_owned(),
        (Some(lower), Some(f64::INFINITY)) => format!("{name} >= {lower}"),
        (Some(f64::NEG_INFINITY), Some(upper)) => format!("{name} <= {upper}"),
        (Some(lower), Some(upper)) => format!("{lower} <= {name} <= {upper}"),
        _ if bounds.iter().all(|bounds| bounds.is_fixed()) => format!("{name} fixed"),
        _ => format!("{name} with bounds"),
    }
}

/// `[k in 1..10, j in 1..2]`
fn ranges(ranges: &[Span]) -> String {
    if ranges.is_empty() {
        return String::new();
    }
    let ranges = ranges.iter().map(|range| match range.len() {
        1 if range.first == range.last => format!("{} = {}", range.name, range.first),
        _ => format!("{} in {}..{}", range.name, range.first, range.last),
    });
    format!("[{}]", ranges.collect::<Vec<_>>().join(", "))
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({} fixed), {}",
            counted(self.variables, "variable"),
            self.fixed,
            counted(self.equations, "equation"),
        )?;
        match self.inequalities {
            0 => {}
            n => write!(f, ", {}", counted(n, "inequality"))?,
        }
        write!(f, ", {}", counted(self.pairs, "pair"))?;
        match self.conditional {
            0 => Ok(()),
            n => write!(f, ", {} for some choices", counted(n, "row")),
        }
    }
}

/// One row per line.
impl fmt::Display for Flat<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.rows.iter().try_for_each(|row| writeln!(f, "{row}"))
    }
}

impl fmt::Display for Row<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.name)?;
        match self.value {
            Value::Equation(row) => write!(f, "0 = {row}"),
            Value::Pair(a, b) => write!(f, "0 <= {a} perp {b} >= 0"),
            Value::Inequality(lower, row, upper) => match (lower.is_finite(), upper.is_finite()) {
                (true, true) => write!(f, "{lower} <= {row} <= {upper}"),
                (true, false) => write!(f, "{row} >= {lower}"),
                _ => write!(f, "{row} <= {upper}"),
            },
            Value::Conditional(row) => write!(f, "0 = {row} for some choices"),
            Value::Objective(term) => write!(f, "minimize {term}"),
        }
    }
}
