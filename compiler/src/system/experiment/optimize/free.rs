//! Reads what an experiment frees: parameters and initial values, within bounds.

use super::super::error::ExperimentError;
use super::super::reader::Reader;
use super::super::with;
use super::Freed;
use crate::expr::Expr;
use crate::model::{self, Domain, Quantity, TargetKind};
use crate::source::Span;
use crate::syntax::{self, Path};

/// An entry that is freed.
pub(super) struct Entry<'e> {
    pub freed: Freed,
    /// Its name with its index, and its symbol.
    pub name: String,
    pub symbol: Expr<'e>,
    /// The bounds that are given where they hold what is free.
    pub moving: Option<[Expr<'e>; 2]>,
}

/// `x[1] free in [0, 1]`, or `k` or `k in [0, 1]` of parameters.
pub(super) fn freed<'e>(
    reader: &mut Reader<'_, 'e>,
    path: &Path,
    domain: Option<&syntax::Domain>,
    is_state: bool,
    earlier: &[Freed],
) -> Option<Vec<Entry<'e>>> {
    let model = reader.model;
    let Some(target) = model.scope.target(path, reader.diags) else {
        reader.failed = true;
        return None;
    };
    let quantity: &Quantity<'e> = match target.kind {
        TargetKind::State(k) if is_state => &model.quantities.states[k],
        TargetKind::Param(k) if !is_state => &model.quantities.params[k],
        kind => {
            reader.error(ExperimentError::NotFree {
                name: with::path_text(model, path, &target),
                kind: kind.word(),
                expected: if is_state { "state" } else { "param" },
                span: path.span,
            });
            return None;
        }
    };
    let given = match domain {
        None => None,
        Some(syntax::Domain::Box(lower, upper)) => {
            let lower = reader.shaped("the lower bound", lower, target.shape)?;
            let upper = reader.shaped("the upper bound", upper, target.shape)?;
            Some((lower, upper))
        }
        Some(syntax::Domain::Set(_)) => {
            reader.no_interval(path.span);
            return None;
        }
    };
    if let (false, Some(Domain::Set(_))) = (is_state, &quantity.domain) {
        reader.no_interval(path.span);
        return None;
    }
    let mut freed: Vec<Entry<'e>> = Vec::new();
    for (place, &entry) in target.entries.iter().enumerate() {
        let var = quantity.vars[entry].as_variable()?;
        if let Some(first) = earlier.iter().find(|known| known.var == var) {
            reader.error(ExperimentError::Twice {
                what: format!("`{}`", model.exprs.name(var)),
                first: first.span,
                second: path.span,
            });
            return None;
        }
        let given = given
            .as_ref()
            .map(|(lower, upper)| [lower[place], upper[place]]);
        freed.push(freed_entry(reader, quantity, entry, given, path.span)?);
    }
    Some(freed)
}

/// An entry of a quantity within its domain and the range that is given, whose ends may depend on what is free.
fn freed_entry<'e>(
    reader: &mut Reader<'_, 'e>,
    quantity: &Quantity<'e>,
    entry: usize,
    given: Option<[Expr<'e>; 2]>,
    span: Span,
) -> Option<Entry<'e>> {
    let symbol = quantity.vars[entry];
    let mut range = Freed {
        var: symbol.as_variable()?,
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        span,
    };
    if let Some(Domain::Box(lower, upper)) = &quantity.domain {
        range = reader.within_ends(range, [lower.data[entry], upper.data[entry]]);
    }
    if let Some(ends) = given {
        range = reader.within_ends(range, ends);
    }
    let Freed { lower, upper, .. } = range;
    if lower > upper {
        reader.error(ExperimentError::NeverHolds {
            why: format!("no number is in [{lower}, {upper}]"),
            span,
        });
        return None;
    }
    let is_moving = |ends: &[Expr<'e>; 2]| reader.values.free.first_in(ends).is_some();
    Some(Entry {
        freed: range,
        name: quantity.shape.entry_name(&quantity.name, entry),
        symbol,
        moving: given.filter(is_moving),
    })
}

impl<'e> Reader<'_, 'e> {
    /// Expressions of parameters in a shape.
    fn shaped(
        &mut self,
        what: &str,
        value: &syntax::Expr,
        shape: model::Shape,
    ) -> Option<Vec<Expr<'e>>> {
        let scope = &self.model.scope;
        let Some(tensor) = scope.expr_as(value, shape, what, None, self.diags) else {
            self.failed = true;
            return None;
        };
        self.guesses(what, &tensor.data, value.span)?;
        Some(tensor.data)
    }

    /// The range cut by two ends, where these are numbers.
    fn within_ends(&self, range: Freed, ends: [Expr<'e>; 2]) -> Freed {
        let number = |e: Expr<'e>| match self.values.free.first_in(&[e]) {
            None => Some(self.values.numbers_of(self.model, &[e]).ok()?[0]),
            Some(_) => None,
        };
        let [lower, upper] = ends.map(number);
        Freed {
            lower: lower.map_or(range.lower, |lower| range.lower.max(lower)),
            upper: upper.map_or(range.upper, |upper| range.upper.min(upper)),
            ..range
        }
    }

    /// That what is freed may have some values only.
    fn no_interval(&mut self, span: Span) {
        self.error(ExperimentError::OutOfRange {
            what: "what is free".to_owned(),
            expected: "in an interval `[lo, hi]`".to_owned(),
            found: "a finite set".to_owned(),
            span,
        });
    }
}
