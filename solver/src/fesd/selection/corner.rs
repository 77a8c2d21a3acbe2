//! A corner of the solutions of the directional problem, where these are a face.
//!
//! In Stewart's form 16 regions that meet have 16 weights θ for 5 equations, and smoothed pairs end in the middle of
//! all weights that do: with every λ' zero the equations determine none of them. Any of these solutions is a convex
//! combination of those with as many positive weights as equations (Carathéodory). One of them is reached as a simplex
//! method would: what the equations do not determine is held where it is, and taken to zero one after the other; where
//! another weight vanishes on the way, that one is held instead.

use super::directional::{Directional, Solved, is_near};
use crate::fesd::system::{ComplementaritySystem, Pair, Zero};

impl Directional {
    /// Solutions with regular matrices that have no positive member which u has not; the zeros are members of the open
    /// pairs that are zero in u. The first one has as few weights as possible that were positive with the zeros `before`:
    /// one of these may just have vanished.
    pub(crate) fn corners(
        &mut self,
        system: &ComplementaritySystem,
        (zeros, u): Solved,
        open: &[usize],
        before: &[Zero],
    ) -> Vec<Solved> {
        let mut found: Vec<Solved> = Vec::new();
        for renews in [true, false] {
            let is_last = |pair: usize| renews && zeros[pair] == before[pair];
            let corner = self.corner(system, (zeros.clone(), u.clone()), open, is_last);
            self.held.fill(0.0);
            found.extend(corner.filter(|corner| found.iter().all(|other| other.0 != corner.0)));
        }
        found
    }

    fn corner(
        &mut self,
        system: &ComplementaritySystem,
        (mut zeros, mut u): Solved,
        open: &[usize],
        is_last: impl Fn(usize) -> bool,
    ) -> Option<Solved> {
        let weight = |pair: usize, u: &[f64]| weight(system, pair, u);
        let mut positive: Vec<usize> = open.to_vec();
        positive.retain(|&pair| has_weight(system, &zeros, pair));
        positive.sort_by(|a, b| {
            let by_weight = weight(*b, &u).total_cmp(&weight(*a, &u));
            is_last(*a).cmp(&is_last(*b)).then(by_weight)
        });
        // The weights of a group are 1 together, so the others determine one of them.
        let group = |pair: &usize| system.pairs[*pair].group;
        let is_first = |pair: &usize| {
            let mut of_group = positive.iter().filter(|other| group(other) == group(pair));
            of_group.next() == Some(pair)
        };
        let (mut determined, others): (Vec<_>, Vec<_>) =
            positive.iter().copied().partition(is_first);
        for &pair in &others {
            zeros[pair] = zeros[pair].other();
            self.held[pair] = weight(pair, &u);
        }
        u = self.solve(system, &zeros, u)?;
        // Of the others, one after the other, those that equations determine next to the ones before.
        let mut held = Vec::new();
        for pair in others {
            let before = (zeros[pair], self.held[pair]);
            (zeros[pair], self.held[pair]) = (before.0.other(), 0.0);
            let solved = self.solve(system, &zeros, u.clone());
            let is_same = |v: &Vec<f64>| {
                let mut pairs = open.iter();
                pairs.all(|&pair| is_near(&[weight(pair, v)], &[weight(pair, &u)]))
            };
            match solved.filter(is_same) {
                Some(v) => {
                    u = v;
                    determined.push(pair);
                }
                None => {
                    (zeros[pair], self.held[pair]) = before;
                    held.push(pair);
                }
            }
        }
        for pair in held {
            self.held[pair] = 0.0;
            let end = self.solve(system, &zeros, u.clone())?;
            let vanishes = |(at, &other): (usize, &usize)| {
                let (from, to) = (weight(other, &u), weight(other, &end));
                (to < 0.0).then(|| (from / (from - to), at))
            };
            let vanishing = determined.iter().enumerate().filter_map(vanishes);
            u = match vanishing.min_by(|a, b| a.0.total_cmp(&b.0)) {
                None => end,
                Some((_, at)) => {
                    let other = std::mem::replace(&mut determined[at], pair);
                    for pair in [pair, other] {
                        zeros[pair] = zeros[pair].other();
                    }
                    self.solve(system, &zeros, u)?
                }
            };
        }
        Some((zeros, u))
    }
}

/// The member of a pair that jumps.
fn weight(system: &ComplementaritySystem, pair: usize, u: &[f64]) -> f64 {
    let Pair { left, right, .. } = &system.pairs[pair];
    let mut members = [left, right].into_iter();
    let jumping = members.find(|member| !system.is_continuous(member.variable));
    jumping.map_or(0.0, |member| member.value(u))
}

/// Whether that is a weight that may be positive. α is none, which is in two pairs: at an end of its range its switch
/// would not be where the solution has it.
fn has_weight(system: &ComplementaritySystem, zeros: &[Zero], pair: usize) -> bool {
    let all = &system.pairs;
    let (zero, other) = all[pair].split(zeros[pair]);
    let has_it = |pair: &&Pair| {
        [pair.left, pair.right]
            .iter()
            .any(|m| m.variable == other.variable)
    };
    system.is_continuous(zero.variable)
        && !system.is_continuous(other.variable)
        && all[pair].is_bounded
        && all.iter().filter(has_it).count() == 1
}
