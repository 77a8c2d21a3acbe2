//! Steps in time all of whose nodes are in one active set.
//!
//! Between switches these are most steps. There the reduced equations of the set, those of a finite
//! element, are all that has to be solved; where its other members turn out to be negative at a node,
//! nodes of the step are in different sets.

use rustc_hash::FxHashMap;
use wide::f64x4;

use super::element::Element;
use super::system::{ComplementaritySystem, Pair, Zero, measure};
use crate::fesd::element::scheme::{Scheme, WIDTH};
use crate::fesd::system::library::Library;
use crate::hybrid::Stats;

/// Members above this are not negative.
pub(crate) const SLACK: f64 = -1e-10;

/// Active sets that were met, and the present one.
pub(crate) struct Uniform {
    pub scheme: Scheme,
    /// Places in `elements`; none for sets without equations of their own.
    known: FxHashMap<Vec<Zero>, Option<usize>>,
    elements: Vec<Element>,
    present: Option<usize>,
    /// Whether the last step was in the present set.
    repeats: bool,
    zeros: Vec<Zero>,
    numbers: Vec<f64>,
    scale: Vec<f64>,
    /// The states that equations determine.
    algebraic: Vec<usize>,
    registers: Vec<f64x4>,
}

impl Uniform {
    /// No set yet.
    pub fn new(scheme: Scheme, system: &ComplementaritySystem) -> Self {
        Uniform {
            scheme,
            known: FxHashMap::default(),
            elements: Vec::new(),
            present: None,
            repeats: false,
            zeros: Vec::new(),
            numbers: vec![0.0; system.n_numbers()],
            scale: vec![0.0; system.n_states()],
            algebraic: system.algebraic_states.to_vec(),
            registers: Vec::new(),
        }
    }

    /// Starts anew at x, in no set.
    pub fn begin(&mut self, x: &[f64]) {
        self.present = None;
        self.scale.fill(0.0);
        measure(&mut self.scale, x, &self.algebraic);
    }

    /// Takes the numbers that hold from here on.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        self.numbers.copy_from_slice(numbers);
        for element in &mut self.elements {
            element.set_numbers(numbers);
        }
    }

    /// Takes the set that z is in, where it has equations that are those of the whole system.
    pub fn enter(&mut self, system: &ComplementaritySystem, library: &mut Library, z: &[f64]) {
        self.zeros.clear();
        let zero = |pair: &Pair| match pair.left.value(z) <= pair.right.value(z) {
            true => Zero::Left,
            false => Zero::Right,
        };
        self.zeros.extend(system.pairs.iter().map(zero));
        self.repeats = false;
        if let Some(&known) = self.known.get(&self.zeros) {
            self.present = known;
            return;
        }
        let reduced = library.reduced(system, &self.zeros);
        self.present = reduced.filter(|reduced| reduced.is_direct).map(|reduced| {
            let (n, n_numbers) = (system.n_states(), self.numbers.len());
            let mut element = Element::new(&self.scheme, n, n_numbers, reduced);
            element.follow(&self.algebraic);
            element.set_numbers(&self.numbers);
            self.elements.push(element);
            self.elements.len() - 1
        });
        self.known.insert(self.zeros.clone(), self.present);
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
        let Some(present) = self.present else {
            return false;
        };
        measure(&mut self.scale, x, &self.algebraic);
        let element = &mut self.elements[present];
        let (n, per_node) = (x.len(), unknowns.len() / self.scheme.s);
        if self.repeats {
            element.extrapolate(&self.scheme, 1.0, h / element.h);
        } else {
            let last = &unknowns[unknowns.len() - per_node..];
            let places = element.reduced.unknowns.iter();
            let w: Vec<f64> = places.map(|&i| last[n + i]).collect();
            element.guess(&last[..n], &w);
        }
        let before = element.work;
        let solved = element.solve(&self.scheme, t, h, x, &self.scale);
        let work = element.work - before;
        stats.newton_iterations += work.iterations;
        stats.factorizations += work.factorizations;
        self.repeats = solved.is_ok() && self.write(present, n, unknowns);
        self.repeats
    }

    /// Writes V and z of the nodes, unless a member is negative at one.
    fn write(&mut self, present: usize, n: usize, unknowns: &mut [f64]) -> bool {
        let (scheme, element) = (&self.scheme, &self.elements[present]);
        let per_node = unknowns.len() / scheme.s;
        let reduced = &element.reduced;
        let tapes = [&reduced.members, &reduced.algebraics];
        let longest = tapes.map(|tape| tape.n_registers().max(tape.n_inputs()));
        let longest = longest.into_iter().max().unwrap_or(0);
        self.registers.resize(longest, f64x4::splat(0.0));
        let nodes = |g: usize| g * WIDTH..(g * WIDTH + WIDTH).min(scheme.s);
        for g in 0..scheme.groups {
            element.load(scheme, g, &mut self.registers[..reduced.members.n_inputs()]);
            reduced.members.run(&mut self.registers);
            for value in reduced.members.results(&self.registers) {
                let values = value.to_array();
                // Not a number is negative, too.
                if !nodes(g).all(|node| values[node % WIDTH] >= SLACK) {
                    return false;
                }
            }
        }
        for g in 0..scheme.groups {
            element.load(
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
        for (node, solved) in unknowns
            .chunks_exact_mut(per_node)
            .zip(element.unknowns.chunks_exact(element.per_node()))
        {
            node[..n].copy_from_slice(&solved[..n]);
        }
        true
    }
}
