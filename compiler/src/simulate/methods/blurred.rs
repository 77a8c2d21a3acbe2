//! Switches far from zero: elements count ψ as zero within a share of the size of its terms, however little it moves.

use nsd_solver::hybrid::Outcome;

use crate::expr::Expr;
use crate::report::Warning;
use crate::simulate::outcome::steepest;
use crate::system::{Role, System};

/// Within this share of its terms ψ is zero.
const BAND: f64 = 1e-12;

/// The share of how far ψ moves that this may be.
const SHARE: f64 = 0.1;

/// A warning about the first switch that counts as zero over much of where it moves, by the least and the largest value of
/// each state.
pub(crate) fn warning(system: &System, outcome: &Outcome, ranges: &[[f64; 2]]) -> Option<Warning> {
    let values = steepest::values(system, outcome);
    let value = |e: Expr| values.value(e);
    let plain = (system.switches.iter())
        .filter(|switch| switch.role == Role::Step && switch.slip_of.is_none());
    plain.into_iter().find_map(|switch| {
        let (mut size, mut moves) = (0.0, 0.0);
        for (state, [low, high]) in system.states.iter().zip(ranges) {
            let var = state.var.as_variable()?;
            let slope = value(switch.psi.diff(var)).abs();
            size += slope * low.abs().max(high.abs());
            moves += slope * (high - low);
        }
        let band = BAND * size;
        (band.is_finite() && moves > 0.0 && band > SHARE * moves).then(|| Warning {
            code: "W0727".into(),
            message: format!(
                "`{}` counts as zero within {band:.0e}, and moves by {moves:.0e} in all: its terms are too large for elements",
                switch.name
            ),
            span: switch.spans.first().copied(),
        })
    })
}
