//! Comparisons -> rows lower <= value <= upper.

use super::super::error::ExperimentError;
use super::super::reader::Reader;
use super::{At, Holds, Penalty, Row};
use crate::expr::Expr;
use crate::model::Comparison;
use crate::syntax::Relation;

/// A comparison of expressions of the model.
pub(crate) struct Constraint<'e> {
    /// When it holds.
    pub at: At,
    pub comparison: Comparison<'e>,
    /// What missing it costs, where it is soft.
    pub penalty: Option<Penalty<'e>>,
}

impl<'e> Reader<'_, 'e> {
    /// `a <= b <= c` as rows: what is known is a bound, and two bounds of one value are one row.
    pub(crate) fn bounded(&mut self, constraints: &[Constraint<'e>]) -> Vec<Row<'e>> {
        let mut rows: Vec<Row<'e>> = Vec::new();
        for constraint in constraints {
            let (first, comparison) = (rows.len(), &constraint.comparison);
            if comparison.relations.contains(&Relation::Perp) {
                rows.extend(pair(self, constraint));
                continue;
            }
            let pairs = comparison.members.windows(2).zip(&comparison.relations);
            for (pair, &relation) in pairs {
                let Some(row) = self.row(pair[0], relation, pair[1], constraint) else {
                    continue;
                };
                let known = rows[first..]
                    .iter_mut()
                    .find(|known| known.value == row.value);
                match known {
                    Some(known) => {
                        known.lower = known.lower.max(row.lower);
                        known.upper = known.upper.min(row.upper);
                    }
                    None => rows.push(row),
                }
            }
            let is_bound = |row: &Row| row.lower.is_finite() || row.upper.is_finite();
            let own = rows.split_off(first);
            let asks = |row: &Row| is_bound(row) || row.lower >= row.upper;
            rows.extend(own.into_iter().filter(asks));
            let is_empty = |row: &&Row| row.lower > row.upper || !is_bound(row);
            if let Some(row) = rows[first..].iter().find(is_empty) {
                let (lower, upper) = (row.lower, row.upper);
                self.error(ExperimentError::NeverHolds {
                    why: format!("it asks for {lower} <= {upper}"),
                    span: comparison.span,
                });
            }
        }
        rows
    }

    fn row(
        &mut self,
        left: Expr<'e>,
        relation: Relation,
        right: Expr<'e>,
        constraint: &Constraint<'e>,
    ) -> Option<Row<'e>> {
        let number = |e: Expr<'e>| -> Option<f64> {
            if self.values.free.first_in(&[e]).is_some() {
                return None;
            }
            Some(self.values.numbers_of(self.model, &[e]).ok()?[0])
        };
        let span = constraint.comparison.span;
        // left - right in [lower, upper]
        let (lower, upper) = match relation {
            Relation::Less | Relation::LessEqual => (f64::NEG_INFINITY, 0.0),
            Relation::Greater | Relation::GreaterEqual => (0.0, f64::INFINITY),
            Relation::Equal | Relation::Perp => (0.0, 0.0),
        };
        let row = |value, lower, upper| {
            Some(Row {
                name: String::new(),
                value,
                lower,
                upper,
                at: constraint.at,
                holds: constraint.penalty.map_or(Holds::Strictly, Holds::Softly),
                span,
            })
        };
        match (number(left), number(right)) {
            (None, Some(right)) => row(left, beside(right, lower), beside(right, upper)),
            (Some(left), None) => row(right, beside(left, -upper), beside(left, -lower)),
            (None, None) => row(left - right, lower, upper),
            (Some(left), Some(right)) => {
                let holds = (lower..=upper).contains(&(left - right));
                if !holds {
                    self.error(ExperimentError::NeverHolds {
                        why: format!("its sides are {left} and {right}, whatever is chosen"),
                        span,
                    });
                }
                None
            }
        }
    }
}

/// number + bound, where an infinite bound is none whatever the number is.
fn beside(number: f64, bound: f64) -> f64 {
    match bound.is_finite() {
        true => number + bound,
        false => bound,
    }
}

/// `0 <= a perp b >= 0`
fn pair<'e>(reader: &mut Reader<'_, 'e>, constraint: &Constraint<'e>) -> Option<Row<'e>> {
    let Constraint {
        at,
        comparison,
        penalty,
    } = constraint;
    let Comparison {
        members,
        relations,
        span,
    } = comparison;
    let is_zero = |e: &Expr<'e>| e.as_constant() == Some(0.0);
    let why = match (&members[..], &relations[..]) {
        ([first, a, b, last], [Relation::LessEqual, Relation::Perp, Relation::GreaterEqual])
            if is_zero(first) && is_zero(last) =>
        {
            match penalty {
                None => {
                    return Some(Row {
                        name: String::new(),
                        value: *a,
                        lower: 0.0,
                        upper: f64::INFINITY,
                        at: *at,
                        holds: Holds::Against(*b),
                        span: *span,
                    });
                }
                Some(_) => "it cannot be soft",
            }
        }
        _ => "its members are not between zeros",
    };
    reader.error(ExperimentError::NotAPair { why, span: *span });
    None
}
