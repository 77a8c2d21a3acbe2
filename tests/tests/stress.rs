//! Hard cases with known answers: what is easy to get wrong without noticing.

mod pulses;
mod touches;

use std::f64::consts::PI;

use nsd_tests::stress::held_switches;
use nsd_tests::{end, run};
use nsdc::report::{Status, Trajectory};

fn simulate(model: &str, experiment: &str) -> Trajectory {
    let text = format!("model m {{ {model} }}\nsimulate s of m {{ {experiment} }}");
    run(&text, "s")
}

/// The run ends well, and a state ends where it should, as does its time of switching.
fn check(model: &str, experiment: &str, state: &str, exact: f64, tolerance: f64) -> Trajectory {
    let trajectory = simulate(model, experiment);
    assert!(trajectory.failure.is_none(), "{model}");
    assert_eq!(trajectory.status, Status::Solved, "{model}");
    let found = end(&trajectory, state)[0];
    assert!(
        (found - exact).abs() <= tolerance,
        "{model}: {found} instead of {exact}"
    );
    trajectory
}

/// The run ends early, for a reason with these words. Returns when, and the reason.
fn refused(model: &str, experiment: &str, words: &[&str]) -> (f64, String) {
    let trajectory = simulate(model, experiment);
    assert_eq!(trajectory.status, Status::NumericalFailure, "{model}");
    let reason = trajectory.failure.map(|f| f.to_string());
    let reason = reason.unwrap_or_default();
    for word in words {
        assert!(reason.contains(word), "{model}: {reason}");
    }
    (
        trajectory.samples.time[trajectory.samples.time.len() - 1],
        reason,
    )
}

/// What rounding does to the times of both events is what remains.
#[test]
fn a_field_that_is_huge_for_an_instant() {
    for distance in [1e-11, 1e-12, 1e-13] {
        let relays = format!(
            "state x = 1; state z = 1; x' = -1; z' = (sign(x) - sign(x + {distance:e}))/{distance:e};"
        );
        let clock = format!(
            "state z = 1; z' = -2*(step(time - 1) - step(time - 1 - {distance:e}))/{distance:e};"
        );
        for model in [relays, clock] {
            check(
                &model,
                "horizon 2;",
                "z",
                -1.0,
                16.0 * f64::EPSILON / distance,
            );
        }
    }
}

/// The states are polynomials, only the switching functions vary quickly.
#[test]
fn switching_functions_limit_the_step_where_the_states_do_not() {
    // cos(50 t) > 0.9 for half a hump, seven whole ones, and the begin of the ninth.
    let width = 0.9_f64.acos() / 50.0;
    let above = 15.0 * width + (1.0 - (16.0 * PI / 50.0 - width));
    let x = 2.0 * above - 1.0;
    for k in [3, 8, 12] {
        let experiment = format!("horizon 1; tolerance 1e-{k};");
        let model = "state x = 0; x' = sign(cos(50*time) - 0.9);";
        let trajectory = check(model, &experiment, "x", x, 1e-12);
        assert_eq!(trajectory.history.switch_times().len(), 16);
    }
    let width = (2.0_f64.ln() / 1000.0).sqrt();
    check(
        "state x = 0; x' = step(exp(-1000*(time - 0.5)^2) - 0.5);",
        "horizon 1;",
        "x",
        2.0 * width,
        1e-12,
    );
    check(
        "state x = 0; state y = 0; y' = 1; x' = step(1/(1 + 100*(y - 0.5)^2) - 0.5);",
        "horizon 1;",
        "x",
        0.2,
        1e-12,
    );
}

#[test]
fn a_thousand_periods_of_a_square_wave() {
    let end = 2000.0 * PI;
    let experiment = format!("horizon {end:.12};");
    let trajectory = check(
        "state x = 0; x' = sign(sin(time));",
        &experiment,
        "x",
        0.0,
        1e-8,
    );
    let times = trajectory.history.switch_times();
    for (k, t) in times.iter().enumerate() {
        let exact = PI * (k as f64 + 1.0);
        assert!(
            (t - exact).abs() <= 1e-15 * exact + 1e-13,
            "{t} and {exact}"
        );
    }
}

#[test]
fn series_whose_last_terms_vanish() {
    check(
        "state x = 0; x' = time^60;",
        "horizon 1;",
        "x",
        1.0 / 61.0,
        1e-9,
    );
    check(
        "state x = 0; x' = 5*time^4*exp(time^5);",
        "horizon 1.2; tolerance 1e-12;",
        "x",
        1.2_f64.powi(5).exp() - 1.0,
        1e-11,
    );
}

/// All branches start with the same velocity and part later.
#[test]
fn branches_that_start_alike_are_all_named() {
    let words = ["above(x)", "below(x)"];
    refused("state x = 0; x' = time*sign(x);", "horizon 1;", &words);
    let model = "state x = 0; state y = 0; y' = 1; x' = y*sign(x);";
    refused(model, "horizon 1;", &words);
    // A large velocity elsewhere does not hide the small difference.
    let model = "state x = 0; state y = 0; y' = 1e12; x' = sign(x);";
    refused(model, "horizon 1;", &["above(x)", "below(x)", "sliding(x)"]);
}

/// Attracting before, repelling after: both rates vanish at t = 1.
#[test]
fn a_two_fold_is_not_passed_in_silence() {
    let model = "state x = 0; state y = -1; y' = 1; x' = if x > 0 then y else -2*y;";
    let (t, _) = refused(model, "horizon 2;", &["singular"]);
    assert!((t - 1.0).abs() <= 1e-9, "{t}");
}

#[test]
fn sliding_rates_with_products_have_all_their_zeros() {
    // x' = 0 and y' = 0 have the two solutions α = (1/4, 3/4) and (3/4, 1/4) on a hyperbola and a line.
    let model = "state x = 0; state y = 0; state z = 0; \
                 x' = 16*step(x)*step(y) - 3; y' = step(x) + step(y) - 1; z' = step(x);";
    let (_, reason) = refused(model, "horizon 1;", &[]);
    assert_eq!(
        reason.matches("sliding(x), sliding(y)").count(),
        2,
        "{reason}"
    );
}

#[test]
fn states_of_any_size_slide_together() {
    let model = "state x = 1e-12; state y = 1e9; \
                 x' = -2e-12*sign(x - 0.5e-12) + 1e-22*y; y' = -3e9*sign(y - 2e8) - 1e20*x;";
    check(model, "horizon 1;", "x", 0.5e-12, 1e-24);
    check(model, "horizon 1;", "y", 2e8, 1e-3);
}

/// The same model in other units of states and time has the same events.
#[test]
fn units_do_not_matter() {
    let times = |s: f64, t: f64| {
        let model = format!(
            "state x = {s:e}; state v = 0; x' = v/{t:e}; \
             v' = (-x - 0.15*{s:e}*sign(v - {s:e}*0.3*sin(2*time/{t:e})))/{t:e};"
        );
        let trajectory = simulate(&model, &format!("horizon {:e}; tolerance 1e-10;", 20.0 * t));
        assert!(trajectory.failure.is_none());
        let times = trajectory.history.switch_times();
        times.iter().map(|time| time / t).collect::<Vec<_>>()
    };
    let reference = times(1.0, 1.0);
    assert!(reference.len() > 5);
    for (s, t) in [
        (1e-12, 1.0),
        (1e9, 1.0),
        (1.0, 1e-6),
        (1.0, 1e7),
        (1e8, 1e-9),
    ] {
        let found = times(s, t);
        assert_eq!(found.len(), reference.len(), "{s} {t}");
        for (a, b) in found.iter().zip(&reference) {
            assert!((a - b).abs() <= 1e-8, "{a} and {b} in units {s} {t}");
        }
    }
}

#[test]
fn a_blow_up_ends_where_it_happens() {
    for (model, at) in [
        ("state x = 1; x' = x^2;", 1.0),
        ("state x = 1; x' = -1/x;", 0.5),
    ] {
        let (t, _) = refused(model, "horizon 2;", &["finite"]);
        assert!((t - at).abs() <= 1e-8, "{t} instead of {at}");
    }
}

/// All masses come to rest, one joint after the other, often with rates that are rounding only.
#[test]
fn forty_masses_rub_against_each_other() {
    let n = 40;
    let mut model = String::new();
    for i in 0..n {
        let v = 2.0 * f64::from(i).sin();
        model += &format!("state q{i} = 0; state v{i} = {v:.6}; q{i}' = v{i};");
        let (before, rub) = match i {
            0 => ("q0".to_owned(), "v0".to_owned()),
            _ => (format!("q{i} - q{}", i - 1), format!("v{i} - v{}", i - 1)),
        };
        let after = match i + 1 {
            j if j == n => String::new(),
            j => format!(" + (q{j} - q{i}) + 0.3*sign(v{j} - v{i})"),
        };
        model += &format!("v{i}' = -({before}) - 0.3*sign({rub}){after};");
    }
    let trajectory = simulate(&model, "horizon 20; tolerance 1e-8;");
    assert_eq!(trajectory.status, Status::Solved);
    assert!(trajectory.quality.error_estimate.unwrap() < 1e-10);
    assert!(trajectory.warnings.is_empty());
    for i in 0..10 {
        assert!(end(&trajectory, &format!("v{i}"))[0].abs() < 1e-14);
    }
}

/// The sum of twenty thousand steps is the time: rounding in it would be an error of phase.
#[test]
fn ten_thousand_periods_keep_their_phase() {
    let model = "state x = 1; state v = 0; x' = v; v' = -x;";
    let experiment = "horizon 20000*pi; tolerance 1e-10;";
    let trajectory = check(model, experiment, "x", 1.0, 1e-10);
    assert!(end(&trajectory, "v")[0].abs() <= 1e-10);
}

/// Slides on x = 1/2 until the other branch of `max` is positive whatever x does.
#[test]
fn a_surface_with_a_kink_is_left_where_its_branch_changes() {
    let model = "state x = 0; x' = 1 - 2*step(max(x - 0.5, 0.2*time - 0.3));";
    let trajectory = check(model, "horizon 4;", "x", -2.0, 1e-13);
    let times = trajectory.history.switch_times();
    for (t, exact) in times.iter().zip([0.25, 0.5, 1.5]) {
        assert!((t - exact).abs() <= 1e-14, "{t} and {exact}");
    }
}

/// α touches its bounds at multiples of π, of 8 coupled switches at once, and turns back.
#[test]
fn touching_the_bounds_of_sliding_is_no_event() {
    let mut model = "state x[8] = zeros(8);".to_owned();
    for i in 0..8 {
        let (i, next, far) = (i + 1, (i + 1) % 8 + 1, (i + 3) % 8 + 1);
        model += &format!(
            "x[{i}]' = 1 + cos(time) - 2*step(x[{i}]) + 0.1*(step(x[{next}]) - step(x[{far}]));"
        );
    }
    let trajectory = check(&model, "horizon 20;", "x", 0.0, 1e-14);
    assert!(trajectory.history.events.is_empty());
    assert!(trajectory.warnings.is_empty());
    // The same at a surface: (t - 1)⁴. Rounding might take x below for 2 (1e-16)^¼.
    let model = "state x = 1; state y = 0; x' = 4*(time - 1)^3; y' = step(x);";
    let trajectory = check(model, "horizon 2;", "y", 2.0, 1e-13);
    assert!(trajectory.history.events.is_empty());
    assert_eq!(codes(&trajectory), ["W0710"]);
}

fn codes(trajectory: &Trajectory) -> Vec<&str> {
    let warnings = trajectory.warnings.iter();
    warnings.map(|warning| warning.code.as_str()).collect()
}

/// The state ends where it should, to the tolerance asked; or else the run says that it might not.
fn honest(model: &str, experiment: &str, state: &str, exact: f64) {
    let trajectory = simulate(model, experiment);
    if trajectory.failure.is_some() || !trajectory.warnings.is_empty() {
        return;
    }
    let tolerance = experiment.split("tolerance 1e").nth(1);
    let tolerance = tolerance.and_then(|rest| rest.split(';').next()?.parse().ok());
    let tolerance = 10.0_f64.powi(tolerance.unwrap_or(-8));
    let found = end(&trajectory, state)[0];
    let estimate = trajectory.quality.error_estimate.unwrap_or(0.0);
    let error = ((found - exact) / exact).abs();
    assert!(error <= tolerance, "{model}: {found} instead of {exact}");
    assert!(
        error <= 10.0 * estimate + 1e-14,
        "{model}: error {error:e}, estimate {estimate:e}"
    );
}

#[test]
fn surfaces_that_are_almost_the_same() {
    for k in 2..=14 {
        let angle = 10.0_f64.powi(-k);
        // On x = 0, y falls until the second surface is met there too.
        let model = format!(
            "state x = 0.5; state y = 1; x' = 0.3 - sign(x); y' = 0.2 - sign(x + {angle:e}*y);"
        );
        if k <= 11 {
            check(&model, "horizon 1;", "y", 0.2, 1e-14);
            check(&model, "horizon 2;", "y", 0.0, 1e-14);
        } else {
            honest(&model, "horizon 1;", "y", 0.2);
        }
    }
}

/// ψ = (t - 1)³ + s (t - 1) is crossed at the rate s.
#[test]
fn crossings_at_small_angles() {
    for k in [2, 4, 6, 8, 9, 10, 12, 14] {
        let rate = 10.0_f64.powi(-k);
        let model = format!(
            "state y = {:e}; state w = 0; y' = 3*(time - 1)^2 + {rate:e}; w' = step(y);",
            -1.0 - rate
        );
        let experiment = "horizon 2;";
        if k <= 8 {
            check(&model, experiment, "w", 1.0, 1e-8);
        } else {
            honest(&model, experiment, "w", 1.0);
        }
    }
}

/// ψ = (t - 1)² - d is negative for 2 √d.
#[test]
fn short_visits_to_the_other_side() {
    for k in 2..=16 {
        let depth = 10.0_f64.powi(-k);
        let start = 1.0 - depth;
        let model = format!("state y = {start}; state w = 0; y' = 2*(time - 1); w' = step(y);");
        let exact = 2.0 - 2.0 * (1.0 - start).sqrt();
        honest(&model, "horizon 2;", "w", exact);
        let trajectory = simulate(&model, "horizon 2;");
        let error = (end(&trajectory, "w")[0] / exact - 1.0).abs();
        let estimate = trajectory.quality.error_estimate.unwrap_or(0.0);
        assert!(
            error <= 10.0 * estimate,
            "depth {depth:e}: error {error:e}, estimate {estimate:e}"
        );
    }
}

/// x = 1 + d + sin t passes the surface at the distance d, or meets it and falls.
#[test]
fn passing_by_and_meeting() {
    for k in [2, 4, 6, 8, 10, 12] {
        for tolerance in [4, 8, 11] {
            let distance = 10.0_f64.powi(-k);
            let experiment = format!("horizon 6; tolerance 1e-{tolerance};");
            let model =
                |start: f64| format!("state x = {start}; x' = if x > 0 then cos(time) else -10;");
            let (above, below) = (1.0 + distance, 1.0 - distance);
            honest(&model(above), &experiment, "x", above + 6.0_f64.sin());
            let meets = PI + below.asin();
            honest(&model(below), &experiment, "x", -10.0 * (6.0 - meets));
        }
    }
}

/// To rounding, where the families of `tests/src/stress/` ask for the tolerance.
#[test]
fn ten_surfaces_at_once() {
    for n in [3, 6, 7, 8, 10] {
        let (model, exact) = held_switches(n);
        let trajectory = check(&model, "horizon 3;", "y", exact, 1e-14);
        assert!(trajectory.history.events.is_empty() && trajectory.warnings.is_empty());
    }
}

/// Parabolas between crossings, 4 √2 for a period.
#[test]
fn five_thousand_crossings() {
    let end = 10_000.0 * 2.0_f64.sqrt();
    let model = "state x = 1; state v = 0; x' = v; v' = -sign(x);";
    let trajectory = check(model, &format!("horizon {end};"), "x", 1.0, 1e-8);
    assert_eq!(trajectory.history.switch_times().len(), 5000);
}
