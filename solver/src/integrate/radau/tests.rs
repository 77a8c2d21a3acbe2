//! Closed forms, orders and reference values of stiff problems.

use std::sync::Arc;

use super::{Counts, Implicit, Radau, Shape, Start, Stuck, Tableau};

/// A problem by closures: (t, y) to values, and to the Jacobian.
struct Problem<F, J>(F, J);

impl<F: FnMut(f64, &[f64], &mut [f64]), J: FnMut(f64, &[f64], &mut [f64])> Implicit
    for Problem<F, J>
{
    fn eval(&mut self, t: f64, y: &[f64], values: &mut [f64]) {
        self.0(t, y, values);
    }

    fn jacobian(&mut self, t: f64, y: &[f64], matrix: &mut [f64]) {
        self.1(t, y, matrix);
    }
}

/// Integrates from 0 to `end`; y at the end, the number of steps, and the counts.
fn integrate(
    problem: &mut impl Implicit,
    shape: Shape,
    (nodes, tolerance): (usize, f64),
    y0: &[f64],
    end: f64,
) -> (Vec<f64>, usize, Counts) {
    let mut radau = Radau::new(Arc::new(Tableau::new(nodes)), shape, tolerance);
    radau.restart(1e-6 * end);
    let (mut t, mut steps) = (0.0, 0);
    // A value that starts at zero has no magnitude yet.
    let mut start = at(y0);
    start.scales = y0.iter().map(|y| y.abs().max(1e-5)).collect();
    while t < end {
        let h = radau
            .step(problem, &start, end - t)
            .unwrap_or_else(|_| panic!("stuck at {t} with {:?}", start.y));
        t = if h == end - t { end } else { t + h };
        start.t = t;
        start.y = (0..y0.len()).map(|row| radau.end(&start, row)).collect();
        for (scale, y) in start.scales.iter_mut().zip(&start.y) {
            *scale = scale.max(y.abs());
        }
        steps += 1;
        assert!(steps < 20_000, "at {t}");
    }
    (start.y, steps, radau.counts)
}

/// A start at time 0, with magnitudes of order one.
fn at(y: &[f64]) -> Start {
    Start {
        t: 0.0,
        y: y.to_vec(),
        scales: vec![1.0; y.len()],
        terms: vec![0.0; y.len()],
    }
}

fn states(states: usize) -> Shape {
    Shape {
        states,
        algebraic: 0,
    }
}

#[track_caller]
fn assert_relative(found: &[f64], exact: &[f64], tolerance: f64) {
    for (found, exact) in found.iter().zip(exact) {
        let error = ((found - exact) / exact).abs();
        assert!(error <= tolerance, "{found:e} is not {exact:e}: {error:e}");
    }
}

/// Van der Pol in Liénard's time, ε y'' = (1 - y²) y' - y.
fn van_der_pol(epsilon: f64) -> impl Implicit {
    Problem(
        move |_, y: &[f64], f: &mut [f64]| {
            f[0] = y[1];
            f[1] = ((1.0 - y[0] * y[0]) * y[1] - y[0]) / epsilon;
        },
        move |_, y: &[f64], j: &mut [f64]| {
            j[0] = 0.0;
            j[1] = 1.0;
            j[2] = (-2.0 * y[0] * y[1] - 1.0) / epsilon;
            j[3] = (1.0 - y[0] * y[0]) / epsilon;
        },
    )
}

/// Reference: Mazzia & Magherini 2008, problem VDPOL. Which steps the jumps take, and with them the
/// error, hangs on the last digits of the tolerance: the error is the median over some near it. On the
/// slow manifold, y' = y/(1 - y²), an error of y shows (1 + y²)/(y² - 1) = 2.05 times in y'.
#[test]
fn van_der_pol_through_its_jumps() {
    let exact = [0.1706167732170483e1, -0.8928097010247975];
    for (nodes, tolerance) in [(3, 1e-6), (5, 1e-8), (7, 1e-10), (9, 1e-12), (11, 1e-12)] {
        let mut errors = [Vec::new(), Vec::new()];
        for k in -10..=10 {
            let tolerance = tolerance * (1.0 + 0.01 * f64::from(k));
            let setting = (nodes, tolerance);
            let mut problem = van_der_pol(1e-6);
            let (y, steps, _) = integrate(&mut problem, states(2), setting, &[2.0, 0.0], 2.0);
            assert!(steps < 700, "{nodes} nodes take {steps} steps");
            for ((errors, y), exact) in errors.iter_mut().zip(y).zip(exact) {
                errors.push(((y - exact) / exact).abs());
            }
        }
        for (mut errors, bound) in errors.into_iter().zip([30.0, 2.05 * 30.0]) {
            errors.sort_by(f64::total_cmp);
            let median = errors[errors.len() / 2];
            assert!(median <= bound * tolerance, "{nodes} nodes: {median:e}");
        }
    }
}

/// Reference: Mazzia & Magherini 2008, problem HIRES.
#[test]
fn hires() {
    let mut problem = Problem(
        |_, y: &[f64], f: &mut [f64]| {
            f[0] = -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007;
            f[1] = 1.71 * y[0] - 8.75 * y[1];
            f[2] = -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4];
            f[3] = 8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3];
            f[4] = -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6];
            f[5] = -280.0 * y[5] * y[7] + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6];
            f[6] = 280.0 * y[5] * y[7] - 1.81 * y[6];
            f[7] = -f[6];
        },
        |_, y: &[f64], j: &mut [f64]| {
            j.fill(0.0);
            let entries = [
                (0, 0, -1.71),
                (0, 1, 0.43),
                (0, 2, 8.32),
                (1, 0, 1.71),
                (1, 1, -8.75),
                (2, 2, -10.03),
                (2, 3, 0.43),
                (2, 4, 0.035),
                (3, 1, 8.32),
                (3, 2, 1.71),
                (3, 3, -1.12),
                (4, 4, -1.745),
                (4, 5, 0.43),
                (4, 6, 0.43),
                (5, 3, 0.69),
                (5, 4, 1.71),
                (5, 5, -280.0 * y[7] - 0.43),
                (5, 6, 0.69),
                (5, 7, -280.0 * y[5]),
                (6, 5, 280.0 * y[7]),
                (6, 6, -1.81),
                (6, 7, 280.0 * y[5]),
                (7, 5, -280.0 * y[7]),
                (7, 6, 1.81),
                (7, 7, -280.0 * y[5]),
            ];
            for (row, col, value) in entries {
                j[row * 8 + col] = value;
            }
        },
    );
    let mut y0 = [0.0; 8];
    (y0[0], y0[7]) = (1.0, 0.0057);
    let exact = [
        0.7371312573325668e-3,
        0.1442485726316185e-3,
        0.5888729740967575e-4,
        0.1175651343283149e-2,
        0.2386356198831331e-2,
        0.6238968252742796e-2,
        0.2849998395185769e-2,
        0.2850001604814231e-2,
    ];
    for (nodes, tolerance) in [(5, 1e-8), (7, 1e-10), (9, 1e-12)] {
        let (y, _, _) = integrate(&mut problem, states(8), (nodes, tolerance), &y0, 321.8122);
        for (y, exact) in y.iter().zip(exact) {
            // Relative to the largest values, of order one.
            assert!((y - exact).abs() < tolerance, "{y:e} is not {exact:e}");
        }
    }
}

/// Reference: Mazzia & Magherini 2008, problem ROBER.
#[test]
fn robertson_over_eleven_decades() {
    let mut problem = Problem(
        |_, y: &[f64], f: &mut [f64]| {
            f[0] = -0.04 * y[0] + 1e4 * y[1] * y[2];
            f[2] = 3e7 * y[1] * y[1];
            f[1] = -f[0] - f[2];
        },
        |_, y: &[f64], j: &mut [f64]| {
            j.copy_from_slice(&[
                -0.04,
                1e4 * y[2],
                1e4 * y[1],
                0.04,
                -1e4 * y[2] - 6e7 * y[1],
                -1e4 * y[1],
                0.0,
                6e7 * y[1],
                0.0,
            ]);
        },
    );
    let exact = [
        0.2083340149701255e-7,
        0.8333360770334713e-13,
        0.999999979166505,
    ];
    let (y, steps, _) = integrate(&mut problem, states(3), (7, 1e-11), &[1.0, 0.0, 0.0], 1e11);
    for (y, exact) in y.iter().zip(exact) {
        assert!((y - exact).abs() < 1e-11, "{y:e} is not {exact:e}");
    }
    assert!(steps < 300, "{steps} steps");
}

/// x' = -λ (x - cos t) - sin t from x(0) = 1: x = cos t (Prothero & Robinson 1974).
#[test]
fn stiffness_costs_no_order() {
    for lambda in [1e3, 1e6, 1e9] {
        let mut problem = Problem(
            |t: f64, y: &[f64], f: &mut [f64]| f[0] = -lambda * (y[0] - t.cos()) - t.sin(),
            |_, _: &[f64], j: &mut [f64]| j[0] = -lambda,
        );
        let (y, steps, _) = integrate(&mut problem, states(1), (7, 1e-11), &[1.0], 10.0);
        assert_relative(&y, &[10.0_f64.cos()], 1e-12);
        assert!(steps < 80, "{steps} steps at {lambda:e}");
    }
}

/// x' = α - 3, 0 = (1 + x²)(α - 3 + x) + t (α - 3 + x): x = e^{-t}, α = 3 - x.
#[test]
fn algebraic_unknowns_follow() {
    let mut problem = Problem(
        |t, y: &[f64], f: &mut [f64]| {
            let (x, alpha) = (y[0], y[1]);
            f[0] = alpha - 3.0;
            f[1] = (1.0 + x * x + t) * (alpha - 3.0 + x);
        },
        |t, y: &[f64], j: &mut [f64]| {
            let (x, alpha) = (y[0], y[1]);
            j[0] = 0.0;
            j[1] = 1.0;
            j[2] = 1.0 + x * x + t + 2.0 * x * (alpha - 3.0 + x);
            j[3] = 1.0 + x * x + t;
        },
    );
    let shape = Shape {
        states: 1,
        algebraic: 1,
    };
    let (y, _, _) = integrate(&mut problem, shape, (7, 1e-11), &[1.0, 2.0], 2.0);
    let x = (-2.0_f64).exp();
    assert_relative(&y, &[x, 3.0 - x], 1e-10);
}

/// x₁' = x₂, x₂' = -x₁: x₁ = sin t, without error control.
#[test]
fn converges_with_its_order() {
    let mut problem = Problem(
        |_, y: &[f64], f: &mut [f64]| (f[0], f[1]) = (y[1], -y[0]),
        |_, _: &[f64], j: &mut [f64]| j.copy_from_slice(&[0.0, 1.0, -1.0, 0.0]),
    );
    let mut error = |nodes: usize, steps: usize| {
        let mut radau = Radau::new(Arc::new(Tableau::new(nodes)), states(2), 1e-13);
        let (mut start, h) = (at(&[0.0, 1.0]), 6.0 / steps as f64);
        for step in 0..steps {
            start.t = step as f64 * h;
            radau.solve(&mut problem, &start, h).unwrap();
            start.y = vec![radau.end(&start, 0), radau.end(&start, 1)];
        }
        (start.y[0] - 6.0_f64.sin()).hypot(start.y[1] - 6.0_f64.cos())
    };
    for (nodes, steps) in [(3, 32), (5, 8), (7, 2)] {
        let order = (error(nodes, steps) / error(nodes, 2 * steps)).log2();
        let expected = (2 * nodes - 1) as f64;
        assert!(
            (order - expected).abs() < 0.25,
            "order {order} of {nodes} nodes"
        );
    }
}

/// The series are those of the solution within the step too.
#[test]
fn series_are_as_accurate_as_the_step() {
    let mut problem = Problem(
        |_, y: &[f64], f: &mut [f64]| {
            (f[0], f[1]) = (y[1], -y[0]);
        },
        |_, _: &[f64], j: &mut [f64]| j.copy_from_slice(&[0.0, 1.0, -1.0, 0.0]),
    );
    let shape = Shape {
        states: 2,
        algebraic: 0,
    };
    let mut radau = Radau::new(Arc::new(Tableau::new(7)), shape, 1e-10);
    radau.restart(1.0);
    let h = radau.step(&mut problem, &at(&[0.0, 1.0]), 1.0).unwrap();
    for k in 0..=20 {
        let t = k as f64 / 20.0 * h;
        let value = |row| crate::expansion::series::value(radau.series(row), t);
        assert!((value(0) - t.sin()).abs() < 1e-10);
        assert!((value(1) - t.cos()).abs() < 1e-10);
    }
}

#[test]
fn ends_where_nothing_is_finite() {
    let mut problem = Problem(
        |_, _: &[f64], f: &mut [f64]| f[0] = f64::NAN,
        |_, _: &[f64], j: &mut [f64]| j[0] = 1.0,
    );
    let mut radau = Radau::new(Arc::new(Tableau::new(3)), states(1), 1e-8);
    radau.restart(1.0);
    assert_eq!(radau.step(&mut problem, &at(&[1.0]), 1.0), Err(Stuck));
}
