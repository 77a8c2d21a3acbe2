//! The active set that goes on, from the equations of a whole element.
//!
//! Where no set is consistent by its rates and by trial elements of its own, the complementarity
//! problem of an element is solved with every pair open at every node (`nodes.rs`), from the length of a
//! step down to ever shorter elements, each from the solution of the one before. The first nodes at
//! which the members of a pair are told apart say which of them is zero. Only the set is taken from
//! there: an element of its own has to confirm it, and what happens behind the first nodes is found by
//! the elements that follow.

use super::directional::Choice;
use crate::fesd::element::nodes::{Nodes, Step};
use crate::fesd::system::Zero;
use crate::fesd::watch::BAND;
use crate::fesd::{Run, Simulator};

/// Elements that are tried, and how long each is next to the one before.
const MAX_ELEMENTS: usize = 4;
const SHRINK: f64 = 0.1;

/// A pair whose members are both below this at a node is not told apart there.
const TIED: f64 = 1e-9;

impl Simulator<'_> {
    /// The set of the first nodes of an element about as long as `length`, where it is consistent.
    pub(crate) fn whole(&mut self, run: &mut Run, bands: &[f64], length: f64) -> Option<Choice> {
        let (system, s) = (self.system, self.scheme.s);
        let mut nodes = match self.nodes.take() {
            Some(nodes) => nodes,
            None => Nodes::new(system, s),
        };
        nodes.numbers().copy_from_slice(&self.numbers);
        nodes.begin(system, run.t, &run.x, &run.z);
        let mut h = length;
        let mut found = None;
        for _ in 0..MAX_ELEMENTS {
            if self.settings.limit.is_over() {
                break;
            }
            let step = Step {
                t: run.t,
                h,
                x: &run.x,
            };
            if nodes.solve(
                system,
                &self.scheme,
                step,
                &self.settings.limit,
                &mut run.stats,
            ) {
                found = self.set_of(run, &nodes, bands, h);
            } else {
                nodes.begin(system, run.t, &run.x, &run.z);
            }
            if found.is_some() {
                break;
            }
            h *= SHRINK;
        }
        self.nodes = Some(nodes);
        found
    }

    /// The set of the first nodes of an element h long, if an element of that set up to the first
    /// node confirms it.
    fn set_of(&mut self, run: &Run, nodes: &Nodes, bands: &[f64], h: f64) -> Option<Choice> {
        let system = self.system;
        // At a node without distance from the start, the set before may still hold.
        let behind = self.scheme.tableau.nodes.iter().enumerate();
        let behind: Vec<usize> = behind.filter(|(_, c)| **c > 0.0).map(|(m, _)| m).collect();
        let zero = |pair: &crate::fesd::Pair| {
            let members = behind.iter().map(|&node| {
                let z = nodes.z(node);
                (pair.left.value(z), pair.right.value(z))
            });
            let mut told_apart = members.filter(|(left, right)| left.max(*right) > TIED);
            told_apart.next().map(|(left, right)| match left <= right {
                true => Zero::Left,
                false => Zero::Right,
            })
        };
        let pairs = system.pairs.iter().zip(&run.zeros);
        let zeros: Vec<Zero> = pairs
            .map(|(pair, old)| zero(pair).unwrap_or(*old))
            .collect();
        let first = *behind.first()?;
        let distance = self.scheme.tableau.nodes[first] * h;
        let (before, after) = (&run.z, nodes.z(first));
        let guess = before.iter().zip(after).enumerate();
        let guess = guess.map(|(i, (before, after))| match system.is_continuous(i) {
            true => (after - before) / distance,
            false => *after,
        });
        let guess: Vec<f64> = guess.collect();
        // What changes no more than rounding over the element has no rate.
        let size = bands
            .iter()
            .fold(0.0_f64, |size, band| size.max(band / BAND));
        let rates = guess.iter().enumerate();
        let rates = rates.filter(|(i, _)| system.is_continuous(*i));
        let rate_scale = rates.fold(size / h, |scale, (_, rate)| scale.max(rate.abs()));
        let rate_scale = rate_scale.max(f64::MIN_POSITIVE);
        let choice = self
            .directional
            .choice(system, (zeros, guess), &run.z, bands, rate_scale)?;
        self.passes(run, &choice, bands, distance).then_some(choice)
    }
}
