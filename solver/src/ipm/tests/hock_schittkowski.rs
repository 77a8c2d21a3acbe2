//! Problems with published optima.
//!
//! Hock & Schittkowski 1981, *Test Examples for Nonlinear Programming Codes*, Springer; numbers and optima are theirs.

use super::program::{INF, Program};
use super::{Options, log, run};
use crate::ipm::Status;

/// The optimum is reached within `tolerance` of its size.
fn check(program: Program, optimum: f64) {
    check_one_of(program, &[optimum]);
}

/// There are several local optima.
fn check_one_of(mut program: Program, optima: &[f64]) {
    let solution = run(&mut program);
    let error = |f: &f64| (solution.objective - f).abs() / f.abs().max(1.0);
    let error = optima.iter().map(error).fold(INF, f64::min);
    let residuals = solution.residuals;
    let is_solved = solution.status == Status::Solved && error < 1e-6;
    assert!(
        is_solved && residuals.primal < 1e-6 && residuals.complementarity < 1e-6,
        "{:?} with {} instead of {optima:?}, {residuals:?}\n{}",
        solution.status,
        solution.objective,
        log(&mut program, &Options::default())
            .lines()
            .take(100)
            .collect::<Vec<_>>()
            .join("\n"),
    );
}

#[test]
fn hs1() {
    let program = Program::new(&[-2.0, 1.0])
        .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
        .bounds(1, -1.5, INF);
    check(program, 0.0);
}

#[test]
fn hs6() {
    let program = Program::new(&[-1.2, 1.0])
        .minimize(|x| (1.0 - x[0]).powi(2))
        .equal(|x| 10.0 * (x[1] - x[0].powi(2)));
    check(program, 0.0);
}

#[test]
fn hs7() {
    let program = Program::new(&[2.0, 2.0])
        .minimize(|x| (1.0 + x[0].powi(2)).ln() - x[1])
        .equal(|x| (1.0 + x[0].powi(2)).powi(2) + x[1].powi(2) - 4.0);
    check(program, -(3.0_f64.sqrt()));
}

#[test]
fn hs9() {
    use std::f64::consts::PI;
    let program = Program::new(&[0.0, 0.0])
        .minimize(|x| (PI / 12.0 * x[0]).sin() * (PI / 16.0 * x[1]).cos())
        .equal(|x| 4.0 * x[0] - 3.0 * x[1]);
    check(program, -0.5);
}

#[test]
fn hs10() {
    let program = Program::new(&[-10.0, 10.0])
        .minimize(|x| x[0] - x[1])
        .positive(|x| -3.0 * x[0].powi(2) + 2.0 * x[0] * x[1] - x[1].powi(2) + 1.0);
    check(program, -1.0);
}

#[test]
fn hs11() {
    let program = Program::new(&[4.9, 0.1])
        .minimize(|x| (x[0] - 5.0).powi(2) + x[1].powi(2) - 25.0)
        .positive(|x| -(x[0].powi(2)) + x[1]);
    check(program, -8.498464223);
}

#[test]
fn hs12() {
    let program = Program::new(&[0.0, 0.0])
        .minimize(|x| 0.5 * x[0].powi(2) + x[1].powi(2) - x[0] * x[1] - 7.0 * x[0] - 7.0 * x[1])
        .positive(|x| 25.0 - 4.0 * x[0].powi(2) - x[1].powi(2));
    check(program, -30.0);
}

#[test]
fn hs14() {
    let program = Program::new(&[2.0, 2.0])
        .minimize(|x| (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2))
        .equal(|x| x[0] - 2.0 * x[1] + 1.0)
        .positive(|x| -0.25 * x[0].powi(2) - x[1].powi(2) + 1.0);
    check(program, 9.0 - 2.875 * 7.0_f64.sqrt());
}

#[test]
fn hs15() {
    let program = Program::new(&[-2.0, 1.0])
        .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
        .positive(|x| x[0] * x[1] - 1.0)
        .positive(|x| x[0] + x[1].powi(2))
        .bounds(0, -INF, 0.5);
    check(program, 306.5);
}

#[test]
fn hs16() {
    let program = Program::new(&[-2.0, 1.0])
        .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
        .positive(|x| x[0] + x[1].powi(2))
        .positive(|x| x[0].powi(2) + x[1])
        .bounds(0, -0.5, 0.5)
        .bounds(1, -INF, 1.0);
    // (1/2, 1/4), and a local minimum on x_1 = -x_2².
    check_one_of(program, &[0.25, 23.144_660_9]);
}

#[test]
fn hs21() {
    let program = Program::new(&[-1.0, -1.0])
        .minimize(|x| 0.01 * x[0].powi(2) + x[1].powi(2) - 100.0)
        .positive(|x| 10.0 * x[0] - x[1] - 10.0)
        .bounds(0, 2.0, 50.0)
        .bounds(1, -50.0, 50.0);
    check(program, -99.96);
}

#[test]
fn hs24() {
    let root = 3.0_f64.sqrt();
    let program = Program::new(&[1.0, 0.5])
        .minimize(move |x| ((x[0] - 3.0).powi(2) - 9.0) * x[1].powi(3) / (27.0 * root))
        .positive(move |x| x[0] / root - x[1])
        .positive(move |x| x[0] + root * x[1])
        .positive(move |x| 6.0 - x[0] - root * x[1])
        .all_bounds(0.0, INF);
    check(program, -1.0);
}

#[test]
fn hs35() {
    let program = Program::new(&[0.5, 0.5, 0.5])
        .minimize(|x| {
            9.0 - 8.0 * x[0] - 6.0 * x[1] - 4.0 * x[2]
                + 2.0 * x[0].powi(2)
                + 2.0 * x[1].powi(2)
                + x[2].powi(2)
                + 2.0 * x[0] * x[1]
                + 2.0 * x[0] * x[2]
        })
        .positive(|x| 3.0 - x[0] - x[1] - 2.0 * x[2])
        .all_bounds(0.0, INF);
    check(program, 1.0 / 9.0);
}

#[test]
fn hs71() {
    let program = Program::new(&[1.0, 5.0, 5.0, 1.0])
        .minimize(|x| x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2])
        .positive(|x| x[0] * x[1] * x[2] * x[3] - 25.0)
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) - 40.0)
        .all_bounds(1.0, 5.0);
    check(program, 17.0140173);
}
