//! Observed orders of convergence.

use nalgebra::{DMatrix, DVector};

use super::{Family, Tableau};

/// The order that the errors of `solve` with two numbers of steps show.
fn observed(solve: impl Fn(usize) -> f64, steps: [usize; 2]) -> f64 {
    let ratio = steps[1] as f64 / steps[0] as f64;
    (solve(steps[0]) / solve(steps[1])).ln() / ratio.ln()
}

/// x' = (1 + t) |x|² (-x₂, x₁) turns (1, 0) by the angle t + t²/2.
fn turn(t: f64, x: [f64; 2]) -> [f64; 2] {
    let speed = (1.0 + t) * (x[0] * x[0] + x[1] * x[1]);
    [-speed * x[1], speed * x[0]]
}

/// The error at t = 1.
fn turned(method: &Tableau, steps: usize) -> f64 {
    let (s, h) = (method.n_nodes(), 1.0 / steps as f64);
    let mut x = [1.0, 0.0];
    for step in 0..steps {
        let mut rates = vec![[0.0; 2]; s];
        let moved = |row: &[f64], rates: &[[f64; 2]]| {
            let sum = |k: usize| -> f64 { row.iter().zip(rates).map(|(a, f)| a * f[k]).sum() };
            [x[0] + h * sum(0), x[1] + h * sum(1)]
        };
        // Steps are short enough for the fixed-point iteration to contract; explicit methods are done
        // after s of them.
        for _ in 0..100 {
            let next = |(row, c): (&[f64], &f64)| turn((step as f64 + c) * h, moved(row, &rates));
            rates = method.a.chunks(s).zip(&method.nodes).map(next).collect();
        }
        x = moved(&method.weights, &rates);
    }
    let angle = 1.5_f64;
    (x[0] - angle.cos()).hypot(x[1] - angle.sin())
}

#[test]
fn methods_have_their_order() {
    for family in Family::ALL {
        // The errors of more nodes are near rounding.
        for s in family.nodes().filter(|s| *s <= 4) {
            let method = Tableau::new(family, s).unwrap();
            let steps = if method.order > 4 { [6, 9] } else { [40, 60] };
            let order = observed(|steps| turned(&method, steps), steps);
            let difference = (order - method.order as f64).abs();
            assert!(difference < 0.2, "{family:?} {s}: {order}");
        }
    }
}

/// Sliding down the unit circle: x' = (0, -1) + z x, 0 = |x|² - 1 from (1, 0), so that x = (1/cosh t,
/// -tanh t) and z = x₂. The error of x at t = 2.
fn slid(method: &Tableau, steps: usize) -> f64 {
    let (s, h) = (method.n_nodes(), 2.0 / steps as f64);
    let mut x = [1.0, 0.0];
    for _ in 0..steps {
        // The unknowns are (x, z) at the nodes.
        let mut y = DVector::from_fn(3 * s, |row, _| if row % 3 < 2 { x[row % 3] } else { x[1] });
        let rate = |y: &DVector<f64>, j: usize| {
            let z = y[3 * j + 2];
            [z * y[3 * j], z * y[3 * j + 1] - 1.0]
        };
        for _ in 0..20 {
            let mut residual = DVector::zeros(3 * s);
            let mut jacobian = DMatrix::zeros(3 * s, 3 * s);
            for i in 0..s {
                for k in 0..2 {
                    let row = 3 * i + k;
                    residual[row] = y[row] - x[k];
                    jacobian[(row, row)] += 1.0;
                    for j in 0..s {
                        let weight = h * method.a[i * s + j];
                        residual[row] -= weight * rate(&y, j)[k];
                        jacobian[(row, 3 * j + k)] -= weight * y[3 * j + 2];
                        jacobian[(row, 3 * j + 2)] -= weight * y[3 * j + k];
                    }
                    residual[3 * i + 2] += y[row] * y[row];
                    jacobian[(3 * i + 2, row)] = 2.0 * y[row];
                }
                residual[3 * i + 2] -= 1.0;
            }
            y -= jacobian.lu().solve(&residual).expect("A is invertible");
        }
        for (k, x) in x.iter_mut().enumerate() {
            let terms = method.weights.iter().enumerate();
            *x += h * terms.map(|(j, b)| b * rate(&y, j)[k]).sum::<f64>();
        }
    }
    (x[0] - 1.0 / 2.0_f64.cosh()).hypot(x[1] + 2.0_f64.tanh())
}

#[test]
fn methods_have_their_order_in_sliding() {
    for family in Family::ALL {
        for s in family.nodes().filter(|s| *s <= 4) {
            let method = Tableau::new(family, s).unwrap();
            let Some(exact) = method.sliding_order() else {
                continue;
            };
            // Even numbers: the error of Gauss with an odd number of nodes depends on the parity.
            let steps = if exact > 4 { [10, 16] } else { [40, 60] };
            let order = observed(|steps| slid(&method, steps), steps);
            let difference = (order - exact as f64).abs();
            assert!(difference < 0.2, "{family:?} {s}: {order} is not {exact}");
        }
    }
}
