//! What a run comes to, for those who want an objective below one that is known.

use std::ops::ControlFlow;

use crate::ipm;

/// What the solution of a branch is wanted for.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// The solution itself.
    Solution,
    /// A solution with an objective below this.
    Below(f64),
    /// The same, where the branch is feasible close to the point.
    Near(f64),
}

impl Goal {
    /// What the objective has to be below.
    fn below(self) -> Option<f64> {
        match self {
            Goal::Solution => None,
            Goal::Below(objective) | Goal::Near(objective) => Some(objective),
        }
    }
}

/// Errors of the conditions of a barrier problem at which its objective is believed.
const SETTLED: f64 = 1e-4;
/// So many steps bring the violation of a branch that is feasible close by below this share of what it was. Of the
/// branches of the examples, those that needed more were infeasible or had larger objectives.
const APPROACH: (usize, f64) = (5, 0.5);
/// The objective is believed, too, where it has stayed so many times within this share of what it is too large by,
/// each time with such a violation: whole steps would have changed it by no more.
const STEADY: (usize, f64, f64) = (2, 0.1, 1e-2);

/// Ends runs that do not reach a goal.
#[derive(Debug)]
pub struct Outlook {
    goal: Goal,
    /// The violation at the start.
    first: f64,
    /// The objective one step ago, and how often it has stayed nearly the same.
    before: f64,
    steady: usize,
    /// How a run that has been ended has failed.
    pub verdict: ipm::Status,
}

impl Outlook {
    /// Before a run.
    pub fn new(goal: Goal) -> Self {
        Outlook {
            goal,
            first: f64::INFINITY,
            before: f64::INFINITY,
            steady: 0,
            verdict: ipm::Status::Stopped,
        }
    }

    /// Whether the branch turns out not to be feasible close to the start.
    fn is_far(&mut self, progress: &ipm::Progress<'_>) -> bool {
        if progress.iteration == 0 {
            self.first = progress.primal;
        }
        let (steps, share) = APPROACH;
        progress.is_restoration
            || progress.iteration >= steps && progress.primal > share * self.first
    }

    /// Whether the objective is not going to be below one, as far as duality gaps tell.
    fn is_above(&mut self, progress: &ipm::Progress<'_>, below: f64) -> bool {
        // What restoration minimizes is not the objective.
        if progress.is_restoration {
            return false;
        }
        let (count, share, violation) = STEADY;
        let excess = progress.objective - progress.gap - below;
        let whole_step = (progress.objective - self.before).abs() / progress.step_lengths.0;
        let is_steady = progress.primal <= violation && whole_step <= share * excess;
        self.steady = if is_steady { self.steady + 1 } else { 0 };
        self.before = progress.objective;
        let is_settled = progress.primal.max(progress.dual) <= SETTLED;
        excess > 0.0 && (is_settled || self.steady >= count)
    }
}

impl ipm::Observer for Outlook {
    fn iteration(&mut self, progress: &ipm::Progress<'_>) -> ControlFlow<()> {
        let Some(below) = self.goal.below() else {
            return ControlFlow::Continue(());
        };
        if matches!(self.goal, Goal::Near(_)) && self.is_far(progress) {
            self.verdict = ipm::Status::LocallyInfeasible;
            return ControlFlow::Break(());
        }
        match self.is_above(progress, below) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Goal, Outlook};
    use crate::ipm::{Observer, Progress, Status};

    /// After how many steps a run with these objectives, violations and lengths of steps is ended, and why.
    fn end(goal: Goal, points: &[(f64, f64, f64)]) -> Option<(usize, Status)> {
        let mut outlook = Outlook::new(goal);
        let mut points = points.iter().enumerate();
        let end = points.position(|(iteration, &(objective, primal, length))| {
            let progress = Progress {
                iteration,
                is_restoration: false,
                objective,
                primal,
                dual: 1.0,
                mu: 1e-5,
                gap: 1e-5,
                step: 1.0,
                regularization: 0.0,
                step_lengths: (length, length),
                trials: 1,
                w: &[],
            };
            outlook.iteration(&progress).is_break()
        })?;
        Some((end, outlook.verdict))
    }

    #[test]
    fn a_branch_that_stays_infeasible_is_not_near() {
        let points = [(1.0, 0.1, 0.02); 8];
        assert_eq!(
            end(Goal::Near(2.0), &points),
            Some((5, Status::LocallyInfeasible))
        );
        assert_eq!(end(Goal::Below(2.0), &points), None);
    }

    #[test]
    fn an_objective_that_stays_too_large_is_believed() {
        // It is too large by 1. Whole steps would change it by 0.2, then by 0.02 and by nothing: the last two count.
        let points = [
            (3.0, 0.1, 0.0),
            (2.11, 2e-2, 0.5),
            (2.01, 9e-3, 0.5),
            (2.0, 8e-3, 0.5),
            (2.0, 7e-3, 1.0),
        ];
        assert_eq!(end(Goal::Below(1.0), &points), Some((4, Status::Stopped)));
        // Short steps say little, and violation may hide a larger change.
        let short = points.map(|(f, primal, length)| (f, primal, 1e-3 * length));
        assert_eq!(end(Goal::Below(1.0), &short[..4]), None);
        let infeasible = points.map(|(f, primal, length)| (f, 10.0 * primal, length));
        assert_eq!(end(Goal::Below(1.0), &infeasible), None);
        // Below the goal nothing ends.
        assert_eq!(end(Goal::Below(2.5), &points), None);
        assert_eq!(end(Goal::Solution, &points), None);
    }
}
