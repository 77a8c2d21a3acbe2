//! The stages of an element: V = x' and w, the algebraic variables that its active set leaves unknown, at its nodes, and
//! X_m = x₀ + h Σ_j a_mj V_j, in lanes over the nodes.

use std::slice::{ChunksExact, ChunksExactMut};

use wide::f64x4;

use super::scheme::{Scheme, WIDTH};
use crate::fesd::system::Reduced;
use crate::fesd::system::evaluator::n_registers;
use crate::fesd::system::hidden::Hidden;
use crate::tape::Tape;

/// The unknowns of an element, and where they are.
pub(crate) struct Stages {
    /// Length of x, and of V and w together.
    pub n: usize,
    pub per_node: usize,
    /// Start and length.
    pub t: f64,
    pub h: f64,
    /// x₀.
    pub x0: Vec<f64>,
    /// V and w of every node, one after the other.
    pub unknowns: Vec<f64>,
    /// Σ b_j V_j, and what the projection of the end adds to it.
    pub mean: Vec<f64>,
    /// What changes at breakpoints.
    pub numbers: Vec<f64>,
    /// X at the nodes: state i at `i * groups`.
    pub x: Vec<f64x4>,
    pub registers: Vec<f64x4>,
}

impl Stages {
    /// Memory for elements of an active set.
    pub fn new(scheme: &Scheme, n: usize, n_numbers: usize, reduced: &Reduced) -> Self {
        let per_node = n + reduced.unknowns.len();
        let zero = f64x4::splat(0.0);
        let tapes = [
            &reduced.equations.tape,
            &reduced.equations.slopes.tape,
            &reduced.members.tape,
        ];
        Stages {
            n,
            per_node,
            t: 0.0,
            h: 0.0,
            x0: vec![0.0; n],
            unknowns: vec![0.0; scheme.s * per_node],
            mean: vec![0.0; n],
            numbers: vec![0.0; n_numbers],
            x: vec![zero; n * scheme.groups],
            registers: vec![zero; n_registers(tapes)],
        }
    }

    /// State i at a point of the scheme.
    fn state_at(&self, scheme: &Scheme, point: usize, i: usize) -> f64 {
        match scheme.points.nodes[point] {
            Some(node) => self.x[i * scheme.groups + node / WIDTH].as_array()[node % WIDTH],
            None if point == 0 => self.x0[i],
            None => self.x0[i] + self.h * self.mean[i],
        }
    }

    /// Moves to a point of the scheme, with w or a guess of it.
    pub fn enter(&self, scheme: &Scheme, point: usize, hidden: &mut Hidden, w: &[f64]) {
        let x = (0..self.n).map(|i| self.state_at(scheme, point, i));
        hidden.set(self.t + scheme.points.at[point] * self.h, x, w);
    }

    /// w of a node.
    pub fn w(&self, node: usize) -> &[f64] {
        &self.unknowns[node * self.per_node + self.n..(node + 1) * self.per_node]
    }

    /// Takes constant rates as the first guess.
    pub fn guess(&mut self, rates: &[f64], w: &[f64]) {
        for node in by_node_mut(&mut self.unknowns, self.per_node) {
            node[..self.n].copy_from_slice(rates);
            node[self.n..].copy_from_slice(w);
        }
    }

    /// Σ b_j V_j
    pub fn average(&mut self, scheme: &Scheme) {
        for (i, mean) in self.mean.iter_mut().enumerate() {
            let terms = scheme.tableau.weights.iter().enumerate();
            *mean = terms
                .map(|(j, b)| b * self.unknowns[j * self.per_node + i])
                .sum();
        }
    }

    /// X_m = x₀ + h Σ_j a_mj V_j
    pub fn place(&mut self, scheme: &Scheme) {
        let (per_node, groups) = (self.per_node, scheme.groups);
        for i in 0..self.n {
            for g in 0..groups {
                let mut sum = f64x4::splat(0.0);
                for j in 0..scheme.s {
                    sum += scheme.columns[j * groups + g] * self.unknowns[j * per_node + i];
                }
                self.x[i * groups + g] = f64x4::splat(self.x0[i]) + sum * self.h;
            }
        }
    }

    /// Puts (t, X, w, numbers) of the nodes of a group, one a lane, into registers, in the order in which tapes read them.
    /// Lanes behind the last node have the w of it: nobody reads their results.
    pub fn load(&self, scheme: &Scheme, g: usize, registers: &mut [f64x4]) {
        let (n, per_node) = (self.n, self.per_node);
        registers[0] = f64x4::splat(self.t) + scheme.nodes[g] * self.h;
        for i in 0..n {
            registers[1 + i] = self.x[i * scheme.groups + g];
        }
        for k in n..per_node {
            let at = |lane: usize| {
                let node = (g * WIDTH + lane).min(scheme.s - 1);
                self.unknowns[node * per_node + k]
            };
            registers[1 + k] = f64x4::from(std::array::from_fn(at));
        }
        for (register, number) in registers[1 + per_node..].iter_mut().zip(&self.numbers) {
            *register = f64x4::splat(*number);
        }
    }

    /// Evaluates a tape at a group of nodes, into the registers.
    pub fn run(&mut self, scheme: &Scheme, g: usize, tape: &Tape) {
        let mut registers = std::mem::take(&mut self.registers);
        self.load(scheme, g, &mut registers);
        tape.run(&mut registers);
        self.registers = registers;
    }

    /// The negative residual: f - V and -r of every node.
    pub fn residual(&mut self, scheme: &Scheme, reduced: &Reduced, residual: &mut [f64]) {
        self.place(scheme);
        let (n, per_node, tape) = (self.n, self.per_node, &reduced.equations.tape);
        for g in 0..scheme.groups {
            self.run(scheme, g, tape);
            let first = g * WIDTH;
            let last = (first + WIDTH).min(scheme.s);
            for (i, value) in tape.results(&self.registers).enumerate() {
                let values = value.to_array();
                for node in first..last {
                    let at = node * per_node + i;
                    residual[at] = match i < n {
                        true => values[node - first] - self.unknowns[at],
                        false => -values[node - first],
                    };
                }
            }
        }
    }
}

/// The unknowns of each node; no nodes where they have none.
pub(crate) fn by_node(unknowns: &[f64], per_node: usize) -> ChunksExact<'_, f64> {
    unknowns.chunks_exact(per_node.max(1))
}

/// The same, to be written.
pub(crate) fn by_node_mut(unknowns: &mut [f64], per_node: usize) -> ChunksExactMut<'_, f64> {
    unknowns.chunks_exact_mut(per_node.max(1))
}
