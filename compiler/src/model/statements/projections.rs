//! `project x onto { c >= 0; } metric E;`
//!
//! Rows become constraints c ≥ 0, one per comparison; what they do to the rates is decided when they are lowered.

use super::dynamics::Walk;
use crate::expr::Expr;
use crate::model::expressions::rows::Comparison;
use crate::model::expressions::{Lowering, rows};
use crate::model::names::scope::Reported;
use crate::model::{Constraint, DynamicsError, Projection, Shape};
use crate::source::Span;
use crate::syntax::{self, Relation};

/// Entries of E that differ by less than this, relative to the largest, are the same.
const SYMMETRIC: f64 = 1e-12;

impl<'e> Walk<'e> {
    /// One projection, with everything in it looked at.
    pub(crate) fn project(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        project: &syntax::Project,
    ) -> Result<(), Reported> {
        let state = self.states(lowering, &project.state);
        let mut comparisons = Vec::new();
        let rows = rows::all(lowering, &project.rows, &mut comparisons);
        let (state, ()) = (state?, rows?);
        let n = state.entries.len();
        let metric = match &project.metric {
            None => None,
            Some(metric) => Some(square(lowering, metric, n)?),
        };
        let mut constraints = Vec::new();
        for comparison in &comparisons {
            constraints.extend(halves(lowering, comparison)?);
        }
        let first = self.offset(&state);
        self.found.projections.push(Projection {
            entries: state.entries.iter().map(|&entry| first + entry).collect(),
            constraints,
            metric,
            span: project.span,
        });
        Ok(())
    }
}

/// E, row by row; a number is that times the identity.
fn square<'e>(
    lowering: &mut Lowering<'_, 'e>,
    metric: &syntax::Expr,
    n: usize,
) -> Result<Vec<Expr<'e>>, Reported> {
    let value = lowering.numbers(metric)?;
    let wrong = |lowering: &mut Lowering<'_, 'e>, what: String| {
        lowering.error(DynamicsError::ProjectionForm {
            what,
            span: metric.span,
        })
    };
    let zero = lowering.constant(0.0);
    let entries = match value.as_scalar() {
        Some(scale) => {
            let entry = |k: usize| if k / n == k % n { scale } else { zero };
            (0..n * n).map(entry).collect()
        }
        None if value.shape == Shape::Matrix(n, n) => value.data,
        None => {
            let what = format!("`metric` is {}, not a matrix of {n} by {n}", value.shape);
            return wrong(lowering, what);
        }
    };
    let number = |k: usize| entries[k].as_constant();
    let size = (0..n * n)
        .filter_map(number)
        .fold(0.0_f64, |s, e| s.max(e.abs()));
    let differs = |(a, b): (f64, f64)| (a - b).abs() > SYMMETRIC * size;
    let mirrored = |k: usize| (k % n) * n + k / n;
    if (0..n * n).any(|k| number(k).zip(number(mirrored(k))).is_some_and(differs)) {
        return wrong(lowering, "`metric` is not symmetric".to_owned());
    }
    if (0..n).any(|i| number(i * n + i).is_some_and(|entry| entry < 0.0)) {
        let what = "`metric` has a negative entry on its diagonal".to_owned();
        return wrong(lowering, what);
    }
    Ok(entries)
}

/// c ≥ 0 of every relation in a row: of a ≤ b it is b - a.
fn halves<'e>(
    lowering: &mut Lowering<'_, 'e>,
    comparison: &Comparison<'e>,
) -> Result<Vec<Constraint<'e>>, Reported> {
    let span: Span = comparison.span;
    let mut found = Vec::new();
    for (pair, relation) in comparison.members.windows(2).zip(&comparison.relations) {
        let c = match relation {
            Relation::GreaterEqual | Relation::Greater => pair[0] - pair[1],
            Relation::LessEqual | Relation::Less => pair[1] - pair[0],
            Relation::Equal => {
                let what = "a row is an equation: a set has `>=` and `<=`".to_owned();
                return lowering.error(DynamicsError::ProjectionForm { what, span });
            }
            Relation::Perp => {
                let what = "a row is a complementarity: a set has `>=` and `<=`".to_owned();
                return lowering.error(DynamicsError::ProjectionForm { what, span });
            }
        };
        if let Some(value) = c.as_constant() {
            return lowering.error(DynamicsError::ConstantComparison {
                value: value >= 0.0,
                span,
            });
        }
        found.push(Constraint { c, span });
    }
    Ok(found)
}
