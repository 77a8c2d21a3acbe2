//! Taylor arithmetic: the Taylor coefficients of the outputs from those of the inputs, order by order.
//!
//! A coefficient is normalised: the row of `x` holds `x_k = x^(k)(t) / k!`. A function `w(u)` that solves a
//! differential equation gives a recurrence for its coefficients, as `w = exp(u)`, `w' = w u'` gives
//! `k w_k = Σ_{j=1..k} j u_j w_{k-j}`. These recurrences are classical: Griewank & Walther 2008, chapter 13;
//! Jorba & Zou 2005. Sums and numeric multiples cost O(1) per order, all else O(k).
//!
//! For an ordinary differential equation `x' = f(x)` the coefficient of order `k` of `f` gives the one of order
//! `k + 1` of `x`, which is the next input.

use rustc_hash::FxHashMap;

use super::bulk::fill_all;
use super::row::{Depends, Row, UNBOUNDED};
use super::steps::{Kind, Step, advance_all, start_all};
use crate::tape::{Slot, Tape, UNUSED};

/// The Taylor coefficients of all values of one tape up to a fixed order.
#[derive(Clone, Debug)]
pub struct Jet {
    tape: Tape,
    /// The orders of one row.
    stride: usize,
    /// The degrees of the inputs as polynomials in time.
    degrees: Vec<u32>,
    recurrences: Recurrences,
    data: Vec<f64>,
    weights: Vec<f64>,
}

/// The recurrences of a tape on rows of memory that it may share with other tapes: its inputs are
/// anywhere in front of its own rows.
#[derive(Clone, Debug)]
pub(crate) struct Recurrences {
    /// Steps that depend on time alone, whose results all others may read.
    pub timed: Vec<Step>,
    /// All others, in order.
    pub moving: Vec<Step>,
    /// Those of them that depend on α.
    pub by_alpha: Vec<Step>,
    /// Those that move and may hide what they do within a step.
    pub hiding: Vec<Step>,
    /// Where the rows of the outputs start, and their degrees as polynomials in time, as far as those of the inputs tell.
    pub outputs: Vec<usize>,
    pub degrees: Vec<u32>,
    /// Where the rows behind its own start.
    pub end: usize,
}

impl Recurrences {
    /// Places a tape; `base` is where its own rows start and `stride` the length of every row.
    pub fn new(tape: &Tape, inputs: &[Row], base: usize, stride: usize) -> Self {
        let unknown = Row {
            start: 0,
            degree: UNBOUNDED,
            depends: Depends::Time,
        };
        let mut row_of = inputs.to_vec();
        row_of.resize(tape.n_values, unknown);
        let mut factors = vec![1.0; tape.n_values];
        let mut end = base;
        let (mut timed, mut moving, mut by_alpha) = (Vec::new(), Vec::new(), Vec::new());
        for instruction in &tape.values {
            let ([a, b], c) = instruction.op.parts();
            let row = |value: Slot| match value {
                UNUSED => unknown,
                _ => row_of[value as usize],
            };
            let kind = Kind::of(instruction.op);
            let of = |value: Slot| match value {
                UNUSED => 0.0,
                _ => factors[value as usize],
            };
            let count = kind.factors([of(a), of(b)]);
            let c = if kind.is_product() { count } else { c };
            factors[instruction.out as usize] = count;
            let step = Step::new(kind, end, [row(a), row(b)], c);
            let depends = row(a).depends.max(row(b).depends);
            let result = |start: usize| Row {
                start,
                degree: step.degree,
                depends,
            };
            row_of[instruction.out as usize] = result(end);
            if instruction.second != UNUSED {
                row_of[instruction.second as usize] = result(end + stride);
            }
            end += (1 + step.kind.n_helpers()) * stride;
            match depends {
                Depends::Time => timed.push(step),
                _ => moving.push(step),
            }
            if depends == Depends::Alpha {
                by_alpha.push(step);
            }
        }
        let outputs = tape.outputs.iter().map(|&value| row_of[value as usize]);
        Recurrences {
            outputs: outputs.clone().map(|row| row.start).collect(),
            degrees: outputs.map(|row| row.degree).collect(),
            hiding: moving
                .iter()
                .filter(|step| step.can_hide())
                .copied()
                .collect(),
            timed,
            moving,
            by_alpha,
            end,
        }
    }

    /// The degrees of the outputs of a tape as polynomials in time, where those of its inputs are these.
    pub fn degrees(tape: &Tape, inputs: &[u32]) -> Vec<u32> {
        place(tape, inputs, 1).degrees
    }
}

/// The weights of the orders of one row: 0, 1, 2, ...
pub(crate) fn weights(stride: usize) -> Vec<f64> {
    (0..stride).map(|k| k as f64).collect()
}

impl Jet {
    /// Memory for the orders `0..=max_order` of the values of a tape.
    pub fn new(tape: &Tape, max_order: usize) -> Self {
        let stride = max_order + 1;
        let degrees = vec![UNBOUNDED; tape.n_inputs];
        let recurrences = place(tape, &degrees, stride);
        Self {
            tape: tape.clone(),
            stride,
            degrees,
            data: vec![0.0; recurrences.end],
            recurrences,
            weights: weights(stride),
        }
    }

    /// The highest order.
    pub fn max_order(&self) -> usize {
        self.stride - 1
    }

    /// Promises that an input is a polynomial in time of this degree: time itself has degree 1, a parameter 0.
    ///
    /// Clears all coefficients.
    pub fn bound_degree(&mut self, input: usize, degree: usize) {
        self.bound_degrees([(input, degree)]);
    }

    /// The same of several inputs.
    pub(crate) fn bound_degrees(&mut self, degrees: impl IntoIterator<Item = (usize, usize)>) {
        for (input, degree) in degrees {
            self.degrees[input] = u32::try_from(degree).unwrap_or(UNBOUNDED);
        }
        self.data.fill(0.0);
        self.recurrences = place(&self.tape, &self.degrees, self.stride);
    }

    /// All coefficients of an input, to be set.
    pub(crate) fn input_row_mut(&mut self, input: usize) -> &mut [f64] {
        &mut self.data[input * self.stride..][..self.stride]
    }

    /// Sets the coefficient of order `k` of an input.
    pub fn set_input(&mut self, input: usize, k: usize, value: f64) {
        assert!(
            input < self.tape.n_inputs && k < self.stride,
            "inputs and orders were fixed at the start"
        );
        self.data[input * self.stride + k] = value;
    }

    /// The coefficient of order `k` of an input.
    pub fn input(&self, input: usize, k: usize) -> f64 {
        self.input_row(input)[k]
    }

    /// The coefficients of an input, all orders.
    pub fn input_row(&self, input: usize) -> &[f64] {
        assert!(
            input < self.tape.n_inputs,
            "the tape has {} inputs",
            self.tape.n_inputs
        );
        &self.data[input * self.stride..][..self.stride]
    }

    /// The coefficient of order `k` of an output.
    pub fn output(&self, output: usize, k: usize) -> f64 {
        self.data[self.recurrences.outputs[output] + k]
    }

    /// The coefficients of an output, all orders.
    pub fn output_row(&self, output: usize) -> &[f64] {
        &self.data[self.recurrences.outputs[output]..][..self.stride]
    }

    /// Of every output, the first one that is the same value.
    pub(crate) fn same_outputs(&self) -> Vec<usize> {
        let mut first = FxHashMap::default();
        let outputs = self.recurrences.outputs.iter().enumerate();
        outputs
            .map(|(at, start)| *first.entry(start).or_insert(at))
            .collect()
    }

    /// Computes the coefficients of order `k` from the inputs up to order `k` and everything of lower order.
    ///
    /// It may be called again for the same `k` when inputs of that order have changed.
    pub fn advance(&mut self, k: usize) {
        assert!(k < self.stride, "the highest order was fixed at the start");
        let Recurrences { timed, moving, .. } = &self.recurrences;
        for steps in [timed, moving] {
            match k {
                0 => start_all(steps, &mut self.data, self.stride),
                _ => advance_all(steps, &mut self.data, &self.weights, k, self.stride),
            }
        }
    }

    /// Computes the coefficients of all orders at once, from inputs that are known to the highest.
    pub fn fill(&mut self) {
        let Recurrences { timed, moving, .. } = &self.recurrences;
        for steps in [timed, moving] {
            fill_all(
                steps,
                &mut self.data,
                &self.weights,
                self.stride,
                self.stride,
            );
        }
    }
}

/// A tape alone in its memory: the inputs come first.
fn place(tape: &Tape, degrees: &[u32], stride: usize) -> Recurrences {
    let row = |(input, &degree)| Row {
        start: input * stride,
        degree,
        depends: Depends::State,
    };
    let inputs: Vec<Row> = degrees.iter().enumerate().map(row).collect();
    Recurrences::new(tape, &inputs, inputs.len() * stride, stride)
}
