//! The order of the unknowns of an element in which its Jacobian is narrow.
//!
//! Nodes couple all derivatives of a state, and equations few states: with the nodes of one state side by
//! side, and states that share an equation close to each other, elimination stays near the diagonal.

use std::collections::VecDeque;

/// Sizes up to which the order is of no interest.
const SMALL: usize = 48;

/// The place of every unknown (node, variable), at `node * n + variable`; none where all is small.
/// `entries` are the pairs (equation, variable) of n equations and variables, at each of s nodes.
///
/// The order of the variables is that of Cuthill & McKee 1969, from a variable with few neighbours on.
pub(crate) fn places(
    s: usize,
    n: usize,
    entries: impl Iterator<Item = (usize, usize)>,
) -> Option<Vec<usize>> {
    if s * n <= SMALL {
        return None;
    }
    let mut neighbours = vec![Vec::new(); n];
    for (a, b) in entries.filter(|(a, b)| a != b) {
        neighbours[a].push(b);
        neighbours[b].push(a);
    }
    for all in &mut neighbours {
        all.sort_unstable();
        all.dedup();
    }
    let degree = |variable: &usize| neighbours[*variable].len();
    let mut starts: Vec<usize> = (0..n).collect();
    starts.sort_by_key(degree);
    let mut order = Vec::with_capacity(n);
    let mut seen = vec![false; n];
    for start in starts {
        let mut queue = VecDeque::from([start]);
        while let Some(variable) = queue.pop_front() {
            if std::mem::replace(&mut seen[variable], true) {
                continue;
            }
            order.push(variable);
            let mut next: Vec<usize> = neighbours[variable].clone();
            next.sort_by_key(degree);
            queue.extend(next);
        }
    }
    let mut places = vec![0; s * n];
    for (position, variable) in order.into_iter().enumerate() {
        for node in 0..s {
            places[node * n + variable] = position * s + node;
        }
    }
    Some(places)
}

#[cfg(test)]
mod tests {
    use super::places;

    #[test]
    fn a_chain_becomes_a_band() {
        // x_i' = v_i, v_i' = x_(i-1) - 2 x_i + x_(i+1) with all x in front.
        let (blocks, s) = (30, 3);
        let couple = |i: usize| {
            let near = i.saturating_sub(1)..(i + 2).min(blocks);
            let own = std::iter::once((i, blocks + i));
            own.chain(near.map(move |j| (blocks + i, j)))
        };
        let entries: Vec<(usize, usize)> = (0..blocks).flat_map(couple).collect();
        let n = 2 * blocks;
        let places = places(s, n, entries.iter().copied()).expect("it is large");
        let mut all = places.clone();
        all.sort_unstable();
        assert!(all.iter().copied().eq(0..s * n), "it is a permutation");
        let width = |&(a, b): &(usize, usize)| places[a].abs_diff(places[b]);
        let widest = entries.iter().map(width).max();
        assert!(widest <= Some(4 * s), "{widest:?}");
    }

    #[test]
    fn small_systems_stay_as_they_are() {
        assert_eq!(places(4, 3, [(0, 1)].into_iter()), None);
    }
}
