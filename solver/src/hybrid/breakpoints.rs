//! Breakpoints: where functions of time that are made of pieces go on with their next ones.
//!
//! No step goes beyond a breakpoint, so that each sees smooth functions. There x is kept, and what depends
//! on the data may jump or bend: a ψ that has jumped is treated like one that jumps with a relay
//! (`lead.rs`), and what lies on its surface then is decided by the new rates, sliding too.

use super::Side;
use crate::event::state::State;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::series;
use crate::hybrid::status::Status;
use crate::hybrid::system::HybridSystem;
use crate::integrate::step::{TOGETHER, Watch};
use crate::selector::algebraic::Initialization;
use crate::selector::select::Selector;

/// Which switches the data of pieces concerns.
pub(crate) struct Pieces {
    /// The next breakpoint; infinity where there is none.
    pub until: f64,
    /// Switches whose ψ may jump or bend there.
    switches: Vec<usize>,
    /// Switches whose rate φ may.
    rates: Vec<usize>,
}

impl Pieces {
    pub(crate) fn new(system: &HybridSystem) -> Self {
        let all = 0..system.n_switches();
        Pieces {
            until: f64::INFINITY,
            switches: (all.clone())
                .filter(|&i| system.switches[i].has_data[0])
                .collect(),
            rates: all.filter(|&i| system.switches[i].has_data[1]).collect(),
        }
    }

    /// Takes the pieces that hold from an instant on.
    pub(crate) fn load(&mut self, mode: &mut Mode, t: f64) {
        self.until = mode.load(t);
    }
}

/// An event that is closer to the end of a step, as a fraction of the step, may be there.
const NEAR: f64 = 1e-6;

impl Selector<'_> {
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
        self.pieces.load(self.mode, state.point.t);
        self.mode
            .measure_bands(state, &switches, t1 - state.point.t);
        let mut open = triggers.to_vec();
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
        let meets = |&&i: &&usize| {
            (state.point.sides[i] == Side::Slide || state.bands.armed[i]) && !self.system.leads(i)
        };
        open.extend(self.pieces.rates.iter().filter(meets));
        open.sort_unstable();
        open.dedup();
        if open.is_empty() && !Initialization::is_unsettled(self.mode, state, t1) {
            return Ok(());
        }
        self.change(state, &open, t1)
    }
}

/// True when an event at `tau` is not told apart from the end of its step `h`.
pub(crate) fn is_at_end(dense: Dense, tau: f64, h: f64, watch: Watch) -> bool {
    let at_end = match watch {
        Watch::Surface(i) => {
            let c = dense.psi(i);
            series::value(c, h).abs() <= TOGETHER * series::magnitude(c, h, 0)
        }
        Watch::Bound(i, limit) => (series::value(dense.alpha(i), h) - limit).abs() <= TOGETHER,
        Watch::Disc(_) => false,
    };
    at_end && h - tau <= NEAR * h
}
