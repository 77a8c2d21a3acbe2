//! Problems that lack something, have too much of it, or have no solution.

use super::program::{INF, Program};
use super::{log, run};
use crate::optimization::ipm::residuals::residuals;
use crate::optimization::ipm::{Failure, Options, Point, Solution, Status, solve};
use crate::optimization::problem::{Nlp, Structure};

fn expect(mut program: Program, status: Status) -> Solution {
    let solution = run(&mut program);
    let mut text = || {
        log(&mut program, &Options::default())
            .lines()
            .take(80)
            .collect::<Vec<_>>()
            .join("\n")
    };
    assert_eq!(
        solution.status,
        status,
        "{:?}\n{}",
        solution.residuals,
        text()
    );
    solution
}

fn assert_near(found: &[f64], exact: &[f64]) {
    assert_eq!(found.len(), exact.len());
    for (a, b) in found.iter().zip(exact) {
        assert!((a - b).abs() < 1e-6, "{found:?} instead of {exact:?}");
    }
}

#[test]
fn neither_rows_nor_bounds() {
    let program =
        Program::new(&[3.0, -4.0]).minimize(|x| (x[0] - 1.0).powi(2) + (x[1] - x[0]).powi(4));
    let solution = expect(program, Status::Solved);
    assert!((solution.w[0] - 1.0).abs() < 1e-6);
}

#[test]
fn no_objective() {
    let program = Program::new(&[1.0, 1.0])
        .row(2.0, |x| x[0] * x[1], 3.0)
        .row(-INF, |x| x[0] - x[1], 1.0);
    let solution = expect(program, Status::Solved);
    assert!(solution.residuals.primal < 1e-7);
}

#[test]
fn as_many_equations_as_variables() {
    let program = Program::new(&[2.0, 0.5])
        .equal(|x| x[0].powi(2) + x[1].powi(2) - 25.0)
        .equal(|x| x[0] * x[1] - 12.0);
    let solution = expect(program, Status::Solved);
    let sum = solution.w[0] + solution.w[1];
    assert!((sum.abs() - 7.0).abs() < 1e-7);
}

#[test]
fn no_variable_at_all() {
    expect(Program::new(&[]), Status::Solved);
}

#[test]
fn all_variables_fixed() {
    let program = Program::new(&[0.0, 5.0])
        .minimize(|x| x[0] * x[1])
        .equal(|x| x[0] + x[1] - 3.0)
        .bounds(0, 1.0, 1.0)
        .bounds(1, 2.0, 2.0);
    let solution = expect(program, Status::Solved);
    assert_eq!(solution.w, [1.0, 2.0]);
    let impossible = Program::new(&[0.0])
        .equal(|x| x[0] - 3.0)
        .bounds(0, 1.0, 1.0);
    expect(impossible, Status::LocallyInfeasible);
}

#[test]
fn fixed_variables_have_multipliers() {
    // min x² + y² + xy with x + y >= 3 and x = 2: y = 1; 2y + x + λ = 0, λ = -4, and z = 2x + y + λ = 1.
    let program = Program::new(&[0.0, 0.0])
        .minimize(|x| x[0].powi(2) + x[1].powi(2) + x[0] * x[1])
        .row(3.0, |x| x[0] + x[1], INF)
        .bounds(0, 2.0, 2.0);
    let solution = expect(program, Status::Solved);
    assert_near(&solution.w, &[2.0, 1.0]);
    assert_near(&solution.y, &[-4.0]);
    assert_near(&solution.z_l, &[1.0, 0.0]);
    assert_near(&solution.z_u, &[0.0, 0.0]);
}

#[test]
fn residuals_are_those_of_the_conditions_at_any_point() {
    // min x² + 3y with 1 <= x <= 4, y >= 1, 3 <= xy <= 8 and x + y <= 4, at (2, 3).
    let mut program = Program::new(&[2.0, 3.0])
        .minimize(|x| x[0].powi(2) + 3.0 * x[1])
        .row(3.0, |x| x[0] * x[1], 8.0)
        .row(-INF, |x| x[0] + x[1], 4.0)
        .bounds(0, 1.0, 4.0)
        .bounds(1, 1.0, INF);
    let (y, z_l, z_u) = ([-0.5, 0.25], [0.75, 0.5], [0.25, 0.0]);
    let found = residuals(&mut program, &[2.0, 3.0], &y, &z_l, &z_u);
    // 2x - 0.5 y + 0.25 - 0.75 + 0.25 = 2.25 is more than 3 - 0.5 x + 0.25 - 0.5, 0.5 (xy - 3) = 1.5 more than
    // other products, and x + y is 1 too much.
    let (primal, dual, complementarity) = (found.primal, found.dual, found.complementarity);
    assert_near(&[primal, dual, complementarity], &[1.0, 2.25, 1.5]);
}

#[test]
fn free_and_empty_rows() {
    let program = Program::new(&[4.0])
        .minimize(|x| (x[0] - 2.0).powi(2))
        .row(-INF, |x| x[0].exp(), INF)
        .row(-1.0, |x| 0.0 * x[0], 1.0)
        .row(0.0, |x| 0.0 * x[0], 0.0);
    let solution = expect(program, Status::Solved);
    assert_near(&solution.w, &[2.0]);
}

#[test]
fn rows_of_fixed_variables() {
    let square = |value: f64| {
        Program::new(&[2.0, 3.0])
            .minimize(|x| x[1].powi(2) + x[0] * x[1])
            .equal(move |x| x[0].powi(2) - value)
            .row(0.0, |x| x[0], INF)
            .bounds(0, 2.0, 2.0)
    };
    let solution = expect(square(4.0), Status::Solved);
    assert_near(&solution.w, &[2.0, -1.0]);
    assert_near(&solution.y, &[0.0, 0.0]);
    // ∂f/∂x₀ = x₁ is taken by the bounds.
    assert_near(&solution.z_u, &[1.0, 0.0]);
    expect(square(4.1), Status::LocallyInfeasible);
}

#[test]
fn rows_that_repeat_each_other() {
    let program = Program::new(&[1.0, 3.0])
        .minimize(|x| x[0].powi(2) + x[1].powi(2))
        .equal(|x| x[0] + x[1] - 2.0)
        .equal(|x| 2.0 * x[0] + 2.0 * x[1] - 4.0)
        .row(0.0, |x| x[0] - x[1], INF)
        .row(-INF, |x| x[0] - x[1], 0.0);
    let solution = expect(program, Status::Solved);
    assert_near(&solution.w, &[1.0, 1.0]);
}

#[test]
fn infeasible() {
    // x² + y² <= 1 and x + y >= 3.
    let program = Program::new(&[0.3, 0.2])
        .minimize(|x| x[0])
        .row(-INF, |x| x[0].powi(2) + x[1].powi(2), 1.0)
        .row(3.0, |x| x[0] + x[1], INF);
    let solution = expect(program, Status::LocallyInfeasible);
    assert!(solution.residuals.primal > 0.1);
    let program = Program::new(&[1.0])
        .minimize(|x| x[0])
        .equal(|x| x[0].powi(2) + 1.0);
    expect(program, Status::LocallyInfeasible);
    let program = Program::new(&[1.0])
        .minimize(|x| x[0].powi(2))
        .equal(|x| 0.0 * x[0] + 1.0);
    expect(program, Status::LocallyInfeasible);
    let program = Program::new(&[1.0]).bounds(0, 1.0, 0.0);
    expect(program, Status::LocallyInfeasible);
}

#[test]
fn unbounded() {
    expect(Program::new(&[1.0]).minimize(|x| x[0]), Status::Unbounded);
    let program = Program::new(&[1.0, 1.0])
        .minimize(|x| x[0] - x[1].powi(2))
        .row(0.0, |x| x[0] - x[1], INF);
    expect(program, Status::Unbounded);
}

#[test]
fn no_number_at_the_start() {
    let failure = Status::NumericalFailure(Failure::EvaluationAtStart);
    expect(Program::new(&[-1.0]).minimize(|x| x[0].ln()), failure);
    expect(Program::new(&[-1.0]).equal(|x| x[0].sqrt() - 1.0), failure);
}

#[test]
fn steps_keep_out_of_where_functions_are_no_numbers() {
    let program = Program::new(&[10.0]).minimize(|x| x[0] - x[0].ln());
    assert_near(&expect(program, Status::Solved).w, &[1.0]);
}

#[test]
fn no_constraint_qualification() {
    // Hock & Schittkowski 13: x = (1, 0) is no KKT point.
    let mut program = Program::new(&[-2.0, -2.0])
        .minimize(|x| (x[0] - 2.0).powi(2) + x[1].powi(2))
        .positive(|x| (1.0 - x[0]).powi(3) - x[1])
        .all_bounds(0.0, INF);
    let solution = run(&mut program);
    assert!(
        (solution.objective - 1.0).abs() < 2e-2,
        "{}",
        solution.objective
    );
    // min x with x² = 0.
    let program = Program::new(&[1.0])
        .minimize(|x| x[0])
        .equal(|x| x[0].powi(2));
    let mut program = program;
    let solution = run(&mut program);
    assert!(solution.w[0].abs() < 1e-3, "{solution:?}");
}

#[test]
fn where_line_search_methods_break_down() {
    // Wächter & Biegler 2000: min x_1 with x_1² - x_2 - 1 = 0, x_1 - x_3 - 1/2 = 0, x_2, x_3 >= 0.
    // From there (-1, 0, 0) has locally the least violation Σ|c|.
    let mut program = Program::new(&[-2.0, 3.0, 1.0])
        .minimize(|x| x[0])
        .equal(|x| x[0].powi(2) - x[1] - 1.0)
        .equal(|x| x[0] - x[2] - 0.5)
        .bounds(1, 0.0, INF)
        .bounds(2, 0.0, INF);
    let solution = run(&mut program);
    if solution.status == Status::Solved {
        assert_near(&solution.w, &[1.0, 0.0, 0.5]);
    } else {
        assert_eq!(solution.status, Status::LocallyInfeasible);
        assert_near(&solution.w, &[-1.0, 0.0, 0.0]);
    }
    program.start = vec![2.0, 3.0, 1.0];
    assert_near(&expect(program, Status::Solved).w, &[1.0, 0.0, 0.5]);
}

#[test]
fn a_warm_start_is_shorter() {
    let mut program = Program::new(&[1.0, 5.0, 5.0, 1.0])
        .minimize(|x| x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2])
        .positive(|x| x[0] * x[1] * x[2] * x[3] - 25.0)
        .equal(|x| x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) - 40.0)
        .all_bounds(1.0, 5.0);
    let cold = run(&mut program);
    let Solution { w, y, z_l, z_u, .. } = cold;
    let point = Point {
        w,
        y,
        z_l,
        z_u,
        mu: 1e-7,
    };
    let warm = solve(&mut program, &Options::default(), Some(&point), &mut ());
    assert_eq!(warm.status, Status::Solved);
    assert!(
        warm.iterations <= 3 && warm.iterations < cold.iterations,
        "{}",
        warm.iterations
    );
}

#[test]
fn a_run_may_stop_at_a_barrier_parameter() {
    // min x with x >= 0: x z = μ with z = 1.
    let mut program = Program::new(&[1.0]).minimize(|x| x[0]).bounds(0, 0.0, INF);
    let options = Options {
        mu_target: 1e-3,
        bound_relaxation: 0.0,
        ..Options::default()
    };
    let solution = solve(&mut program, &options, None, &mut ());
    assert_eq!(
        solution.status,
        Status::Solved,
        "{}",
        log(&mut program, &options)
    );
    assert!((solution.w[0] - 1e-3).abs() < 1e-7);
}

/// min x + y with x y >= μ, x - y = k: its bound follows the barrier parameter.
struct Following {
    program: Program,
    calls: usize,
    fixes: bool,
}

impl Nlp for Following {
    fn structure(&self) -> Structure<'_> {
        self.program.structure()
    }

    fn objective(&mut self, w: &[f64]) -> f64 {
        self.program.objective(w)
    }
    fn gradient(&mut self, w: &[f64], gradient: &mut [f64]) {
        self.program.gradient(w, gradient);
    }
    fn rows(&mut self, w: &[f64], rows: &mut [f64]) {
        self.program.rows(w, rows);
    }
    fn jacobian(&mut self, w: &[f64], entries: &mut [f64]) {
        self.program.jacobian(w, entries);
    }
    fn hessian(&mut self, w: &[f64], factor: f64, y: &[f64], entries: &mut [f64]) {
        self.program.hessian(w, factor, y, entries);
    }
    fn follow(&mut self, mu: f64) -> bool {
        self.calls += 1;
        self.program.row_upper[0] = mu;
        if self.fixes && mu < 1e-3 {
            (self.program.lower[2], self.program.upper[2]) = (0.5, 0.5);
        }
        true
    }
}

#[test]
fn bounds_may_follow_the_barrier_parameter() {
    // min (x - 1)² + (y - 2)² with x y <= μ, x, y >= 0: (0, 2) in the limit; z is free or fixed to 1/2 on the way.
    for fixes in [false, true] {
        let program = Program::new(&[1.0, 1.0, 0.0])
            .minimize(|x| (x[0] - 1.0).powi(2) + (x[1] - 2.0).powi(2) + (x[2] - 1.0).powi(2))
            .row(-INF, |x| x[0] * x[1], 1.0)
            .bounds(0, 0.0, INF)
            .bounds(1, 0.0, INF);
        let mut following = Following {
            program,
            calls: 0,
            fixes,
        };
        let solution = run(&mut following);
        assert_eq!(solution.status, Status::Solved);
        assert_near(&solution.w, &[0.0, 2.0, if fixes { 0.5 } else { 1.0 }]);
        assert!(following.calls > 5);
    }
}

#[test]
fn limits_end_a_run() {
    let rosenbrock = || {
        Program::new(&[-1.2, 1.0])
            .minimize(|x| 100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2))
    };
    let few = Options {
        max_iterations: 3,
        ..Options::default()
    };
    let solution = solve(&mut rosenbrock(), &few, None, &mut ());
    assert_eq!(
        (solution.status, solution.iterations),
        (Status::IterationLimit, 3)
    );
    let short = Options {
        limit: crate::runtime::limit::Limit::within(std::time::Duration::ZERO),
        ..Options::default()
    };
    let solution = solve(&mut rosenbrock(), &short, None, &mut ());
    assert_eq!(
        solution.status,
        Status::Over(crate::runtime::limit::Over::TimeLimit)
    );
    let mut stop = |progress: &crate::optimization::ipm::Progress<'_>| {
        if progress.iteration == 2 {
            std::ops::ControlFlow::Break(())
        } else {
            std::ops::ControlFlow::Continue(())
        }
    };
    let solution = solve(&mut rosenbrock(), &Options::default(), None, &mut stop);
    assert_eq!((solution.status, solution.iterations), (Status::Stopped, 2));
}
