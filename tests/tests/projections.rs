//! Projected dynamics against closed forms, and against an enumeration of active sets.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use nsd_tests::random::Random;
use nsd_tests::{assert_near, end, fitted_order, optimum, run, times};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

/// By events, and by finite elements of an order that leaves rounding.
const ROADS: [&str; 2] = [
    "tolerance 1e-12;",
    "method fesd { steps = 120; scheme = radau_iia(4); }",
];

/// Runs a model to a horizon.
fn runs(model: &str, name: &str, horizon: f64, method: &str) -> Trajectory {
    let text = format!("{model} simulate this of {name} {{ horizon {horizon:?}; {method} }}");
    let trajectory = run(&text, "this");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    trajectory
}

/// Turns clockwise with radius 2 down to x₂ = -1, along it to (0, -1), where nothing pushes any more, and on with
/// radius 1.
const TURN: &str = "model turn {
  state x[2] = [sqrt(2), sqrt(2)];
  x' = [x[2], -x[1]];
  project x onto { x[2] + 1 >= 0; }
}";

fn turn_horizon() -> f64 {
    11.0 * PI / 12.0 + 3.0_f64.sqrt()
}

#[test]
fn a_constraint_is_reached_and_left() {
    for method in ROADS {
        let found = runs(TURN, "turn", turn_horizon(), method);
        assert_near(&end(&found, "x"), &[-1.0, 0.0], 1e-10);
        let reached = 5.0 * PI / 12.0;
        assert_near(&times(&found, EventKind::Activate), &[reached], 1e-10);
        let left = reached + 3.0_f64.sqrt();
        assert_near(&times(&found, EventKind::Deactivate), &[left], 1e-9);
    }
}

#[test]
fn finite_elements_keep_their_order_across_activation_and_deactivation() {
    for (scheme, n_nodes, grids) in [
        ("radau_iia(1)", 1.0, &[200, 270, 365, 490, 660, 890][..]),
        ("radau_iia(2)", 2.0, &[20, 27, 37, 51, 69, 93]),
        ("radau_iia(3)", 3.0, &[8, 11, 15, 20, 27, 36]),
    ] {
        let errors: Vec<(usize, f64)> = grids
            .iter()
            .map(|&steps| {
                let method = format!("method fesd {{ steps = {steps}; scheme = {scheme}; }}");
                let x = end(&runs(TURN, "turn", turn_horizon(), &method), "x");
                let error = (x[0] + 1.0).hypot(x[1]);
                (steps, error)
            })
            .collect();
        let order = fitted_order(&errors);
        let least = 2.0 * n_nodes - 1.3;
        assert!(order >= least, "{scheme}: order {order:.2} from {errors:?}");
    }
}

#[test]
fn a_constraint_is_touched_with_third_order_and_pushed() {
    // y = 2 - s³ + s⁴ at s = x comes down to zero with y' = 0 at t = 1; -3s² + 4s³ pushes until s = 3/4.
    let model = "model touch {
      state x = -1;
      state y = 2;
      x' = 1;
      y' = -3*x^2 + 4*x^3;
      project y onto { y >= 0; }
    }";
    let rest = |s: f64| s.powi(4) - s.powi(3);
    for method in ROADS {
        let found = runs(model, "touch", 2.5, method);
        assert_near(&end(&found, "y"), &[rest(1.5) - rest(0.75)], 1e-10);
        assert_near(&times(&found, EventKind::Deactivate), &[1.75], 1e-8);
    }
}

#[test]
fn a_moving_disc_sweeps_a_point() {
    // In the frame of the centre the point is at the angle θ, tan(θ/2) = tan(θ₀/2) e^t once it is met at t = √3/2.
    let model = "model sweep {
      state x[2] = [0, 0.5];
      x' = [0, 0];
      project x onto { 1 - (x[1] - time)^2 - x[2]^2 >= 0; }
    }";
    let met = 0.75_f64.sqrt();
    let start = 0.5_f64.atan2(-met);
    let theta = 2.0 * ((start / 2.0).tan() * (4.0 - met).exp()).atan();
    for method in ROADS {
        let found = runs(model, "sweep", 4.0, method);
        assert_near(&end(&found, "x"), &[4.0 + theta.cos(), theta.sin()], 1e-10);
        assert_near(&times(&found, EventKind::Activate), &[met], 1e-10);
    }
}

/// x(T) of x' = P f, constant f, in the polyhedron A x + b ≥ 0 with the metric E: between the instants at which
/// another row is met, x' is f + E A_Kᵀ λ for the one K of the active rows with λ ≥ 0 and no rate of the others
/// negative.
fn in_polyhedron(
    (a, b, e): (&DMatrix<f64>, &DVector<f64>, &DMatrix<f64>),
    f: &DVector<f64>,
    mut x: DVector<f64>,
    mut left: f64,
) -> DVector<f64> {
    let m = a.nrows();
    while left > 0.0 {
        let c = a * &x + b;
        let met: Vec<usize> = (0..m).filter(|&i| c[i] <= 1e-11).collect();
        let rate = (0..1_usize << met.len()).find_map(|mask| {
            let kept = met
                .iter()
                .enumerate()
                .filter(|(bit, _)| mask >> bit & 1 == 1);
            let rows = a.select_rows(&kept.map(|(_, &i)| i).collect::<Vec<_>>());
            let push = e * rows.transpose();
            let force = match rows.nrows() {
                0 => DVector::zeros(0),
                _ => (&rows * &push).lu().solve(&(-(&rows * f)))?,
            };
            let rate = f + push * &force;
            let rises = met.iter().all(|&i| (a.row(i) * &rate)[0] >= -1e-11);
            (force.iter().all(|&force| force >= -1e-11) && rises).then_some(rate)
        });
        let rate = rate.expect("the projection exists");
        let falls = a * &rate;
        let next = (0..m)
            .filter(|&i| falls[i] < -1e-11)
            .map(|i| -c[i] / falls[i]);
        let step = next.fold(left, f64::min);
        x += rate * step;
        left -= step;
    }
    x
}

#[test]
fn corners_of_two_and_three_constraints_with_any_metric() {
    let mut seed = 7_u64;
    let mut random = || {
        seed = seed
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        2.0 * ((seed >> 33) as f64 / (1_u64 << 31) as f64) - 1.0
    };
    let mut most = 0;
    for case in 0..24 {
        let n = 2 + case % 2;
        // Independent normals that point away from the start, and a field that goes against all of them.
        let a = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(i == j)) + 0.4 * random());
        let b = DVector::from_fn(n, |_, _| 0.6 + 0.5 * random());
        let root = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(i == j)) + 0.4 * random());
        let e = &root * root.transpose();
        let f = DVector::from_fn(n, |_, _| -1.0 + 0.4 * random());
        let exact = in_polyhedron((&a, &b, &e), &f, DVector::zeros(n), 3.0);
        let list = |values: Vec<f64>| {
            let words: Vec<String> = values.iter().map(|v| format!("{v:?}")).collect();
            words.join(", ")
        };
        let rows: Vec<String> = (0..n)
            .map(|i| {
                format!(
                    "dot([{}], x) + {:?} >= 0;",
                    list(a.row(i).iter().copied().collect()),
                    b[i]
                )
            })
            .collect();
        let metric: Vec<String> = (0..n)
            .map(|i| list(e.row(i).iter().copied().collect()))
            .collect();
        let model = format!(
            "model corner {{ state x[{n}] = zeros({n}); x' = [{}]; project x onto {{ {} }} metric [{}]; }}",
            list(f.iter().copied().collect()),
            rows.join(" "),
            metric.join("; ")
        );
        for method in ROADS {
            let found = runs(&model, "corner", 3.0, method);
            assert_near(&end(&found, "x"), exact.as_slice(), 1e-9);
            let last = found.history.modes.last().expect("a run has a mode");
            let active = |side: &&nsdc::report::Side| **side == nsdc::report::Side::Active;
            most = most.max(last.sides.iter().filter(active).count());
        }
    }
    assert_eq!(most, 3, "some case ends in a corner of three");
}

#[test]
fn a_block_of_zeros_in_the_metric_leaves_a_state_alone() {
    // Only y is pushed: x = t, and y follows -x once it is met at t = 1.
    let model = "model partly {
      state z[2] = [0, 1];
      z' = [1, 0];
      project z onto { z[2] >= z[1]; } metric [0, 0; 0, 1];
    }";
    for method in ROADS {
        let found = runs(model, "partly", 3.0, method);
        assert_near(&end(&found, "z"), &[3.0, 3.0], 1e-11);
        assert_near(&times(&found, EventKind::Activate), &[1.0], 1e-11);
    }
}

#[test]
fn a_tank_that_overflows_is_a_projection_or_a_relay() {
    // The relay removes more than comes in; sliding is the projection.
    let flow = "sin(2*time) + 0.3*cos(5*time)";
    let projected =
        format!("model tank {{ state h = 0.5; h' = {flow}; project h onto {{ 0 <= h <= 0.8; }} }}");
    let switched =
        format!("model tank {{ state h = 0.5; h' = {flow} - 2*step(h - 0.8) + 2*step(-h); }}");
    for method in ROADS {
        let of = |model: &str| runs(model, "tank", 6.0, method);
        let (a, b) = (of(&projected), of(&switched));
        assert_near(&end(&a, "h"), &end(&b, "h"), 1e-9);
        let (on, off) = (
            times(&a, EventKind::Activate),
            times(&a, EventKind::Deactivate),
        );
        assert!(on.len() >= 2, "{on:?}");
        assert_near(&on, &times(&b, EventKind::EnterSliding), 1e-9);
        assert_near(&off, &times(&b, EventKind::LeaveSliding), 1e-9);
    }
}

#[test]
fn regions_and_parts_may_be_projected() {
    // Down to the floor at t = 1/2, along it, up in the other region from x = 2 on.
    let text = "model lift {
      input speed;
      state x[2] = [0, 1];
      region left where x[1] < 2 { x' = [1, -2*speed]; }
      region right where x[1] > 2 { x' = [1, 3]; }
      project x onto { x[2] >= 0; }
    }
    model whole { part one = lift { speed = 1; } }
    simulate this of whole { horizon 3; tolerance 1e-11; output one.x;
      expect mode at 1 is active(one.x[2]);
      expect mode at 2.5 is inactive(one.x[2]); }";
    let found = run(text, "this");
    assert_near(&end(&found, "one.x"), &[3.0, 3.0], 1e-11);
}

#[test]
fn a_run_that_starts_at_rest_on_a_constraint() {
    // The force is 1 at the start, so that nothing is left of the rate, and x stays exactly zero up to t = π/2.
    let model = "model rest { state x = 0; x' = -cos(time); project x onto { x >= 0; } }";
    for method in ROADS {
        let found = runs(model, "rest", 5.0, method);
        assert_near(&end(&found, "x"), &[1.0 - 5.0_f64.sin()], 1e-10);
        assert_near(&times(&found, EventKind::Deactivate), &[PI / 2.0], 1e-8);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
}

#[test]
fn constraints_that_depend_on_each_other_keep_a_point() {
    // Three rows meet in the origin of the plane: which of them push there is open, the motion is not.
    let model = "model three {
      state x[2] = [0.3, 1];
      x' = [-0.1, -1];
      project x onto { x[2] >= 0; x[2] + x[1] >= 0; x[2] - x[1] >= 0; }
    }";
    for method in ROADS {
        let found = runs(model, "three", 4.0, method);
        assert_near(&end(&found, "x"), &[0.0, 0.0], 1e-12);
    }
}

#[test]
fn a_set_that_closes_ends_the_run() {
    let model = "model shut { state x = 0.5; x' = 0; project x onto { time <= x <= 1; } }";
    for method in [
        "",
        "method fesd { steps = 20; }",
        "method timestepping { steps = 20; }",
    ] {
        let text = format!("{model} simulate this of shut {{ horizon 2; {method} }}");
        let found = run(&text, "this");
        assert_eq!(found.status, Status::NumericalFailure, "{method}");
        let last = found.history.modes.last().expect("a mode");
        assert!((last.to - 1.0).abs() <= 1e-9, "{}", last.to);
        assert!(last.mode.contains("inactive(1 - x)") && last.mode.starts_with("active("));
    }
}

#[test]
fn a_start_outside_of_the_set_is_an_error() {
    let text = "model disc { state x = 2; x' = 1; project x onto { x <= 1; } }
      simulate this of disc { horizon 1; } simulate that of disc { horizon 1; method fesd { steps = 3; } }";
    for experiment in ["this", "that"] {
        let found = run(text, experiment);
        let outside = matches!(found.failure, Some(Failure::Penetrates { time: 0.0, .. }));
        assert!(outside, "{:?}", found.failure);
    }
}

#[test]
fn an_optimum_uses_a_wall() {
    // Full speed to the wall at x = 0 within t = 1/2 and waiting there is best: 1/24 is ∫ (1/2 - t)² dt.
    let text = "model wall {
      state x = 0.5;
      control u in [-1, 1] = 0;
      x' = u;
      project x onto { x >= 0; }
    }
    optimize this of wall {
      horizon 1; intervals 4; elements 2; scheme radau_iia(3);
      minimize integral(x^2 + 1e-3*(u + 1)^2);
    }";
    let found = optimum(text, "this");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    let objective = found.objective.expect("an objective");
    assert!((objective - 1.0 / 24.0).abs() <= 1e-9, "{objective}");
    assert!(end(&found, "x")[0].abs() <= 1e-10);
}

#[test]
fn a_metric_that_depends_on_the_state_pushes_along_a_curved_boundary() {
    // x' = f + E∇c λ with f = (1, -2), ∇c = (-x₁, 1), E = (1 + x₁², ½; ½, 1) on c = x₂ - x₁²/2 = 0: λ takes away
    // ∇c·f = -x₁ - 2, ∇cᵀE∇c = x₁²(1 + x₁²) - x₁ + 1, so x₁' = 1 + λ (½ - x₁ (1 + x₁²)).
    let model = "model curved {
      state x[2] = [-1, 2.5];
      x' = [1, -2];
      project x onto { x[2] - x[1]^2/2 >= 0; } metric [1 + x[1]^2, 0.5; 0.5, 1];
    }";
    // Met at 5/2 - 2t = (t - 1)²/2: t = √5 - 1.
    let met = 5.0_f64.sqrt() - 1.0;
    let rate = |x: f64| {
        let force = (x + 2.0) / (x * x * (1.0 + x * x) - x + 1.0);
        1.0 + force * (0.5 - x * (1.0 + x * x))
    };
    let (horizon, steps) = (3.0, 20_000);
    let h = (horizon - met) / f64::from(steps);
    let end_of = (0..steps).fold(met - 1.0, |x, _| {
        let k1 = rate(x);
        let k2 = rate(x + 0.5 * h * k1);
        let k3 = rate(x + 0.5 * h * k2);
        let k4 = rate(x + h * k3);
        x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    });
    for method in ROADS {
        let found = runs(model, "curved", horizon, method);
        assert_near(&times(&found, EventKind::Activate), &[met], 1e-10);
        assert_near(&end(&found, "x"), &[end_of, end_of * end_of / 2.0], 1e-9);
    }
}

#[test]
fn a_boundary_is_entered_and_left_along_itself() {
    // In the frame x the wall w = (x - 1)³ (4 - x)/10 comes up to y = 0 with w' = w'' = 0 at x = 1, carries y along up
    // to its top at x = 3.25, and sinks below it again.
    let model = "model carried {
      state x = 0;
      state y = 0;
      x' = 1;
      y' = 0;
      project y onto { y - (x - 1)^3*(4 - x)/10 >= 0; }
    }";
    let top = 3.25_f64;
    let height = (top - 1.0).powi(3) * (4.0 - top) / 10.0;
    // An element that ends at a triple root is not solved (E0711).
    let found = runs(model, "carried", 5.0, ROADS[0]);
    assert_near(&end(&found, "y"), &[height], 1e-10);
    assert_near(&times(&found, EventKind::Deactivate), &[top], 1e-8);
}

#[test]
fn a_rectifier_with_a_capacitor_is_a_projection_or_a_relay() {
    // The voltage at the load is not below that of the source, whichever sign it has: charge flows from C = 1 to 2.
    let projected = "model bridge {
      state x[2] = [1, 1.5]; state i = -2; i' = x[1]; x' = [-i, -x[2]/4];
      project x onto { x[2] - x[1] >= 0; x[2] + x[1] >= 0; } metric [1, 0; 0, 0.5];
    }";
    let switched = "model bridge {
      state x[2] = [1, 1.5]; state i = -2; i' = x[1];
      x' = [-i - 8*step(x[1] - x[2]) + 8*step(-x[1] - x[2]), -x[2]/4 + 4*step(x[1] - x[2]) + 4*step(-x[1] - x[2])];
    }";
    for method in ROADS {
        let of = |model: &str| runs(model, "bridge", 12.0, method);
        let (a, b) = (of(projected), of(switched));
        assert_near(&end(&a, "x"), &end(&b, "x"), 1e-9);
        assert_near(&end(&a, "i"), &end(&b, "i"), 1e-9);
        let on = times(&a, EventKind::Activate);
        assert!(on.len() >= 2, "{on:?}");
        assert_near(&on, &times(&b, EventKind::EnterSliding), 1e-9);
    }
}

#[test]
fn two_forces_vanish_at_one_instant() {
    // Two discs push a third one until they pass it, each the mirror image of the other. With the angle θ of the line
    // between centres and u = (5, 10), forces λ = (5 cos θ - 10 sin θ)/(1 + 2 sin² θ) vanish where tan θ = 1/2, the
    // third one moves with -2 λ sin θ, and 3 θ' = 5 sin θ + 10 cos θ + 2 λ sin θ cos θ.
    // Where one force vanishes, what is left of the other one is little, and nothing soon.
    let model = "model passed {
      param more = 0;
      state x[6] = [-3, 0, 3, 0, 0, 0];
      x' = [5 + more, 10, -5, 10, 0, 0];
      project x onto { norm(x[5..6] - x[1..2]) >= 3; norm(x[5..6] - x[3..4]) >= 3; }
    }";
    // dt/dθ, and what the third one moves by.
    let rates = |theta: f64| {
        let (s, c) = theta.sin_cos();
        let force = (5.0 * c - 10.0 * s) / (1.0 + 2.0 * s * s);
        let slow = 3.0 / (5.0 * s + 10.0 * c + 2.0 * force * s * c);
        [slow, -2.0 * force * s * slow]
    };
    let (last, n) = (0.5_f64.atan(), 1000);
    let simpson = |i: usize| {
        let weight = |k: usize| match k {
            0 => 1.0,
            k if k == n => 1.0,
            k => 2.0 + 2.0 * (k % 2) as f64,
        };
        let h = last / n as f64;
        let terms = (0..=n).map(|k| weight(k) * rates(k as f64 * h)[i]);
        terms.sum::<f64>() * h / 3.0
    };
    for more in [0.0, 1e-10, 1e-8, -3e-8, 1e-7] {
        let settings = format!("with {{ more = {more:?}; }} tolerance 1e-12;");
        let found = runs(model, "passed", 0.5, &settings);
        assert_near(
            &times(&found, EventKind::Deactivate),
            &[simpson(0); 2],
            1e-7,
        );
        assert_near(&end(&found, "x")[4..], &[0.0, simpson(1)], 1e-7);
    }
}

/// The rate nearest to f in the tangent cone at a point of x >= 0, Σ x <= 1, where these entries are zero and the sum is one: f
/// less a number, without what is negative of it among these entries.
fn nearest_rate(f: &[f64], is_zero: &[bool], is_full: bool) -> Vec<f64> {
    let cut = |shift: f64| -> Vec<f64> {
        let pairs = f.iter().zip(is_zero);
        let entry = |(f, zero): (&f64, &bool)| {
            if *zero {
                (f - shift).max(0.0)
            } else {
                f - shift
            }
        };
        pairs.map(entry).collect()
    };
    let sum = |shift: f64| cut(shift).iter().sum::<f64>();
    if !is_full || sum(0.0) <= 0.0 {
        return cut(0.0);
    }
    // Σ falls with the number, by bisection.
    let (mut low, mut high) = (0.0, 20.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match sum(middle) > 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    cut(high)
}

/// More constraints meet than are enumerated, from a vertex of a simplex.
#[test]
fn many_constraints_have_the_nearest_rate() {
    let mut random = Random(3);
    for case in 0..60 {
        let n = 4 + case % 8;
        let f: Vec<f64> = (0..n).map(|_| 2.0 * random.unit() - 1.0).collect();
        // The origin, or another vertex.
        let corner = (case % 2 == 1).then(|| case % n);
        let start: Vec<f64> = (0..n)
            .map(|i| f64::from(u8::from(corner == Some(i))))
            .collect();
        let is_zero: Vec<bool> = start.iter().map(|x| *x == 0.0).collect();
        let horizon = 1e-3;
        let text = format!(
            "model m {{ state x[{n}] = {start:?}; x' = {f:?}; project x onto {{ for i in 1..{n} {{ x[i] >= 0; }} sum(x) <= 1; }} }}
             simulate s of m {{ horizon {horizon}; }}"
        );
        let found = run(&text, "s");
        assert_eq!(found.status, Status::Solved, "{text}");
        assert!(found.warnings.is_empty(), "{:?} {text}", found.warnings);
        let rate = nearest_rate(&f, &is_zero, corner.is_some());
        let moved = end(&found, "x");
        let moved: Vec<f64> = (moved.iter().zip(&start))
            .map(|(x, start)| (x - start) / horizon)
            .collect();
        assert_near(&moved, &rate, 1e-8);
    }
}

/// Constraints join one by one, up to all of them: x ends in the vertex of the largest rate.
#[test]
fn a_simplex_is_not_left() {
    let found = runs(
        "model m { state x[8] = 0.1*ones(8); x' = [1, 0.9, -0.1, -0.2, -0.3, -0.4, -0.5, -0.6];
           project x onto { for i in 1..8 { x[i] >= 0; } sum(x) <= 1; } }",
        "m",
        40.0,
        "",
    );
    assert_eq!(found.status, Status::Solved);
    let corner = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_near(&end(&found, "x"), &corner, 1e-10);
}

/// x' = s (cos t - 0.3) within [0, 0.4 s]: the same in all units, as long as λ has enough digits, which is told.
#[test]
fn constraints_that_forces_are_too_small_for_are_told() {
    // At the bound from sin t - 0.3 t = 0.4 to cos t = 0.3.
    let leaves = 0.3_f64.acos();
    let exact = 0.4 + (2.0_f64.sin() - leaves.sin()) - 0.3 * (2.0 - leaves);
    for (scale, is_told) in [
        (1e6, false),
        (1.0, false),
        (1e-4, false),
        (1e-10, true),
        (1e-13, true),
        (1e-15, true),
    ] {
        let found = runs(
            &format!(
                "model m {{ param s = {scale:?}; state x = 0; x' = s*(cos(time) - 0.3); project x onto {{ x >= 0; x <= 0.4*s; }} }}"
            ),
            "m",
            2.0,
            "",
        );
        let told = found.warnings.iter().any(|warning| warning.code == "W0737");
        assert_eq!(told, is_told, "{scale}");
        if !is_told {
            assert_near(&[end(&found, "x")[0] / scale], &[exact], 1e-7);
        }
    }
}

/// What a constraint is multiplied with does not matter.
#[test]
fn constraints_have_any_unit() {
    let on = |row: &str| {
        let text = format!(
            "model m {{ state x = 1; x' = -1 + 2*sin(time); project x onto {{ {row}; }} }}"
        );
        let found = runs(&text, "m", 5.0, "");
        assert_eq!(found.status, Status::Solved);
        end(&found, "x")[0]
    };
    let known = on("x >= 0");
    for row in ["1e-6*x >= 0", "1e-3*x >= 0", "1e3*x >= 0"] {
        assert_near(&[on(row)], &[known], 1e-8);
    }
}
