//! Programs made of functions that are applied at many places.
//!
//! A [`Block`] applies one tape at its places: an equation of collocation at all nodes, or one of a thousand rows that
//! differ in their variables and numbers only. Derivatives are made once per block, and values, Jacobians and Hessians
//! are evaluated in lanes over the places.
//!
//! Rows are numbered block by block, in the order in which the blocks are given; output i at place p of a block is its
//! row i · places + p.

mod block;
mod check;

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::optimization::problem::{
    HeldStructure, Intervals, Mpcc, Nlp, Pair, Pattern, Side, Structure,
};
use crate::tape::Tape;
use block::{Compiled, Slopes};

/// A function and the places where it is applied.
#[derive(Clone, Debug)]
pub struct Block {
    /// The values; its inputs are variables, then numbers, then parameters.
    pub values: Tape,
    /// The number of places.
    pub n_places: usize,
    /// The index of the variable that is argument i at place p, at i · places + p.
    pub variables: Vec<u32>,
    /// Number i at place p, at i · places + p.
    pub numbers: Vec<f64>,
    /// The indices of the parameters of the program, the same at all places, that are its last inputs.
    pub parameters: Vec<u32>,
}

/// A nonlinear program with complementarity constraints, made of blocks.
///
/// ```
/// use nsd_solver::optimization::kernels::{Block, Program};
/// use nsd_solver::optimization::problem::{Nlp, Pair, Side};
/// use nsd_solver::tape::Tape;
///
/// // minimize (x - 1)² + (y - 2)²  subject to  0 <= x ⟂ y >= 0
/// let mut square = Tape::builder(2);
/// let distance = square.sub(square.input(0), square.input(1));
/// let distance = square.square(distance);
/// let infinity = f64::INFINITY;
/// let mut program = Program::builder(&[0.0, 0.0], &[infinity, infinity], &[0.5, 0.5]);
/// program.objective(Block {
///     values: square.finish(&[distance]),
///     n_places: 2,
///     variables: vec![0, 1],
///     numbers: vec![1.0, 2.0],
///     parameters: vec![],
/// });
/// program.pair(Pair { a: Side::Variable(0), b: Side::Variable(1) });
/// let mut program = program.finish();
/// assert_eq!(program.objective(&[0.0, 2.0]), 1.0);
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct Program {
    structure: HeldStructure,
    pairs: Vec<Pair>,
    blocks: Vec<Compiled>,
    terms: Vec<Term>,
    /// What does not change: entries of the Jacobian and of the gradient.
    constant_slopes: Vec<f64>,
    constant_gradient: Vec<f64>,
}

/// A block of the objective.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Term {
    block: Compiled,
    /// Its part of the constant gradient, by variable.
    constant: Vec<(u32, f64)>,
    /// Whether it depends on no variable.
    is_constant: bool,
    /// What it counts in the objective: nothing with 0.
    weight: f64,
}

/// Collects the parts of a [`Program`].
#[derive(Clone, Debug)]
pub struct ProgramBuilder {
    structure: HeldStructure,
    parameters: Vec<f64>,
    pairs: Vec<Pair>,
    blocks: Vec<(Range<usize>, Block)>,
    terms: Vec<Block>,
}

impl Program {
    /// Starts a program with variables l <= w <= u, and where to start from.
    ///
    /// # Panics
    ///
    /// If the lengths differ.
    pub fn builder(lower: &[f64], upper: &[f64], start: &[f64]) -> ProgramBuilder {
        assert_eq!(lower.len(), upper.len(), "one bound per variable");
        assert_eq!(lower.len(), start.len(), "one start per variable");
        ProgramBuilder {
            structure: HeldStructure {
                variables: Intervals {
                    lower: lower.to_vec(),
                    upper: upper.to_vec(),
                },
                start: start.to_vec(),
                ..HeldStructure::default()
            },
            parameters: Vec::new(),
            pairs: Vec::new(),
            blocks: Vec::new(),
            terms: Vec::new(),
        }
    }

    /// The number of blocks, with those of the objective.
    pub fn n_blocks(&self) -> usize {
        self.blocks.len() + self.terms.len()
    }

    /// Where a solver starts from.
    ///
    /// # Panics
    ///
    /// If there are more or fewer values than variables.
    pub fn set_start(&mut self, start: &[f64]) {
        self.structure.start.copy_from_slice(start);
    }

    /// Gives the parameters other values; patterns stay as they are.
    ///
    /// # Panics
    ///
    /// If there are fewer values than parameters.
    pub fn set_parameters(&mut self, values: &[f64]) {
        self.constant_slopes.fill(0.0);
        for block in &mut self.blocks {
            block.set_parameters(values);
            block.add_constant_slopes(&mut self.constant_slopes);
        }
        let mut own = vec![0.0; self.constant_gradient.len()];
        for term in &mut self.terms {
            term.block.set_parameters(values);
            own.fill(0.0);
            term.block.add_constant_slopes(&mut own);
            let constant = (0..).zip(own.iter().copied());
            term.constant = constant.filter(|(_, slope)| *slope != 0.0).collect();
        }
        self.add_constant_gradients();
    }

    fn add_constant_gradients(&mut self) {
        self.constant_gradient.fill(0.0);
        for term in &self.terms {
            for &(variable, slope) in &term.constant {
                self.constant_gradient[variable as usize] += term.weight * slope;
            }
        }
    }

    /// Weights a term of the objective, at first by 1; patterns stay as they are.
    ///
    /// # Panics
    ///
    /// If there is no such term.
    pub fn weight_term(&mut self, term: usize, weight: f64) {
        let weighted = &mut self.terms[term].weight;
        if *weighted != weight {
            *weighted = weight;
            self.add_constant_gradients();
        }
    }

    /// Changes the bounds of a variable; where it is a side of a pair, its lower one has to stay.
    ///
    /// # Panics
    ///
    /// If there is no such variable.
    pub fn set_variable_bounds(&mut self, variable: usize, lower: f64, upper: f64) {
        self.structure.variables.lower[variable] = lower;
        self.structure.variables.upper[variable] = upper;
    }

    /// Changes the bounds of a row that is no side of a pair.
    ///
    /// # Panics
    ///
    /// If there is no such row.
    pub fn set_row_bounds(&mut self, row: usize, lower: f64, upper: f64) {
        self.structure.rows.lower[row] = lower;
        self.structure.rows.upper[row] = upper;
    }
}

impl ProgramBuilder {
    /// The values of the parameters, which are known before the first block.
    pub fn parameters(&mut self, values: &[f64]) {
        self.parameters = values.to_vec();
    }

    /// Adds rows cl <= c(w) <= cu and gives their numbers.
    ///
    /// # Panics
    ///
    /// If there are not as many bounds as rows, or if the arguments of the block do not fit together.
    pub fn rows(&mut self, block: Block, lower: &[f64], upper: &[f64]) -> Range<usize> {
        self.check(&block);
        let n_rows = block.values.n_outputs() * block.n_places;
        assert_eq!(lower.len(), n_rows, "one lower bound per row");
        assert_eq!(upper.len(), n_rows, "one upper bound per row");
        let first = self.structure.rows.lower.len();
        self.structure.rows.lower.extend_from_slice(lower);
        self.structure.rows.upper.extend_from_slice(upper);
        let rows = first..first + n_rows;
        self.blocks.push((rows.clone(), block));
        rows
    }

    /// Adds all outputs at all places to the objective, and gives the number of the term that they are.
    ///
    /// # Panics
    ///
    /// If the arguments of the block do not fit together.
    pub fn objective(&mut self, block: Block) -> usize {
        self.check(&block);
        self.terms.push(block);
        self.terms.len() - 1
    }

    /// Adds a pair of sides that are there already.
    ///
    /// # Panics
    ///
    /// If a side has no finite lower bound, or is a row with a finite upper one.
    pub fn pair(&mut self, pair: Pair) {
        for side in [pair.a, pair.b] {
            let lower = match side {
                Side::Variable(variable) => self.structure.variables.lower[variable as usize],
                Side::Row(row) => {
                    let upper = self.structure.rows.upper[row as usize];
                    assert_eq!(upper, f64::INFINITY, "a row of a pair has no upper bound");
                    self.structure.rows.lower[row as usize]
                }
            };
            assert!(lower.is_finite(), "the sides of a pair have lower bounds");
        }
        self.pairs.push(pair);
    }

    /// Makes the derivatives and their patterns.
    pub fn finish(self) -> Program {
        let n = self.structure.variables.lower.len();
        let mut slopes = Vec::new();
        let mut curvatures = Vec::new();
        let (mut of_rows, mut of_terms) = (Vec::new(), Vec::new());
        for (rows, block) in self.blocks {
            let found = Slopes::new(&block);
            let first = rows.start;
            let entries = found.entries.iter();
            slopes.extend(entries.map(|&(row, column)| (first as u32 + row, column)));
            let block = Compiled::new(block, rows, &found, &mut curvatures);
            of_rows.push((block, found));
        }
        for block in self.terms {
            let found = Slopes::new(&block);
            let block = Compiled::new(block, 0..0, &found, &mut curvatures);
            of_terms.push((block, found));
        }
        let jacobian = Pattern::new(self.structure.rows.lower.len(), slopes);
        let hessian = Pattern::new(n, curvatures);

        for (block, found) in &mut of_rows {
            let first = block.first_row();
            let place = |(row, column): (u32, u32)| {
                let place = jacobian.place(first + row as usize, column);
                place.expect("the pattern has all entries") as u32
            };
            block.scatter_slopes(found, place);
            block.scatter_curvature(&hessian);
        }
        let mut terms = Vec::with_capacity(of_terms.len());
        for (mut block, found) in of_terms {
            block.scatter_slopes(&found, |(_, column)| column);
            block.scatter_curvature(&hessian);
            terms.push(Term {
                block,
                constant: Vec::new(),
                is_constant: found.entries.is_empty(),
                weight: 1.0,
            });
        }
        let mut program = Program {
            constant_slopes: vec![0.0; jacobian.n_entries()],
            constant_gradient: vec![0.0; n],
            structure: HeldStructure {
                jacobian,
                hessian,
                ..self.structure
            },
            pairs: self.pairs,
            blocks: of_rows.into_iter().map(|(block, _)| block).collect(),
            terms,
        };
        program.set_parameters(&self.parameters);
        program
    }

    fn check(&self, block: &Block) {
        block.check(self.structure.variables.lower.len());
        let known = |&parameter: &u32| (parameter as usize) < self.parameters.len();
        assert!(block.parameters.iter().all(known), "parameters are known");
    }
}

impl Block {
    fn check(&self, n_variables: usize) {
        let n = self.n_places;
        let places = |length: usize| match n {
            0 => {
                assert_eq!(length, 0, "no argument where there is no place");
                None
            }
            _ => {
                assert_eq!(length % n, 0, "one argument per place");
                Some(length / n)
            }
        };
        let counts = (places(self.variables.len()), places(self.numbers.len()));
        if let (Some(variables), Some(numbers)) = counts {
            let n_inputs = variables + numbers + self.parameters.len();
            assert_eq!(n_inputs, self.values.n_inputs(), "one argument per input");
        }
        let known = |&variable: &u32| (variable as usize) < n_variables;
        assert!(self.variables.iter().all(known), "arguments are variables");
    }
}

impl Nlp for Program {
    fn structure(&self) -> Structure<'_> {
        self.structure.view()
    }

    fn has_objective(&self) -> bool {
        let mut terms = self.terms.iter();
        terms.any(|term| term.weight != 0.0 && !term.is_constant)
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        let terms = self.terms.iter_mut().filter(|term| term.weight != 0.0);
        terms.map(|term| term.weight * term.block.sum(w)).sum()
    }

    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        gradient.copy_from_slice(&self.constant_gradient);
        for term in self.terms.iter_mut().filter(|term| term.weight != 0.0) {
            term.block.add_slopes(w, term.weight, gradient);
        }
    }

    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        for block in &mut self.blocks {
            block.rows(w, rows);
        }
    }

    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        entries.copy_from_slice(&self.constant_slopes);
        for block in &mut self.blocks {
            block.add_slopes(w, 1.0, entries);
        }
    }

    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        entries.fill(0.0);
        for term in self.terms.iter_mut().filter(|term| term.weight != 0.0) {
            let weights = block::Weights::Factor(factor * term.weight);
            term.block.add_curvature(w, weights, entries);
        }
        for block in &mut self.blocks {
            block.add_curvature(w, block::Weights::Rows(y), entries);
        }
    }
}

impl Mpcc for Program {
    fn pairs(&self) -> &[Pair] {
        &self.pairs
    }
}

#[cfg(test)]
mod tests;
