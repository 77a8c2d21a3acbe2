//! Functions of time that are narrow: zero, or constant, wherever a long step looks.

use std::f64::consts::PI;

use nsd_tests::end;

use super::{check, codes, simulate};

/// Pulses between 0 and 10, and their areas.
fn pulses() -> Vec<(&'static str, f64)> {
    // Γ(9/8), DLMF 5.4.
    let gamma = 0.941_742_699_849_701_5;
    vec![
        ("exp(-((time - 5)/0.001)^2)", 1e-3 * PI.sqrt()),
        ("exp(-((time - 5)/0.001)^8)", 2e-3 * gamma),
        ("tanh((time - 3)/1e-4) - tanh((time - 3.001)/1e-4)", 2e-3),
        (
            "1/(1 + exp((3 - time)/0.01)) - 1/(1 + exp((3.02 - time)/0.01))",
            0.02,
        ),
        ("exp((time - 7)/0.02)/(1 + exp((time - 7)/0.02))^2", 0.02),
        (
            "1e3/(1 + ((time - 7)/1e-3)^2)",
            7e3_f64.atan() + 3e3_f64.atan(),
        ),
        // Layers at the ends.
        ("exp(1e4*(time - 10))", 1e-4),
        ("exp(-1e4*time)", 1e-4),
        ("exp(-((time - 10)/0.001)^2)", 0.5e-3 * PI.sqrt()),
    ]
}

/// The result is right, to the tolerance or else with a warning.
#[test]
fn pulses_are_not_passed_over() {
    for (pulse, area) in pulses() {
        for method in [
            "event",
            "fesd",
            "fesd { scheme = gauss(3); }",
            "adaptive",
            "smoothing",
        ] {
            for k in [5, 8] {
                let semicolon = if method.ends_with('}') { "" } else { ";" };
                let experiment =
                    format!("horizon 10; tolerance 1e-{k}; method {method}{semicolon}");
                let model = format!("state x = 1; x' = {pulse};");
                let trajectory = simulate(&model, &experiment);
                // Extrapolation may give up where rounding of terms that cancel is all there is to see.
                if method == "adaptive" && trajectory.failure.is_some() {
                    continue;
                }
                let failure = &trajectory.failure;
                assert!(failure.is_none(), "{model} {experiment}: {failure:?}");
                let error = (end(&trajectory, "x")[0] - 1.0 - area).abs();
                let is_covered = !trajectory.warnings.is_empty() && error <= 1e-2 * area;
                assert!(
                    error <= 10.0_f64.powi(-k) * (1.0 + area) || is_covered,
                    "{model} {experiment}: an error of {error:e} without a warning"
                );
            }
        }
    }
    // A state that is nothing but the pulse.
    let model = "state x = 0; x' = exp(-((time - 5)/0.001)^2);";
    let area = 1e-3 * PI.sqrt();
    check(model, "horizon 10;", "x", area, 1e-8 * area);
    let model = "state x = 0; x' = step(exp(-((time - 5)/0.001)^2) - 0.5);";
    let width = 2e-3 * 2.0_f64.ln().sqrt();
    check(model, "horizon 10;", "x", width, 1e-12);
}

/// A grid is taken as it is: it fails, warns, or is right, whatever its nodes meet.
#[test]
fn grids_that_miss_a_pulse_say_so() {
    for (pulse, area) in pulses() {
        for method in ["fesd", "timestepping"] {
            for steps in [1, 4, 10, 37, 100] {
                let model = format!("state x = 1; x' = {pulse};");
                let experiment = format!("horizon 10; method {method} {{ steps = {steps}; }}");
                let trajectory = simulate(&model, &experiment);
                let found = end(&trajectory, "x")[0];
                let error = ((found - 1.0 - area) / (1.0 + area)).abs();
                let is_known = trajectory.failure.is_some()
                    || !trajectory.warnings.is_empty()
                    || error <= 10.0 * trajectory.quality.error_estimate.unwrap_or(0.0) + 1e-14;
                assert!(is_known, "{model} {experiment}: {found}");
            }
        }
    }
    // Enough steps are no reason for a warning.
    let model = "state x = 0; x' = exp(-(time - 5)^2);";
    for method in ["fesd", "timestepping"] {
        let experiment = format!("horizon 10; method {method} {{ steps = 40; }}");
        let trajectory = check(model, &experiment, "x", PI.sqrt(), 1e-6);
        assert!(codes(&trajectory).is_empty());
    }
}

/// The expansion at the start knows nothing of the pulse.
#[test]
fn a_pulse_within_the_first_step_is_seen() {
    check(
        "state x = 1; x' = exp(-1000*(time - 0.5)^2);",
        "horizon 1;",
        "x",
        1.0 + (PI / 1000.0).sqrt(),
        1e-8,
    );
}
