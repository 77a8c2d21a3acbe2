//! Where numbers are: one place per time, state, α and coefficient for values at a point, one row each
//! for series, and behind them what functions need for themselves.

use std::ops::Range;
use std::sync::Arc;

use crate::hybrid::periodic::latest;
use crate::hybrid::{HybridSystem, Input, Piecewise, write_pieces};
use crate::tape::{self, Ball, Depends, Lane, Rounded, Row, UNBOUNDED};

/// The order to which ψ is needed beyond that of α, which follows from it.
pub(crate) const LOOKAHEAD: usize = 1;

/// What functions compute with: numbers, intervals and numbers with their running errors.
#[derive(Default)]
pub(crate) struct Registers {
    pub numbers: Vec<f64>,
    pub balls: Vec<Ball>,
    pub rounded: Vec<Rounded>,
}

impl Registers {
    /// Makes room for functions with so many.
    pub(crate) fn reserve(&mut self, wanted: usize) {
        if self.numbers.len() < wanted {
            self.numbers.resize(wanted, 0.0);
            self.balls.resize(wanted, Ball::splat(0.0));
        }
    }
}

/// Values at a point and Taylor coefficients around one.
pub(crate) struct Memory {
    pub n_states: usize,
    n_switches: usize,
    n_coefficients: usize,
    n_parameters: usize,
    /// Functions of time that are made of pieces.
    pub data: Vec<Arc<Piecewise>>,
    /// The order of an expansion of the states, up to that for which rows have room.
    pub order: usize,
    /// Length of a row: the orders of a series.
    pub stride: usize,
    /// The order up to which the last expansion has no term that overflows.
    pub known: usize,
    /// t, x, α, the coefficients of pieces, parameters, and then numbers of functions.
    pub values: Vec<f64>,
    /// One row after another, in the same order; then the rows of functions.
    pub rows: Vec<f64>,
    /// 0, 1, 2, ...
    pub weights: Vec<f64>,
    /// How often coefficients or parameters have been replaced.
    pub version: usize,
}

impl Memory {
    pub(crate) fn new(system: &HybridSystem, order: usize) -> Self {
        let (n_states, n_switches) = (system.n_states(), system.n_switches());
        let n_coefficients = system.n_coefficients();
        let stride = order + LOOKAHEAD + 1;
        let n_slots = 1 + n_states + n_switches + n_coefficients + system.parameters.len();
        let mut memory = Memory {
            n_states,
            n_switches,
            n_coefficients,
            n_parameters: system.parameters.len(),
            data: system.data.clone(),
            order,
            stride,
            known: order,
            values: vec![0.0; n_slots],
            rows: vec![0.0; n_slots * stride],
            weights: tape::weights(stride),
            version: 0,
        };
        memory.set_parameters(&system.parameters);
        memory
    }

    /// The place of an input among the values; a number gets a new one.
    pub(crate) fn slot(&mut self, input: Input) -> usize {
        match input {
            Input::Time => 0,
            Input::State(state) => 1 + state,
            Input::Alpha(switch) => 1 + self.n_states + switch,
            Input::Coefficient(at) => self.coefficients().start + at,
            Input::Parameter(at) => self.parameters().start + at,
            Input::Number(number) => {
                self.values.push(number);
                self.values.len() - 1
            }
        }
    }

    /// The value of an input where the point is.
    pub(crate) fn value(&mut self, input: Input) -> f64 {
        match input {
            Input::Number(number) => number,
            input => {
                let slot = self.slot(input);
                self.values[slot]
            }
        }
    }

    /// The row of an input; a number gets a new one.
    pub(crate) fn row(&mut self, input: Input) -> Row {
        let depends = match input {
            Input::Time | Input::Coefficient(_) | Input::Parameter(_) | Input::Number(_) => {
                Depends::Time
            }
            Input::State(_) => Depends::State,
            Input::Alpha(_) => Depends::Alpha,
        };
        let (start, degree) = match input {
            Input::Time => (0, 1),
            Input::State(state) => (self.state(state), UNBOUNDED),
            Input::Alpha(switch) => (self.alpha(switch), UNBOUNDED),
            Input::Coefficient(at) => ((self.coefficients().start + at) * self.stride, 0),
            Input::Parameter(at) => ((self.parameters().start + at) * self.stride, 0),
            Input::Number(number) => {
                let start = self.grow(1);
                self.rows[start] = number;
                (start, 0)
            }
        };
        Row {
            start,
            degree,
            depends,
        }
    }

    /// The degree of an input as a polynomial in time, where those of states are known and nothing slides.
    pub(crate) fn degree(input: Input, states: &[u32]) -> u32 {
        match input {
            Input::Time => 1,
            Input::State(state) => states[state],
            Input::Alpha(_) | Input::Coefficient(_) | Input::Parameter(_) | Input::Number(_) => 0,
        }
    }

    /// New rows behind all others; where they start.
    pub(crate) fn grow(&mut self, n_rows: usize) -> usize {
        let start = self.rows.len();
        self.rows.resize(start + n_rows * self.stride, 0.0);
        start
    }

    /// The series whose row starts here, as far as those of states are known.
    pub(crate) fn series(&self, start: usize) -> &[f64] {
        &self.rows[start..=start + self.order]
    }

    /// Where the row of a state starts.
    pub(crate) fn state(&self, state: usize) -> usize {
        (1 + state) * self.stride
    }

    /// Where the row of an α starts.
    pub(crate) fn alpha(&self, switch: usize) -> usize {
        (1 + self.n_states + switch) * self.stride
    }

    /// The places of the coefficients among the values, and their rows among the rows.
    pub(crate) fn coefficients(&self) -> Range<usize> {
        let start = 1 + self.n_states + self.n_switches;
        start..start + self.n_coefficients
    }

    /// The places of the parameters among the values, and their rows among the rows.
    pub(crate) fn parameters(&self) -> Range<usize> {
        let start = self.coefficients().end;
        start..start + self.n_parameters
    }

    /// Takes other values of the parameters.
    pub(crate) fn set_parameters(&mut self, parameters: &[f64]) {
        self.version += 1;
        for (place, &parameter) in self.parameters().zip(parameters) {
            self.values[place] = parameter;
            self.rows[place * self.stride] = parameter;
        }
    }

    /// Takes the coefficients that hold from `t` on, and gives the instant at which they change: the last of those that
    /// are one with the first of them.
    pub(crate) fn load(&mut self, system: &HybridSystem, t: f64) -> f64 {
        self.version += 1;
        let places = self.coefficients();
        write_pieces(&self.data, t, &mut self.values[places.clone()]);
        for place in places {
            self.rows[place * self.stride] = self.values[place];
        }
        let ends = self.data.iter().map(|data| data.piece(t).end);
        latest(ends.chain([system.next_stop(t)]))
    }

    /// Sets t, x and α at a point.
    pub(crate) fn set(&mut self, t: f64, x: &[f64], alpha: &[f64]) {
        let n = self.n_states;
        self.values[0] = t;
        self.values[1..=n].copy_from_slice(x);
        self.values[1 + n..1 + n + alpha.len()].copy_from_slice(alpha);
    }
}
