//! All solutions of the directional problem where the pairs that meet fall into independent groups.
//!
//! Two pairs belong together when a row of the directional form contains both. The choices of a group
//! are tried while the other groups stand at one solution of theirs, so that the effort is that of the
//! groups one by one; a solution of the whole is made of one from each.

use petgraph::unionfind::UnionFind;

use super::directional::{Directional, Solved, start, starts};
use crate::fesd::system::{ComplementaritySystem, Zero};

/// Pairs of one group of which all choices are tried.
pub(crate) const MAX_OPEN: usize = 8;

/// Weights are at least zero, and below this far from it.
const FAR: f64 = -1.0;

/// Solutions of the whole that are looked at.
const MOST: usize = 1 << MAX_OPEN;

impl Directional {
    /// The solutions for all choices of the open pairs, with a group of them at a time, and the largest
    /// rate of all that were tried; none where a group is too large, or has none by itself.
    pub(crate) fn each(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        z: &[f64],
        open: &[usize],
        bands: &[f64],
    ) -> Option<(Vec<Solved>, f64)> {
        let groups = groups(system, open);
        if groups.iter().any(|group| group.len() > MAX_OPEN) {
            return None;
        }
        let base = self.one(system, zeros, z, open).0.pop();
        let (zeros, u) = base.unwrap_or_else(|| {
            let u = start(system, z, open, [0.5, 0.5]);
            (zeros.to_vec(), u)
        });
        let tried = groups
            .iter()
            .map(|group| self.all(system, &zeros, z, group));
        let tried: Vec<Vec<Solved>> = tried.collect();
        let scales = tried.iter().map(|tried| rate_scale(system, tried));
        let scale = scales.fold(0.0, f64::max);
        let mut found = vec![zeros.clone()];
        for (group, tried) in groups.iter().zip(tried) {
            let agrees = |(zeros, u): &Solved| {
                let mut pairs = group.iter();
                pairs.all(|&pair| starts(system, (zeros, u), z, bands, scale, pair).is_some())
            };
            let mut sets: Vec<Vec<Zero>> = Vec::new();
            for (zeros, _) in tried.into_iter().filter(agrees) {
                if !sets.contains(&zeros) {
                    sets.push(zeros);
                }
            }
            if sets.is_empty() || sets.len() * found.len() > MOST {
                return None;
            }
            let with_each = |found: &Vec<Zero>| {
                let with = |set: &Vec<Zero>| {
                    let mut found = found.clone();
                    for &pair in group {
                        found[pair] = set[pair];
                    }
                    found
                };
                sets.iter().map(with).collect::<Vec<_>>()
            };
            found = found.iter().flat_map(with_each).collect();
        }
        let mut solved = Vec::new();
        for zeros in found {
            let u = self.solve(system, &zeros, u.clone());
            solved.extend(u.map(|u| (zeros, u)));
        }
        Some((solved, scale))
    }
}

/// The largest rate of what is continuous in some solutions.
pub(crate) fn rate_scale(system: &ComplementaritySystem, found: &[Solved]) -> f64 {
    let rates = comparable(system, found).flat_map(|(_, u)| {
        let continuous = u.iter().enumerate();
        continuous.filter(|(i, _)| system.is_continuous(*i))
    });
    rates.fold(f64::MIN_POSITIVE, |scale, (_, rate)| scale.max(rate.abs()))
}

/// Those of some solutions whose rates others are compared with. A weight far below zero holds a surface on which sides
/// have nearly the same rate, and the rates that it gives have any size.
pub(crate) fn comparable<'f>(
    system: &ComplementaritySystem,
    found: &'f [Solved],
) -> impl Iterator<Item = &'f Solved> + Clone {
    let is_far = |(zeros, u): &&Solved| {
        let mut pairs = system.pairs.iter().zip(zeros);
        pairs.any(|(pair, &zero)| {
            let (_, member) = pair.split(zero);
            !system.is_continuous(member.variable) && member.value(u) < FAR
        })
    };
    let has_near = !found.iter().all(|solved| is_far(&solved));
    found
        .iter()
        .filter(move |solved| !(has_near && is_far(solved)))
}

/// The open pairs, those together that rows of the directional form connect.
fn groups(system: &ComplementaritySystem, open: &[usize]) -> Vec<Vec<usize>> {
    let (n, n_z) = (system.n_states(), system.n_algebraics());
    let first = 1 + n + n_z;
    let entries = &system.full.directional_slopes.entries;
    let mut rows: Vec<Vec<usize>> = vec![Vec::new(); system.full.directional.n_outputs()];
    let mut occurs = vec![0; n_z];
    for &(row, input) in entries {
        rows[row].push(input - first);
        occurs[input - first] += 1;
    }
    let mut is_open = vec![false; n_z];
    for &pair in open {
        let pair = &system.pairs[pair];
        is_open[pair.left.variable] = true;
        is_open[pair.right.variable] = true;
    }
    // What stays as it is connects nothing, and neither does a row that only gives the rate of a member
    // that is positive.
    let mut is_settled = vec![false; n_z];
    for pair in &system.pairs {
        for member in [pair.left, pair.right] {
            let i = member.variable;
            is_settled[i] = !is_open[i];
        }
    }
    let mut sets = UnionFind::<usize>::new(n_z);
    for row in rows {
        let gives = |&i: &usize| is_settled[i] && system.is_continuous(i) && occurs[i] == 1;
        if row.iter().any(gives) {
            continue;
        }
        let tied: Vec<usize> = (row.into_iter())
            .filter(|&i| !is_settled[i] || system.is_continuous(i))
            .collect();
        for two in tied.windows(2) {
            sets.union(two[0], two[1]);
        }
    }
    for &pair in open {
        let pair = &system.pairs[pair];
        sets.union(pair.left.variable, pair.right.variable);
    }
    let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
    for &at in open {
        let set = sets.find_mut(system.pairs[at].left.variable);
        match groups.iter_mut().find(|(of, _)| *of == set) {
            Some((_, group)) => group.push(at),
            None => groups.push((set, vec![at])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}
