//! What nonsmooth terms are in the α of their switch.
//!
//! step(ψ), ψ > 0, ψ >= 0 -> α,  sign(ψ) -> 2α - 1,  abs(y) -> (2α - 1) y with ψ = y,
//! max(a, b) -> α a + (1 - α) b with ψ = a - b,  min(a, b) -> (1 - α) a + α b.

use rustc_hash::FxHashSet;

use crate::expr::{BinaryFunction, Expr, Function, Node, transform, variables_of};
use crate::system::switches::entries::Entry;
use crate::system::switches::known::Known;

/// The ψ of a nonsmooth term, and how its switch enters.
pub(crate) fn compared(e: Expr) -> Option<(Expr, Entry)> {
    if !e.is_function() {
        return None;
    }
    match e.node() {
        Node::Unary(function, psi) if function.on_surface().is_some() => {
            Some((psi, Entry::Condition))
        }
        Node::Unary(Function::Sign, psi) => Some((psi, Entry::Term)),
        Node::Unary(Function::Abs, y) => Some((y, Entry::Kink)),
        Node::Binary(BinaryFunction::Max | BinaryFunction::Min, a, b) => Some((a - b, Entry::Kink)),
        _ => None,
    }
}

/// The nonsmooth terms of an expression that contain no others and that no others contain: a term inside of the ψ of another
/// one is on the side that decides that ψ.
pub(crate) fn plain(e: Expr<'_>) -> FxHashSet<Expr<'_>> {
    let (mut found, mut inside) = (FxHashSet::default(), FxHashSet::default());
    transform(&[e], &mut |e, _| {
        if let Some((psi, _)) = compared(e) {
            let mut inner = false;
            transform(&[psi], &mut |e, _| {
                if compared(e).is_some() {
                    inner = true;
                    inside.insert(e);
                }
                e
            });
            if !inner {
                found.insert(e);
            }
        }
        e
    });
    found.retain(|term| !inside.contains(term));
    found
}

/// How the switch of a nonsmooth term enters a law, which reads numbers at an instant.
pub(crate) fn in_law(e: Expr, entry: Entry) -> Entry {
    match e.node() {
        Node::Unary(Function::Positive, _) => Entry::Above,
        Node::Unary(Function::NonNegative, _) => Entry::NotBelow,
        Node::Unary(Function::Step | Function::Sign, _) => Entry::Between,
        _ => entry,
    }
}

/// A nonsmooth term with this α; others stay as they are.
pub(crate) fn at_alpha<'e>(e: Expr<'e>, alpha: Expr<'e>) -> Expr<'e> {
    match e.node() {
        Node::Unary(function, _) if function.on_surface().is_some() => alpha,
        Node::Unary(Function::Sign, _) => 2.0 * alpha - 1.0,
        Node::Unary(Function::Abs, y) => (2.0 * alpha - 1.0) * y,
        Node::Binary(BinaryFunction::Max, a, b) => alpha * a + (1.0 - alpha) * b,
        Node::Binary(BinaryFunction::Min, a, b) => (1.0 - alpha) * a + alpha * b,
        _ => e,
    }
}

/// What a smaller or larger of two terms is where one of them is infinite, whatever states are: an infinite bound is
/// never met.
pub(crate) fn beside_infinite<'e>(e: Expr<'e>, params: &Known) -> Option<Expr<'e>> {
    let Node::Binary(function @ (BinaryFunction::Max | BinaryFunction::Min), a, b) = e.node()
    else {
        return None;
    };
    let least = match function {
        BinaryFunction::Max => f64::NEG_INFINITY,
        _ => f64::INFINITY,
    };
    [(a, b), (b, a)].into_iter().find_map(|(bound, other)| {
        let value = infinite(bound, params)?;
        Some(if value == least { other } else { bound })
    })
}

/// The infinite value of what consists of numbers and fixed parameters, or of a sum with such terms: all others are
/// finite.
fn infinite(e: Expr, params: &Known) -> Option<f64> {
    let fixed = |e: Expr| {
        let all_fixed = variables_of(&[e])
            .iter()
            .all(|var| params.fixed(*var).is_some());
        all_fixed.then(|| e.eval(&|var| params.fixed(var).unwrap_or(f64::NAN)))
    };
    let value = match e.node() {
        Node::Constant(value) => value,
        _ if !params.numbers.values().any(|number| number.is_infinite()) => return None,
        Node::Sum { constant, terms } => {
            let known = terms.iter().filter_map(|&(c, term)| Some(c * fixed(term)?));
            constant + known.sum::<f64>()
        }
        _ => fixed(e)?,
    };
    value.is_infinite().then_some(value)
}
