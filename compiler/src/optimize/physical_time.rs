//! A program in numerical time as it is seen in physical time.
//!
//! Elements in which the clock stands still are instants: contacts that act there are jumps. Elsewhere polynomials go
//! through the values at the nodes at the times that the clock shows there.

use rustc_hash::FxHashMap;

use super::Problem;
use crate::expr::{Expr, Var};
use crate::system::System;

/// A clock slower than this stands still.
const STANDS: f64 = 1e-6;

impl<'e> Problem<'e> {
    /// The system that is discretized.
    pub(super) fn lowered(&self) -> &System<'e> {
        match &self.frozen {
            Some(frozen) => &frozen.system,
            None => &self.system,
        }
    }

    /// Physical time at node 0, the Runge-Kutta nodes and the end of an element that starts at `start`.
    pub(super) fn instants(&self, w: &[f64], (k, j): (usize, usize), start: f64) -> Vec<f64> {
        let layout = &self.layout;
        match &self.frozen {
            Some(frozen) => (0..=layout.end)
                .map(|m| w[layout.x(k, j, m) + frozen.clock])
                .collect(),
            None => {
                let h = w[layout.h(k, j)].max(0.0);
                layout.points.iter().map(|c| start + h * c).collect()
            }
        }
    }

    /// Whether the clock stands still in an element with these instants.
    pub(super) fn stands(&self, w: &[f64], (k, j): (usize, usize), instants: &[f64]) -> bool {
        let advance = instants[instants.len() - 1] - instants[0];
        self.frozen.is_some() && advance <= STANDS * w[self.layout.h(k, j)]
    }

    /// The laws of the contacts that act in an element.
    pub(super) fn acting(&self, w: &[f64], (k, j): (usize, usize)) -> Vec<usize> {
        let Some(frozen) = &self.frozen else {
            return Vec::new();
        };
        let n = self.layout.nodes;
        let nodes: Vec<Vec<f64>> = (1..=n).map(|m| self.lowered_alphas(w, k, j, m)).collect();
        let is_below = |switch: usize| {
            let sum: f64 = nodes.iter().map(|alphas| alphas[switch]).sum();
            sum < 0.5 * n as f64
        };
        let contacts = frozen.contacts.iter().filter(|contact| {
            let comes = contact
                .rest
                .as_ref()
                .is_none_or(|rest| is_below(rest.speed));
            is_below(contact.switch) && comes
        });
        contacts.map(|contact| contact.law).collect()
    }

    /// α of the switches of the model at a node; of a contact, 1 - λ_n.
    pub(super) fn alphas(&self, w: &[f64], k: usize, j: usize, m: usize) -> Vec<f64> {
        let lowered = self.lowered_alphas(w, k, j, m);
        let Some(frozen) = &self.frozen else {
            return lowered;
        };
        let x = &w[self.layout.x(k, j, m)..];
        let known = frozen
            .places
            .iter()
            .map(|place| place.map_or(1.0, |p| lowered[p]));
        let mut alphas: Vec<f64> = known.collect();
        for memory in &frozen.relays {
            alphas[memory.relay] = f64::from(x[memory.state] > 0.5);
        }
        let value = |var: Var| {
            let is = |e: Expr| e.as_variable() == Some(var);
            let state = frozen.system.states.iter().position(|state| is(state.var));
            let param = || self.system.params.iter().find(|param| is(param.var));
            let given = || param().map_or(f64::NAN, |param| param.value);
            state.map_or_else(given, |i| x[i])
        };
        // x' = .. (ϑ (..) + (1 - ϑ) a n): a contact slows down the forces of those before it.
        let mut passing = 1.0;
        for contact in &frozen.contacts {
            let apart = lowered[contact.switch];
            let leaves = contact
                .rest
                .as_ref()
                .map_or(0.0, |rest| lowered[rest.speed]);
            let free = apart + leaves - apart * leaves;
            let force = contact.strength.eval(&value) * (1.0 - free) / (free * passing);
            alphas[contact.contact] = if force > 0.0 { 1.0 - force } else { 1.0 };
            passing *= free;
        }
        alphas
    }

    /// α of the switches of the system that is discretized.
    pub(super) fn lowered_alphas(&self, w: &[f64], k: usize, j: usize, m: usize) -> Vec<f64> {
        let dcs = &self.dcs;
        let known = dcs
            .algebraics
            .iter()
            .enumerate()
            .filter_map(|(i, z)| Some((z.var.as_variable()?, w[self.layout.z(k, j, m, i)?])));
        let known: FxHashMap<Var, f64> = known.collect();
        let value = |var: Var| known.get(&var).copied().unwrap_or(f64::NAN);
        dcs.alphas.iter().map(|alpha| alpha.eval(&value)).collect()
    }
}
