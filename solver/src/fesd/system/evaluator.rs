//! Several functions of one point.

use crate::tape::Tape;

/// Inputs that tapes share, and registers for any of them.
pub(crate) struct Evaluator {
    /// t, x, what else there is, and the numbers that change at breakpoints.
    pub inputs: Vec<f64>,
    registers: Vec<f64>,
}

impl Evaluator {
    /// Memory for tapes with so many inputs.
    pub fn new<const N: usize>(n_inputs: usize, tapes: [&Tape; N]) -> Self {
        Evaluator {
            inputs: vec![0.0; n_inputs],
            registers: vec![0.0; n_registers(tapes)],
        }
    }

    /// Moves to a point.
    pub fn set(&mut self, t: f64, x: impl Iterator<Item = f64>) {
        self.inputs[0] = t;
        debug_assert!(x.size_hint().0 < self.inputs.len(), "x has a place");
        for (input, x) in self.inputs[1..].iter_mut().zip(x) {
            *input = x;
        }
    }

    /// Takes the numbers that hold from here on.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        let first = self.inputs.len() - numbers.len();
        self.inputs[first..].copy_from_slice(numbers);
    }

    /// Evaluates a tape at the inputs.
    pub fn eval<'e>(&'e mut self, tape: &'e Tape) -> impl Iterator<Item = f64> + 'e {
        self.registers[..self.inputs.len()].copy_from_slice(&self.inputs);
        tape.run(&mut self.registers);
        self.results(tape)
    }

    /// The values of the tape that was evaluated last.
    pub fn results<'e>(&'e self, tape: &'e Tape) -> impl Iterator<Item = f64> + 'e {
        tape.results(&self.registers)
    }
}

/// Registers that serve any of several tapes, and hold the inputs.
pub(crate) fn n_registers<const N: usize>(tapes: [&Tape; N]) -> usize {
    let registers = tapes.map(|tape| tape.n_registers().max(tape.n_inputs()));
    registers.into_iter().max().unwrap_or(0)
}
