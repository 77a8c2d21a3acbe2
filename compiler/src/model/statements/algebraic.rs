//! `0 = F;` and `0 <= a perp b >= 0;`, entry by entry.

use super::dynamics::Walk;
use crate::diagnostics::Diagnostics;
use crate::model::expressions::Lowering;
use crate::model::names::scope::Reported;
use crate::model::{Complementarity, DynamicsError, Equation, Model, Shape, Tensor};
use crate::source::Span;
use crate::syntax::Expr;

impl<'e> Walk<'e> {
    pub(crate) fn equation(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        residual: &Expr,
        span: Span,
    ) -> Result<(), Reported> {
        let value = lowering.numbers(residual)?;
        let entries = value.data.into_iter();
        self.found
            .equations
            .extend(entries.map(|residual| Equation { residual, span }));
        Ok(())
    }

    /// Members of one shape; a scalar goes with every entry of the other.
    pub(crate) fn complementarity(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        left: &Expr,
        right: &Expr,
        span: Span,
    ) -> Result<(), Reported> {
        let (a, b) = (lowering.numbers(left), lowering.numbers(right));
        let (a, b): (Tensor<'e>, Tensor<'e>) = (a?, b?);
        let shape = match a.shape {
            Shape::Scalar => b.shape,
            shape => shape,
        };
        let found = b.shape.to_string();
        let expected = shape.to_string();
        let (Some(a), Some(b)) = (a.conform(shape), b.conform(shape)) else {
            let span = right.span;
            return lowering.error(DynamicsError::UnequalMembers {
                expected,
                found,
                span,
            });
        };
        let pairs = a.data.into_iter().zip(b.data);
        self.found
            .complementarities
            .extend(pairs.map(|(a, b)| Complementarity {
                members: [a, b],
                spans: [left.span, right.span],
                span,
            }));
        Ok(())
    }
}

/// Reports algebraic states that are not as many as the equations and complementarities.
pub(crate) fn count(model: &Model<'_>, diags: &mut Diagnostics) {
    let unknowns = model.algebraic_entries().count();
    let rows = model.statements.equations.len() + model.statements.complementarities.len();
    if unknowns == rows || diags.has_errors() {
        return;
    }
    let equations = model
        .statements
        .equations
        .iter()
        .map(|equation| equation.span);
    let pairs = model
        .statements
        .complementarities
        .iter()
        .map(|pair| pair.span);
    let span = match unknowns < rows {
        true => equations.chain(pairs).last(),
        false => model.quantities.algebraics.last().map(|z| z.span),
    };
    diags.push(DynamicsError::UnequalCount {
        unknowns,
        rows,
        span: span.unwrap_or(model.span),
    });
}
