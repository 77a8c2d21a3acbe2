//! What is left of the rates of closed contacts at an event, taken away by impulses.
//!
//! A contact that closes may have a rate that is too small to be seen in its gap. With the impulses δ of
//!
//! v⁺ = v - P δ,   J P δ = J v,   P = M⁻¹Jᵀ,
//!
//! the rates of all contacts that are closed, and the slip velocities of those that stick, are zero. v⁺ is the nearest
//! point to v in the metric of M, so that its energy is no larger; any other way to zero may add some.

use crate::contact::redundancy::eliminate;
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::Side;

impl Mode {
    /// Stops what is closed or sticks.
    pub(crate) fn halt(&mut self, state: &mut State) {
        let (mut sides, mut alpha) = (state.point.sides.clone(), state.point.alpha.clone());
        let mut rows = Vec::new();
        for i in 0..sides.len() {
            let slides = state.point.sides[i] == Side::Slide;
            match self.system.slip_of(i) {
                None if slides && self.is_contact(i) => {
                    alpha[i] = 0.0;
                    rows.push(i);
                }
                // A force of a contact has no friction in it where α_t is ½.
                Some(contact) if state.point.sides[contact] == Side::Slide => {
                    sides[i] = Side::Slide;
                    alpha[i] = 0.5;
                    rows.extend(slides.then_some(i));
                }
                _ => {}
            }
        }
        let mode = self;
        mode.enter(&sides);
        mode.eval(state.point.t, &state.point.x, &alpha);
        mode.linearize_impulses(&rows);
        let mut matrix = Vec::with_capacity(rows.len() * rows.len());
        for &row in &rows {
            matrix.extend(rows.iter().map(|&by| mode.coupling(row, by)));
        }
        let mut impulses: Vec<f64> = rows.iter().map(|&row| mode.psi(row)).collect();
        let sticks = |at: usize| mode.system.slip_of(rows[at]).is_some();
        eliminate(&mut matrix, &mut impulses, sticks);
        for (j, x) in state.point.x.iter_mut().enumerate() {
            for (switch, slope) in mode.field.slopes(j) {
                if let Ok(at) = rows.binary_search(&switch) {
                    *x -= slope * impulses[at];
                }
            }
        }
        mode.turn(state);
    }

    /// Lets what slips do so in the direction that impulses have left.
    fn turn(&mut self, state: &mut State) {
        let mut sides = state.point.sides.clone();
        self.move_to(&state.point);
        for (i, side) in sides.iter_mut().enumerate() {
            let contact = self.system.slip_of(i);
            let slips = contact.is_some_and(|of| state.point.sides[of] == Side::Slide);
            if !slips || *side == Side::Slide || self.system.across(i).is_some() {
                continue;
            }
            let band = self.band(i, state, 0.0);
            if self.psi(i) * side.sign() < -band {
                *side = Side::of(-side.sign());
            }
        }
        state.point.set_sides(sides);
    }
}
