//! A step that has been taken.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::{Role, Status};
use crate::selector::selection::Fold;

/// α of a sliding mode that is so far outside of [0, 1] is none.
const ASTRAY: f64 = 0.5;

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

/// Why no step goes on from here.
pub(super) fn stuck(mode: &Mode) -> Status {
    // An α that was not found makes rates infinite, and is not made so by them.
    let is_lost = |&i: &usize| {
        let alpha = mode.memory.values[1 + mode.n + i];
        mode.system.switches[i].is_nonlinear && !(-ASTRAY..=1.0 + ASTRAY).contains(&alpha)
    };
    let lost: Vec<usize> = mode.sliding.iter().copied().filter(is_lost).collect();
    if !lost.is_empty() {
        return Status::SingularSliding { switches: lost };
    }
    let kept = mode.sliding.iter().copied();
    let kept: Vec<usize> = kept
        .filter(|&i| mode.system.role(i) != Role::Step)
        .collect();
    let states = mode.field.f.iter().enumerate();
    // Where it is the rates of algebraic states that grow without bound, their equations turn singular.
    let mut others = states.filter(|(i, _)| !mode.system.is_algebraic(*i));
    if mode.sliding.is_empty()
        || others.any(|(_, f)| !f.is_finite())
        || kept.is_empty() && mode.field.f.iter().any(|f| !f.is_finite())
    {
        return Status::NotFinite;
    }
    match kept.is_empty() {
        true => Status::SingularSliding {
            switches: mode.sliding.clone(),
        },
        false => Status::HighIndex { switches: kept },
    }
}
