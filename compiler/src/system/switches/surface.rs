//! When two switching functions have the same surface, and when one has none.

use crate::expr::{Expr, Function, Interval, Node, Substitution, variables_of};
use crate::system::switches::known::Known;

/// What the zero set of ψ looks like, where its form shows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Form<'e> {
    /// A number.
    Constant(f64),
    /// A number once parameters are given, whose sign is the same wherever free ones may be.
    Parameter(f64),
    /// The same, where free parameters decide the sign.
    Free,
    /// Never on the other side of zero than this sign: `x^2 + y^2`, `exp(x)`.
    Definite(f64),
    /// An odd power of something with the same sign: a surface, but one that ψ crosses with zero slope.
    OddPower(Expr<'e>),
    /// Made of relays and switches of time alone, and zero at one of their values.
    ZeroAtCorner,
    /// Nothing that speaks against a surface.
    Regular,
}

/// The form of ψ for given parameters.
pub(crate) fn form<'e>(psi: Expr<'e>, params: &Known) -> Form<'e> {
    if let Some(value) = psi.cancelled().as_constant() {
        return Form::Constant(value);
    }
    if let Some(value) = parameter(psi, params) {
        return Form::Parameter(value);
    }
    if (variables_of(&[psi]).iter()).all(|var| params.numbers.contains_key(var)) {
        return Form::Free;
    }
    if let Some(sign) = definite(psi, params) {
        return Form::Definite(sign);
    }
    let (scale, normal) = canonical(psi, params);
    match normal.node() {
        Node::Product(factors) => match factors[..] {
            [(base, power)] if power % 2 != 0 && power > 1 => Form::OddPower(scale.signum() * base),
            _ => Form::Regular,
        },
        _ => Form::Regular,
    }
}

/// `(c, e)`: ψ = c e, equal e for functions that are multiples of each other by numbers or parameters.
pub(crate) fn canonical<'e>(psi: Expr<'e>, params: &Known) -> (f64, Expr<'e>) {
    let (scale, normal) = psi.split_scale();
    let Node::Product(factors) = normal.node() else {
        return (scale, normal);
    };
    let mut number = 1.0;
    let kept: Vec<Expr<'e>> = (factors.into_iter())
        .filter_map(|(factor, power)| match parameter(factor, params) {
            Some(value) if value.powi(power).is_normal() => {
                number *= value.powi(power);
                None
            }
            _ => Some(factor.powi(power)),
        })
        .collect();
    if number == 1.0 || !f64::is_normal(number) {
        return (scale, normal);
    }
    let (inner, normal) = psi.exprs().product(kept).split_scale();
    (scale * number * inner, normal)
}

/// The value of an expression that is a number once parameters are given; at the guesses of free ones, if its sign is
/// the same wherever these may be.
pub(crate) fn parameter(e: Expr<'_>, params: &Known) -> Option<f64> {
    let vars = variables_of(&[e]);
    let numbers: Substitution<'_> = (vars.iter())
        .filter_map(|var| Some((*var, e.exprs().constant(*params.numbers.get(var)?))))
        .collect();
    if numbers.is_empty() {
        return e.as_constant();
    }
    let value = e.substitute(&numbers).as_constant()?;
    let is_fixed = vars.iter().all(|var| !params.ranges.contains_key(var));
    (is_fixed || !enclosure(e, params, 6).contains(0.0)).then_some(value)
}

/// All values of an expression, wherever what has a range may be; deeper nesting is not worth a look.
pub(crate) fn enclosure(e: Expr<'_>, params: &Known, depth: usize) -> Interval {
    let Some(depth) = depth.checked_sub(1) else {
        return Interval::ALL;
    };
    let of = |e: Expr<'_>| enclosure(e, params, depth);
    match e.node() {
        Node::Constant(value) => Interval::rounded(value),
        Node::Variable(var) => match (params.ranges.get(&var), params.numbers.get(&var)) {
            (Some(range), _) => *range,
            (None, Some(&value)) => Interval::rounded(value),
            (None, None) => Interval::ALL,
        },
        Node::Sum { constant, terms } => {
            let terms = terms
                .into_iter()
                .map(|(c, term)| Interval::rounded(c) * of(term));
            terms.fold(Interval::rounded(constant), |sum, term| sum + term)
        }
        Node::Product(factors) => {
            let factors = factors
                .into_iter()
                .map(|(factor, power)| of(factor).powi(power));
            factors.fold(Interval::rounded(1.0), |product, factor| product * factor)
        }
        Node::Unary(function, e) => of(e).unary(function),
        Node::Binary(function, a, b) => of(a).binary(function, of(b)),
    }
}

/// The sign that e has wherever it is not zero, where its form shows it.
pub(crate) fn definite(e: Expr<'_>, params: &Known) -> Option<f64> {
    // Deeper nesting is not worth a look; it also bounds the recursion.
    definite_below(e, params, 6)
}

fn definite_below(e: Expr<'_>, params: &Known, depth: usize) -> Option<f64> {
    let depth = depth.checked_sub(1)?;
    if let Some(value) = parameter(e, params) {
        return (value != 0.0).then_some(value.signum());
    }
    match e.node() {
        Node::Sum { constant, terms } => {
            let signs = terms
                .into_iter()
                .map(|(c, term)| Some(c.signum() * definite_below(term, params, depth)?));
            let constant = (constant != 0.0).then_some(Some(constant.signum()));
            let mut signs = signs.chain(constant);
            let first = signs.next()??;
            signs.all(|sign| sign == Some(first)).then_some(first)
        }
        Node::Product(factors) => factors.into_iter().try_fold(1.0, |sign, (factor, power)| {
            if power % 2 == 0 {
                Some(sign)
            } else {
                Some(sign * definite_below(factor, params, depth)?)
            }
        }),
        Node::Unary(Function::Exp | Function::Cosh | Function::Sqrt | Function::Abs, _) => {
            Some(1.0)
        }
        _ => None,
    }
}
