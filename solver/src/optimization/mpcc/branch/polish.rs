//! From a point near a solution to the solution of its branch, with exact zeros on the sides that are held.

use std::ops::ControlFlow;

use super::reach::reach;
use crate::optimization::ipm;
use crate::optimization::mpcc::branch::Branch;
use crate::optimization::mpcc::certificate::Residuals;
use crate::optimization::mpcc::lift::Lifted;
use crate::optimization::mpcc::local::Local;
use crate::optimization::mpcc::observer::Program;
use crate::optimization::mpcc::work::Work;
use crate::optimization::problem::{Member, Nlp};

/// A point with multipliers of the rows of the vertical form.
#[derive(Clone, Debug)]
pub struct Guess {
    /// w.
    pub w: Vec<f64>,
    /// y.
    pub y: Vec<f64>,
}

/// A feasible point of a branch that its solver accepts.
#[derive(Clone, Debug)]
pub struct Polished {
    /// w and y.
    pub point: Guess,
    /// f.
    pub objective: f64,
    /// The sides that are held.
    pub zeros: Vec<Member>,
    /// What the point leaves.
    pub residuals: Residuals,
    /// Whether the optimality conditions of the branch are met.
    pub is_optimal: bool,
    /// A direction of negative curvature, in the vertical form.
    pub falling: Option<Vec<f64>>,
}

/// Rows and bounds of a solution are missed by no more, or by this share of the largest variable.
const ACCURATE: f64 = 1e-8;
const ROUNDINGS: f64 = 1e-14;

impl Polished {
    /// Whether rows and bounds are missed by little more than rounding: what a feasible point may miss them by is no small
    /// part of the steps of many elements.
    pub fn is_accurate(&self) -> bool {
        let largest = self.point.w.iter().fold(0.0_f64, |m, w| m.max(w.abs()));
        self.residuals.violation <= ACCURATE.max(ROUNDINGS * largest)
    }
}

/// μ and the largest number of iterations of a run that starts from the point of a relaxation, and of one that starts
/// anew if that has not come to its end.
const RUNS: [(f64, usize); 2] = [(1e-5, 100), (1e-1, 300)];
/// The largest number of iterations with pivots in pairs.
const MAX_PAIRED: usize = 100;

/// Errors of the conditions of a barrier problem at which its objective is believed.
const SETTLED: f64 = 1e-4;

/// What the solution of a branch is wanted for.
#[derive(Clone, Copy, Debug)]
pub enum Goal {
    /// The solution itself.
    Solution,
    /// A solution with an objective below this.
    Below(f64),
    /// The same, where the branch is feasible close to the point.
    Near(f64),
    /// A point with an objective below the first number in a box around the guess: no variable moves by more than the
    /// second one, times max(1, |w_i|).
    Within(f64, f64),
}

impl Goal {
    /// What the objective has to be below.
    fn below(self) -> Option<f64> {
        match self {
            Goal::Solution => None,
            Goal::Below(objective) | Goal::Near(objective) | Goal::Within(objective, _) => {
                Some(objective)
            }
        }
    }

    /// As much of a branch as is looked at from a guess.
    fn part<'l, 'p>(self, branch: Branch<'l, 'p>, guess: &Guess) -> Branch<'l, 'p> {
        match self {
            Goal::Within(_, reach) => branch.within(reach, &guess.w),
            _ => branch,
        }
    }
}

/// The solution of the branch with these zeros near a point.
///
/// The status `Stopped` says that its objective is not below what the goal is, as far as duality gaps tell.
pub fn polish(
    lifted: &mut Lifted<'_>,
    guess: &Guess,
    zeros: &[Member],
    goal: Goal,
    work: &mut Work<'_>,
) -> Result<Polished, ipm::Status> {
    let is_close = matches!(goal, Goal::Near(_) | Goal::Within(..));
    let runs = if is_close { &RUNS[..1] } else { &RUNS };
    lifted.settle(Some(zeros));
    if !lifted.has_objective()
        && let Some(polished) = nearest(lifted, &guess.w, zeros, work)
    {
        return Ok(polished);
    }
    let reduced = Local::new(lifted, &guess.w).reduced_gradient(&guess.y);
    let mut best: Result<Polished, ipm::Status> = Err(ipm::Status::LocallyInfeasible);
    for &(mu, max_iterations) in runs {
        let branch = Branch::new(lifted, zeros, &guess.w);
        let mut start = ipm::Point {
            w: branch.start().to_vec(),
            y: guess.y.clone(),
            z_l: reduced.iter().map(|r| r.max(0.0)).collect(),
            z_u: reduced.iter().map(|r| (-r).max(0.0)).collect(),
            mu,
        };
        // Where lost pivots keep a feasible point from becoming optimal, the run goes on without them.
        for pairs_pivots in [false, true] {
            let settings = ipm::Options {
                max_iterations: if pairs_pivots {
                    MAX_PAIRED
                } else {
                    max_iterations
                },
                pairs_pivots,
                ..ipm::Options::default()
            };
            let branch = goal.part(Branch::new(lifted, zeros, &start.w), guess);
            let found = solve(branch, &start, goal, settings, work)?;
            let residuals = Residuals::new(lifted, &found.w);
            if residuals.violation > work.options.feasibility || !found.objective.is_finite() {
                best = best.map_err(|_| found.status);
                break;
            }
            start = ipm::Point {
                w: found.w,
                y: found.y,
                z_l: found.z_l,
                z_u: found.z_u,
                mu: found.mu,
            };
            let polished = Polished {
                objective: lifted.objective(&start.w),
                zeros: zeros.to_vec(),
                residuals,
                is_optimal: matches!(found.status, ipm::Status::Solved | ipm::Status::Acceptable),
                point: Guess {
                    w: start.w.clone(),
                    y: start.y.clone(),
                },
                falling: found.falling,
            };
            if polished.is_optimal {
                return Ok(polished);
            }
            let is_best = |best: &Polished| best.objective <= polished.objective;
            if !best.as_ref().is_ok_and(is_best) {
                best = Ok(polished);
            }
            if !found.has_lost_pivots {
                break;
            }
        }
    }
    best
}

/// The nearest feasible point of a branch without an objective, which is as good as any other.
fn nearest(
    lifted: &mut Lifted<'_>,
    start: &[f64],
    zeros: &[Member],
    work: &mut Work<'_>,
) -> Option<Polished> {
    let w = reach(lifted, zeros, start, work)?;
    let residuals = Residuals::new(lifted, &w);
    if residuals.violation > work.options.feasibility {
        return None;
    }
    work.stats.branches += 1;
    Some(Polished {
        objective: lifted.objective(&w),
        zeros: zeros.to_vec(),
        residuals,
        is_optimal: true,
        point: Guess {
            y: vec![0.0; lifted.n_rows()],
            w,
        },
        falling: None,
    })
}

/// One run on the branch, or why it is of no use to the goal.
fn solve(
    mut branch: Branch<'_, '_>,
    start: &ipm::Point,
    goal: Goal,
    settings: ipm::Options,
    work: &mut Work<'_>,
) -> Result<ipm::Solution, ipm::Status> {
    work.stats.branches += 1;
    let settings = ipm::Options {
        tolerance: work.options.tolerance,
        bound_relaxation: 0.0,
        ..settings
    };
    let is_near = matches!(goal, Goal::Near(_));
    let mut is_lost = false;
    let mut hopeless = |progress: &ipm::Progress<'_>| {
        let Some(below) = goal.below() else {
            return ControlFlow::Continue(());
        };
        // What restoration minimizes is not the objective.
        let is_settled = !progress.is_restoration && progress.primal.max(progress.dual) <= SETTLED;
        is_lost = is_near && progress.is_restoration;
        match is_lost || is_settled && progress.objective - progress.gap > below {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let found = work.minimize(
        Program::Branch,
        &mut branch,
        settings,
        Some(start),
        &mut hopeless,
    );
    match found.status {
        ipm::Status::Stopped if is_lost => Err(ipm::Status::LocallyInfeasible),
        ipm::Status::Stopped => Err(ipm::Status::Stopped),
        _ => Ok(found),
    }
}
