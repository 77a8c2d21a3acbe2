//! Instants that a step must not pass over: where a function of time is narrow.
//!
//! A pulse like exp(-((t - 5)/0.001)²) is zero to rounding wherever a long step looks. So steps end where
//! such a function may have one, and before and behind by its width and multiples:
//!
//! - where the argument u(t) of an exponential, a root, a logarithm or a power turns, u' = 0,
//! - where that of a sigmoid vanishes,
//! - where two terms of a divisor balance, as in 1/(1 + exp(-u)),
//! - at the ends of the horizon, from which an exponential may fall off,
//!
//! but only if what happens there is narrow compared with the horizon.

mod search;

use search::Search;

use rustc_hash::FxHashSet;

use super::substituted::{functions, variable, with_numbers};
use crate::expr::{Expr, Function, Node, Var, children, variables_of};
use crate::report::Warning;
use crate::system::System;
use crate::system::experiment::Settings;

/// A function of time varies around an instant, on either side within a width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pulse {
    at: f64,
    width: f64,
}

/// Where functions of time are narrow within the horizon, in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pulses {
    pulses: Vec<Pulse>,
    /// Instants that no step passes over, in order.
    stops: Vec<f64>,
}

/// The distance of a stop from a pulse next to that of the stop before.
const FARTHER: f64 = 4.0;

/// The part of an element that a pulse has to fill for a grid to see it.
const SEEN: f64 = 0.5;

impl Pulses {
    /// Of the rates and switching functions of a system.
    pub fn of(system: &System, horizon: f64) -> Self {
        let functions = with_numbers(system).concat();
        Pulses::among(&functions, variable(system.time), horizon)
    }

    /// Of functions without parameters.
    fn among(functions: &[Expr], time: Var, horizon: f64) -> Self {
        let mut pulses = Search::new(time, horizon).run(functions);
        pulses.retain(|p| p.at - p.width < horizon && p.at + p.width > 0.0);
        // Ever longer steps lead away from a pulse, so that its tails are seen, too.
        let around = |p: &Pulse| {
            let widths = std::iter::successors(Some(p.width), |width| Some(FARTHER * width));
            let widths = widths.take_while(|width| *width < search::NARROW * horizon);
            let around = widths.flat_map(|width| [p.at - width, p.at + width]);
            around.chain([p.at]).collect::<Vec<f64>>()
        };
        let mut stops: Vec<f64> = pulses.iter().flat_map(around).collect();
        stops.retain(|stop| 0.0 < *stop && *stop < horizon);
        stops.sort_by(f64::total_cmp);
        stops.dedup();
        Pulses { pulses, stops }
    }

    /// Where they are, for steps by Taylor series: from there these see all of a pulse.
    pub fn instants(&self) -> Vec<f64> {
        self.pulses.iter().map(|pulse| pulse.at).collect()
    }

    /// Instants that no step passes over, in order.
    pub fn stops(&self) -> &[f64] {
        &self.stops
    }

    /// The next instant behind `t` that no step passes over; infinity where there is none.
    pub fn after(&self, t: f64) -> f64 {
        let next = self.stops.partition_point(|stop| *stop <= t);
        self.stops.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// That elements of this length may not see all pulses.
    pub fn warning(&self, length: f64, settings: &Settings) -> Option<Warning> {
        let is_unseen = |pulse: &&Pulse| pulse.width < SEEN * length;
        let mut unseen = self.pulses.iter().filter(is_unseen);
        let Pulse { at, width } = *unseen.next()?;
        let others = match unseen.count() {
            0 => String::new(),
            1 => ", and at another instant".into(),
            more => format!(", and at {more} more instants"),
        };
        Some(Warning {
            code: "W0711".into(),
            message: format!(
                "something varies within {width:.1e} around time = {at:.6}{others}: steps of {length:.1e} \
                 may pass over it"
            ),
            span: Some(settings.span),
        })
    }
}

/// What may move or make a pulse, time and data among it: all that is inside of a function that can be narrow, together
/// with these.
pub(crate) fn narrowing(system: &System) -> FxHashSet<Var> {
    let data = system.exogenous.data.iter().map(|data| variable(data.var));
    let moving: FxHashSet<Var> = data.chain([variable(system.time)]).collect();
    let mut found = FxHashSet::default();
    let (mut seen, mut left) = (FxHashSet::default(), functions(system).concat());
    while let Some(e) = left.pop() {
        if !seen.insert(e) {
            continue;
        }
        for inside in sharpened(e) {
            let vars = variables_of(&[inside]);
            if vars.iter().any(|var| moving.contains(var)) {
                found.extend(vars);
            }
        }
        left.extend(children(e));
    }
    found
}

/// What an expression may make narrow.
fn sharpened(e: Expr<'_>) -> Vec<Expr<'_>> {
    match e.node() {
        Node::Unary(Function::Sin | Function::Cos, _) | Node::Constant(_) | Node::Variable(_) => {
            Vec::new()
        }
        Node::Unary(_, a) => vec![a],
        Node::Binary(_, a, b) => vec![a, b],
        Node::Sum { .. } => Vec::new(),
        Node::Product(factors) => {
            let sharp = |power: i32| !(0..search::HIGH_POWER).contains(&power);
            let factors = factors.into_iter().filter(|(_, power)| sharp(*power));
            factors.map(|(factor, _)| factor).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Exprs;

    fn found(horizon: f64, function: impl for<'e> Fn(Expr<'e>) -> Expr<'e>) -> Vec<Pulse> {
        let exprs = Exprs::new();
        let time = exprs.variable("time");
        let var = time.as_variable().expect("a variable");
        Pulses::among(&[function(time)], var, horizon).pulses
    }

    fn gauss(time: Expr<'_>, at: f64, width: f64) -> Expr<'_> {
        let s = (time - at) * (1.0 / width);
        (s * s * -1.0).exp()
    }

    #[test]
    fn narrow_pulses_are_found_and_wide_ones_are_not() {
        let pulses = found(10.0, |t| gauss(t, 3.7, 1e-3) + gauss(t, 5.0, 2.0) + t.sin());
        assert_eq!(pulses.len(), 1, "{pulses:?}");
        let Pulse { at, width } = pulses[0];
        assert!((at - 3.7).abs() < 1e-12, "{pulses:?}");
        assert!((1e-3..2e-3).contains(&width), "{pulses:?}");
    }

    #[test]
    fn terms_of_a_divisor_balance() {
        // exp(-(t - 3)/w) = 5
        let w = 1e-4;
        let pulses = found(10.0, |t| (((t - 3.0) * (-1.0 / w)).exp() + 5.0).powi(-1));
        assert_eq!(pulses.len(), 1, "{pulses:?}");
        let at = 3.0 - w * 5.0_f64.ln();
        assert!((pulses[0].at - at).abs() < 1e-12, "{pulses:?}");
    }

    #[test]
    fn flat_tops_and_high_powers_are_narrow_too() {
        let flat = found(10.0, |t| (((t - 3.0) * 1e3).powi(8) * -1.0).exp());
        assert_eq!(flat.len(), 1, "{flat:?}");
        // cos(t)^100000 at multiples of π, zero among them.
        let comb = found(100.0, |t| t.cos().powi(100_000));
        assert_eq!(comb.len(), 32, "{comb:?}");
        assert!(found(100.0, |t| t.cos().powi(2)).is_empty());
    }
}
