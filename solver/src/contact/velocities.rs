//! Stabilization of velocities at an event: what is left of the rates of closed contacts is taken away by impulses.
//!
//! A contact that closes may have a rate that is too small to be seen in its gap. With the impulses δ of
//!
//! v⁺ = v - P δ,   J P δ = J v,   P = M⁻¹Jᵀ,
//!
//! the rates of all contacts that are closed, and the slip velocities of those that stick, are zero. v⁺ is the nearest
//! point to v in the metric of M, so that its energy is no larger; any other way to zero may add some.

use super::rows::Rows;
use crate::event::state::State;
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, Side};
use crate::linalg::redundancy::eliminate;

/// Stops what is closed or sticks.
pub(crate) fn stabilize(mode: &mut Mode, state: &mut State) {
    let mut x = std::mem::take(&mut state.point.x);
    let has_stopped = stop(mode, &state.point, &state.point.sides, &mut x);
    state.point.x = x;
    if has_stopped {
        redirect_slips(mode, state);
    }
}

/// Stops what is closed or sticks on these sides in states x, at the time and with α of a point; false where nothing is
/// closed.
pub(crate) fn stop(mode: &mut Mode, point: &Point, taken: &[Side], x: &mut [f64]) -> bool {
    let mut sides: Few<Side> = taken.into();
    let mut alpha: Few<f64> = point.alpha[..].into();
    let mut rows: Few<usize> = Few::new();
    for i in 0..taken.len() {
        let slides = taken[i] == Side::Slide;
        match mode.system.slip_of(i) {
            None if slides && mode.system.switches[i].is_contact() => {
                alpha[i] = 0.0;
                rows.push(i);
            }
            // A force of a contact has no friction in it where α_t is ½.
            Some(contact) if taken[contact] == Side::Slide => {
                sides[i] = Side::Slide;
                alpha[i] = 0.5;
                rows.extend(slides.then_some(i));
            }
            _ => {}
        }
    }
    if rows.is_empty() {
        return false;
    }
    mode.enter(&sides);
    mode.eval(point.t, x, &alpha);
    let mut impulses: Vec<f64> = rows.iter().map(|&row| mode.psi(row)).collect();
    let system = mode.system.clone();
    let of_contacts = Rows::linearize(mode, &rows);
    let mut matrix = of_contacts.couplings(&rows);
    let sticks = |at: usize| system.slip_of(rows[at]).is_some();
    eliminate(&mut matrix, &mut impulses, sticks);
    of_contacts.take(x, |switch| {
        rows.binary_search(&switch).ok().map(|at| impulses[at])
    });
    true
}

/// Lets what slips do so in the direction that impulses have left.
fn redirect_slips(mode: &mut Mode, state: &mut State) {
    let mut sides = Few::from_slice(&state.point.sides);
    mode.move_to(&state.point);
    for (i, side) in sides.iter_mut().enumerate() {
        let contact = mode.system.slip_of(i);
        let slips = contact.is_some_and(|of| state.point.sides[of] == Side::Slide);
        if !slips || *side == Side::Slide || mode.system.across(i).is_some() {
            continue;
        }
        let band = BandWidths { mode }.of(i, state, 0.0);
        if mode.psi(i) * side.sign() < -band {
            *side = Side::of(-side.sign());
        }
    }
    state.point.set_sides(&sides);
}
