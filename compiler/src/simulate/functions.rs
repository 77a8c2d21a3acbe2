//! What is made of a form on certain sides: tapes, and where their inputs are among those of the form.

use std::cell::RefCell;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use nsd_solver::simulate::{Affine, Input, Partials, Side};
use nsd_solver::tape::{Linear, Tape};
use rustc_hash::FxHashMap;

use super::forms::Form;
use crate::expr::{self, Expr, Var};

/// Functions by form and the sides of the α in it, in order.
pub(super) type Known<T> = RefCell<ByForm<T>>;
pub(super) type ByForm<T> = FxHashMap<(usize, Box<[Side]>), T>;

/// What is known of a form on certain sides, made when it is asked for first.
pub(super) fn kept<T>(
    known: &mut ByForm<T>,
    key: (usize, Box<[Side]>),
    make: impl FnOnce(&[Side]) -> T,
) -> &T {
    match known.entry(key) {
        Entry::Occupied(known) => known.into_mut(),
        Entry::Vacant(new) => {
            let made = make(&new.key().1);
            new.insert(made)
        }
    }
}

/// What an input of a form is in all of its copies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Argument {
    Time,
    State,
    /// Of a piece of data.
    Coefficient,
    /// A number that differs from copy to copy.
    Number,
    /// α of a switch.
    Alpha,
    /// σ of a switch: whether it slides.
    Sticking,
    /// α of a switch on whose surface nothing depends on it.
    Resting,
}

impl Argument {
    fn is_alpha(self) -> bool {
        matches!(self, Self::Alpha | Self::Sticking | Self::Resting)
    }

    /// What functions are differentiated by besides α.
    fn is_smooth(self) -> bool {
        matches!(self, Self::Time | Self::State)
    }

    /// Its number on a side, where it has one.
    fn on(self, side: Side) -> Option<f64> {
        match (self, side) {
            (Self::Alpha, Side::Slide) => None,
            (Self::Resting, Side::Slide) => Some(0.5),
            (Self::Sticking, side) => Some(f64::from(side == Side::Slide)),
            (_, side) => Some(f64::from(side == Side::Plus)),
        }
    }
}

/// The functions of a form, of which those on certain sides are made.
pub(super) struct Generic {
    tape: Tape,
    arguments: Vec<Argument>,
}

/// Rates of a form on certain sides.
pub(super) struct FormRates {
    /// Places among the inputs of the form.
    pub inputs: Vec<usize>,
    pub field: Arc<Tape>,
    pub by_alpha: Arc<Partials>,
}

/// ψ of a form on certain sides.
pub(super) struct FormSurface {
    /// Places among the inputs of the form.
    pub inputs: Vec<usize>,
    pub psi: Arc<Tape>,
    pub gradient: Arc<Partials>,
    pub mixed: Arc<Partials>,
}

impl Generic {
    /// Compiles a form; its variables come first among the inputs.
    pub fn new(form: &Form, argument: impl Fn(Var) -> Argument) -> Self {
        let inputs: Vec<Var> = form.vars.iter().chain(&form.holes).copied().collect();
        let of_vars = form.vars.iter().map(|&var| argument(var));
        let of_holes = form.holes.iter().map(|_| Argument::Number);
        Generic {
            tape: tape(&inputs, &form.functions),
            arguments: of_vars.chain(of_holes).collect(),
        }
    }

    /// The numbers of the inputs on the sides of the α among them.
    fn numbers(&self, sides: &[Side]) -> Vec<Option<f64>> {
        let mut sides = sides.iter();
        let number = |argument: &Argument| match argument.is_alpha() {
            true => argument.on(*sides.next()?),
            false => None,
        };
        self.arguments.iter().map(number).collect()
    }

    pub fn rates(&self, sides: &[Side]) -> FormRates {
        let numbers = self.numbers(sides);
        let (field, inputs) = self.tape.specialize(|input| numbers[input]);
        let is_alpha = |input: usize| self.arguments[inputs[input]].is_alpha();
        FormRates {
            by_alpha: Arc::new(partials(&field, is_alpha)),
            field: Arc::new(field),
            inputs,
        }
    }

    /// ∂f/∂x of rates of this form.
    pub fn jacobian(&self, rates: &FormRates) -> Partials {
        let is_state = |input: usize| self.arguments[rates.inputs[input]] == Argument::State;
        partials(&rates.field, is_state)
    }

    pub fn surface(&self, sides: &[Side]) -> FormSurface {
        let numbers = self.numbers(sides);
        let (psi, inputs) = self.tape.specialize(|input| numbers[input]);
        let gradient = partials(&psi, |input| self.arguments[inputs[input]].is_smooth());
        let mut mixed = partials(&gradient.tape, |input| {
            self.arguments[inputs[input]].is_alpha()
        });
        for (function, _) in &mut mixed.entries {
            *function = gradient.entries[*function].1;
        }
        FormSurface {
            inputs,
            psi: Arc::new(psi),
            gradient: Arc::new(gradient),
            mixed: Arc::new(mixed),
        }
    }

    /// ψ as a sum of fixed multiples of states and time, where it is one; `inputs` are those of a copy.
    pub fn affine(&self, sides: &[Side], inputs: &[Input]) -> Option<Affine> {
        let mut numbers = self.numbers(sides);
        for (number, input) in numbers.iter_mut().zip(inputs) {
            if let Input::Number(known) = input {
                *number = Some(*known);
            }
        }
        let Linear { terms, constant } = self.tape.linear(|input| numbers[input])?;
        let mut affine = Affine {
            constant,
            ..Affine::default()
        };
        for (at, c) in terms {
            match inputs[at] {
                Input::State(state) => affine.terms.push((state, c)),
                Input::Time => affine.time += c,
                _ => return None,
            }
        }
        affine.terms.sort_unstable_by_key(|&(state, _)| state);
        Some(affine)
    }
}

pub(super) fn tape(inputs: &[Var], outputs: &[Expr]) -> Tape {
    expr::compile(inputs, outputs)
        .expect("a verified system holds smooth functions of time, states and α only")
}

/// The derivatives of the outputs by some of the inputs.
fn partials(functions: &Tape, by: impl Fn(usize) -> bool) -> Partials {
    let (entries, tape) = functions.partials(by);
    Partials { tape, entries }
}
