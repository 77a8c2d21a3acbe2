//! Guards that are conjunctions of sides.

use crate::expr::{Expr, Node, Var};
use crate::system::switches::Switches;
use crate::system::switches::interaction::positions;

/// More switches than this in one guard are not enumerated.
pub(crate) const MOST_ENUMERATED: usize = 8;

/// The weight as a conjunction: which switches must be on which side, when it is one.
///
/// 1 where the guard holds, among the corners of its α: a conjunction is a face of the cube.
pub(crate) fn conjunction(weight: Expr<'_>, alphas: &[Var]) -> Option<Vec<(usize, bool)>> {
    if let Some(literals) = product_of_literals(weight, alphas) {
        return Some(literals);
    }
    let inside = positions(weight, alphas);
    if inside.len() > MOST_ENUMERATED {
        return None;
    }
    let corners: Vec<usize> = (0..1usize << inside.len())
        .filter(|&corner| corner_value(weight, alphas, &inside, corner) > 0.5)
        .collect();
    let all_on = corners
        .iter()
        .fold(usize::MAX, |mask, corner| mask & corner);
    let all_off = corners.iter().fold(0, |mask, corner| mask | corner);
    let literals: Vec<(usize, bool)> = (inside.iter().enumerate())
        .filter_map(|(place, &k)| {
            let on = all_on >> place & 1 == 1;
            let off = all_off >> place & 1 == 0;
            (on != off).then_some((k, on))
        })
        .collect();
    (corners.len() == 1 << (inside.len() - literals.len())).then_some(literals)
}

/// α_i is (i, true) and 1 - α_i is (i, false); a product of distinct ones is their conjunction.
fn product_of_literals(weight: Expr<'_>, alphas: &[Var]) -> Option<Vec<(usize, bool)>> {
    let literal = |e: Expr<'_>| match positions(e, alphas)[..] {
        [k] if e.as_variable() == Some(alphas[k]) => Some((k, true)),
        [k] if e == 1.0 - e.exprs().expr(alphas[k]) => Some((k, false)),
        _ => None,
    };
    let mut literals = match weight.node() {
        Node::Product(factors) => (factors.into_iter())
            .map(|(factor, power)| literal(factor).filter(|_| power == 1))
            .collect::<Option<Vec<_>>>()?,
        _ => vec![literal(weight)?],
    };
    literals.sort_unstable();
    let are_distinct = literals.windows(2).all(|pair| pair[0].0 != pair[1].0);
    are_distinct.then_some(literals)
}

/// The weight where bit i of `corner` is the side of the i-th switch inside.
pub(crate) fn corner_value(
    weight: Expr<'_>,
    alphas: &[Var],
    inside: &[usize],
    corner: usize,
) -> f64 {
    weight.eval(&|var| {
        let place = inside.iter().position(|&k| alphas[k] == var);
        place.map_or(f64::NAN, |place| f64::from((corner >> place & 1) as u8))
    })
}

/// The comparisons of a guard that is a conjunction, as switches with their sides.
pub(crate) fn literals<'e>(guard: Expr<'e>, switches: &Switches<'e>) -> Option<Vec<(usize, bool)>> {
    let alphas = switches.list.iter().map(|switch| switch.alpha);
    conjunction(guard, &alphas.collect::<Vec<Var>>())
}

#[cfg(test)]
mod tests {
    use super::conjunction;
    use crate::expr::{Expr, Exprs, Var};

    #[test]
    fn conjunctions_are_faces_of_the_cube() {
        let exprs = Exprs::new();
        let a = exprs.variables("a", 3);
        let vars: Vec<Var> = a.iter().map(|a| a.as_variable().unwrap()).collect();
        let of = |weight: Expr<'_>| conjunction(weight, &vars);
        assert_eq!(of(a[1]), Some(vec![(1, true)]));
        assert_eq!(of(a[0] * (1.0 - a[2])), Some(vec![(0, true), (2, false)]));
        assert_eq!(of(1.0 - a[0] * (1.0 - a[2])), None);
        // or: the complement of a conjunction
        assert_eq!(of(a[0] + a[1] - a[0] * a[1]), None);
        assert_eq!(
            of(1.0 - (a[0] + a[1] - a[0] * a[1])),
            Some(vec![(0, false), (1, false)])
        );
        // a0 a1 + a0 (1 - a1) is a0
        assert_eq!(of(a[0] * a[1] + a[0] * (1.0 - a[1])), Some(vec![(0, true)]));
        assert_eq!(of(exprs.constant(1.0)), Some(vec![]));
    }
}
