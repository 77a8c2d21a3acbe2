//! A step that has been taken.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::{Few, Role, Status};
use crate::selector::selection::Fold;

/// Newton's method for α of a nonlinear switch has diverged if α is farther than this outside of [0, 1].
const DIVERGED: f64 = 0.5;

/// An accepted step, whose end is the point of the state.
#[derive(Default)]
pub(crate) struct Step {
    pub length: f64,
    pub reaches_end: bool,
    /// Switches whose surface is reached, or whose sliding ends, at the end of the step.
    pub triggers: Few<usize>,
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
            triggers: Few::from_slice(&[switch]),
            ..Step::default()
        }
    }
}

/// The status of a run in which no step can be taken: f is not finite, or the equations for α or for the algebraic
/// states are singular.
pub(super) fn step_failure(mode: &Mode) -> Status {
    // First α: if Newton's method has diverged, f(x, α) may be infinite for that reason.
    let has_diverged = |&i: &usize| {
        let alpha = mode.memory.values[1 + mode.n + i];
        mode.system.switches[i].is_nonlinear && !(-DIVERGED..=1.0 + DIVERGED).contains(&alpha)
    };
    let diverged: Vec<usize> = mode.sliding.iter().copied().filter(has_diverged).collect();
    if !diverged.is_empty() {
        return Status::SingularSliding { switches: diverged };
    }
    // Switches that are algebraic equations or complementarities.
    let sliding = mode.sliding.iter().copied();
    let algebraic: Vec<usize> = sliding
        .filter(|&i| mode.system.role(i) != Role::Step)
        .collect();
    // An infinite rate of an algebraic state means that its equations are singular.
    let is_explained = |state: usize| !algebraic.is_empty() && mode.system.is_algebraic(state);
    let mut rates = mode.field.f.iter().enumerate();
    if mode.sliding.is_empty() || !rates.all(|(i, f)| f.is_finite() || is_explained(i)) {
        return Status::NotFinite;
    }
    match algebraic.is_empty() {
        true => Status::SingularSliding {
            switches: mode.sliding.clone(),
        },
        false => Status::HighIndex {
            switches: algebraic,
        },
    }
}
