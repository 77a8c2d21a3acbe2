//! Laws that end a run.

use super::Simulator;
use super::jump::JumpLaws;
use crate::event::state::State;
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::hybrid::{Effect, Side};
use crate::selector::decided::Onward;

/// The laws that end a run, at a point of it.
pub(super) struct Stops<'m> {
    mode: &'m mut Mode,
    /// That of a step.
    tolerance: f64,
}

impl<'m> Stops<'m> {
    pub fn of(simulator: &'m mut Simulator) -> Self {
        Stops {
            tolerance: simulator.settings.local_tolerance(),
            mode: &mut simulator.mode,
        }
    }

    /// Whether one ends the run here. On the surfaces of its switches is what is `reached`, what slides, and what is where ψ
    /// is zero and stays so.
    pub fn end(&mut self, state: &mut State, reached: Vec<usize>, t1: f64) -> bool {
        let system = self.mode.system.clone();
        let laws = system.laws.iter();
        let watched = laws.filter_map(|law| match &law.effect {
            Effect::Stop(on_surface) => Some(on_surface.iter().map(|(switch, _)| *switch)),
            _ => None,
        });
        let mut on = reached;
        for i in watched.flatten() {
            let is_on = match state.point.sides[i] {
                Side::Slide => true,
                _ => {
                    system.switches[i].is_plain()
                        && system.relay(i).is_none()
                        && self.rests_on(state, i, t1)
                }
            };
            on.extend(is_on.then_some(i));
        }
        JumpLaws::new(self.mode).stops(state, &on)
    }

    /// Whether ψ is zero, and stays so in the present mode.
    fn rests_on(&mut self, state: &mut State, switch: usize, t1: f64) -> bool {
        let (mode, tolerance) = (&mut *self.mode, self.tolerance);
        mode.move_to(&state.point);
        mode.enter_surfaces(&state.point.sides);
        mode.surfaces.stand_for(switch, 0);
        BandWidths { mode }.measure(state, &[switch], t1 - state.point.t);
        let is_zero = mode.psi(switch).abs() <= state.bands.width[switch];
        let time = (t1 - state.point.t).max(state.scales.last_step);
        is_zero && Onward { mode, tolerance }.leads(state, switch, time) == Some(0.0)
    }
}
