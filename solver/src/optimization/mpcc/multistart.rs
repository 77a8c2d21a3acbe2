//! Many starts, in parallel.

use super::solution::{Solution, Status};
use super::{Options, solve_from};
use crate::optimization::problem::Mpcc;
use crate::runtime::threads::Share;
use crate::runtime::{random, threads};

/// What came of many starts.
#[derive(Clone, Debug)]
pub struct MultiStart {
    /// The solution from every start, in their order, without those for which no time was left.
    pub solutions: Vec<Solution>,
    /// The solved one with the smallest objective, or where there is none, the feasible one.
    pub best: Option<usize>,
}

/// How the objectives of the feasible solutions spread.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spread {
    /// How many starts led to a feasible solution.
    #[serde(rename = "feasible")]
    pub n_feasible: usize,
    /// How many of them are within 1e-6, relative to max(1, |best|), of the best one.
    #[serde(rename = "at_best")]
    pub n_best: usize,
    /// The smallest objective.
    pub best: f64,
    /// The objective in the middle, the larger one of two.
    pub median: f64,
    /// The largest objective.
    pub worst: f64,
}

impl MultiStart {
    /// Chooses the best of these.
    pub fn new(solutions: Vec<Solution>) -> Self {
        let feasible = (0..solutions.len()).filter(|&i| solutions[i].is_feasible());
        let is_unsolved = |i: usize| solutions[i].status != Status::Solved;
        let best = feasible.min_by(|&i, &j| {
            let by_status = is_unsolved(i).cmp(&is_unsolved(j));
            by_status.then(solutions[i].objective.total_cmp(&solutions[j].objective))
        });
        MultiStart { solutions, best }
    }

    /// The spread; `None` when no start led to a feasible solution.
    pub fn spread(&self) -> Option<Spread> {
        let feasible = self.solutions.iter().filter(|s| s.is_feasible());
        let mut objectives: Vec<f64> = feasible.map(|s| s.objective).collect();
        objectives.sort_by(f64::total_cmp);
        let (&best, &worst) = (objectives.first()?, objectives.last()?);
        let reach = best + 1e-6 * best.abs().max(1.0);
        Some(Spread {
            n_feasible: objectives.len(),
            n_best: objectives.iter().filter(|f| **f <= reach).count(),
            best,
            median: objectives[objectives.len() / 2],
            worst,
        })
    }
}

/// Solves a problem from all of these points on up to `n_threads` threads.
///
/// Every run is the same as [`solve_from`] from its point alone, whatever the number of threads. All runs share the
/// time limit: once it is over no start begins but the first one. `watch` hears which start is done, counted from 0,
/// and what came of it.
///
/// # Panics
///
/// When a start has more or fewer values than the problem has variables.
pub fn multistart<P: Mpcc + Clone + Sync>(
    problem: &P,
    starts: &[Vec<f64>],
    options: &Options,
    n_threads: usize,
    watch: &mut dyn FnMut(usize, &Solution),
) -> MultiStart {
    let work = |share: Share<'_, Solution>| {
        let mut problem = problem.clone();
        while let Some(index) = share.next() {
            if index > 0 && options.limit.is_over() {
                return;
            }
            let found = solve_from(&mut problem, &starts[index], options);
            share.finish(index, found);
        }
    };
    let mut found = vec![None; starts.len()];
    let mut heard = |index: usize, solution: Solution| {
        watch(index, &solution);
        found[index] = Some(solution);
    };
    let asked = options.limit.asked();
    threads::share_out(starts.len(), n_threads, &asked, work, &mut heard);
    MultiStart::new(found.into_iter().flatten().collect())
}

/// Starts around a guess: every variable is moved by an independent normal deviate.
///
/// Start number k depends on the seed and k only, so that more starts leave the first ones as they are. The numbers
/// are those of SplitMix64 (Steele, Lea and Flood 2014), made normal by Box and Muller 1958.
pub fn perturbed(guess: &[f64], deviation: f64, seed: u64, number: u64) -> Vec<f64> {
    let mut state = random::mix(seed).wrapping_add(random::mix(!number));
    let moved = guess.iter().map(|w| w + deviation * normal(&mut state));
    moved.collect()
}

/// A normal deviate that depends on a seed, a number and a stream only: those of several streams are independent.
pub fn deviate(seed: u64, number: u64, stream: u64) -> f64 {
    let start = random::mix(seed).wrapping_add(random::mix(!number));
    normal(&mut random::mix(start ^ random::mix(stream)))
}

/// The next normal deviate of a generator in this state.
fn normal(state: &mut u64) -> f64 {
    let mut uniform = || {
        // In (0, 1]: 53 bits.
        ((random::next(state) >> 11) + 1) as f64 / (1u64 << 53) as f64
    };
    let (radius, angle) = (uniform(), uniform());
    (-2.0 * radius.ln()).sqrt() * (2.0 * std::f64::consts::PI * angle).cos()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::{Class, Multipliers, Options, Residuals, Solution, Stats, Status};
    use super::{MultiStart, multistart, perturbed};
    use crate::optimization::problem::Side;
    use crate::optimization::quadratic::{Function, Quadratic};
    use crate::runtime::limit::Over;

    #[test]
    fn deviates_are_normal() {
        let n = 100_000;
        let w = perturbed(&vec![1.0; n], 2.0, 7, 3);
        let mean = w.iter().sum::<f64>() / n as f64;
        let deviates = || w.iter().map(|w| (w - 1.0) / 2.0);
        let moment = |k: i32| deviates().map(|d| d.powi(k)).sum::<f64>() / n as f64;
        // Standard errors are 0.003, 0.0045 and about 0.03.
        assert!((mean - 1.0).abs() < 0.025, "{mean}");
        assert!((moment(2) - 1.0).abs() < 0.02, "{}", moment(2));
        assert!((moment(4) - 3.0).abs() < 0.15, "{}", moment(4));
        assert_ne!(w, perturbed(&vec![1.0; n], 2.0, 7, 4));
        assert_ne!(w, perturbed(&vec![1.0; n], 2.0, 8, 3));
    }

    /// (x - 1)^2
    fn parabola() -> Quadratic {
        let objective = Function::default().product(0, 0, 1.0).linear(0, -2.0);
        Quadratic::new(1, objective, Vec::new())
    }

    #[test]
    fn all_starts_share_the_time_limit() {
        let starts = vec![vec![0.0]; 5];
        let n_solved = |time: Option<Duration>| {
            let options = Options {
                limit: time.into(),
                ..Options::default()
            };
            let found = multistart(&parabola(), &starts, &options, 2, &mut |_, _| {});
            found.solutions.len()
        };
        assert_eq!(n_solved(None), 5);
        assert_eq!(n_solved(Some(Duration::from_secs(3600))), 5);
        assert_eq!(n_solved(Some(Duration::ZERO)), 1);
    }

    fn ending(status: Status, objective: f64) -> Solution {
        Solution {
            status,
            w: Vec::new(),
            objective,
            residuals: Residuals::default(),
            multipliers: Multipliers::default(),
            class: Class::None,
            is_class_exact: false,
            b_stationary: None,
            is_differentiable: true,
            biactive: Vec::new(),
            others: 0,
            stats: Stats::default(),
        }
    }

    #[test]
    fn solved_is_better_than_feasible_and_feasible_than_nothing() {
        let best = |ends: &[(Status, f64)]| {
            let ends = ends
                .iter()
                .map(|&(status, objective)| ending(status, objective));
            MultiStart::new(ends.collect()).best
        };
        use Status::{Feasible, LocallyInfeasible, Solved};
        assert_eq!(
            best(&[(Feasible, 1.0), (Solved, 3.0), (Solved, 2.0)]),
            Some(2)
        );
        assert_eq!(
            best(&[(LocallyInfeasible, 0.0), (Feasible, 5.0), (Feasible, 4.0)]),
            Some(2)
        );
        assert_eq!(
            best(&[
                (LocallyInfeasible, 0.0),
                (Status::Over(Over::TimeLimit), -1.0)
            ]),
            None
        );
    }

    #[test]
    fn the_best_of_two_minima() {
        // |w - (1, 2)|² on the half-axes has the minima 1 at (0, 2) and 4 at (1, 0).
        let objective = Function::default()
            .product(0, 0, 1.0)
            .product(1, 1, 1.0)
            .linear(0, -2.0)
            .linear(1, -4.0)
            .constant(5.0);
        let problem = Quadratic::new(2, objective, Vec::new())
            .bound(0, 0.0, f64::INFINITY)
            .bound(1, 0.0, f64::INFINITY)
            .complement(Side::Variable(0), Side::Variable(1));
        let starts: Vec<Vec<f64>> = (0..8).map(|k| perturbed(&[1.0, 1.0], 2.0, 1, k)).collect();
        let options = Options::default();
        let mut heard = Vec::new();
        let found = multistart(&problem, &starts, &options, 2, &mut |start, _| {
            heard.push(start)
        });
        let best = &found.solutions[found.best.expect("all are feasible")];
        assert!((best.objective - 1.0).abs() < 1e-8, "{best:?}");
        let spread = found.spread().expect("all are feasible");
        assert_eq!(spread.n_feasible, 8);
        assert!((spread.best - 1.0).abs() < 1e-8);
        for solution in &found.solutions {
            let f = solution.objective;
            assert!(
                (f - 1.0).abs() < 1e-8 || (f - 4.0).abs() < 1e-8,
                "{solution:?}"
            );
        }
        heard.sort_unstable();
        assert_eq!(heard, (0..8).collect::<Vec<_>>());
        // Threads change nothing.
        let alone = multistart(&problem, &starts, &options, 1, &mut |_, _| {});
        for (one, other) in alone.solutions.iter().zip(&found.solutions) {
            assert_eq!(one.w, other.w);
        }
    }
}
