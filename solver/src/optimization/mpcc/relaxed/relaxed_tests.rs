//! Relaxations: their curves, limits and derivatives.

use proptest::prelude::*;

use super::dual::Dual;
use crate::optimization::mpcc::{Coupling, Form, Lifted, Relaxation, Relaxed, Steering};
use crate::optimization::problem::{Nlp, Pattern, Side};
use crate::optimization::quadratic::{Function, Quadratic};

/// Φ of every row.
fn values(relaxation: Relaxation, a: f64, b: f64, sigma: f64) -> Vec<f64> {
    let [a, b, sigma] = [a, b, sigma].map(Dual::constant);
    let rows = 0..relaxation.n_rows();
    rows.map(|row| relaxation.row(row, a, b, sigma).value)
        .collect()
}

fn admits(relaxation: Relaxation, a: f64, b: f64, sigma: f64) -> bool {
    let excess = relaxation.excess(sigma);
    let slack = 1e-12;
    a.min(b) >= -excess
        && values(relaxation, a, b, sigma)
            .iter()
            .all(|phi| *phi <= slack)
}

/// Four variables, a row with an upper bound, and pairs: two variables, a variable and a row, a row that is in two.
fn problem() -> Quadratic {
    let infinity = f64::INFINITY;
    let objective = Function::default()
        .product(0, 1, 0.5)
        .product(2, 2, 1.0)
        .linear(3, -1.0);
    let rows = vec![
        (
            Function::default().linear(0, 1.0).product(3, 1, 2.0),
            -1.0,
            infinity,
        ),
        (
            Function::default().linear(2, 1.0).linear(3, 1.0),
            -infinity,
            4.0,
        ),
        (
            Function::default().product(2, 0, 1.0).constant(0.5),
            0.25,
            infinity,
        ),
    ];
    let mut problem = Quadratic::new(4, objective, rows)
        .start(&[0.5, 0.25, 2.0, 1.0])
        .complement(Side::Variable(0), Side::Variable(3))
        .complement(Side::Row(2), Side::Variable(1))
        .complement(Side::Row(2), Side::Row(0));
    for (j, lower) in [-0.5, 0.0, -1.0, 0.25].into_iter().enumerate() {
        problem = problem.bound(j, lower, infinity);
    }
    problem
}

#[test]
fn a_row_that_is_a_side_becomes_a_variable() {
    let mut problem = problem();
    let mut lifted = Lifted::new(&mut problem);
    assert_eq!(lifted.pairs(), [[0, 3], [5, 1], [5, 4]]);
    // c0 = 0.5 + 2·1·0.25 = 1 is two above its bound, c2 = 2·0.5 + 0.5 = 1.5 one and a quarter.
    assert_eq!(lifted.start(), [0.5, 0.25, 2.0, 1.0, 2.0, 1.25]);
    let mut rows = [0.0; 3];
    let start = lifted.start().to_vec();
    lifted.rows(&start, &mut rows);
    assert_eq!(rows, [-1.0, 3.0, 0.25]);
    assert_eq!(lifted.row_bounds().upper, [-1.0, 4.0, 0.25]);
}

/// Compares Jacobian and Hessian with central differences of rows and of the gradient of the Lagrangian.
fn check_derivatives(nlp: &mut dyn Nlp, w: &[f64]) {
    let (n, m) = (nlp.n_variables(), nlp.n_rows());
    let y: Vec<f64> = (0..m).map(|row| 0.5 + 0.25 * row as f64).collect();
    let factor = 1.5;
    let dense = |pattern: &Pattern, entries: &[f64], n_columns: usize| -> Vec<Vec<f64>> {
        let mut matrix = vec![vec![0.0; n_columns]; pattern.n_rows()];
        for (row, line) in matrix.iter_mut().enumerate() {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, value) in pattern.row(row).iter().zip(&entries[places]) {
                line[column as usize] = *value;
            }
        }
        matrix
    };
    let jacobian_at = |nlp: &mut dyn Nlp, w: &[f64]| {
        let mut entries = vec![f64::NAN; nlp.jacobian_pattern().n_entries()];
        nlp.jacobian(w, &mut entries);
        dense(nlp.jacobian_pattern(), &entries, n)
    };
    let lagrangian_gradient = |nlp: &mut dyn Nlp, w: &[f64]| {
        let mut gradient = vec![0.0; n];
        nlp.gradient(w, &mut gradient);
        let jacobian = jacobian_at(nlp, w);
        let column = |j: usize| -> f64 { (0..m).map(|row| y[row] * jacobian[row][j]).sum() };
        (0..n)
            .map(|j| factor * gradient[j] + column(j))
            .collect::<Vec<f64>>()
    };
    let jacobian = jacobian_at(nlp, w);
    let mut entries = vec![f64::NAN; nlp.hessian_pattern().n_entries()];
    nlp.hessian(w, factor, &y, &mut entries);
    let hessian = dense(nlp.hessian_pattern(), &entries, n);
    let mut gradient = vec![0.0; n];
    nlp.gradient(w, &mut gradient);
    let step = 1e-6;
    for j in 0..n {
        let at = |sign: f64| {
            let mut moved = w.to_vec();
            moved[j] += sign * step;
            moved
        };
        let difference = (nlp.objective(&at(1.0)) - nlp.objective(&at(-1.0))) / (2.0 * step);
        assert!((difference - gradient[j]).abs() < 1e-6, "gradient {j}");
        let (mut up, mut down) = (vec![0.0; m], vec![0.0; m]);
        nlp.rows(&at(1.0), &mut up);
        nlp.rows(&at(-1.0), &mut down);
        for row in 0..m {
            let difference = (up[row] - down[row]) / (2.0 * step);
            let exact = jacobian[row][j];
            assert!(
                (difference - exact).abs() < 1e-6,
                "row {row}, column {j}: {exact}"
            );
        }
        let up = lagrangian_gradient(nlp, &at(1.0));
        let down = lagrangian_gradient(nlp, &at(-1.0));
        for i in j..n {
            let difference = (up[i] - down[i]) / (2.0 * step);
            let exact = hessian[i][j];
            let tolerance = 1e-5 * (1.0 + exact.abs());
            assert!(
                (difference - exact).abs() < tolerance,
                "({i}, {j}): {exact} {difference}"
            );
        }
    }
}

#[test]
fn derivatives_are_those_of_differences() {
    for relaxation in Relaxation::ALL {
        for steering in [Steering::Direct, Steering::L1, Steering::LInfinity] {
            let mut problem = problem();
            let mut lifted = Lifted::new(&mut problem);
            let start = lifted.start().to_vec();
            let form = Form {
                relaxation,
                steering,
                is_equation: false,
                keeps_curvature: false,
            };
            let mut relaxed = Relaxed::new(&mut lifted, form, 0.3, &start);
            let w = relaxed.start().to_vec();
            check_derivatives(&mut relaxed, &w);
        }
    }
}

#[test]
fn a_variable_may_complement_itself() {
    let mut problem = Quadratic::new(1, Function::default().linear(0, -1.0), Vec::new())
        .bound(0, 0.0, 2.0)
        .start(&[0.75])
        .complement(Side::Variable(0), Side::Variable(0));
    let mut lifted = Lifted::new(&mut problem);
    let mut relaxed = Relaxed::new(&mut lifted, Form::default(), 0.5, &[0.75]);
    check_derivatives(&mut relaxed, &[0.75]);
}

#[test]
fn sigma_follows_the_barrier_parameter() {
    let mut problem = problem();
    let mut lifted = Lifted::new(&mut problem);
    let start = lifted.start().to_vec();
    let coupling = Coupling {
        factor: 10.0,
        power: 1.0,
        smallest: 1e-8,
        largest: 5.0,
    };
    let form = Form {
        relaxation: Relaxation::Kadrani,
        ..Form::default()
    };
    let mut relaxed = Relaxed::new(&mut lifted, form, 5.0, &start).coupled(coupling);
    assert!(!relaxed.follow(1.0), "it is at its largest already");
    assert!(relaxed.follow(1e-3));
    assert_eq!(relaxed.sigma(), 1e-2);
    // The sides may be negative by √σ.
    assert!((relaxed.variable_bounds().lower[0] - (-0.5 - 0.1)).abs() < 1e-15);
    assert!(relaxed.follow(1e-12));
    assert_eq!(relaxed.sigma(), 1e-8);
}

proptest! {
    #[test]
    fn all_pass_through_the_corner(sigma in 1e-8..1e2) {
        let t = f64::sqrt(sigma);
        for relaxation in Relaxation::ALL {
            let values = values(relaxation, t, t, sigma);
            prop_assert!(values[0].abs() <= 1e-12 * (1.0 + sigma + t), "{relaxation:?} {values:?}");
        }
    }

    /// Four of them have the curve ab = σ: zero on it, negative below and positive above.
    #[test]
    fn four_share_one_curve(a in 1e-3..1e3, sigma in 1e-6..1e2) {
        let b = sigma / a;
        for relaxation in Relaxation::ALL.into_iter().filter(|r| r.is_curve()) {
            let at = |factor: f64| values(relaxation, a, factor * b, sigma)[0];
            prop_assert!(at(1.0).abs() <= 1e-12 * (1.0 + a), "{relaxation:?}");
            prop_assert!(at(0.5) < 0.0 && at(2.0) > 0.0, "{relaxation:?}");
        }
    }

    /// What a relaxation admits tends to the pair: min(a, b) is at most t where both are positive.
    #[test]
    fn what_they_admit_tends_to_the_pair(a in -2.0..2.0, b in -2.0..2.0, exponent in 1i32..8) {
        let sigma = 0.1f64.powi(2 * exponent);
        let t = sigma.sqrt();
        for relaxation in Relaxation::ALL {
            if admits(relaxation, a, b, sigma) {
                let residual = f64::min(a, b);
                prop_assert!(residual <= t * (1.0 + 1e-9), "{relaxation:?}");
                prop_assert!(residual >= -t * (1.0 + 1e-9), "{relaxation:?}");
            }
        }
    }

    /// No relaxation loses a point of the pair, but Kadrani's those within t of the origin.
    #[test]
    fn the_pair_is_admitted(a in 0.0..2.0, sigma in 1e-8..1.0) {
        for relaxation in Relaxation::ALL {
            let lost = if relaxation == Relaxation::Kadrani { f64::sqrt(sigma) } else { 0.0 };
            prop_assert!(admits(relaxation, a, 0.0, sigma) == (a >= lost), "{relaxation:?}");
        }
    }
}

proptest! {
    #[test]
    fn what_is_missing_makes_a_pair_convex(a in 1e-3..10.0_f64, b in 1e-3..10.0_f64, sigma in 1e-4..1.0_f64, y in 0.0..1e3_f64) {
        for relaxation in Relaxation::ALL {
            let mut problem = Quadratic::new(2, Function::default(), Vec::new())
                .bound(0, 0.0, f64::INFINITY)
                .bound(1, 0.0, f64::INFINITY)
                .complement(Side::Variable(0), Side::Variable(1));
            let mut lifted = Lifted::new(&mut problem);
            let form = Form { relaxation, ..Form::default() };
            let mut relaxed = Relaxed::new(&mut lifted, form, sigma, &[a, b]);
            let y = vec![y; relaxed.n_rows()];
            let mut entries = vec![0.0; relaxed.hessian_pattern().n_entries()];
            relaxed.hessian(&[a, b], 1.0, &y, &mut entries);
            let before = entries.clone();
            prop_assert!(relaxed.convexify(&[a, b], &y, &mut entries));
            let [aa, ba, bb] = [entries[0], entries[1], entries[2]];
            let size = entries.iter().chain(&before).fold(1.0, |m: f64, h| m.max(h.abs()));
            prop_assert!(aa.min(bb) >= -1e-12 * size, "{relaxation:?}");
            prop_assert!(ba * ba - aa * bb <= 1e-12 * size * size, "{relaxation:?}");
            // What is convex stays as it is.
            if before[0].min(before[2]) >= 0.0 && before[1] * before[1] < 0.99 * before[0] * before[2] && y.len() == 1 {
                prop_assert_eq!(entries, before);
            }
        }
    }
}
