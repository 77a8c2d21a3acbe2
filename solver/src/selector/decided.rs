//! What does not wait for the rates at an event: relays, switches of time, and every ψ that jumps
//! with them.
//!
//! Where one of them changes its side, x is kept and all ψ are evaluated again. A ψ that has jumped to
//! the other side of its surface takes its switch there, one that has jumped onto it is decided by the
//! rates, and sliding does not survive a jump of its own ψ. Relays among them may make others jump in
//! turn; all that is due at one time happens together.

use smallvec::SmallVec;

use super::algebraic::Initialization;
use super::select::{Met, Selector};
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::series;
use crate::expansion::step_size::StepSize;
use crate::expansion::taylor::Expansion;
use crate::hybrid::{Few, HybridSystem, Role, Side, Status};

/// The switches on another side.
pub(super) fn changes(before: &[Side], after: &[Side]) -> Few<usize> {
    (0..before.len())
        .filter(|&i| before[i] != after[i])
        .collect()
}

/// Of switches that are to change, those that do first: a relay remembers what others have been for a moment, so it comes
/// behind all others, and behind the relays that it reads.
pub(super) fn innermost(system: &HybridSystem, changed: &[usize]) -> Few<usize> {
    let is_relay = |i: &usize| system.relay(*i).is_some();
    let (relays, others): (Few<usize>, Few<usize>) = changed.iter().copied().partition(is_relay);
    if !others.is_empty() {
        return others;
    }
    let reads = |i: usize, k: usize| i != k && system.switches[i].inside.binary_search(&k).is_ok();
    let is_first = |&&i: &&usize| !relays.iter().any(|&k| reads(i, k));
    let first: Few<usize> = relays.iter().filter(is_first).copied().collect();
    if first.is_empty() { relays } else { first }
}

impl Selector<'_> {
    /// Decides what leads among `triggers`, and all that jumps with it. Returns the switches that
    /// their rates decide.
    pub(crate) fn lead(
        &mut self,
        state: &mut State,
        triggers: &[usize],
        t1: f64,
    ) -> Result<Few<usize>, Status> {
        let (leading, mut open): (Few<usize>, Few<usize>) = triggers
            .iter()
            .copied()
            .partition(|&i| self.system.switches[i].leads());
        if leading.is_empty() {
            return Ok(open);
        }
        self.bands().measure(state, &leading, t1 - state.point.t);
        let before: Few<Side> = Few::from_slice(&state.point.sides);
        let psi = self.mode.all_psi(&state.point);
        let flips: Few<usize> = (leading.iter().copied())
            .filter(|&i| self.system.relay(i).is_some() && self.leaves(state, i, t1))
            .collect();
        for &i in &leading {
            state.bands.armed[i] = true;
            if self.system.switches[i].is_timed {
                let wanted = self.wanted(&[i], &[i]);
                self.choose(state, &[i], &wanted, t1, true)?;
            }
        }
        self.flip(state, &flips);
        self.cascade(state, &before, psi, &mut open, t1)?;
        let changed = changes(&before, &state.point.sides);
        open.extend((0..before.len()).filter(|&i| {
            let meets = state.point.sides[i] == Side::Slide || state.bands.armed[i];
            let couplings = &self.system.switches[i].couplings;
            let coupled = || changed.iter().any(|j| couplings.binary_search(j).is_ok());
            meets && !self.system.switches[i].leads() && coupled()
        }));
        open.sort_unstable();
        open.dedup();
        Ok(open)
    }

    /// Follows what jumps with the switches that are on other sides than `before`, where ψ were `psi`,
    /// to the end.
    pub(crate) fn cascade(
        &mut self,
        state: &mut State,
        before: &[Side],
        mut psi: Few<f64>,
        open: &mut Few<usize>,
        t1: f64,
    ) -> Result<(), Status> {
        let mut seen: SmallVec<[Few<Side>; 2]> = SmallVec::new();
        while *state.point.sides != *seen.last().map_or(before, |sides| &**sides) {
            let last = seen.last().map_or(before, |sides| &**sides);
            if *state.point.sides == *before
                || seen.iter().any(|sides| **sides == *state.point.sides)
            {
                let all = || seen.iter().map(|sides| &**sides).chain([before]);
                let differs = |i: &usize| all().any(|sides| sides[*i] != state.point.sides[*i]);
                let switches = (0..before.len()).filter(differs).collect();
                return Err(Status::Restless { switches });
            }
            let changed = changes(last, &state.point.sides);
            seen.push(Few::from_slice(&state.point.sides));
            let last = std::mem::replace(&mut psi, self.mode.all_psi(&state.point));
            let holds = |&i: &usize| {
                let inside = &self.system.switches[i].inside;
                (changed.iter()).any(|j| *j != i && inside.binary_search(j).is_ok())
            };
            let held: Few<usize> = (0..before.len()).filter(holds).collect();
            self.bands().measure(state, &held, t1 - state.point.t);
            for i in held {
                self.jump(state, i, last[i], psi[i], open);
            }
        }
        Ok(())
    }

    /// What the jump of ψ of a switch from `last` to `psi` does to it.
    pub(crate) fn jump(
        &mut self,
        state: &mut State,
        i: usize,
        last: f64,
        psi: f64,
        open: &mut Few<usize>,
    ) {
        let band = state.bands.width[i];
        // z jumps with an equation, which stays one.
        if self.system.role(i) != Role::Step {
            return;
        }
        if self.system.relay(i).is_some() {
            state.bands.armed[i] = psi.abs() <= band;
            if psi * state.point.sides[i].sign() < -band {
                self.flip(state, &[i]);
            }
        } else if let Some(other) = self.system.across(i) {
            self.jump_in_plane(state, [i, other], open);
        } else if (psi - last).abs() > band {
            state.bands.armed[i] = false;
            if psi.abs() <= band {
                open.push(i);
            } else {
                open.retain(|other| *other != i);
                state.point.change_sides(&[i], &[Side::of(psi)]);
            }
        }
    }

    /// What a slip velocity with two entries does where it has jumped: it slips, or has come to zero.
    fn jump_in_plane(&mut self, state: &mut State, pair: [usize; 2], open: &mut Few<usize>) {
        let Mode {
            surfaces, memory, ..
        } = &mut *self.mode;
        let [w, other] = pair.map(|i| surfaces.value(i, &memory.values));
        let band = pair.map(|i| state.bands.width[i]);
        if w.hypot(other) <= band[0].max(band[1]) {
            let slips = |i: &usize| state.point.sides[*i] != Side::Slide;
            open.extend(pair.into_iter().filter(slips));
            return;
        }
        open.retain(|i| !pair.contains(i));
        for i in pair {
            state.bands.armed[i] = false;
        }
        state.point.change_sides(&pair, &[Side::Plus; 2]);
    }

    /// Sends relays to their other side.
    fn flip(&self, state: &mut State, relays: &[usize]) {
        let mut sides: Few<Side> = Few::from_slice(&state.point.sides);
        for &i in relays {
            state.bands.armed[i] = false;
            sides[i] = Side::of(-sides[i].sign());
        }
        state.point.set_sides(&sides);
    }

    /// True when a relay on its threshold goes beyond it, in the present mode.
    fn leaves(&mut self, state: &mut State, relay: usize, t1: f64) -> bool {
        let tolerance = self.settings.local_tolerance();
        let mode = &mut *self.mode;
        let ahead = Onward { mode, tolerance }.leads(state, relay, t1 - state.point.t);
        let side = state.point.sides[relay].sign();
        ahead.is_none_or(|rate| rate * side < 0.0)
    }

    /// Goes on with the next pieces, and finds the mode that begins there; `triggers` have an event at
    /// the same instant.
    pub(crate) fn pass_breakpoint(
        &mut self,
        state: &mut State,
        triggers: &[usize],
        t1: f64,
    ) -> Result<(), Status> {
        let switches = std::mem::take(&mut self.pieces.switches);
        self.mode.move_to(&state.point);
        self.mode.enter_surfaces(&state.point.sides);
        for &i in &switches {
            self.mode.surfaces.stand_for(i, 0);
        }
        let last: Vec<f64> = switches.iter().map(|&i| self.mode.psi(i)).collect();
        // The end of a run may be a rounding before it.
        let instant = state.point.t.max(self.pieces.until);
        self.pieces.until = self.mode.memory.load(self.system, instant);
        self.bands().measure(state, &switches, t1 - state.point.t);
        let mut open: Few<usize> = triggers.into();
        if !switches.is_empty() {
            let (before, psi) = (state.point.sides.clone(), self.mode.all_psi(&state.point));
            for (&i, last) in switches.iter().zip(last) {
                self.jump(state, i, last, psi[i], &mut open);
                let stays = (psi[i] - last).abs() <= state.bands.width[i];
                if stays && psi[i].abs() <= state.bands.width[i] {
                    open.push(i);
                }
            }
            self.cascade(state, &before, psi, &mut open, t1)?;
        }
        self.pieces.switches = switches;
        let meets = |&i: &usize| {
            (state.point.sides[i] == Side::Slide || state.bands.armed[i])
                && !self.system.switches[i].leads()
        };
        open.extend(self.pieces.rates.iter().copied().filter(meets));
        open.sort_unstable();
        open.dedup();
        if open.is_empty() && !Initialization::is_unsettled(self.mode, state, t1) {
            return Ok(());
        }
        self.change(state, &open, t1)
    }

    /// The mode behind what was met, without jumps.
    pub(crate) fn pass(&mut self, state: &mut State, met: Met, t1: f64) -> Result<(), Status> {
        match met {
            Met::Surfaces(on) if on.is_empty() => Ok(()),
            Met::Surfaces(on) => self.change(state, &on, t1),
            Met::Breakpoint(on) => self.pass_breakpoint(state, &on, t1),
        }
    }
}

/// What ψ does in the present mode.
pub(crate) struct Onward<'m> {
    pub mode: &'m mut Mode,
    /// That of a step.
    pub tolerance: f64,
}

impl Onward<'_> {
    /// The first term by which ψ leaves its band, in a step within this time; zero where it stays, none where that is not
    /// known.
    pub(crate) fn leads(self, state: &mut State, switch: usize, time: f64) -> Option<f64> {
        let Onward { mode, tolerance } = self;
        let mut alpha: Few<f64> = Few::from_slice(&state.point.alpha);
        mode.enter(&state.point.sides);
        let expanded = Expansion { mode }.around(state.point.t, &state.point.x, &mut alpha);
        expanded.ok()?;
        state.scales.measure(mode, &mut state.bands);
        let bands = &mut state.bands;
        Monitor { mode, bands }.expand(switch);
        mode.monitored.switches.clear();
        mode.monitored.switches.push(switch);
        let step_size = StepSize { mode, tolerance };
        let h = step_size.of_states(&state.scales, time);
        let h = step_size.of_psi(&state.bands, h);
        let c = mode.psi_series(switch);
        let leading = series::leading(c, h, state.bands.width[switch]);
        Some(leading.map_or(0.0, |k| c[k]))
    }
}
