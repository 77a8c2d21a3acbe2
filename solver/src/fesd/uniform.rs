//! Steps in time all of whose nodes are in one active set.
//!
//! Between switches these are most steps. There the reduced equations of the set, those of a finite
//! element, are all that has to be solved; where its other members turn out to be negative at a node,
//! nodes of the step are in different sets.

use wide::f64x4;

use super::modes::Modes;
use super::system::{ComplementaritySystem, Pair, Zero, measure};
use crate::fesd::element::scheme::{Scheme, WIDTH};
use crate::fesd::element::stages::{by_node, by_node_mut};
use crate::fesd::system::evaluator::n_registers;
use crate::hybrid::Stats;

/// Members above this are not negative.
pub(crate) const SLACK: f64 = -1e-10;

/// Active sets that were met, and the present one.
pub(crate) struct Uniform<'s> {
    pub modes: Modes<'s>,
    present: Option<usize>,
    /// Whether the last step was in the present set.
    repeats: bool,
    /// The active set at the last node of the last step.
    pub zeros: Vec<Zero>,
    /// Largest magnitude of each state so far, see [`measure`].
    pub scale: Vec<f64>,
    registers: Vec<f64x4>,
}

impl<'s> Uniform<'s> {
    /// No set yet.
    pub fn new(scheme: Scheme, system: &'s ComplementaritySystem) -> Self {
        Uniform {
            modes: Modes::new(system, scheme),
            present: None,
            repeats: false,
            zeros: Vec::new(),
            scale: vec![0.0; system.n_states()],
            registers: Vec::new(),
        }
    }

    /// Starts anew at x, in no set.
    pub fn begin(&mut self, x: &[f64]) {
        self.present = None;
        self.scale.fill(0.0);
        measure(&mut self.scale, x, self.modes.system);
    }

    /// Takes the set that z is in, where it has equations that are those of the whole system.
    pub fn enter(&mut self, z: &[f64]) {
        self.zeros.clear();
        let zero = |pair: &Pair| match pair.left.value(z) <= pair.right.value(z) {
            true => Zero::Left,
            false => Zero::Right,
        };
        let modes = &mut self.modes;
        self.zeros.extend(modes.system.pairs.iter().map(zero));
        self.repeats = false;
        let reduced = modes.library.reduced(modes.system, &self.zeros);
        let is_direct = reduced.is_some_and(|reduced| reduced.is_direct);
        self.present = is_direct.then(|| modes.of(&self.zeros)).flatten();
    }

    /// Solves a step in the present set; `unknowns` are V and z of every node, those of the last step
    /// before. False where there is no set, or the step is not in it.
    pub fn solve(
        &mut self,
        (t, h): (f64, f64),
        x: &[f64],
        unknowns: &mut [f64],
        stats: &mut Stats,
    ) -> bool {
        measure(&mut self.scale, x, self.modes.system);
        let Some(present) = self.present else {
            return false;
        };
        let Modes { scheme, all, .. } = &mut self.modes;
        let element = &mut all[present].element;
        let (n, per_node) = (x.len(), unknowns.len() / scheme.s);
        if self.repeats {
            element.extrapolate(scheme, 1.0, h / element.stages.h);
        } else {
            let last = &unknowns[unknowns.len() - per_node..];
            let places = element.reduced.unknowns.iter();
            let w: Vec<f64> = places.map(|&i| last[n + i]).collect();
            element.stages.guess(&last[..n], &w);
        }
        let mut work = Stats::default();
        let solved = element.solve(scheme, t, h, x, &self.scale, &mut work);
        stats.newton_iterations += work.newton_iterations;
        stats.factorizations += work.factorizations;
        self.repeats = solved.is_ok() && self.write(present, n, unknowns);
        self.repeats
    }

    /// Writes V and z of the nodes, unless a member is negative at one.
    fn write(&mut self, present: usize, n: usize, unknowns: &mut [f64]) -> bool {
        let (scheme, element) = (&self.modes.scheme, &self.modes.all[present].element);
        let per_node = unknowns.len() / scheme.s;
        let reduced = &element.reduced;
        let tapes = [&reduced.members.tape, &reduced.algebraics];
        self.registers.resize(n_registers(tapes), f64x4::splat(0.0));
        let nodes = |g: usize| g * WIDTH..(g * WIDTH + WIDTH).min(scheme.s);
        for g in 0..scheme.groups {
            element.stages.load(
                scheme,
                g,
                &mut self.registers[..reduced.members.tape.n_inputs()],
            );
            reduced.members.tape.run(&mut self.registers);
            for value in reduced.members.tape.results(&self.registers) {
                let values = value.to_array();
                // Not a number is negative, too.
                if !nodes(g).all(|node| values[node % WIDTH] >= SLACK) {
                    return false;
                }
            }
        }
        for g in 0..scheme.groups {
            element.stages.load(
                scheme,
                g,
                &mut self.registers[..reduced.algebraics.n_inputs()],
            );
            reduced.algebraics.run(&mut self.registers);
            let all = reduced.algebraics.results(&self.registers).enumerate();
            for (i, value) in all {
                let values = value.to_array();
                for node in nodes(g) {
                    unknowns[node * per_node + n + i] = values[node % WIDTH];
                }
            }
        }
        let solved = by_node(&element.stages.unknowns, element.stages.per_node);
        for (node, solved) in by_node_mut(unknowns, per_node).zip(solved) {
            node[..n].copy_from_slice(&solved[..n]);
        }
        true
    }
}
