//! Built-in functions.

use super::calls::{Call, arguments, reduce, wrong};
use super::periodic::rounding;
use super::{algebra, check};
use crate::expr::{BinaryFunction, Expr, Function};
use crate::model::expressions::Lowering;
use crate::model::hir::reserved::arity;
use crate::model::names::scope::Reported;
use crate::model::{ModelError, Shape, TableError, Tensor};
use crate::source::Span;

/// The value of a call of a built-in function.
#[inline(never)]
pub(crate) fn builtin<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
) -> Result<Tensor<'e>, Reported> {
    check_arity(lowering, call)?;
    if matches!(call.name, "eye" | "zeros" | "ones") {
        return filled(lowering, call);
    }
    let varied = std::mem::replace(&mut lowering.varies, false);
    let mut values = lowering.all_numbers(call.args.iter().copied())?;
    if matches!(call.name, "sign" | "step" | "abs" | "cbrt") {
        values[0] = values[0].map(Expr::cancelled);
    }
    if matches!(call.name, "sign" | "step") {
        check::record_zeros(lowering, call.args[0], &values[0]);
    }
    lowering.varies |= varied;
    apply(lowering, call, &values)
}

#[inline(never)]
fn check_arity(lowering: &mut Lowering<'_, '_>, call: &Call) -> Result<(), Reported> {
    if call.name == "table" {
        return lowering.error(TableError::Form {
            what: "`table` stands alone as the value of a `signal`".to_owned(),
            span: call.span,
            why: "in another place",
            help: "give the table a name with `signal r = table(..);`, and use `r`".into(),
        });
    }
    let (least, most) = arity(call.name);
    let count = call.args.len();
    if count < least || count > most || (call.name == "sat" && count == 2) {
        let expected = match call.name {
            "sat" => "1 or 3 arguments".to_owned(),
            "clamp" => "a value and 2 bounds".to_owned(),
            "sawtooth" | "triangle" => "a time and a period".to_owned(),
            "pulse" => "a time, a period and a duty".to_owned(),
            "min" | "max" => "at least 1 argument".to_owned(),
            _ if least < most => format!("{least} or {most} arguments"),
            _ => arguments(least),
        };
        return wrong(lowering, call, &expected, &arguments(count));
    }
    Ok(())
}

/// A function of values; their number is right.
#[inline(never)]
fn apply<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
) -> Result<Tensor<'e>, Reported> {
    let first = values[0].clone();
    lowering.spend(first.data.len(), call.span)?;
    if matches!(
        call.name,
        "floor" | "ceil" | "round" | "frac" | "mod" | "pulse" | "sawtooth" | "triangle"
    ) {
        return rounding(lowering, call, values);
    }
    if let Some(function) = Function::of_name(call.name) {
        if function.is_nonsmooth() {
            check::record_surfaces(lowering, call.args[0], &first);
        }
        return Ok(first.map(|entry| entry.apply(function)));
    }
    match call.name {
        "min" | "max" if values.len() == 1 => match first.data.is_empty() {
            true => lowering.error(ModelError::EmptyReduction {
                function: call.name.to_owned(),
                span: call.span,
            }),
            false => Ok(Tensor::scalar(reduce(lowering, call.name, &first.data))),
        },
        "min" | "max" => {
            for (position, arg) in call.args.iter().enumerate() {
                // `max(0, x)` switches where x does.
                if values.len() == 2 && arg.is_zero() {
                    check::record_surfaces(
                        lowering,
                        call.args[1 - position],
                        &values[1 - position],
                    );
                }
            }
            if let ([a, b], [left, right]) = (&call.args[..], values)
                && let ([x], [y]) = (&left.data[..], &right.data[..])
                && !a.is_zero()
            {
                check::record_pair(lowering, (*a, *x), (*b, *y));
            }
            let function = if call.name == "min" {
                BinaryFunction::Min
            } else {
                BinaryFunction::Max
            };
            fold(lowering, call, values, function)
        }
        "cbrt" | "log2" | "log10" | "exp2" | "hypot" => composed(lowering, call, values),
        "atan2" => fold(lowering, call, values, BinaryFunction::Atan2),
        "sat" | "clamp" => clamp(lowering, call, values),
        "deadzone" => dead_zone(lowering, call, values),
        "sum" => Ok(Tensor::scalar(
            lowering.names.scope.exprs.sum(first.data.iter().copied()),
        )),
        "len" => length(lowering, call, &first),
        _ => of_arrays(lowering, call, &first, &values[1..]),
    }
}

/// A value between bounds, -1 and 1 where none are given.
fn clamp<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
) -> Result<Tensor<'e>, Reported> {
    let one = |sign: f64| Tensor::scalar(lowering.constant(sign));
    let (lo, hi) = match values.get(1..) {
        Some([lo, hi]) => (lo.clone(), hi.clone()),
        _ => (one(-1.0), one(1.0)),
    };
    if let ([x], [lo], [hi]) = (&values[0].data[..], &lo.data[..], &hi.data[..]) {
        for (k, bound) in [*lo, *hi].into_iter().enumerate() {
            let written = call.args.get(k + 1).map(|arg| (*arg, 1.0));
            check::record_bound(lowering, (call.args[0], *x), bound, written);
        }
    }
    clip(lowering, call, values[0].clone(), lo, hi)
}

/// x - sat(x, -w, w) with a width w, 1 where none is given.
fn dead_zone<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
) -> Result<Tensor<'e>, Reported> {
    let first = &values[0];
    let one = || Tensor::scalar(lowering.constant(1.0));
    let width = values.get(1).cloned().unwrap_or_else(one);
    if let ([x], [width]) = (&first.data[..], &width.data[..]) {
        for sign in [-1.0, 1.0] {
            let written = call.args.get(1).map(|arg| (*arg, sign));
            check::record_bound(lowering, (call.args[0], *x), sign * *width, written);
        }
    }
    let clipped = clip(lowering, call, first.clone(), width.map(|w| -w), width)?;
    first.zip(&clipped, |x, c| x - c).ok_or(Reported)
}

/// Functions of numbers that are made of others.
fn composed<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
) -> Result<Tensor<'e>, Reported> {
    let first = &values[0];
    match call.name {
        "log2" => Ok(first.map(|x| logarithm(x, 2.0, f64::log2))),
        "log10" => Ok(first.map(|x| logarithm(x, 10.0, f64::log10))),
        "exp2" => {
            let two = lowering.constant(2.0);
            Ok(first.map(|x| match x.as_constant() {
                Some(value) => x.exprs().constant(value.exp2()),
                None => two.powf(x),
            }))
        }
        "hypot" => fold_with(lowering, call, values, |x, y| {
            (x.powi(2) + y.powi(2)).sqrt()
        }),
        _ => {
            check::record_surfaces(lowering, call.args[0], first);
            Ok(first.map(cube_root))
        }
    }
}

/// log(x)/log(b), unless x is a number.
fn logarithm(x: Expr, base: f64, number: fn(f64) -> f64) -> Expr {
    match x.as_constant() {
        Some(value) => x.exprs().constant(number(value)),
        None => x.log() / x.exprs().constant(base.ln()),
    }
}

/// max(x, 0)^(1/3) - max(-x, 0)^(1/3): a root with a kink at zero, unless x is a number.
fn cube_root<'e>(x: Expr<'e>) -> Expr<'e> {
    let number = |value| x.exprs().constant(value);
    let root = |side: Expr<'e>| side.max(number(0.0)).powf(number(1.0 / 3.0));
    match x.as_constant() {
        Some(value) => number(value.cbrt()),
        None => root(x) - root(-x),
    }
}

/// Functions of vectors and matrices.
fn of_arrays<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    first: &Tensor<'e>,
    others: &[Tensor<'e>],
) -> Result<Tensor<'e>, Reported> {
    match call.name {
        "transpose" => Ok(first.transpose()),
        "norm" => norm(lowering, call, first),
        "dot" => match vectors(first, &others[0]) {
            true => Ok(Tensor::scalar(
                lowering.names.scope.exprs.dot(&first.data, &others[0].data),
            )),
            false => mismatch(lowering, call, first, &others[0]),
        },
        "cross" => match vectors(first, &others[0]) && first.data.len() == 3 {
            true => {
                let (a, b) = (&first.data, &others[0].data);
                let entry = |i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
                Ok(Tensor::vector(vec![entry(1, 2), entry(2, 0), entry(0, 1)]))
            }
            false => mismatch(lowering, call, first, &others[0]),
        },
        "diag" => diagonal(lowering, first, call.span),
        "inv" => algebra::inverse(lowering, first, call.span),
        "solve" => algebra::solve(lowering, first, &others[0], call.span),
        "grad" | "jacobian" => derivative(lowering, call, first, &others[0]),
        _ => {
            let (name, span) = (call.name.to_owned(), call.span);
            lowering.error(ModelError::UnknownFunction {
                name,
                span,
                help: None,
            })
        }
    }
}

/// The number of entries of a vector.
fn length<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    first: &Tensor<'e>,
) -> Result<Tensor<'e>, Reported> {
    let count = match first.shape {
        Shape::Matrix(rows, columns) if rows > 1 => {
            let what = "the argument of `len`".to_owned();
            return lowering.error(ModelError::WrongShape {
                what,
                expected: "a vector".to_owned(),
                found: format!("a {rows} by {columns} matrix"),
                span: call.args[0].span,
                help: None,
            });
        }
        shape => shape.len(),
    };
    Ok(Tensor::scalar(lowering.constant(count as f64)))
}

/// The Euclidean norm of a vector.
fn norm<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    first: &Tensor<'e>,
) -> Result<Tensor<'e>, Reported> {
    if let Shape::Matrix(rows, columns) = first.shape
        && rows > 1
    {
        return wrong(
            lowering,
            call,
            "a vector",
            &format!("a {rows} by {columns} matrix"),
        );
    }
    if first.shape == Shape::Scalar {
        check::record_surfaces(lowering, call.args[0], first);
        return Ok(first.map(Expr::abs));
    }
    let squares = first.data.iter().map(|entry| entry.powi(2));
    Ok(Tensor::scalar(
        lowering.names.scope.exprs.sum(squares).sqrt(),
    ))
}

/// True for two vectors (columns or rows) of one length.
fn vectors(a: &Tensor, b: &Tensor) -> bool {
    let is_vector = |shape: Shape| matches!(shape, Shape::Vector(_) | Shape::Matrix(1, _));
    is_vector(a.shape) && is_vector(b.shape) && a.data.len() == b.data.len()
}

fn mismatch<T>(
    lowering: &mut Lowering,
    call: &Call,
    a: &Tensor,
    b: &Tensor,
) -> Result<T, Reported> {
    lowering.error(ModelError::Operands {
        operator: call.name.to_owned(),
        left: a.shape.to_string(),
        right: b.shape.to_string(),
        left_span: call.args.first().map_or(call.span, |arg| arg.span),
        right_span: call.args.get(1).map_or(call.span, |arg| arg.span),
        help: match call.name {
            "dot" => Some("`dot` takes two vectors of one length".to_owned()),
            "cross" => Some("`cross` takes two vectors of 3".to_owned()),
            _ => None,
        },
    })
}

/// x kept between two bounds, as lo + max(x - lo, 0) - max(x - hi, 0): two kinks side by side
/// instead of one inside the other.
fn clip<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call<'_>,
    x: Tensor<'e>,
    lo: Tensor<'e>,
    hi: Tensor<'e>,
) -> Result<Tensor<'e>, Reported> {
    let is_number = |value: &Tensor<'e>| value.data.iter().all(|e| e.as_constant().is_some());
    if [&x, &lo, &hi].into_iter().all(is_number) {
        let raised = fold(lowering, call, &[x, lo], BinaryFunction::Max)?;
        return fold(lowering, call, &[raised, hi], BinaryFunction::Min);
    }
    let zero = lowering.constant(0.0);
    let is_infinite = |bound: Expr<'e>| bound.as_constant().is_some_and(f64::is_infinite);
    let raised = fold_with(lowering, call, &[x.clone(), lo], |x, lo| {
        if is_infinite(lo) {
            x
        } else {
            lo + (x - lo).max(zero)
        }
    })?;
    let excess = fold_with(lowering, call, &[x, hi], |x, hi| {
        if is_infinite(hi) {
            zero
        } else {
            (x - hi).max(zero)
        }
    })?;
    fold_with(lowering, call, &[raised, excess], |a, b| a - b)
}

/// `f(f(a, b), c)`, entry by entry.
fn fold<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
    function: BinaryFunction,
) -> Result<Tensor<'e>, Reported> {
    fold_with(lowering, call, values, |a, b| a.apply_binary(function, b))
}

pub(crate) fn fold_with<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    values: &[Tensor<'e>],
    f: impl Fn(Expr<'e>, Expr<'e>) -> Expr<'e>,
) -> Result<Tensor<'e>, Reported> {
    let mut result = values[0].clone();
    for value in &values[1..] {
        result = match result.zip(value, &f) {
            Some(next) => next,
            None => return mismatch(lowering, call, &result, value),
        };
        lowering.spend(result.data.len(), call.span)?;
    }
    Ok(result)
}

/// `eye(n)`, `zeros(n)`, `zeros(m, n)`, `ones`.
#[inline(never)]
fn filled<'e>(lowering: &mut Lowering<'_, 'e>, call: &Call) -> Result<Tensor<'e>, Reported> {
    let mut sizes = vec![];
    for arg in &call.args {
        sizes.push(lowering.size(arg, "a size")?);
    }
    let shape = match sizes[..] {
        [n] if call.name == "eye" => Shape::matrix(n, n),
        [n] => Shape::Vector(n),
        [m, n] => Shape::matrix(m, n),
        _ => Shape::Scalar,
    };
    lowering.spend(shape.len(), call.span)?;
    let (zero, one) = (lowering.constant(0.0), lowering.constant(1.0));
    let columns = shape.size().1;
    let entry = |position: usize| match call.name {
        "zeros" => zero,
        "ones" => one,
        _ if position / columns == position % columns => one,
        _ => zero,
    };
    Ok(Tensor {
        shape,
        data: (0..shape.len()).map(entry).collect(),
    })
}

/// The diagonal matrix of a vector, or the diagonal of a matrix.
fn diagonal<'e>(
    lowering: &mut Lowering<'_, 'e>,
    value: &Tensor<'e>,
    span: Span,
) -> Result<Tensor<'e>, Reported> {
    match value.shape {
        Shape::Matrix(rows, columns) if rows > 1 => Ok(Tensor::vector(
            (0..rows.min(columns)).map(|i| value.at(i, i)).collect(),
        )),
        _ => {
            let n = value.data.len();
            lowering.spend(n.saturating_mul(n), span)?;
            let zero = lowering.constant(0.0);
            let data = (0..n * n).map(|k| {
                if k / n == k % n {
                    value.data[k / n]
                } else {
                    zero
                }
            });
            Ok(Tensor::matrix(n, n, data.collect()))
        }
    }
}

/// `grad(expr, x)` has the shape of x; `jacobian(expr, x)` has a row per entry of expr.
fn derivative<'e>(
    lowering: &mut Lowering<'_, 'e>,
    call: &Call,
    value: &Tensor<'e>,
    by: &Tensor<'e>,
) -> Result<Tensor<'e>, Reported> {
    let Some(vars) = by
        .data
        .iter()
        .map(|entry| entry.as_variable())
        .collect::<Option<Vec<_>>>()
    else {
        let (function, span) = (call.name.to_owned(), call.args[1].span);
        return lowering.error(ModelError::DifferentiateBy { function, span });
    };
    lowering.spend(value.data.len().saturating_mul(vars.len()), call.span)?;
    if call.name == "grad" {
        let scalar = lowering.only_entry(value, "the function of `grad`", call.args[0].span)?;
        let data = vars.iter().map(|&var| scalar.diff(var)).collect();
        return Ok(Tensor {
            shape: by.shape,
            data,
        });
    }
    let row = |entry: &Expr<'e>| vars.iter().map(|&var| entry.diff(var)).collect::<Vec<_>>();
    let data = value.data.iter().flat_map(row).collect();
    Ok(Tensor {
        shape: Shape::Matrix(value.data.len(), vars.len()),
        data,
    })
}
