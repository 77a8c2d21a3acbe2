//! The mode that goes on from a point, for methods that integrate between events in their own way.
//!
//! Nonlinear switches may have several sliding modes that are all consistent with the complementarity conditions;
//! which of them is taken depends on the side that the state comes from (`dummy.rs`, `several.rs`). So a method that
//! knows the conditions alone asks here, with the sides and α that it has come with.

use crate::event::Simulator;
use crate::event::state::State;
use crate::hybrid::{Side, Status};
use crate::selector::selection::Decision;
use crate::selector::selection::Fold;

/// Where a method stands that asks.
#[derive(Clone, Copy, Debug)]
pub struct Standing<'a> {
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
pub trait Guide {
    /// The mode after an event.
    fn next(&mut self, standing: Standing) -> Result<Next, Status>;
}

impl Guide for Simulator {
    fn next(&mut self, standing: Standing) -> Result<Next, Status> {
        let mut state = std::mem::take(&mut self.state);
        let found = self.next_from(&mut state, standing);
        let next = found.map(|()| Next {
            sides: state.point.sides.clone(),
            alpha: state.point.alpha.clone(),
            decisions: std::mem::take(&mut state.selection.decisions),
        });
        self.state = state;
        next
    }
}

impl Simulator {
    fn next_from(&mut self, state: &mut State, standing: Standing) -> Result<(), Status> {
        let Standing { t, t1, x, .. } = standing;
        state.begin(t, x, self.system.n_switches());
        state.scales.largest.copy_from_slice(standing.scale);
        let Some((sides, alpha)) = standing.before else {
            return self.start(state, t1 - t);
        };
        state.selection.begun = true;
        self.pieces.until = self.mode.load(t);
        state.point.set_sides(sides.into());
        state.point.alpha.copy_from_slice(alpha);
        self.mode.enter(&state.point.sides);
        state.selection.fold = match standing.fold {
            None => None,
            Some(switch) => Some(Fold::at(&mut self.mode, &state.point, switch)?),
        };
        self.selector().change(state, standing.triggers, t1)
    }
}
