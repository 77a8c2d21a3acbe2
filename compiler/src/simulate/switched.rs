//! A [`System`] as the simulator sees it: blocks of rates and surfaces, compiled for local sides.
//!
//! Parameters are numbers by now, and α of a switch that does not slide is 0 or 1. Both are
//! substituted before anything is compiled, so that a function holds what its sides need and
//! nothing else. What was compiled is kept, and serves every simulator of the system.

use std::cell::RefCell;
use std::sync::Arc;

use nsd_solver::simulate::{
    Affine, Block, Input, Partials, Rates, Side, Smooth, Surface, SwitchedSystem,
};
use nsd_solver::tape::Tape;
use rustc_hash::FxHashMap;

use super::blocks;
use crate::expr::{self, Expr, Exprs, Node, Substitution, Var};
use crate::system::System;

/// Functions by block or switch and its local sides.
type Known<T> = RefCell<FxHashMap<(usize, Box<[Side]>), T>>;

/// x' = f(t, x, α) with the parameters of one experiment.
pub struct Switched<'e> {
    exprs: &'e Exprs,
    /// What every variable stands for.
    inputs: FxHashMap<Var, Input>,
    alphas: Vec<Var>,
    rates: Vec<Expr<'e>>,
    switching: Vec<Expr<'e>>,
    continuous: Vec<bool>,
    blocks: Vec<Block>,
    /// Switches whose α is in ψ_i.
    inside: Vec<Vec<usize>>,
    /// Where relays start; none for other switches.
    relays: Vec<Option<Side>>,
    /// Switches whose ψ depends on time only.
    timed: Vec<bool>,
    /// Switches whose α the rate φ_i may contain.
    couplings: Vec<Vec<usize>>,
    known_rates: Known<Rates>,
    known_surfaces: Known<Surface>,
}

impl<'e> Switched<'e> {
    /// Substitutes the parameters.
    pub fn new(system: &System<'e>) -> Self {
        let exprs = system.exprs;
        let mut numbers = Substitution::new();
        for param in &system.params {
            numbers.insert(variable(param.var), exprs.constant(param.value));
        }
        let rates: Vec<_> = system.states.iter().map(|state| state.rate).collect();
        let rates = numbers.apply(&rates);
        let switching: Vec<_> = system.switches.iter().map(|switch| switch.psi).collect();
        let switching = numbers.apply(&switching);
        let alphas = system.switches.iter().map(|switch| variable(switch.alpha));
        let alphas: Vec<Var> = alphas.collect();
        let mut inputs = FxHashMap::default();
        inputs.insert(variable(system.time), Input::Time);
        for (i, state) in system.states.iter().enumerate() {
            inputs.insert(variable(state.var), Input::State(i));
        }
        for (i, &alpha) in alphas.iter().enumerate() {
            inputs.insert(alpha, Input::Alpha(i));
        }
        let occurring = |e: &Expr<'e>| {
            let found = expr::variables_of(&[*e]).into_iter();
            let found: Vec<Input> = found.filter_map(|var| inputs.get(&var).copied()).collect();
            found
        };
        let switches_of = |inputs: &[Input]| {
            let found = inputs.iter().filter_map(|input| match input {
                Input::Alpha(switch) => Some(*switch),
                _ => None,
            });
            let mut found: Vec<usize> = found.collect();
            found.sort_unstable();
            found
        };
        let in_rates: Vec<_> = rates
            .iter()
            .map(|rate| switches_of(&occurring(rate)))
            .collect();
        let in_psi: Vec<_> = switching.iter().map(occurring).collect();
        let inside: Vec<_> = in_psi.iter().map(|inputs| switches_of(inputs)).collect();
        // φ_i = Σ ∂ψ_i/∂x_k f_k + ∂ψ_i/∂t
        let coupled = |inputs: &Vec<Input>| {
            let mut found = switches_of(inputs);
            for input in inputs {
                if let Input::State(state) = input {
                    found.extend(&in_rates[*state]);
                }
            }
            found.sort_unstable();
            found.dedup();
            found
        };
        let mut timed: Vec<bool> = Vec::new();
        for inputs in &in_psi {
            // Inner switches come first; a relay holds its own α and is none of time.
            timed.push(inputs.iter().all(|input| match input {
                Input::Alpha(k) => timed.get(*k) == Some(&true),
                input => *input == Input::Time,
            }));
        }
        let start = |switch: &crate::system::Switch| match switch.relay?.start {
            true => Some(Side::Plus),
            false => Some(Side::Minus),
        };
        Switched {
            relays: system.switches.iter().map(start).collect(),
            timed,
            couplings: in_psi.iter().map(coupled).collect(),
            blocks: blocks::cut(&rates, &in_rates, &alphas),
            continuous: (system.switches.iter())
                .map(|switch| switch.continuity.is_continuous())
                .collect(),
            exprs,
            inputs,
            alphas,
            rates,
            switching,
            inside,
            known_rates: RefCell::default(),
            known_surfaces: RefCell::default(),
        }
    }

    /// The rates of a block on its local sides.
    fn block(&self, block: usize, sides: &[Side]) -> Vec<Expr<'e>> {
        let Block { states, switches } = &self.blocks[block];
        let mut fixed = Substitution::new();
        for (&switch, side) in switches.iter().zip(sides) {
            if *side != Side::Slide {
                fixed.insert(self.alphas[switch], self.alpha(*side));
            }
        }
        let rates: Vec<_> = states.iter().map(|&state| self.rates[state]).collect();
        fixed.apply(&rates)
    }

    /// α off the surface.
    fn alpha(&self, side: Side) -> Expr<'e> {
        self.exprs
            .constant(if side == Side::Minus { 0.0 } else { 1.0 })
    }

    fn inputs_of(&self, vars: &[Var]) -> Vec<Input> {
        vars.iter().map(|var| self.inputs[var]).collect()
    }

    /// Those variables that stand for what is wanted.
    fn those(&self, vars: &[Var], wanted: impl Fn(Input) -> bool) -> Vec<Var> {
        let wanted = |var: &Var| wanted(self.inputs[var]);
        vars.iter().copied().filter(wanted).collect()
    }

    fn compile_rates(&self, block: usize, sides: &[Side]) -> Rates {
        let rates = self.block(block, sides);
        let vars = expr::variables_of(&rates);
        let sliding = self.those(&vars, |input| matches!(input, Input::Alpha(_)));
        Rates {
            inputs: self.inputs_of(&vars),
            field: Arc::new(tape(&vars, &rates)),
            by_alpha: Arc::new(partials(&vars, &rates, &sliding)),
        }
    }

    fn compile_surface(&self, switch: usize, sides: &[Side]) -> Surface {
        let mut fixed = Substitution::new();
        for (&inner, side) in self.inside[switch].iter().zip(sides) {
            match side {
                Side::Slide if self.continuous[inner] => {}
                // ψ is continuous here, so either branch of it will do while the other slides.
                side => fixed.insert(self.alphas[inner], self.alpha(*side)),
            }
        }
        let psi = self.switching[switch].substitute(&fixed);
        if let Some(affine) = self.affine(psi) {
            return Surface::Affine(affine);
        }
        let vars = expr::variables_of(&[psi]);
        let smooth = self.those(&vars, |input| !matches!(input, Input::Alpha(_)));
        let alphas = self.those(&vars, |input| matches!(input, Input::Alpha(_)));
        let gradient = partials(&vars, &[psi], &smooth);
        let entries = expr::jacobian(&[psi], &smooth).entries;
        let slopes: Vec<_> = entries.iter().map(|&(.., entry)| entry).collect();
        let mut mixed = partials(&vars, &slopes, &alphas);
        for (function, _) in &mut mixed.entries {
            *function = gradient.entries[*function].1;
        }
        Surface::Smooth(Smooth {
            inputs: self.inputs_of(&vars),
            psi: Arc::new(tape(&vars, &[psi])),
            gradient: Arc::new(gradient),
            mixed: Arc::new(mixed),
        })
    }

    /// ψ as a sum of multiples of states and time, where it is one.
    fn affine(&self, psi: Expr<'e>) -> Option<Affine> {
        let (constant, terms) = match psi.node() {
            Node::Constant(constant) => (constant, Vec::new()),
            Node::Variable(_) => (0.0, vec![(1.0, psi)]),
            Node::Sum { constant, terms } => (constant, terms),
            _ => return None,
        };
        let mut affine = Affine {
            constant,
            ..Affine::default()
        };
        for (c, term) in terms {
            match self.inputs[&term.as_variable()?] {
                Input::Time => affine.time = c,
                Input::State(state) => affine.terms.push((state, c)),
                _ => return None,
            }
        }
        affine.terms.sort_unstable_by_key(|&(state, _)| state);
        Some(affine)
    }
}

fn tape(inputs: &[Var], outputs: &[Expr]) -> Tape {
    expr::compile(inputs, outputs)
        .expect("a verified system holds smooth functions of time, states and α only")
}

/// The derivatives of functions of `inputs` by some of these.
fn partials(inputs: &[Var], functions: &[Expr], by: &[Var]) -> Partials {
    let entries = expr::jacobian(functions, by).entries;
    let values: Vec<_> = entries.iter().map(|&(.., value)| value).collect();
    let place = |var: &Var| {
        let place = inputs.binary_search(var);
        place.expect("functions are differentiated by their inputs")
    };
    Partials {
        tape: tape(inputs, &values),
        entries: (entries.iter())
            .map(|&(function, column, _)| (function, place(&by[column])))
            .collect(),
    }
}

fn variable(expr: Expr) -> Var {
    expr.as_variable()
        .expect("a declared quantity is a variable")
}

impl SwitchedSystem for Switched<'_> {
    fn n_states(&self) -> usize {
        self.rates.len()
    }

    fn n_switches(&self) -> usize {
        self.alphas.len()
    }

    fn is_continuous(&self, switch: usize) -> bool {
        self.continuous[switch]
    }

    fn couplings(&self, switch: usize) -> &[usize] {
        &self.couplings[switch]
    }

    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    fn is_timed(&self, switch: usize) -> bool {
        self.timed[switch]
    }

    fn relay(&self, switch: usize) -> Option<Side> {
        self.relays[switch]
    }

    fn inside(&self, switch: usize) -> &[usize] {
        &self.inside[switch]
    }

    fn rates(&self, block: usize, sides: &[Side]) -> Rates {
        let mut known = self.known_rates.borrow_mut();
        let known = known.entry((block, sides.into()));
        known
            .or_insert_with(|| self.compile_rates(block, sides))
            .clone()
    }

    fn surface(&self, switch: usize, sides: &[Side]) -> Surface {
        let mut known = self.known_surfaces.borrow_mut();
        let known = known.entry((switch, sides.into()));
        known
            .or_insert_with(|| self.compile_surface(switch, sides))
            .clone()
    }

    fn jacobian(&self, block: usize, sides: &[Side]) -> Arc<Partials> {
        let rates = self.block(block, sides);
        let vars = expr::variables_of(&rates);
        let states = self.those(&vars, |input| matches!(input, Input::State(_)));
        Arc::new(partials(&vars, &rates, &states))
    }
}
