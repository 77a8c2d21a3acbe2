//! Names in expressions: local ones first, then built-in values, then the model's.

use std::collections::BTreeMap;
use std::rc::Rc;

use miette::LabeledSpan;

use super::fields::meaning;
use super::places;
use super::scope::{Meaning, Reported, Value, needs_indices};
use crate::expr::Expr;
use crate::model::errors::foreign;
use crate::model::expressions::Lowering;
use crate::model::expressions::environment::{Lazy, Local};
use crate::model::hir::reserved::{VALUES, did_you_mean, is_function};
use crate::model::units::literal::is_unit;
use crate::model::{ModelError, TargetKind, Tensor};
use crate::source::Span;
use crate::syntax::{self, ExprKind, Index};

#[inline(never)]
pub(crate) fn name<'e>(
    lowering: &mut Lowering<'_, 'e>,
    name: &str,
    span: Span,
) -> Result<Value<'e>, Reported> {
    if let Some(position) = lowering
        .names
        .locals
        .iter()
        .rposition(|local| local.name() == name)
    {
        return local(lowering, position, span);
    }
    match name {
        "pi" => return Ok(Tensor::scalar(lowering.constant(std::f64::consts::PI)).into()),
        "inf" => return Ok(Tensor::scalar(lowering.constant(f64::INFINITY)).into()),
        "true" => return Ok(Value::condition(lowering.constant(1.0))),
        "false" => return Ok(Value::condition(lowering.constant(0.0))),
        "time" => {
            lowering.varies = true;
            return Ok(Tensor::scalar(lowering.names.scope.time).into());
        }
        _ => {}
    }
    let scope = lowering.names.scope;
    match lowering.names.visible(name) {
        Some(Meaning::Value(value, kind)) => {
            lowering.varies |= !matches!(kind, TargetKind::Const);
            Ok(value.clone())
        }
        Some(meaning) => {
            let known = match meaning {
                Meaning::Family { binders, members } => {
                    let indices = binders
                        .iter()
                        .map(|binder| lowering.names.index_value(binder));
                    let indices: Option<Vec<i64>> = indices.collect();
                    indices.and_then(|indices| members.get(&indices))
                }
                _ => None,
            };
            match known {
                Some((value, _)) => Ok(value.clone()),
                None => lowering.refuse(meaning.no_value(name, span)),
            }
        }
        None if scope.forgiving => Err(Reported),
        None if is_function(name) || scope.functions.contains_key(name) => {
            let help = Some(format!("call it: `{name}(..)`"));
            lowering.error(ModelError::NotAValue {
                name: name.to_owned(),
                kind: "function",
                span,
                help,
            })
        }
        None => {
            let of_model = (!lowering.names.in_function).then(|| scope.own_names());
            let of_file = scope.of_file.keys().map(String::as_str);
            let locals = lowering.names.locals.iter().map(Local::name);
            let known = of_model.into_iter().flatten().chain(of_file);
            let known = known.chain(VALUES).chain(locals);
            let help = foreign::value(name).or_else(|| did_you_mean(name, known));
            let as_unit = || {
                let text =
                    format!("as a unit it stands behind a number: `1 {name}`, `x/(1 {name})`");
                is_unit(name).then(|| text.into())
            };
            let help = help.or_else(as_unit);
            lowering.error(ModelError::UnknownName {
                name: name.to_owned(),
                span,
                help,
            })
        }
    }
}

#[inline(never)]
fn local<'e>(
    lowering: &mut Lowering<'_, 'e>,
    position: usize,
    span: Span,
) -> Result<Value<'e>, Reported> {
    let is_fixed = |e: &Expr<'e>| e.as_constant().is_some();
    lowering.varies |= match &lowering.names.locals[position] {
        Local::Value { value, .. } => !value.tensor.data.iter().all(is_fixed),
        Local::Let { .. } => true,
    };
    let (statement, frame) = match &lowering.names.locals[position] {
        Local::Value { value, .. } => return Ok(value.clone()),
        Local::Let {
            statement,
            value,
            frame,
        } => match value {
            Lazy::Done(value) => return Ok(value.clone()),
            Lazy::Failed => return Err(Reported),
            Lazy::Running => {
                let name = statement.name.name.clone();
                let chain = format!("{name} -> .. -> {name}");
                return lowering.error(ModelError::Cycle {
                    what: format!("`{name}`"),
                    chain,
                    span,
                    others: vec![LabeledSpan::new_with_span(
                        Some("while this is computed".to_owned()),
                        statement.name.span,
                    )],
                });
            }
            Lazy::Waiting => (Rc::clone(statement), *frame),
        },
    };
    // Its expression sees what stands around the `let`, not around its use.
    lowering.names.set_lazy(position, Lazy::Running);
    let inner = lowering
        .names
        .locals
        .split_off(frame.min(lowering.names.locals.len()));
    let value = lowering.expr(&statement.value);
    lowering.names.locals.extend(inner);
    lowering.names.set_lazy(
        position,
        value
            .as_ref()
            .map_or(Lazy::Failed, |value| Lazy::Done(value.clone())),
    );
    value
}

/// The value of a name that no loop, function or hook gives another meaning.
fn declared<'a, 'e>(lowering: &Lowering<'a, 'e>, expr: &syntax::Expr) -> Option<&'a Value<'e>> {
    let ExprKind::Name(name) = &expr.kind else {
        return None;
    };
    let hidden = lowering.hook.is_some() || lowering.names.in_function;
    if hidden || lowering.names.is_local(name) {
        return None;
    }
    match lowering.names.visible(name) {
        Some(Meaning::Value(value, _)) => Some(value),
        _ => None,
    }
}

#[inline(never)]
pub(crate) fn index<'e>(
    lowering: &mut Lowering<'_, 'e>,
    base: &syntax::Expr,
    indices: &[Index],
    span: Span,
) -> Result<Value<'e>, Reported> {
    if let Some((name, Meaning::Family { binders, members })) = meaning(lowering, base)? {
        let (value, _) = member(
            lowering,
            name,
            indices,
            members,
            binders.len(),
            "loop",
            span,
        )?;
        return Ok(value.clone());
    }
    // Looked into where it is: a loop over the entries must not copy all of them in every round.
    let computed;
    let value = match declared(lowering, base) {
        Some(value) => value,
        None => {
            computed = lowering.expr(base)?;
            &computed
        }
    };
    let what = format!("`{}`", lowering.names.written().text(base));
    let places = places::select(lowering, value.tensor.shape, indices, &what, span)?;
    let data = places
        .positions
        .iter()
        .map(|&position| value.tensor.data[position])
        .collect();
    Ok(Value {
        tensor: Tensor {
            shape: places.shape,
            data,
        },
        is_condition: value.is_condition,
    })
}

/// One of the things of a name that are declared in a loop, or of an array of parts.
pub(crate) fn member<'m, T>(
    lowering: &mut Lowering<'_, '_>,
    name: &str,
    indices: &[Index],
    members: &'m BTreeMap<Vec<i64>, T>,
    count: usize,
    range: &str,
    span: Span,
) -> Result<&'m T, Reported> {
    if indices.len() != count {
        return lowering.error(needs_indices(name, count, span));
    }
    let mut values = vec![];
    for index in indices {
        match index {
            Index::One(expr) => values.push(lowering.integer(expr, "an index")?),
            _ => return lowering.error(needs_indices(name, count, span)),
        }
    }
    if let Some(member) = members.get(&values) {
        return Ok(member);
    }
    let list = |indices: &[i64]| {
        let indices: Vec<String> = indices.iter().map(i64::to_string).collect();
        indices.join(",")
    };
    let valid = match (members.keys().next(), members.keys().next_back()) {
        (Some(first), Some(last)) if count == 1 => format!("{}..{}", list(first), list(last)),
        (Some(first), Some(last)) => format!("from {} to {}", list(first), list(last)),
        _ => format!("none: its {range} is empty"),
    };
    lowering.error(ModelError::OutOfRange {
        index: list(&values),
        what: format!("`{name}`"),
        valid,
        span,
    })
}
