//! `method smoothing` against closed forms of the smoothed systems, and the limit of small widths.

use std::f64::consts::PI;

use nsd_tests::{end, run};
use nsdc::report::{Status, Trajectory};

const EPSILON: f64 = 0.1;

fn smoothed(statements: &str, law: &str, horizon: f64) -> Trajectory {
    let text = format!(
        "model m {{ {statements} }} simulate run of m {{ horizon {horizon}; tolerance 1e-11; \
         method smoothing {{ epsilon = {EPSILON}; law = {law}; }} }}"
    );
    let found = run(&text, "run");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found
}

#[test]
fn tanh_is_followed_to_the_surface() {
    // sinh(x/ε) = sinh(1/ε) exp(-t/ε)
    let statements = "state x = 1; x' = -sign(x); output s = sign(x);";
    let found = smoothed(statements, "tanh", 1.2);
    let exact = EPSILON * ((1.0 / EPSILON).sinh() * (-1.2 / EPSILON).exp()).asinh();
    let x = end(&found, "x")[0];
    assert!((x - exact).abs() < 1e-10, "{x} {exact}");
    // What is recorded is smooth too.
    let s = end(&found, "s")[0];
    assert!((s - (x / EPSILON).tanh()).abs() < 1e-12, "{s}");
    assert!(found.history.events.is_empty());
    assert_eq!(found.setup.method.name, "smoothing");
    let codes: Vec<_> = found.warnings.iter().map(|w| w.code.as_str()).collect();
    assert_eq!(codes, ["W0707"]);
    assert!(
        found
            .quality
            .error_estimate
            .is_some_and(|error| error < 1e-10)
    );
}

#[test]
fn rational_has_tails() {
    // x' = -x/√(ε² + x²): √(ε² + x²) - ε ln((ε + √(ε² + x²))/x) falls by t.
    let found = smoothed("state x = 1; x' = -sign(x);", "rational", 1.1);
    let x = end(&found, "x")[0];
    let fallen = |x: f64| {
        let root = (EPSILON * EPSILON + x * x).sqrt();
        root - EPSILON * ((EPSILON + root) / x).ln()
    };
    assert!((fallen(1.0) - fallen(x) - 1.1).abs() < 1e-9, "{x}");
}

#[test]
fn polynomial_is_exact_outside_its_width() {
    let found = smoothed("state x = 1; x' = -sign(x);", "polynomial", 1.0);
    let times = found.history.switch_times();
    assert!(
        times.len() == 1 && (times[0] - 0.9).abs() < 1e-12,
        "{times:?}"
    );
    // Inside, t = 0.9 + ε ∫ dy/s(y) from x/ε to 1, by Simpson's rule.
    let s = |y: f64| (15.0 * y - 10.0 * y.powi(3) + 3.0 * y.powi(5)) / 8.0;
    let (n, low) = (2000, end(&found, "x")[0] / EPSILON);
    let h = (1.0 - low) / f64::from(n);
    let weight = |k: i32| match k {
        0 => 1.0,
        k if k == n => 1.0,
        k => 2.0 + 2.0 * f64::from(k % 2),
    };
    let sum: f64 = (0..=n).map(|k| weight(k) / s(low + f64::from(k) * h)).sum();
    let t = 0.9 + EPSILON * sum * h / 3.0;
    assert!((t - 1.0).abs() < 1e-9, "{t}");
}

#[test]
fn kinks_stay_and_may_be_inside_what_is_smoothed() {
    // With z = x + 1, then 1 - x: sinh(z/ε) grows like exp(t/ε) up to x = 0 and falls so from there.
    let found = smoothed("state x = -0.5; x' = -sign(abs(x) - 1);", "tanh", 1.7);
    let kink = EPSILON * ((1.0 / EPSILON).sinh() / (0.5 / EPSILON).sinh()).ln();
    let times = found.history.switch_times();
    assert!(
        times.len() == 1 && (times[0] - kink).abs() < 1e-11,
        "{times:?}"
    );
    let z = (1.0 / EPSILON).sinh() * (-(1.7 - kink) / EPSILON).exp();
    let exact = 1.0 - EPSILON * z.asinh();
    let x = end(&found, "x")[0];
    assert!((x - exact).abs() < 1e-9, "{x} {exact}");
}

#[test]
fn the_error_of_a_crossing_vanishes_with_the_width() {
    let error = |epsilon: f64, law: &str| {
        let text = format!(
            "model oscillator {{ param omega = 2*pi; state x[2] = [exp(-1), 0]; \
             let c = dot(x, x) - 1; \
             region inside where c < 0 {{ x' = [1, omega; -omega, 1]*x; }} \
             region outside where c > 0 {{ x' = [1, -omega; omega, 1]*x; }} }} \
             simulate run of oscillator {{ horizon pi/2; \
             method smoothing {{ epsilon = {epsilon}; law = {law}; }} }}"
        );
        let found = run(&text, "run");
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        let (radius, angle) = ((PI / 2.0 - 1.0).exp(), 2.0 * PI * (PI / 2.0 - 1.0));
        let x = end(&found, "x");
        (x[0] - radius * angle.cos()).hypot(x[1] - radius * angle.sin())
    };
    for law in ["tanh", "rational", "polynomial"] {
        let (coarse, fine) = (error(0.1, law), error(0.001, law));
        assert!(
            coarse > 1e-4 && fine < coarse / 50.0,
            "{law}: {coarse} {fine}"
        );
    }
}

#[test]
fn a_model_without_jumps_is_left_as_it_is() {
    let found = smoothed("state x = 1; x' = -abs(x - 0.5) - 0.5;", "tanh", 2.0);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    assert_eq!(found.history.events.len(), 1);
}

#[test]
fn a_law_may_be_a_function_of_the_file() {
    let run_with = |law: &str, statements: &str, horizon: f64| {
        let text = format!(
            "fn logistic(y) = 2/(1 + exp(-y)) - 1; fn root(y) = y/sqrt(1 + y^2); \
             model m {{ {statements} }} simulate run of m {{ horizon {horizon}; tolerance 1e-11; \
             method smoothing {{ epsilon = {EPSILON}; law = {law}; }} }}"
        );
        let found = run(&text, "run");
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        found
    };
    // s(y) = tanh(y/2): sinh(x/2ε) = sinh(1/2ε) exp(-t/2ε)
    let found = run_with("logistic", "state x = 1; x' = -sign(x);", 1.2);
    let width = 2.0 * EPSILON;
    let exact = width * ((1.0 / width).sinh() * (-1.2 / width).exp()).asinh();
    let x = end(&found, "x")[0];
    assert!((x - exact).abs() < 1e-10, "{x} {exact}");
    let shown = found
        .setup
        .method
        .options
        .iter()
        .find(|(name, _)| name == "law");
    let law = nsdc::report::MethodOption::Text("logistic".into());
    assert_eq!(shown.map(|(_, law)| law), Some(&law));
    // At rest 2/(1 + exp(-y)) - 1 = 1/2, so that x = ε ln 3.
    let found = run_with("logistic", "state x = 1; x' = 0.5 - sign(x);", 20.0);
    let x = end(&found, "x")[0];
    assert!((x - EPSILON * 3.0_f64.ln()).abs() < 1e-10, "{x}");
    // The same function as a built-in law gives the same run.
    let statements = "state x = 1; x' = 0.3*cos(time) - sign(x);";
    let (own, built_in) = (
        end(&run_with("root", statements, 2.0), "x")[0],
        end(&run_with("rational", statements, 2.0), "x")[0],
    );
    assert!((own - built_in).abs() < 1e-11, "{own} {built_in}");
}
