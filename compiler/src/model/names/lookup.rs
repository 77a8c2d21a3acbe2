//! Names in expressions: local ones first, then built-in values, then the model's.

use std::collections::BTreeMap;
use std::rc::Rc;

use miette::LabeledSpan;

use super::places;
use super::scope::{Meaning, Reported, Value, needs_indices};
use crate::expr::Expr;
use crate::model::errors::foreign;
use crate::model::expressions::{Lazy, Local, Lowering};
use crate::model::hir::reserved::{VALUES, did_you_mean, is_function};
use crate::model::{ModelError, TargetKind, Tensor};
use crate::source::Span;
use crate::syntax::{self, ExprKind, Index};

impl<'a, 'e> Lowering<'a, 'e> {
    #[inline(never)]
    pub fn name(&mut self, name: &str, span: Span) -> Result<Value<'e>, Reported> {
        if let Some(position) = self.locals.iter().rposition(|local| local.name() == name) {
            return self.local(position, span);
        }
        match name {
            "pi" => return Ok(Tensor::scalar(self.constant(std::f64::consts::PI)).into()),
            "inf" => return Ok(Tensor::scalar(self.constant(f64::INFINITY)).into()),
            "true" => return Ok(Value::condition(self.constant(1.0))),
            "false" => return Ok(Value::condition(self.constant(0.0))),
            "time" => {
                self.varies = true;
                return Ok(Tensor::scalar(self.scope.time).into());
            }
            _ => {}
        }
        let scope = self.scope;
        match self.visible(name) {
            Some(Meaning::Value(value, kind)) => {
                self.varies |= !matches!(kind, TargetKind::Const);
                Ok(value.clone())
            }
            Some(meaning) => {
                let known = match meaning {
                    Meaning::Family { binders, members } => {
                        let indices = binders.iter().map(|binder| self.index_value(binder));
                        let indices: Option<Vec<i64>> = indices.collect();
                        indices.and_then(|indices| members.get(&indices))
                    }
                    _ => None,
                };
                match known {
                    Some((value, _)) => Ok(value.clone()),
                    None => self.refuse(meaning.no_value(name, span)),
                }
            }
            None if scope.forgiving => Err(Reported),
            None if is_function(name) || scope.functions.contains_key(name) => {
                let help = Some(format!("call it: `{name}(..)`"));
                self.error(ModelError::NotAValue {
                    name: name.to_owned(),
                    kind: "function",
                    span,
                    help,
                })
            }
            None => {
                let of_model = (!self.in_function).then(|| scope.own_names());
                let of_file = scope.of_file.keys().map(String::as_str);
                let locals = self.locals.iter().map(Local::name);
                let known = of_model.into_iter().flatten().chain(of_file);
                let known = known.chain(VALUES).chain(locals);
                let help = foreign::value(name).or_else(|| did_you_mean(name, known));
                self.error(ModelError::UnknownName {
                    name: name.to_owned(),
                    span,
                    help,
                })
            }
        }
    }

    /// What a name means that is not local, to the model or in a function.
    pub fn visible(&self, name: &str) -> Option<&'a Meaning<'e>> {
        match self.in_function {
            true => self.scope.of_file.get(name),
            false => self.scope.get(name),
        }
    }

    /// The current value of a loop index.
    pub fn index_value(&self, binder: &str) -> Option<i64> {
        self.locals.iter().rev().find_map(|local| match local {
            Local::Value { name, value, .. } if name == binder => value
                .tensor
                .as_scalar()?
                .as_constant()
                .map(|value| value as i64),
            _ => None,
        })
    }

    #[inline(never)]
    fn local(&mut self, position: usize, span: Span) -> Result<Value<'e>, Reported> {
        let is_fixed = |e: &Expr<'e>| e.as_constant().is_some();
        self.varies |= match &self.locals[position] {
            Local::Value { value, .. } => !value.tensor.data.iter().all(is_fixed),
            Local::Let { .. } => true,
        };
        let (statement, frame) = match &self.locals[position] {
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
                    return self.error(ModelError::Cycle {
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
        self.set_lazy(position, Lazy::Running);
        let inner = self.locals.split_off(frame.min(self.locals.len()));
        let value = self.expr(&statement.value);
        self.locals.extend(inner);
        self.set_lazy(
            position,
            value
                .as_ref()
                .map_or(Lazy::Failed, |value| Lazy::Done(value.clone())),
        );
        value
    }

    fn set_lazy(&mut self, position: usize, lazy: Lazy<'e>) {
        if let Some(Local::Let { value, .. }) = self.locals.get_mut(position) {
            *value = lazy;
        }
    }

    /// The value of a name that no loop, function or hook gives another meaning.
    fn declared(&self, expr: &syntax::Expr) -> Option<&'a Value<'e>> {
        let ExprKind::Name(name) = &expr.kind else {
            return None;
        };
        let hidden = self.hook.is_some() || self.in_function;
        if hidden || self.is_local(name) {
            return None;
        }
        match self.visible(name) {
            Some(Meaning::Value(value, _)) => Some(value),
            _ => None,
        }
    }

    #[inline(never)]
    pub fn index(
        &mut self,
        base: &syntax::Expr,
        indices: &[Index],
        span: Span,
    ) -> Result<Value<'e>, Reported> {
        if let Some((name, Meaning::Family { binders, members })) = self.meaning(base)? {
            let (value, _) = self.member(name, indices, members, binders.len(), "loop", span)?;
            return Ok(value.clone());
        }
        // Looked into where it is: a loop over the entries must not copy all of them in every round.
        let computed;
        let value = match self.declared(base) {
            Some(value) => value,
            None => {
                computed = self.expr(base)?;
                &computed
            }
        };
        let what = format!("`{}`", self.written().text(base));
        let places = places::select(self, value.tensor.shape, indices, &what, span)?;
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
    pub fn member<'m, T>(
        &mut self,
        name: &str,
        indices: &[Index],
        members: &'m BTreeMap<Vec<i64>, T>,
        count: usize,
        range: &str,
        span: Span,
    ) -> Result<&'m T, Reported> {
        if indices.len() != count {
            return self.error(needs_indices(name, count, span));
        }
        let mut values = vec![];
        for index in indices {
            match index {
                Index::One(expr) => values.push(self.integer(expr, "an index")?),
                _ => return self.error(needs_indices(name, count, span)),
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
        self.error(ModelError::OutOfRange {
            index: list(&values),
            what: format!("`{name}`"),
            valid,
            span,
        })
    }
}
