//! Conditions as numbers in [0, 1], and what chooses by them.

use super::{Lowering, algebra};
use crate::expr::Expr;
use crate::model::names::scope::{Reported, Value};
use crate::model::{ModelError, Tensor};
use crate::source::Span;
use crate::syntax;

#[inline(never)]
pub(crate) fn comprehension<'e>(
    lowering: &mut Lowering<'_, 'e>,
    body: &syntax::Expr,
    binders: &[syntax::Binder],
    span: Span,
) -> Result<Value<'e>, Reported> {
    let mut data = vec![];
    lowering.for_each(binders, span, &mut |lowering| {
        data.push(lowering.scalar(body, "an entry of a comprehension")?);
        Ok(())
    })?;
    Ok(Tensor::vector(data).into())
}

#[inline(never)]
pub(crate) fn negate<'e>(
    lowering: &mut Lowering<'_, 'e>,
    inner: &syntax::Expr,
) -> Result<Value<'e>, Reported> {
    Ok(lowering.numbers(inner)?.map(|entry| -entry).into())
}

#[inline(never)]
pub(crate) fn power<'e>(
    lowering: &mut Lowering<'_, 'e>,
    op: syntax::BinaryOp,
    left: &syntax::Expr,
    right: &syntax::Expr,
) -> Result<Value<'e>, Reported> {
    // Both sides are looked at, so that mistakes in both are reported.
    let (a, b) = (lowering.numbers(left), lowering.numbers(right));
    algebra::binary(lowering, op, (&a?, left.span), (&b?, right.span)).map(Value::from)
}

/// not: 1 - a
#[inline(never)]
pub(crate) fn not<'e>(
    lowering: &mut Lowering<'_, 'e>,
    inner: &syntax::Expr,
) -> Result<Value<'e>, Reported> {
    let inner = lowering.condition(inner)?;
    Ok(Value::condition(1.0 - inner))
}

/// and: Π a
#[inline(never)]
pub(crate) fn and<'e>(
    lowering: &mut Lowering<'_, 'e>,
    members: &[syntax::Expr],
) -> Result<Value<'e>, Reported> {
    let members = conditions(lowering, members)?;
    Ok(Value::condition(
        lowering.names.scope.exprs.product(members),
    ))
}

/// or: 1 - Π (1 - a)
#[inline(never)]
pub(crate) fn or<'e>(
    lowering: &mut Lowering<'_, 'e>,
    members: &[syntax::Expr],
) -> Result<Value<'e>, Reported> {
    let members = conditions(lowering, members)?;
    let none = members.into_iter().map(|member| 1.0 - member);
    Ok(Value::condition(
        1.0 - lowering.names.scope.exprs.product(none),
    ))
}

/// Several conditions; mistakes in all of them are reported.
fn conditions<'e>(
    lowering: &mut Lowering<'_, 'e>,
    members: &[syntax::Expr],
) -> Result<Vec<Expr<'e>>, Reported> {
    let members: Vec<_> = members
        .iter()
        .map(|member| lowering.condition(member))
        .collect();
    members.into_iter().collect()
}

/// `if c then a else b`: b + c (a - b), or one of them when c is constant.
#[inline(never)]
pub(crate) fn choose<'e>(
    lowering: &mut Lowering<'_, 'e>,
    condition: &syntax::Expr,
    a: &syntax::Expr,
    b: &syntax::Expr,
) -> Result<Value<'e>, Reported> {
    let c = lowering.condition(condition)?;
    if let Some(c) = c.as_constant() {
        return lowering.expr(if c > 0.5 { a } else { b });
    }
    let (first, second) = (lowering.expr(a), lowering.expr(b));
    let (first, second) = (first?, second?);
    if first.is_condition != second.is_condition {
        let span = if first.is_condition { a.span } else { b.span };
        return lowering.error(ModelError::BooleanAsNumber { span });
    }
    match first.tensor.zip(&second.tensor, |a, b| b + c * (a - b)) {
        Some(tensor) => {
            lowering.spend(tensor.data.len(), condition.span)?;
            Ok(Value {
                tensor,
                is_condition: first.is_condition,
            })
        }
        None => lowering.error(ModelError::Operands {
            operator: "if".to_owned(),
            left: first.tensor.shape.to_string(),
            right: second.tensor.shape.to_string(),
            left_span: a.span,
            right_span: b.span,
            help: Some("both branches must have one shape".to_owned()),
        }),
    }
}
