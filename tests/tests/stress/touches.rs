//! Surfaces that are touched as far as can be told.

use std::f64::consts::PI;

use nsd_tests::end;
use nsdc::report::Trajectory;

use super::{codes, honest, simulate};

/// A run that cannot tell says so; where one of both runs crosses, they do not agree.
fn is_in_doubt(trajectory: &Trajectory, model: &str) {
    let codes = codes(trajectory);
    assert!(
        codes == ["W0710"] || codes == ["W0701"],
        "{model}: {codes:?}"
    );
}

/// x = 1 + sin t touches zero.
#[test]
fn a_touch_is_told_where_it_matters() {
    // Behind the surface x falls to the end.
    for tolerance in [4, 8, 11] {
        let experiment = format!("horizon 6; tolerance 1e-{tolerance};");
        let falls = "state x = 1; x' = if x > 0 then cos(time) else -10;";
        is_in_doubt(&simulate(falls, &experiment), falls);
    }
    // The clock is exact, but for rounding.
    let clock = "state x = 0; x' = if 1 + sin(time) > 0 then 0 else 1;";
    is_in_doubt(&simulate(clock, "horizon 6;"), clock);
    // Behind the surface x rises, its field is the same, or the run is over.
    let exact = 1.0 + 6.0_f64.sin();
    for (field, horizon) in [
        ("if x > 0 then cos(time) else 10", 6.0),
        ("cos(time) + 2*max(-x, 0)", 6.0),
        ("if x > 0.001 then cos(time) else 10", 4.5),
    ] {
        let model = format!("state x = 1; x' = {field};");
        let trajectory = simulate(&model, &format!("horizon {horizon};"));
        assert!(
            trajectory.warnings.is_empty(),
            "{model}: {:?}",
            trajectory.warnings
        );
        let end = end(&trajectory, "x")[0];
        assert!(
            horizon < 6.0 || (end - exact).abs() < 1e-10,
            "{model}: {end}"
        );
    }
}

/// x = 1 + d + sin t comes down to the threshold of a relay that holds what it has seen.
#[test]
fn a_touch_at_a_relay_is_told() {
    let model = |start: f64| {
        format!(
            "state x = {start}; state y = 0; switch h = hysteresis(x, on = 0, off = 5, start = 0); \
             x' = cos(time); y' = h;"
        )
    };
    for tolerance in [4, 8, 11] {
        let experiment = format!("horizon 6; tolerance 1e-{tolerance};");
        let touches = model(1.0);
        is_in_doubt(&simulate(&touches, &experiment), &touches);
    }
    let clear = simulate(&model(1.01), "horizon 6;");
    assert!(clear.warnings.is_empty(), "{:?}", clear.warnings);
    assert_eq!(end(&clear, "y"), [0.0]);
    let switched = simulate(&model(0.99), "horizon 6;");
    assert!(switched.warnings.is_empty(), "{:?}", switched.warnings);
    let exact = 6.0 - PI - 0.99_f64.asin();
    assert!((end(&switched, "y")[0] - exact).abs() < 1e-8);
}

/// x = c + sin t by a stiff equation, in implicit steps, above zero or below for a while.
#[test]
fn a_touch_in_an_implicit_step_is_told() {
    let model = |c: f64| {
        format!(
            "state x = {c}; state y = 1; \
             x' = cos(time) - 1e5*(x - {c} - sin(time)); y' = if x > 0 then 0 else 1;"
        )
    };
    for tolerance in [5, 8, 10] {
        let experiment = format!("horizon 6; tolerance 1e-{tolerance};");
        let trajectory = simulate(&model(1.0), &experiment);
        let options = &trajectory.setup.method.options;
        assert!(options.iter().any(|(name, _)| name == "implicit_order"));
        if tolerance < 10 {
            is_in_doubt(&trajectory, &model(1.0));
        }
        // Where there is no doubt the result is right.
        for distance in [0.0, 1e-2, 1e-6, 1e-9, 1e-11, 1e-12] {
            for c in [1.0 + distance, 1.0 - distance] {
                let below = if c < 1.0 { 2.0 * f64::acos(c) } else { 0.0 };
                honest(&model(c), &experiment, "y", 1.0 + below);
            }
        }
        let clear = simulate(&model(1.01), &experiment);
        assert!(clear.warnings.is_empty(), "{:?}", clear.warnings);
    }
}

/// An oscillation comes to a surface that is below its peaks by less than a run is accurate, and by less than the more
/// accurate run beside it is, so that both may go the same wrong way. Both states of ψ have their errors.
#[test]
fn a_touch_that_two_runs_do_not_see_is_told() {
    for tolerance in [2, 5] {
        for periods in [2, 5] {
            for k in 0..40 {
                let depth = 10.0_f64.powf(-1.0 - f64::from(tolerance) - 0.15 * f64::from(k));
                let surface = 2.0 * (1.0 - depth);
                let model = format!(
                    "state x = 0; state w = 0; state v = 1; state y = 1; \
                     x' = v; w' = -v; v' = -x; y' = step(x - w - {surface:?});"
                );
                let experiment = format!("horizon {periods}*2*pi; tolerance 1e-{tolerance};");
                let above = 2.0 * f64::from(periods) * f64::acos(1.0 - depth);
                honest(&model, &experiment, "y", 1.0 + above);
            }
        }
    }
}

/// ψ that vanish together wherever they do are one surface, and nothing lies between them.
#[test]
fn two_names_of_one_surface_are_met_at_once() {
    let names = [
        ("x^3 - 1", "log(x)"),
        ("x - 1", "(x - 1)*exp(y/1e7)"),
        ("sin(x) - sin(1)", "exp(2*x) - exp(2)"),
    ];
    for (a, b) in names {
        let model = format!(
            "state x = 0.3; state y = 0; x' = 1; y' = (if {a} > 0 then 1e6 else -1) + (if {b} > 0 then -1e6 else 1);"
        );
        for method in ["event", "fesd"] {
            let found = simulate(&model, &format!("horizon 1.5; method {method};"));
            // Elements tell what may lie between.
            let is_told = method == "fesd" && codes(&found) == ["W0710"];
            assert!(
                is_told || codes(&found).is_empty(),
                "{model}: {:?}",
                codes(&found)
            );
            assert!(end(&found, "y")[0].abs() < 1e-8, "{model} by {method}");
        }
    }
    // Another surface that is met at once has something between.
    let model = "state x = 0.3; state z = 0; state y = 0; x' = 1; z' = 1;
        y' = (if x^3 > 1 then 1e11 else -1) + (if z > 0.7 then -1e11 else 1);";
    let found = simulate(model, "horizon 2;");
    is_in_doubt(&found, model);
}
