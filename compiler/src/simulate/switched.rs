//! A [`System`] as the simulator sees it: tapes, mode by mode.
//!
//! Parameters are numbers by now, and in a mode α of every switch that does not
//! slide is 0 or 1. Both are substituted before anything is compiled, so that a
//! mode's tape holds that mode's field and nothing else.

use nsd_solver::simulate::{ModeFunctions, Side, SwitchedSystem};
use nsd_solver::tape::Tape;
use rustc_hash::FxHashMap;

use crate::expr::{self, Expr, Exprs, Substitution, Var};
use crate::system::System;

/// x' = f(t, x, α) with the parameters of one experiment.
pub struct Switched<'e> {
    exprs: &'e Exprs,
    time: Var,
    states: Vec<Var>,
    alphas: Vec<Var>,
    rates: Vec<Expr<'e>>,
    switching: Vec<Expr<'e>>,
    /// (state, ∂ψ_i/∂x) where it is not zero.
    gradients: Vec<Vec<(usize, Expr<'e>)>>,
    /// ∂ψ_i/∂t.
    time_gradients: Vec<Expr<'e>>,
    continuous: Vec<bool>,
    /// Switches whose α the rate φ_i may contain.
    couplings: Vec<Vec<usize>>,
}

impl<'e> Switched<'e> {
    /// Substitutes the parameters.
    pub fn new(system: &System<'e>) -> Self {
        let exprs = system.exprs;
        let mut numbers = Substitution::new();
        for param in &system.params {
            numbers.insert(variable(param.var), exprs.constant(param.value));
        }
        let time = variable(system.time);
        let states: Vec<Var> = system
            .states
            .iter()
            .map(|state| variable(state.var))
            .collect();
        let alphas: Vec<Var> = system
            .switches
            .iter()
            .map(|switch| variable(switch.alpha))
            .collect();
        let rates: Vec<_> = system
            .states
            .iter()
            .map(|state| state.rate.substitute(&numbers))
            .collect();
        let switching: Vec<_> = system
            .switches
            .iter()
            .map(|switch| switch.psi.substitute(&numbers))
            .collect();
        let place: FxHashMap<Var, usize> = states
            .iter()
            .enumerate()
            .map(|(i, &var)| (var, i))
            .collect();
        let gradient = |psi: &Expr<'e>| {
            let occurring = expr::variables_of(&[*psi])
                .into_iter()
                .filter_map(|var| Some((*place.get(&var)?, var)));
            occurring.map(|(i, var)| (i, psi.diff(var))).collect()
        };
        let gradients: Vec<Vec<_>> = switching.iter().map(gradient).collect();
        let time_gradients: Vec<_> = switching.iter().map(|psi| psi.diff(time)).collect();
        Switched {
            couplings: couplings(&rates, &gradients, &time_gradients, &alphas),
            time_gradients,
            continuous: system
                .switches
                .iter()
                .map(|switch| switch.continuity.is_continuous())
                .collect(),
            exprs,
            time,
            states,
            alphas,
            rates,
            switching,
            gradients,
        }
    }

    fn tape(&self, inputs: &[Var], outputs: &[Expr<'e>]) -> Tape {
        expr::compile(inputs, outputs)
            .expect("a verified system holds smooth functions of time, states and α only")
    }
}

/// Which α each rate φ_i = Σ ∂ψ_i/∂x_k f_k + ∂ψ_i/∂t may contain.
fn couplings<'e>(
    rates: &[Expr<'e>],
    gradients: &[Vec<(usize, Expr<'e>)>],
    time_gradients: &[Expr<'e>],
    alphas: &[Var],
) -> Vec<Vec<usize>> {
    let place: FxHashMap<Var, usize> = alphas
        .iter()
        .enumerate()
        .map(|(i, &var)| (var, i))
        .collect();
    let alphas_of = |e: Expr<'e>| {
        expr::variables_of(&[e])
            .into_iter()
            .filter_map(|var| place.get(&var).copied())
    };
    let in_rate: Vec<Vec<usize>> = rates
        .iter()
        .map(|rate| alphas_of(*rate).collect())
        .collect();
    let of_switch = |(gradient, by_time): (&Vec<(usize, Expr<'e>)>, &Expr<'e>)| {
        let mut found: Vec<usize> = gradient
            .iter()
            .flat_map(|(k, entry)| in_rate[*k].iter().copied().chain(alphas_of(*entry)))
            .chain(alphas_of(*by_time))
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    };
    gradients
        .iter()
        .zip(time_gradients)
        .map(of_switch)
        .collect()
}

fn variable(expr: Expr) -> Var {
    expr.as_variable()
        .expect("a declared quantity is a variable")
}

impl SwitchedSystem for Switched<'_> {
    fn n_states(&self) -> usize {
        self.states.len()
    }

    fn n_switches(&self) -> usize {
        self.alphas.len()
    }

    fn is_continuous(&self, switch: usize) -> bool {
        self.continuous[switch]
    }

    fn couples(&self, rate: usize, alpha: usize) -> bool {
        self.couplings[rate].binary_search(&alpha).is_ok()
    }

    fn compile(&self, sides: &[Side]) -> ModeFunctions {
        let mut fixed = Substitution::new();
        let mut inputs = vec![self.time];
        inputs.extend(&self.states);
        let mut sliding = Vec::new();
        let mut in_psi = Substitution::new();
        for (i, (&alpha, side)) in self.alphas.iter().zip(sides).enumerate() {
            match side {
                Side::Minus => fixed.insert(alpha, self.exprs.constant(0.0)),
                Side::Plus => fixed.insert(alpha, self.exprs.constant(1.0)),
                Side::Slide => {
                    // Another ψ is continuous here, so either branch of it will do while this one
                    // slides. A switch that never slides is only asked for one of its sides.
                    if !self.continuous[i] {
                        in_psi.insert(alpha, self.exprs.constant(1.0));
                    }
                    inputs.push(alpha);
                    sliding.push(i);
                }
            }
        }
        let rates: Vec<_> = self
            .rates
            .iter()
            .map(|rate| rate.substitute(&fixed))
            .collect();
        let switching: Vec<_> = self
            .switching
            .iter()
            .map(|psi| psi.substitute(&fixed).substitute(&in_psi))
            .collect();

        // φ = ∂ψ/∂x f + ∂ψ/∂t
        let mut phi = Vec::with_capacity(sliding.len());
        let mut gradients = vec![self.exprs.constant(0.0); sliding.len() * self.states.len()];
        let mut time_gradients = Vec::with_capacity(sliding.len());
        for (row, &i) in sliding.iter().enumerate() {
            let by_time = self.time_gradients[i]
                .substitute(&fixed)
                .substitute(&in_psi);
            let mut rate = by_time;
            for (k, entry) in &self.gradients[i] {
                let entry = entry.substitute(&fixed).substitute(&in_psi);
                gradients[row * self.states.len() + k] = entry;
                rate = rate + entry * rates[*k];
            }
            phi.push(rate);
            time_gradients.push(by_time);
        }
        let mut pairs = Vec::with_capacity(sliding.len() * sliding.len());
        for (rate, &row) in phi.iter().zip(&sliding) {
            for &i in &sliding {
                pairs.push(if self.couples(row, i) {
                    rate.diff(self.alphas[i])
                } else {
                    self.exprs.constant(0.0)
                });
            }
        }
        let linear: Vec<_> = pairs
            .into_iter()
            .chain(gradients)
            .chain(time_gradients)
            .collect();
        let field: Vec<_> = rates.into_iter().chain(phi).chain(switching).collect();
        ModeFunctions {
            field: self.tape(&inputs, &field),
            sliding: self.tape(&inputs, &linear),
        }
    }
}
