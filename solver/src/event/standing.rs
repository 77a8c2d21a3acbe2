//! The surfaces on which laws find the state: there a comparison has the value that it has between equal numbers.

use super::Simulator;
use crate::event::state::State;
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

/// Which surfaces count.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Stand {
    /// Those that the state slides along or rests on.
    Stays,
    /// All where ψ is zero: laws whose instant it is compare numbers, wherever the state comes from and goes.
    Is,
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

    /// Finds those that hold the state.
    pub fn find(&mut self, state: &mut State, stand: Stand, t1: f64) {
        let mut on = std::mem::take(&mut state.jumps.known.on);
        on.clear();
        for &i in self.looked_at {
            let holds = match state.point.sides[i] {
                Side::Slide => true,
                _ => {
                    self.mode.system.switches[i].is_plain()
                        && self.is_zero(state, i, t1)
                        && (stand == Stand::Is || self.stays(state, i, t1))
                }
            };
            on.extend(holds.then_some(i));
        }
        state.jumps.known.on = on;
    }

    fn is_zero(&mut self, state: &mut State, switch: usize, t1: f64) -> bool {
        let mode = &mut *self.mode;
        mode.move_to(&state.point);
        mode.enter_surfaces(&state.point.sides);
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
