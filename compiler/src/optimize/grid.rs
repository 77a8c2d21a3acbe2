//! Grids that refine themselves.
//!
//! A coarse grid is for finding what happens when, a fine one for saying it accurately: the solution on the one begins
//! the other, in its branch. Between switches the polynomials of elements converge as their degree grows, so that nodes
//! come first, and elements are halved where there are no more nodes or more of them gain little.

use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{Options, Solution, Status, Trust};

use super::checks::confirm::Sequences;
use super::checks::{confirm, simulated};
use super::problem::Given;
use super::{Problem, branches};
use crate::optimize::problem::size_of_objective;
use crate::project::watch::Watch;
use crate::report::{Confirmation, FoundBy, GridTried, Way};
use crate::system::experiment::Discretization;

/// How often a solution is refined and confirmed, where the one leads to another.
const MOST_ROUNDS: usize = 3;
/// How many nodes come with a finer grid, and how many where that leads to no solution.
const MORE_NODES: [usize; 2] = [2, 1];
/// Grids that do not divide the error by so much gain little, once it is below the second number: before, solutions may
/// be far apart.
const WORTH: f64 = 4.0;
const ROUGH: f64 = 1e-2;
/// How often elements are halved.
const MOST_HALVINGS: usize = 2;
/// So many iterations may lead to no solution in any case.
const LOST: usize = 800;
/// A finer grid costs more by no more than this, relative to max(1, |J|): what does is another minimum.
const WORSE: f64 = 1.0;

/// What simulations say of a solution, or of what they lead to, on a grid that is fine enough where it is to be.
pub(super) fn confirm(
    problem: &mut Problem,
    solution: &mut Solution,
    options: &Options,
    (grids, ways): (&mut Vec<GridTried>, &mut Vec<FoundBy>),
    watch: &mut dyn Watch,
) -> (Confirmation, Option<f64>) {
    let looks = (options, Sequences::WithMemory);
    if !problem.task.discretization.refines {
        return confirm::confirm(problem, solution, looks, ways, watch);
    }
    refine(problem, solution, options, (grids, ways), watch);
    let mut said = confirm::confirm(problem, solution, looks, ways, watch);
    for _ in 1..MOST_ROUNDS {
        // Another solution may ask for another grid.
        let last = grids.last().map(|grid| grid.objective);
        let is_other = last != Some(solution.objective);
        if !is_other || !refine(problem, solution, options, (grids, ways), watch) {
            break;
        }
        said = confirm::confirm(problem, solution, looks, ways, watch);
    }
    said
}

/// Takes finer and finer grids until a simulation with the controls ends where the program does, or none gets closer;
/// whether there was one. Programs that lead to no solution take together about as many iterations as the solution did.
fn refine(
    problem: &mut Problem,
    solution: &mut Solution,
    options: &Options,
    (tried, ways): (&mut Vec<GridTried>, &mut Vec<FoundBy>),
    watch: &mut dyn Watch,
) -> bool {
    let limit = &options.limit;
    let (mut is_refined, mut lost) = (false, 0);
    loop {
        let grid = &problem.task.discretization;
        let last = GridTried {
            elements: grid.elements,
            nodes: grid.scheme.1,
            objective: solution.objective,
            error: simulated::disagreement(problem, solution, limit),
        };
        tried.pop_if(|known| (known.elements, known.nodes) == (last.elements, last.nodes));
        tried.push(last);
        if last.error <= problem.settings.numerics.tolerance {
            return is_refined;
        }
        let mut finer = None;
        for grid in next(problem, tried) {
            if limit.is_over() || lost > solution.stats.iterations.max(LOST) {
                break;
            }
            match on(problem, solution, grid, options, watch) {
                Ok(found) => {
                    finer = Some(found);
                    break;
                }
                Err(iterations) => lost += iterations,
            }
        }
        let Some((mut finer, mut found)) = finer else {
            return is_refined;
        };
        found.stats.iterations += solution.stats.iterations;
        // Simulations do not know of grids.
        finer.runs = std::mem::take(&mut problem.runs);
        (*problem, *solution) = (finer, found);
        ways.push(FoundBy {
            way: Way::Grid,
            objective: solution.objective,
        });
        is_refined = true;
    }
}

/// The grids that may be next, the first choice first; none where they are not expected to gain.
fn next(problem: &Problem, tried: &[GridTried]) -> Vec<Discretization> {
    let grid = &problem.task.discretization;
    let (nodes, most) = (grid.scheme.1, *grid.scheme.0.nodes().end());
    let gains = |pair: &[GridTried]| {
        pair[1].error > ROUGH
            || !pair[1].error.is_finite()
            || pair[0].error >= WORTH * pair[1].error
    };
    let (last, had_more_nodes) = match tried.windows(2).last() {
        Some(pair) => (gains(pair), pair[0].nodes < pair[1].nodes),
        None => (true, true),
    };
    let mut grids: Vec<Discretization> = Vec::new();
    let more_nodes = MORE_NODES.map(|more| (nodes + more).min(most));
    for count in more_nodes
        .into_iter()
        .filter(|&count| count > nodes && last)
    {
        let mut finer = grid.clone();
        finer.scheme.1 = count;
        grids.push(finer);
    }
    let halvings = tried
        .windows(2)
        .filter(|pair| pair[0].elements < pair[1].elements);
    // What contacts give where the halves of an element meet would be no part of the solution.
    let may_halve = problem.layout.boundaries.is_none() && halvings.count() < MOST_HALVINGS;
    if may_halve && (last || had_more_nodes) {
        let mut finer = grid.clone();
        finer.elements *= 2;
        grids.push(finer);
    }
    grids.dedup();
    grids
}

/// The solution on another grid, in the branch of this one, if there is one that is as good a solution; else how many
/// iterations show that there is none.
fn on<'e>(
    problem: &Problem<'e>,
    solution: &Solution,
    grid: Discretization,
    options: &Options,
    watch: &mut dyn Watch,
) -> Result<(Problem<'e>, Solution), usize> {
    let mut task = problem.task.clone();
    task.discretization = grid;
    let (system, settings) = (&problem.system, &problem.settings);
    let mut finer = Problem::new(system, settings, &task, Given::Numbers).map_err(|_| 0_usize)?;
    finer.analyses = problem.analyses.clone();
    let point = problem.point(&solution.w);
    let start = finer.lifted(&point.refined(&problem.layout, &finer.layout));
    let start = start.ok_or(0_usize)?;
    let options = Options {
        trust: Trust::Alone,
        effort: 0,
        certificate: mpcc::Tolerances {
            sizes: Some(finer.sizes.clone()),
            ..options.certificate.clone()
        },
        ..options.clone()
    };
    let mut found = mpcc::solve_observed(&mut finer.program, &start, &options, watch);
    let most = solution.objective + WORSE * size_of_objective(problem, solution.objective);
    let is_as_good = |found: &Solution| {
        let is_kept = found.status == Status::Solved || solution.status != Status::Solved;
        found.is_feasible() && is_kept && found.objective <= most
    };
    let mut is_found = is_as_good(&found);
    if is_found && !finer.dcs.switches.branches.is_empty() {
        let limit = &options.limit;
        let failure = branches::settle(&mut finer, &mut found, &options, limit, watch);
        is_found = failure.is_none() && is_as_good(&found);
    }
    match is_found {
        true => Ok((finer, found)),
        false => Err(found.stats.iterations),
    }
}
