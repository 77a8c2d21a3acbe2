//! One block: its functions, and where their values go.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::Block;
use crate::hybrid::check::{Fault, must};
use crate::optimization::problem::Pattern;
use crate::tape::{Derivative, LaneScratch, Tape};

/// Values of a function that is read, at most.
const MOST_VALUES: usize = 1 << 26;

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
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Compiled {
    rows: Range<usize>,
    inputs: Inputs,
    values: Function,
    slopes: Function,
    /// The slopes that do not change with the variables.
    constant: Function,
    curvature: Function,
    /// Row and column of each output of the curvature at each place.
    curvature_at: Vec<(u32, u32)>,
    /// What is added twice: both triangles of arguments that are one variable; output and entry.
    twice: Vec<(u32, u32)>,
}

/// The inputs of all functions of a block.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Inputs {
    n_places: usize,
    /// Indices of the variables that are the first inputs.
    gather: Vec<u32>,
    /// The indices of the parameters that are the last inputs but weights.
    parameters: Vec<u32>,
    /// Variables, numbers and parameters at all places, then weights.
    values: Vec<f64>,
    n_weights: usize,
}

impl Inputs {
    /// All but the weights.
    fn of_values(&self) -> &[f64] {
        &self.values[..self.values.len() - self.n_weights]
    }

    /// Sets the variables.
    fn gather(&mut self, w: &[f64]) {
        for (input, &index) in self.values.iter_mut().zip(&self.gather) {
            *input = w[index as usize];
        }
    }

    /// Sets the parameters, which are the same at all places.
    fn set_parameters(&mut self, values: &[f64]) {
        let end = self.values.len() - self.n_weights;
        let first = end - self.parameters.len() * self.n_places;
        let places = self.values[first..end].chunks_mut(self.n_places.max(1));
        for (places, &parameter) in places.zip(&self.parameters) {
            places.fill(values[parameter as usize]);
        }
    }

    fn weights_mut(&mut self) -> &mut [f64] {
        let first = self.values.len() - self.n_weights;
        &mut self.values[first..]
    }
}

/// A tape with memory for its evaluation.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "Applied", into = "Applied")]
struct Function {
    tape: Tape,
    scratch: LaneScratch,
    n_places: usize,
    outputs: Vec<f64>,
    /// The entry that each of the outputs is added to.
    to: Vec<u32>,
}

/// What a function is written as; all else of it is memory.
#[derive(Serialize, Deserialize)]
struct Applied {
    tape: Tape,
    n_places: usize,
    to: Vec<u32>,
}

impl From<Function> for Applied {
    fn from(function: Function) -> Self {
        Applied {
            tape: function.tape,
            n_places: function.n_places,
            to: function.to,
        }
    }
}

impl TryFrom<Applied> for Function {
    type Error = Fault;

    fn try_from(Applied { tape, n_places, to }: Applied) -> Result<Self, Fault> {
        let n_values = n_places.checked_mul(tape.n_outputs().max(1));
        let are_few = n_values.is_some_and(|n| n <= MOST_VALUES);
        must(are_few, "a function has too many values")?;
        let function = Function::new(tape, n_places);
        Ok(Function { to, ..function })
    }
}

impl Function {
    /// Whether it has so many inputs at so many places, and each of its values one of so many places to go to.
    fn fits(&self, [n_inputs, n_places, n_entries]: [usize; 3]) -> bool {
        self.tape.n_inputs() == n_inputs
            && self.n_places == n_places
            && self.to.len() == self.outputs.len()
            && self.to.iter().all(|&to| (to as usize) < n_entries)
    }

    fn new(tape: Tape, n_places: usize) -> Self {
        Function {
            scratch: tape.lane_scratch(),
            n_places,
            outputs: vec![0.0; tape.n_outputs() * n_places],
            to: Vec::new(),
            tape,
        }
    }

    fn eval(&mut self, inputs: &[f64]) -> &[f64] {
        let (outputs, scratch) = (&mut self.outputs, &mut self.scratch);
        (self.tape).eval_many(inputs, outputs, self.n_places, scratch);
        &self.outputs
    }

    /// Adds the outputs to entries, with a weight.
    fn add(&mut self, inputs: &[f64], weight: f64, entries: &mut [f64]) {
        self.eval(inputs);
        for (value, &entry) in self.outputs.iter().zip(&self.to) {
            entries[entry as usize] += weight * value;
        }
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
            rows,
            inputs: Inputs {
                n_places: n,
                gather: block.variables,
                parameters: block.parameters,
                values: inputs,
                n_weights,
            },
            values: Function::new(block.values, n),
            slopes: Function::new(slopes.derivative.tape.clone(), n),
            constant: Function::new(slopes.derivative.constant.clone(), n),
            curvature: Function::new(curvature.tape, n),
            curvature_at,
            twice,
        }
    }

    /// How many parameters of the program it needs.
    pub(crate) fn n_parameters(&self) -> usize {
        let last = self.inputs.parameters.iter().max();
        last.map_or(0, |last| *last as usize + 1)
    }

    /// Whether its values are rows of a program that has so many.
    pub(crate) fn has_rows_among(&self, n_rows: usize) -> bool {
        let Range { start, end } = self.rows;
        start <= end && end <= n_rows && end - start == self.values.outputs.len()
    }

    /// Whether its functions fit each other, so many variables, and the places of slopes and second derivatives.
    pub(crate) fn fits(&self, n_variables: usize, [slopes, curvatures]: [usize; 2]) -> bool {
        let (inputs, values) = (&self.inputs, &self.values);
        let (n, n_inputs, n_outputs) = (
            inputs.n_places,
            values.tape.n_inputs(),
            values.tape.n_outputs(),
        );
        let is_fed = values.n_places == n
            && inputs.n_weights == n_outputs * n
            && inputs.values.len() == (n_inputs + n_outputs) * n
            && inputs.gather.len() + inputs.parameters.len() * n <= n_inputs * n
            && (inputs.gather.iter()).all(|&variable| (variable as usize) < n_variables);
        let mut twice = self.twice.iter();
        is_fed
            && self.slopes.fits([n_inputs, n, slopes])
            && self.constant.fits([n_inputs, n, slopes])
            && (self.curvature).fits([n_inputs + n_outputs, n, curvatures])
            && twice.all(|&(output, entry)| {
                let outputs = self.curvature.outputs.len();
                (output as usize) < outputs && (entry as usize) < curvatures
            })
    }

    pub(crate) fn first_row(&self) -> usize {
        self.rows.start
    }

    /// Notes where slopes go.
    pub(crate) fn scatter_slopes(&mut self, slopes: &Slopes, place: impl Fn((u32, u32)) -> u32) {
        let to = slopes.entries.iter().map(|&entry| place(entry));
        self.slopes.to = to.collect();
        self.constant.to = self.slopes.to.split_off(self.slopes.outputs.len());
    }

    /// Sets the parameters among the inputs.
    pub(crate) fn set_parameters(&mut self, values: &[f64]) {
        self.inputs.set_parameters(values);
    }

    /// Adds the slopes that do not change with the variables.
    pub(crate) fn add_constant_slopes(&mut self, entries: &mut [f64]) {
        self.constant.add(self.inputs.of_values(), 1.0, entries);
    }

    /// Notes where second derivatives go.
    pub(crate) fn scatter_curvature(&mut self, pattern: &Pattern) {
        let at = std::mem::take(&mut self.curvature_at).into_iter();
        let place = |(row, column): (u32, u32)| {
            let place = pattern.place(row as usize, column);
            place.expect("the pattern has all entries") as u32
        };
        self.curvature.to = at.map(place).collect();
        for (output, entry) in &mut self.twice {
            *entry = self.curvature.to[*output as usize];
        }
    }

    /// The values at w.
    pub(crate) fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        self.inputs.gather(w);
        let (rows, values) = (&mut rows[self.rows.clone()], &mut self.values);
        let inputs = self.inputs.of_values();
        (values.tape).eval_many(inputs, rows, values.n_places, &mut values.scratch);
    }

    /// The sum of all values at w.
    pub(crate) fn sum(&mut self, w: &[f64]) -> f64 {
        self.inputs.gather(w);
        self.values.eval(self.inputs.of_values()).iter().sum()
    }

    /// Adds the slopes at w that change, with a weight.
    pub(crate) fn add_slopes(&mut self, w: &[f64], weight: f64, entries: &mut [f64]) {
        if !self.slopes.to.is_empty() {
            self.inputs.gather(w);
            self.slopes.add(self.inputs.of_values(), weight, entries);
        }
    }

    /// Adds the weighted second derivatives at w.
    pub(crate) fn add_curvature(&mut self, w: &[f64], weights: Weights, entries: &mut [f64]) {
        if self.curvature.to.is_empty() {
            return;
        }
        self.inputs.gather(w);
        let of_outputs = self.inputs.weights_mut();
        match weights {
            Weights::Factor(factor) => of_outputs.fill(factor),
            Weights::Rows(y) => of_outputs.copy_from_slice(&y[self.rows.clone()]),
        }
        self.curvature.add(&self.inputs.values, 1.0, entries);
        for &(output, entry) in &self.twice {
            entries[entry as usize] += self.curvature.outputs[output as usize];
        }
    }
}
