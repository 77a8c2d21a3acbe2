//! Roots at whose zero a run has ended.
//!
//! A method that takes rates to be smooth between switches may find no way on where u^p, p no integer, comes to u = 0:
//! there its slope has no bound, or one of its slopes has none. What it says of elements and steps is not the cause then.

use crate::lowering::hybrid::with_numbers;
use nsd_solver::hybrid::{Outcome, Status};

use super::steepest;
use crate::expr::{Expr, rewrite};
use crate::report::Warning;
use crate::system::System;
use crate::system::switches::roots::{Root, Vanishing};

/// How close to zero u is, as a share of what the states in it are or were at the start.
const NEAR: f64 = 1e-2;

/// Tells of the first root at whose zero a run has ended without a better reason.
pub(crate) fn warning(system: &System, outcome: &Outcome) -> Option<Warning> {
    let is_told = matches!(
        outcome.status,
        Status::Unsolved
            | Status::NoSolution { .. }
            | Status::StepLimit
            | Status::Accumulation
            | Status::MissedSwitch { .. }
    );
    if !is_told {
        return None;
    }
    let values = steepest::values(system, outcome);
    let value = |e: Expr| values.value(e);
    let [rates, switching] = with_numbers(system);
    let vanishing = Vanishing::of(system, &switching);
    let is_near = |u: Expr| {
        let moves = system.states.iter().zip(&outcome.x).map(|(state, x)| {
            let var = state.var.as_variable();
            let slope = var.map_or(0.0, |var| value(u.diff(var)));
            slope.abs() * x.abs().max(state.initial.abs())
        });
        value(u).abs() <= NEAR * moves.sum::<f64>()
    };
    system.states.iter().zip(rates).find_map(|(state, rate)| {
        let mut ended = None;
        rewrite(rate, &mut |e| {
            let found = vanishing.root(e).map(|(root, switch)| (root, switching[switch]));
            let found = found.or_else(|| Root::of(e).map(|root| (root, root.base)));
            if let Some((root, u)) = found.filter(|(_, u)| is_near(*u)) {
                ended.get_or_insert((root.power, u));
            }
            e
        });
        let (power, u) = ended?;
        Some(Warning {
            code: "W0726".into(),
            message: format!(
                "`{u}` is close to zero where the run has ended, and the rate of `{}` has its power {power:.3}, which \
                 has no derivative there",
                state.name
            ),
            span: Some(state.span),
        })
    })
}
