//! The term of a right-hand side that is not finite where a run ends, or has the steepest slope there.
//!
//! A run ends just before a root, a logarithm or a quotient loses its value, so that all rates may still be finite.
//! Then |∂f_i/∂x_j| is largest in the rate that is to blame, and most of it comes from one term of f_i.

use miette::LabeledSpan;

use nsd_solver::simulate::Outcome;
use rustc_hash::FxHashMap;

use crate::expr::{Expr, Node, Var, variables_of};
use crate::system::System;
use crate::system::roots::{Root, Vanishing};

/// A term with at least this share of the slope of what it stands in is to blame for it.
const SHARE: f64 = 1e-3;
/// The base of a root below this is at its end.
const AT_END: f64 = 1e-6;
/// Slopes below this are nothing special.
const STEEP: f64 = 1e6;

/// The line of the rate with the term, as a label; none where all rates are harmless.
pub(super) fn label<'e>(system: &System<'e>, outcome: &Outcome) -> Option<LabeledSpan> {
    let values = values(system, outcome);
    let value = |e: Expr<'e>| e.eval(&|var| values.get(&var).copied().unwrap_or(f64::NAN));
    let mut steepest: Option<(f64, usize, Var)> = None;
    for (i, state) in system.states.iter().enumerate() {
        let found = value(state.rate);
        if !found.is_finite() {
            let size = |e: Expr<'e>| {
                if value(e).is_finite() {
                    0.0
                } else {
                    f64::INFINITY
                }
            };
            let term = innermost(state.rate, &size);
            let is = match value(term) {
                number if number.is_nan() => "no number".to_owned(),
                number => number.to_string(),
            };
            let text = format!("`{term}` is {is}{}", below_zero(system, term, &value));
            return Some(LabeledSpan::new_with_span(Some(text), state.span));
        }
        for var in variables_of(&[state.rate]) {
            let slope = slope(value(state.rate.diff(var)));
            if slope > STEEP && steepest.is_none_or(|(most, ..)| slope > most) {
                steepest = Some((slope, i, var));
            }
        }
    }
    let (size, i, var) = steepest?;
    let state = &system.states[i];
    let term = innermost(state.rate, &|e| slope(value(e.diff(var))));
    let name = system.exprs.name(var);
    let text = match size.is_finite() {
        true => format!("the slope of `{term}` along `{name}` is {size:.0e}"),
        false => format!("`{term}` has no slope along `{name}`"),
    };
    let text = text + &below_zero(system, term, &value);
    Some(LabeledSpan::new_with_span(Some(text), state.span))
}

/// How a root goes on whose base has come to zero, or below, where no switch looks after it.
fn below_zero<'e>(system: &System<'e>, term: Expr<'e>, value: &dyn Fn(Expr<'e>) -> f64) -> String {
    let switching: Vec<Expr> = system.switches.iter().map(|switch| switch.psi).collect();
    let is_plain = Vanishing::of(system, &switching).root(term).is_none();
    let ended = Root::of(term).filter(|root| is_plain && value(root.base) < AT_END);
    ended.map_or_else(String::new, |root| {
        format!("; `max({}, 0)` in it goes on at zero", root.base)
    })
}

/// What a slope weighs: without bound where it is no number.
fn slope(value: f64) -> f64 {
    if value.is_nan() {
        f64::INFINITY
    } else {
        value.abs()
    }
}

/// The smallest part of an expression that still has most of its size.
fn innermost<'e>(e: Expr<'e>, size: &dyn Fn(Expr<'e>) -> f64) -> Expr<'e> {
    let mut at = e;
    loop {
        let below: Vec<Expr<'e>> = match at.node() {
            Node::Constant(_) | Node::Variable(_) => return at,
            Node::Sum { terms, .. } => terms.into_iter().map(|(_, term)| term).collect(),
            Node::Product(factors) => factors.into_iter().map(|(factor, _)| factor).collect(),
            Node::Unary(_, e) => vec![e],
            Node::Binary(_, a, b) => vec![a, b],
        };
        let wanted = SHARE * size(at);
        match below.into_iter().find(|&part| size(part) >= wanted) {
            Some(part) => at = part,
            None => return at,
        }
    }
}

/// All variables where the run has ended.
pub(super) fn values(system: &System, outcome: &Outcome) -> FxHashMap<Var, f64> {
    let states = system.states.iter().map(|state| state.var);
    let switches = system.switches.iter().map(|switch| switch.alpha);
    let params = system.params.iter().map(|param| (param.var, param.value));
    let data = system.data.iter();
    let data = data.map(|data| (data.var, data.table.value(outcome.time)));
    let all = states.zip(outcome.x.iter().copied());
    let all = all.chain(switches.zip(outcome.alpha.iter().copied()));
    let all = all
        .chain(params)
        .chain(data)
        .chain([(system.time, outcome.time)]);
    all.filter_map(|(e, value)| Some((e.as_variable()?, value)))
        .collect()
}
