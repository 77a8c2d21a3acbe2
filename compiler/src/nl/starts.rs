//! Starts beside that of the file: a small problem has time for them, and a local minimum may be the least of several.

use std::num::NonZeroUsize;

use nsd_solver::optimization::kernels::Program;
use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{Observer, Options, Solution, Status, Trust};
use nsd_solver::optimization::problem::{Mpcc, Nlp};

/// How many starts there are at most, where it is not said how many.
const MOST: usize = 32;
/// They begin then as long as all iterations, times the number of variables and rows, are fewer than this: a second or two.
const EFFORT: usize = 1_000_000;
/// Each value of the start is moved by a normal deviate times one of these, by turns.
const DEVIATIONS: [f64; 4] = [0.3, 1.0, 3.0, 10.0];
/// Objectives that are less by a smaller share are the same.
const SAME: f64 = 1e-6;

/// The best local minimum that is found from the start of a problem and, where pairs make it one of many, from others.
pub(super) fn solve(
    program: &mut Program,
    starts: Option<NonZeroUsize>,
    options: &Options,
    observer: &mut dyn Observer,
) -> Solution {
    let start = program.start().to_vec();
    let mut best = mpcc::solve_observed(program, &start, options, observer);
    if program.pairs().is_empty() {
        return best;
    }
    let size = program.n_variables() + program.n_rows();
    let (mut iterations, mut relaxed) = (best.stats.iterations, best.stats.relaxed);
    for number in 0..starts.map_or(MOST, NonZeroUsize::get) - 1 {
        let is_over = options.limit.is_over() || matches!(best.status, Status::Unbounded);
        let is_much = starts.is_none() && iterations.saturating_mul(size) >= EFFORT;
        if is_over || is_much {
            break;
        }
        let deviation = DEVIATIONS[number / 2 % DEVIATIONS.len()];
        let moved = mpcc::perturbed(&start, deviation, 1, number as u64);
        // One way from each: relaxations forget where they start from, so that every second one is in the branch of its start.
        let options = Options {
            trust: match number % 2 {
                0 => Trust::No,
                _ => Trust::First,
            },
            effort: 0,
            max_restarts: 0,
            ..options.clone()
        };
        let found = mpcc::solve_observed(program, &moved, &options, observer);
        iterations += found.stats.iterations;
        relaxed += found.stats.relaxed;
        if is_better(&found, &best) {
            best = found;
        }
    }
    (best.stats.iterations, best.stats.relaxed) = (iterations, relaxed);
    best
}

/// Whether a solution is solved where the other one is not, or is less.
fn is_better(found: &Solution, best: &Solution) -> bool {
    let rank = |one: &Solution| (one.is_feasible(), one.status == Status::Solved);
    match rank(found).cmp(&rank(best)) {
        std::cmp::Ordering::Equal => {
            let gain = best.objective - found.objective;
            found.is_feasible() && gain > SAME * best.objective.abs().max(1.0)
        }
        other => other.is_gt(),
    }
}
