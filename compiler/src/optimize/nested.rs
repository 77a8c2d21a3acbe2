//! Long horizons by nested iteration (Hackbusch 1985, *Multi-Grid Methods and Applications*, chapter 5).
//!
//! A relaxation takes more iterations the more intervals there are, a branch hardly does. So what happens when is found
//! with few intervals, and the solution begins the program of all of them, in its branch.

use std::ops::RangeInclusive;

use super::checks::confirm::{Sequences, confirm};
use super::problem::Given;
use super::start::{Begin, Start};
use super::{Problem, Sampled, branches, start};
use crate::limit::Limit;
use crate::lowering::discretize::inside;
use crate::project::clock::Instant;
use crate::project::watch::Watch;
use crate::report::{Confirmation, FoundBy, Way};
use crate::system::experiment::Lengths;
use nsd_solver::optimization::mpcc::{Options, Solution, Trust};

/// How many intervals the first grid has: fewer may be too coarse, and programs with no more are solved by themselves.
const COARSE: RangeInclusive<usize> = 16..=64;
/// How many first grids are tried, where simulations contradict the solution on one.
const TRIED: usize = 2;
/// With more intervals, branches in which the solution means the same are not looked at: each takes as long as the solution.
const LONG: usize = 512;

/// What leads to the point to start from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Before {
    /// As that of [`Options`], where there was a way.
    pub patience: usize,
    /// What was found on the way, the first one first.
    pub ways: Vec<FoundBy>,
    /// Iterations in all.
    pub iterations: usize,
    /// Seconds in all.
    pub seconds: f64,
}

impl Before {
    /// How the program is solved that begins there: in its branch where there is one, as other ways were those of the first
    /// grid.
    pub fn options(&self, options: &Options) -> Options {
        match self.ways.is_empty() {
            true => options.clone(),
            false => Options {
                trust: Trust::First,
                effort: 0,
                patience: self.patience,
                ..options.clone()
            },
        }
    }

    /// The way of what is found from there.
    pub fn next(&self) -> Way {
        match self.ways.is_empty() {
            true => Way::Relaxation,
            false => Way::Grid,
        }
    }

    /// Adds what was found.
    pub fn push(&mut self, solution: &Solution, way: Way) {
        self.iterations += solution.stats.iterations;
        self.seconds += solution.stats.seconds;
        self.ways.push(FoundBy {
            way,
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
    let mut grids = intervals(problem).into_iter().take(TRIED);
    let begin = grids.find_map(|n| from(problem, n, sampled, limit, watch));
    begin.or_else(|| problem.begin(Start::Task(sampled), limit))
}

/// How many intervals the first grid may have, the finest first.
fn intervals(problem: &Problem) -> Vec<usize> {
    let grid = &problem.task.discretization;
    // What contacts give at the ends of parts would be no part of a solution, and numerical time has other parts.
    let is_split = problem.frozen.is_none() && problem.layout.boundaries.is_none();
    let is_alone = problem.task.starts.is_none();
    if grid.intervals <= *COARSE.end() || grid.lengths != Lengths::Equal || !is_split || !is_alone {
        return Vec::new();
    }
    let horizon = problem.settings.horizon;
    let range = problem.task.horizon.unwrap_or((horizon, horizon));
    let bends = |n: usize| {
        let mut tables = problem.dcs.data.iter().map(|data| &data.table);
        tables.any(|table| inside(table, range, n).is_some())
    };
    let are_parts = |n: &usize| grid.intervals.is_multiple_of(*n) && !bends(*n);
    COARSE.rev().filter(are_parts).collect()
}

/// The solution with `n` intervals as a start, in its branch.
fn from(
    problem: &Problem,
    n: usize,
    sampled: &[Sampled],
    limit: &Limit,
    watch: &mut dyn Watch,
) -> Option<Begin> {
    let started = Instant::now();
    let mut task = problem.task.clone();
    task.discretization.intervals = n;
    let (system, settings) = (&problem.system, &problem.settings);
    let mut coarse = Problem::new(system, settings, &task, Given::Numbers).ok()?;
    let begin = coarse.begin(Start::Task(sampled), limit)?;
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
    let mut ways = vec![FoundBy {
        way: Way::Relaxation,
        objective: solution.objective,
    }];
    // Where the program of all intervals may be too large for it, simulations say here which minimum is a better one.
    let looks = (options, Sequences::All);
    let (confirmation, _) = confirm(&mut coarse, &mut solution, looks, &mut ways, watch);
    if matches!(confirmation, Confirmation::Descent(_)) {
        return None;
    }
    let point = coarse.point(&solution.w);
    let point = point.in_parts(&coarse.layout, &problem.layout);
    Some(Begin {
        guess: problem.lifted(&point)?,
        options: start::options(problem, false, None, limit),
        is_solved_before: false,
        starts: None,
        before: Before {
            patience: match problem.task.discretization.intervals {
                ..=LONG => options.patience,
                _ => 0,
            },
            ways,
            iterations: solution.stats.iterations,
            seconds: started.elapsed().as_secs_f64(),
        },
    })
}
