//! Convex kinks of an objective at the end of the horizon -> soft constraints there.
//!
//! c |e| is c times what 0 = e is missed by, c max(a, b) = c b + c max(a - b, 0), and -c min(a, b) = -c b + c max(b - a, 0),
//! for c > 0: a program has slacks for them, and no switch that it would have to follow over the whole horizon.

use super::{At, Cost, Holds, Norm, Penalty, Row, Term};
use crate::expr::{BinaryFunction, Expr, Function, Node, rewrite};

/// `weight` times what lower <= value <= 0 is missed by.
struct Kink<'e> {
    weight: f64,
    value: Expr<'e>,
    lower: f64,
}

impl Kink<'_> {
    /// Whether another one is a multiple of it.
    fn is_like(&self, other: &Self) -> bool {
        self.value == other.value && self.lower == other.lower
    }
}

/// An objective without its convex kinks, which become rows behind those that are there.
pub(super) fn soften<'e>(cost: &Cost<'e>, rows: &mut Vec<Row<'e>>) -> Cost<'e> {
    let first = rows.len();
    let (value, kinks) = split(cost.value);
    rows.extend(kinks.iter().map(|kink| Row {
        name: String::new(),
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
    let smooth = Cost {
        value,
        ..cost.clone()
    };
    let share = |kink: &Kink<'e>| {
        let place = kinks.iter().position(|other| other.is_like(kink))?;
        Some((first + place, kink.weight / kinks[place].weight))
    };
    let left = kinks_in(smooth.value);
    let apart = |term: &Term<'e>| {
        let (value, own) = split(term.value);
        let soft = own.iter().map(share).collect::<Option<_>>()?;
        // What is concave in a term, and not in the sum, has no switch.
        let mut kinks = kinks_in(value).into_iter();
        kinks.all(|kink| left.contains(&kink)).then(|| Term {
            text: term.text.clone(),
            value,
            soft,
        })
    };
    let terms = cost.terms.iter().map(apart).collect::<Option<_>>();
    Cost {
        // Terms whose kinks are others than those of the sum do not come apart.
        terms: terms.unwrap_or_default(),
        ..smooth
    }
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
        match found.filter(|(_, value, _)| kinks_in(*value).is_empty()) {
            Some((smooth, value, lower)) => {
                rest.push(smooth);
                let kink = Kink {
                    weight: c.abs(),
                    value,
                    lower,
                };
                match kinks
                    .iter_mut()
                    .find(|known: &&mut Kink| known.is_like(&kink))
                {
                    Some(known) => known.weight += kink.weight,
                    None => kinks.push(kink),
                }
            }
            None => rest.push(c * term),
        }
    }
    (exprs.sum(rest), kinks)
}

/// The nonsmooth functions in an expression.
fn kinks_in(e: Expr<'_>) -> Vec<Expr<'_>> {
    let mut found = Vec::new();
    rewrite(e, &mut |node| {
        if node.node().is_nonsmooth() {
            found.push(node);
        }
        node
    });
    found
}
