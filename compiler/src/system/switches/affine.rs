//! Multi-affine form in the switch variables.
//!
//! f(α) -> (1 - α_i) f|α_i=0 + α_i f|α_i=1 for every α_i that f is not affine in.
//!
//! Only the values at α_i = 0 and 1 are kept: α^k becomes α. At the corners, that is off the
//! surfaces, nothing changes.

use crate::expr::{Expr, Node, Substitution, Var};

/// The value with one variable at a number.
pub(crate) fn at<'e>(f: Expr<'e>, var: Var, value: f64) -> Expr<'e> {
    let number = f.exprs().constant(value);
    f.substitute(&Substitution::from_iter([(var, number)]))
}

/// Polynomials of higher degree are not expanded in search of terms that cancel.
const MOST_EXPANDED: u32 = 8;

/// Whether f is affine in the variable, as far as its canonical form shows.
pub(crate) fn is_affine(f: Expr<'_>, var: Var) -> bool {
    match f.degree(var) {
        Some(0 | 1) => true,
        Some(2..=MOST_EXPANDED) => {
            let slope = f.diff(var);
            slope.is_zero() || slope.diff(var).is_zero()
        }
        Some(_) | None => false,
    }
}

/// Whether f is a polynomial in the variable: nested conditions make powers of it.
pub(crate) fn is_polynomial(f: Expr<'_>, var: Var) -> bool {
    f.degree(var).is_some()
}

/// The jump across the surface: f|α=1 - f|α=0.
pub(crate) fn jump<'e>(f: Expr<'e>, alpha: Var) -> Expr<'e> {
    at(f, alpha, 1.0) - at(f, alpha, 0.0)
}

/// The variables that f is not affine in: its interpolant has up to two terms per corner of them.
pub(crate) fn bent(f: Expr<'_>, alphas: &[Var]) -> Vec<Var> {
    let mut bent = alphas.to_vec();
    bent.retain(|&alpha| !is_affine(f, alpha));
    bent
}

/// The multi-affine interpolant of f at the corners of the variables.
pub(crate) fn multi_affine<'e>(f: Expr<'e>, alphas: &[Var]) -> Expr<'e> {
    bent(f, alphas).into_iter().fold(f, interpolate)
}

fn interpolate<'e>(f: Expr<'e>, alpha: Var) -> Expr<'e> {
    if is_affine(f, alpha) {
        return f;
    }
    // Terms that are affine already stay as they were written.
    if let Node::Sum { constant, terms } = f.node() {
        let terms = terms.into_iter().map(|(c, term)| c * between(term, alpha));
        return f.exprs().sum(terms) + constant;
    }
    between(f, alpha)
}

fn between<'e>(f: Expr<'e>, alpha: Var) -> Expr<'e> {
    if is_affine(f, alpha) {
        return f;
    }
    let (below, above) = (at(f, alpha, 0.0), at(f, alpha, 1.0));
    if below == above {
        return below;
    }
    let alpha = f.exprs().expr(alpha);
    (1.0 - alpha) * below + alpha * above
}

#[cfg(test)]
mod tests {
    use super::multi_affine;
    use crate::expr::{Expr, Exprs, Var};
    use insta::assert_snapshot;

    fn var(e: Expr) -> Var {
        e.as_variable().unwrap()
    }

    #[test]
    fn powers_fold_and_affine_terms_stay() {
        let exprs = Exprs::new();
        let [x, a, b] = ["x", "a", "b"].map(|name| exprs.variable(name));
        let reduce = |f| multi_affine(f, &[var(a), var(b)]);
        let s = 2.0 * a - 1.0;
        assert_snapshot!(reduce(s * s * x), @"x");
        assert_snapshot!(reduce(a.powi(3)), @"a");
        assert_eq!(reduce(s * x + a * b), s * x + a * b);
        assert_snapshot!(reduce(s * x + a.exp() * x), @"x*(2*a - 1) + x*(1 - a) + 2.718281828459045*x*a");
    }
}
