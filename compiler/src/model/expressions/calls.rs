//! Calls: functions of the file are inlined, built-in ones become expressions.

use super::builtins;
use crate::diagnostics::{Help, counted};
use crate::expr::Expr;
use crate::model::errors::foreign;
use crate::model::expressions::Lowering;
use crate::model::expressions::environment::{Environment, Local};
use crate::model::hir::reserved::{did_you_mean, function_names, is_function, is_kept};
use crate::model::names::fields::{meaning, not_in_module};
use crate::model::names::scope::{Callable, Meaning, Reported, Scope, Value};
use crate::model::{ModelError, Tensor};
use crate::source::Span;
use crate::syntax::{self, Arg, Binder, ExprKind};

/// A call with positional arguments.
pub(crate) struct Call<'c> {
    pub name: &'c str,
    pub args: Vec<&'c syntax::Expr>,
    pub span: Span,
}

/// A function of a file, with the names it sees.
type Body<'a, 'e> = (&'a Callable<'e>, &'a Scope<'e>);

/// The value of a call.
#[inline(never)]
pub(crate) fn call<'e>(
    lowering: &mut Lowering<'_, 'e>,
    function: &syntax::Expr,
    args: &[Arg],
    span: Span,
) -> Result<Value<'e>, Reported> {
    let (name, callable) = callee(lowering, function)?;
    if let [Arg::Positional(body, binders)] = args
        && !binders.is_empty()
    {
        return reduction(lowering, name, body, binders, span).map(Value::from);
    }
    let call = positional(lowering, name, args, span)?;
    match callable {
        Some(callable) => inline(lowering, callable, &call),
        None => builtins::builtin(lowering, &call).map(Value::from),
    }
}

/// A function that exists: its name, and its body unless it is built in.
#[inline(never)]
fn callee<'a, 'c, 'e>(
    lowering: &mut Lowering<'a, 'e>,
    function: &'c syntax::Expr,
) -> Result<(&'c str, Option<Body<'a, 'e>>), Reported> {
    let span = function.span;
    if let ExprKind::Field(base, field) = &function.kind
        && let Some((name, module)) = lowering.names.module(base)
    {
        let found = module.functions.get(&field.name);
        return match found.filter(|_| module.declares.contains(&field.name)) {
            Some(callable) => Ok((&field.name, Some((callable, &**module)))),
            None if matches!(module.declared(&field.name), Some(Meaning::Unusable)) => {
                Err(Reported)
            }
            None => not_in_module(lowering, name, module, field),
        };
    }
    let ExprKind::Name(name) = &function.kind else {
        // What stands in a file that could not be imported is unknown.
        if let ExprKind::Field(base, _) = &function.kind
            && let Some((_, Meaning::Unusable)) = meaning(lowering, base)?
        {
            return Err(Reported);
        }
        let name = lowering.names.written().text(function);
        let help = match function.kind {
            ExprKind::Number(_) => Some(per_unit(&name)),
            _ => foreign::function(&name),
        };
        return lowering.error(ModelError::UnknownFunction { name, span, help });
    };
    let scope = lowering.names.scope;
    let visible = lowering.names.visible(name);
    if let Some(Meaning::Unusable) = visible {
        // A value says nothing of a function; only a function of the file may stand behind its name.
        let is_file = matches!(scope.of_file.get(name), Some(Meaning::Unusable));
        let may_be_built_in = is_kept(name) || is_function(name) && !is_file;
        if !may_be_built_in {
            return Err(Reported);
        }
    }
    if let Some(callable) = scope.functions.get(name) {
        let home = callable.home.as_deref().unwrap_or(scope);
        return Ok((name, Some((callable, home))));
    }
    if is_function(name) {
        return Ok((name, None));
    }
    let help = if lowering.names.is_local(name) || visible.is_some() {
        let hint = "is not a function; index it as";
        Some(format!("`{name}` {hint} `{name}[..]`, multiply with `*`").into())
    } else if scope.forgiving {
        return Err(Reported);
    } else {
        let declared = scope.functions.keys().map(String::as_str);
        foreign::function(name).or_else(|| did_you_mean(name, function_names().chain(declared)))
    };
    let name = name.clone();
    lowering.error(ModelError::UnknownFunction { name, span, help })
}

/// What may be meant by a number before parentheses.
fn per_unit(number: &str) -> Help {
    format!("a product has a `*`, as in `{number}*(x + 1)`; a unit without a numerator is a quotient, as in `{number}/(1 h)`").into()
}

/// A call without options and reductions.
#[inline(never)]
fn positional<'c>(
    lowering: &mut Lowering<'_, '_>,
    name: &'c str,
    args: &'c [Arg],
    span: Span,
) -> Result<Call<'c>, Reported> {
    let mut call = Call {
        name,
        args: vec![],
        span,
    };
    for arg in args {
        match arg {
            Arg::Positional(value, binders) if binders.is_empty() => call.args.push(value),
            Arg::Positional(..) => {
                return wrong(lowering, &call, "one `for`", "more arguments beside it");
            }
            Arg::Named(option, _) => {
                let found = format!("an option `{}`", option.name);
                return wrong(lowering, &call, "no options", &found);
            }
        }
    }
    Ok(call)
}

#[inline(never)]
pub(crate) fn wrong<T>(
    lowering: &mut Lowering,
    call: &Call,
    expected: &str,
    found: &str,
) -> Result<T, Reported> {
    lowering.error(ModelError::Arguments {
        function: call.name.to_owned(),
        expected: expected.to_owned(),
        found: found.to_owned(),
        span: call.span,
    })
}

pub(crate) fn arguments(count: usize) -> String {
    match count {
        0 => "no arguments".to_owned(),
        n => counted(n, "argument"),
    }
}

/// The body of a function with its arguments put in.
#[inline(never)]
fn inline<'a, 'e>(
    lowering: &mut Lowering<'a, 'e>,
    (callable, home): Body<'a, 'e>,
    call: &Call,
) -> Result<Value<'e>, Reported> {
    let function = &callable.function;
    if call.args.len() != function.params.len() {
        let (expected, found) = (arguments(function.params.len()), arguments(call.args.len()));
        return wrong(lowering, call, &expected, &found);
    }
    let mut locals = vec![];
    for (param, arg) in function.params.iter().zip(&call.args) {
        let value = lowering.expr(arg)?;
        locals.push(Local::Value {
            name: param.name.clone(),
            value,
            text: lowering.names.whole().text(arg),
        });
    }
    let inside = Environment {
        scope: home,
        locals,
        in_function: true,
    };
    let outside = std::mem::replace(&mut lowering.names, inside);
    let hook = lowering.hook.take();
    let value = lowering.expr(&function.body);
    (lowering.names, lowering.hook) = (outside, hook);
    value
}

/// `sum(expr for i in 1..n)`, `min`, `max`.
#[inline(never)]
fn reduction<'e>(
    lowering: &mut Lowering<'_, 'e>,
    name: &str,
    body: &syntax::Expr,
    binders: &[Binder],
    span: Span,
) -> Result<Tensor<'e>, Reported> {
    if !matches!(name, "sum" | "min" | "max") {
        let call = Call {
            name,
            args: vec![],
            span,
        };
        return wrong(
            lowering,
            &call,
            "no `for`",
            "one; only `sum`, `min` and `max` do",
        );
    }
    let mut values: Vec<Tensor<'e>> = vec![];
    lowering.for_each(binders, span, &mut |lowering| {
        let value = lowering.numbers(body)?;
        if let Some(first) = values.first()
            && first.shape != value.shape
        {
            return lowering.error(ModelError::WrongShape {
                what: "a term".to_owned(),
                expected: first.shape.to_string(),
                found: value.shape.to_string(),
                span: body.span,
                help: None,
            });
        }
        values.push(value);
        Ok(())
    })?;
    let Some(first) = values.first() else {
        return match name {
            "sum" => Ok(Tensor::scalar(lowering.constant(0.0))),
            _ => lowering.error(ModelError::EmptyReduction {
                function: name.to_owned(),
                span,
            }),
        };
    };
    let entry = |position: usize| -> Vec<Expr<'e>> {
        values.iter().map(|value| value.data[position]).collect()
    };
    let data = (0..first.data.len())
        .map(|position| reduce(lowering, name, &entry(position)))
        .collect();
    Ok(Tensor {
        shape: first.shape,
        data,
    })
}

/// Several numbers to one; there is at least one unless they are summed.
pub(crate) fn reduce<'e>(
    lowering: &Lowering<'_, 'e>,
    name: &str,
    entries: &[Expr<'e>],
) -> Expr<'e> {
    match (name, entries) {
        ("min", [_, ..]) => halves(entries, Expr::min),
        ("max", [_, ..]) => halves(entries, Expr::max),
        _ => lowering.names.scope.exprs.sum(entries.iter().copied()),
    }
}

/// Both halves first: then a comparison is nested in few others.
fn halves<'e>(entries: &[Expr<'e>], of: fn(Expr<'e>, Expr<'e>) -> Expr<'e>) -> Expr<'e> {
    match entries {
        [only] => *only,
        _ => {
            let (a, b) = entries.split_at(entries.len().div_ceil(2));
            of(halves(a, of), halves(b, of))
        }
    }
}
