//! One ψ, compiled for the sides of the switches inside it.

use super::field::{gather, run_balls};
use super::layout::Memory;
use crate::hybrid::Input;
use crate::hybrid::form::{Affine, Smooth, Surface};
use crate::tape::{self, Ball, Lane, Recurrences, Rounded, Step, Tame, Tape};

/// ψ for certain sides inside it.
pub(crate) struct Compiled {
    pub form: Form,
    /// (j, ∂ψ/∂x_j) where it was last linearized.
    pub gradient: Vec<(usize, f64)>,
    /// ∂ψ/∂t there.
    pub by_time: f64,
    /// Where its series is, once it was needed.
    pub row: Option<usize>,
    /// What coefficients of an affine function follow from, where they depend on parameters.
    coefficients: Option<Box<Parametric>>,
}

/// An affine function with its coefficients as functions of parameters: the derivatives, and its value at zero.
struct Parametric {
    functions: Smooth,
    gather: Vec<usize>,
    registers: Vec<f64>,
}

pub(crate) enum Form {
    Affine(Affine),
    Smooth(Box<Tapes>),
}

pub(crate) struct Tapes {
    pub functions: Smooth,
    pub gather: Vec<usize>,
    /// The places in the gradient of its entries; none for time.
    pub places: Vec<Option<usize>>,
    pub series: Option<Recurrences>,
    /// Steps of the series that may hide what they do within a step.
    pub hiding: Vec<Step>,
    /// (place in the gradient or none for time, switch, ∂²ψ).
    pub mixed: Vec<(Option<usize>, usize, f64)>,
}

impl Compiled {
    pub(crate) fn new(surface: Surface, memory: &mut Memory) -> Self {
        match surface {
            Surface::Affine(affine) => Compiled {
                gradient: affine.terms.clone(),
                by_time: affine.time,
                row: None,
                form: Form::Affine(affine),
                coefficients: None,
            },
            Surface::Parametric(functions) => {
                let mut surface = Compiled {
                    gradient: Vec::new(),
                    by_time: 0.0,
                    row: None,
                    form: Form::Affine(Affine::default()),
                    coefficients: Some(Box::new(Parametric::new(functions, memory))),
                };
                surface.take_parameters(memory);
                surface
            }
            Surface::Smooth(functions) => {
                let mut gradient = Vec::new();
                let mut place_of = vec![None; functions.inputs.len()];
                for &(_, input) in &functions.gradient.entries {
                    if let Input::State(state) = functions.inputs[input] {
                        place_of[input] = Some(gradient.len());
                        gradient.push((state, 0.0));
                    }
                }
                let entries = functions.gradient.entries.iter();
                let mixed = functions.mixed.entries.iter();
                let mixed = mixed.filter_map(|&(by, alpha)| match functions.inputs[alpha] {
                    Input::Alpha(switch) => Some((place_of[by], switch, 0.0)),
                    _ => None,
                });
                let tapes = Tapes {
                    places: entries.map(|&(_, input)| place_of[input]).collect(),
                    mixed: mixed.collect(),
                    gather: functions.inputs.iter().map(|&i| memory.slot(i)).collect(),
                    series: None,
                    hiding: Vec::new(),
                    functions,
                };
                Compiled {
                    gradient,
                    by_time: 0.0,
                    row: None,
                    form: Form::Smooth(Box::new(tapes)),
                    coefficients: None,
                }
            }
        }
    }

    /// Takes the coefficients of an affine function that parameters make.
    pub(crate) fn take_parameters(&mut self, memory: &Memory) {
        let (Some(coefficients), Form::Affine(affine)) = (&mut self.coefficients, &mut self.form)
        else {
            return;
        };
        coefficients.write(memory, affine);
        self.gradient.clone_from(&affine.terms);
        self.by_time = affine.time;
    }

    /// The row of ψ, and what computes it where it is not affine.
    fn place(&mut self, memory: &mut Memory) -> usize {
        if let Some(row) = self.row {
            return row;
        }
        let row = match &mut self.form {
            Form::Affine(_) => memory.grow(1),
            Form::Smooth(tapes) => {
                let functions = &tapes.functions;
                let inputs: Vec<_> = functions.inputs.iter().map(|&i| memory.row(i)).collect();
                let base = memory.rows.len();
                let series = Recurrences::new(&functions.psi, &inputs, base, memory.stride);
                memory.grow((series.end - base) / memory.stride);
                let hiding = series.moving.iter().filter(|step| step.can_hide());
                tapes.hiding = hiding.copied().collect();
                tapes.series.insert(series).outputs[0]
            }
        };
        *self.row.insert(row)
    }

    /// Computes the coefficient of order k along the series of the states, from all lower ones.
    pub(crate) fn advance(&mut self, memory: &mut Memory, k: usize) {
        let row = self.place(memory);
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = memory;
        match &self.form {
            Form::Affine(affine) => {
                let terms = affine.terms.iter();
                let sum: f64 = terms
                    .map(|&(state, c)| c * rows[(1 + state) * *stride + k])
                    .sum();
                rows[row + k] = sum + affine.term(k, rows[0]);
            }
            Form::Smooth(tapes) => {
                let series = tapes.series.iter();
                for steps in series.flat_map(|series| [&series.timed, &series.moving]) {
                    match k {
                        0 => tape::start_all(steps, rows, *stride),
                        _ => tape::advance_all(steps, rows, weights, k, *stride),
                    }
                }
            }
        }
    }

    /// Computes the coefficients of all orders below `n`.
    pub(crate) fn expand(&mut self, memory: &mut Memory, n: usize) {
        let row = self.place(memory);
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = memory;
        match &self.form {
            Form::Affine(affine) => {
                let (states, own) = rows.split_at_mut(row);
                own[..n].fill(0.0);
                for &(state, c) in &affine.terms {
                    let of_state = &states[(1 + state) * *stride..][..n];
                    for (sum, x) in own.iter_mut().zip(of_state) {
                        *sum += c * x;
                    }
                }
                for (k, sum) in own.iter_mut().enumerate().take(2) {
                    *sum += affine.term(k, states[0]);
                }
            }
            Form::Smooth(tapes) => {
                let series = tapes.series.iter();
                for steps in series.flat_map(|series| [&series.timed, &series.moving]) {
                    tape::fill_all(steps, rows, weights, n, *stride);
                }
            }
        }
    }

    /// Its degree as a polynomial in time, where those of states are known.
    pub(crate) fn degree(&self, states: &[u32]) -> u32 {
        match &self.form {
            Form::Affine(affine) => {
                let terms = affine.terms.iter().map(|&(state, _)| states[state]);
                terms.fold(1, u32::max)
            }
            Form::Smooth(tapes) => {
                let inputs = tapes.functions.inputs.iter();
                let inputs: Vec<u32> = inputs.map(|&i| Memory::degree(i, states)).collect();
                let degrees = Recurrences::degrees(&tapes.functions.psi, &inputs);
                degrees.into_iter().fold(0, u32::max)
            }
        }
    }

    /// Computes the coefficient of order k ≥ 1 again, after that of the states has changed.
    pub(crate) fn correct(&self, memory: &mut Memory, k: usize) {
        if let Form::Smooth(tapes) = &self.form
            && let Some(series) = &tapes.series
        {
            let Memory {
                rows,
                weights,
                stride,
                ..
            } = memory;
            tape::advance_all(&series.moving, rows, weights, k, *stride);
        }
    }

    /// What α of a continuous switch changes in the rate φ through ∇ψ: Σ ∂²ψ/∂x∂α f + ∂²ψ/∂t∂α.
    pub(crate) fn mixed(&self, alpha: usize, f: &[f64]) -> f64 {
        let Form::Smooth(tapes) = &self.form else {
            return 0.0;
        };
        let of_alpha = tapes.mixed.iter().filter(|entry| entry.1 == alpha);
        let rate = |place: Option<usize>| place.map_or(1.0, |at| f[self.gradient[at].0]);
        of_alpha.map(|&(place, _, value)| value * rate(place)).sum()
    }

    /// How far rounding may take ψ from what exact arithmetic gives; 0 where ψ is affine, or no bound is known.
    pub(crate) fn running_error(&self, values: &[f64], registers: &mut Vec<Rounded>) -> f64 {
        let Form::Smooth(tapes) = &self.form else {
            return 0.0;
        };
        let tape = &tapes.functions.psi;
        let input = |slot: usize| Ball::splat(values[slot]);
        run_balls(tape, &tapes.gather, input, registers);
        let error = tape.results(registers).next();
        let error = error.map_or(0.0, |psi| psi.ball().radius);
        if error.is_finite() { error } else { 0.0 }
    }

    /// The same of ∂ψ/∂x and ∂ψ/∂t: calls `see` with the state, or none for time, and its error.
    pub(crate) fn running_errors_of_gradient(
        &self,
        values: &[f64],
        registers: &mut Vec<Rounded>,
        mut see: impl FnMut(Option<usize>, f64),
    ) {
        let Form::Smooth(tapes) = &self.form else {
            return;
        };
        let tape = &tapes.functions.gradient.tape;
        let input = |slot: usize| Ball::splat(values[slot]);
        run_balls(tape, &tapes.gather, input, registers);
        for (place, slope) in tapes.places.iter().zip(tape.results(registers)) {
            let state = place.map(|place| self.gradient[place].0);
            see(state, slope.ball().radius);
        }
    }

    /// Whether ψ may hide what it does within a step h, from the first `n` coefficients of what it reads.
    pub(crate) fn may_hide(&self, memory: &Memory, h: f64, n: usize) -> bool {
        let Form::Smooth(tapes) = &self.form else {
            return false;
        };
        let mut hiding = tapes.hiding.iter();
        hiding.any(|step| step.may_hide(&memory.rows, h, n, memory.stride))
    }

    /// An enclosure of ψ while each input stays in its ball, and whether ψ is tame there: its value at the middle of
    /// the balls is typical. `input` gives the ball of a place in `Memory::values`. None if ψ is affine.
    pub(crate) fn enclose(
        &self,
        input: impl Fn(usize) -> Ball,
        registers: &mut Vec<Tame>,
    ) -> Option<Tame> {
        let Form::Smooth(tapes) = &self.form else {
            return None;
        };
        let psi = &tapes.functions.psi;
        run_balls(psi, &tapes.gather, input, registers);
        psi.results(registers).next()
    }
}

impl Parametric {
    fn new(functions: Smooth, memory: &mut Memory) -> Self {
        let n_registers = (functions.psi.n_registers()).max(functions.gradient.tape.n_registers());
        Parametric {
            gather: functions.inputs.iter().map(|&i| memory.slot(i)).collect(),
            registers: vec![0.0; n_registers],
            functions,
        }
    }

    /// Writes the coefficients.
    fn write(&mut self, memory: &Memory, affine: &mut Affine) {
        let Smooth {
            inputs,
            psi,
            gradient,
            ..
        } = &self.functions;
        let registers = &mut self.registers;
        run(&gradient.tape, &self.gather, &memory.values, registers);
        affine.terms.clear();
        affine.time = 0.0;
        let results = gradient.tape.results(registers);
        for (&(_, input), c) in gradient.entries.iter().zip(results) {
            match inputs[input] {
                Input::State(state) => affine.terms.push((state, c)),
                _ => affine.time = c,
            }
        }
        affine.terms.sort_unstable_by_key(|&(state, _)| state);
        gather(&self.gather, &memory.values, registers);
        for (register, input) in registers.iter_mut().zip(inputs) {
            if !input.is_constant() {
                *register = 0.0;
            }
        }
        psi.run(registers);
        affine.constant = psi.results(registers).next().unwrap_or(0.0);
    }
}

impl Affine {
    /// What time and numbers make of order k at a time t.
    fn term(&self, k: usize, t: f64) -> f64 {
        match k {
            0 => self.time * t + self.constant,
            1 => self.time,
            _ => 0.0,
        }
    }

    /// ψ at a point.
    pub(crate) fn value(&self, values: &[f64]) -> f64 {
        let terms = self.terms.iter().map(|&(state, c)| c * values[1 + state]);
        terms.sum::<f64>() + self.time * values[0] + self.constant
    }
}

/// Evaluates where `values` say, into the registers.
pub(crate) fn run(tape: &Tape, from: &[usize], values: &[f64], registers: &mut [f64]) {
    gather(from, values, registers);
    tape.run(registers);
}
