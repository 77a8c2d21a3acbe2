//! Operators between shapes, and small linear systems.

use crate::expr::Expr;
use crate::model::expressions::Lowering;
use crate::model::names::scope::Reported;
use crate::model::{ModelError, Shape, Tensor, Unsupported};
use crate::source::Span;
use crate::syntax::{self, BinaryOp};

/// Symbolic inverses grow like the factorial of the size.
const MAX_SYMBOLIC: usize = 4;
/// Numeric ones are computed at once.
const MAX_NUMERIC: usize = 100;

/// `a + b - c` or `a * b / c`, from left to right.
#[inline(never)]
pub(crate) fn chain<'e>(
    lowering: &mut Lowering<'_, 'e>,
    first: &syntax::Expr,
    rest: &[(BinaryOp, syntax::Expr)],
) -> Result<Tensor<'e>, Reported> {
    // All operands are looked at, so that mistakes in all of them are reported.
    let start = lowering.numbers(first);
    let operands: Vec<_> = rest
        .iter()
        .map(|(op, operand)| (*op, operand.span, lowering.numbers(operand)))
        .collect();
    if rest
        .iter()
        .all(|(op, _)| matches!(op, BinaryOp::Add | BinaryOp::Sub))
    {
        let mut terms = vec![(BinaryOp::Add, first.span, start?)];
        for (op, span, value) in operands {
            terms.push((op, span, value?));
        }
        return total(lowering, &terms);
    }
    fold(lowering, (start?, first.span), operands)
}

/// From left to right.
#[inline(never)]
fn fold<'e>(
    lowering: &mut Lowering<'_, 'e>,
    (mut value, mut span): (Tensor<'e>, Span),
    operands: Vec<(BinaryOp, Span, Result<Tensor<'e>, Reported>)>,
) -> Result<Tensor<'e>, Reported> {
    for (op, operand_span, operand) in operands {
        value = binary(lowering, op, (&value, span), (&operand?, operand_span))?;
        span = span.to(operand_span);
    }
    Ok(value)
}

/// All terms at once: adding one by one would build every partial sum.
#[inline(never)]
fn total<'e>(
    lowering: &mut Lowering<'_, 'e>,
    terms: &[(BinaryOp, Span, Tensor<'e>)],
) -> Result<Tensor<'e>, Reported> {
    let mut whole = &terms[0];
    for term in terms {
        if term.2.shape == whole.2.shape || term.2.shape == Shape::Scalar {
            continue;
        }
        if whole.2.shape != Shape::Scalar {
            return operands(
                lowering,
                symbol(term.0),
                (&whole.2, whole.1),
                (&term.2, term.1),
                None,
            );
        }
        whole = term;
    }
    let shape = whole.2.shape;
    lowering.spend(shape.len().saturating_mul(terms.len()), whole.1)?;
    let entry = |position: usize| {
        let signed = terms.iter().map(|(op, _, value)| {
            let entry = value.data[if value.shape == Shape::Scalar {
                0
            } else {
                position
            }];
            if *op == BinaryOp::Sub { -entry } else { entry }
        });
        lowering.names.scope.exprs.sum(signed)
    };
    Ok(Tensor {
        shape,
        data: (0..shape.len()).map(entry).collect(),
    })
}

/// `a ^ b` and so on.
#[inline(never)]
pub(crate) fn binary<'e>(
    lowering: &mut Lowering<'_, 'e>,
    op: BinaryOp,
    (a, left): (&Tensor<'e>, Span),
    (b, right): (&Tensor<'e>, Span),
) -> Result<Tensor<'e>, Reported> {
    let exprs = lowering.names.scope.exprs;
    lowering.spend(a.data.len().max(b.data.len()), left.to(right))?;
    let divides = matches!(op, BinaryOp::Div | BinaryOp::ElementDiv);
    if divides && b.data.iter().any(|entry| entry.is_zero()) {
        return lowering.error(ModelError::DivisionByZero { span: right });
    }
    let divide = |a: Expr<'e>, b: Expr<'e>| match (a.as_constant(), b.as_constant()) {
        (Some(a), Some(b)) => exprs.constant(a / b),
        _ => a / b,
    };
    let value = match op {
        BinaryOp::Add => a.zip(b, |a, b| a + b),
        BinaryOp::Sub => a.zip(b, |a, b| a - b),
        BinaryOp::ElementMul => a.zip(b, |a, b| a * b),
        BinaryOp::ElementDiv => a.zip(b, divide),
        BinaryOp::ElementPow => a.zip(b, Expr::powf),
        BinaryOp::Mul => return product(lowering, a, b, left, right),
        BinaryOp::Div => b
            .as_scalar()
            .map(|divisor| a.map(|entry| divide(entry, divisor))),
        BinaryOp::Pow => match (a.as_scalar(), b.as_scalar()) {
            (Some(base), Some(power)) => Some(Tensor {
                shape: a.shape,
                data: vec![base.powf(power)],
            }),
            _ => None,
        },
    };
    match value {
        Some(value) => Ok(value),
        None => {
            let help = match op {
                BinaryOp::Div => {
                    Some("divide by a scalar, entry by entry with `./`, or use `solve`")
                }
                BinaryOp::Pow => Some("`^` is for scalars; `.^` works entry by entry"),
                _ => None,
            };
            operands(lowering, symbol(op), (a, left), (b, right), help)
        }
    }
}

fn operands<T>(
    lowering: &mut Lowering,
    operator: &str,
    left: (&Tensor, Span),
    right: (&Tensor, Span),
    help: Option<&str>,
) -> Result<T, Reported> {
    lowering.error(ModelError::Operands {
        operator: operator.to_owned(),
        left: left.0.shape.to_string(),
        right: right.0.shape.to_string(),
        left_span: left.1,
        right_span: right.1,
        help: help.map(str::to_owned),
    })
}

fn symbol(op: BinaryOp) -> &'static str {
    match op {
        BinaryOp::Add => "+",
        BinaryOp::Sub => "-",
        BinaryOp::Mul => "*",
        BinaryOp::Div => "/",
        BinaryOp::Pow => "^",
        BinaryOp::ElementMul => ".*",
        BinaryOp::ElementDiv => "./",
        BinaryOp::ElementPow => ".^",
    }
}

/// Scaling, or the matrix product.
fn product<'e>(
    lowering: &mut Lowering<'_, 'e>,
    a: &Tensor<'e>,
    b: &Tensor<'e>,
    left_span: Span,
    right_span: Span,
) -> Result<Tensor<'e>, Reported> {
    let both_single = a.data.len() == 1 && b.data.len() == 1;
    if a.shape == Shape::Scalar || b.shape == Shape::Scalar || both_single {
        let shape = if a.shape == Shape::Scalar {
            b.shape
        } else {
            a.shape
        };
        let scaled = match (a.as_scalar(), b.as_scalar()) {
            (Some(factor), _) if a.shape == Shape::Scalar || both_single => {
                b.map(|entry| factor * entry)
            }
            (_, Some(factor)) => a.map(|entry| entry * factor),
            _ => a.clone(),
        };
        return Ok(Tensor {
            shape,
            data: scaled.data,
        });
    }
    let ((rows, inner), (inner_b, columns)) = (a.shape.size(), b.shape.size());
    if inner != inner_b {
        let is_vector = |shape| matches!(shape, Shape::Vector(_));
        let (left, right) = (a.shape.to_string(), b.shape.to_string());
        if is_vector(a.shape) && is_vector(b.shape) {
            return lowering.error(ModelError::VectorProduct {
                left,
                right,
                left_span,
                right_span,
            });
        }
        let help = format!("the left side has {inner} columns, the right side {inner_b} rows");
        return operands(lowering, "*", (a, left_span), (b, right_span), Some(&help));
    }
    lowering.spend(
        rows.saturating_mul(inner).saturating_mul(columns),
        left_span.to(right_span),
    )?;
    let entry = |i: usize, j: usize| {
        lowering
            .names
            .scope
            .exprs
            .sum((0..inner).map(|k| a.at(i, k) * b.at(k, j)))
    };
    let data: Vec<_> = (0..rows)
        .flat_map(|i| (0..columns).map(move |j| (i, j)))
        .map(|(i, j)| entry(i, j))
        .collect();
    match (rows, columns) {
        (1, 1) => Ok(Tensor {
            shape: Shape::Scalar,
            data,
        }),
        _ => Ok(Tensor::matrix(rows, columns, data)),
    }
}

/// A⁻¹
pub(crate) fn inverse<'e>(
    lowering: &mut Lowering<'_, 'e>,
    a: &Tensor<'e>,
    span: Span,
) -> Result<Tensor<'e>, Reported> {
    let (n, columns) = a.shape.size();
    if n != columns {
        return not_square(lowering, "inv", a, span);
    }
    let data = (0..n * n)
        .map(|k| lowering.constant(if k / n == k % n { 1.0 } else { 0.0 }))
        .collect();
    let identity = Tensor {
        shape: a.shape,
        data,
    };
    solve(lowering, a, &identity, span)
}

fn not_square<T>(
    lowering: &mut Lowering,
    function: &str,
    a: &Tensor,
    span: Span,
) -> Result<T, Reported> {
    lowering.error(ModelError::Arguments {
        function: function.to_owned(),
        expected: "a square matrix".to_owned(),
        found: a.shape.to_string(),
        span,
    })
}

/// A⁻¹ b, by Cramer's rule; by elimination where all entries of A are numbers.
pub(crate) fn solve<'e>(
    lowering: &mut Lowering<'_, 'e>,
    a: &Tensor<'e>,
    b: &Tensor<'e>,
    span: Span,
) -> Result<Tensor<'e>, Reported> {
    let (n, columns) = a.shape.size();
    if n != columns {
        return not_square(lowering, "solve", a, span);
    }
    let (rows, right_sides) = b.shape.size();
    if rows != n {
        return operands(lowering, "solve", (a, span), (b, span), None);
    }
    let numbers = a.constants();
    if n > if numbers.is_some() {
        MAX_NUMERIC
    } else {
        MAX_SYMBOLIC
    } {
        return lowering.error(Unsupported::LargeInverse { size: n, span });
    }
    lowering.spend(n.pow(3).saturating_add(n * n * right_sides), span)?;
    let inverse = match numbers {
        Some(numbers) => eliminate(n, numbers).map(|inverse| {
            inverse
                .iter()
                .map(|&entry| lowering.constant(entry))
                .collect::<Vec<_>>()
        }),
        None => adjugate(lowering, a, n),
    };
    let Some(inverse) = inverse else {
        return lowering.error(ModelError::Singular { span });
    };
    let entry = |i: usize, j: usize| {
        lowering
            .names
            .scope
            .exprs
            .sum((0..n).map(|k| inverse[i * n + k] * b.at(k, j)))
    };
    let data = (0..n)
        .flat_map(|i| (0..right_sides).map(move |j| (i, j)))
        .map(|(i, j)| entry(i, j))
        .collect();
    Ok(Tensor {
        shape: b.shape,
        data,
    })
}

/// adj(A)/det(A)
fn adjugate<'e>(lowering: &Lowering<'_, 'e>, a: &Tensor<'e>, n: usize) -> Option<Vec<Expr<'e>>> {
    let all: Vec<usize> = (0..n).collect();
    let determinant = determinant(lowering, a, &all, &all);
    if determinant.is_zero() {
        return None;
    }
    let without = |k: usize| all.iter().copied().filter(|&i| i != k).collect::<Vec<_>>();
    let cofactor = |i: usize, j: usize| {
        let minor = self::determinant(lowering, a, &without(i), &without(j));
        if (i + j).is_multiple_of(2) {
            minor
        } else {
            -minor
        }
    };
    // The cofactor of the transposed place.
    Some(
        (0..n * n)
            .map(|k| cofactor(k % n, k / n) / determinant)
            .collect(),
    )
}

/// Expansion along the first of the given rows.
fn determinant<'e>(
    lowering: &Lowering<'_, 'e>,
    a: &Tensor<'e>,
    rows: &[usize],
    columns: &[usize],
) -> Expr<'e> {
    let Some((&row, rest)) = rows.split_first() else {
        return lowering.constant(1.0);
    };
    let term = |(position, &column): (usize, &usize)| {
        let entry = a.at(row, column);
        if entry.is_zero() {
            return entry;
        }
        let others: Vec<usize> = columns
            .iter()
            .copied()
            .filter(|&other| other != column)
            .collect();
        let minor = determinant(lowering, a, rest, &others);
        if position.is_multiple_of(2) {
            entry * minor
        } else {
            -(entry * minor)
        }
    };
    lowering
        .names
        .scope
        .exprs
        .sum(columns.iter().enumerate().map(term))
}

/// The inverse by elimination with row exchanges.
fn eliminate(n: usize, mut a: Vec<f64>) -> Option<Vec<f64>> {
    let scale = a.iter().fold(0.0_f64, |max, entry| max.max(entry.abs()));
    let mut inverse: Vec<f64> = (0..n * n)
        .map(|k| if k / n == k % n { 1.0 } else { 0.0 })
        .collect();
    for column in 0..n {
        let pivot = (column..n)
            .max_by(|&i, &j| a[i * n + column].abs().total_cmp(&a[j * n + column].abs()))?;
        // Rounding leaves this much of a zero.
        let size = a[pivot * n + column].abs();
        if size.is_nan() || size <= 1e-14 * scale {
            return None;
        }
        for k in 0..n {
            a.swap(column * n + k, pivot * n + k);
            inverse.swap(column * n + k, pivot * n + k);
        }
        let divisor = a[column * n + column];
        for k in 0..n {
            a[column * n + k] /= divisor;
            inverse[column * n + k] /= divisor;
        }
        for row in (0..n).filter(|&row| row != column) {
            let factor = a[row * n + column];
            for k in 0..n {
                a[row * n + k] -= factor * a[column * n + k];
                inverse[row * n + k] -= factor * inverse[column * n + k];
            }
        }
    }
    Some(inverse)
}
