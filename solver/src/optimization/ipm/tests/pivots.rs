//! Pivots that a static order loses.

use std::ops::ControlFlow;

use crate::optimization::ipm::{Options, Progress, Solution, Status, solve};
use crate::optimization::quadratic::{Function, Quadratic};

const N: usize = 150;
const HORIZON: f64 = 0.2;

/// The double integrator from rest at 0 to rest at 1 with the least Σ u²: convex, with weak rows and no curvature but
/// that of u. Variables are x, v and u at N + 1, N + 1 and N instants.
fn double_integrator() -> Quadratic {
    let h = HORIZON / N as f64;
    let x = |k: usize| k as u32;
    let v = |k: usize| (N + 1 + k) as u32;
    let u = |k: usize| (2 * (N + 1) + k) as u32;
    let sum = |objective: Function, k| objective.product(u(k), u(k), 100.0);
    let objective = (0..N).fold(Function::default(), sum);
    let rows = (0..N).flat_map(|k| {
        let position = Function::default().linear(x(k + 1), 1.0).linear(x(k), -1.0);
        let speed = Function::default().linear(v(k + 1), 1.0).linear(v(k), -1.0);
        [
            (position.linear(v(k + 1), -h), 0.0, 0.0),
            (speed.linear(u(k), -h), 0.0, 0.0),
        ]
    });
    let problem = Quadratic::new(3 * N + 2, objective, rows.collect());
    let ends = [(x(0), 0.0), (v(0), 0.0), (x(N), 1.0), (v(N), 0.0)];
    let fixed =
        |problem: Quadratic, (i, value): (u32, f64)| problem.bound(i as usize, value, value);
    ends.into_iter().fold(problem, fixed)
}

/// The solution, and the largest correction on the way.
fn run(pairs_pivots: bool) -> (Solution, f64) {
    let options = Options {
        pairs_pivots,
        ..Options::default()
    };
    let mut largest = 0.0_f64;
    let mut observer = |progress: &Progress<'_>| {
        largest = largest.max(progress.regularization);
        ControlFlow::Continue(())
    };
    let solution = solve(&mut double_integrator(), &options, None, &mut observer);
    (solution, largest)
}

#[test]
fn pairs_of_pivots_leave_a_convex_program_uncorrected() {
    let (single, corrected) = run(false);
    assert!(single.has_lost_pivots && corrected > 1e-5, "{corrected}");
    let (paired, corrected) = run(true);
    assert_eq!(paired.status, Status::Solved);
    assert!(paired.has_lost_pivots && corrected <= 1e-8, "{corrected}");
    assert!(paired.iterations < single.iterations / 2, "{paired:?}");
    // The best u is a straight line, of about 6 / T² at its start.
    let u = &paired.w[2 * (N + 1)..];
    let size = 6.0 / (HORIZON * HORIZON);
    assert!((u[0] / size - 1.0).abs() < 0.05, "{}", u[0]);
    for three in u.windows(3) {
        let bend = three[0] - 2.0 * three[1] + three[2];
        assert!(bend.abs() < 1e-4 * size, "{three:?}");
    }
}
