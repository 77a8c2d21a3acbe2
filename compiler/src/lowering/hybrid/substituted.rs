//! Numbers in place of parameters, and directions of slip in place of their switches.
//!
//! Where a slip velocity w with two entries is not zero, rates have w/|w| in place of their 2α - 1. So α in them is
//! σ α + (1 - σ) (1 + w/|w|)/2, where σ is 1 for a switch that slides and else 0.
//!
//! A root of ψ is ((1 - σ) ψ²)^(p/2): nothing on the surface, and a number where rounding has ψ on the wrong side of it.

use crate::expr::{Expr, Substitution, Var, rewrite_all};
use crate::system::System;
use crate::system::switches::roots;

/// The values of the parameters but those that are open, by their numbers.
pub(crate) fn numbers<'e>(system: &System<'e>, open: &[usize]) -> Substitution<'e> {
    let params = system.exogenous.params.iter().enumerate();
    let params = params.filter(|(place, _)| !open.contains(place));
    params
        .map(|(_, param)| (variable(param.var), system.exprs.constant(param.value)))
        .collect()
}

/// All rates, and all ψ.
pub(crate) fn functions<'e>(system: &System<'e>) -> [Vec<Expr<'e>>; 2] {
    let rates = system.states.iter().map(|state| state.rate).collect();
    let switching = system.switches.iter().map(|switch| switch.psi).collect();
    [rates, switching]
}

/// All rates, and all ψ, with the values of the parameters.
pub(crate) fn with_numbers<'e>(system: &System<'e>) -> [Vec<Expr<'e>>; 2] {
    let numbers = numbers(system, &[]);
    functions(system).map(|functions| numbers.apply(&functions))
}

/// Below this the square of a slip velocity has no direction.
const NO_DIRECTION: f64 = 1e-300;

/// Rates with the directions of slip velocities with two entries, and σ of their switches.
pub(crate) fn with_directions<'e>(
    system: &System<'e>,
    rates: Vec<Expr<'e>>,
    switching: &[Expr<'e>],
) -> (Vec<Expr<'e>>, Vec<(usize, Var)>) {
    let (mut directions, mut sticking) = (Substitution::new(), Vec::new());
    for (i, switch) in system.switches.iter().enumerate() {
        let Some(other) = switch.across else { continue };
        let square = switching[i].powi(2) + switching[other].powi(2);
        let direction = switching[i] / (square + NO_DIRECTION).sqrt();
        let sigma = system.exprs.variable(&format!("sticks[{}]", i + 1));
        let alpha = sigma * switch.alpha + (1.0 - sigma) * (0.5 + 0.5 * direction);
        directions.insert(variable(switch.alpha), alpha);
        sticking.push((i, variable(sigma)));
    }
    match sticking.is_empty() {
        true => (rates, sticking),
        false => (directions.apply(&rates), sticking),
    }
}

/// Rates with the roots of switching functions, and σ of their switches.
pub(crate) fn with_roots<'e>(
    system: &System<'e>,
    rates: Vec<Expr<'e>>,
    switching: &[Expr<'e>],
) -> (Vec<Expr<'e>>, Vec<(usize, Var)>) {
    let vanishing = roots::Vanishing::of(system, switching);
    let mut resting: Vec<(usize, Expr<'e>)> = Vec::new();
    let rates = rewrite_all(&rates, &mut |e| {
        let Some((root, switch)) = vanishing.root(e) else {
            return e;
        };
        let known = resting.iter().find(|(i, _)| *i == switch);
        let sigma = match known {
            Some((_, sigma)) => *sigma,
            None => {
                let sigma = system.exprs.variable(&format!("rests[{}]", switch + 1));
                resting.push((switch, sigma));
                sigma
            }
        };
        root.extended(1.0 - sigma)
    });
    let resting = resting.into_iter();
    let resting = resting.map(|(switch, sigma)| (switch, variable(sigma)));
    (rates, resting.collect())
}

pub(crate) fn variable(expr: Expr) -> Var {
    expr.as_variable()
        .expect("a declared quantity is a variable")
}
