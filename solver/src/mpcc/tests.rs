//! Whole runs on problems with known solutions.

use super::{Class, Options, Solution, Status, solve};
use crate::problem::Side;
use crate::quadratic::{Function, Quadratic};

const INFINITY: f64 = f64::INFINITY;

/// Σ (w_j - target_j)².
fn distance(target: &[f64]) -> Function {
    let terms = (0..).zip(target);
    terms.fold(Function::default(), |f, (j, &t)| {
        f.product(j, j, 1.0).linear(j, -2.0 * t).constant(t * t)
    })
}

/// A pair of the variables 0 and 1, which are not negative.
fn pair(problem: Quadratic) -> Quadratic {
    problem
        .bound(0, 0.0, INFINITY)
        .bound(1, 0.0, INFINITY)
        .complement(Side::Variable(0), Side::Variable(1))
}

fn run(mut problem: Quadratic) -> Solution {
    solve(&mut problem, &Options::default())
}

#[test]
fn the_nearest_point_of_two_half_axes() {
    let solution = run(pair(Quadratic::new(2, distance(&[1.0, 2.0]), Vec::new())));
    assert_eq!(solution.status, Status::Solved, "{solution:?}");
    assert_eq!(solution.class, Class::S);
    assert_eq!(solution.b_stationary, Some(true));
    assert_eq!(solution.residuals.product, 0.0);
    let at = |w: [f64; 2]| {
        (solution.w[0] - w[0])
            .abs()
            .max((solution.w[1] - w[1]).abs())
            < 1e-9
    };
    assert!(at([0.0, 2.0]) || at([1.0, 0.0]), "{solution:?}");
}
