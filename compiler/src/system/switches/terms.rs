//! What nonsmooth terms are in the α of their switch.
//!
//! step(ψ), ψ > 0, ψ >= 0 -> α,  sign(ψ) -> 2α - 1,  abs(y) -> (2α - 1) y with ψ = y,
//! max(a, b) -> α a + (1 - α) b with ψ = a - b,  min(a, b) -> (1 - α) a + α b.

use rustc_hash::FxHashSet;

use crate::expr::{BinaryFunction, Expr, Function, Node, Var, rewrite, transform, variables_of};
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

/// An expression as it is where variables have these values: with those α that are 0 or 1 as numbers, and in place of each
/// nonsmooth term the one that it is there, if that is known.
///
/// lo + max(x - lo, 0) is x above lo: in numbers a large lo takes digits of x with it, and a term that is on another side may
/// have no value.
pub(crate) fn decided<'e>(
    expr: Expr<'e>,
    value: &impl Fn(Var) -> f64,
    is_alpha: &impl Fn(Var) -> bool,
) -> Expr<'e> {
    rewrite(expr, &mut |e| {
        let number = |value: f64| e.exprs().constant(value);
        if let Some(alpha) = e.as_variable().filter(|var| is_alpha(*var)).map(value) {
            return if alpha == 0.0 || alpha == 1.0 {
                number(alpha)
            } else {
                e
            };
        }
        let Some((psi, entry)) = compared(e) else {
            return e;
        };
        match (psi.eval(value), e.node()) {
            (psi, _) if psi.is_nan() => e,
            (psi, Node::Unary(function, _)) if entry != Entry::Kink => number(function.value(psi)),
            (psi, _) => at_alpha(e, number(f64::from(u8::from(psi >= 0.0)))),
        }
    })
}

/// The value where variables have these, of the expression as it is there.
pub(crate) fn value_on_sides(expr: Expr, value: &impl Fn(Var) -> f64) -> f64 {
    decided(expr, value, &|_| false).eval(value)
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

#[cfg(test)]
mod tests {
    use super::{decided, value_on_sides};
    use crate::expr::Exprs;

    #[test]
    fn what_is_on_another_side_has_no_part_in_a_value() {
        let e = Exprs::new();
        let x = e.variable("x");
        let zero = e.constant(0.0);
        let at = |value: f64| move |_| value;
        for large in [2.0, 1e9, 1e20, 1e300] {
            let clipped = -large + (x + large).max(zero) - (x - large).max(zero);
            for (x, right) in [(1.3, 1.3), (-1.7e301, -large), (1.7e301, large), (0.1, 0.1)] {
                assert_eq!(value_on_sides(clipped, &at(x)), right, "{large:e} {x:e}");
            }
        }
        let either = (x - 5.0).positive() * (x - 5.0).log() + (1.0 - (x - 5.0).positive()) * x;
        assert_eq!(value_on_sides(either, &at(2.0)), 2.0);
        assert_eq!(value_on_sides(either, &at(8.0)), 3.0_f64.ln());
        assert_eq!(value_on_sides(x.abs().log(), &at(-1.0)), 0.0);
        assert_eq!(value_on_sides(x.min(zero).sqrt(), &at(4.0)), 0.0);
        assert_eq!(value_on_sides(x.step() + x.sign(), &at(0.0)), 0.5);
        assert!(value_on_sides(x.max(zero), &at(f64::NAN)).is_nan());
    }

    #[test]
    fn alphas_are_numbers_where_they_are_sides() {
        let e = Exprs::new();
        let (x, alpha) = (e.variable("x"), e.variable("alpha"));
        let either = alpha * x.log() + (1.0 - alpha) * (1e20 - x) - 1e20 + alpha * 1e20;
        let is_alpha = |var| Some(var) == alpha.as_variable();
        let on = |side: f64| {
            decided(
                either,
                &|var| if is_alpha(var) { side } else { 2.0 },
                &is_alpha,
            )
        };
        assert_eq!(on(1.0), x.log());
        assert_eq!(on(0.0), -x);
        assert_eq!(on(0.5), either);
    }
}
