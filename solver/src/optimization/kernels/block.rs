//! One block: its functions, and where their values go.

use std::ops::Range;

use super::Block;
use crate::optimization::problem::Pattern;
use crate::tape::{Derivative, LaneScratch, Tape};

/// The Jacobian of a block by its variables.
#[derive(Clone, Debug)]
pub(crate) struct Slopes {
    derivative: Derivative,
    /// Row within the block and variable, for each output of the tapes at each place.
    pub entries: Vec<(u32, u32)>,
}

/// What the rows of a Hessian are weighted with.
#[derive(Clone, Copy)]
pub(crate) enum Weights<'a> {
    /// All outputs by the same.
    Factor(f64),
    /// One multiplier per row of the program.
    Rows(&'a [f64]),
}

/// The functions of one block with all that their evaluation needs.
#[derive(Clone, Debug)]
pub(crate) struct Compiled {
    n_places: usize,
    rows: Range<usize>,
    /// Indices of the variables that are the first inputs.
    gather: Vec<u32>,
    /// The indices of the parameters that are the last inputs but weights.
    parameters: Vec<u32>,
    /// Variables, numbers and parameters at all places, then weights.
    inputs: Vec<f64>,
    n_weights: usize,
    values: Function,
    slopes: Function,
    /// The slopes that do not change with the variables.
    constant: Function,
    curvature: Function,
    /// The entry of the Jacobian or gradient that each of the slopes is added to: of those that change, and of the others.
    slopes_to: Vec<u32>,
    constant_to: Vec<u32>,
    /// Row and column of each output of the curvature at each place, and its entry of the Hessian.
    curvature_at: Vec<(u32, u32)>,
    curvature_to: Vec<u32>,
    /// What is added twice: both triangles of arguments that are one variable; output and entry.
    twice: Vec<(u32, u32)>,
}

/// A tape with memory for its evaluation.
#[derive(Clone, Debug)]
struct Function {
    tape: Tape,
    scratch: LaneScratch,
    outputs: Vec<f64>,
}

impl Function {
    fn new(tape: Tape, n_places: usize) -> Self {
        Function {
            scratch: tape.lane_scratch(),
            outputs: vec![0.0; tape.n_outputs() * n_places],
            tape,
        }
    }

    fn eval(&mut self, inputs: &[f64], n_places: usize) -> &[f64] {
        let (outputs, scratch) = (&mut self.outputs, &mut self.scratch);
        self.tape.eval_many(inputs, outputs, n_places, scratch);
        &self.outputs
    }
}

impl Slopes {
    pub(crate) fn new(block: &Block) -> Self {
        let n = block.n_places;
        let derivative = block.values.jacobian(block.n_variables());
        let entries = derivative.entries.iter().flat_map(|&(output, argument)| {
            let (output, argument) = (output as usize, argument as usize);
            (0..n).map(move |place| {
                let row = (output * n + place) as u32;
                (row, block.variables[argument * n + place])
            })
        });
        Slopes {
            entries: entries.collect(),
            derivative,
        }
    }
}

impl Block {
    fn n_variables(&self) -> usize {
        self.variables.len().checked_div(self.n_places).unwrap_or(0)
    }
}

impl Compiled {
    /// `curvatures` receives row and column of the entries of the Hessian.
    pub(crate) fn new(
        block: Block,
        rows: Range<usize>,
        slopes: &Slopes,
        curvatures: &mut Vec<(u32, u32)>,
    ) -> Self {
        let n = block.n_places;
        let n_weights = block.values.n_outputs() * n;
        let curvature = block.values.hessian(block.n_variables());
        let at = |&(i, j): &(u32, u32)| {
            let [i, j] = [i, j].map(|argument| argument as usize * n);
            let (variables, n) = (&block.variables, n);
            (0..n).map(move |place| {
                let (v, w) = (variables[i + place], variables[j + place]);
                (v.max(w), v.min(w))
            })
        };
        let curvature_at: Vec<(u32, u32)> = curvature.entries.iter().flat_map(at).collect();
        curvatures.extend_from_slice(&curvature_at);
        let twice = curvature.entries.iter().enumerate();
        let twice = twice
            .filter(|(_, (i, j))| i != j)
            .flat_map(|(output, _)| output * n..(output + 1) * n);
        let twice = twice.filter(|&at| curvature_at[at].0 == curvature_at[at].1);
        let twice = twice.map(|at| (at as u32, 0)).collect();
        let mut inputs = vec![0.0; block.variables.len()];
        inputs.extend_from_slice(&block.numbers);
        inputs.resize(inputs.len() + block.parameters.len() * n + n_weights, 0.0);
        debug_assert_eq!(
            curvature.constant.n_outputs(),
            0,
            "weights are in all entries"
        );
        Compiled {
            n_places: n,
            rows,
            gather: block.variables,
            parameters: block.parameters,
            inputs,
            n_weights,
            values: Function::new(block.values, n),
            slopes: Function::new(slopes.derivative.tape.clone(), n),
            constant: Function::new(slopes.derivative.constant.clone(), n),
            curvature: Function::new(curvature.tape, n),
            slopes_to: Vec::new(),
            constant_to: Vec::new(),
            curvature_at,
            curvature_to: Vec::new(),
            twice,
        }
    }

    pub(crate) fn first_row(&self) -> usize {
        self.rows.start
    }

    /// Notes where slopes go.
    pub(crate) fn scatter_slopes(&mut self, slopes: &Slopes, place: impl Fn((u32, u32)) -> u32) {
        let to = slopes.entries.iter().map(|&entry| place(entry));
        self.slopes_to = to.collect();
        self.constant_to = self.slopes_to.split_off(self.slopes.outputs.len());
    }

    /// Sets the parameters among the inputs, which are the same at all places.
    pub(crate) fn set_parameters(&mut self, values: &[f64]) {
        let n_inputs = self.inputs.len() - self.n_weights;
        let first = n_inputs - self.parameters.len() * self.n_places;
        let places = self.inputs[first..n_inputs].chunks_mut(self.n_places.max(1));
        for (places, &parameter) in places.zip(&self.parameters) {
            places.fill(values[parameter as usize]);
        }
    }

    /// Adds the slopes that do not change with the variables.
    pub(crate) fn add_constant_slopes(&mut self, entries: &mut [f64]) {
        let n_inputs = self.inputs.len() - self.n_weights;
        let slopes = (self.constant).eval(&self.inputs[..n_inputs], self.n_places);
        add(slopes, &self.constant_to, entries);
    }

    /// Notes where second derivatives go.
    pub(crate) fn scatter_curvature(&mut self, pattern: &Pattern) {
        let at = std::mem::take(&mut self.curvature_at).into_iter();
        let place = |(row, column): (u32, u32)| {
            let place = pattern.place(row as usize, column);
            place.expect("the pattern has all entries") as u32
        };
        self.curvature_to = at.map(place).collect();
        for (output, entry) in &mut self.twice {
            *entry = self.curvature_to[*output as usize];
        }
    }

    /// The values at w.
    pub(crate) fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        let n_inputs = self.gather(w);
        let (rows, scratch) = (&mut rows[self.rows.clone()], &mut self.values.scratch);
        let inputs = &self.inputs[..n_inputs];
        (self.values.tape).eval_many(inputs, rows, self.n_places, scratch);
    }

    /// The sum of all values at w.
    pub(crate) fn sum(&mut self, w: &[f64]) -> f64 {
        let n_inputs = self.gather(w);
        let values = (self.values).eval(&self.inputs[..n_inputs], self.n_places);
        values.iter().sum()
    }

    /// Adds the slopes at w that change.
    pub(crate) fn add_slopes(&mut self, w: &[f64], entries: &mut [f64]) {
        if self.slopes_to.is_empty() {
            return;
        }
        let n_inputs = self.gather(w);
        let slopes = (self.slopes).eval(&self.inputs[..n_inputs], self.n_places);
        add(slopes, &self.slopes_to, entries);
    }

    /// Adds the weighted second derivatives at w.
    pub(crate) fn add_curvature(&mut self, w: &[f64], weights: Weights, entries: &mut [f64]) {
        if self.curvature_to.is_empty() {
            return;
        }
        let n_inputs = self.gather(w);
        let inputs = &mut self.inputs[n_inputs..];
        match weights {
            Weights::Factor(factor) => inputs.fill(factor),
            Weights::Rows(y) => inputs.copy_from_slice(&y[self.rows.clone()]),
        }
        let curvature = self.curvature.eval(&self.inputs, self.n_places);
        add(curvature, &self.curvature_to, entries);
        for &(output, entry) in &self.twice {
            entries[entry as usize] += curvature[output as usize];
        }
    }

    /// Sets the variables among the inputs; gives the number of inputs without weights.
    fn gather(&mut self, w: &[f64]) -> usize {
        for (input, &index) in self.inputs.iter_mut().zip(&self.gather) {
            *input = w[index as usize];
        }
        self.inputs.len() - self.n_weights
    }
}

fn add(values: &[f64], to: &[u32], entries: &mut [f64]) {
    for (value, &entry) in values.iter().zip(to) {
        entries[entry as usize] += value;
    }
}
