//! Starts beside that of the file: a small problem has time for them, and a local minimum may be the least of several.

use std::num::NonZeroUsize;

use nsd_solver::optimization::kernels::Program;
use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::{Observer, Options, Solution, Status, Trust};
use nsd_solver::optimization::problem::{Mpcc, Nlp, Side};

/// How many starts there are at most, where it is not said how many.
const MOST: usize = 32;
/// They begin then as long as all iterations, times the number of variables and rows, are fewer than this: a second or two.
const EFFORT: usize = 1_000_000;
/// Each value of the start is moved by a normal deviate times one of these, by turns.
const DEVIATIONS: [f64; 4] = [0.3, 1.0, 3.0, 10.0];
/// Objectives that are less by a smaller share are the same.
const SAME: f64 = 1e-6;

/// Up to so many variables between two bounds that they complement, all corners of their box are starts.
const MOST_AT_CORNERS: usize = 10;

/// The best local minimum that is found from the start of a problem and, where pairs make it one of many, from others.
pub(super) fn solve(
    program: &mut Program,
    starts: Option<NonZeroUsize>,
    options: &Options,
    observer: &mut dyn Observer,
) -> Solution {
    let start = program.start().to_vec();
    let best = mpcc::solve_observed(program, &start, options, observer);
    if program.pairs().is_empty() {
        return best;
    }
    let mut search = Search {
        iterations: best.stats.iterations,
        relaxed: best.stats.relaxed,
        best,
        program,
        options,
        observer,
        effort: match starts {
            Some(_) => usize::MAX,
            None => EFFORT,
        },
    };
    for number in 0..starts.map_or(MOST, NonZeroUsize::get) - 1 {
        let deviation = DEVIATIONS[number / 2 % DEVIATIONS.len()];
        let moved = mpcc::perturbed(&start, deviation, 1, number as u64);
        // Relaxations forget where they start from, so that every second one is in the branch of its start.
        let trust = match number % 2 {
            0 => Trust::No,
            _ => Trust::First,
        };
        search.try_from(&moved, trust);
    }
    if starts.is_none() {
        search.corners();
    }
    let Search {
        mut best,
        iterations,
        relaxed,
        ..
    } = search;
    (best.stats.iterations, best.stats.relaxed) = (iterations, relaxed);
    best
}

/// The best solution so far, and what it took.
struct Search<'s> {
    program: &'s mut Program,
    options: &'s Options,
    observer: &'s mut dyn Observer,
    best: Solution,
    iterations: usize,
    relaxed: usize,
    effort: usize,
}

impl Search<'_> {
    /// Whether no more starts are taken.
    fn is_over(&self) -> bool {
        let size = self.program.n_variables() + self.program.n_rows();
        let is_much = self.iterations.saturating_mul(size) >= self.effort;
        is_much || self.options.limit.is_over() || self.best.status == Status::Unbounded
    }

    /// Follows one way from a start; whether what it leads to is better.
    fn try_from(&mut self, start: &[f64], trust: Trust) -> bool {
        if self.is_over() {
            return false;
        }
        let options = Options {
            trust,
            effort: 0,
            max_restarts: 0,
            ..self.options.clone()
        };
        let found = mpcc::solve_observed(self.program, start, &options, self.observer);
        self.iterations += found.stats.iterations;
        self.relaxed += found.stats.relaxed;
        let is_better = is_better(&found, &self.best);
        if is_better {
            self.best = found;
        }
        is_better
    }

    /// Looks at the other ends of ranges whose distances to both ends complement each other, as those of binary variables do:
    /// at all of them together where there are few, else at one or two at a time, from every better point anew.
    fn corners(&mut self) {
        let bounds = self.program.variable_bounds();
        let ends = |side: Side| match side {
            Side::Variable(i) => Some((
                i as usize,
                bounds.lower[i as usize] + bounds.upper[i as usize],
            )),
            Side::Row(_) => None,
        };
        let pairs = self.program.pairs().iter();
        let ends: Vec<(usize, f64)> = pairs
            .filter_map(|pair| ends(pair.a).filter(|(_, sum)| sum.is_finite()))
            .collect();
        if ends.len() <= MOST_AT_CORNERS {
            let base = self.best.w.clone();
            for corner in 1..1_usize << ends.len() {
                let turned = (0..ends.len()).filter(|i| corner >> i & 1 == 1);
                self.try_from(&turned_over(&base, turned.map(|i| ends[i])), Trust::First);
            }
            return;
        }
        while !self.is_over() {
            let base = self.best.w.clone();
            let alone = ends.iter().map(|&end| vec![end]);
            let both = ends.iter().enumerate().flat_map(|(i, &first)| {
                let behind = ends[i + 1..].iter();
                behind.map(move |&second| vec![first, second])
            });
            let is_better = alone
                .chain(both)
                .any(|ends| self.try_from(&turned_over(&base, ends.into_iter()), Trust::First));
            if !is_better {
                break;
            }
        }
    }
}

/// A point with variables as far from the other end of their range, by the sum of both ends.
fn turned_over(w: &[f64], ends: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
    let mut turned = w.to_vec();
    for (i, sum) in ends {
        turned[i] = sum - w[i];
    }
    turned
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
