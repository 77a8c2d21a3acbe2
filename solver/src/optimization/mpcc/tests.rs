//! Whole runs on problems with known solutions.

use nalgebra::DMatrix;
use proptest::prelude::*;

use super::branch::polish::{Guess, Polished};
use super::certificate::{Certificate, Residuals};
use super::{
    Candidate, Class, Form, Homotopy, Observer, Options, Program, Relaxation, Solution, Status,
    Steering, Trust, alternatives, solve, solve_observed,
};
use crate::optimization::ipm::Progress;
use crate::optimization::problem::Side;
use crate::optimization::quadratic::{Function, Quadratic};
use crate::runtime::limit::{Cancel, Limit};

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

/// x² + y² + w₁ = 1 twice, in the branch w₁ = 0 of a pair: the rows depend on each other, and from a point near the circle
/// the nearest one on it is in the same direction.
#[test]
fn a_branch_without_objective_is_met_at_the_nearest_point() {
    let circle = |factor: f64| {
        let row = Function::default()
            .product(2, 2, factor)
            .product(3, 3, factor)
            .linear(1, factor);
        (row, factor, factor)
    };
    let problem = Quadratic::new(4, Function::default(), vec![circle(1.0), circle(2.0)]);
    let mut problem = pair(problem).start(&[0.7, 1e-9, 0.62, 0.81]);
    let options = Options {
        trust: Trust::First,
        effort: 0,
        ..Options::default()
    };
    let solution = solve(&mut problem, &options);
    let length = 0.62_f64.hypot(0.81);
    check_at(&solution, &[0.7, 0.0, 0.62 / length, 0.81 / length], 1e-5);
    assert!(solution.residuals.violation <= 8.0 * f64::EPSILON);
    assert_eq!((solution.class, solution.stats.relaxed), (Class::S, 0));
    assert!(solution.stats.iterations <= 6, "{solution:?}");
}

/// The circle x² + y² = 1 with x >= 2 is not met from anywhere.
#[test]
fn rows_without_a_point_are_not_met() {
    let circle = Function::default().product(2, 2, 1.0).product(3, 3, 1.0);
    let problem = Quadratic::new(4, Function::default(), vec![(circle, 1.0, 1.0)]);
    let mut problem = pair(problem)
        .bound(2, 2.0, INFINITY)
        .start(&[0.7, 0.0, 2.0, 0.5]);
    let options = Options {
        trust: Trust::First,
        effort: 0,
        max_restarts: 0,
        ..Options::default()
    };
    let solution = solve(&mut problem, &options);
    assert!(!solution.is_feasible(), "{solution:?}");
}

fn linear(coefficients: &[f64]) -> Function {
    let terms = (0..).zip(coefficients);
    terms.fold(Function::default(), |f, (j, &c)| f.linear(j, c))
}

fn check_at(solution: &Solution, w: &[f64], tolerance: f64) {
    assert_eq!(solution.status, Status::Solved, "{solution:?}");
    for (found, expected) in solution.w.iter().zip(w) {
        assert!((found - expected).abs() < tolerance, "{solution:?}");
    }
    assert_eq!(solution.residuals.product, 0.0);
}

#[test]
fn every_relaxation_and_steering_finds_the_only_minimum() {
    // (x - 1)² + y²: the origin is C-stationary and not a minimum.
    for relaxation in Relaxation::ALL {
        for steering in [Steering::Direct, Steering::L1, Steering::LInfinity] {
            let homotopies = [
                Options::default().homotopy,
                Homotopy::Sequential {
                    start: 1.0,
                    factor: 0.1,
                    stop: 1e-8,
                },
            ];
            for homotopy in homotopies {
                let mut problem = pair(Quadratic::new(2, distance(&[1.0, 0.0]), Vec::new()));
                let form = Form {
                    relaxation,
                    steering,
                    is_equation: false,
                    keeps_curvature: false,
                };
                let options = Options {
                    form,
                    homotopy,
                    max_restarts: 0,
                    ..Options::default()
                };
                check_at(&solve(&mut problem, &options), &[1.0, 0.0], 1e-8);
            }
        }
    }
}

#[test]
fn curves_may_be_equations() {
    for relaxation in Relaxation::ALL.into_iter().filter(|r| r.is_curve()) {
        let mut problem = pair(Quadratic::new(2, distance(&[1.0, 0.0]), Vec::new()));
        let options = Options {
            form: Form {
                relaxation,
                is_equation: true,
                ..Form::default()
            },
            ..Options::default()
        };
        check_at(&solve(&mut problem, &options), &[1.0, 0.0], 1e-8);
    }
}

#[test]
fn an_optimum_that_is_not_strongly_stationary() {
    // minimize x + y - z, z <= 4x, z <= 4y (scholtes4 of MacMPEC): the origin is M-stationary.
    let rows = vec![
        (linear(&[4.0, 0.0, -1.0]), 0.0, INFINITY),
        (linear(&[0.0, 4.0, -1.0]), 0.0, INFINITY),
    ];
    let solution = run(pair(Quadratic::new(3, linear(&[1.0, 1.0, -1.0]), rows)));
    check_at(&solution, &[0.0; 3], 1e-8);
    assert_eq!(solution.class, Class::M);
    assert_eq!(solution.b_stationary, Some(true));
    assert_eq!(solution.biactive, [0]);
}

#[test]
fn sides_that_are_rows_have_the_multipliers_of_their_rows() {
    // minimize 2x - y, 0 <= y ⟂ y - x >= 0 (ralph1 of MacMPEC), with x >= 0 and x >= ½.
    let rows = vec![(linear(&[-1.0, 1.0]), 0.0, INFINITY)];
    let problem = Quadratic::new(2, linear(&[2.0, -1.0]), rows)
        .bound(0, 0.0, INFINITY)
        .bound(1, 0.0, INFINITY)
        .complement(Side::Variable(1), Side::Row(0));
    let solution = run(problem.clone());
    check_at(&solution, &[0.0, 0.0], 1e-8);
    let away = run(problem.bound(0, 0.5, INFINITY));
    // y = 0 would have y - x < 0.
    check_at(&away, &[0.5, 0.5], 1e-8);
    let [nu_y, nu_row] = away.multipliers.pairs[0];
    // ∂(f + η (y - x))/∂y = η - 1 = 0, and ν = -η; the bound of x has 2 - η.
    assert!(nu_y.abs() < 1e-8 && (nu_row + 1.0).abs() < 1e-8, "{away:?}");
    assert!((away.multipliers.rows[0] - 1.0).abs() < 1e-8);
    assert!((away.multipliers.lower[0] - 1.0).abs() < 1e-8);
}

#[test]
fn what_cannot_be_met_is_locally_infeasible() {
    let problem = Quadratic::new(
        2,
        distance(&[0.0, 0.0]),
        vec![
            (linear(&[1.0]), 1.0, INFINITY),
            (linear(&[0.0, 1.0]), 1.0, INFINITY),
        ],
    );
    let solution = run(pair(problem));
    assert_eq!(solution.status, Status::LocallyInfeasible, "{solution:?}");
    assert_eq!(solution.class, Class::None);
    assert!(
        solution
            .residuals
            .complementarity
            .max(solution.residuals.violation)
            > 0.1
    );
}

#[test]
fn what_falls_forever_is_unbounded() {
    let solution = run(pair(Quadratic::new(2, linear(&[-1.0, 1.0]), Vec::new())));
    assert_eq!(solution.status, Status::Unbounded, "{solution:?}");
}

#[test]
fn fixed_variables_empty_rows_and_free_rows() {
    let rows = || {
        vec![
            (Function::default(), -1.0, 1.0),
            (linear(&[1.0, 1.0]), -INFINITY, INFINITY),
        ]
    };
    let of = |value: f64| {
        let problem = pair(Quadratic::new(2, distance(&[1.0, 2.0]), rows()));
        run(problem.bound(0, value.min(0.0), value))
    };
    check_at(&of(0.0), &[0.0, 2.0], 1e-8);
    // x = 2 above its bound 0 needs y = 0.
    let mut rows = rows();
    rows.push((linear(&[1.0]), 2.0, 2.0));
    let problem = pair(Quadratic::new(2, distance(&[1.0, 2.0]), rows));
    check_at(&run(problem), &[2.0, 0.0], 1e-8);
}

#[test]
fn no_objective() {
    let rows = vec![(linear(&[1.0, 2.0]), 2.0, 2.0)];
    let solution = run(pair(Quadratic::new(2, Function::default(), rows)));
    assert_eq!(solution.status, Status::Solved, "{solution:?}");
    let w = &solution.w;
    assert!((w[0] + 2.0 * w[1] - 2.0).abs() < 1e-9 && w[0].min(w[1]) == 0.0);
}

#[test]
fn a_start_that_is_no_number() {
    // A variable without bounds has no other place to start from.
    let problem = pair(Quadratic::new(3, distance(&[1.0, 0.0, 0.0]), Vec::new()));
    let solution = run(problem.start(&[0.0, 0.0, f64::NAN]));
    assert_eq!(solution.status, Status::Evaluation, "{solution:?}");
    assert_eq!(solution.class, Class::None);
}

#[test]
fn a_program_without_pairs() {
    // The nearest point of x + y = 1 to (1, 1).
    let rows = vec![(linear(&[1.0, 1.0]), 1.0, 1.0)];
    let solution = run(Quadratic::new(2, distance(&[1.0, 1.0]), rows));
    check_at(&solution, &[0.5, 0.5], 1e-6);
    assert!((solution.multipliers.rows[0] - 1.0).abs() < 1e-6);
}

#[test]
fn no_constraint_qualification() {
    // minimize (x - 1)² + (y + 1)², y² <= 0, 0 <= x ⟂ y >= 0: (1, 0), where the gradient of the row vanishes.
    let rows = vec![(Function::default().product(1, 1, 1.0), -INFINITY, 0.0)];
    let solution = run(pair(Quadratic::new(2, distance(&[1.0, -1.0]), rows)));
    check_at(&solution, &[1.0, 0.0], 1e-8);
    assert_eq!(solution.class, Class::S);
}

#[test]
fn sums_are_held_with_their_terms() {
    // (x + y) ⟂ z as a row: minimize (x + 1)² + (y - 1)² + (z - 3)²; the branch x = y = 0 has the value 2 at z = 3,
    // that of z = 0 has 10.
    let rows = vec![(linear(&[1.0, 1.0]), 0.0, INFINITY)];
    let mut problem = Quadratic::new(3, distance(&[-1.0, 1.0, 3.0]), rows);
    for j in 0..3 {
        problem = problem.bound(j, 0.0, INFINITY);
    }
    let solution = run(problem.complement(Side::Row(0), Side::Variable(2)));
    check_at(&solution, &[0.0, 0.0, 3.0], 1e-8);
    assert_eq!(solution.w[..2], [0.0, 0.0]);
    assert_eq!(solution.class, Class::S);
}

#[test]
fn a_time_limit_of_nothing_ends_at_once() {
    let mut problem = pair(Quadratic::new(2, distance(&[1.0, 0.0]), Vec::new()));
    let options = Options {
        limit: Limit::within(std::time::Duration::ZERO),
        ..Options::default()
    };
    let solution = solve(&mut problem, &options);
    assert!(
        !solution.is_feasible() || solution.stats.restarts == 0,
        "{solution:?}"
    );
}

/// What was seen: σ of the relaxations, and how many iterations of branches.
#[derive(Default)]
struct Seen {
    programs: Vec<Program>,
    sigmas: Vec<f64>,
    in_branches: usize,
}

impl Observer for Seen {
    fn program(&mut self, program: &Program) {
        self.programs.push(*program);
    }

    fn iteration(&mut self, program: &Program, progress: &Progress<'_>) {
        match program.sigma(progress.mu) {
            Some(sigma) => self.sigmas.push(sigma),
            None => self.in_branches += 1,
        }
    }
}

#[test]
fn an_observer_sees_every_program_and_iteration() {
    let mut problem = pair(Quadratic::new(2, distance(&[1.0, 2.0]), Vec::new()));
    let mut seen = Seen::default();
    let options = Options {
        max_restarts: 0,
        ..Options::default()
    };
    let solution = solve_observed(&mut problem, &[1.0, 1.0], &options, &mut seen);
    let alone = super::solve_from(&mut problem, &[1.0, 1.0], &options);
    assert_eq!(solution.w, alone.w);
    assert!(matches!(seen.programs[0], Program::Relaxed { .. }));
    assert!(seen.programs.contains(&Program::Branch));
    assert!(seen.sigmas.windows(2).all(|pair| pair[1] <= pair[0]));
    assert!(seen.sigmas.last() < seen.sigmas.first());
    // Every program shows its start, too.
    assert!(
        seen.sigmas.len() + seen.in_branches >= solution.stats.iterations + seen.programs.len()
    );
}

#[test]
fn effort_is_for_other_minima_and_patience_for_stationary_points() {
    let mut problem = pair(Quadratic::new(2, distance(&[1.0, -1.0]), Vec::new()));
    for (effort, restarts) in [(0, 0), (usize::MAX, Options::default().max_restarts)] {
        let options = Options {
            effort,
            patience: 0,
            ..Options::default()
        };
        let solution = solve(&mut problem, &options);
        check_at(&solution, &[1.0, 0.0], 1e-9);
        assert_eq!(solution.stats.restarts, restarts);
    }
}

/// A maximum in the middle of its bounds: nothing that is symmetric leaves it.
#[test]
fn a_maximum_is_left() {
    let hill = Function::default().product(0, 0, -1.0);
    let solution = run(Quadratic::new(1, hill, Vec::new()).bound(0, -2.0, 2.0));
    assert_eq!(solution.status, Status::Solved, "{solution:?}");
    assert!((solution.w[0].abs() - 2.0).abs() < 1e-8, "{solution:?}");
}

#[test]
fn a_saddle_is_left_in_its_branch() {
    // a + b - z² with 0 <= a ⟂ b >= 0, z in [-2, 2].
    let objective = linear(&[1.0, 1.0]).product(2, 2, -1.0);
    let solution = run(pair(
        Quadratic::new(3, objective, Vec::new()).bound(2, -2.0, 2.0),
    ));
    assert_eq!(solution.status, Status::Solved, "{solution:?}");
    assert!((solution.objective + 4.0).abs() < 1e-7, "{solution:?}");
}

proptest! {
    #[test]
    fn quadratic_forms_end_where_they_are_convex(
        n in 2_usize..6,
        has_row: bool,
        entries in prop::collection::vec(-1.0..1.0_f64, 15),
    ) {
        // wᵀ H w over a cube, or where Σ w = 0 in it, from its middle.
        let mut h = DMatrix::zeros(n, n);
        let mut form = Function::default();
        let pairs = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
        for ((i, j), &entry) in pairs.zip(&entries) {
            (h[(i, j)], h[(j, i)]) = (entry, entry);
            let factor = if i == j { entry } else { 2.0 * entry };
            form = form.product(i as u32, j as u32, factor);
        }
        let row = has_row.then(|| (linear(&vec![1.0; n]), 0.0, 0.0));
        let problem = Quadratic::new(n, form, row.into_iter().collect());
        let solution = run((0..n).fold(problem, |problem, i| problem.bound(i, -1.0, 1.0)));
        prop_assert_eq!(solution.status, Status::Solved);
        let free: Vec<usize> = (0..n).filter(|&i| solution.w[i].abs() < 1.0 - 1e-6).collect();
        if free.is_empty() {
            return Ok(());
        }
        let k = free.len();
        let along = match has_row {
            true => DMatrix::identity(k, k) - DMatrix::from_element(k, k, 1.0 / k as f64),
            false => DMatrix::identity(k, k),
        };
        let face = &along * h.select_rows(&free).select_columns(&free) * &along;
        let least = face.symmetric_eigenvalues().min();
        prop_assert!(least > -1e-6, "{} at {:?}", least, solution.w);
    }
}

#[test]
fn multipliers_that_are_the_only_ones_are_told_from_others() {
    // minimize (x - 2)² + (y + 1)²   subject to   x <= 1 twice, y >= 0: they share 2, and y has 2.
    let objective = Function::default()
        .product(0, 0, 1.0)
        .product(1, 1, 1.0)
        .linear(0, -4.0)
        .linear(1, 2.0);
    let row = || (Function::default().linear(0, 1.0), -INFINITY, 1.0);
    for (rows, is_unique) in [(vec![row()], true), (vec![row(), row()], false)] {
        let mut problem = Quadratic::new(2, objective.clone(), rows).bound(1, 0.0, INFINITY);
        let options = Options::default();
        let solution = solve(&mut problem, &options);
        let others = alternatives(&mut problem, &solution, &options).unwrap();
        for other in others {
            let differs = (other.rows[0] - solution.multipliers.rows[0]).abs();
            assert_eq!(differs < 1e-8, is_unique, "{differs}");
            assert!((other.rows.iter().sum::<f64>() - 2.0).abs() < 1e-7);
            assert!((other.lower[1] - 2.0).abs() < 1e-7);
        }
    }
}

/// Cancels at the first stationary point.
struct CancelsWhereStationary(Cancel);

impl Observer for CancelsWhereStationary {
    fn stationary(&mut self, _: f64, _: Class) {
        self.0.cancel();
    }
}

/// (x - 3)² + (y + 1)² from 0, where it falls with x. That this was found is known when the run is canceled there.
#[test]
fn what_descends_does_so_when_canceled() {
    let mut problem = pair(Quadratic::new(2, distance(&[3.0, -1.0]), Vec::new()));
    let cancel = Cancel::default();
    let options = Options {
        limit: Limit::default().canceled_by(&cancel),
        trust: Trust::First,
        ..Options::default()
    };
    let ended = solve_observed(
        &mut problem,
        &[0.0; 2],
        &options,
        &mut CancelsWhereStationary(cancel),
    );
    assert!(ended.w.iter().all(|w| w.abs() < 1e-9), "{ended:?}");
    assert_eq!(ended.status, Status::Feasible, "{ended:?}");
    assert_eq!(ended.b_stationary, Some(false), "{ended:?}");
}

/// What is reached of an objective in a class, with descent where that is known.
fn candidate(
    objective: f64,
    class: Class,
    descent: Option<f64>,
    b_stationary: Option<bool>,
) -> Candidate {
    let (point, residuals) = (
        Guess {
            w: Vec::new(),
            y: Vec::new(),
        },
        Residuals::default(),
    );
    Candidate {
        best: Polished {
            point,
            objective,
            zeros: Vec::new(),
            residuals,
            is_optimal: true,
            falling: None,
        },
        certificate: Certificate {
            class,
            is_exact: true,
            b_stationary,
            is_differentiable: true,
            biactive: Vec::new(),
            y: Vec::new(),
            reduced: Vec::new(),
            descent: descent.map(|d| vec![d]),
        },
        others: 0,
    }
}

/// A solution does not hide a lower point from which descent is known, and no search that met its limit hides that it is.
#[test]
fn what_is_lower_is_preferred() {
    let solved = |objective| candidate(objective, Class::S, None, Some(true));
    let weak = |objective| candidate(objective, Class::M, Some(1.0), Some(false));
    let open = |objective| candidate(objective, Class::M, None, None);
    assert!(weak(1.0).is_better(&solved(5.0)) && !solved(5.0).is_better(&weak(1.0)));
    assert!(solved(1.0).is_better(&weak(5.0)) && !weak(5.0).is_better(&solved(1.0)));
    assert!(!open(1.0 - 1e-12).is_better(&weak(1.0)) && open(0.9).is_better(&weak(1.0)));
    assert_eq!(
        [weak(1.0).status(), open(1.0).status()],
        [Status::Feasible, Status::Solved]
    );
    // What is not stationary is not preferred, however low it is.
    let nothing = candidate(-9.0, Class::None, None, None);
    assert!(solved(5.0).is_better(&nothing) && !nothing.is_better(&weak(5.0)));
}
