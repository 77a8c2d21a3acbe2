//! Nonlinear sliding by the event road, against closed forms.

use std::f64::consts::PI;

use nsd_tests::{assert_near, end, run, solved, times};
use nsdc::report::{EventKind, Failure, Status};

/// ∫ f from a to b, by Simpson's rule.
fn integral(f: impl Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    let n = 20_000;
    let h = (b - a) / f64::from(n);
    let weight = |k: i32| match k {
        0 => 1.0,
        k if k == n => 1.0,
        k => 2.0 + 2.0 * f64::from(k % 2),
    };
    let sum: f64 = (0..=n).map(|k| weight(k) * f(a + f64::from(k) * h)).sum();
    sum * h / 3.0
}

/// Example 2 of Jeffrey 2014: modes s = (1 ± √(1 + 8x))/4, which meet at x = -1/8.
const MODES: &str = "model m {
  state x = 0.9; state y = 0.05;
  switch s = sign(y) sliding nonlinear;
  x' = 2*s^2 - 1; y' = 2*s^2 - s - x;
}
simulate folds of m { horizon 3; tolerance 1e-11; output x, y, s; }
simulate filippov of m { with { s.sliding = linear; } horizon 2.5; tolerance 1e-11; }
simulate between of m { with { x = 0.5; y = 0; } horizon 0.5; method event { branch = slide; } tolerance 1e-11; }
simulate open of m { with { x = 0.5; y = 0; } horizon 0.5; }";

/// A reading is that of the switching function, by whatever name it stands and in whatever order: x is at 0 from t = 1 on, and
/// there s = 1/3 from 1 - 1/2 - 3 s/2 = 0, or s² - 1/2 - 3 s/2 = 0.
#[test]
fn a_reading_holds_wherever_its_function_stands() {
    let statements = |reading: &str| {
        let named = format!("switch s = sign(x) sliding {reading};");
        let other = "switch a = sign(x);";
        [format!("{named} {other}"), format!("{other} {named}")]
    };
    for (reading, slides) in [
        ("linear", 1.0 / 3.0),
        ("nonlinear", (1.5 - 4.25_f64.sqrt()) / 2.0),
    ] {
        for statements in statements(reading) {
            for [first, second] in [
                ["s", "s"],
                ["sign(x)", "sign(x)"],
                ["a", "sign(x)"],
                ["sign(x)", "s"],
            ] {
                let text = format!(
                    "model m {{ state x = 1; state y = 0; {statements}
                     x' = {first}^2 - 0.5 - 1.5*{second}; y' = {first}; }}
                     simulate e of m {{ horizon 3; }}"
                );
                let found = end(&solved(&text, "e"), "y");
                assert_near(&found, &[1.0 + 2.0 * slides], 1e-9);
            }
        }
    }
}

#[test]
fn a_branch_is_followed_to_its_fold() {
    let found = solved(MODES, "folds");
    // y = 0.05 + 0.1 t - t²/2 reaches 0; then x = 2s² - s, dx = (2s² - 1) dt up to s = 1/4.
    let enters = 0.1 + 0.11_f64.sqrt();
    let first = (1.0 - (1.0 + 8.0 * (0.9 + enters)).sqrt()) / 4.0;
    let slides = integral(|s| (1.0 - 4.0 * s) / (1.0 - 2.0 * s * s), first, 0.25);
    let folds = enters + slides;
    assert!((folds - 2.7591491063842).abs() < 1e-12, "{folds}");
    assert_near(&found.history.switch_times(), &[enters, folds], 1e-11);
    assert_near(&times(&found, EventKind::Fold), &[folds], 1e-11);
    // Then upwards with (1, 1 - x) from x = -1/8.
    let left = 3.0 - folds;
    assert_near(&end(&found, "x"), &[left - 0.125], 1e-11);
    assert_near(
        &end(&found, "y"),
        &[1.125 * left - 0.5 * left * left],
        1e-11,
    );
    assert!(
        found
            .quality
            .error_estimate
            .is_some_and(|error| error < 1e-10)
    );

    // Entering at x > 1 there is one mode, which attracts: the minus root, against the sign printed in the paper.
    let entry = &found.history.events[0];
    assert_eq!(entry.kind, EventKind::EnterSliding);
    let [mode] = entry.sliding[..] else {
        panic!("{:?}", entry.sliding)
    };
    assert!(mode.taken && (mode.value - first).abs() < 1e-11, "{mode:?}");
    assert!(
        (mode.stability - (4.0 * first - 1.0)).abs() < 1e-10,
        "{mode:?}"
    );
    // At the fold both are one.
    let fold = &found.history.events[1];
    assert!(
        fold.sliding
            .iter()
            .all(|mode| !mode.taken && (mode.value - 0.25).abs() < 1e-4),
        "{:?}",
        fold.sliding
    );
}

#[test]
fn the_linear_reading_drops_what_is_hidden() {
    // x' = 1 throughout, and sliding for 1 < x < 3 only.
    let found = solved(MODES, "filippov");
    let enters = 0.1 + 0.11_f64.sqrt();
    assert_near(&found.history.switch_times(), &[enters, 2.1], 1e-11);
    assert_near(&end(&found, "x"), &[3.4], 1e-11);
}

#[test]
fn a_start_on_the_surface_names_its_branches() {
    // Two modes at x = 1/2, and the field above leads away: three ways to go on.
    let open = run(MODES, "open");
    assert_ne!(open.status, Status::Solved);
    let found = solved(MODES, "between");
    // The attracting one slides left: x = 2s² - s again, from the minus root.
    let first = (1.0 - 5.0_f64.sqrt()) / 4.0;
    let time = |s: f64| integral(|s| (1.0 - 4.0 * s) / (1.0 - 2.0 * s * s), first, s);
    let x = end(&found, "x")[0];
    let last = (1.0 - (1.0 + 8.0 * x).sqrt()) / 4.0;
    assert!((time(last) - 0.5).abs() < 1e-10, "{x}");
}

/// A block on a belt whose friction is F = s + 2π s (1 - s²) (Jeffrey 2014, equations 28 and 29).
const BELT: &str = "model m {
  param c = 0.3;
  state x = 2.4; state u = 1;
  switch s = sign(u) sliding nonlinear;
  x' = u - 1; u' = -s - x - c*(u - 1);
  hidden on s { u' += -2*pi*s*(1 - s^2); }
}
simulate printed of m { horizon 40; tolerance 1e-11; }
simulate cycle of m { with { c = 0.25; } horizon 40; tolerance 1e-11; }";

/// The largest static friction.
fn strongest() -> f64 {
    let s = ((1.0 + 2.0 * PI) / (6.0 * PI)).sqrt();
    s + 2.0 * PI * s * (1.0 - s * s)
}

/// Slipping from rest on the belt at x: w = x + 1 has w'' + c w' + w = 0 and w' = u - 1. Returns w and w' after t.
fn slip(c: f64, x: f64, t: f64) -> [f64; 2] {
    let (w, v) = (x + 1.0, -1.0);
    let (decay, omega) = (0.5 * c, (1.0 - 0.25 * c * c).sqrt());
    let b = (v + decay * w) / omega;
    let (sine, cosine) = (omega * t).sin_cos();
    let scale = (-decay * t).exp();
    let position = scale * (w * cosine + b * sine);
    let speed = scale * (b * omega * cosine - w * omega * sine) - decay * position;
    [position, speed]
}

#[test]
fn static_friction_is_larger_than_kinetic() {
    assert!((strongest() - 3.018145824447).abs() < 1e-12);
    let found = solved(BELT, "printed");
    let [sticks, folds] = found.history.switch_times()[..] else {
        panic!("{:?}", found.history.switch_times())
    };
    assert!((sticks - 0.313251180078).abs() < 1e-11, "{sticks}");
    // While it sticks, x' = -1, up to where the spring overcomes static friction.
    let leaves = 0.3 - strongest();
    let x_sticks = leaves + (folds - sticks);
    assert!((folds - 5.270996991752).abs() < 1e-11, "{folds}");
    assert_near(&times(&found, EventKind::Fold), &[folds], 0.0);
    // From there it slips for ever: the slip speed comes down to 0.0174, and the cycle that the paper tells of is
    // none for its printed damping.
    let slowest = (1..4000).map(|k| slip(0.3, leaves, 0.01 * f64::from(k))[1] + 1.0);
    let slowest = slowest.fold(f64::INFINITY, f64::min);
    assert!((slowest - 0.0173892).abs() < 1e-5, "{slowest}");
    let [w, speed] = slip(0.3, leaves, 40.0 - folds);
    assert_near(&end(&found, "x"), &[w - 1.0], 1e-10);
    assert_near(&end(&found, "u"), &[speed + 1.0], 1e-10);
    // Where it sticks, by the energy of neither: the slip before that is from (2.4, 1).
    assert!((x_sticks - 2.24).abs() < 0.05, "{x_sticks}");
}

#[test]
fn folds_are_found_whatever_the_numbers() {
    // A push that grows along a line reaches the strongest friction at t = (F + c)/b, and x = 0 until then; afterwards
    // x' = v with v' = b t - c - 1.
    for k in 0..40 {
        let b = 0.61 + 0.173 * f64::from(k);
        let c = 0.007 * f64::from(k * k % 17);
        let folds = (strongest() + c) / b;
        let text = format!(
            "model m {{ state x = 0; state v = 0; switch s = sign(v) sliding nonlinear;
               x' = v; v' = {b}*time - {c} - s; hidden on s {{ v' += -2*pi*s*(1 - s^2); }} }}
             simulate run of m {{ horizon {}; tolerance 1e-11; }}",
            folds + 0.5
        );
        let found = solved(&text, "run");
        assert_near(&times(&found, EventKind::Fold), &[folds], 1e-11 * folds);
        let v = 0.5 * (b * (folds + 0.25) - c - 1.0);
        assert_near(&end(&found, "v"), &[v], 1e-10 * v);
    }
}

#[test]
fn with_less_damping_it_sticks_and_slips_for_ever() {
    let found = solved(BELT, "cycle");
    let leaves = 0.25 - strongest();
    // It sticks again where the slip speed w' + 1 is zero first.
    let speed = |t: f64| slip(0.25, leaves, t)[1] + 1.0;
    let mut low = 0.1;
    while speed(low + 0.01) > 0.0 {
        low += 0.01;
    }
    let mut high = low + 0.01;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if speed(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let sticks = slip(0.25, leaves, low)[0] - 1.0;
    let period = low + (sticks - leaves);
    assert!((sticks + 0.205246624111).abs() < 1e-10, "{sticks}");
    assert!((period - 7.200604513192).abs() < 1e-10, "{period}");
    let folds = times(&found, EventKind::Fold);
    assert_eq!(folds.len(), 5, "{folds:?}");
    for pair in folds.windows(2) {
        assert!((pair[1] - pair[0] - period).abs() < 1e-10, "{folds:?}");
    }
}

#[test]
fn each_side_enters_its_own_mode() {
    // φ = -4 (s + ½) s (s - ½): the outer modes attract, the one between repels.
    let model = |y: f64| {
        format!(
            "model m {{ state x = 0; state y = {y}; switch s = sign(y) sliding nonlinear;
               x' = s; y' = -4*(s + 0.5)*s*(s - 0.5); }}
             simulate run of m {{ horizon 2; tolerance 1e-11; }}"
        )
    };
    for (y, side) in [(0.3, 1.0), (-0.3, -1.0)] {
        let found = solved(&model(y), "run");
        // y' = ∓3 outside.
        assert_near(&found.history.switch_times(), &[0.1], 1e-12);
        assert_near(&end(&found, "x"), &[side * (0.1 + 0.5 * 1.9)], 1e-11);
        let branch = found
            .history
            .events
            .iter()
            .find(|event| event.kind == EventKind::Branch);
        let Some(branch) = branch else {
            panic!("{:?}", found.history.events)
        };
        let values: Vec<f64> = branch.sliding.iter().map(|mode| mode.value).collect();
        assert_near(&values, &[-0.5, 0.0, 0.5], 1e-12);
        let slopes: Vec<f64> = branch.sliding.iter().map(|mode| mode.stability).collect();
        assert_near(&slopes, &[-2.0, 1.0, -2.0], 1e-10);
        let taken: Vec<f64> = (branch.sliding.iter())
            .filter(|mode| mode.taken)
            .map(|mode| mode.value)
            .collect();
        assert_near(&taken, &[0.5 * side], 1e-12);
    }
}

#[test]
fn readings_of_the_sign_differ_on_the_surface_alone() {
    // The functions of the paper's introduction: all are sign(y) off the surface.
    let by = |reading: &str| {
        let text = format!(
            "model m {{ state x = 0; state y = 1; switch s = sign(y) sliding nonlinear;
               x' = s; y' = 0.5 - ({reading}); }}
             simulate run of m {{ horizon 4; tolerance 1e-11; }}"
        );
        let found = solved(&text, "run");
        assert_near(&found.history.switch_times(), &[2.0], 1e-12);
        end(&found, "x")[0] - 2.0
    };
    assert_near(&[by("s")], &[2.0 * 0.5], 1e-11);
    assert_near(&[by("s^3")], &[2.0 * 0.5_f64.cbrt()], 1e-11);
    assert_near(&[by("sin(pi*s/2)")], &[2.0 / 3.0], 1e-11);
    // s + 1 - s² = ½ at s = (1 - √3)/2.
    assert_near(&[by("s + 1 - s^2")], &[1.0 - 3.0_f64.sqrt()], 1e-11);
}

#[test]
fn a_fold_may_lead_to_another_branch() {
    // With r = s/0.9, φ = x - (4r³ - 3r): at r = ∓½, x = ±1 the state goes on at r = ±1, while x' = -s.
    let text = "model m { state x = 0.5; state y = 0.1; switch s = sign(y) sliding nonlinear;
           x' = -s; y' = x - (4*(s/0.9)^3 - 3*s/0.9); }
         simulate run of m { horizon 12; tolerance 1e-11; output x, y, s every 0.01; }";
    let found = solved(text, "run");
    let folds = times(&found, EventKind::Fold);
    assert!(folds.len() >= 3, "{folds:?}");
    // dt = dx/(-s) = (12 r² - 3)/(-0.9 r) dr from r = -1 to -½.
    let half = (4.5 - 3.0 * 2.0_f64.ln()) / 0.9;
    for pair in folds.windows(2) {
        assert!((pair[1] - pair[0] - half).abs() < 1e-10, "{folds:?} {half}");
    }
    // It never leaves the surface, and x stays between the folds.
    let y = end(&found, "y")[0];
    assert!(y.abs() < 1e-12, "{y}");
    let first = &found
        .history
        .events
        .iter()
        .find(|event| event.kind == EventKind::Fold);
    let taken = first.and_then(|event| event.sliding.iter().find(|mode| mode.taken));
    assert!(
        taken.is_some_and(|mode| (mode.value.abs() - 0.9).abs() < 1e-9),
        "{first:?}"
    );
}

#[test]
fn a_fold_of_switches_that_interact() {
    // r³ + r/2 = s/10 on the surface z = 0, and on both x = 2s² - s + r/10, which turns back where dx/ds = 0.
    let text = "model m { state x = 0.9; state y = 0.05; state z = 0.02;
           switch s = sign(y) sliding nonlinear; switch r = sign(z) sliding nonlinear;
           x' = 2*s^2 - 1; y' = 2*s^2 - s - x + 0.1*r; z' = -r^3 - 0.5*r + 0.1*s; }
         simulate run of m { horizon 4; tolerance 1e-11; }";
    let found = solved(text, "run");
    let zero = |f: &dyn Fn(f64) -> f64, mut low: f64, mut high: f64| {
        let sign = f(low).signum();
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            match f(middle).signum() == sign {
                true => low = middle,
                false => high = middle,
            }
        }
        low
    };
    let r = |s: f64| zero(&|r| r * r * r + 0.5 * r - 0.1 * s, -1.0, 1.0);
    let by_r = |s: f64| 0.1 / (3.0 * r(s).powi(2) + 0.5);
    let x = |s: f64| 2.0 * s * s - s + 0.1 * r(s);
    let by_s = |s: f64| 4.0 * s - 1.0 + 0.1 * by_r(s);
    // z falls by 1.4, then y by x - 1 - r/10 with s = 1.
    let first = 0.02 / 1.4;
    let y = |t: f64| {
        let until = |t: f64, r: f64| (0.1 + 0.1 * r) * t - 0.5 * t * t;
        0.05 + until(first, 1.0) + until(t, r(1.0)) - until(first, r(1.0))
    };
    let second = zero(&y, 0.1, 1.0);
    assert_near(&found.history.switch_times()[..2], &[first, second], 1e-11);
    let enters = zero(&|s| x(s) - 0.9 - second, -0.9, 0.0);
    let turns = zero(&by_s, 0.0, 0.5);
    let folds = second + integral(|s| by_s(s) / (2.0 * s * s - 1.0), enters, turns);
    assert_near(&times(&found, EventKind::Fold), &[folds], 1e-10);
    let fold = found
        .history
        .events
        .iter()
        .find(|event| event.kind == EventKind::Fold);
    assert!(fold.is_some_and(|fold| fold.surface == "s"), "{fold:?}");
    // From there upwards with s = 1, while r goes on.
    let left = 4.0 - folds;
    assert_near(&end(&found, "x"), &[x(turns) + left], 1e-10);
    let rises = (1.0 - x(turns) + 0.1 * r(1.0)) * left - 0.5 * left * left;
    assert_near(&end(&found, "y"), &[rises], 1e-10);
}

#[test]
fn one_of_two_that_interact_leaves_at_its_bound() {
    // a = ∛w up to w = 1, where x leaves with x'' = w' = 1; b = ∛(a/2) stays where it is then.
    let text = "model m { state w = 0.5; state x = 0; state y = 0; state z = 0;
           switch a = sign(x) sliding nonlinear; switch b = sign(y) sliding nonlinear;
           w' = 1; x' = w - a^3; y' = 0.5*a - b^3; z' = b; }
         simulate run of m { horizon 1; tolerance 1e-11; }";
    let found = solved(text, "run");
    assert_near(&found.history.switch_times(), &[0.5], 1e-10);
    assert_near(&end(&found, "x"), &[0.125], 1e-11);
    // ∫ ∛(∛w/2) dw from 1/2 to 1, and then half of ∛½.
    let slides = 0.5_f64.cbrt() * 0.9 * (1.0 - 0.5_f64.powf(10.0 / 9.0));
    assert_near(&end(&found, "z"), &[slides + 0.5 * 0.5_f64.cbrt()], 1e-10);
}

#[test]
fn sliding_ends_at_a_bound_too() {
    // φ = x - s³ with x' = 1: s = ∛x up to 1, where it leaves upwards tangentially, y'' = x' = 1.
    let text = "model m { state x = 0.2; state y = 0.4; switch s = sign(y) sliding nonlinear;
           x' = 1; y' = x - s^3; }
         simulate run of m { horizon 1.5; tolerance 1e-11; }";
    let found = solved(text, "run");
    // y = 0.4 - 0.8 t + t²/2 = 0 at t = 0.8 - √(0.64 - 0.8) has no root: it turns above the surface.
    let least = 0.4 - 0.8 * 0.8 + 0.5 * 0.8 * 0.8;
    assert!(
        least > 0.0 && found.history.switch_times().is_empty(),
        "{least}"
    );
    let lower = text.replace("y = 0.4", "y = 0.2");
    let found = solved(&lower, "run");
    let enters = 0.8 - (0.64_f64 - 0.4).sqrt();
    assert_near(&found.history.switch_times(), &[enters, 0.8], 1e-10);
    assert_near(&end(&found, "y"), &[0.5 * 0.7 * 0.7], 1e-10);
}

#[test]
fn smoothed_dynamics_tend_to_nonlinear_sliding() {
    // At the fold the smoothed state is late by a multiple of ε^(2/3).
    let by = |epsilon: f64, sliding: &str| {
        let text = MODES.replace(
            "simulate folds of m { horizon 3; tolerance 1e-11; output x, y, s; }",
            &format!(
                "simulate smooth of m {{ with {{ s.sliding = {sliding}; }} horizon 2; tolerance 1e-9;
                   method smoothing {{ epsilon = {epsilon}; law = tanh; }} }}"
            ),
        );
        end(&solved(&text, "smooth"), "x")[0]
    };
    // On the branch, before its fold, the error is of first order; Filippov's has x' = 1 throughout.
    let enters = 0.1 + 0.11_f64.sqrt();
    let exact = {
        let first = (1.0 - (1.0 + 8.0 * (0.9 + enters)).sqrt()) / 4.0;
        let time = |s: f64| integral(|s| (1.0 - 4.0 * s) / (1.0 - 2.0 * s * s), first, s);
        let (mut low, mut high) = (first, 0.25);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if enters + time(middle) < 2.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        2.0 * low * low - low
    };
    let errors = [1e-3, 1e-4].map(|epsilon| (by(epsilon, "nonlinear") - exact).abs());
    let order = (errors[0] / errors[1]).log10();
    assert!((order - 1.0).abs() < 0.2, "{errors:?}");
    let linear = [1e-3, 1e-4].map(|epsilon| (by(epsilon, "linear") - 2.9).abs());
    assert!(linear[1] < 1e-8 && linear[0] < 1e-8, "{linear:?}");
}

#[test]
fn a_second_switch_arrives_while_the_first_one_slides() {
    // a = ∛0.3 from t = 1 on, and b = ∛(0.2 + a/2) once y has come down.
    let text = "model m { state x = 0.7; state y = 1; state z = 0;
           switch a = sign(x) sliding nonlinear; switch b = sign(y) sliding nonlinear;
           x' = 0.3 - a^3; y' = 0.2 - b^3 + 0.5*a; z' = a*b; }
         simulate run of m { horizon 4; tolerance 1e-11; }";
    let found = solved(text, "run");
    let a = 0.3_f64.cbrt();
    let b = (0.2 + 0.5 * a).cbrt();
    let second = 1.0 + 0.7 / (0.8 - 0.5 * a);
    assert_near(&found.history.switch_times(), &[1.0, second], 1e-11);
    let z = 1.0 + a * (second - 1.0) + a * b * (4.0 - second);
    assert_near(&end(&found, "z"), &[z], 1e-11);
}

#[test]
fn two_switches_arrive_together() {
    // From the corner a = b = 1 both go down to the zero of b/5 - a³, a = b = √0.2, which attracts however steep they are.
    let text = "model m { state x = 1; state y = 1; state z = 0;
           switch a = sign(x) sliding nonlinear; switch b = sign(y) sliding nonlinear;
           x' = 0.2*b - a^3; y' = 0.2*a - b^3; z' = a + b; }
         simulate run of m { horizon 3; tolerance 1e-11; }";
    let found = solved(text, "run");
    let times = found.history.switch_times();
    assert_near(&times[..1], &[1.25], 1e-12);
    let z = 2.0 * 1.25 + 2.0 * 0.2_f64.sqrt() * 1.75;
    assert_near(&end(&found, "z"), &[z], 1e-10);
}

#[test]
fn a_triple_root_ends_a_run_and_is_named() {
    // s = ∛x has no derivative at x = 0, where S = -3s² vanishes and nothing folds.
    for rate in ["0", "s"] {
        let text = format!(
            "model m {{ state x = 0.5; state y = 0.1; state z = 0; switch s = sign(y) sliding nonlinear;
               x' = -1; y' = x - s^3; z' = {rate}; }}
             simulate run of m {{ horizon 1; tolerance 1e-10; }}"
        );
        let found = run(&text, "run");
        let Some(Failure::SingularSliding { time, surfaces, .. }) = &found.failure else {
            panic!("{:?} {:?}", found.status, found.failure)
        };
        assert!((time - 0.5).abs() < 1e-6 && surfaces.len() == 1, "{time}");
    }
}
