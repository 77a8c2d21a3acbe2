//! Nonlinear sliding by events, by finite elements, and as the limit of smoothed switches: three roads to one solution.

use std::f64::consts::PI;

use nsd_tests::random::Random;
use nsd_tests::{DataFiles, end, fitted_order, run, run_with_data, solved, times};
use nsdc::report::{EventKind, Status};

/// The last value of a state when `model` is run with these lines.
fn last(model: &str, state: &str, lines: &str) -> f64 {
    let text = format!("{model}\nsimulate run of m {{ {lines} }}");
    end(&solved(&text, "run"), state)[0]
}

/// Numbers of steps from where orders show to where rounding does, for 2 and 3 nodes.
const GRIDS: [[usize; 3]; 2] = [[8, 16, 32]; 2];

/// Smoothing of two widths has order 1 where a mode is followed.
const FIRST: ([f64; 2], f64) = ([1e-3, 1e-4], 1.0);

/// Random models that data move.
const MOVED: usize = 60;

/// All roads lead to `exact`: Radau IIA with s nodes by order 2s - 1, and smoothing by one of its own.
fn agree(
    model: &str,
    (state, horizon, exact): (&str, f64, f64),
    grids: [[usize; 3]; 2],
    (widths, smoothing): ([f64; 2], f64),
) {
    let error = |lines: &str| {
        let lines = format!("horizon {horizon}; {lines}");
        (last(model, state, &lines) - exact).abs()
    };
    let events = error("tolerance 1e-11;");
    assert!(events < 1e-10, "{events}");
    let elements = error("tolerance 1e-10; method fesd;");
    assert!(elements < 1e-9, "{elements}");
    for (nodes, grid) in [2, 3].into_iter().zip(grids) {
        let order = f64::from(2 * nodes - 1);
        let errors = grid.map(|steps| {
            let scheme = format!("scheme = radau_iia({nodes});");
            let error = error(&format!("method fesd {{ steps = {steps}; {scheme} }}"));
            (steps, error)
        });
        let found = fitted_order(&errors);
        assert!(found > order - 0.3, "{nodes}: {found} {errors:?}");
    }
    let smoothed = widths.map(|epsilon| {
        error(&format!(
            "tolerance 1e-9; method smoothing {{ epsilon = {epsilon}; law = tanh; }}"
        ))
    });
    let order = (smoothed[0] / smoothed[1]).log10();
    assert!((order - smoothing).abs() < 0.15, "{order} {smoothed:?}");
}

/// y' = x - r(s) with r(1) = 1 comes down from y = 0.2 to the surface; z' = s z then is known by ∫ s dx.
fn one_switch(reading: &str, integral: impl Fn(f64) -> f64) {
    let model = format!(
        "model m {{ state x = 0.2; state y = 0.2; state z = 1; switch s = sign(y) sliding nonlinear;
           x' = 1; y' = x - ({reading}); z' = s*z; }}"
    );
    let enters = 0.8 - 0.24_f64.sqrt();
    let slides = integral(0.8) - integral(0.2 + enters);
    agree(&model, ("z", 0.6, (enters + slides).exp()), GRIDS, FIRST);
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

/// Example 2 of Jeffrey 2014.
const MODES: &str = "model m { state x = 0.9; state y = 0.05; switch s = sign(y) sliding nonlinear;
   x' = 2*s^2 - 1; y' = 2*s^2 - s - x; }";

/// His block on a belt, with the static friction of a hidden term.
const BELT: &str =
    "model m { param c = 0.3; state x = 2.4; state u = 1; switch s = sign(u) sliding nonlinear;
   x' = u - 1; u' = -s - x - c*(u - 1); hidden on s { u' += -2*pi*s*(1 - s^2); } }";

#[test]
fn by_three_roads_on_one_of_two_modes() {
    // Up to t = 2 the state stays on the mode that it entered, although from x = 1 on there is another one.
    let enters = 0.1 + 0.11_f64.sqrt();
    let first = (1.0 - (1.0 + 8.0 * (0.9 + enters)).sqrt()) / 4.0;
    let time = |s: f64| integral(|s| (1.0 - 4.0 * s) / (1.0 - 2.0 * s * s), first, s);
    let s = root(|s| enters + time(s) - 2.0, first, 0.25);
    agree(
        MODES,
        ("x", 2.0, 2.0 * s * s - s),
        [[8, 16, 32], [4, 8, 16]],
        FIRST,
    );
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
    let grows = first + integral(a, first, second) + integral(|t| a(t) * b(t), second, 3.0);
    agree(model, ("z", 3.0, grows.exp()), GRIDS, FIRST);
}

#[test]
fn by_three_roads_beyond_a_fold() {
    // The mode ends at s = 1/4, x = -1/8, from where the state leaves with (1, 1 - x). Smoothed, it is late by ε^(2/3).
    let enters = 0.1 + 0.11_f64.sqrt();
    let first = (1.0 - (1.0 + 8.0 * (0.9 + enters)).sqrt()) / 4.0;
    let slides = integral(|s| (1.0 - 4.0 * s) / (1.0 - 2.0 * s * s), first, 0.25);
    let left = 3.0 - enters - slides;
    agree(
        MODES,
        ("x", 3.0, left - 0.125),
        [[16, 32, 64], [8, 16, 32]],
        ([1e-5, 1e-6], 2.0 / 3.0),
    );
    let text = format!("{MODES} simulate run of m {{ horizon 3; tolerance 1e-10; method fesd; }}");
    let found = solved(&text, "run");
    let folds = times(&found, EventKind::Fold);
    assert!(
        folds.len() == 1 && (folds[0] - enters - slides).abs() < 1e-9,
        "{folds:?}"
    );
    let y = end(&found, "y")[0];
    assert!((y - (1.125 * left - 0.5 * left * left)).abs() < 1e-9, "{y}");
}

#[test]
fn by_three_roads_a_block_is_released() {
    // While it slips w = x + 1 swings; it sticks where w' = -1, with x falling by 1 until the strongest friction holds
    // it no longer, at a fold, and slips from there on.
    let swings = |[w, v]: [f64; 2], t: f64| {
        let (decay, omega) = (0.15, (1.0_f64 - 0.15 * 0.15).sqrt());
        let b = (v + decay * w) / omega;
        let (sine, cosine) = (omega * t).sin_cos();
        let scale = (-decay * t).exp();
        let position = scale * (w * cosine + b * sine);
        let speed = scale * omega * (b * cosine - w * sine) - decay * position;
        [position, speed]
    };
    let sticks = root(|t| swings([3.4, 0.0], t)[1] + 1.0, 0.0, 1.0);
    let s = ((1.0 + 2.0 * PI) / (6.0 * PI)).sqrt();
    let released = 0.3 - (s + 2.0 * PI * s * (1.0 - s * s));
    let fold = sticks + swings([3.4, 0.0], sticks)[0] - 1.0 - released;
    let exact = swings([released + 1.0, -1.0], 8.0 - fold)[0] - 1.0;
    agree(BELT, ("x", 8.0, exact), GRIDS, ([1e-3, 1e-4], 2.0 / 3.0));
    let text = format!("{BELT} simulate run of m {{ horizon 8; tolerance 1e-10; method fesd; }}");
    let found = solved(&text, "run");
    let folds = times(&found, EventKind::Fold);
    assert!(
        folds.len() == 1 && (folds[0] - fold).abs() < 1e-9,
        "{folds:?}"
    );
}

#[test]
fn from_fold_to_fold() {
    // With r = s/0.9, φ = x - (4r³ - 3r): at r = ∓½, x = ±1 the state goes on at r = ±1, while x' = -s.
    let text = "model m { state x = 0.5; state y = 0.1; switch s = sign(y) sliding nonlinear;
           x' = -s; y' = x - (4*(s/0.9)^3 - 3*s/0.9); }
         simulate run of m { horizon 12; tolerance 1e-10; method fesd; output x, y, s every 0.01; }";
    let found = solved(text, "run");
    let folds = times(&found, EventKind::Fold);
    assert!(folds.len() >= 3, "{folds:?}");
    // dt = dx/(-s) = (12 r² - 3)/(-0.9 r) dr from r = -1 to -½.
    let half = (4.5 - 3.0 * 2.0_f64.ln()) / 0.9;
    for pair in folds.windows(2) {
        assert!((pair[1] - pair[0] - half).abs() < 1e-8, "{folds:?} {half}");
    }
    // What is reported between the nodes is on the branch, too.
    let [x, s] = ["x", "s"].map(|name| {
        let all = found.samples.states.iter().chain(&found.samples.outputs);
        let series = all.into_iter().find(|series| series.name == name);
        series
            .map(|series| series.values.clone())
            .unwrap_or_default()
    });
    let slid = found.samples.time.iter().zip(x.iter().zip(&s));
    let slid = slid.filter(|(t, _)| **t > folds[0]);
    let off = slid.map(|(_, (x, s))| (x - (4.0 * (s / 0.9).powi(3) - 3.0 * s / 0.9)).abs());
    let worst = off.fold(0.0, f64::max);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn folds_of_switches_that_interact_end_a_run() {
    let text = "model m { state x = 0.9; state y = 0.05; state z = 0.02;
           switch s = sign(y) sliding nonlinear; switch r = sign(z) sliding nonlinear;
           x' = 2*s^2 - 1; y' = 2*s^2 - s - x + 0.1*r; z' = -r^3 - 0.5*r + 0.1*s; }
         simulate run of m { horizon 5; tolerance 1e-8; method fesd; }";
    let found = run(text, "run");
    assert_eq!(
        found.status,
        Status::NumericalFailure,
        "{:?}",
        found.history.events
    );
}

#[test]
fn a_signal_from_data_moves_what_slides() {
    // A block is pushed by what a table says, which jumps at 1 and 2: it comes to rest at 1/3, sticks with F(s) = u, and
    // is torn loose by the last push, beyond the strongest friction. z' = s.
    let model = "model m { signal u = table(\"push.csv\", \"u\", fit = FIT); state v = -0.5; state z = 0;
       switch s = sign(v) sliding nonlinear; v' = u - s; hidden on s { v' += -2*pi*s*(1 - s^2); } z' = s; }
     simulate run of m { horizon 3; tolerance 1e-10; METHOD }";
    let data = DataFiles(vec![(
        "push.csv",
        "t,u\n0,0.5\n1,2.9\n2,3.5\n3,3.5\n".to_owned(),
    )]);
    let friction = |s: f64| s + 2.0 * PI * s * (1.0 - s * s);
    let held = |u: f64| root(|s| friction(s) - u, 0.0, 0.6215);
    let jumps = -1.0 / 3.0 + 2.0 / 3.0 * held(0.5) + held(2.9) + 1.0;
    for method in ["", "method fesd;"] {
        let text = model.replace("METHOD", method);
        let found = run_with_data(&text.replace("FIT", "hold"), &data, "run");
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        let (v, z) = (end(&found, "v")[0], end(&found, "z")[0]);
        assert!((v - 2.5).abs() < 1e-9, "{method} {v}");
        assert!((z - jumps).abs() < 1e-9, "{method} {z} {jumps}");

        // Along lines it is torn loose in a fold, at u = F between t = 1 and 2.
        let found = run_with_data(&text.replace("FIT", "linear"), &data, "run");
        assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
        let folds = 1.0 + (3.018145824447 - 2.9) / 0.6;
        let found_at = times(&found, EventKind::Fold);
        assert!(
            found_at.len() == 1 && (found_at[0] - folds).abs() < 1e-9,
            "{method} {found_at:?} {folds}"
        );
        let v = 0.5 * (3.018145824447 + 3.5) * (2.0 - folds) + 3.5 - (3.0 - folds);
        assert!((end(&found, "v")[0] - v).abs() < 1e-9, "{method}");
    }
}

/// Random data that jump, bend and turn while one or two nonlinear switches cross, slide, and are torn loose in folds: from
/// event to event and by finite elements alike.
#[test]
fn data_move_what_slides_alike() {
    let mut random = Random(5);
    for _ in 0..MOVED {
        let fit = random.of(&["hold", "hold", "linear", "cubic"]);
        let rows: String = [0.0, 0.7, 1.5, 2.2, 3.0]
            .map(|t| format!("{t},{}\n", random.rounded(-1.0, 1.0)))
            .concat();
        let data = DataFiles(vec![("push.csv", format!("time,r\n{rows}"))]);
        let [c0, c1, c2, c3, by, own, other, push]: [f64; 8] = [
            (-0.5, 0.5),
            (-1.5, 0.8),
            (-1.0, 1.0),
            (-2.0, 2.0),
            (-1.0, 1.0),
            (-1.2, -0.3),
            (-0.5, 0.5),
            (-1.0, 1.0),
        ]
        .map(|(lo, hi)| random.rounded(lo, hi));
        let second = match random.below(2) {
            0 => String::new(),
            _ => format!(
                "state y = {}; switch q = sign(y) sliding nonlinear; y' = {own}*q + ({other})*s + ({push})*r; z' += {by}*q;",
                random.rounded(-0.5, 0.5)
            ),
        };
        let model = format!(
            "model m {{ signal r = table(\"push.csv\", \"r\", fit = {fit}); state x = {}; state z = 0;
               switch s = sign(x) sliding nonlinear; x' = {c0} + ({c1})*s + ({c2})*s^2 + ({c3})*s^3 + r; z' = s; {second} }}",
            random.rounded(-0.5, 0.5)
        );
        let ends = ["event", "fesd"].map(|method| {
            let text = format!("{model}\nsimulate run of m {{ horizon 3; method {method}; }}");
            let found = run_with_data(&text, &data, "run");
            let failure = &found.failure;
            assert_eq!(found.status, Status::Solved, "{failure:?}\n{text}\n{rows}");
            [end(&found, "x")[0], end(&found, "z")[0]]
        });
        let [events, elements] = &ends;
        let differ = events
            .iter()
            .zip(elements)
            .any(|(a, b)| (a - b).abs() > 1e-6);
        assert!(!differ, "{ends:?}\n{model}\n{rows}");
    }
}

#[test]
fn elements_pass_a_triple_root() {
    // s = ∛x down through x = 0, where S = -3s² vanishes: z' = s is 1 until y = 0.1 - t/2 - t²/2 is zero, and ∫ s dt
    // from there on is ¾ (x^(4/3) - 0.7^(4/3)).
    let text =
        "model m { state x = 0.5; state y = 0.1; state z = 0; switch s = sign(y) sliding nonlinear;
           x' = -1; y' = x - s^3; z' = s; }
         simulate run of m { horizon 1.2; tolerance 1e-8; method fesd; }";
    let found = solved(text, "run");
    let enters = 0.45_f64.sqrt() - 0.5;
    let slides = 0.75 * ((0.5 - enters).powf(4.0 / 3.0) - 0.7_f64.powf(4.0 / 3.0));
    let error = (end(&found, "z")[0] - enters - slides).abs();
    assert!(error < 1e-4, "{error}");
    assert!(
        found
            .quality
            .error_estimate
            .is_some_and(|estimate| 30.0 * estimate > error),
        "{error}"
    );
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
        let kinds: Vec<EventKind> = found
            .history
            .events
            .iter()
            .map(|event| event.kind)
            .collect();
        assert_eq!(kinds, [EventKind::EnterSliding, EventKind::Branch]);
        let taken = found.history.events[1]
            .sliding
            .iter()
            .find(|mode| mode.taken);
        assert!(taken.is_some_and(|mode| (mode.value - 0.5 * side).abs() < 1e-12));
    }
}
