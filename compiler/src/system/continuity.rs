//! Which switches the dynamics are continuous across (NSD1).
//!
//! A switch is continuous when the jump f|α=1 - f|α=0 of every rate and of every other ψ
//! vanishes on ψ = 0. Sampled points of the surface refute it; the symbolic form proves it.

use super::Continuity;
use super::affine::jump;
use super::sample::{Point, Sampler};
use crate::expr::{Expr, Node, Substitution, Var, variables_of};

/// Points tried per function.
const N_POINTS: usize = 24;
/// A jump on the surface this small beside the jump off it is rounding.
const RELATIVE: f64 = 1e-6;

/// What is known about a switch α ∈ step(ψ) in the functions `f`.
pub(super) fn classify<'e>(
    f: &[Expr<'e>],
    (alpha, psi): (Var, Expr<'e>),
    is_kink: bool,
    sampler: &Sampler<'e>,
) -> Continuity {
    let jumps: Vec<Expr<'e>> = f
        .iter()
        .map(|&f| jump(f, alpha))
        .filter(|jump| !jump.is_zero())
        .collect();
    if jumps.iter().any(|jump| jump.as_constant().is_some()) {
        return Continuity::Discontinuous;
    }
    let sampler = &sampler.only(&[jumps.as_slice(), &[psi]].concat());
    let proven: Vec<bool> = jumps.iter().map(|&jump| vanishes(jump, psi)).collect();
    if proven.iter().all(|&proven| proven) {
        return Continuity::Certain;
    }
    let open = jumps
        .iter()
        .zip(proven)
        .filter(|(_, proven)| !proven)
        .map(|(&jump, _)| jump);
    if open
        .into_iter()
        .any(|jump| !vanishes_at_samples(jump, psi, sampler))
    {
        return Continuity::Discontinuous;
    }
    if is_kink {
        Continuity::Certain
    } else {
        Continuity::Sampled
    }
}

/// Whether the form of e shows that it is zero wherever ψ is.
fn vanishes<'e>(e: Expr<'e>, psi: Expr<'e>) -> bool {
    has_factor(e, psi.split_scale().1) || vanishes_after_solving(e, psi)
}

/// Whether ψ̂ is a factor of e, or of every term of it.
fn has_factor<'e>(e: Expr<'e>, psi: Expr<'e>) -> bool {
    if e.split_scale().1 == psi {
        return true;
    }
    let divides = |e: Expr<'e>| match e.node() {
        Node::Product(factors) => factors
            .into_iter()
            .any(|(factor, power)| power > 0 && factor.split_scale().1 == psi),
        _ => e.split_scale().1 == psi,
    };
    match e.node() {
        Node::Sum { constant, terms } => {
            constant == 0.0 && terms.into_iter().all(|(_, term)| divides(term))
        }
        _ => divides(e),
    }
}

/// Solves ψ = 0 for a variable with a numeric coefficient and substitutes it.
fn vanishes_after_solving<'e>(e: Expr<'e>, psi: Expr<'e>) -> bool {
    variables_of(&[psi]).into_iter().any(|var| {
        let Some(slope) = psi.diff(var).as_constant() else {
            return false;
        };
        if slope == 0.0 {
            return false;
        }
        let rest = psi - slope * psi.exprs().expr(var);
        e.substitute(&Substitution::from_iter([(var, rest / -slope)]))
            .is_zero()
    })
}

/// Whether e is zero, to rounding, at every sampled point of the surface that it is defined at.
pub(super) fn vanishes_at_samples<'e>(e: Expr<'e>, psi: Expr<'e>, sampler: &Sampler<'e>) -> bool {
    let on_surface = |start: &Point| sampler.to_surface(psi, start);
    let verdicts = sampler.points(N_POINTS).filter_map(|start| {
        let on = on_surface(&start)?.eval(e);
        let off = start.eval(e);
        (on.is_finite()).then_some((on.abs(), off.abs()))
    });
    let mut size: f64 = 0.0;
    let mut largest: f64 = 0.0;
    let mut found = false;
    for (on, off) in verdicts {
        found = true;
        if off.is_finite() {
            size = size.max(off);
        }
        largest = largest.max(on);
        if largest > RELATIVE * size && largest > RELATIVE {
            return false;
        }
    }
    found && largest <= RELATIVE * size.max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::classify;
    use crate::expr::{Expr, Exprs};
    use crate::system::Continuity::{self, Certain, Discontinuous, Sampled};
    use crate::system::sample::Sampler;

    fn class<'e>(
        exprs: &'e Exprs,
        f: impl Fn(Expr<'e>, Expr<'e>, Expr<'e>) -> (Expr<'e>, Expr<'e>),
    ) -> Continuity {
        let [x, y, alpha, time] = ["x", "y", "alpha", "time"].map(|name| exprs.variable(name));
        let var = |e: Expr<'e>| e.as_variable().unwrap();
        let (psi, f) = f(x, y, alpha);
        let switches = vec![(var(alpha), psi)];
        let sampler = Sampler::new(
            [(var(x), 1.0), (var(y), 0.5)],
            vec![var(x), var(y)],
            var(time),
            1.0,
            switches,
        );
        classify(&[f], (var(alpha), psi), false, &sampler)
    }

    #[test]
    fn a_jump_is_found() {
        let exprs = Exprs::new();
        assert_eq!(class(&exprs, |x, _, a| (x, a)), Discontinuous);
        assert_eq!(class(&exprs, |x, y, a| (x, a * y)), Discontinuous);
        // The circle: the jump y is zero at two points of it only.
        assert_eq!(
            class(&exprs, |x, y, a| (x * x + y * y - 1.0, a * y)),
            Discontinuous
        );
    }

    #[test]
    fn a_factor_proves_continuity() {
        let exprs = Exprs::new();
        assert_eq!(class(&exprs, |x, y, a| (x, a * x * y)), Certain);
        assert_eq!(
            class(&exprs, |x, y, a| (x - y, a * (2.0 * y - 2.0 * x) * x.sin())),
            Certain
        );
        assert_eq!(
            class(&exprs, |x, y, a| (x - 2.0 * y, a * (x * x - 4.0 * y * y))),
            Certain
        );
        assert_eq!(
            class(&exprs, |x, y, a| (
                x * x + y * y - 1.0,
                a * (x * x + y * y - 1.0).powi(2)
            )),
            Certain
        );
        assert_eq!(class(&exprs, |x, _, _| (x, x)), Certain);
    }

    #[test]
    fn samples_decide_the_rest() {
        let exprs = Exprs::new();
        // sin(ψ) is zero on ψ = 0, which no rule here knows.
        assert_eq!(
            class(&exprs, |x, y, a| (
                x * x + y * y - 1.0,
                a * (x * x + y * y - 1.0).sin()
            )),
            Sampled
        );
    }
}
