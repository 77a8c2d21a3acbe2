//! Derivatives of runs by finite elements: against closed forms, against those of runs from event to event, and, on a grid,
//! against differences of the runs themselves.

use std::path::Path;

use nsdc::report::{Sensitivity, Trajectory};
use nsdc::{Options, Project};

use crate::sensitivity::{affine, run_within, slopes, undifferentiated, warned};

/// A text with these settings in its experiment `s`.
fn with(text: &str, settings: &str) -> String {
    text.replacen(
        "simulate s of m {",
        &format!("simulate s of m {{ {settings}"),
        1,
    )
}

/// The derivatives of a run that knows them all.
fn known(text: &str, settings: &str, tolerance: Option<f64>) -> Trajectory {
    let run = run_within(&with(text, settings), tolerance);
    assert!(
        run.failure.is_none() && !warned(&run),
        "{:?} {:?}",
        run.failure,
        run.warnings
    );
    run
}

fn near(found: f64, expected: f64, within: f64) {
    let error = (found - expected).abs();
    assert!(
        error <= within * (1.0 + expected.abs()),
        "{found} {expected}"
    );
}

const CIRCLE: &str = "model m { param w = 2*pi; state x[2] = [exp(-1), 0]; let c = dot(x, x) - 1;
      region inside where c < 0 { x' = [1, w; -w, 1]*x; }
      region outside where c > 0 { x' = [1, -w; w, 1]*x; } }
    simulate s of m { horizon 1.6; sensitivity to w, x at 0; }";

/// From (r, 0) the circle is met at t = -log r, where the angle turns back: x = r eᵗ (cos a, sin a), a = w (t + 2 log r).
/// Its derivatives at 1.6 by w, r and the angle at the start, over r.
fn of_circle() -> [[f64; 2]; 3] {
    let (w, t, r) = (2.0 * std::f64::consts::PI, 1.6_f64, (-1.0_f64).exp());
    let (sin, cos) = (w * (t - 2.0)).sin_cos();
    let size = r * t.exp();
    let turned = [-size * sin, size * cos];
    let by_r = |k: usize| [cos, sin][k] * size / r + turned[k] * 2.0 * w / r;
    [
        turned.map(|v| (t - 2.0) * v),
        [by_r(0), by_r(1)],
        turned.map(|v| v / r),
    ]
}

#[test]
fn a_circle_is_crossed() {
    let run = known(CIRCLE, "method fesd;", Some(1e-11));
    let all = &run.samples.sensitivities;
    for (by, expected) in all.iter().zip(of_circle()) {
        for (found, expected) in slopes(&run, by).iter().zip(expected) {
            near(*found, expected, 1e-9);
        }
    }
    for (by, expected) in all.iter().zip([0.0, -1.0_f64.exp(), 0.0]) {
        near(by.events[0].derivative, expected, 1e-9);
    }
}

/// x' = -k sign(x) + t from a: it meets the surface at k - √(k² - 2a), slides until k, and x = (t - k)²/2 then.
#[test]
fn a_relay_slides_and_leaves() {
    let text = "model m { param k = 2; param a = 1; state x = a; output u = sign(x); x' = -k*sign(x) + time; }
        simulate s of m { horizon 3; output at [1.5, 3]; sensitivity to k, a; }";
    for lowering in ["", "lower step;"] {
        let run = known(text, &format!("method fesd; {lowering}"), Some(1e-11));
        let [k, a] = [0, 1].map(|d| &run.samples.sensitivities[d]);
        let root = 2.0_f64.sqrt();
        let events = |by: &Sensitivity| [0, 1].map(|at| by.events[at].derivative);
        for (found, expected) in [
            (slopes(&run, k), [-1.0, 0.0]),
            (slopes(&run, a), [0.0, 0.0]),
            (events(k).to_vec(), [1.0 - 2.0 / root, 1.0]),
            (events(a).to_vec(), [1.0 / root, 0.0]),
            // While it slides sign(x) is t/k.
            (k.outputs[0].values.clone(), [-1.5 / 4.0, 0.0]),
        ] {
            found
                .iter()
                .zip(expected)
                .for_each(|(found, expected)| near(*found, expected, 1e-10));
        }
    }
}

/// Two surfaces that are slid on together: x' = -2 s + b r, y' = -c r + d s, z' = s with s = sign x, r = sign y, from 1.
/// x = 0 is met at t = 1/(2 - b), y = 0 after τ = (1 - (c - d) t)/(c - d b/2), and z = t + τ b/2 is all that is left.
#[test]
fn two_surfaces_are_slid_on() {
    let text = "model m { param b = 0.5; param c = 1; param d = 0.3; state x = 1; state y = 1; state z = 0;
          x' = -2*sign(x) + b*sign(y); y' = -c*sign(y) + d*sign(x); z' = sign(x); }
        simulate s of m { horizon 3; sensitivity to b, c, d; }";
    let (b, c, d) = (0.5, 1.0, 0.3);
    let first = 1.0 / (2.0 - b);
    let (rest, speed) = (1.0 - (c - d) * first, c - 0.5 * d * b);
    let tau = rest / speed;
    let of_tau = |rest: f64, by: f64| (rest - tau * by) / speed;
    let expected = [
        first * first + 0.5 * tau + 0.5 * b * of_tau(-(c - d) * first * first, -0.5 * d),
        0.5 * b * of_tau(-first, 1.0),
        0.5 * b * of_tau(first, -0.5 * b),
    ];
    for lowering in ["", "lower step;"] {
        let run = known(text, &format!("method fesd; {lowering}"), None);
        for (by, expected) in run.samples.sensitivities.iter().zip(expected) {
            let found = slopes(&run, by);
            [0.0, 0.0, expected]
                .iter()
                .zip(found)
                .for_each(|(e, f)| near(f, *e, 1e-12));
        }
    }
}

/// A heater that remembers: T tends to a = o + 5/k while it is on, from 17 to 20, and to o while it is off, down to 18.
#[test]
fn a_thermostat_remembers() {
    let text = "model m { param o = 10; param k = 0.2; state T = 17; switch heater = hysteresis(T, on = 18, off = 20);
          T' = -k*(T - o) + 5*heater; }
        simulate s of m { horizon 3; sensitivity to o, k, T at 0; }";
    let run = known(text, "method fesd; lower timefreezing;", Some(1e-10));
    let (o, k) = (10.0, 0.2);
    let a: f64 = o + 5.0 / k;
    let heats = ((a - 17.0) / (a - 20.0)).ln();
    let cools = (10.0_f64 / 8.0).ln();
    let by_a = (1.0 / (a - 17.0) - 1.0 / (a - 20.0)) / k;
    let off = [
        by_a,
        -heats / (k * k) - 5.0 / (k * k) * by_a,
        -1.0 / (k * (a - 17.0)),
    ];
    let on = [(1.0 / 8.0 - 1.0 / 10.0) / k, -cools / (k * k), 0.0];
    for ((by, off), on) in run.samples.sensitivities.iter().zip(off).zip(on) {
        let moves: Vec<f64> = by.events.iter().map(|moves| moves.derivative).collect();
        near(moves[0], off, 1e-9);
        near(moves[1], off + on, 1e-9);
    }
}

/// A ball that is let fall from h meets the floor at T (1 + 2e + 2e² + ..), T = √(2h/g), and leaves it with e^n g T.
#[test]
fn a_ball_bounces() {
    let text = "model m { param g = 9; param e = 0.5; param h = 2; state q = h; state v = 0;
          q' = v; v' = -g; jump floor when q <= 0 and v < 0 { v := -e*v; } }
        simulate s of m { horizon 1.5; sensitivity to g, e, h; }";
    let run = known(text, "method fesd; lower timefreezing;", Some(1e-10));
    let (g, e, h) = (9.0_f64, 0.5_f64, 2.0_f64);
    let first = (2.0 * h / g).sqrt();
    let all = [0, 1, 2].map(|d| &run.samples.sensitivities[d]);
    assert_eq!(all[0].events.len(), 2);
    for (n, instant, by_e) in [(0, 1.0, 0.0), (1, 1.0 + 2.0 * e, 2.0)] {
        let expected = [
            -first * instant / (2.0 * g),
            first * by_e,
            first * instant / (2.0 * h),
        ];
        for (by, expected) in all.iter().zip(expected) {
            near(by.events[n].derivative, expected, 1e-9);
        }
        // v behind the bounce, at its instant.
        let time = all[0].events[n].time;
        let row = run
            .samples
            .time
            .iter()
            .rposition(|t| *t == time)
            .expect("it is reported");
        let power = (n + 1) as f64;
        let thrown = e.powf(power) * g * first;
        let of_v = [0.5 * thrown / g, power * thrown / e, 0.5 * thrown / h];
        for ((by, of_v), moved) in all.iter().zip(of_v).zip(expected) {
            near(by.states[1].at(row)[0], of_v + g * moved, 1e-7);
        }
    }
}

/// On a grid the order of derivatives is that of the method, whatever switches: in the interior, where a surface is crossed,
/// and with Gauss methods on a curved surface that is slid on.
#[test]
fn derivatives_have_the_order_of_the_method() {
    let bent =
        "model m { param k = 1.5; param a = 0.7; state x = 1; state y = 0; let c = x + 0.1*y^2;
          x' = -k*sign(c) + a*sin(2*y) + 0.2*x*y; y' = 1 + 0.1*x; }
        simulate s of m { horizon 3; sensitivity to k, a, x at 0; }";
    let of_events = known(bent, "", Some(1e-13));
    let all = of_events.samples.sensitivities.iter();
    let of_bent: Vec<f64> = all.flat_map(|by| slopes(&of_events, by)).collect();
    let circle: Vec<f64> = of_circle().concat();
    for (text, expected, scheme, order, steps) in [
        (CIRCLE, &circle, "radau_iia(2)", 3.0, 40),
        (CIRCLE, &circle, "gauss(2)", 4.0, 40),
        (CIRCLE, &circle, "radau_iia(3)", 5.0, 40),
        (bent, &of_bent, "radau_iia(2)", 3.0, 60),
        (bent, &of_bent, "gauss(2)", 4.0, 60),
    ] {
        let error = |steps: usize| {
            let settings = format!("method fesd {{ scheme = {scheme}; steps = {steps}; }}");
            let run = known(text, &settings, None);
            let all = run.samples.sensitivities.iter();
            let found: Vec<f64> = all.flat_map(|by| slopes(&run, by)).collect();
            let errors = found.iter().zip(expected).map(|(a, b)| (a - b).powi(2));
            errors.sum::<f64>().sqrt()
        };
        // Where in its step a switch is changes the factor.
        let errors = [error(steps), error(2 * steps), error(4 * steps)];
        let slope = (errors[0] / errors[2]).log2() / 2.0;
        assert!(slope >= order - 0.35, "{scheme}: {slope} {errors:?}");
    }
}

/// On a grid what is found is the derivative of the run itself, elements of equal length before a switch and projected ends
/// among it.
#[test]
fn derivatives_are_those_of_the_run_on_its_grid() {
    let text =
        "model m { param k = 1.5; param a = 0.7; state x = 1; state y = 0; let c = x + 0.1*y^2;
          x' = -k*sign(c) + a*sin(2*y) + 0.2*x*y; y' = 1 + 0.1*x; }
        simulate s of m { horizon 3; sensitivity to k; }";
    for settings in [
        "method fesd { scheme = gauss(2); steps = 7; elements = 3; }",
        "method fesd { scheme = radau_iia(2); steps = 10; elements = 2; }",
        "method fesd { scheme = lobatto_iiic(3); steps = 10; elements = 2; } lower step;",
    ] {
        let run = known(text, settings, None);
        let found = slopes(&run, &run.samples.sensitivities[0]);
        let project = Project::from_text("model.nsd", &undifferentiated(&with(text, settings)));
        let at = |k: f64| -> Vec<f64> {
            let options = Options {
                values: vec![("k".to_owned(), k)],
                ends_alone: true,
                ..Options::default()
            };
            let run = project
                .run("s", &options, &mut ())
                .expect("it runs")
                .trajectory;
            run.samples
                .states
                .iter()
                .map(|series| series.values[series.values.len() - 1])
                .collect()
        };
        let differences = |h: f64| -> Vec<f64> {
            let pairs = at(1.5 + h).into_iter().zip(at(1.5 - h));
            pairs.map(|(a, b)| (a - b) / (2.0 * h)).collect()
        };
        let (near_by, farther) = (differences(1e-3), differences(2e-3));
        for ((found, near_by), farther) in found.iter().zip(near_by).zip(farther) {
            near(*found, (4.0 * near_by - farther) / 3.0, 1e-9);
        }
    }
}

/// How far derivatives at the end, and of instants, by elements are from those by events where both are known, relative to
/// their sizes; how many are known and how many by elements alone or by events alone.
fn compared(by_events: &Trajectory, by_elements: &Trajectory) -> (f64, [usize; 3]) {
    let (mut farthest, mut counts) = (0.0_f64, [0; 3]);
    let pairs = by_events
        .samples
        .sensitivities
        .iter()
        .zip(&by_elements.samples.sensitivities);
    for (own, other) in pairs {
        assert_eq!(own.to, other.to);
        match (own.until, other.until) {
            (None, None) => counts[0] += 1,
            (Some(_), None) => counts[1] += 1,
            (None, Some(_)) => counts[2] += 1,
            _ => {}
        }
        let differs = |a: f64, b: f64| (a - b).abs() / (1.0 + a.abs());
        let states = slopes(by_events, own)
            .into_iter()
            .zip(slopes(by_elements, other));
        let is_same = own.events.len() == other.events.len();
        let events = own.events.iter().zip(&other.events).filter(|_| is_same);
        let events = events.map(|(a, b)| (a.derivative, b.derivative));
        let all = states.chain(events).map(|(a, b)| differs(a, b));
        farthest = all.filter(|error| !error.is_nan()).fold(farthest, f64::max);
    }
    (farthest, counts)
}

/// Of 50 random systems derivatives by elements are those by events.
#[test]
fn random_systems_agree_with_events() {
    let mut all = [0; 3];
    for seed in 1000..1050 {
        let text = affine(seed);
        let by_events = run_within(&text, Some(1e-11));
        let by_elements = run_within(&with(&text, "method fesd;"), Some(1e-10));
        if by_events.failure.is_some() || by_elements.failure.is_some() {
            continue;
        }
        let (farthest, counts) = compared(&by_events, &by_elements);
        assert!(farthest <= 1e-7, "seed {seed}: {farthest:.1e}\n{text}");
        all.iter_mut()
            .zip(counts)
            .for_each(|(sum, count)| *sum += count);
    }
    let [both, elements, events] = all;
    assert!(
        both >= 100 && events <= 6,
        "{both} by both, {elements} and {events} by one alone"
    );
}

/// Of examples with algebraic states, programs, projections, data, parts and friction, too.
#[test]
fn examples_agree_with_events() {
    for (file, experiment, to) in [
        ("stick_slip", "coulomb", "m, k, x at 0"),
        ("sliding_mode", "slides", "c, k, v at 0"),
        ("servo", "tracked", "lag, angle at 0"),
        ("buck", "ten_periods", "E, L, v at 0"),
        ("projected", "cut", "x[1] at 0, x[2] at 0"),
        ("convex", "program", "x at 0"),
        ("dispatch", "day", "cheap, dear"),
        ("rectifier", "rectifies", "L"),
        ("impact_like", "exact", "a, k, c"),
        ("parts", "one_alone", "a.mu, a.x at 0"),
        ("switching_cases", "switch", "beyond, x at 0"),
        ("epidemic", "held", "beta, gamma, I at 0"),
    ] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
        let project = Project::load(folder.join(format!("{file}.nsd"))).expect("it is there");
        let run = |method: &str| {
            let words = ["sensitivity to ", to].concat();
            let options = Options {
                settings: vec![
                    ("sensitivity".to_owned(), words),
                    ("method".to_owned(), format!("method {method}")),
                ],
                ends_alone: true,
                ..Options::default()
            };
            let run = project.run(experiment, &options, &mut ());
            run.expect("it is differentiated").trajectory
        };
        let (farthest, counts) = compared(&run("event"), &run("fesd"));
        let n = to.split(',').count();
        assert_eq!(counts, [n, 0, 0], "{file}");
        assert!(farthest <= 1e-6, "{file}: {farthest:.1e}");
    }
}

/// A weighted sum has the gradient that derivatives of what it is made of say.
#[test]
fn sums_have_gradients() {
    let text =
        "model m { param k = 2; param a = 1; state x = a; output u = x^2; x' = -k*sign(x) + time; }
        simulate s of m { horizon 3; output at [0.2, 2.5]; sensitivity to k, a; }";
    let gradient = |settings: &str| {
        let options = Options {
            weights: Some(vec![
                ("x".to_owned(), vec![0.3, 2.0, 0.0]),
                ("u".to_owned(), vec![-1.0, 0.5, 0.0]),
            ]),
            tolerance: Some(1e-11),
            ..Options::default()
        };
        let project = Project::from_text("model.nsd", &with(text, settings));
        let run = project.run("s", &options, &mut ()).expect("it runs");
        run.trajectory.samples.gradient.clone().expect("it has one")
    };
    // x(0.2) = a - 0.2 k + 0.02 = 0.62 and x(2.5) = (2.5 - k)²/2 = 1/8.
    let [first, last] = [0.3 - 2.0 * 0.62, 2.0 + 0.125];
    for (found, expected) in gradient("method fesd;")
        .iter()
        .zip([-0.2 * first - 0.5 * last, first])
    {
        near(*found, expected, 1e-9);
    }
}

/// Where there is no derivative both roads say so, at the same instant, for the same reason and surfaces.
#[test]
fn what_is_lost_is_said() {
    for (model, to) in [
        // A surface is touched.
        (
            "param a = 1; state x = 0; state y = 1; x' = 0.5 + sign(y); y' = 2*(time - 1)*a;",
            "a",
        ),
        // Two that interact are met at once.
        (
            "param a = 1; state x = -1; state y = -1; x' = a - 0.3*sign(y) - 0.2*sign(x); y' = 1 - 0.3*sign(x) - 0.2*sign(y);",
            "a, x at 0",
        ),
        // The start is on a surface that is crossed.
        ("param a = 1; state x = 0; x' = 2*a + sign(x);", "a, x at 0"),
        // The state stays at a tie of sliding.
        ("param a = 1; state x = 1; x' = -a*(1 + sign(x));", "a"),
    ] {
        let text =
            format!("model m {{ {model} }} simulate s of m {{ horizon 2; sensitivity to {to}; }}");
        let said = |settings: &str| {
            let run = run_within(&with(&text, settings), None);
            let warnings = run
                .warnings
                .into_iter()
                .filter(|warning| warning.code == "W0735");
            warnings
                .map(|warning| (warning.message, warning.span))
                .collect::<Vec<_>>()
        };
        assert_eq!(said("method fesd;"), said(""), "{model}");
        assert_eq!(said("method fesd; lower step;"), said(""), "{model}");
    }
}

/// What has no derivatives by elements is refused, and why is said.
#[test]
fn what_is_not_differentiated_is_refused() {
    let text = "model m { param e = 0.5; state q = 1; state v = 0; q' = v; v' = -10;
          jump floor when q <= 0 and v < 0 { v := -e*v; } }
        simulate s of m { horizon 1; sensitivity to e; }";
    for (settings, why) in [
        ("method fesd; lower impact;", "programs of their own"),
        ("method event; lower timefreezing;", "time is frozen"),
        (
            "method timestepping { steps = 10; }",
            "by `method timestepping`",
        ),
    ] {
        let project = Project::from_text("model.nsd", &with(text, settings));
        let found = project.run("s", &Options::default(), &mut ()).err();
        let found = found.expect("it is refused").to_string();
        assert!(found.contains("E0532") && found.contains(why), "{found}");
    }
}

/// Where a state is simple and its derivative is not, elements that serve the one are too long for the other: what is known
/// is right, and the rest is said to be unknown. The integral of sin(3t) is (1 - cos(3t))/3, and the swing of a pendulum
/// about its rest is cos(t).
#[test]
fn elements_that_are_too_long_for_derivatives_are_told() {
    type Exact = fn(f64) -> f64;
    let models: [(&str, &str, Exact); 2] = [
        ("param z = 0; state x = 1; x' = z*sin(3*time);", "z", |t| {
            (1.0 - (3.0 * t).cos()) / 3.0
        }),
        (
            "state x = 0; state v = 0; x' = v; v' = -sin(x);",
            "x at 0",
            f64::cos,
        ),
    ];
    for (model, by, exact) in models {
        for method in [
            "fesd",
            "fesd { scheme = gauss(2); }",
            "fesd { scheme = radau_iia(3); }",
        ] {
            let text = format!(
                "model m {{ {model} }} simulate s of m {{ horizon 10; output x at [2.5, 5, 10]; method {method}; sensitivity to {by}; }}"
            );
            let run = run_within(&text, Some(1e-10));
            assert!(run.failure.is_none(), "{:?}", run.failure);
            let found = &run.samples.sensitivities[0];
            let own = &found.states[0];
            let mut is_known = true;
            for (k, &t) in run.samples.time.iter().enumerate() {
                let slope = own.at(k)[0];
                is_known &= slope.is_finite();
                assert!(
                    slope.is_nan() || (slope - exact(t)).abs() < 1e-3,
                    "{method} {t}: {slope}"
                );
            }
            assert!(is_known || warned(&run), "{method}: {:?}", run.warnings);
        }
    }
}

/// An instant that is asked for and that of a switch of time are the same but for rounding: each row has the value and the
/// derivative of its own side, ±p and ±1.
#[test]
fn rows_at_an_event_are_on_their_own_sides() {
    let text = "model m { param p = 0.3; param q = 1; state x = 0.2; x' = sin(3*x) + p*step(time - 0.2*q); output o = p*sign(time - 0.2*q); }
        simulate s of m { horizon 2; output at [0.2, 2]; sensitivity to p, q; }";
    let run = known(text, "method fesd;", Some(1e-10));
    let (values, slopes) = (
        &run.samples.outputs[0],
        &run.samples.sensitivities[0].outputs[0],
    );
    for row in 0..run.samples.time.len() {
        near(slopes.at(row)[0], values.at(row)[0] / 0.3, 1e-12);
    }
    assert_eq!(run.samples.time.len(), 3);
}
