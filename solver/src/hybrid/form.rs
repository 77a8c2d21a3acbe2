//! Forms: functions of time, states, α and numbers, of which those on certain sides are made when a run meets them.
//!
//! α of a switch that does not slide is 0 or 1: a tape is specialized to that, so that it holds what its sides need and
//! nothing else, and differentiated. What was made is kept, by form and sides: it serves all instances of the form.

use std::collections::hash_map::Entry;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::Side;
use super::sided::Sided;
use super::system::{HybridSystem, Input, Reset};
use crate::tape::{Linear, Tape};

/// Functions with α as inputs.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Form {
    /// The functions.
    pub tape: Tape,
    /// What their inputs are.
    pub arguments: Vec<Argument>,
}

/// What an input of a form is in all of its instances.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Argument {
    /// t.
    Time,
    /// A state.
    State,
    /// A coefficient of a piece of data.
    Coefficient,
    /// A parameter.
    Parameter,
    /// A number that differs from instance to instance.
    Number,
    /// α of a switch.
    Alpha,
    /// σ of a switch: whether it slides.
    Sticking,
    /// α of a switch on whose surface nothing depends on it.
    Resting,
}

/// A form with what its inputs stand for.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Instance {
    /// Which form.
    pub form: usize,
    /// One for each of its arguments.
    pub inputs: Vec<Input>,
}

/// The rates of a block on certain local sides.
#[derive(Clone, Debug)]
pub struct Rates {
    /// What the inputs of both tapes are.
    pub inputs: Vec<Input>,
    /// To f of the states of the block.
    pub field: Arc<Tape>,
    /// ∂f/∂α of the switches that slide.
    pub by_alpha: Arc<Partials>,
}

/// Partial derivatives that are not structurally zero, as one tape.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Partials {
    /// One output per entry.
    pub tape: Tape,
    /// (function, input) of every output, ordered by function.
    pub entries: Vec<(usize, usize)>,
}

impl Partials {
    /// No partial derivatives of functions with this many inputs.
    pub fn none(n_inputs: usize) -> Self {
        Partials {
            tape: Tape::builder(n_inputs).finish(&[]),
            entries: Vec::new(),
        }
    }
}

/// A switching function.
#[derive(Clone, Debug)]
pub enum Surface {
    /// Affine with constant coefficients, the common case: it needs no tape, and its series follows
    /// from those of the states.
    Affine(Affine),
    /// Affine with coefficients that are functions of parameters.
    Parametric(Smooth),
    /// Any other.
    Smooth(Smooth),
}

/// ψ = Σ c_j x_j + d t + e.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Affine {
    /// (j, c_j), ordered by state.
    pub terms: Vec<(usize, f64)>,
    /// d.
    pub time: f64,
    /// e.
    pub constant: f64,
}

/// ψ as a tape.
#[derive(Clone, Debug)]
pub struct Smooth {
    /// What the inputs of all tapes are.
    pub inputs: Vec<Input>,
    /// To ψ.
    pub psi: Arc<Tape>,
    /// ∂ψ/∂x and ∂ψ/∂t: entries (0, input).
    pub gradient: Arc<Partials>,
    /// ∂²ψ/∂x∂α and ∂²ψ/∂t∂α of α that are inputs: entries (input x or t, input α).
    pub mixed: Arc<Partials>,
}

/// Functions by form and the sides of the α in it, in order.
type Known<T> = FxHashMap<(usize, Box<[Side]>), T>;

/// Functions on certain sides.
#[derive(Clone, Debug)]
pub(crate) struct Library {
    system: Arc<HybridSystem>,
    rates: Known<FormRates>,
    jacobians: Known<Arc<Partials>>,
    surfaces: Known<FormSurface>,
    /// New values of states, by law.
    resets: FxHashMap<usize, Sided>,
}

/// Rates of a form on certain sides.
#[derive(Clone, Debug)]
struct FormRates {
    /// Places among the inputs of the form.
    inputs: Vec<usize>,
    field: Arc<Tape>,
    by_alpha: Arc<Partials>,
}

/// ψ of a form on certain sides.
#[derive(Clone, Debug)]
struct FormSurface {
    /// Places among the inputs of the form.
    inputs: Vec<usize>,
    psi: Arc<Tape>,
    gradient: Arc<Partials>,
    mixed: Arc<Partials>,
    /// Whether ψ is affine in states and time, and its coefficients are constant in a run.
    is_affine: bool,
}

impl Argument {
    fn is_alpha(self) -> bool {
        matches!(self, Self::Alpha | Self::Sticking | Self::Resting)
    }

    /// Whether it is the same all through a run.
    fn is_constant(self) -> bool {
        matches!(self, Self::Parameter | Self::Number)
    }

    /// What functions are differentiated by besides α.
    fn is_smooth(self) -> bool {
        matches!(self, Self::Time | Self::State)
    }

    /// Its number on a side, where it has one.
    pub(super) fn on(self, side: Side) -> Option<f64> {
        match (self, side) {
            (Self::Alpha, Side::Slide) => None,
            (Self::Resting, Side::Slide) => Some(0.5),
            (Self::Sticking, side) => Some(f64::from(side == Side::Slide)),
            (_, side) => Some(f64::from(side == Side::Plus)),
        }
    }
}

impl Instance {
    /// The sides of the α among its inputs, in order, where `switches`, in order, are on these sides: what is made of a
    /// form is known by them.
    fn key(&self, switches: &[usize], sides: &[Side]) -> (usize, Box<[Side]>) {
        let side = |input: &Input| match input {
            Input::Alpha(switch) => Some(sides[switches.binary_search(switch).ok()?]),
            _ => None,
        };
        (self.form, self.inputs.iter().filter_map(side).collect())
    }

    /// What some inputs of the form stand for.
    fn inputs_at(&self, places: &[usize]) -> Vec<Input> {
        places.iter().map(|&place| self.inputs[place]).collect()
    }
}

impl Form {
    /// The numbers of the inputs on the sides of the α among them.
    fn numbers(&self, sides: &[Side]) -> Vec<Option<f64>> {
        let mut sides = sides.iter();
        let number = |argument: &Argument| match argument.is_alpha() {
            true => argument.on(*sides.next()?),
            false => None,
        };
        self.arguments.iter().map(number).collect()
    }

    fn rates(&self, sides: &[Side]) -> FormRates {
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
    fn jacobian(&self, rates: &FormRates) -> Partials {
        let is_state = |input: usize| self.arguments[rates.inputs[input]] == Argument::State;
        partials(&rates.field, is_state)
    }

    fn surface(&self, sides: &[Side]) -> FormSurface {
        let numbers = self.numbers(sides);
        let (psi, inputs) = self.tape.specialize(|input| numbers[input]);
        let gradient = partials(&psi, |input| self.arguments[inputs[input]].is_smooth());
        let mut mixed = partials(&gradient.tape, |input| {
            self.arguments[inputs[input]].is_alpha()
        });
        for (function, _) in &mut mixed.entries {
            *function = gradient.entries[*function].1;
        }
        let argument = |&input: &usize| self.arguments[inputs[input]];
        let moves = gradient.tape.needed_inputs();
        let is_affine = moves.iter().all(|input| argument(input).is_constant())
            && (0..inputs.len()).all(|i| argument(&i).is_constant() || argument(&i).is_smooth());
        FormSurface {
            is_affine,
            inputs,
            psi: Arc::new(psi),
            gradient: Arc::new(gradient),
            mixed: Arc::new(mixed),
        }
    }

    /// ψ as a sum of fixed multiples of states and time, where it is one; `inputs` are those of an instance.
    fn affine(&self, sides: &[Side], inputs: &[Input]) -> Option<Affine> {
        let mut numbers = self.numbers(sides);
        for (number, input) in numbers.iter_mut().zip(inputs) {
            if let Input::Number(known) = input {
                *number = Some(*known);
            }
        }
        let Linear {
            terms, constant, ..
        } = self.tape.linear(|input| numbers[input])?;
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

impl Library {
    /// Nothing is known of the forms of a system yet.
    pub(crate) fn new(system: Arc<HybridSystem>) -> Self {
        Library {
            system,
            rates: Known::default(),
            jacobians: Known::default(),
            surfaces: Known::default(),
            resets: FxHashMap::default(),
        }
    }

    /// The number of functions that were made, which blocks and surfaces of one form share.
    pub(crate) fn len(&self) -> usize {
        self.rates.len() + self.surfaces.len()
    }

    /// The rates of a block on its local sides.
    pub(crate) fn rates(&mut self, block: usize, sides: &[Side]) -> Rates {
        let instance = &self.system.rates[block];
        let key = instance.key(&self.system.blocks[block].switches, sides);
        let form = &self.system.forms[instance.form];
        let rates = kept(&mut self.rates, key, |sides| form.rates(sides));
        Rates {
            inputs: instance.inputs_at(&rates.inputs),
            field: rates.field.clone(),
            by_alpha: rates.by_alpha.clone(),
        }
    }

    /// The new values that a law gives to states, as functions of what they read.
    pub(crate) fn reset(&mut self, law: usize, reset: &Reset) -> &mut Sided {
        let is_alpha = |input: usize| matches!(reset.inputs.get(input), Some(Input::Alpha(_)));
        (self.resets.entry(law)).or_insert_with(|| Sided::new(reset.values.clone(), is_alpha))
    }

    /// ∂f/∂x of a block on its local sides, by the inputs of its [`Rates`]. Only implicit methods ask for it.
    pub(crate) fn jacobian(&mut self, block: usize, sides: &[Side]) -> Arc<Partials> {
        let instance = &self.system.rates[block];
        let key = instance.key(&self.system.blocks[block].switches, sides);
        let form = &self.system.forms[instance.form];
        let rates = kept(&mut self.rates, key.clone(), |sides| form.rates(sides));
        kept(&mut self.jacobians, key, |_| Arc::new(form.jacobian(rates))).clone()
    }

    /// ψ of a switch, given the sides of the switches inside it. ψ is continuous where another switch slides, so either
    /// branch of it will do: α of one that slides is 1, unless it is continuous.
    pub(crate) fn surface(&mut self, switch: usize, sides: &[Side]) -> Surface {
        self.function((switch, switch), sides)
    }

    /// The derivative of ψ of an order of at least 1, on the same sides.
    pub(crate) fn derivative(&mut self, switch: usize, order: usize, sides: &[Side]) -> Surface {
        let at = self.system.switches[switch].derivatives.start + order - 1;
        self.function((switch, at), sides)
    }

    /// ψ of a switch or a derivative, by its place among the surfaces.
    fn function(&mut self, (switch, at): (usize, usize), sides: &[Side]) -> Surface {
        let inside = &self.system.switches[switch].inside;
        let sides = inside.iter().zip(sides).map(|(&inner, side)| match side {
            Side::Slide if !self.system.is_continuous(inner) => Side::Plus,
            side => *side,
        });
        let sides: Vec<Side> = sides.collect();
        let instance = &self.system.surfaces[at];
        let key = instance.key(inside, &sides);
        let form = &self.system.forms[instance.form];
        if let Some(affine) = form.affine(&key.1, &instance.inputs) {
            return Surface::Affine(affine);
        }
        let surface = kept(&mut self.surfaces, key, |sides| form.surface(sides));
        let smooth = Smooth {
            inputs: instance.inputs_at(&surface.inputs),
            psi: surface.psi.clone(),
            gradient: surface.gradient.clone(),
            mixed: surface.mixed.clone(),
        };
        match surface.is_affine {
            true => Surface::Parametric(smooth),
            false => Surface::Smooth(smooth),
        }
    }
}

/// What is known of a form on certain sides, made when it is asked for first.
fn kept<T>(known: &mut Known<T>, key: (usize, Box<[Side]>), make: impl FnOnce(&[Side]) -> T) -> &T {
    match known.entry(key) {
        Entry::Occupied(known) => known.into_mut(),
        Entry::Vacant(new) => {
            let made = make(&new.key().1);
            new.insert(made)
        }
    }
}

/// The derivatives of the outputs by some of the inputs.
fn partials(functions: &Tape, by: impl Fn(usize) -> bool) -> Partials {
    let (entries, tape) = functions.partials(by);
    Partials { tape, entries }
}
