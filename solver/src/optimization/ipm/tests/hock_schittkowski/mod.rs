//! Problems with published optima.
//!
//! Hock & Schittkowski 1981, *Test Examples for Nonlinear Programming Codes*, Springer; numbers and optima are theirs.

use super::log;
mod bounds;
mod equations;

use super::program::{INF, Program};
use crate::optimization::ipm::{BarrierRule, Options, Status, solve};

/// The optimum is reached within `tolerance` of its size.
pub fn check(program: Program, optimum: f64) {
    check_one_of(program, &[optimum]);
}

/// One of several local optima is, by either rule for μ.
pub fn check_one_of(mut program: Program, optima: &[f64]) {
    for barrier in [BarrierRule::Monotone, BarrierRule::Adaptive] {
        let options = Options {
            barrier,
            ..Options::default()
        };
        let solution = solve(&mut program, &options, None, &mut ());
        let error = |f: &f64| (solution.objective - f).abs() / f.abs().max(1.0);
        let error = optima.iter().map(error).fold(INF, f64::min);
        let residuals = solution.residuals;
        let is_solved = solution.status == Status::Solved && error < 1e-6;
        assert!(
            is_solved && residuals.primal < 1e-6 && residuals.complementarity < 1e-5,
            "{barrier:?} {:?} with {} instead of {optima:?}, {residuals:?}\n{}",
            solution.status,
            solution.objective,
            log(&mut program, &options),
        );
    }
}
