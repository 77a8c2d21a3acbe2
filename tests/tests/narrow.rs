//! Functions of states that are narrow beside the steps of a run, where neither series nor probes see them.

use std::f64::consts::PI;

use nsd_tests::{end, run};
use nsdc::report::Status;

/// y at the end of a run over a horizon.
fn y(model: &str, experiment: &str) -> f64 {
    let text = format!("model m {{ {model} }}\nsimulate run of m {{ {experiment} }}");
    let found = run(&text, "run");
    assert_eq!(found.status, Status::Solved, "{model}: {:?}", found.failure);
    end(&found, "y")[0]
}

fn close(found: f64, exact: f64, within: f64) {
    let error = (found - exact).abs();
    assert!(error <= within * exact.abs(), "{found} instead of {exact}");
}

#[test]
fn a_window_of_a_state_opens_and_closes() {
    let width = 2e-3 * 2.0_f64.ln().sqrt();
    let model = "state s = 0; state y = 0; s' = 1;
        y' = if exp(-((s - 70.123)/0.001)^2) > 0.5 then 1 else 0;";
    close(y(model, "horizon 100;"), width, 1e-7);
}

/// A ball that falls from 1 past 0.6, with a contact that slips in a plane far below it.
#[test]
fn a_window_is_passed_in_flight() {
    let model = "state q[3] = [0, 0, 1]; state v[3] = [1, 0, 0]; state y = 0; q' = v;
        mechanics q, v { mass = 1; force = [0, 0, -10];
          contact floor { gap = q[3]; restitution = 0.5; friction = 0.2; slip = v[1..2]; } }
        y' = if exp(-((q[3] - 0.6)/1e-3)^2) > 0.5 then 1 else 0;";
    let half = 1e-3 * 2.0_f64.ln().sqrt();
    let fallen = |height: f64| (height / 5.0).sqrt();
    let exact = fallen(0.4 + half) - fallen(0.4 - half);
    close(y(model, "horizon 0.4;"), exact, 1e-7);
}

#[test]
fn a_force_acts_on_what_passes_by() {
    let gauss = "exp(-((s - 70.123)/0.001)^2)/0.001";
    let model = format!("state s = 0; state y = 0; s' = 1; y' = {gauss};");
    close(y(&model, "horizon 100;"), PI.sqrt(), 1e-8);
    // With a fast state beside it, whose modes are stiff.
    let model = format!(
        "state s = 0; state z = 0; state y = 0; s' = 1; z' = 1e6*(cos(s) - z); y' = {gauss};"
    );
    close(y(&model, "horizon 100;"), PI.sqrt(), 1e-7);
    // Three passages of cos t through 0.123 in 10, each with the area √π/|s'|.
    let model = "state s = 1; state v = 0; state y = 0; s' = v; v' = -s;
        y' = exp(-((s - 0.123)/1e-5)^2)/1e-5;";
    let exact = 3.0 * PI.sqrt() / (1.0 - 0.123_f64.powi(2)).sqrt();
    close(y(model, "horizon 10;"), exact, 1e-7);
    // A Lorentz curve, with its tails.
    let model = "state s = 0; state y = 0; s' = 1; y' = 1e-3/((s - 70.123)^2 + 1e-6);";
    let exact = 70.123e3_f64.atan() + 29.877e3_f64.atan();
    close(y(model, "horizon 100;"), exact, 1e-6);
}

/// The surface that holds x has a bump that is too steep to follow: x leaves it and comes back.
#[test]
fn a_surface_bends_for_an_instant() {
    let model = "state x = 0; state s = 0; state y = 0; s' = 1;
        x' = -2*sign(x - 0.1*exp(-((s - 70.123)/0.001)^2)); y' = x;";
    let found = y(model, "horizon 100;");
    // x climbs with slope 2 from where it leaves until the bump is over, 2e-3 at most for a few widths, and falls back.
    assert!(found > 1e-6 && found < 1e-4, "{found}");
}

/// High powers are bumps, however small their base is between them: ∫ cosᵖ over one of them is √π Γ((p + 1)/2)/Γ(p/2 + 1),
/// by mpmath in 25 digits.
#[test]
fn high_powers_are_not_passed_over() {
    let even = |power: f64| match power {
        20_000.0 => 0.017_724_316_953_708_613,
        _ => 0.007_926_634_778_600_305,
    };
    // All of those whose middle lies within the horizon, with their tails.
    for (rate, horizon, exact) in [
        ("cos(s - 70)^20000", 100.0, 32.0 * even(2e4)),
        ("cos(s + 1)^20000", 100.0, 32.0 * even(2e4)),
        ("sin(s)^100000", 9.0, 3.0 * even(1e5)),
        // cos²(s/2) to this power.
        ("((1 + cos(s - 70))/2)^10000", 100.0, 16.0 * 2.0 * even(2e4)),
    ] {
        let model = format!("state s = 0; state y = 0; s' = 1; y' = {rate};");
        close(y(&model, &format!("horizon {horizon:?};")), exact, 1e-7);
    }
}

/// Off the bump these overflow, and so do their series: a step without one passes over nothing either. The integral of
/// (1 + u²)⁻²⁰⁰⁰⁰ is √π Γ(19999.5)/Γ(20000), by mpmath in 25 digits.
#[test]
fn what_overflows_off_a_bump_is_not_passed_over() {
    let power = 0.012_533_376_375_675_608;
    for (rate, exact) in [
        ("1/cosh(1000*(s - 70))", 1e-3 * PI),
        ("(1 + (s - 70)^2)^(-20000)", power),
        ("(1/(1 + (s - 70)^2))^20000", power),
        ("1/(1 + (s - 70)^2)^20000", power),
        ("1/(exp(1000*(s - 70)) + exp(1000*(70 - s)))", 5e-4 * PI),
    ] {
        let model = format!("state s = 0; state y = 0; s' = 1; y' = {rate};");
        close(y(&model, "horizon 100;"), exact, 1e-8);
    }
}

/// The series of what is divided by it are zero, so that steps are as long as the others allow.
#[test]
fn a_divisor_that_overflows_costs_no_steps() {
    let logistic = "state s = 0.1; state y = 0; s' = s*(1 - s/10);";
    for rate in ["1/cosh(1000*(s - 7))", "(1 + 100*(s - 7)^2)^(-2000)"] {
        let text =
            format!("model m {{ {logistic} y' = {rate}; }}\nsimulate run of m {{ horizon 4; }}");
        let found = run(&text, "run");
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        assert_eq!(end(&found, "y"), [0.0]);
        assert!(
            found.quality.stats.steps < 20,
            "{} steps",
            found.quality.stats.steps
        );
    }
}

/// A step off a root, which has no series of any state, passes over no bump of another one.
#[test]
fn a_step_off_a_root_passes_over_nothing() {
    let model = "state s = 0; state y = 0; state z = 1; s' = 1; z' = 1e-14*sqrt(time);
        y' = exp(-((s - 70.123)/0.001)^2)/0.001;";
    close(y(model, "horizon 100;"), PI.sqrt(), 1e-7);
}

/// Where ψ is steep, its terms say nothing of its size: a window of 1.4e-6 behind such a place.
#[test]
fn a_steep_window_is_not_stepped_over() {
    let width = 3.883_624_206_066_842e-5;
    let half = width * (2_f64.ln() / 2000.0).exp_m1().sqrt();
    let model = format!(
        "state s = 0; state y = 0; s' = 1;
         y' = if (1 + ((s - 5.3991365648138725)/{width:?})^2)^(-2000) > 0.5 then 1/{width:?} else 0;"
    );
    for tolerance in ["1e-3", "1e-4", "1e-6", "1e-8"] {
        let experiment = format!("horizon 10; tolerance {tolerance};");
        close(y(&model, &experiment), 2.0 * half / width, 1e-8);
    }
}

/// Methods that do not look for it themselves, with a horizon of 100.
const OTHERS: [&str; 4] = [
    "fesd;",
    "fesd { steps = 50; }",
    "adaptive;",
    "timestepping { steps = 200; }",
];

/// The spans of W0719 in a run by a method.
fn passed_over(model: &str, method: &str) -> Vec<String> {
    let text =
        format!("model m {{ {model} }}\nsimulate run of m {{ horizon 100; method {method} }}");
    let found = run(&text, "run");
    let warnings = found.warnings.iter().filter(|w| w.code == "W0719");
    warnings.map(|w| w.message.clone()).collect()
}

#[test]
fn other_methods_tell_what_they_pass_over() {
    let gauss = "exp(-((s - 70.123)/0.001)^2)";
    let rate = format!("state s = 0; state y = 0; s' = 1; y' = {gauss}/0.001;");
    let surface = format!("state s = 0; state y = 0; s' = 1; y' = if {gauss} > 0.5 then 1 else 0;");
    let power = "state s = 0; state y = 0; s' = 1/4; y' = cos(s - 9)^200000;";
    for method in OTHERS {
        assert_eq!(passed_over(power, method).len(), 1, "{method}");
        let of_rate = passed_over(&rate, method);
        assert!(
            of_rate.len() == 1 && of_rate[0].contains("rate of `y`"),
            "{method} {of_rate:?}"
        );
        let of_surface = passed_over(&surface, method);
        let is_told = of_surface.iter().any(|w| w.contains("switching function"));
        assert!(is_told, "{method} {of_surface:?}");
    }
}

/// Exponentials, roots and quotients that are no narrower than the steps.
#[test]
fn nothing_is_told_of_functions_that_steps_see() {
    let models = [
        "state s = 0; state y = 0; s' = 1; y' = exp(sin(s/10));",
        "state s = 1; state y = 0; s' = 0.1*sqrt(s); y' = 1/(1 + s);",
        "state s = 0; state y = 0; s' = 1; y' = exp(-((s - 70.123)/20)^2);",
        "state s = 1; state y = 0; s' = -0.1*s; y' = tanh(s)*exp(-s);",
    ];
    for model in models {
        for method in OTHERS {
            let told = passed_over(model, method);
            assert!(told.is_empty(), "{model} {method} {told:?}");
        }
    }
}

/// Methods that take contacts and do not look for it themselves.
const WITH_CONTACTS: [&str; 4] = [
    "method timestepping { steps = 50; }",
    "lower impact; method fesd { steps = 20; }",
    "lower timefreezing; method fesd;",
    "lower timefreezing; method fesd { steps = 20; }",
];

/// The codes of a run over a curve of s beside a body that strikes a wall.
fn beside_a_contact(curve: &str, road: &str) -> Vec<String> {
    let text = format!(
        "model m {{
           state s = 0; state y = 1; s' = 1; y' = {curve};
           state q = 0; state v = 1; q' = v;
           mechanics q, v {{ mass = 1; force = 0; contact wall {{ gap = 9 - q; restitution = 0.5; }} }}
         }}
         simulate run of m {{ horizon 10; {road} }}"
    );
    let warnings = run(&text, "run").warnings;
    warnings.into_iter().map(|warning| warning.code).collect()
}

#[test]
fn contacts_hide_no_bump() {
    for road in WITH_CONTACTS {
        let narrow = beside_a_contact("exp(-((s - 7.2031)/0.0007)^2)/0.0007", road);
        assert!(narrow.contains(&"W0719".to_owned()), "{road} {narrow:?}");
        let wide = beside_a_contact("exp(-((s - 7.2031)/2)^2)", road);
        assert!(wide.is_empty(), "{road} {wide:?}");
    }
}

/// A stage that hits a bump makes a state of it that finer steps do not know.
#[test]
fn steps_that_hit_a_bump_once_are_told() {
    let curve = |at: f64| format!("1/(1 + ((s - {at:?})/0.0007)^2)/0.0007");
    let beside = |steps: usize| {
        let road = format!("method timestepping {{ steps = {steps}; }}");
        beside_a_contact(&curve(7.3), &road)
    };
    let alone = |steps: usize| {
        let text = format!(
            "model m {{ state s = 0; state y = 1; s' = 1; y' = {}; }}
             simulate run of m {{ horizon 10; method timestepping {{ steps = {steps}; }} }}",
            curve(7.281779286481416)
        );
        let warnings = run(&text, "run").warnings;
        warnings.into_iter().map(|warning| warning.code).collect()
    };
    let all: [&dyn Fn(usize) -> Vec<String>; 2] = [&alone, &beside];
    for codes in all {
        assert_eq!(codes(50), ["W0702"]);
        assert!(codes(100_000).is_empty());
    }
}

/// Where 1/(1 + exp(-u)) is no zero yet, terms of exp(-u) overflow at some order, and those before it are numbers.
#[test]
fn sigmoids_with_terms_that_overflow_are_met() {
    for (width, within) in [(1e-2, 1e-8), (1e-3, 1e-9), (1e-4, 1e-10), (1e-5, 1e-10)] {
        let text = format!(
            "model m {{ state s = 0; state y = 0; s' = 1; y' = 1/(1 + exp(-(s - 7)/{width:e})); }}
             simulate run of m {{ horizon 10; }}"
        );
        let found = run(&text, "run");
        assert_eq!(found.status, Status::Solved, "{width:e}");
        let y = end(&found, "y")[0];
        assert!((y - 3.0).abs() <= within, "{width:e}: {y}");
    }
}
