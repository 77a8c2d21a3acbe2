//! Comparisons as switching functions, and small questions about expressions.

use crate::expr::{Expr, Node, has_kinks, rewrite, variables_of};
use crate::model::expressions::Lowering;
use crate::model::names::scope::{Reported, Value};
use crate::model::{DynamicsError, Shape, Surface, Tensor};
use crate::syntax::{self, ExprKind, Level, Relation};

/// The name of a variable of some expressions, in backticks.
pub(crate) fn first_variable(entries: &[Expr<'_>]) -> Option<String> {
    let exprs = entries.first()?.exprs();
    variables_of(entries)
        .first()
        .map(|&var| format!("`{}`", exprs.name(var)))
}

/// What to do about a value of another shape.
pub(crate) fn shape_help(expected: Shape, found: Shape) -> Option<String> {
    match (expected, found) {
        (Shape::Scalar, Shape::Vector(n)) => Some(format!(
            "declare the size in brackets, as in `x[{n}]`, or take one entry"
        )),
        (Shape::Scalar, Shape::Matrix(m, n)) => Some(format!(
            "declare the size in brackets, as in `A[{m},{n}]`, or take one entry"
        )),
        (Shape::Vector(n), Shape::Matrix(1, m)) if n == m => Some("transpose the row".to_owned()),
        _ => None,
    }
}

/// `a < b < c`
#[inline(never)]
pub(crate) fn compare<'e>(
    lowering: &mut Lowering<'_, 'e>,
    first: &syntax::Expr,
    rest: &[(Relation, syntax::Expr)],
) -> Result<Value<'e>, Reported> {
    let mut truth: Option<Expr<'e>> = None;
    let varied = std::mem::replace(&mut lowering.varies, false);
    let mut left = (first, lowering.scalar(first, "a side of a comparison"));
    for (sign, member) in rest {
        let right = lowering.scalar(member, "a side of a comparison");
        let one = relation(lowering, (left.0, left.1?), *sign, (member, right?))?;
        truth = Some(truth.map_or(one, |truth| truth * one));
        left = (member, right);
    }
    lowering.varies |= varied;
    Ok(Value::condition(
        truth.unwrap_or_else(|| lowering.constant(1.0)),
    ))
}

/// `a > b` is `positive(a - b)`, `a < b` is `1 - nonnegative(a - b)`.
#[inline(never)]
fn relation<'e>(
    lowering: &mut Lowering<'_, 'e>,
    (left, a): (&syntax::Expr, Expr<'e>),
    relation: Relation,
    (right, b): (&syntax::Expr, Expr<'e>),
) -> Result<Expr<'e>, Reported> {
    let above = matches!(relation, Relation::Greater | Relation::GreaterEqual);
    let change = (a - b).cancelled();
    if let Some(value) = change.as_constant() {
        let holds = match relation {
            Relation::Less => value < 0.0,
            Relation::LessEqual => value <= 0.0,
            Relation::Greater => value > 0.0,
            Relation::GreaterEqual => value >= 0.0,
            Relation::Equal | Relation::Perp => value == 0.0,
        };
        if lowering.in_guard {
            let span = left.span.to(right.span);
            return lowering.error(DynamicsError::ConstantComparison { value: holds, span });
        }
        // What is made of more than structural constants was meant to switch.
        if value == 0.0 && lowering.varies {
            let (_, name) = difference(lowering, (left, a), (right, b));
            let (psi, span) = (change, left.span.to(right.span));
            lowering.surfaces.push(Surface::new(name, psi, span));
        }
        return Ok(lowering.constant(if holds { 1.0 } else { 0.0 }));
    }
    // A constant stands behind the minus: the surface of `1 < x` is `x - 1`.
    let ((psi, name), above) = if a.as_constant().is_some() {
        (difference(lowering, (right, b), (left, a)), !above)
    } else {
        (difference(lowering, (left, a), (right, b)), above)
    };
    let span = left.span.to(right.span);
    lowering.surfaces.push(Surface::new(name, psi, span));
    let is_strict = matches!(relation, Relation::Less | Relation::Greater);
    let holds = match above == is_strict {
        true => psi.positive(),
        false => psi.nonnegative(),
    };
    Ok(if above { holds } else { 1.0 - holds })
}

/// The switching function that compares two values, and its name.
fn difference<'e>(
    lowering: &Lowering<'_, 'e>,
    (left, a): (&syntax::Expr, Expr<'e>),
    (right, b): (&syntax::Expr, Expr<'e>),
) -> (Expr<'e>, String) {
    let text = match b.as_constant() {
        _ if right.is_zero() => lowering.names.whole().text(left),
        Some(value) if value < 0.0 => {
            format!(
                "{} + {}",
                lowering.names.whole().at_level(left, Level::Sum),
                -value
            )
        }
        _ => format!(
            "{} - {}",
            lowering.names.whole().at_level(left, Level::Sum),
            lowering.names.whole().at_level(right, Level::Product)
        ),
    };
    (a - b, text)
}

/// Remembers an argument of `sign` or `step` that is zero though it is made of more than structural constants.
pub(crate) fn record_zeros<'e>(
    lowering: &mut Lowering<'_, 'e>,
    arg: &syntax::Expr,
    value: &Tensor<'e>,
) {
    if lowering.varies && value.data.iter().any(|psi| psi.is_zero()) {
        let (name, psi) = (lowering.names.whole().text(arg), lowering.constant(0.0));
        let span = arg.span;
        lowering.surfaces.push(Surface::new(name, psi, span));
    }
}

/// Remembers how the switching functions in the argument of `sign` and the like are written.
pub(crate) fn record_surfaces<'e>(
    lowering: &mut Lowering<'_, 'e>,
    arg: &syntax::Expr,
    value: &Tensor<'e>,
) {
    for (position, &psi) in value.data.iter().enumerate() {
        if psi.as_constant().is_some() {
            continue;
        }
        let name = match (value.shape, &arg.kind) {
            (Shape::Scalar, _) => lowering.names.whole().text(arg),
            (_, ExprKind::Matrix(matrix))
                if !matrix.semicolons
                    && matrix.rows.iter().flatten().count() == value.data.len() =>
            {
                matrix
                    .rows
                    .iter()
                    .flatten()
                    .nth(position)
                    .map(|entry| lowering.names.whole().text(entry))
                    .unwrap_or_default()
            }
            // `x[3]` says more than the first entry of `x[3..4]`.
            (shape, _) => match psi.as_variable() {
                Some(var) => psi.exprs().name(var),
                None => {
                    shape.entry_name(&lowering.names.whole().at_level(arg, Level::Atom), position)
                }
            },
        };
        // `q[1] - 1` says more than `(q - [1, -1])[1]`.
        if value.shape != Shape::Scalar && name.starts_with('(') {
            let formula = Surface::new(psi.to_string(), psi, arg.span);
            lowering.surfaces.push(formula.alias());
        }
        lowering.surfaces.push(Surface::new(name, psi, arg.span));
    }
}

/// Remembers how the kinks between two values are written.
pub(crate) fn record_pair<'e>(
    lowering: &mut Lowering<'_, 'e>,
    left: (&syntax::Expr, Expr<'e>),
    right: (&syntax::Expr, Expr<'e>),
) {
    let ((psi, name), span) = (difference(lowering, left, right), left.0.span);
    if psi.as_constant().is_none() {
        (lowering.surfaces).push(Surface::new(name, psi, span).alias());
    }
}

/// Remembers how the surface x = bound of a value between bounds is written, its bound as it is or with the other sign. That
/// is its name where x itself is made of kinks: what these stand for says less than their words.
pub(crate) fn record_bound<'e>(
    lowering: &mut Lowering<'_, 'e>,
    (value, x): (&syntax::Expr, Expr<'e>),
    bound: Expr<'e>,
    written: Option<(&syntax::Expr, f64)>,
) {
    let (sign, text) = match (bound.as_constant(), written) {
        (Some(number), _) if number.is_infinite() => return,
        (Some(number), _) => (number, number.abs().to_string()),
        (None, Some((written, sign))) => {
            let (sign, written) = match &written.kind {
                ExprKind::Negate(inner) => (-sign, &**inner),
                _ => (sign, written),
            };
            let words = lowering.names.whole();
            (sign, words.at_level(written, Level::Product))
        }
        (None, None) => return,
    };
    let words = lowering.names.whole().at_level(value, Level::Sum);
    let name = match text.as_str() {
        "0" => words,
        text => format!("{words} {} {text}", if sign < 0.0 { "+" } else { "-" }),
    };
    let psi = x - bound;
    if !psi.cancels() {
        let surface = Surface::new(name, psi, value.span);
        (lowering.surfaces).push(if has_kinks(x) {
            surface
        } else {
            surface.alias()
        });
    }
}

/// True for a condition that holds on no side of the surfaces in it.
///
/// It is tried on all sides of up to ten surfaces; with more the answer is no.
pub(crate) fn corners_are_empty(condition: Expr<'_>) -> bool {
    let exprs = condition.exprs();
    let mut sides: Vec<(Expr<'_>, Expr<'_>)> = vec![];
    let of_sides = rewrite(condition, &mut |node| match node.node() {
        Node::Unary(function, psi) if function.on_surface().is_some() => {
            let (scale, surface) = psi.split_scale();
            let known = sides
                .iter()
                .find(|(other, _)| *other == surface)
                .map(|&(_, side)| side);
            let side = known.unwrap_or_else(|| {
                let side = exprs.variable("side");
                sides.push((surface, side));
                side
            });
            if scale > 0.0 { side } else { 1.0 - side }
        }
        _ => node,
    });
    let vars: Vec<_> = sides
        .iter()
        .filter_map(|(_, side)| side.as_variable())
        .collect();
    let others = variables_of(&[of_sides])
        .iter()
        .any(|var| !vars.contains(var));
    if vars.len() > 10 || others {
        return false;
    }
    (0..1_usize << vars.len()).all(|corner| {
        let value = of_sides.eval(&|var| {
            let position = vars
                .iter()
                .position(|&other| other == var)
                .unwrap_or_default();
            ((corner >> position) & 1) as f64
        });
        value.abs() < 0.5
    })
}
