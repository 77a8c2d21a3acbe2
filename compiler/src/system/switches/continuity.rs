//! Which switches the dynamics are continuous across (NSD1).
//!
//! A switch is continuous when the jump f|α=1 - f|α=0 of every rate and of every other ψ
//! vanishes on ψ = 0. Sampled points of the surface refute it; the symbolic form proves it.

use std::cell::OnceCell;

use rustc_hash::FxHashSet;

use super::Switches;
use super::affine::jump;
use super::interaction::positions;
use super::relay::at_all_sides;
use super::switched::Switched;
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Node, Substitution, Var, jacobian, variables_of};
use crate::system::regions::corners::jumps_somewhere;
use crate::system::regions::coverage::Frame;
use crate::system::regions::sample::Sampler;
use crate::system::{Continuity, Role, Switch, SystemError};

/// Points tried per function.
const N_POINTS: usize = 12;
/// A jump is rounding that is not larger than what it changes by this close to the surface. Far
/// from it, as in a Stribeck curve, a jump may be larger by any factor and says nothing; and a
/// stiff spring that starts with a small preload must not pass for continuous.
const ROUNDING: f64 = 1e-10;
/// The same for kinks, which are continuous by construction unless something divides by them.
const ROUNDING_OF_KINKS: f64 = 1e-6;

/// The functions that each α of a system enters.
pub(crate) struct Entered<'s, 'e> {
    collected: &'s Switches<'e>,
    /// The switches of the system among those that were collected.
    kept: &'s [usize],
    switched: &'s Switched<'s, 'e>,
    /// α of relays.
    relays: Vec<Var>,
    /// Rates and the ψ of other switches by switch, but for kinks that are continuous by form.
    functions: Vec<Vec<Expr<'e>>>,
}

impl<'s, 'e> Entered<'s, 'e> {
    pub fn new(
        collected: &'s Switches<'e>,
        kept: &'s [usize],
        switched: &'s Switched<'s, 'e>,
    ) -> Self {
        let (alphas, switches) = (switched.alphas, switched.switches);
        let asked = asked(switched);
        let all: Vec<Expr<'e>> = asked.iter().map(|asked| asked.f).collect();
        let kinks = (0..alphas.len()).filter(|&k| collected.entries.is_kink(kept[k]));
        let (kinks, kink_alphas): (Vec<usize>, Vec<Var>) = kinks.map(|k| (k, alphas[k])).unzip();
        let slopes = jacobian(&all, &kink_alphas).entries.into_iter();
        let continuous: FxHashSet<(usize, usize)> = slopes
            .map(|(f, j, slope)| (f, kinks[j], slope))
            .filter(|&(_, k, slope)| is_multiple(slope, (alphas[k], switches[k].psi)))
            .map(|(f, k, _)| (f, k))
            .collect();
        let mut functions: Vec<Vec<Expr<'e>>> = vec![Vec::new(); alphas.len()];
        for (number, asked) in asked.iter().enumerate() {
            for &k in &asked.of {
                if !continuous.contains(&(number, k)) {
                    functions[k].push(asked.f);
                }
            }
        }
        let relays = (switches.iter().zip(alphas))
            .filter_map(|(switch, &alpha)| switch.relay.map(|_| alpha))
            .collect();
        Entered {
            collected,
            kept,
            switched,
            relays,
            functions,
        }
    }

    /// What is known about functions across ψ = 0 of a switch. A relay has either value on any surface, and the worse
    /// one counts.
    fn across(&self, functions: &[Expr<'e>], (k, psi): (usize, Expr<'e>)) -> Continuity {
        let Some(sides) = at_all_sides(functions, psi, &self.relays) else {
            return Continuity::Discontinuous;
        };
        let (alpha, is_kink) = (
            self.switched.alphas[k],
            self.collected.entries.is_kink(self.kept[k]),
        );
        let classes = (sides.iter()).map(|(functions, psi)| {
            classify(functions, (alpha, *psi), is_kink, self.switched.sampler)
        });
        classes.max().unwrap_or(Continuity::Discontinuous)
    }

    /// Whether f is continuous across the surface of every switch.
    pub fn continuity(&self, frame: &Frame<'e>) -> Vec<Continuity> {
        let class = |(k, switch): (usize, &Switch<'e>)| {
            let functions = &self.functions[k];
            // A hidden term needs no jump to slide by.
            if switch.relay.is_some()
                || switch.is_nonlinear && !functions.is_empty()
                || switch.unilateral
                || switch.slip_of.is_some()
                || switch.role != Role::Step
            {
                return Continuity::Discontinuous;
            }
            let known = self.across(functions, (k, switch.psi));
            let sampler = self.switched.sampler;
            match known == Continuity::Sampled && jumps_somewhere(functions, k, frame, sampler) {
                true => Continuity::Discontinuous,
                false => known,
            }
        };
        let switches = self.switched.switches.iter();
        switches.enumerate().map(class).collect()
    }

    /// Reports every ψ that jumps across the surface of a switch that is not decided before it.
    pub fn check_surfaces(&self, diags: &mut Diagnostics) {
        let switches = self.switched.switches;
        for outer in switches {
            for k in positions(outer.psi, self.switched.alphas) {
                let inner = &switches[k];
                if self.collected.is_leading(self.kept[k])
                    || !self.functions[k].contains(&outer.psi)
                {
                    continue;
                }
                // What the rates do there is another matter.
                if self.across(&[outer.psi], (k, inner.psi)) == Continuity::Discontinuous {
                    diags.push(SystemError::DiscontinuousSurface {
                        outer: outer.name.clone(),
                        inner: inner.name.clone(),
                        outer_span: outer.spans[0],
                        inner_span: inner.spans[0],
                    });
                }
            }
        }
    }
}

/// A function, and of which switches it is asked whether it is continuous across ψ = 0.
struct Asked<'e> {
    f: Expr<'e>,
    of: Vec<usize>,
}

/// Rates, and the ψ of all switches. A gap that holds an α, and with it its normal and its slip velocity, was found to
/// be continuous where it is not negative: nothing is asked of them. Of the α in it, rates are asked with its contact
/// open, and friction and masses by themselves.
fn asked<'e>(switched: &Switched<'_, 'e>) -> Vec<Asked<'e>> {
    let (alphas, switches) = (switched.alphas, switched.switches);
    let mut gaps_with: Vec<Vec<usize>> = vec![Vec::new(); switches.len()];
    let mut is_bent = vec![false; switches.len()];
    for c in (0..switches.len()).filter(|&c| switches[c].unilateral) {
        for k in positions(switches[c].psi, alphas) {
            gaps_with[k].push(c);
            is_bent[c] = true;
        }
    }
    let is_of_gap = |k: usize| is_bent[k] || switches[k].slip_of.is_some_and(|of| is_bent[of]);
    let in_gaps = |k: &usize| !gaps_with[*k].is_empty();
    let rates = switched.rates.iter().map(|&f| {
        let of = positions(f, alphas).into_iter();
        let of = of.filter(|k| !in_gaps(k)).collect();
        Asked { f, of }
    });
    let psi = (0..switches.len()).filter(|&k| !is_of_gap(k)).map(|k| {
        let f = switches[k].psi;
        let of = positions(f, alphas);
        Asked { f, of }
    });
    let inside = (0..switches.len()).filter(in_gaps).flat_map(|k| {
        let one = switches[k].psi.exprs().constant(1.0);
        let open: Substitution<'e> = gaps_with[k].iter().map(|&c| (alphas[c], one)).collect();
        let rates = switched
            .rates
            .iter()
            .map(move |rate| rate.substitute(&open));
        let functions = rates.chain(switched.coefficients.iter().copied());
        let functions = functions.filter(move |&f| positions(f, alphas).contains(&k));
        functions.map(move |f| Asked { f, of: vec![k] })
    });
    rates.chain(psi).chain(inside).collect()
}

/// What is known about a switch α ∈ step(ψ) in the functions `f`.
fn classify<'e>(
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
    let rounding = if is_kink { ROUNDING_OF_KINKS } else { ROUNDING };
    let sampled = on_samples(&jumps, psi, rounding, sampler);
    let mut known = jumps.iter().zip(&sampled);
    if sampled.contains(&Some(false)) {
        return Continuity::Discontinuous;
    }
    if is_kink || known.clone().all(|(&jump, _)| vanishes(jump, psi)) {
        return Continuity::Certain;
    }
    match known.all(|(&jump, sampled)| sampled.is_some() || vanishes(jump, psi)) {
        true => Continuity::Sampled,
        false => Continuity::Discontinuous,
    }
}

/// Whether ∂f/∂α is ψ times α or 1 - α of others, as where minima are nested: f is linear in α and jumps by a product
/// that has no pole which a sample could find.
fn is_multiple<'e>(slope: Expr<'e>, (alpha, psi): (Var, Expr<'e>)) -> bool {
    let (slope, psi) = (slope.split_scale().1, psi.split_scale().1);
    let is_harmless = |factor: Expr<'e>| {
        factor == psi || is_linear(factor) && !variables_of(&[factor]).contains(&alpha)
    };
    match slope.node() {
        _ if slope == psi => true,
        Node::Product(factors) => {
            let holds_psi = factors.iter().any(|&(factor, _)| factor == psi);
            let mut all = factors.into_iter();
            holds_psi && all.all(|(factor, power)| power > 0 && is_harmless(factor))
        }
        _ => false,
    }
}

/// Whether e is a variable or a sum of some.
fn is_linear(e: Expr) -> bool {
    match e.node() {
        Node::Variable(_) => true,
        Node::Sum { terms, .. } => terms.iter().all(|(_, term)| term.as_variable().is_some()),
        _ => false,
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

/// Whether e is zero at every sampled point of the surface; without doubt, that is found at some.
pub(crate) fn vanishes_at_samples<'e>(e: Expr<'e>, psi: Expr<'e>, sampler: &Sampler<'e>) -> bool {
    on_samples(&[e], psi, ROUNDING, sampler) == [Some(true)]
}

/// Whether e is zero wherever ψ is, as its form shows, or at all sampled points.
pub(crate) fn is_zero_on<'e>(e: Expr<'e>, psi: Expr<'e>, sampler: &Sampler<'e>) -> bool {
    e.is_zero() || vanishes(e, psi) || {
        let sampler = sampler.only(&[e, psi]);
        vanishes_at_samples(e, psi, &sampler)
    }
}

/// Whether functions are zero, to rounding, at the sampled points of the surface where they are defined; `None`
/// without such points. The first one that is not ends the search.
fn on_samples<'e>(
    functions: &[Expr<'e>],
    psi: Expr<'e>,
    rounding: f64,
    sampler: &Sampler<'e>,
) -> Vec<Option<bool>> {
    let mut is_zero = vec![None; functions.len()];
    if functions.is_empty() {
        return is_zero;
    }
    'points: for start in sampler.points(N_POINTS) {
        let Some(point) = sampler.to_surface(psi, &start) else {
            continue;
        };
        let near = OnceCell::new();
        for (&e, is_zero) in functions.iter().zip(&mut is_zero) {
            let on = sampler.eval(e, &point);
            if !on.is_finite() {
                continue;
            }
            let near = near.get_or_init(|| sampler.near(psi, &point, rounding));
            let change = (near.iter().map(|near| (sampler.eval(e, near) - on).abs()))
                .filter(|change| change.is_finite())
                .fold(0.0, f64::max);
            // Terms that cancel in a jump leave their roundings.
            let is_jump = on.abs() > change && on.abs() > sampler.rounding(e, &point);
            *is_zero = Some(!is_jump);
            if is_jump {
                break 'points;
            }
        }
    }
    is_zero
}

#[cfg(test)]
mod tests {
    use super::{classify, is_multiple};
    use crate::expr::{Expr, Exprs};
    use crate::system::Continuity::{self, Certain, Discontinuous, Sampled};
    use crate::system::regions::sample::Sampler;

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
        // A stiff spring with a small preload.
        assert_eq!(
            class(&exprs, |x, _, a| (x, a * (1e6 * x + 1.0))),
            Discontinuous
        );
        // A Stribeck curve: far from the surface, the jump is larger by any factor.
        assert_eq!(
            class(&exprs, |x, _, a| (
                x,
                a * ((1e3 * x).exp() + (-1e3 * x).exp())
            )),
            Discontinuous
        );
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
    fn nested_minima_need_no_samples() {
        let exprs = Exprs::new();
        let [x, y, a, b, other] = ["x", "y", "a", "b", "other"].map(|name| exprs.variable(name));
        let alpha = a.as_variable().unwrap();
        let proved = |f: Expr| is_multiple(f.diff(alpha), (alpha, x - y));
        let inner = (1.0 - a) * x + a * y;
        assert!(proved(inner));
        assert!(proved((1.0 - b) * inner + b * other - 3.0));
        assert!(proved(2.0 * b.powi(2) * inner));
        // Poles, other jumps, and what is not linear in α.
        assert!(!proved(inner / other));
        assert!(!proved(inner * other.sqrt()));
        assert!(!proved(inner + a));
        assert!(!proved(a * inner));
        assert!(!proved(a * a * (x - y)));
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
