//! The active set that goes on, from the equations of a whole element.
//!
//! Where no set is consistent by its rates and by trial elements of its own, the complementarity
//! problem of an element is solved with every pair open at every node (`nodes.rs`), as the selection asks for it,
//! for ever shorter elements, each from the solution of the one before. The first nodes at
//! which the members of a pair are told apart say which of them is zero. Only the set is taken from
//! there: an element of its own has to confirm it, and what happens behind the first nodes is found by
//! the elements that follow.

use crate::fesd::element::nodes::{Nodes, Step};
use crate::fesd::element::scheme::Scheme;
use crate::fesd::modes::Modes;
use crate::fesd::run::Run;
use crate::fesd::run::place::Place;
use crate::fesd::system::{ComplementaritySystem, Pair, Zero};
use crate::integrate::tableau::{Family, Tableau, lagrange};
use crate::runtime::limit::Limit;

/// A pair whose members are both below this at a node is not told apart there.
const TIED: f64 = 1e-9;

/// The length of an element in which what is smooth hardly moves, in that of others, and its nodes: values at its start are
/// known to SHORT^NODES of what they change within the others.
const SHORT: f64 = 1e-3;
const NODES: usize = 5;

/// The set of the first nodes of an element.
pub(crate) struct FirstNodes {
    pub zeros: Vec<Zero>,
    /// u up to the first node behind the start.
    pub u: Vec<f64>,
    /// How far that is from the start.
    pub distance: f64,
}

impl FirstNodes {
    /// The largest rate of what is continuous, at least this.
    pub fn rate_scale(&self, system: &ComplementaritySystem, least: f64) -> f64 {
        let rates = self.u.iter().enumerate();
        let rates = rates.filter(|(i, _)| system.is_continuous(*i));
        let rate_scale = rates.fold(least, |scale, (_, rate)| scale.max(rate.abs()));
        rate_scale.max(f64::MIN_POSITIVE)
    }
}

/// The complementarity problem of a whole element.
#[derive(Default)]
pub(crate) struct ElementMcp {
    /// Memory, once it is needed.
    nodes: Option<Nodes>,
    /// That of a short element.
    short: Option<(Scheme, Nodes)>,
}

impl ElementMcp {
    /// Takes z and the rates at a place as the guess of all nodes.
    pub fn begin(&mut self, modes: &Modes, place: &Place) {
        let system = modes.system;
        let nodes = (self.nodes).get_or_insert_with(|| Nodes::new(system, modes.scheme.s));
        nodes.numbers().copy_from_slice(&modes.numbers);
        nodes.begin(system, place.t, &place.x, &place.z);
    }

    /// Solves for an element h long, from the one before.
    pub fn solve(
        &mut self,
        modes: &Modes,
        run: &mut Run,
        h: f64,
        limit: &Limit,
    ) -> Option<FirstNodes> {
        let nodes = self.nodes.as_mut()?;
        let (place, stats) = (&run.place, &mut run.record.stats);
        let (system, scheme) = (modes.system, &modes.scheme);
        let (t, x, scale) = (place.t, &place.x[..], &run.scale[..]);
        if !nodes.solve(system, scheme, Step { t, h, x, scale }, limit, stats) {
            nodes.begin(system, t, x, &place.z);
            return None;
        }
        // At a node without distance from the start, the set before may still hold.
        let behind = scheme.tableau.nodes.iter().enumerate();
        let behind: Vec<usize> = behind.filter(|(_, c)| **c > 0.0).map(|(m, _)| m).collect();
        let zero = |pair: &Pair| {
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
        let pairs = system.pairs.iter().zip(&place.zeros);
        let zeros: Vec<Zero> = pairs
            .map(|(pair, old)| zero(pair).unwrap_or(*old))
            .collect();
        let first = *behind.first()?;
        let distance = scheme.tableau.nodes[first] * h;
        let (before, after) = (&place.z, nodes.z(first));
        let guess = before.iter().zip(after).enumerate();
        let guess = guess.map(|(i, (before, after))| match system.is_continuous(i) {
            true => (after - before) / distance,
            false => *after,
        });
        Some(FirstNodes {
            zeros,
            u: guess.collect(),
            distance,
        })
    }

    /// Gives algebraic states the values that they have behind an instant at which data or switches of time jump: those at
    /// the nodes of a short element that starts with z, extrapolated to its start. Nothing where that has no solution.
    pub fn settle(
        &mut self,
        modes: &Modes,
        run: &mut Run,
        z: &[f64],
        (length, limit): (f64, &Limit),
    ) {
        let system = modes.system;
        let (place, stats) = (&mut run.place, &mut run.record.stats);
        let (scheme, nodes) = self.short.get_or_insert_with(|| {
            let tableau = Tableau::new(Family::RadauIia, NODES);
            let scheme = Scheme::new(tableau.expect("Radau IIA has as many nodes"));
            let nodes = Nodes::new(system, scheme.s);
            (scheme, nodes)
        });
        nodes.numbers().copy_from_slice(&modes.numbers);
        nodes.begin(system, place.t, &place.x, z);
        let (t, h, x) = (place.t, SHORT * length, &place.x[..]);
        let scale = &run.scale[..];
        if !nodes.solve(system, scheme, Step { t, h, x, scale }, limit, stats) {
            return;
        }
        let tableau = &scheme.tableau;
        let at_start = lagrange(&tableau.nodes, &[0.0]);
        for &i in &system.algebraic_states {
            let moves = nodes.moves(tableau, i);
            let moved: f64 = at_start.iter().zip(moves).map(|(l, moved)| l * moved).sum();
            place.x[i] += h * moved;
        }
    }
}
