//! A step that has been taken.

use crate::event::state::State;
use crate::hybrid::Status;
use crate::selector::selection::Fold;

/// An accepted step, whose end is the point of the state.
#[derive(Default)]
pub(crate) struct Step {
    pub length: f64,
    pub reaches_end: bool,
    /// Switches whose surface is reached, or whose sliding ends, at the end of the step.
    pub triggers: Vec<usize>,
    /// ‖x' - f‖ h at the end, relative to the magnitude of the states.
    pub defect: f64,
    /// Whether its polynomials are those of the implicit method.
    pub implicit: bool,
    /// What ends the run where it ends.
    pub ends: Option<Status>,
    /// Whether it is the first one of what sets off from rest, in the mode in which that sticks.
    pub departs: bool,
}

impl Step {
    /// One that ends in a fold, where the point behind it is known.
    pub(crate) fn to_fold(state: &mut State, fold: Fold) -> Self {
        std::mem::swap(&mut state.point.x, &mut state.trial.x);
        for turn in &fold.turns {
            state.point.alpha[turn.switch] = turn.alpha;
        }
        let (length, switch) = (fold.after, fold.switch);
        state.selection.fold = Some(fold);
        Step {
            length,
            ..Step::at_once(switch)
        }
    }

    /// One without a length, at the end of which a switch changes.
    pub(crate) fn at_once(switch: usize) -> Self {
        Step {
            triggers: vec![switch],
            ..Step::default()
        }
    }
}
