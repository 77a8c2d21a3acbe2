//! Nonlinear sliding by events, by finite elements, and as the limit of smoothed switches: three roads to one solution.

use std::f64::consts::PI;

use nsd_tests::{end, fitted_order, run};
use nsdc::report::{EventKind, Status, Trajectory};

fn solved(text: &str, experiment: &str) -> Trajectory {
    let found = run(text, experiment);
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    found
}

/// The last value of a state when `model` is run with these lines.
fn last(model: &str, state: &str, lines: &str) -> f64 {
    let text = format!("{model}\nsimulate run of m {{ {lines} }}");
    end(&solved(&text, "run"), state)[0]
}

/// All roads lead to `exact`: the orders of Radau IIA with 2 and 3 nodes are 3 and 5, and that of smoothing is 1.
fn agree(model: &str, state: &str, horizon: f64, exact: f64) {
    let error = |lines: &str| {
        let lines = format!("horizon {horizon}; {lines}");
        (last(model, state, &lines) - exact).abs()
    };
    let events = error("tolerance 1e-11;");
    assert!(events < 1e-10, "{events}");
    let elements = error("tolerance 1e-10; method fesd;");
    assert!(elements < 1e-9, "{elements}");
    for (nodes, order) in [(2, 3.0), (3, 5.0)] {
        let errors = [8, 16, 32].map(|steps| {
            let scheme = format!("scheme = radau_iia({nodes});");
            let error = error(&format!("method fesd {{ steps = {steps}; {scheme} }}"));
            (steps, error)
        });
        let found = fitted_order(&errors);
        assert!(found > order - 0.3, "{nodes}: {found} {errors:?}");
    }
    let smoothed = [1e-3, 1e-4].map(|epsilon| {
        error(&format!(
            "tolerance 1e-9; method smoothing {{ epsilon = {epsilon}; law = tanh; }}"
        ))
    });
    let order = (smoothed[0] / smoothed[1]).log10();
    assert!((order - 1.0).abs() < 0.15, "{order} {smoothed:?}");
}

/// y' = x - r(s) with r(1) = 1 comes down from y = 0.2 to the surface; z' = s z then is known by ∫ s dx.
fn one_switch(reading: &str, integral: impl Fn(f64) -> f64) {
    let model = format!(
        "model m {{ state x = 0.2; state y = 0.2; state z = 1; switch s = sign(y) sliding nonlinear;
           x' = 1; y' = x - ({reading}); z' = s*z; }}"
    );
    let enters = 0.8 - 0.24_f64.sqrt();
    let slides = integral(0.8) - integral(0.2 + enters);
    agree(&model, "z", 0.6, (enters + slides).exp());
}

#[test]
fn by_three_roads_a_cube() {
    one_switch("s^3", |x| 0.75 * x.powf(4.0 / 3.0));
}

#[test]
fn by_three_roads_a_sine() {
    one_switch("sin(pi*s/2)", |x| {
        2.0 / PI * (x * x.asin() + (1.0 - x * x).sqrt())
    });
}

#[test]
fn by_three_roads_a_hidden_term() {
    // s + 1 - s² = x at s = (1 - √(5 - 4x))/2.
    one_switch("s + 1 - s^2", |x| {
        0.5 * (x + (5.0 - 4.0 * x).powf(1.5) / 6.0)
    });
}

/// ∫ f from a to b, by Simpson's rule.
fn integral(f: impl Fn(f64) -> f64, a: f64, b: f64) -> f64 {
    let n = 2000;
    let h = (b - a) / f64::from(n);
    let weight = |k: i32| match k {
        0 => 1.0,
        k if k == n => 1.0,
        k => 2.0 + 2.0 * f64::from(k % 2),
    };
    let sum: f64 = (0..=n).map(|k| weight(k) * f(a + f64::from(k) * h)).sum();
    sum * h / 3.0
}

fn root(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let sign = f(low).signum();
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if f(middle).signum() == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[test]
fn by_three_roads_on_one_of_two_modes() {
    // Jeffrey's example 2 up to t = 2: both modes are there from x = 1 on, and the state stays on the one it entered.
    let model = "model m { state x = 0.9; state y = 0.05; switch s = sign(y) sliding nonlinear;
       x' = 2*s^2 - 1; y' = 2*s^2 - s - x; }";
    let enters = 0.1 + 0.11_f64.sqrt();
    let first = (1.0 - (1.0 + 8.0 * (0.9 + enters)).sqrt()) / 4.0;
    let time = |s: f64| integral(|s| (1.0 - 4.0 * s) / (1.0 - 2.0 * s * s), first, s);
    let s = root(|s| enters + time(s) - 2.0, first, 0.25);
    agree(model, "x", 2.0, 2.0 * s * s - s);
}

#[test]
fn by_three_roads_two_switches() {
    // a = ∛(0.3 + t/10) from where x reaches 0, and b = ∛(0.2 + a/2) from where y does.
    let model = "model m { state x = 0.7; state y = 1; state z = 1; state w = 0.3;
       switch a = sign(x) sliding nonlinear; switch b = sign(y) sliding nonlinear;
       w' = 0.1; x' = w - a^3; y' = 0.2 - b^3 + 0.5*a; z' = a*b*z; }";
    let a = |t: f64| (0.3 + 0.1 * t).cbrt();
    let b = |t: f64| (0.2 + 0.5 * a(t)).cbrt();
    let first = 7.0 - 35.0_f64.sqrt();
    let y = |t: f64| 1.0 - 0.3 * first - 0.8 * (t - first) + 0.5 * integral(a, first, t);
    let second = root(y, first, 4.0);
    assert!(first < second && second < 2.9, "{first} {second}");
    let grows =
        first + integral(a, first, second) + integral(|t| a(t) * b(t), second, 3.0);
    agree(model, "z", 3.0, grows.exp());
}

#[test]
fn the_side_of_entry_decides() {
    // s = ±1/2 attract, and 0 repels.
    let model = |y: f64| {
        format!(
            "model m {{ state x = 0; state y = {y}; switch s = sign(y) sliding nonlinear;
               x' = s; y' = -4*s*(s^2 - 0.25); }}
             simulate run of m {{ horizon 2; tolerance 1e-10; method fesd; }}"
        )
    };
    for (y, side) in [(0.3, 1.0), (-0.3, -1.0)] {
        let found = solved(&model(y), "run");
        // y' = ∓3 outside.
        let x = end(&found, "x")[0];
        assert!((x - side * (0.1 + 0.5 * 1.9)).abs() < 1e-9, "{x}");
        let kinds: Vec<EventKind> = found.events.iter().map(|event| event.kind).collect();
        assert_eq!(kinds, [EventKind::Branch]);
        let taken = found.events[0].sliding.iter().find(|mode| mode.taken);
        assert!(taken.is_some_and(|mode| (mode.value - 0.5 * side).abs() < 1e-12));
    }
}
