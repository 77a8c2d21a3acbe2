//! Gradients of weighted sums of what a run reports, which go back through the run: against the derivatives that go forward, and
//! against closed forms.

use crate::sensitivity::affine;
use nsd_tests::random::Random;
use nsdc::expr::Exprs;
use nsdc::files::Memory;
use nsdc::report::Trajectory;
use nsdc::session::Session;
use nsdc::{Messages, Options, Project};

type Weights = Vec<(String, Vec<f64>)>;

fn run(text: &str, tolerance: f64, weights: Option<Weights>) -> Trajectory {
    let options = Options {
        tolerance: Some(tolerance),
        ends_alone: true,
        weights,
        ..Options::default()
    };
    let files: Memory = [("model.nsd", text), ("r.csv", DATA)].into_iter().collect();
    let project = Project::from_files("model.nsd", files).expect("there is a text");
    let found = project.run("s", &options, &mut ());
    found.expect("it compiles and is differentiated").trajectory
}

/// What models read.
const DATA: &str = "time,r\n0,0\n0.9,1\n1.5,0\n2.2,2\n3,1\n";

/// Random weights of all states and outputs at all rows, none where a derivative is not known.
fn weights(run: &Trajectory, seed: u64) -> Weights {
    let mut random = Random(seed);
    let samples = &run.samples;
    let all = samples.states.iter().chain(&samples.outputs).enumerate();
    let of = |(place, series): (usize, &nsdc::report::Series)| {
        let is_known = |at: usize| {
            samples.sensitivities.iter().all(|by| {
                let mut own = by.states.iter().chain(&by.outputs);
                own.nth(place).is_some_and(|own| own.values[at].is_finite())
            })
        };
        let weights = (0..series.values.len()).map(|at| match is_known(at) {
            true => random.rounded(-1.0, 1.0),
            false => 0.0,
        });
        (series.name.clone(), weights.collect())
    };
    all.map(of).collect()
}

/// The same gradient from derivatives of all that is weighed, with how large its terms are.
fn contracted(run: &Trajectory, weights: &Weights) -> Vec<[f64; 2]> {
    let by = run.samples.sensitivities.iter().map(|by| {
        let all = by.states.iter().chain(&by.outputs).zip(weights);
        let mut sums = [0.0, 0.0];
        for (series, (name, weights)) in all {
            assert_eq!(*name, series.name);
            for (weight, value) in weights.iter().zip(&series.values) {
                if *weight != 0.0 {
                    sums[0] += weight * value;
                    sums[1] += (weight * value).abs();
                }
            }
        }
        sums
    });
    by.collect()
}

/// Asserts that both passes agree to 1e-11; whether the second one has gone backward.
fn agrees(text: &str, seed: u64) -> bool {
    agrees_to(text, seed, 1e-11)
}

fn agrees_to(text: &str, seed: u64, share: f64) -> bool {
    let forward = run(text, 1e-13, None);
    let weights = weights(&forward, seed);
    let expected = contracted(&forward, &weights);
    let back = run(text, 1e-13, Some(weights));
    let found = back.samples.gradient.clone().expect("it was asked for");
    assert_eq!(found.len(), expected.len());
    for (found, [sum, size]) in found.iter().zip(expected) {
        let error = (found - sum).abs();
        assert!(
            error <= share * size,
            "{found} {sum}: {error:e} of {size}\n{text}"
        );
    }
    back.samples.sensitivities.is_empty()
}

const SYSTEMS: [&str; 17] = [
    "model m { param k = 2; param a = 1; state x = a; x' = -k*sign(x) + time; }
     simulate s of m { horizon 3; sensitivity to k, a; }",
    "model m { param g = 9; param e = 0.5; param h = 2; state q = h; state v = 0;
       q' = v; v' = -g; jump floor when q <= 0 and v < 0 { v := -e*v; } }
     simulate s of m { horizon 1.9; sensitivity to g, e, h; }",
    "model m { param w = 2; param r = 0.8; state x[2] = [1.3, 0.2]; output e = r*dot(x, x);
       x[1]' = if dot(x, x) > r^2 then -0.3*x[1] - w*x[2] else 0.1*x[1] - 3*x[2];
       x[2]' = if dot(x, x) > r^2 then w*x[1] - 0.3*x[2] else 3*x[1] + 0.1*x[2]; }
     simulate s of m { horizon 3; sensitivity to r, w, x[1] at 0; }",
    "model m { param mu = 0.6; param k = 1.1; param vb = 0.3; param d = 0.1; state q = 0; state v = 1;
       output u = mu*sign(v - vb); q' = v; v' = -k*q - d*v - mu*sign(v - vb)*exp(-abs(v - vb)); }
     simulate s of m { horizon 12; sensitivity to mu, k, vb, d, q at 0, v at 0; }",
    "model m { param a = 1; param b = 0.4; state x[2] = [0.7, -0.6]; state y = 0;
       x[1]' = -a*sign(x[1]) + 0.3*sign(x[2]) + 0.2*y; x[2]' = -0.8*sign(x[2]) + b*x[1]; y' = 1; }
     simulate s of m { horizon 8; sensitivity to a, b, x[1] at 0, x[2] at 0; }",
    "model m { param a = 0.7; state T = 19; switch on = hysteresis(T, on = 18, off = 21, start = 1);
       T' = 5*on - a*(T - 10)/10; }
     simulate s of m { horizon 9; sensitivity to a, T at 0; }",
    "model m { param mu = 0.6; param e = 0.5; param g = 9.81; state q[2] = [0, 1]; state v[2] = [2, 0]; q' = v;
       mechanics q, v { mass = 1; force = [0, -g];
         contact floor { gap = q[2]; slip = v[1]; restitution = e; friction = mu; } } }
     simulate s of m { horizon 1.2; sensitivity to mu, e, g, q[2] at 0, v[1] at 0; }",
    "model m { param T = 0.4; param a = 1.5; state x = 1; x' = if time < T then -a*x else a*sin(x); }
     simulate s of m { horizon 1; sensitivity to T, a, x at 0; }",
    "model m { param a = 1.2; param b = 0.5; state x = 1; algebraic z = 0.5; x' = -z + sign(x - b)*0.1; 0 = z^3 + a*z - x; }
     simulate s of m { horizon 3; sensitivity to a, b, x at 0; }",
    "model m { param r = 1.5; param w = 2; state q[2] = [0.5, 0]; q' = [1, w*cos(w*time)];
       project q onto { dot(q, q) <= r^2; }; }
     simulate s of m { horizon 3; sensitivity to r, w, q[1] at 0; }",
    "model m { param p = 0.7; state x = 1; algebraic z = 0.5; x' = -x*z; 0 = z^3 + z - p*x;
       jump halve when x >= 0.9 { x := 0.5*x + 0.2*z; } }
     simulate s of m { horizon 1; sensitivity to p, x at 0; }",
    "model m { param k = 2; param a = 1; state x = a; output u = sign(x); x' = -k*sign(x) + time; }
     simulate s of m { horizon 3; sensitivity to k, a; }",
    "model m { param mu = 0.6; param k = 1.1; param vb = 0.3; param d = 0.1; state q = 0.1; state v = 1;
       output u = mu*sign(v - vb*cos(time)); q' = v;
       v' = -k*q - d*v - mu*sign(v - vb*cos(time))*exp(-abs(v - vb*cos(time))); }
     simulate s of m { horizon 12; sensitivity to mu, k, d, v at 0; }",
    "model m { param a = 1; state x = 1; state y = 0.1; state z = 0.2; output e = sign(x - y*sin(time));
       x' = -2*a*sign(x - y*sin(time)) + 0.3*z*(1 + time); y' = x*(1 + time) + 0.1*y;
       z' = -sign(x - y*sin(time))*x + time*z; }
     simulate s of m { horizon 2; sensitivity to a, x at 0, y at 0, z at 0; }",
    "model m { signal r = table(\"r.csv\", \"r\", fit=cubic); param a = 1; param b = 0.5; state x = 1; algebraic z = 0.5;
       x' = -a + 0.3*sign(x - b) - 0.1*z; 0 = z^3 + z - x - r; }
     simulate s of m { horizon 3; sensitivity to a, b, x at 0; }",
    "model m { signal r = table(\"r.csv\", \"r\", fit=hold); param a = 1; param b = 0.5; state x = 1; algebraic z = 0.5;
       x' = -a + 0.3*sign(x - b) - 0.1*z; 0 = z^3 + z - x - r*time; }
     simulate s of m { horizon 3; sensitivity to a, b, x at 0; }",
    "model m { param p = 1; state x = 1; state u = 0; x' = -x + u; u' = 0;
       jump a1 when x <= 0.5 { u := 3*p*x; } jump a2 when x <= 0.5 { u := 3*p*x; } }
     simulate s of m { horizon 1; sensitivity to p, x at 0; }",
];

#[test]
fn both_passes_agree() {
    for (seed, text) in SYSTEMS.iter().enumerate() {
        assert!(agrees(text, seed as u64), "it does not go backward\n{text}");
    }
}

/// Of random piecewise affine systems, which cross, slide and leave, the gradient is the same either way, and most are found by
/// going back.
#[test]
fn both_passes_agree_for_random_systems() {
    let (mut back, mut all) = (0, 0);
    for seed in 0..60 {
        let text = affine(seed);
        if run(&text, 1e-13, None).failure.is_none() {
            all += 1;
            back += usize::from(agrees(&text, seed));
        }
    }
    assert!(all >= 40 && 4 * back >= 3 * all, "{back} of {all}");
}

/// A random model of what depends on time by itself where an instant does not move: surfaces that move and are slid on, outputs
/// that see α, data, algebraic states, and jumps.
fn moving(seed: u64) -> String {
    let mut random = Random(seed);
    let data = random.of(&["linear", "cubic", "hold"]);
    let has = [0; 4].map(|_| random.below(3) > 0);
    let mut number = |lo: f64, hi: f64| random.rounded(lo, hi);
    let mut text = format!(
        "model m {{ signal r = table(\"r.csv\", \"r\", fit={data});
           param a = {}; param b = {}; param k = {}; state x = {}; state y = {};",
        number(0.5, 1.5),
        number(0.2, 0.8),
        number(0.8, 2.5),
        number(0.5, 1.5),
        number(-0.5, 0.5),
    );
    let surfaces = [
        "x - b*sin(2*time)",
        "x - b*time",
        "x - b + 0.2*r*time",
        "x - b*cos(time) - 0.1*y",
    ];
    let equations = [
        "z^3 + z - x - r",
        "z^3 + z - b*x - r*time",
        "z + 0.2*sin(z) - y*cos(time) - x",
    ];
    let by_z = if has[0] { " - 0.3*z" } else { "" };
    let by_r = if has[1] { " + 0.4*r*a" } else { "" };
    let (c, d, e) = (number(0.2, 0.6), number(0.0, 0.4), number(0.5, 1.5));
    let psi = random.of(&surfaces);
    text += &format!(
        "output u = k*sign({psi})*(1 + 0.2*time);
         x' = -k*sign({psi}) + {c}*a*time{by_z}; y' = {e} + {d}*x*sin(time){by_r};"
    );
    if has[0] {
        let equation = random.of(&equations);
        text += &format!("algebraic z = 0.5; output o = z*time; 0 = {equation};");
    }
    if has[2] {
        text += &format!(
            "jump back when y >= 1 {{ y := 0.2*y + 0.1*time*a{by_z}; x := x + 0.3*b*time; }}"
        );
    }
    if has[3] {
        text += "state q = 0.1; state v = 1; output f = a*sign(v - b*cos(time)); q' = v;
           v' = -k*q - 0.1*x - a*sign(v - b*cos(time));";
    }
    text + "} simulate s of m { horizon 2.7; sensitivity to a, b, k, x at 0, y at 0; }"
}

/// Nothing differs in silence where functions depend on time by themselves.
#[test]
fn both_passes_agree_for_what_moves_by_itself() {
    let (mut back, mut all) = (0, 0);
    for seed in 0..100 {
        let text = moving(seed);
        if run(&text, 1e-13, None).failure.is_none() {
            all += 1;
            back += usize::from(agrees_to(&text, seed, 1e-9));
        }
    }
    assert!(all >= 80 && 4 * back >= 3 * all, "{back} of {all}");
}

/// Where it slides, α is t/k: at an instant that stands, whatever comes before it.
#[test]
fn a_row_does_not_move() {
    let text = SYSTEMS[11].replace("horizon 3", "horizon 3; output at [1.2]");
    let back = run(&text, 1e-12, Some(vec![("u".to_owned(), vec![1.0, 0.0])]));
    let found = back.samples.gradient.as_ref().expect("it was asked for");
    assert!(back.samples.sensitivities.is_empty());
    for (found, exact) in found.iter().zip([-0.3, 0.0]) {
        assert!((found - exact).abs() < 1e-11, "{found} {exact}");
    }
}

/// What one direction does beside a large one, of which it is no part: y = ∫ x where x - s goes to 0 as exp(-20 t), and s = q.
#[test]
fn directions_are_known_in_their_own_scales() {
    for q in [1.0, 1e6, 1e9] {
        let text = format!(
            "model m {{ param q = {q}; param q2 = 0; state s = q; state x = q + q2; state y = 0;
               s' = 0; x' = -20*(x - s); y' = x; }}
             simulate s of m {{ horizon 1; sensitivity to q, q2, x at 0; output at [1]; }}"
        );
        for tolerance in [1e-8, 1e-12] {
            let back = run(&text, tolerance, Some(vec![("y".to_owned(), vec![1.0])]));
            let found = back.samples.gradient.as_ref().expect("it was asked for");
            let own = (1.0 - (-20.0_f64).exp()) / 20.0;
            for (found, exact) in found.iter().zip([1.0, own, own]) {
                let error = (found / exact - 1.0).abs();
                assert!(error <= 1e-10, "{q}: {found} {exact}: {error:e}");
            }
        }
    }
}

/// x' = -k sign(x) + t from a meets the surface at k - √(k² - 2a), slides until k, and x = (t - k)²/2 then.
#[test]
fn a_relay_slides_and_leaves() {
    let text = SYSTEMS[0].replace("horizon 3", "horizon 3; output at [0.25, 3]");
    let back = run(&text, 1e-12, Some(vec![("x".to_owned(), vec![10.0, 1.0])]));
    let found = back.samples.gradient.clone().expect("it was asked for");
    // x(1/4) = a - k/4 + 1/32.
    for (found, exact) in found.iter().zip([-2.5 - 1.0, 10.0]) {
        assert!((found - exact).abs() < 1e-10, "{found} {exact}");
    }
}

/// Behind the first bounce of a ball, v = e √(2gh) - g (t - √(2h/g)).
#[test]
fn a_ball_bounces() {
    let text = SYSTEMS[1].replace("horizon 1.9", "horizon 1; output at [1]");
    let back = run(&text, 1e-13, Some(vec![("v".to_owned(), vec![1.0])]));
    let found = back.samples.gradient.clone().expect("it was asked for");
    let (g, e, h, t) = (9.0_f64, 0.5_f64, 2.0_f64, 1.0_f64);
    let by_g = e * (0.5 * h / g).sqrt() - t + 0.5 * (2.0 * h / g).sqrt();
    let by_e = (2.0 * g * h).sqrt();
    let by_h = e * (0.5 * g / h).sqrt() + 0.5 * (2.0 * g / h).sqrt();
    for (found, exact) in found.iter().zip([by_g, by_e, by_h]) {
        assert!((found - exact).abs() < 1e-10, "{found} {exact}");
    }
}

/// Two states meet their surfaces at one instant, and do so for all values of what they have in common: that is asked of each
/// direction at the start.
#[test]
fn what_meets_together_stays_together() {
    let text =
        "model m { param k = 0.5; param a = 1; param b = 1; state x = a; state y = a; state z = 0;
           x' = -b - k*sign(x); y' = -b - k*sign(y); z' = x + 2*y; }
         simulate s of m { horizon 2; sensitivity to k, a, b; }";
    assert!(agrees(text, 1), "it does not go backward");
}

/// In a row of masses the last ones move with the first spring at an order in time beyond any series: that is nothing at first,
/// and no reason not to know it.
#[test]
fn what_is_far_away_moves_in_the_end() {
    const N: usize = 20;
    let mut text = format!(
        "model m {{ param c = 20; state q[{N}] = zeros({N}); state v[{N}] = [sin(i) for i in 1..{N}]; q' = v; "
    );
    for i in 1..=N {
        let spring = |left: usize| match left {
            0 | N => "0".to_owned(),
            1 => "c*(q[2] - q[1])".to_owned(),
            left => format!("20*(q[{}] - q[{left}])", left + 1),
        };
        text += &format!("v[{i}]' = {} - {}; ", spring(i), spring(i - 1));
    }
    text += "} simulate s of m { horizon 5; sensitivity to c, v[1] at 0; output at [5]; }";
    assert!(agrees(&text, 2), "it does not go backward");
    let forward = run(&text, 1e-9, None);
    let forward = &forward.samples.sensitivities;
    assert!(forward.iter().all(|by| by.until.is_none()));
    let mut last = forward.iter().map(|by| by.states[0].values[N - 1]);
    assert!(last.all(|by| by.abs() > 1e-6));
}

/// A direction that leaves a surface has no derivative, however small what it does is beside what another one does and takes
/// back: of y - b - (c - 1)/10⁷ behind a jump to b, and of x - b at a start in b.
#[test]
fn what_is_small_is_not_overlooked() {
    for (text, known) in [
        (
            "model m { param b = 300; param c = 1; state x = 1; state y = 0; state z = 0; x' = -1; z' = y*c;
               y' = -0.1*sign(y - b - 1e-7*(c - 1)); jump up when x <= 0 { x := 1; y := b; } }
             simulate s of m { horizon 1.5; sensitivity to b, c; output at [1.5]; }",
            // From 1 on y = b.
            [0.5, f64::NAN],
        ),
        (
            "model m { param b = 1e8; state x = b; state z = 0; x' = -1 - 2*sign(x - b); z' = x; }
             simulate s of m { horizon 1; sensitivity to b, x at 0; output at [1]; }",
            [1.0, f64::NAN],
        ),
    ] {
        let back = run(text, 1e-10, Some(vec![("z".to_owned(), vec![1.0])]));
        let found = back.samples.gradient.as_ref().expect("it was asked for");
        assert!((found[0] - known[0]).abs() <= 1e-9, "{found:?}");
        assert!(found[1].is_nan(), "{found:?}");
        assert!(back.warnings.iter().any(|warning| warning.code == "W0735"));
    }
}

const DECAY: &str = "model m { param k = 1; state x[2] = [1, 2]; output y = x[1]^2; x' = -k*x; }
    simulate s of m { horizon 1; sensitivity to k; output at [0, 1]; }";

/// Messages without the ends of their lines.
fn told(messages: &Messages) -> String {
    let text = messages.to_string().replace('│', "");
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// What is refused says why, whoever runs it.
#[test]
fn what_is_no_weight_is_refused() {
    let weights = |names: &[(&str, &[f64])]| -> Weights {
        let all = names.iter();
        all.map(|&(name, own)| (name.to_owned(), own.to_vec()))
            .collect()
    };
    let one: &[f64] = &[1.0; 4];
    let good = weights(&[("x", one)]);
    let cases = [
        (weights(&[("x[1]", one)]), "`x[1]` is reported"),
        (weights(&[("k", one)]), "`k` is reported"),
        (
            weights(&[("x", one), ("y", &[0.0; 2]), ("x", one)]),
            "`x` has weights twice",
        ),
        (
            weights(&[("y", &[1.0, f64::NAN])]),
            "`y` has the weight NaN",
        ),
        (
            weights(&[("y", &[f64::INFINITY, 1.0])]),
            "`y` has the weight inf",
        ),
        (
            weights(&[("x", &[1.0; 3])]),
            "3 weights of `x` for 2 rows of 2 entries",
        ),
        (
            weights(&[("x", one), ("y", &[0.0; 3])]),
            "3 weights of `y` for 2 rows",
        ),
    ];
    let refused = |text: &str, weights: &Weights, why: &str| {
        let options = Options {
            weights: Some(weights.clone()),
            ..Options::default()
        };
        let project = Project::from_text("model.nsd", text);
        let exprs = Exprs::new();
        let mut session = Session::new(&exprs, &project);
        let found = [
            project.run("s", &options, &mut ()),
            session.run("s", &options, &mut ()),
        ];
        for found in found {
            let told = told(&found.expect_err("it is refused"));
            assert!(told.contains(why), "{told}");
        }
    };
    for (weights, why) in &cases {
        refused(DECAY, weights, why);
        refused(DECAY, weights, "E0534");
    }
    let without = DECAY.replace("sensitivity to k;", "");
    refused(&without, &good, "has no `sensitivity to`");
    refused(&without, &weights(&[]), "has no `sensitivity to`");
    let optimum = "model m { state x = 1; control u in [-1, 1] = 0; x' = u; }
        optimize s of m { horizon 1; intervals 5; minimize integral(x^2); }";
    refused(optimum, &good, "E0534");
    for method in [
        "timestepping { steps = 10; }",
        "adaptive",
        "smoothing { width = 0.1; }",
    ] {
        let other = DECAY.replace("horizon 1;", &format!("horizon 1; method {method};"));
        refused(&other, &good, "E0532");
    }
}

/// Sweeps have no gradients.
#[test]
fn a_sweep_has_no_weights() {
    let axes = vec![nsdc::study::sweep::Axis {
        name: "k".to_owned(),
        values: vec![1.0, 2.0],
    }];
    let grid = nsdc::study::sweep::Grid::new(axes, false).expect("there are few points");
    let options = Options {
        weights: Some(vec![("x".to_owned(), vec![1.0; 4])]),
        ..Options::default()
    };
    let project = Project::from_text("model.nsd", DECAY);
    let refused = project.sweep("s", &options, grid).map(|_| ());
    let told = told(&refused.expect_err("it is refused"));
    assert!(told.contains("E0534"), "{told}");
}

/// Of nothing, and of what has no rows since its run has not come there, there is nothing to be found.
#[test]
fn a_sum_of_nothing_does_not_move() {
    for weights in [vec![], vec![("x".to_owned(), vec![0.0; 4])]] {
        assert_eq!(
            run(DECAY, 1e-9, Some(weights)).samples.gradient,
            Some(vec![0.0])
        );
    }
    let grows = "model m { param k = 1; state x = 1; x' = k*x^2; }
        simulate s of m { horizon 2; sensitivity to k; output at [0, 2]; }";
    let failed = run(grows, 1e-9, Some(vec![("x".to_owned(), vec![0.0, 1.0])]));
    assert!(failed.failure.is_some() && failed.samples.gradient.is_none());
}

/// x(1) = x(0) e^{-k} and y(1) = y(0) + a, y(0) = k, and x(0) = a where it is not given: a session compiles the gradient of
/// x(1) + 10 y(1), and the derivatives, once for all values on the same sides of zero.
#[test]
fn a_second_gradient_compiles_nothing() {
    let text = "model m { param k = 1; param a = 2; state x = a; state y = k; x' = -k*x; y' = a; }
        simulate s of m { horizon 1; sensitivity to k, a, x at 0; output at [1]; }";
    let project = Project::from_text("model.nsd", text);
    let exprs = Exprs::new();
    let mut session = Session::new(&exprs, &project);
    let weights = vec![("x".to_owned(), vec![1.0]), ("y".to_owned(), vec![10.0])];
    let given = |all: &[(&str, f64)]| -> Vec<(String, f64)> {
        let all = all.iter().map(|&(name, value)| (name.to_owned(), value));
        all.collect()
    };
    for [first, second] in [
        [vec![("k", 0.5), ("a", 3.0)], vec![("k", 2.0), ("a", 1.5)]],
        [vec![("k", 0.5), ("x", 5.0)], vec![("k", 1.5), ("x", 0.1)]],
        [vec![("k", 0.0), ("a", 1.0)], vec![("k", 0.0), ("a", 0.5)]],
        [vec![("k", -0.5), ("a", 1.0)], vec![("k", -1.0), ("a", 0.5)]],
        [vec![], vec![]],
    ] {
        let mut known = None;
        for values in [first.clone(), second.clone(), first] {
            let value = |name: &str| values.iter().find(|(known, _)| *known == name).map(|v| v.1);
            let [k, a]: [f64; 2] =
                [("k", 1.0), ("a", 2.0)].map(|(name, own)| value(name).unwrap_or(own));
            let (x, starts) = (value("x").unwrap_or(a), value("x").is_none());
            let fades = (-k).exp();
            let of_x = [-x * fades, if starts { fades } else { 0.0 }, fades];
            let expected = [of_x[0] + 10.0, of_x[1] + 10.0, fades];
            for weights in [Some(weights.clone()), None] {
                let options = Options {
                    values: given(&values),
                    tolerance: Some(1e-12),
                    weights,
                    ..Options::default()
                };
                let run = session.run("s", &options, &mut ()).expect("it compiles");
                let samples = &run.trajectory.samples;
                let is_known = known == Some(exprs.n_nodes());
                assert_eq!(run.trajectory.quality.stats.compile_s == 0.0, is_known);
                known = Some(exprs.n_nodes());
                match &samples.gradient {
                    Some(found) => near(found, &expected),
                    None => {
                        let by = samples.sensitivities.iter();
                        let found: Vec<f64> = by.map(|by| by.states[0].values[0]).collect();
                        near(&found, &of_x);
                    }
                }
            }
        }
    }
    assert_eq!(session.kept(), 5);
}

fn near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }
}

/// Where one of two directions has no derivative, the other one keeps its own.
#[test]
fn what_is_lost_for_one_parameter_is_known_for_the_other() {
    let text = "model m { param a = 0.5; state x = 0; state y = 1; x' = -a - sign(x); y' = -a*y; }
        simulate s of m { horizon 1; sensitivity to a, x at 0; output at [1]; }";
    let back = run(text, 1e-12, Some(vec![("y".to_owned(), vec![1.0])]));
    let found = back.samples.gradient.as_ref().expect("it was asked for");
    assert!(
        (found[0] + (-0.5_f64).exp()).abs() < 1e-10 && found[1].is_nan(),
        "{found:?}"
    );
    assert!(back.warnings.iter().any(|warning| warning.code == "W0735"));
}
