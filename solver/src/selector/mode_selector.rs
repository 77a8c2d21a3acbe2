//! The mode that goes on from a point, for methods that integrate between events in their own way.
//!
//! Nonlinear switches may have several sliding modes that are all consistent with the complementarity conditions;
//! which of them is taken depends on the side that the state comes from (`dummy.rs`, `interacting.rs`). So a method that
//! knows the conditions alone asks here, with the sides and α that it has come with.

use super::select::Selector;
use crate::event::Simulator;
use crate::event::state::State;
use crate::hybrid::{Side, Status};
use crate::selector::selection::{Decision, Fold};

/// Where a method stands that asks.
#[derive(Clone, Copy, Debug)]
pub struct Query<'a> {
    /// The present time.
    pub t: f64,
    /// When the run ends.
    pub t1: f64,
    /// The state.
    pub x: &'a [f64],
    /// The largest magnitude of each state so far.
    pub scale: &'a [f64],
    /// Sides and α of all switches so far; none where a run starts.
    pub before: Option<(&'a [Side], &'a [f64])>,
    /// The switches that have reached their surface or stop to slide.
    pub triggers: &'a [usize],
    /// The switch among them whose sliding mode has ended in a fold.
    pub fold: Option<usize>,
}

/// How it goes on.
#[derive(Clone, Debug)]
pub struct Next {
    /// Sides of all switches.
    pub sides: Box<[Side]>,
    /// α of all switches.
    pub alpha: Vec<f64>,
    /// What decided about nonlinear switches.
    pub decisions: Vec<Decision>,
}

/// Knows how a system goes on from a point.
pub trait ModeSelector {
    /// The mode after an event.
    fn next(&mut self, query: Query) -> Result<Next, Status>;
}

impl ModeSelector for Simulator {
    fn next(&mut self, query: Query) -> Result<Next, Status> {
        let mut state = std::mem::take(&mut self.state);
        state.begin(query.t, query.x, self.system.n_switches());
        state.scales.largest.copy_from_slice(query.scale);
        let found = match query.before {
            None => self.start(&mut state, query.t1 - query.t),
            Some((sides, alpha)) => {
                state.point.set_sides(sides);
                state.point.alpha.copy_from_slice(alpha);
                self.selector().go_on(&mut state, query)
            }
        };
        let next = found.map(|()| Next {
            sides: state.point.sides.clone(),
            alpha: state.point.alpha.clone(),
            decisions: std::mem::take(&mut state.selection.decisions),
        });
        self.state = state;
        next
    }
}

impl Selector<'_> {
    /// Goes on from the sides and α of a state that was set.
    fn go_on(&mut self, state: &mut State, query: Query) -> Result<(), Status> {
        state.selection.begun = true;
        self.pieces.until = self.mode.memory.load(self.system, query.t);
        self.mode.enter(&state.point.sides);
        state.selection.fold = match query.fold {
            None => None,
            Some(switch) => Some(Fold::at(self.mode, &state.point, switch)?),
        };
        self.change(state, query.triggers, query.t1)
    }
}
