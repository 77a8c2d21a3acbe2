//! A point w of the program in quantities of the model: T, instants, free parameters, α, contacts that act.
//!
//! A program in numerical time is seen in physical time. Elements in which the clock stands still are instants: contacts that act there are jumps. Elsewhere polynomials go
//! through the values at the nodes at the times that the clock shows there.

use rustc_hash::FxHashMap;

use super::Problem;
use crate::expr::{Expr, Var};

/// A clock slower than this stands still.
const STANDS: f64 = 1e-6;

/// Impulses below this are rounding.
const IMPULSE: f64 = 1e-9;

/// A point of a program.
#[derive(Clone, Copy)]
pub(crate) struct Iterate<'p, 'e> {
    problem: &'p Problem<'e>,
    w: &'p [f64],
}

impl<'e> Problem<'e> {
    /// A point of the program.
    pub(crate) fn at<'p>(&'p self, w: &'p [f64]) -> Iterate<'p, 'e> {
        Iterate { problem: self, w }
    }
}

impl Iterate<'_, '_> {
    /// T.
    pub fn horizon(&self) -> f64 {
        let free = self.problem.layout.horizon();
        free.map_or(self.problem.settings.horizon, |index| self.w[index])
    }

    /// s_k, the lengths of control intervals as shares of T/N; none where they are equal.
    pub fn shares(&self) -> Option<Vec<f64>> {
        let layout = &self.problem.layout;
        (1..=layout.steps)
            .map(|k| layout.decided.share(k).map(|index| self.w[index].max(0.0)))
            .collect()
    }

    /// When control intervals begin, and the last one ends: k T/N, or by their shares.
    pub fn ends(&self) -> Vec<f64> {
        let (steps, horizon) = (self.problem.layout.steps, self.horizon());
        let shares = self.shares();
        let all: f64 = shares.iter().flatten().sum();
        let mut before = 0.0;
        let end = |k: usize| match &shares {
            _ if k == steps => horizon,
            None => horizon * k as f64 / steps as f64,
            Some(shares) => {
                let end = horizon * before / all;
                before += shares[k];
                end
            }
        };
        (0..=steps).map(end).collect()
    }

    /// Points of elements, where those of an interval are equal, as shares of the horizon.
    pub fn places(&self) -> impl Fn((usize, usize), f64) -> f64 + use<> {
        let layout = &self.problem.layout;
        let (steps, elements) = (layout.steps, layout.elements);
        let horizon = self.horizon();
        let ends = self.shares().map(|_| self.ends());
        move |(k, j), c| match &ends {
            None => (((k - 1) * elements + j - 1) as f64 + c) / (steps * elements) as f64,
            Some(ends) => {
                let share = ((j - 1) as f64 + c) / elements as f64;
                (ends[k - 1] + share * (ends[k] - ends[k - 1])) / horizon
            }
        }
    }

    /// The free parameters.
    pub fn params(&self) -> Vec<f64> {
        let task = self.problem.system.task.iter();
        let n = task.map(|task| task.params.len()).sum();
        (0..n).map(|i| self.w[self.problem.layout.p(i)]).collect()
    }

    /// Physical time at node 0, the Runge-Kutta nodes and the end of an element that starts at `start`.
    pub fn instants(&self, (k, j): (usize, usize), start: f64) -> Vec<f64> {
        let (problem, w) = (self.problem, self.w);
        let layout = &problem.layout;
        match &problem.frozen {
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
    pub fn stands(&self, (k, j): (usize, usize), instants: &[f64]) -> bool {
        let (problem, w) = (self.problem, self.w);
        let advance = instants[instants.len() - 1] - instants[0];
        problem.frozen.is_some() && advance <= STANDS * w[problem.layout.h(k, j)]
    }

    /// The laws of the contacts that act in an element.
    pub fn acting(&self, (k, j): (usize, usize)) -> Vec<usize> {
        let problem = self.problem;
        let Some(frozen) = &problem.frozen else {
            return Vec::new();
        };
        let n = problem.layout.nodes;
        let nodes: Vec<Vec<f64>> = (1..=n).map(|m| self.lowered_alphas(k, j, m)).collect();
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
    pub fn alphas(&self, k: usize, j: usize, m: usize) -> Vec<f64> {
        let (problem, w) = (self.problem, self.w);
        let lowered = self.lowered_alphas(k, j, m);
        let Some(frozen) = &problem.frozen else {
            return lowered;
        };
        let x = &w[problem.layout.x(k, j, m)..];
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
            let params = &problem.system.exogenous.params;
            let param = || params.iter().find(|param| is(param.var));
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
    pub fn lowered_alphas(&self, k: usize, j: usize, m: usize) -> Vec<f64> {
        let (problem, w) = (self.problem, self.w);
        let dcs = &problem.dcs;
        let known =
            dcs.algebraics.iter().enumerate().filter_map(|(i, z)| {
                Some((z.var.as_variable()?, w[problem.layout.z(k, j, m, i)?]))
            });
        let known: FxHashMap<Var, f64> = known.collect();
        let value = |var: Var| known.get(&var).copied().unwrap_or(f64::NAN);
        dcs.switches.at(&value)
    }

    /// The laws of the contacts that give impulses where an element begins: jumps come first.
    pub fn struck(&self, (k, j): (usize, usize)) -> Vec<usize> {
        let (problem, w) = (self.problem, self.w);
        let Some(first) = problem.layout.impulses(k, j) else {
            return Vec::new();
        };
        let contacts = 0..problem.dcs.impacts.len();
        let struck = contacts.filter(|c| w[first + c] > IMPULSE);
        let n_laws = problem.system.jumps.laws.len();
        struck.map(|c| n_laws + c).collect()
    }
}
