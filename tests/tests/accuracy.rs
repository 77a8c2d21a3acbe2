//! Known solutions: error against tolerance, event times, orders of convergence.

use std::f64::consts::PI;

use nsd_tests::{distance, end, run, with_experiment};
use nsdc::report::{EventKind, Status};

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");
const INTERSECTIONS: &str = include_str!("../../examples/intersections.nsd");

fn oscillator_end() -> [f64; 2] {
    let (radius, angle) = ((PI / 2.0 - 1.0).exp(), 2.0 * PI * (PI / 2.0 - 1.0));
    [radius * angle.cos(), radius * angle.sin()]
}

fn oscillator_with(setting: &str) -> String {
    OSCILLATOR.replacen("tolerance 1e-13;", setting, 1)
}

#[test]
fn the_oscillator_is_exact_to_rounding() {
    let trajectory = run(OSCILLATOR, "crossing");
    assert_eq!(trajectory.status, Status::Solved);
    assert!(distance(&end(&trajectory, "x"), &oscillator_end()) <= 1e-12);
    assert!(distance(&trajectory.history.switch_times(), &[1.0]) <= 1e-13);
    let kinds: Vec<EventKind> = trajectory
        .history
        .events
        .iter()
        .map(|event| event.kind)
        .collect();
    assert_eq!(kinds, [EventKind::Crossing]);
}

#[test]
fn every_tolerance_is_met_and_the_estimate_covers_the_error() {
    for k in 3..=13 {
        let tolerance = 10.0_f64.powi(-k);
        let trajectory = run(&oscillator_with(&format!("tolerance 1e-{k};")), "crossing");
        let error = distance(&end(&trajectory, "x"), &oscillator_end());
        let estimate = trajectory.quality.error_estimate.unwrap();
        assert!(error <= 2.0 * tolerance, "{error:e} at {tolerance:e}");
        assert!(
            error <= 10.0 * estimate + 1e-14,
            "{error:e} is above the estimate {estimate:e}"
        );
    }
}

/// With the step bounded by the tolerance, halving log(tolerance) must show in the number of
/// steps as h ~ tol^(1/p); the error of one fixed order must fall with it.
#[test]
fn the_error_falls_with_the_order_of_the_method() {
    let errors_and_steps = |order: usize| -> Vec<(f64, f64)> {
        let runs = [2, 4, 6].map(|k| {
            let text = oscillator_with(&format!(
                "tolerance 1e-{k}; method event {{ order = {order}; }}"
            ));
            with_experiment(&text, "crossing", |compiled| {
                let request = nsdc::simulate::Request {
                    estimate: false,
                    ..Default::default()
                };
                let trajectory =
                    nsdc::simulate::run(&compiled.system, &compiled.settings, &request);
                let error = distance(&end(&trajectory, "x"), &oscillator_end());
                (error, trajectory.quality.stats.steps as f64)
            })
        });
        runs.to_vec()
    };
    for order in [4, 6, 8] {
        let runs = errors_and_steps(order);
        let (first, last) = (runs[0], runs[runs.len() - 1]);
        let observed = (first.0 / last.0).ln() / (last.1 / first.1).ln();
        assert!(
            observed >= order as f64 - 0.7,
            "order {order} shows as {observed:.2}: {runs:?}"
        );
    }
}

#[test]
fn codimension_two_and_three_follow_their_exact_solutions() {
    let trajectory = run(INTERSECTIONS, "codimension_two");
    assert!(trajectory.failure.is_none());
    let exact = [
        2.0_f64.cos() / 0.5_f64.cosh(),
        2.0_f64.sin() / 0.5_f64.cosh(),
        0.5_f64.tanh(),
    ];
    assert!(
        distance(&end(&trajectory, "x"), &exact) <= 1e-12,
        "{:?}",
        (end(&trajectory, "x"), exact)
    );
    assert!(distance(&trajectory.history.switch_times(), &[0.5, 1.0]) <= 1e-12);

    let trajectory = run(INTERSECTIONS, "codimension_three");
    assert!(trajectory.failure.is_none());
    let s: f64 = 0.65 * 0.65 / 2.0;
    let exact = [
        2.0_f64.cos() / s.cosh(),
        2.0_f64.sin() / s.cosh(),
        s.tanh(),
        0.0,
    ];
    assert!(
        distance(&end(&trajectory, "x"), &exact) <= 1e-12,
        "{:?}",
        (end(&trajectory, "x"), exact)
    );
    assert!(distance(&trajectory.history.switch_times(), &[0.5, 1.35]) <= 1e-12);
}

/// A non-unique start is reported with all its branches and never picked in silence.
#[test]
fn a_non_unique_start_names_its_branches() {
    let text = "model m { state x = 0; x' = sign(x); }\nsimulate s of m { horizon 1; }";
    let trajectory = run(text, "s");
    assert_eq!(trajectory.status, Status::NumericalFailure);
    let reason = trajectory.failure.unwrap().to_string();
    for branch in ["below(x)", "sliding(x)", "above(x)"] {
        assert!(reason.contains(branch), "{reason}");
    }
}

/// Energy of a block with Coulomb friction: 0.5 v^2 falls by the friction work exactly.
#[test]
fn friction_takes_its_work() {
    let text = "model m { param mu = 0.4; state q = 0; state v = 3; q' = v; v' = -mu*9.81*sign(v); }\n\
                simulate s of m { horizon 2; tolerance 1e-12; }";
    let trajectory = run(text, "s");
    let stop = 3.0 / (0.4 * 9.81);
    assert!(distance(&trajectory.history.switch_times(), &[stop]) <= 1e-12);
    assert!(distance(&end(&trajectory, "q"), &[3.0 * stop / 2.0]) <= 1e-12);
    assert!(distance(&end(&trajectory, "v"), &[0.0]) <= 1e-15);
}

/// x slides on x = y, where the kink of max(x, y) is too, until y = 2 at t = 2; then x stays at 2.
#[test]
fn a_state_slides_along_the_kink_of_another_surface() {
    let text = "
model m {
  state x = 0;
  state y = 1;
  x' = -sign(x - y) - sign(max(x, y) - 2);
  y' = 0.5;
}
simulate run of m { horizon 3; }";
    let trajectory = run(text, "run");
    assert_eq!(trajectory.status, Status::Solved);
    assert!(distance(&trajectory.history.switch_times(), &[2.0 / 3.0, 2.0]) <= 1e-12);
    assert!(distance(&end(&trajectory, "x"), &[2.0]) <= 1e-12);
    assert!(distance(&end(&trajectory, "y"), &[2.5]) <= 1e-12);
}
