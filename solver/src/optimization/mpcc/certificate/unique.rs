//! Multipliers of a point, and whether they are the only ones.
//!
//! Whatever their signs, the multipliers of a point are an affine set: r = ∇f + Jᵀy is zero for variables strictly
//! between their bounds, and y for rows that are not active. What all members share is the same in those that are
//! nearest to points chosen at random; anything else differs, but for luck of probability zero.

use super::class;
use crate::optimization::mpcc::branch::choose;
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::local::{Local, Sets};
use crate::optimization::mpcc::multistart::perturbed;
use crate::optimization::mpcc::options::Options;
use crate::optimization::mpcc::solution::{Multipliers, Solution};
use crate::optimization::problem::{Mpcc, Nlp};

/// Multipliers y of the rows of the vertical form and its r as those of the problem; a side at most `biactive` is zero.
pub(crate) fn multipliers(
    lifted: &Lifted<'_>,
    w: &[f64],
    (y, reduced): (Vec<f64>, &[f64]),
    biactive: f64,
) -> Multipliers {
    let n = lifted.n_original();
    let mut multipliers = Multipliers {
        rows: y,
        lower: vec![0.0; n],
        upper: vec![0.0; n],
        pairs: Vec::new(),
    };
    let mut is_side = vec![false; lifted.n_variables()];
    for (pair, sides) in lifted.pairs().iter().enumerate() {
        let distances = lifted.distances(pair, w);
        let mut nu = [0.0; 2];
        for k in 0..2 {
            if distances[k] <= biactive {
                nu[k] = reduced[sides[k] as usize];
                is_side[sides[k] as usize] = true;
            }
        }
        multipliers.pairs.push(nu);
    }
    for i in (0..n).filter(|&i| !is_side[i]) {
        multipliers.lower[i] = reduced[i].max(0.0);
        multipliers.upper[i] = (-reduced[i]).max(0.0);
    }
    multipliers
}

/// Two other multipliers of a solution, chosen at random: what they share with those of the solution is unique. Signs
/// at active bounds are not looked at. `None` where there is no factorization, or no more time.
pub fn alternatives(
    problem: &mut dyn Mpcc,
    solution: &Solution,
    options: &Options,
) -> Option<[Multipliers; 2]> {
    if options.limit.is_over() {
        return None;
    }
    let tolerances = &options.certificate;
    let mut lifted = Lifted::new(problem);
    let w = lifted.extend(&solution.w);
    let zeros = choose(&lifted, &w);
    lifted.settle(Some(&zeros));
    let local = Local::new(&mut lifted, &w);
    let sets = Sets::new(&lifted, &w, tolerances.biactive);
    let points = [1, 2].map(|seed| perturbed(&vec![0.0; local.rows.len()], local.scale, seed, 1));
    let found = class::nearest(&lifted, &local, &sets, points, tolerances).map(|found| {
        found.map(|y| {
            let reduced = local.reduced_gradient(&y);
            multipliers(&lifted, &w, (y, &reduced), tolerances.biactive)
        })
    });
    lifted.settle(None);
    found
}
