//! `method adaptive`: exact where nothing switches, honest about what it does where something does.

use std::f64::consts::PI;

use nsd_tests::{end, run};
use nsdc::report::{Status, Trajectory};

fn adaptive(statements: &str, settings: &str) -> Trajectory {
    let text =
        format!("model m {{ {statements} }} simulate run of m {{ {settings} method adaptive; }}");
    run(&text, "run")
}

fn codes(found: &Trajectory) -> Vec<&str> {
    found.warnings.iter().map(|w| w.code.as_str()).collect()
}

#[test]
fn smooth_models_are_as_accurate_as_asked_at_any_instant() {
    let statements = "param k = 2; state x = 1; state y = 0; x' = -k*y; y' = k*x + 0*time;";
    let found = adaptive(
        statements,
        "horizon 5; tolerance 1e-10; output x, y every 0.1;",
    );
    assert_eq!(found.status, Status::Solved);
    assert!(codes(&found).is_empty() && found.quality.error_estimate.is_some());
    assert_eq!(found.samples.time.len(), 51);
    for (k, t) in found.samples.time.iter().enumerate() {
        let (x, y) = (
            found.samples.states[0].at(k)[0],
            found.samples.states[1].at(k)[0],
        );
        let error = (x - (2.0 * t).cos()).hypot(y - (2.0 * t).sin());
        assert!(error < 1e-10, "at {t}: {error:e}");
    }
}

#[test]
fn crossings_are_no_events_and_modes_follow_the_points() {
    let statements = "param omega = 2*pi; state x[2] = [exp(-1), 0]; let c = dot(x, x) - 1; \
        region inside where c < 0 { x' = [1, omega; -omega, 1]*x; } \
        region outside where c > 0 { x' = [1, -omega; omega, 1]*x; }";
    let found = adaptive(statements, "horizon pi/2; tolerance 1e-6;");
    assert_eq!(found.status, Status::Solved);
    let (radius, angle) = ((PI / 2.0 - 1.0).exp(), 2.0 * PI * (PI / 2.0 - 1.0));
    let x = end(&found, "x");
    let error = (x[0] - radius * angle.cos()).hypot(x[1] - radius * angle.sin());
    assert!(error < 1e-4, "{error:e}");
    assert!(found.history.events.is_empty());
    assert!(codes(&found).contains(&"W0708"), "{:?}", codes(&found));
    let modes: Vec<&str> = found
        .history
        .modes
        .iter()
        .map(|m| m.mode.as_str())
        .collect();
    assert_eq!(modes, ["inside", "outside"]);
    assert!(
        (found.history.modes[0].to - 1.0).abs() < 1e-3,
        "{}",
        found.history.modes[0].to
    );
    assert_eq!(found.setup.method.name, "adaptive");
}

#[test]
fn sliding_ends_at_the_limit_of_steps_near_the_surface() {
    let found = adaptive("state x = 1; x' = if x > 0 then -2 else 1;", "horizon 10;");
    assert_eq!(found.status, Status::IterationLimit);
    assert!(found.samples.time.last().is_some_and(|t| *t > 0.5));
    assert!(end(&found, "x")[0].abs() < 1e-6, "{:?}", end(&found, "x"));
}

#[test]
fn switches_inside_switching_functions_are_settled_in_order() {
    // x rises to 1 through the kink of |x|: x' = 3 below 1, then 0.5.
    let statements = "state x = -1; x' = 1.75 - 1.25*sign(abs(x) + max(x, 0) - 2);";
    let found = adaptive(statements, "horizon 1; tolerance 1e-6; ");
    assert_eq!(found.status, Status::Solved);
    let exact = 1.0 + 0.5 * (1.0 - 2.0 / 3.0);
    let x = end(&found, "x")[0];
    assert!((x - exact).abs() < 1e-5, "{x} {exact}");
}

/// Steps move a state by less than its last digits there, and all steps together do not.
#[test]
fn states_far_from_zero_move() {
    for offset in [0.0, 1e6, 1e9, 1e12] {
        let model = format!(
            "param B = {offset:e}; state x = B; state y = 0; x' = 1; y' = if x > B + 1 then 1 else 0;"
        );
        let found = adaptive(&model, "horizon 2;");
        assert_eq!(found.status, Status::Solved, "{offset:e}");
        let x = end(&found, "x")[0];
        assert!(
            (x - (offset + 2.0)).abs() <= f64::EPSILON * (offset + 2.0),
            "{offset:e}: {x}"
        );
        let y = end(&found, "y")[0];
        let known = 1e-8 + f64::EPSILON * offset;
        assert!((y - 1.0).abs() <= known, "{offset:e}: {y}");
    }
}

/// The rates there are as far off as the rounding of that state moves them, and the estimate says so.
#[test]
fn estimates_know_what_rounding_of_states_does_to_rates() {
    for offset in [1e9, 1e12, 1e15] {
        let model = format!(
            "param B = {offset:e}; state x = B; state y = 0; x' = 1; y' = if x > B + 1 then 1 else 0;"
        );
        let found = adaptive(&model, "horizon 2;");
        let error = (end(&found, "y")[0] - 1.0).abs();
        let estimate = found.quality.error_estimate.expect("a second run was made");
        assert!(
            error <= 4.0 * estimate,
            "{offset:e}: {error:e} {estimate:e}"
        );
        assert!(codes(&found).contains(&"W0702"), "{offset:e}");
    }
}

/// A state that starts at zero, on its surface, has the size that its rate gives it.
#[test]
fn a_start_on_a_sliding_surface_ends_at_the_limit_of_steps() {
    let found = adaptive("state x = 0; x' = -sign(x);", "horizon 1;");
    assert_eq!(found.status, Status::IterationLimit);
    assert!(end(&found, "x")[0].abs() <= 1e-9);
}
