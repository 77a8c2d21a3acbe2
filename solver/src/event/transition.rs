//! From one mode to the next at an event: jumps, and the mode that goes on from where they lead.

use super::Simulator;
use super::jump::JumpLaws;
use super::standing::Surfaces;
use crate::contact::impact::Impacts;
use crate::event::state::State;
use crate::hybrid::{Effect, Few, Side, Status};
use crate::selector::select::{Met, Selector};

/// Jumps at one instant before they count as endless.
const MAX_ROUNDS: usize = 100;

impl Simulator {
    /// What selects the next mode.
    pub(crate) fn selector(&mut self) -> Selector<'_> {
        Selector {
            system: &self.system,
            mode: &mut self.mode,
            settings: &self.settings,
            coupling: &self.coupling,
            pieces: &mut self.pieces,
            projection: &mut self.projection,
        }
    }

    /// Takes the pieces of data at the start, and the sides on which relays begin.
    pub(super) fn load(&mut self, state: &mut State) {
        self.pieces.until = self.mode.memory.load(&self.system, state.point.t);
        let relay = |i: usize| self.system.relay(i).unwrap_or(Side::Plus);
        let sides = (0..state.point.sides.len()).map(relay);
        state.point.set_sides(&sides.collect::<Few<Side>>());
    }

    /// Finds the mode at the start, taking every surface that holds the state as meeting there.
    pub(crate) fn start(&mut self, state: &mut State, horizon: f64) -> Result<(), Status> {
        self.load(state);
        JumpLaws::new(&self.system, &mut self.mode).let_due(state);
        let on = self.selector().place(state, horizon, &[])?;
        let t1 = state.point.t + horizon;
        self.pass(state, Met::Surfaces(on), t1)
    }

    /// Finds the mode behind what was met.
    pub(crate) fn pass(&mut self, state: &mut State, met: Met, t1: f64) -> Result<(), Status> {
        match self.system.laws.is_empty() {
            true => self.selector().pass(state, met, t1),
            false => self.jump_and_pass(state, met, t1),
        }
    }

    /// Lets everything jump that jumps here, and finds the mode that goes on.
    fn jump_and_pass(&mut self, state: &mut State, mut met: Met, t1: f64) -> Result<(), Status> {
        state.jumps.begin();
        let mut last: Few<usize> = Few::new();
        let (Met::Surfaces(on) | Met::Breakpoint(on)) = &mut met;
        self.selector().wake(state, on, t1);
        JumpLaws::new(&self.system, &mut self.mode).find_near(state, on, t1);
        // At the start no side is one before.
        let is_step = |i: &usize| state.selection.begun && self.system.switches[*i].is_plain();
        let mut steps: Few<usize> = on.iter().copied().filter(is_step).collect();
        let mut due = std::mem::take(&mut state.jumps.known.due);
        for _ in 0..MAX_ROUNDS {
            let mut fired = JumpLaws::new(&self.system, &mut self.mode).struck(state);
            // What is reached counts as such before anything that it sets off takes the state away.
            let mut reached: Few<usize> = (fired.iter())
                .filter_map(|&law| self.system.laws[law].closes())
                .collect();
            reached.extend_from_slice(&steps);
            if !reached.is_empty() {
                Surfaces::of(self).find(state, t1);
                if JumpLaws::new(&self.system, &mut self.mode).stops(state, &reached) {
                    return Ok(());
                }
            }
            if fired.is_empty() {
                // What stops at a contact may no longer stick there.
                if !state.jumps.fired.is_empty()
                    && JumpLaws::new(&self.system, &mut self.mode).close(state)
                    && let Met::Surfaces(on) = &mut met
                {
                    *on = self.selector().place_kept(state, t1 - state.point.t)?;
                }
                // What nothing meets goes on as it was, up to what jumps.
                let is_met = !matches!(&met, Met::Surfaces(on) if on.is_empty());
                if is_met || due.is_empty() || !state.selection.begun {
                    self.selector().pass(state, met, t1)?;
                }
                steps.clear();
                Surfaces::of(self).find(state, t1);
                if JumpLaws::new(&self.system, &mut self.mode).stops(state, &[]) {
                    return Ok(());
                }
                fired = JumpLaws::new(&self.system, &mut self.mode).holding(state);
                fired.extend(due.drain(..));
            }
            if fired.is_empty() {
                return Ok(());
            }
            // What one impact sets in motion may strike the same contact again.
            let again = |law: &&usize| {
                let effect = &self.system.laws[**law].effect;
                last.contains(law) && matches!(effect, Effect::Reset(_))
            };
            if let Some(&law) = fired.iter().find(again) {
                return Err(Status::StaysInGuard { law });
            }
            JumpLaws::new(&self.system, &mut self.mode).apply(state, &fired)?;
            Impacts {
                system: self.system.clone(),
                mode: &mut self.mode,
                settings: &self.settings,
                coupling: &self.coupling,
            }
            .strike_all(state, &fired, &steps)?;
            let moves = |law: &usize| matches!(self.system.laws[*law].effect, Effect::Reset(_));
            let moves = fired.iter().any(moves);
            if moves {
                state.jumps.kept.clear();
            }
            let on = self.selector().place_kept(state, t1 - state.point.t)?;
            if moves {
                JumpLaws::new(&self.system, &mut self.mode).find_near(state, &on, t1);
            }
            met = Met::Surfaces(on);
            last = fired;
        }
        Err(Status::EndlessJumps {
            laws: last.into_vec(),
        })
    }

    /// Kicks the state at one of these instants, and finds the mode where it is then. Sliding does not survive where
    /// ψ leaves zero.
    pub(crate) fn kick(&mut self, state: &mut State, instant: f64, t1: f64) -> Result<(), Status> {
        if let Some(kicks) = &self.settings.kicks {
            let number = (instant / kicks.every).round();
            kicks.apply(number as u64, &mut state.point.x);
        }
        self.stepper.stiffness.after_event();
        let on = self.selector().place(state, t1 - state.point.t, &[])?;
        let fired = std::mem::take(&mut state.jumps.fired);
        let before = std::mem::take(&mut state.jumps.before);
        self.pass(state, Met::Surfaces(on), t1)?;
        // What has jumped at this instant has done so before the kick.
        if !fired.is_empty() {
            state.jumps.fired.splice(0..0, fired);
            state.jumps.before = before;
        }
        Ok(())
    }
}
