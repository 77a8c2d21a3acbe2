//! Guards of regions as weights in α: conjunctions, overlaps, gaps.

pub mod arrangement;
pub(crate) mod corners;
pub(crate) mod coverage;
pub(crate) mod partitions;
pub(crate) mod sample;
use super::{Coverage, Partition, State, Subsystem, Switch, SystemError};
use crate::expr::{Expr, Node, Var};
use crate::source::Span;
use crate::system::regions::coverage::Proof;
use crate::system::regions::sample::{Point, Sampler};
use crate::system::switches::affine::at;
use crate::system::switches::interaction::{positions, subsystems};

/// More switches than this in one guard are not enumerated.
const MOST_ENUMERATED: usize = 8;

/// The weight as a conjunction: which switches must be on which side, when it is one.
///
/// 1 where the guard holds, among the corners of its α: a conjunction is a face of the cube.
pub(super) fn conjunction(weight: Expr<'_>, alphas: &[Var]) -> Option<Vec<(usize, bool)>> {
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

/// Whether in every corner of α the weights are 0 or 1, or at least sum to one, as they do with a region
/// `else` in corners that no point has; with many α, whatever they are.
pub(super) fn are_weights(partition: &Partition<'_>, alphas: &[Var]) -> bool {
    let inside = &partition.switches;
    inside.len() > MOST_ENUMERATED
        || (0..1usize << inside.len()).all(|corner| {
            let weights = partition.regions.iter().map(|region| region.weight);
            let values: Vec<f64> = weights
                .map(|weight| corner_value(weight, alphas, inside, corner))
                .collect();
            let are_indicators = values.iter().all(|v| (v * (v - 1.0)).abs() < 1e-9);
            are_indicators || (values.iter().sum::<f64>() - 1.0).abs() < 1e-9
        })
}

/// The weight where bit i of `corner` is the side of the i-th switch inside.
fn corner_value(weight: Expr<'_>, alphas: &[Var], inside: &[usize], corner: usize) -> f64 {
    weight.eval(&|var| {
        let place = inside.iter().position(|&k| alphas[k] == var);
        place.map_or(f64::NAN, |place| f64::from((corner >> place & 1) as u8))
    })
}

/// Looks for points at which no guard of the partition holds, or two do, by the weights of the guards: the point that a
/// proof has found, or sampled ones where the proof is not complete.
pub(super) fn check<'e>(
    partition: &Partition<'e>,
    (weights, proof): (&[Expr<'e>], &Proof<'e>),
    states: &[State<'e>],
    switches: &[Switch<'e>],
    guards: &[Span],
    sampler: &Sampler<'e>,
) -> Result<Coverage, SystemError> {
    if proof.is_complete && proof.counterexample.is_none() {
        return Ok(Coverage::Proven);
    }
    let psi: Vec<Expr<'e>> = partition
        .switches
        .iter()
        .map(|&k| switches[k].psi)
        .collect();
    let Some(first) = partition.regions.first() else {
        return Ok(Coverage::Proven);
    };
    let exprs = first.weight.exprs();
    let sampler = sampler.only(&[psi.as_slice(), weights].concat());
    // On a surface, no guard has a say.
    let is_off = |point: &Point| psi.iter().all(|&psi| sampler.eval(psi, point).abs() > 1e-9);
    let holding = |point: &Point| -> Vec<usize> {
        let holds = |&r: &usize| sampler.eval(weights[r], point) > 0.5;
        (0..partition.regions.len()).filter(holds).collect()
    };
    let is_wrong = |point: &Point| holding(point).len() != 1;
    let proven = proof.counterexample.iter();
    let proven = proven.map(|values| sampler.point_at(values));
    let sampled = sampler.points_around(&psi).filter(is_off);
    let Some(point) = proven.chain(sampled).find(is_wrong) else {
        return Ok(Coverage::Sampled);
    };
    let is_beside = |point: &Point| psi.iter().all(|&psi| sampler.eval(psi, point) != 0.0);
    let point = sampler.shortened(&point, |point| is_beside(point) && is_wrong(point));
    let witness = sampler.witness(&point, &psi, |var| exprs.name(var));
    match holding(&point)[..] {
        [first, second, ..] => {
            let (first_span, second_span) = (guards[first], guards[second]);
            let (first, second) = (&partition.regions[first], &partition.regions[second]);
            Err(SystemError::Overlap {
                first: first.name.clone(),
                second: second.name.clone(),
                witness,
                first_span,
                second_span,
            })
        }
        _ => {
            let set: Vec<&str> = (partition.states.iter())
                .map(|&s| states[s].name.as_str())
                .collect();
            Err(SystemError::Gap {
                states: set.join(", "),
                witness,
                span: partition
                    .regions
                    .last()
                    .map_or(first.span, |last| last.span),
            })
        }
    }
}

/// Whether nothing depends on the switches of a partition but through its regions: no rate, once a region has decided
/// them, and no other ψ.
pub(super) fn decide_all(
    partition: &Partition<'_>,
    rates: &[Expr<'_>],
    switches: &[Switch<'_>],
    alphas: &[Var],
) -> bool {
    let own = |k: &usize| partition.switches.contains(k);
    let is_free = |e: Expr<'_>| !positions(e, alphas).iter().any(own);
    let mut others = (0..switches.len()).filter(|k| !own(k));
    let are_named = partition
        .switches
        .iter()
        .any(|&k| !switches[k].named.is_empty());
    !are_named
        && others.all(|k| is_free(switches[k].psi))
        && partition.regions.iter().all(|region| {
            let Some(literals) = &region.literals else {
                return false;
            };
            let inside = |rate: &Expr<'_>| {
                let fixed = literals.iter();
                is_free(fixed.fold(*rate, |f, &(k, on)| at(f, alphas[k], f64::from(on))))
            };
            rates.iter().all(inside)
        })
}

/// The subsystems of switches that rates multiply, with the regions that they decide.
pub(super) fn subsystems_of(
    rates: &[Expr<'_>],
    alphas: &[Var],
    partitions: &[Partition<'_>],
) -> Vec<Subsystem> {
    let mut subsystems = subsystems(rates, alphas);
    for subsystem in &mut subsystems {
        subsystem.regions = regions_of(subsystem, partitions, rates, alphas);
    }
    subsystems
}

/// The partition whose regions are all there is to a subsystem: disjoint conjunctions that cover
/// every corner, with rates that depend on the subsystem's α through the region only.
fn regions_of(
    subsystem: &Subsystem,
    partitions: &[Partition<'_>],
    rates: &[Expr<'_>],
    alphas: &[Var],
) -> Option<usize> {
    let own = |k: &usize| subsystem.switches.contains(k);
    (0..partitions.len()).find(|&p| {
        let partition = &partitions[p];
        let mut covered = 0.0;
        let fits = partition.regions.iter().all(|region| {
            let Some(literals) = &region.literals else {
                return false;
            };
            covered += 0.5f64.powi(literals.len() as i32);
            rates.iter().all(|&rate| {
                let inside = literals
                    .iter()
                    .fold(rate, |f, &(k, on)| at(f, alphas[k], f64::from(on)));
                !positions(inside, alphas).iter().any(own)
            })
        });
        let disjoint = partition.regions.iter().enumerate().all(|(r, a)| {
            partition.regions[..r].iter().all(|b| {
                let (a, b) = (a.literals.iter().flatten(), b.literals.iter().flatten());
                a.clone()
                    .any(|&(k, on)| b.clone().any(|&other| other == (k, !on)))
            })
        });
        !partition.switches.is_empty()
            && partition.switches.iter().all(own)
            && fits
            && disjoint
            && covered == 1.0
    })
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
