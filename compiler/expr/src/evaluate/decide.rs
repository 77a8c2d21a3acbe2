//! What expressions are at a point.
//!
//! x + L + max(-x - L, 0) is 0 below -L and x + L above it: in place of a term that is not smooth the one that it is at a point
//! is put, with the terms that it has in common with others. In numbers a large L takes digits of x with it, and terms that
//! are on another side may have no value.

use crate::{BinaryFunction, Expr, Function, Node, Var, rewrite};

/// An expression as it is where variables have these values, with the numbers of `fixed` in place of their variables. A term
/// of which the point does not tell what it is stays.
pub fn decided<'e>(
    expr: Expr<'e>,
    value: &impl Fn(Var) -> f64,
    fixed: &impl Fn(Var) -> Option<f64>,
) -> Expr<'e> {
    rewrite(expr, &mut |e| {
        let number = |number: f64| e.exprs().constant(number);
        let decided = match e.node() {
            Node::Variable(var) => fixed(var).map(number),
            Node::Unary(Function::Abs, y) => side(y, value).map(|above| if above { y } else { -y }),
            Node::Unary(
                function @ (Function::Sign
                | Function::Step
                | Function::Positive
                | Function::NonNegative),
                psi,
            ) => {
                let side = function.value(psi.eval(value));
                (!side.is_nan()).then(|| number(side))
            }
            Node::Binary(BinaryFunction::Max, a, b) => {
                side(a - b, value).map(|above| if above { a } else { b })
            }
            Node::Binary(BinaryFunction::Min, a, b) => {
                side(a - b, value).map(|above| if above { b } else { a })
            }
            _ => None,
        };
        decided.unwrap_or(e)
    })
}

/// The value where variables have these: that of the expression as it is there.
pub fn value_on_sides(expr: Expr<'_>, value: &impl Fn(Var) -> f64) -> f64 {
    decided(expr, value, &|_| None).eval(value)
}

/// Whether a number is not below zero, where that is known.
fn side(psi: Expr, value: &impl Fn(Var) -> f64) -> Option<bool> {
    let psi = psi.eval(value);
    (!psi.is_nan()).then_some(psi >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::{decided, value_on_sides};
    use crate::Exprs;

    #[test]
    fn what_is_on_another_side_has_no_part_in_a_value() {
        let e = Exprs::new();
        let x = e.variable("x");
        let (zero, known) = (e.constant(0.0), x.as_variable().unwrap());
        for large in [2.0, 1e9, 1e20, 1e300] {
            let clipped = -large + (x + large).max(zero) - (x - large).max(zero);
            for (at, right) in [(1.3, 1.3), (-1.7e301, -large), (1.7e301, large), (0.1, 0.1)] {
                let found =
                    value_on_sides(clipped, &|var| if var == known { at } else { f64::NAN });
                assert_eq!(found, right, "{large:e} {at:e}");
            }
        }
        let at = |value: f64| move |_| value;
        let either = (x - 5.0).positive() * (x - 5.0).log() + (1.0 - (x - 5.0).positive()) * x;
        assert_eq!(value_on_sides(either, &at(2.0)), 2.0);
        assert_eq!(value_on_sides(either, &at(8.0)), 3.0_f64.ln());
        assert_eq!(value_on_sides(x.abs().log(), &at(-1.0)), 0.0);
        assert_eq!(value_on_sides(x.min(zero).sqrt(), &at(4.0)), 0.0);
        assert_eq!(value_on_sides(x.step() + x.sign(), &at(0.0)), 0.5);
        assert!(value_on_sides(x.max(zero), &at(f64::NAN)).is_nan());
    }

    #[test]
    fn numbers_take_the_place_of_variables() {
        let e = Exprs::new();
        let (x, alpha) = (e.variable("x"), e.variable("alpha"));
        let either = alpha * x.log() + (1.0 - alpha) * (1e20 - x) - 1e20 + alpha * 1e20;
        let on = |side: f64| {
            let fixed = move |var| (Some(var) == alpha.as_variable()).then_some(side);
            decided(either, &|_| f64::NAN, &fixed)
        };
        assert_eq!(on(1.0), x.log());
        assert_eq!(on(0.0), -x);
    }
}
