//! Optimal control of switches that are read nonlinearly: closed forms, and runs from event to event with the controls.

use nsd_tests::{agrees, optimum, solved_optimum};
use nsdc::report::{Failure, Status, Trajectory};

/// The optimum of experiment `o` of a text.
#[track_caller]
fn solved(text: &str) -> Trajectory {
    solved_optimum(text, "o")
}

#[track_caller]
fn close(value: f64, exact: f64, within: f64) {
    assert!((value - exact).abs() <= within, "{value} is not {exact}");
}

fn objective(found: &Trajectory) -> f64 {
    found.objective.expect("an optimum has an objective")
}

/// The least value of a function with one minimum in an interval.
fn least(f: impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2]) -> f64 {
    for _ in 0..200 {
        let [first, second] = [1.0, 2.0].map(|third| low + third * (high - low) / 3.0);
        match f(first) < f(second) {
            true => high = second,
            false => low = first,
        }
    }
    f(0.5 * (low + high))
}

/// Example 2 of Jeffrey 2014, whose drift along the surface is controlled.
const DRIFT: &str = "model m { state x = 1.2; state y = 0; control u in [-9, 9] = 1;
   switch s = sign(y) sliding nonlinear; x' = u*(2*s^2 - 1); y' = 2*s^2 - s - x; }";

/// ∫ dx/(2s² - 1) on its attracting mode, x = 2s² - s.
fn w(x: f64) -> f64 {
    let root = 2.0_f64.sqrt();
    let s = (1.0 - (1.0 + 8.0 * x).sqrt()) / 4.0;
    let inverse = ((root * s - 1.0) / (root * s + 1.0)).abs().ln() / (2.0 * root);
    (2.0 * s * s - 1.0).abs().ln() - inverse
}

#[test]
fn an_attracting_mode_is_followed_at_least_cost() {
    // w' = u with w = ∫ dx/(2s² - 1), x = 2s² - s: of all u that take w as far, the constant one is cheapest. Which
    // sign the surface has, and how steep it is, changes nothing.
    let turned = DRIFT
        .replace("sign(y)", "sign(-2*y)")
        .replace("- s - x", "+ s - x");
    for drift in [DRIFT, &turned] {
        let found = solved(&format!(
            "{drift} optimize o of m {{ horizon 1; intervals 4; final {{ x = 0.2; y = 0; }} minimize integral(u^2); }}"
        ));
        close(objective(&found), (w(0.2) - w(1.2)).powi(2), 1e-6);
        agrees(&found, 1e-6);
    }
}

/// Friction F = s + 2π s (1 - s²) on a body that a control pushes, and the largest F.
const BLOCK: &str = "model m { state v = -0.5; control u in [-9, 9] = 0;
   switch s = sign(v) sliding nonlinear; v' = u - s; hidden on s { v' += -2*pi*s*(1 - s^2); } }";
const STRONGEST: f64 = 3.018_145_824_447;

#[test]
fn a_block_is_torn_loose_at_least_cost() {
    // With u from a to b along a line, it comes to rest, sticks until u = F, and then has v' = u - 1: from there on
    // v = ((F + b)/2 - 1) 2 (b - F)/(b - a), which is to be 1.
    let found = solved(&format!(
        "{BLOCK} optimize o of m {{ horizon 2; intervals 1; elements 4; controls linear;
           guess {{ u = 2.5*time; }} final {{ v = 1; }} minimize integral(u^2); }}"
    ));
    let cost = |b: f64| {
        let a = b - 2.0 * (b - STRONGEST) * (0.5 * (STRONGEST + b) - 1.0);
        2.0 / 3.0 * (a * a + a * b + b * b)
    };
    close(objective(&found), least(cost, [3.1, 6.0]), 1e-7);
    agrees(&found, 1e-7);
    // It leaves in the fold: nowhere else inside of its interval may a mode end.
    let last = *found
        .history
        .switch_times()
        .last()
        .expect("it is torn loose");
    let u = |t: f64| {
        let series = &found.samples.controls[0].values;
        series[0] + (series[series.len() - 1] - series[0]) * t / 2.0
    };
    close(u(last), STRONGEST, 1e-8);
}

#[test]
fn a_mode_does_not_end_where_an_interval_does() {
    // More lines cost less, and the block is still torn loose where u = F.
    let cost = |intervals: usize| {
        let found = solved(&format!(
            "{BLOCK} optimize o of m {{ horizon 2; intervals {intervals}; elements 3; controls linear;
               guess {{ u = 2.5*time; }} final {{ v = 1; }} minimize integral(u^2); }}"
        ));
        agrees(&found, 1e-7);
        let last = *found
            .history
            .switch_times()
            .last()
            .expect("it is torn loose");
        let at = found
            .samples
            .time
            .iter()
            .position(|t| (t - last).abs() < 1e-12);
        let u = &found.samples.controls[0].values;
        close(u[at.expect("elements end where modes do")], STRONGEST, 1e-8);
        objective(&found)
    };
    let costs = [1, 4].map(cost);
    assert!(costs.is_sorted_by(|a, b| a > b), "{costs:?}");
}

/// Modes s = ±1/2 attract, and s = 0 between them repels; from above the state comes to 1/2.
const SIDES: &str = "model m { state x = 0; state y = 0.3; control u in [-2, 2] = 0;
   switch s = sign(y) sliding nonlinear; x' = s + u; y' = -4*s*(s^2 - 0.25); }";

#[test]
fn a_cheaper_mode_that_is_not_entered_is_no_optimum() {
    // x(1) + ∫u² is least with u = -1/2; s = 1 until t = 0.1. With s = -1/2 it would be less by 0.9.
    let found = solved(&format!(
        "{SIDES} optimize o of m {{ horizon 1; intervals 3; elements 3; minimize integral(u^2) + final(x); }}"
    ));
    close(objective(&found), -0.25 + 0.1 + 0.45, 1e-7);
    agrees(&found, 1e-7);
}

#[test]
fn repelling_modes_are_infeasible() {
    // x' = 1 - 4s² is zero where the modes attract, -3 outside, and 1 on the repelling one.
    let model = SIDES.replace("x' = s + u;", "x' = 1 - 4*s^2 + 0.01*u;");
    let found = optimum(
        &format!(
            "{model} optimize o of m {{ horizon 1; intervals 2; elements 3; final {{ x = 0.5; }} minimize integral(u^2); }}"
        ),
        "o",
    );
    assert_eq!(
        found.status,
        Status::LocallyInfeasible,
        "{:?}",
        found.failure
    );
}

#[test]
fn a_mode_that_is_met_first_is_not_crossed() {
    // With 1 < u < F the field points upwards on both sides of v = 0, but between them it has a zero, where the block
    // comes to rest for good. Constant controls below F cannot bring it further.
    let model = BLOCK.replace("[-9, 9] = 0", "[-9, 2.9] = 1.2");
    let found = optimum(
        &format!(
            "{model} optimize o of m {{ horizon 2; intervals 1; elements 3; final {{ v = 0.5; }} minimize integral(u^2); }}"
        ),
        "o",
    );
    let Some(Failure::OtherMode { name, .. }) = &found.failure else {
        panic!("{:?} {:?}", found.status, found.failure)
    };
    assert_eq!(name, "s");
}

#[test]
fn several_ways_from_a_start_on_the_surface_are_named() {
    let model = DRIFT.replace("x = 1.2", "x = 0.5");
    let found = optimum(
        &format!(
            "{model} optimize o of m {{ horizon 0.1; intervals 2; final {{ x = 0.4; }} minimize integral(u^2); }}"
        ),
        "o",
    );
    assert!(
        matches!(found.failure, Some(Failure::NonUnique { .. })),
        "{:?} {:?}",
        found.status,
        found.failure
    );
    // The failure is that of the run with these controls, which is said once.
    let warnings = found.warnings.iter().filter(|one| one.code == "W0709");
    let messages: Vec<&str> = warnings.map(|one| one.message.as_str()).collect();
    let [message] = messages[..] else {
        panic!("{messages:?}")
    };
    assert!(message.contains("does not reach the end: "), "{message}");
}

#[test]
fn two_nonlinear_switches_at_once() {
    // a = ∛w and b = ∛(a/2) on both surfaces, and z' = b⁹ = w/8: of all u = w' that bring z to 0.06 from w = 0.1 in
    // t = 1, ∫u² is least with w'' = -λ/8, u(1) = 0: u = c (1 - t) with ∫w/8 = 0.1/8 + c/24.
    let found = solved(
        "model m { state w = 0.1; state x = 0; state y = 0; state z = 0; control u in [-9, 9] = 0.5;
           switch a = sign(x) sliding nonlinear; switch b = sign(y) sliding nonlinear;
           w' = u; x' = w - a^3; y' = 0.5*a - b^3; z' = b^9; }
         optimize o of m { horizon 1; intervals 4; controls linear; final { z = 0.06; } minimize integral(u^2); }",
    );
    let c = 24.0 * (0.06 - 0.1 / 8.0);
    close(objective(&found), c * c / 3.0, 1e-6);
    agrees(&found, 1e-6);
}

#[test]
fn a_fold_inside_of_an_interval() {
    // The drift takes the mode to its end at x = -1/8, from where x' = u and y' = 1 - x. α is like a square root there,
    // so that elements in time lose their order.
    let found = solved(&format!(
        "{DRIFT} optimize o of m {{ horizon 1; intervals 1; elements 16; tolerance 1e-2;
           guess {{ u = 2.6; }} final {{ y >= 0.1; }} minimize integral(u^2); }}"
    ));
    let folds = w(-0.125) - w(1.2);
    let height = |u: f64| {
        let left = 1.0 - folds / u;
        1.125 * left - 0.5 * u * left * left
    };
    let (mut low, mut high) = (folds, 1.2 * folds);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match height(middle) < 0.1 {
            true => low = middle,
            false => high = middle,
        }
    }
    close(objective(&found), low * low, 2e-3 * low * low);
    agrees(&found, 1e-3);
}
