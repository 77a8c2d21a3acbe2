//! Constraints in braces -> scalar comparisons.

use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::expressions::Lowering;
use crate::model::names::scope::{Hook, Reported, Scope};
use crate::model::{ModelError, Shape, Tensor};
use crate::source::Span;
use crate::syntax::{self, Binder, Relation, Row};

/// `a <= b <= c`, one entry of it.
#[derive(Clone, Debug)]
pub struct Comparison<'e> {
    /// a, b, c; at least two.
    pub members: Vec<Expr<'e>>,
    /// What stands between them.
    pub relations: Vec<Relation>,
    /// The row.
    pub span: Span,
}

impl<'e> Scope<'e> {
    /// The comparisons of all rows, entry by entry, loops unrolled; `None` after an error.
    pub fn rows(
        &self,
        rows: &[Row],
        hook: Option<&Hook<'_, 'e>>,
        diags: &mut Diagnostics,
    ) -> Option<Vec<Comparison<'e>>> {
        let mut lowering = Lowering::new(self, hook, diags);
        let mut found = Vec::new();
        all(&mut lowering, rows, &mut found).ok()?;
        Some(found)
    }
}

/// A loop around expressions.
pub type Loop<'s> = (&'s [Binder], Span);

/// One turn of loops: the values of expressions in it.
pub struct Turn<'e> {
    /// The number of the turn of each loop, the outer one first.
    pub turns: Vec<usize>,
    /// Values, with the expressions as they are written.
    pub values: Vec<(String, Tensor<'e>)>,
}

impl<'e> Scope<'e> {
    /// The values of expressions with their texts, once for all indices of the loops around them; `None` after an error.
    pub fn each(
        &self,
        loops: &[Loop<'_>],
        exprs: &[syntax::Expr],
        diags: &mut Diagnostics,
    ) -> Option<Vec<Turn<'e>>> {
        let mut found = Vec::new();
        let mut lowering = Lowering::new(self, None, diags);
        each(&mut lowering, loops, exprs, &mut Vec::new(), &mut found).ok()?;
        Some(found)
    }
}

fn each<'e>(
    lowering: &mut Lowering<'_, 'e>,
    loops: &[Loop<'_>],
    exprs: &[syntax::Expr],
    turns: &mut Vec<usize>,
    found: &mut Vec<Turn<'e>>,
) -> Result<(), Reported> {
    if let [(binders, span), inner @ ..] = loops {
        turns.push(0);
        let result = lowering.for_each(binders, *span, &mut |lowering| {
            let result = each(lowering, inner, exprs, turns, found);
            if let Some(turn) = turns.last_mut() {
                *turn += 1;
            }
            result
        });
        turns.pop();
        return result;
    }
    let values = lowering.all_numbers(exprs.iter())?;
    let texts = exprs.iter().map(|expr| lowering.names.whole().text(expr));
    found.push(Turn {
        turns: turns.clone(),
        values: texts.zip(values).collect(),
    });
    Ok(())
}

/// The comparisons of all rows, added to those found.
pub(crate) fn all<'e>(
    lowering: &mut Lowering<'_, 'e>,
    rows: &[Row],
    found: &mut Vec<Comparison<'e>>,
) -> Result<(), Reported> {
    let mut result = Ok(());
    for row in rows {
        let one = match row {
            Row::Bad(_) => Err(Reported),
            Row::For {
                binders,
                rows,
                span,
            } => lowering.for_each(binders, *span, &mut |lowering| all(lowering, rows, found)),
            Row::Relation { first, rest, span } => {
                let members = std::iter::once(first).chain(rest.iter().map(|(_, member)| member));
                let relations: Vec<Relation> = rest.iter().map(|(relation, _)| *relation).collect();
                relation(lowering, members.collect(), &relations, *span, found)
            }
        };
        result = result.and(one);
    }
    result
}

/// Members of one shape; scalars are compared with every entry.
fn relation<'e>(
    lowering: &mut Lowering<'_, 'e>,
    members: Vec<&syntax::Expr>,
    relations: &[Relation],
    span: Span,
    found: &mut Vec<Comparison<'e>>,
) -> Result<(), Reported> {
    let values = lowering.all_numbers(members.iter().copied())?;
    let mut shapes = values.iter().map(|value| value.shape);
    let shape = shapes
        .find(|shape| *shape != Shape::Scalar)
        .unwrap_or(Shape::Scalar);
    lowering.spend(shape.len().saturating_mul(values.len()), span)?;
    let mut conforming = Vec::with_capacity(values.len());
    for (value, member) in values.into_iter().zip(&members) {
        match value.conform(shape) {
            Some(value) => conforming.push(value),
            None => {
                return lowering.error(ModelError::WrongShape {
                    what: "a side of this row".to_owned(),
                    expected: shape.to_string(),
                    found: value.shape.to_string(),
                    span: member.span,
                    help: None,
                });
            }
        }
    }
    found.extend((0..shape.len()).map(|entry| Comparison {
        members: conforming.iter().map(|value| value.data[entry]).collect(),
        relations: relations.to_vec(),
        span,
    }));
    Ok(())
}
