//! Convex kinks of an objective at the end of the horizon -> soft constraints there.
//!
//! c |e| is c times what 0 = e is missed by, c max(a, b) = c b + c max(a - b, 0), and -c min(a, b) = -c b + c max(b - a, 0),
//! for c > 0: a program has slacks for them, and no switch that it would have to follow over the whole horizon.

use super::{At, Cost, Holds, Norm, Penalty, Row};
use crate::expr::{BinaryFunction, Expr, Function, Node, rewrite};

/// `weight` times what lower <= value <= 0 is missed by.
struct Kink<'e> {
    weight: f64,
    value: Expr<'e>,
    lower: f64,
}

/// An objective without its convex kinks, which become rows behind those that are there.
pub(super) fn soften<'e>(cost: &Cost<'e>, rows: &mut Vec<Row<'e>>) -> Cost<'e> {
    let first = rows.len();
    let (value, kinks) = split(cost.value);
    rows.extend(kinks.iter().map(|kink| Row {
        name: kink.value.to_string(),
        value: kink.value,
        lower: kink.lower,
        upper: 0.0,
        at: At::End,
        holds: Holds::Softly(Penalty {
            norm: Norm::L1,
            weight: kink.value.exprs().constant(kink.weight),
        }),
        span: cost.span,
    }));
    let mut smooth = Cost {
        value,
        ..cost.clone()
    };
    for term in &mut smooth.terms {
        let (value, own) = split(term.value);
        term.value = value;
        let share = |kink: &Kink<'e>| {
            let is_same = |other: &Kink<'e>| other.value == kink.value && other.lower == kink.lower;
            let place = kinks.iter().position(is_same)?;
            Some((first + place, kink.weight / kinks[place].weight))
        };
        term.soft = own.iter().filter_map(share).collect();
    }
    smooth
}

/// A sum without its convex kinks, and these.
fn split<'e>(sum: Expr<'e>) -> (Expr<'e>, Vec<Kink<'e>>) {
    let exprs = sum.exprs();
    let (constant, terms) = match sum.node() {
        Node::Sum { constant, terms } => (constant, terms),
        _ => (0.0, vec![(1.0, sum)]),
    };
    let (mut kinks, mut rest) = (Vec::new(), vec![exprs.constant(constant)]);
    for (c, term) in terms {
        let found = match term.node() {
            Node::Unary(Function::Abs, e) if c > 0.0 => Some((exprs.constant(0.0), e, 0.0)),
            Node::Binary(BinaryFunction::Max, a, b) if c > 0.0 => {
                Some((c * b, a - b, f64::NEG_INFINITY))
            }
            Node::Binary(BinaryFunction::Min, a, b) if c < 0.0 => {
                Some((c * b, b - a, f64::NEG_INFINITY))
            }
            _ => None,
        };
        match found.filter(|(_, value, _)| is_smooth(*value)) {
            Some((smooth, value, lower)) => {
                rest.push(smooth);
                kinks.push(Kink {
                    weight: c.abs(),
                    value,
                    lower,
                });
            }
            None => rest.push(c * term),
        }
    }
    (exprs.sum(rest), kinks)
}

fn is_smooth(e: Expr<'_>) -> bool {
    let mut smooth = true;
    rewrite(e, &mut |node| {
        smooth &= !node.node().is_nonsmooth();
        node
    });
    smooth
}
