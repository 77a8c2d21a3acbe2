//! Contacts that are met where a run ends: rounding decides whether they are struck.
//!
//! From event to event an impact at the last instant takes place; other methods end before it. Either way an end that is
//! earlier or later by a rounding has other velocities.

use nsd_solver::hybrid::{Outcome, Status};

use super::steepest;
use crate::report::Warning;
use crate::system::System;

/// An instant within this share of the horizon of the end is the end.
const NEAR: f64 = 1e-11;
/// What would move a gap by less than this share of how far it has moved, in as long as the whole run, is no motion.
const SLOW: f64 = 1e-6;

/// A warning about the first contact whose gap is zero at the end, and moves; by the least and the largest value of each
/// state in the run.
pub(crate) fn warning(system: &System, outcome: &Outcome, ranges: &[[f64; 2]]) -> Option<Warning> {
    let ends = outcome.status == Status::Solved && outcome.stats.stopped_by.is_none();
    let laws = system.jumps.laws.iter().filter_map(|law| law.strikes);
    let contacts = system.jumps.contacts.iter().map(|contact| contact.switch);
    let mut gaps = laws.chain(contacts).filter(|_| ends).peekable();
    gaps.peek()?;
    let (time, values) = (outcome.time, steepest::values(system, outcome));
    let is_met = |&switch: &usize| {
        let psi = system.switches[switch].psi;
        let by_time = system.time.as_variable().map(|time| psi.diff(time));
        let (mut rate, mut moves) = (by_time.map_or(0.0, |slope| values.value(slope)), 0.0);
        for (state, [low, high]) in system.states.iter().zip(ranges) {
            let slope = state.var.as_variable().map(|var| psi.diff(var));
            if let Some(slope) = slope.filter(|slope| !slope.is_zero()) {
                let slope = values.value(slope);
                rate += slope * values.value(state.rate);
                moves += slope.abs() * (high - low);
            }
        }
        let goes = rate.abs() * time;
        goes > SLOW * moves && values.value(psi).abs() <= NEAR * goes
    };
    let switch = &system.switches[gaps.find(is_met)?];
    Some(Warning {
        code: "W0710".into(),
        message: format!(
            "at t = {time}, where the run ends, `{}` is met as far as can be told; whether it is struck matters",
            switch.name
        ),
        span: switch.spans.first().copied(),
    })
}
