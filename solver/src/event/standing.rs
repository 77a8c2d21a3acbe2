//! The surfaces on which laws find the state: there a comparison has the value that it has between equal numbers.

use super::Simulator;
use crate::event::state::{Known, State};
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::hybrid::{Effect, Guard, HybridSystem, Input, Side};
use crate::selector::decided::Onward;

/// The switches of laws, but for relays.
pub(super) fn looked_at(system: &HybridSystem) -> Vec<usize> {
    let reads = |switch: usize| {
        system.laws.iter().any(|law| {
            let resets = match &law.effect {
                Effect::Reset(reset) => reset.inputs.contains(&Input::Alpha(switch)),
                Effect::Impact(_) | Effect::Stop => false,
            };
            resets || matches!(law.guard, Guard::Sides { .. }) && law.guard.looks_at(switch)
        })
    };
    // What a relay remembers has no surface.
    let decides = |&i: &usize| reads(i) && system.relay(i).is_none();
    (0..system.n_switches()).filter(decides).collect()
}

/// The surfaces of switches of laws.
pub(super) struct Surfaces<'m> {
    mode: &'m mut Mode,
    looked_at: &'m [usize],
    /// That of a step.
    tolerance: f64,
}

impl<'m> Surfaces<'m> {
    pub fn of(simulator: &'m mut Simulator) -> Self {
        Surfaces {
            tolerance: simulator.settings.local_tolerance(),
            mode: &mut simulator.mode,
            looked_at: &simulator.looked_at,
        }
    }

    /// Finds those that hold the state: of all of them where ψ is zero, and of these where it stays so. Contacts and
    /// projections have theirs for themselves: laws compare nothing with them.
    pub fn find(&mut self, state: &mut State, t1: f64) {
        if self.looked_at.is_empty() {
            return;
        }
        let Known { zero, held, .. } = &mut state.jumps.known;
        let (mut zero, mut held) = (std::mem::take(zero), std::mem::take(held));
        zero.clear();
        held.clear();
        self.mode.move_to(&state.point);
        self.mode.enter_surfaces(&state.point.sides);
        for &i in self.looked_at {
            let slides = state.point.sides[i] == Side::Slide;
            if slides || self.mode.system.switches[i].is_plain() && self.is_zero(state, i, t1) {
                zero.push(i);
                held.extend(slides.then_some(i));
            }
        }
        for &i in &zero {
            if !held.contains(&i) && self.stays(state, i, t1) {
                held.push(i);
            }
        }
        (state.jumps.known.zero, state.jumps.known.held) = (zero, held);
    }

    fn is_zero(&mut self, state: &mut State, switch: usize, t1: f64) -> bool {
        let mode = &mut *self.mode;
        mode.surfaces.stand_for(switch, 0);
        BandWidths { mode }.measure(state, &[switch], t1 - state.point.t);
        mode.psi(switch).abs() <= state.bands.width[switch]
    }

    /// Whether ψ stays what it is in the present mode.
    fn stays(&mut self, state: &mut State, switch: usize, t1: f64) -> bool {
        let (mode, tolerance) = (&mut *self.mode, self.tolerance);
        let time = (t1 - state.point.t).max(state.scales.last_step);
        Onward { mode, tolerance }.leads(state, switch, time) == Some(0.0)
    }
}
