//! Long horizons by nested iteration (Hackbusch 1985, *Multi-Grid Methods and Applications*, chapter 5).
//!
//! A relaxation takes more iterations the more intervals there are, a branch does not. So what happens when is found with
//! few intervals, and the solution begins the program of finer ones, in its branch.

use super::problem::Given;
use super::start::{Begin, Start};
use super::{Problem, Sampled, branches, start};
use crate::limit::Limit;
use crate::lowering::discretize::inside;
use crate::project::watch::Watch;
use crate::report::{FoundBy, Way};
use crate::system::experiment::Lengths;
use nsd_solver::optimization::mpcc::{Options, Solution, Trust};

/// Programs with more intervals begin with fewer.
const LONG: usize = 128;
/// How many intervals of a grid are one of the next coarser grid.
const PARTS: [usize; 4] = [2, 3, 5, 7];

/// What leads to the point to start from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Before {
    /// Grid by grid, the coarsest first.
    pub ways: Vec<FoundBy>,
    /// Iterations in all.
    pub iterations: usize,
}

impl Before {
    /// Adds what was found from there.
    pub fn push(&mut self, solution: &Solution) {
        self.iterations += solution.stats.iterations;
        self.ways.push(FoundBy {
            way: match self.ways.is_empty() {
                true => Way::Relaxation,
                false => Way::Grid,
            },
            objective: solution.objective,
        });
    }
}

/// Where a task is solved from: a solution with fewer intervals, where they are many and there is one.
pub(super) fn begin(
    problem: &Problem,
    sampled: &[Sampled],
    limit: &Limit,
    watch: &mut dyn Watch,
) -> Option<Begin> {
    match intervals(problem).and_then(|n| from(problem, n, sampled, limit, watch)) {
        Some(begin) => Some(begin),
        None => problem.begin(Start::Task(sampled), limit),
    }
}

/// How many intervals the next coarser grid has; none where there is none.
fn intervals(problem: &Problem) -> Option<usize> {
    let grid = &problem.task.discretization;
    // What contacts give at the ends of parts would be no part of a solution, and numerical time has other parts.
    let is_split = problem.frozen.is_none() && problem.layout.boundaries.is_none();
    let is_alone = problem.task.starts.is_none();
    if grid.intervals <= LONG || grid.lengths != Lengths::Equal || !is_split || !is_alone {
        return None;
    }
    let horizon = problem.settings.horizon;
    let range = problem.task.horizon.unwrap_or((horizon, horizon));
    let mut coarser = PARTS.iter().filter(|&parts| grid.intervals % parts == 0);
    let n = grid.intervals / coarser.next()?;
    let bends = |table| inside(table, range, n).is_some();
    let is_bent = (problem.dcs.data.iter()).any(|data| bends(&data.table));
    (!is_bent).then_some(n)
}

/// The solution with `n` intervals as a start, in its branch.
fn from(
    problem: &Problem,
    n: usize,
    sampled: &[Sampled],
    limit: &Limit,
    watch: &mut dyn Watch,
) -> Option<Begin> {
    let mut task = problem.task.clone();
    task.discretization.intervals = n;
    let (system, settings) = (&problem.system, &problem.settings);
    let mut coarse = Problem::new(system, settings, &task, Given::Numbers).ok()?;
    let begin = begin(&coarse, sampled, limit, watch)?;
    let found = start::solve(&mut coarse, &begin, watch);
    let mut solution = found.solutions.into_iter().next()?;
    if !solution.is_feasible() {
        return None;
    }
    let options = &begin.options;
    if branches::has_other_modes(&coarse, &solution.w)
        && branches::settle(&mut coarse, &mut solution, options, limit, watch).is_some()
    {
        return None;
    }
    let point = coarse.point(&solution.w);
    let point = point.in_parts(&coarse.layout, &problem.layout);
    let mut before = begin.before;
    before.push(&solution);
    Some(Begin {
        guess: problem.lifted(&point)?,
        options: Options {
            trust: Trust::First,
            effort: 0,
            ..start::options(problem, true, None, limit)
        },
        is_solved_before: false,
        starts: None,
        before,
    })
}
