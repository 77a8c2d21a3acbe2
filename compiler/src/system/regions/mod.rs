//! Guards of regions as weights in α: overlaps, gaps.

pub mod arrangement;
pub(crate) mod conjunction;
pub(crate) mod corners;
pub(crate) mod coverage;
pub(crate) mod partitions;
pub(crate) mod sample;
use super::{Coverage, Partition, State, Subsystem, SystemError};
use crate::expr::{Expr, Var};
use crate::source::Span;
use crate::system::regions::conjunction::{MOST_ENUMERATED, corner_value};
use crate::system::regions::coverage::Proof;
use crate::system::regions::sample::Point;
use crate::system::switches::affine::at;
use crate::system::switches::interaction::{positions, subsystems};
use crate::system::switches::switched::Switched;

/// Whether in every corner of α the weights are 0 or 1, or at least sum to one, as they do with a region
/// `else` in corners that no point has; with many α, whatever they are.
pub(crate) fn are_weights(partition: &Partition<'_>, alphas: &[Var]) -> bool {
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

/// Looks for points at which no guard of the partition holds, or two do, by the weights of the guards: the point that a
/// proof has found, or sampled ones where the proof is not complete.
pub(crate) fn check<'e>(
    partition: &Partition<'e>,
    (weights, proof): (&[Expr<'e>], &Proof<'e>),
    states: &[State<'e>],
    guards: &[Span],
    switched: &Switched<'_, 'e>,
) -> Result<Coverage, SystemError> {
    if proof.is_complete && proof.counterexample.is_none() {
        return Ok(Coverage::Proven);
    }
    let psi: Vec<Expr<'e>> = partition
        .switches
        .iter()
        .map(|&k| switched.switches[k].psi)
        .collect();
    let Some(first) = partition.regions.first() else {
        return Ok(Coverage::Proven);
    };
    let exprs = first.weight.exprs();
    let sampler = switched.sampler.only(&[psi.as_slice(), weights].concat());
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
            let set: Vec<String> = (partition.states.iter())
                .map(|&s| states[s].name.clone())
                .collect();
            Err(SystemError::Gap {
                states: set.join(", "),
                witness,
                span: partition
                    .regions
                    .last()
                    .map_or(first.span, |last| last.span),
                entries: set,
            })
        }
    }
}

/// Whether nothing depends on the switches of a partition but through its regions: no rate, once a region has decided
/// them, and no other ψ.
pub(crate) fn decide_all(partition: &Partition<'_>, switched: &Switched<'_, '_>) -> bool {
    let Switched {
        rates,
        switches,
        alphas,
        ..
    } = switched;
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
pub(crate) fn subsystems_of(
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
