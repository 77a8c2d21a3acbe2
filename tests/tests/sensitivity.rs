//! Derivatives of runs by parameters and initial values, across every kind of event: against closed forms, and against
//! differences of runs with Richardson's extrapolation.

use std::fmt::Write;
use std::path::Path;

use nsd_tests::random::Random;
use nsdc::expr::Exprs;
use nsdc::files::Memory;
use nsdc::limit::{Cancel, Limit};
use nsdc::report::{Sensitivity, Trajectory};
use nsdc::session::Session;
use nsdc::syntax::ExperimentKind;
use nsdc::{Options, Project};

/// A run of the only experiment `s` of a text; within the tolerance of the experiment where none is given.
pub(crate) fn run_within(text: &str, tolerance: Option<f64>) -> Trajectory {
    let options = Options {
        tolerance,
        ends_alone: true,
        ..Options::default()
    };
    let project = Project::from_text("model.nsd", text);
    let found = project.run("s", &options, &mut ());
    found.expect("it compiles and is differentiated").trajectory
}

fn run_at(text: &str, tolerance: f64) -> Trajectory {
    run_within(text, Some(tolerance))
}

/// A text without what it is differentiated by.
pub(crate) fn undifferentiated(text: &str) -> String {
    let (before, rest) = text
        .split_once("sensitivity to")
        .expect("it is differentiated");
    let (_, behind) = rest.split_once(';').expect("a setting ends");
    format!("{before}{behind}")
}

/// States and outputs at the end.
fn ends(run: &Trajectory) -> Vec<f64> {
    let last = run.samples.time.len() - 1;
    let series = run.samples.states.iter().chain(&run.samples.outputs);
    series.flat_map(|series| series.at(last).to_vec()).collect()
}

/// Their derivatives.
pub(crate) fn slopes(run: &Trajectory, by: &Sensitivity) -> Vec<f64> {
    let last = run.samples.time.len() - 1;
    let series = by.states.iter().chain(&by.outputs);
    series.flat_map(|series| series.at(last).to_vec()).collect()
}

pub(crate) fn warned(run: &Trajectory) -> bool {
    run.warnings.iter().any(|warning| warning.code == "W0735")
}

/// Central differences of runs of the experiment with steps h, h/2 and h/4, extrapolated twice; with how far the last
/// extrapolation has moved them. None where a run fails.
pub(crate) fn extrapolated(
    session: &mut Session,
    experiment: &str,
    (name, value): (&str, f64),
    h: f64,
) -> Option<(Vec<f64>, f64)> {
    let mut at = |value: f64| -> Option<Vec<f64>> {
        let options = Options {
            values: vec![(name.to_owned(), value)],
            tolerance: Some(1e-13),
            ends_alone: true,
            ..Options::default()
        };
        let run = session.run(experiment, &options, &mut ()).ok()?.trajectory;
        run.failure.is_none().then(|| ends(&run))
    };
    let mut all = Vec::new();
    for h in [h, 0.5 * h, 0.25 * h] {
        let (high, low) = (at(value + h)?, at(value - h)?);
        let pairs = high.iter().zip(&low);
        all.push(
            pairs
                .map(|(a, b)| (a - b) / (2.0 * h))
                .collect::<Vec<f64>>(),
        );
    }
    let next = |fine: &[f64], coarse: &[f64], power: f64| -> Vec<f64> {
        let pairs = fine.iter().zip(coarse);
        pairs
            .map(|(f, c)| (power * f - c) / (power - 1.0))
            .collect()
    };
    let [first, second] = [next(&all[1], &all[0], 4.0), next(&all[2], &all[1], 4.0)];
    let last = next(&second, &first, 16.0);
    let moves = last
        .iter()
        .zip(&second)
        .map(|(a, b)| (a - b).abs() / (1.0 + a.abs()));
    let moves = moves.fold(0.0, f64::max);
    Some((last, moves))
}

/// What the value of a direction is in a run: of a parameter, or of a state at the start.
fn value(run: &Trajectory, to: &str) -> (String, f64) {
    let name = to.trim_end_matches(" at 0").to_owned();
    let all = match to.ends_with(" at 0") {
        true => &run.samples.states,
        false => &run.setup.parameters,
    };
    let entries = all
        .iter()
        .flat_map(|series| series.entry_names().into_iter().zip(series.at(0)));
    let found = entries.into_iter().find(|(entry, _)| *entry == name);
    let value = *found.expect("it is a state or a parameter").1;
    (name, value)
}

/// Asserts all derivatives at the end, and that none is lost, of accurate runs and within the tolerance of the experiment;
/// events that must have happened.
fn agrees(text: &str, n_events: usize) {
    let plain = Project::from_text("model.nsd", &undifferentiated(text));
    let exprs = Exprs::new();
    let mut session = Session::new(&exprs, &plain);
    for (tolerance, within) in [(Some(1e-13), 1e-8), (None, 1e-5)] {
        let run = run_within(text, tolerance);
        assert!(!warned(&run), "{:?}", run.warnings);
        let same = run_within(&undifferentiated(text), tolerance);
        for (end, same) in ends(&run).iter().zip(&ends(&same)) {
            assert!(
                (end - same).abs() <= 0.1 * within,
                "the run is the same: {end} {same}"
            );
        }
        let events = &run.samples.sensitivities[0].events;
        assert_eq!(events.len(), n_events, "{events:?}");
        for by in &run.samples.sensitivities {
            assert_eq!(by.until, None);
            let (name, value) = value(&run, &by.to);
            let h = 1e-3 * value.abs().max(0.1);
            let reference = extrapolated(&mut session, "s", (&name, value), h);
            let (reference, _) = reference.expect("runs beside it go through");
            let found = slopes(&run, by);
            assert_eq!(found.len(), reference.len());
            for (found, reference) in found.iter().zip(&reference) {
                let error = (found - reference).abs();
                assert!(
                    error <= within * (1.0 + reference.abs()),
                    "{}: {found} {reference}",
                    by.to
                );
            }
        }
    }
}

/// x' = -k sign(x) + t from a: it meets the surface at k - √(k² - 2a), slides until k, and x = (t - k)²/2 then.
#[test]
fn a_relay_slides_and_leaves() {
    let text = "model m { param k = 2; param a = 1; state x = a; x' = -k*sign(x) + time; }
        simulate s of m { horizon 3; sensitivity to k, a; }";
    let run = run_at(text, 1e-12);
    assert!(!warned(&run), "{:?}", run.warnings);
    let root = 2.0_f64.sqrt();
    let [k, a] = [0, 1].map(|d| &run.samples.sensitivities[d]);
    let near = |found: f64, expected: f64| {
        assert!((found - expected).abs() <= 1e-10, "{found} {expected}");
    };
    near(slopes(&run, k)[0], -1.0);
    near(slopes(&run, a)[0], 0.0);
    assert_eq!(k.events.len(), 2);
    near(k.events[0].derivative, 1.0 - 2.0 / root);
    near(a.events[0].derivative, 1.0 / root);
    near(k.events[1].derivative, 1.0);
    near(a.events[1].derivative, 0.0);
    // While it slides nothing moves it.
    let samples = &run.samples;
    for (at, time) in samples.time.iter().enumerate() {
        if *time > 0.6 && *time < 2.0 {
            near(k.states[0].at(at)[0], 0.0);
        }
    }
}

/// A ball that is let fall from h meets the floor at T (1 + 2e + 2e² + ..), T = √(2h/g), and leaves it with e^n g T.
#[test]
fn a_ball_bounces() {
    let text = "model m { param g = 9; param e = 0.5; param h = 2; state q = h; state v = 0;
          q' = v; v' = -g; jump floor when q <= 0 and v < 0 { v := -e*v; } }
        simulate s of m { horizon 1.9; sensitivity to g, e, h; }";
    let run = run_at(text, 1e-13);
    assert!(!warned(&run), "{:?}", run.warnings);
    let (g, e, h) = (9.0_f64, 0.5_f64, 2.0_f64);
    let first = (2.0 * h / g).sqrt();
    let n = run.samples.sensitivities[0].events.len();
    assert!(n >= 4, "{n} bounces");
    let near = |found: f64, expected: f64| {
        let error = (found - expected).abs();
        assert!(
            error <= 1e-10 * (1.0 + expected.abs()),
            "{found} {expected}"
        );
    };
    let mut instant = 1.0;
    let mut by_e = 0.0;
    for k in 0..n {
        let moves = |d: usize| run.samples.sensitivities[d].events[k].derivative;
        near(moves(0), -first * instant / (2.0 * g));
        near(moves(1), first * by_e);
        near(moves(2), first * instant / (2.0 * h));
        // Behind the bounce v = e^n g T - g (t - t_n), at its instant.
        let time = run.samples.sensitivities[0].events[k].time;
        let rows: Vec<usize> = (0..run.samples.time.len())
            .filter(|&at| run.samples.time[at] == time)
            .collect();
        assert_eq!(rows.len(), 2, "before and behind");
        let power = (k + 1) as f64;
        let thrown = e.powf(power) * g * first;
        let of_v = |d: usize, row: usize| run.samples.sensitivities[d].states[1].at(rows[row])[0];
        near(of_v(0, 1), 0.5 * thrown / g + g * moves(0));
        near(of_v(1, 1), power * thrown / e + g * moves(1));
        near(of_v(2, 1), 0.5 * thrown / h + g * moves(2));
        // Before it, v = e^(n-1) g T - g (t - t_(n-1)).
        if k == 0 {
            near(of_v(0, 0), -time);
            near(of_v(2, 0), 0.0);
        }
        instant += 2.0 * e.powf(power);
        by_e += 2.0 * power * e.powf(power - 1.0);
    }
}

#[test]
fn a_circle_is_crossed() {
    agrees(
        "model m { param w = 2; param r = 0.8; state x[2] = [1.3, 0.2]; output e = r*dot(x, x);
          x[1]' = if dot(x, x) > r^2 then -0.3*x[1] - w*x[2] else 0.1*x[1] - 3*x[2];
          x[2]' = if dot(x, x) > r^2 then w*x[1] - 0.3*x[2] else 3*x[1] + 0.1*x[2]; }
        simulate s of m { horizon 3; sensitivity to r, w, x[1] at 0; }",
        1,
    );
}

#[test]
fn a_block_sticks_and_slips() {
    agrees(
        "model m { param mu = 0.6; param k = 1.1; param vb = 0.3; param d = 0.1; state q = 0; state v = 1;
          q' = v; v' = -k*q - d*v - mu*sign(v - vb)*exp(-abs(v - vb)); }
        simulate s of m { horizon 12; sensitivity to mu, k, vb, d, q at 0, v at 0; }",
        3,
    );
}

#[test]
fn two_surfaces_are_slid_on() {
    agrees(
        "model m { param a = 1; param b = 0.4; state x[2] = [0.7, -0.6]; state y = 0;
          x[1]' = -a*sign(x[1]) + 0.3*sign(x[2]) + 0.2*y; x[2]' = -0.8*sign(x[2]) + b*x[1]; y' = 1; }
        simulate s of m { horizon 8; sensitivity to a, b, x[1] at 0, x[2] at 0; }",
        3,
    );
}

#[test]
fn a_relay_remembers() {
    agrees(
        "model m { param a = 0.7; state T = 19; switch on = hysteresis(T, on = 18, off = 21, start = 1);
          T' = 5*on - a*(T - 10)/10; }
        simulate s of m { horizon 9; sensitivity to a, T at 0; }",
        3,
    );
}

#[test]
fn contacts_slip_and_stick() {
    agrees(
        "model m { param mu = 0.6; param e = 0.5; param g = 9.81; state q[2] = [0, 1]; state v[2] = [2, 0]; q' = v;
          mechanics q, v { mass = 1; force = [0, -g];
            contact floor { gap = q[2]; slip = v[1]; restitution = e; friction = mu; } } }
        simulate s of m { horizon 1.2; sensitivity to mu, e, g, q[2] at 0, v[1] at 0; }",
        3,
    );
    agrees(
        "model m { param mu = 0.3; param th = 0.4; param k = 20; state q[2] = [0, 0]; state v[2] = [3, 0]; q' = v;
          mechanics q, v { mass = 1; force = [-k*q[1] + 9.81*sin(th), -9.81*cos(th)];
            contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = mu; } } }
        simulate s of m { horizon 3; sensitivity to mu, th, k, v[1] at 0; }",
        3,
    );
}

/// With one e for all that act on each other Poisson's law is that of Newton. With friction that sticks beside it they agree
/// for e = 0, and their derivatives do not.
#[test]
fn impulses_given_back_are_speeds_for_one_contact_alone() {
    let rod = |mass: &str, e: &str| {
        format!(
            "model m {{ param e = 0.5; param g = 9.81; state q[2] = [0, 1]; state v[2] = [0.1, 0]; q' = v;
               mechanics q, v {{ mass = {mass}; force = [0, -g];
                 contact floor {{ gap = q[2]; slip = v[1]; restitution = poisson({e}); friction = 1; }} }} }}
             simulate s of m {{ horizon 1; sensitivity to e; }}"
        )
    };
    agrees(&rod("1", "e").replace("to e", "to e, g, v[1] at 0"), 2);
    let fall = (2.0_f64 / (0.4 * 9.81)).sqrt();
    loses(&rod("[2, 1; 1, 3]", "2*e - 1"), fall, "jumps");
}

#[test]
fn contacts_close_and_open() {
    agrees(
        "model m { param g = 9.81; param c = 0.3; state q = 0.4; state v = 0; state w = 0; q' = v; w' = 1;
          mechanics q, v { mass = 1; force = -g + c*g*w^2*12; contact floor { gap = q + 0.2*q^2; restitution = 0; } } }
        simulate s of m { horizon 1; sensitivity to g, c, q at 0; }",
        2,
    );
}

#[test]
fn instants_of_clocks_move() {
    agrees(
        "model m { param T = 0.4; param a = 1.5; state x = 1; x' = if time < T then -a*x else a*sin(x); }
        simulate s of m { horizon 1; sensitivity to T, a, x at 0; }",
        1,
    );
}

#[test]
fn algebraic_states_follow() {
    agrees(
        "model m { param a = 1.2; param b = 0.5; state x = 1; algebraic z = 0.5; x' = -z + sign(x - b)*0.1; 0 = z^3 + a*z - x; }
        simulate s of m { horizon 3; sensitivity to a, b, x at 0; }",
        1,
    );
}

/// A step at an instant that is a parameter, inside of a switching function, of equations, pairs and variational
/// inequalities, of a nonlinear switch, and of a slip.
#[test]
fn steps_at_instants_that_move() {
    let step = "(if time < p then 0 else 0.5)";
    for (statements, n_events) in [
        (format!("state x = 0.2; x' = -sign(x - {step});"), 3),
        (format!("state x = 0; algebraic z = 0; 0 = z + z^3 - 4*{step}; x' = z;"), 1),
        (format!("state x = 0.2; algebraic z = 0; 0 <= z perp z + x - {step} >= 0; x' = z - 0.1*x;"), 1),
        (format!("state x = 0.2; z in variational [-1, 1] solves z - 3*{step}; x' = z;"), 1),
        (format!("state x = 0.2; switch s = sign(x - {step}) sliding nonlinear; x' = -s + 0.1*(1 - s^2);"), 3),
        (
            format!(
                "state q[2] = [0, 0]; state v[2] = [0, 0]; q' = v;
                 mechanics q, v {{ mass = eye(2); force = [0, -10];
                   contact floor {{ gap = q[2]; restitution = 0; friction = 0.1; slip = v[1] - {step}; }} }}"
            ),
            2,
        ),
    ] {
        agrees(
            &format!("model m {{ param p = 1; {statements} }} simulate s of m {{ horizon 2; sensitivity to p; }}"),
            n_events,
        );
    }
}

/// z = max(0, (p - x)/q) by a pair, and max(-p, min(p, x/q)) by a variational inequality: both have the derivatives of the
/// kink, wherever they open and close.
#[test]
fn pairs_have_the_derivatives_of_kinks() {
    let mut random = Random(7);
    let pair = [
        "algebraic z = 0; 0 <= z perp q*z + x - p >= 0;",
        "let z = max(0, (p - x)/q);",
    ];
    let inequality = [
        "z in variational [-p, p] solves q*z - x;",
        "let z = max(-p, min(p, x/q));",
    ];
    let mut switched = 0;
    for [implicit, explicit] in [pair, inequality] {
        for _ in 0..40 {
            let [p, q] = [random.rounded(0.1, 0.4), random.rounded(0.5, 2.0)];
            let [x, turns] = [random.rounded(-1.0, 1.0), random.rounded(1.0, 3.0)];
            let run = |z: &str| {
                let text = format!(
                    "model m {{ param p = {p}; param q = {q}; state x = {x}; {z}
                       x' = -x + 1.5*sin({turns}*time) + 0.3*z; }}
                     simulate s of m {{ horizon 4; sensitivity to p, q, x at 0; }}"
                );
                let run = run_at(&text, 1e-12);
                assert!(!warned(&run), "{text}");
                run
            };
            let [found, known] = [run(implicit), run(explicit)];
            switched += found.history.events.len();
            let both = found.samples.sensitivities.iter();
            for (by, same) in both.zip(&known.samples.sensitivities) {
                let [found, known] = [slopes(&found, by)[0], slopes(&known, same)[0]];
                assert!((found - known).abs() <= 1e-10, "{}: {found} {known}", by.to);
            }
        }
    }
    assert!(switched >= 120, "{switched}");
}

/// What a counter reaches is no bound that a parameter moves.
#[test]
fn counted_samples_have_derivatives() {
    agrees(
        "model m { param p = 1; state y = 0; y' = 0; discrete n = 0; discrete x = 0;
           every 0.5 { n := n + 1; x := x + p; } jump j when n >= 3 { n := 0; y := y + x*p; } }
        simulate s of m { horizon 2.2; sensitivity to p; }",
        5,
    );
}

#[test]
fn a_disc_is_not_left() {
    agrees(
        "model m { param r = 1.5; param w = 2; state q[2] = [0.5, 0]; q' = [1, w*cos(w*time)];
          project q onto { dot(q, q) <= r^2; }; }
        simulate s of m { horizon 3; sensitivity to r, w, q[1] at 0; }",
        1,
    );
}

#[test]
fn initial_values_follow_parameters() {
    agrees(
        "model m { param a = 0.7; param b = 2*a; state x = a^2; state y = sin(b); x' = y*b; y' = -x + a; }
        simulate s of m { horizon 2; sensitivity to a, y at 0; }",
        0,
    );
}

#[test]
fn jumps_at_the_start_see_algebraic_states() {
    agrees(
        "model m { param p = 0.7; state x = 1; algebraic z = 0.5; x' = -x*z; 0 = z^3 + z - p*x;
          jump halve when x >= 0.9 { x := 0.5*x + 0.2*z; } }
        simulate s of m { horizon 1; sensitivity to p, x at 0; }",
        1,
    );
}

/// x' = -k (x - a cos t) is at a (k² cos t + k sin t)/(k² + 1) soon, however it starts.
#[test]
fn stiff_steps_are_followed() {
    let text = "model m { param k = 1e5; param a = 1.5; state x = 2; state y = 0; x' = -k*(x - a*cos(time)); y' = x; }
        simulate s of m { horizon 2; sensitivity to k, a, x at 0; }";
    let run = run_at(text, 1e-8);
    assert!(!warned(&run), "{:?}", run.warnings);
    assert!(run.quality.stats.steps < 500, "{:?}", run.quality.stats);
    let [by_k, by_a, by_start] = [0, 1, 2].map(|d| slopes(&run, &run.samples.sensitivities[d]));
    let (k, a, c, s) = (1e5_f64, 1.5, 2.0_f64.cos(), 2.0_f64.sin());
    let near = |found: f64, exact: f64, within: f64| {
        assert!((found - exact).abs() <= within, "{found} {exact}");
    };
    let square = k * k + 1.0;
    let part = (k * k * c + k * s) / square;
    near(by_a[0], part, 1e-8);
    near(
        by_a[1],
        (k * k * s + k * (1.0 - c)) / square - k / square,
        1e-8,
    );
    near(
        by_k[0],
        a * ((2.0 * k * c + s) / square - 2.0 * k * part / square),
        1e-12,
    );
    near(by_start[0], 0.0, 1e-12);
    near(by_start[1], 1.0 / k, 1e-12);
}

/// y' = -k (y - cos t) + p with p = 0: what the run knows of y - cos t, within its tolerance, is what moves y with k.
#[test]
fn stiff_steps_know_as_much_as_the_run() {
    for k in [1e3_f64, 1e4, 1e5, 1e6] {
        let text = format!(
            "model m {{ param k = {k}; param p = 0; state c = 0; state y = 1; c' = 1; y' = -k*(y - cos(c)) + p; }}
            simulate s of m {{ horizon 10; sensitivity to k, p; }}"
        );
        let run = run_within(&text, None);
        assert!(!warned(&run), "{k}: {:?}", run.warnings);
        let [by_k, by_p] = [0, 1].map(|d| slopes(&run, &run.samples.sensitivities[d])[1]);
        let (c, s, square) = (10.0_f64.cos(), 10.0_f64.sin(), k * k + 1.0);
        let exact = (2.0 * k * c + s) / square - 2.0 * k * (k * k * c + k * s) / (square * square);
        assert!((by_k - exact).abs() <= 1e-7 / k, "{k}: {by_k}, not {exact}");
        assert!((by_p - 1.0 / k).abs() <= 1e-7 / k, "{k}: {by_p}");
    }
}

/// What moves nothing but itself does so beside what is stiff, whatever else is asked for: v' = u - m with u ≈ sin(w t).
#[test]
fn directions_of_a_stiff_run_do_not_see_each_other() {
    for to in ["m, w", "w, m"] {
        let text = format!(
            "model l {{ param m = 0.5; param w = 1; state v = 0; state u = 0; v' = u - m; u' = -1e4*(u - sin(w*time)); }}
            simulate s of l {{ horizon 3; sensitivity to {to}; }}"
        );
        let run = run_within(&text, None);
        assert!(!warned(&run), "{to}: {:?}", run.warnings);
        let by_m = run.samples.sensitivities.iter().find(|by| by.to == "m");
        let found = slopes(&run, by_m.expect("it is asked for"));
        assert!(
            (found[0] + 3.0).abs() < 1e-9 && found[1].abs() < 1e-12,
            "{to}: {found:?}"
        );
    }
}

/// A pulse that is narrower than can be looked for is said to be lost.
#[test]
fn pulses_too_narrow_to_be_seen_are_lost() {
    for width in ["1e-9", "1e-10"] {
        let text = format!(
            "model m {{ param p = 0; state c = 0; state y = 0; c' = 1; y' = p*exp(-((c - 0.312345)/{width})^2)/{width}; }}
            simulate s of m {{ horizon 1; sensitivity to p; }}"
        );
        let run = run_within(&text, None);
        let found = slopes(&run, &run.samples.sensitivities[0])[1];
        let exact = std::f64::consts::PI.sqrt();
        assert!(warned(&run) || (found - exact).abs() < 1e-5, "{found}");
    }
}

/// x' = c g(t) - x with a pulse g = a exp(-((t - 1.234)/w)²) and c = 0 or 1 in the run, so that the derivative of x(T) by c
/// is a w √π exp(1.234 - T + w²/4) however little the run itself sees of g: the time may be a state, and c one.
#[test]
fn pulses_that_a_run_does_not_see_move_its_derivatives() {
    for width in [5e-4, 4e-3, 0.02, 0.1] {
        let exact = 1000.0 * width * std::f64::consts::PI.sqrt();
        let exact = exact * (1.234 - 2.0 + 0.25 * width * width).exp();
        let pulse = |t: &str| format!("1000*exp(-(({t} - 1.234)/{width})^2)");
        let (by_time, by_state) = (pulse("time"), pulse("s"));
        let rates = [
            ("p", format!("(p - 1)*{by_time} - x")),
            ("p", format!("p*{by_time} - x")),
            ("p", format!("p*{by_state} - x")),
            ("z at 0", format!("z*{by_time} - x")),
            ("z at 0", format!("z*{by_state} - x")),
        ];
        for (to, rate) in rates {
            let text = format!(
                "model m {{ param p = 1; state x = 0; state s = 0; state z = 0; s' = 1; z' = 0; x' = {rate}; }}
                 simulate s of m {{ horizon 2; sensitivity to {to}; }}"
            );
            for (tolerance, close) in [(None, 1e-5), (Some(1e-12), 1e-9)] {
                let run = run_within(&text, tolerance);
                assert!(!warned(&run), "{text}: {:?}", run.warnings);
                let found = slopes(&run, &run.samples.sensitivities[0])[0];
                assert!(
                    (found - exact).abs() <= close * exact,
                    "{text}: {found}, not {exact}"
                );
            }
        }
    }
}

#[test]
fn outputs_have_derivatives_without_states_and_without_switches() {
    let text = "model m { param a = 2; output e = a*time; }
        simulate s of m { horizon 3; output at [0, 1, 3]; sensitivity to a; }";
    let run = run_at(text, 1e-8);
    let by = &run.samples.sensitivities[0];
    assert_eq!(
        (by.until, by.outputs[0].values.clone()),
        (None, vec![0.0, 1.0, 3.0])
    );
}

/// x = 1 - a t, and y = t - a t²/2: at the start nothing moves with a.
#[test]
fn what_does_not_move_at_the_start_is_known() {
    let run = run_at(
        "model m { param a = 1; state x = 1; state y = 0; x' = -a; y' = x; }
         simulate s of m { horizon 2; output every 0.25; sensitivity to a; }",
        1e-10,
    );
    let by = &run.samples.sensitivities[0];
    assert_eq!(by.until, None);
    assert!(!warned(&run) && run.samples.time.len() > 2);
    for (at, t) in run.samples.time.iter().enumerate() {
        let found: Vec<f64> = by.states.iter().map(|own| own.at(at)[0]).collect();
        for (found, exact) in found.iter().zip([-t, -0.5 * t * t]) {
            assert!((found - exact).abs() <= 1e-12, "{t}: {found} {exact}");
        }
    }
}

/// Where a derivative does not exist, or none is known, a warning has the instant and there is no number from there on.
fn loses(text: &str, time: f64, words: &str) {
    for tolerance in [1e-8, 1e-10] {
        let run = run_at(text, tolerance);
        let warning = run.warnings.iter().find(|warning| warning.code == "W0735");
        let warning = warning.expect("it is lost");
        assert!(warning.message.contains(words), "{}", warning.message);
        assert!(warning.span.is_some());
        for by in &run.samples.sensitivities {
            let until = by.until.expect("it is lost");
            assert!((until - time).abs() <= 1e-4, "{until}");
            let rows = run.samples.time.iter().enumerate();
            let before = rows.clone().filter(|(_, t)| **t < until);
            for (at, _) in before {
                assert!(by.states[0].at(at)[0].is_finite());
            }
            for (at, t) in rows.filter(|(_, t)| **t >= until) {
                // At the instant itself there may be a row before it.
                let is_before = run.samples.time.get(at + 1) == Some(t);
                for series in by.states.iter().chain(&by.outputs) {
                    assert!(
                        is_before || series.at(at).iter().all(|v| v.is_nan()),
                        "at {t}"
                    );
                }
            }
            let mut behind = by.events.iter().filter(|event| event.time > until);
            assert!(behind.all(|event| event.derivative.is_nan()));
        }
    }
}

#[test]
fn starts_rests_and_limits_have_no_derivative() {
    // It starts on the surface, and on one side of it for other values.
    loses(
        "model m { state x = 0; x' = 2 - sign(x); } simulate s of m { horizon 1; sensitivity to x at 0; }",
        0.0,
        "starts on a surface",
    );
    // A relay flips there, for these values alone.
    for (start, threshold) in [
        ("0.3", "start = 0); x' = 1 + h"),
        ("-0.3", "start = 1); x' = h - 2"),
    ] {
        loses(
            &format!(
                "model m {{ state x = {start}; switch h = hysteresis(x, on = 0.3, off = -0.3, {threshold}; }}
                 simulate s of m {{ horizon 1; sensitivity to x at 0; }}"
            ),
            0.0,
            "starts on a surface",
        );
    }
    // It rests where the field bends.
    loses(
        "model m { state x = 0; x' = abs(x); } simulate s of m { horizon 1; sensitivity to x at 0; }",
        0.0,
        "rests on a surface",
    );
    // The same from when on the parameter moves it.
    loses(
        "model m { param p = 1; state y = -1; state x = 0; y' = 1; x' = max(x, 2*x) + (p - 1)*step(y); }
        simulate s of m { horizon 2; sensitivity to p; }",
        1.0,
        "rests on a surface",
    );
    // Bounces end at 3 T.
    loses(
        "model m { param g = 2; state q = 1; state v = 0; q' = v;
          mechanics q, v { mass = 1; force = -g; contact floor { gap = q; restitution = 0.5; } } }
        simulate s of m { horizon 4; sensitivity to g; }",
        3.0,
        "accumulate",
    );
}

#[test]
fn surfaces_that_meet_at_once_have_no_derivative() {
    // Both surfaces are met at 1.
    loses(
        "model m { param a = 1; state x = -1; state y = -1; x' = a + 0.5*step(y); y' = 1 + step(x); }
        simulate s of m { horizon 3; sensitivity to a; }",
        1.0,
        "meet in one point",
    );
    // Both are met at 1, and the errors of the run tell them apart.
    loses(
        "model m { param a = 1; state x = 1 - exp(1); state y = -sin(1); state t = 0;
          x' = a*(x + exp(1)) + 0.5*step(y); y' = cos(t) + step(x); t' = 1; }
        simulate s of m { horizon 2; sensitivity to a; }",
        1.0,
        "meet in one point",
    );
}

/// A row of a table leads onto the bound of a guard, and not to it for a larger parameter.
#[test]
fn rows_that_lead_onto_a_guard_have_no_derivative() {
    let text = "model m { param p = 1; signal r = table(\"d.csv\", \"r\", fit = hold); state y = 0; y' = 1;
           jump j when r >= p and y < 1.5 { y := 10; } }
         simulate s of m { horizon 2; sensitivity to p; }";
    for (values, is_lost) in [("0,0\n1,1\n2,3\n", true), ("0,0\n1,1.5\n2,3\n", false)] {
        let data = format!("time,r\n{values}");
        let files: Memory = [("model.nsd", text), ("d.csv", &data)]
            .into_iter()
            .collect();
        let project = Project::from_files("model.nsd", files).expect("the text is there");
        let found = project.run("s", &Options::default(), &mut ());
        let run = found.unwrap_or_else(|errors| panic!("{errors}")).trajectory;
        assert_eq!(warned(&run), is_lost, "{values}");
        let by = &run.samples.sensitivities[0];
        assert_eq!(
            by.until.is_some_and(|until| (until - 1.0).abs() < 1e-9),
            is_lost
        );
    }
}

#[test]
fn laws_set_off_on_one_side_have_no_derivative() {
    // Two laws set one state at ln 2, to the same value for these parameters alone.
    loses(
        "model m { param p = 1; param q = 1; state x = 1; state u = 0; x' = -x + u; u' = 0;
           jump a1 when x <= 0.5 { u := 3*p; } jump a2 when x <= 0.5 { u := 3*q; } }
        simulate s of m { horizon 1; sensitivity to p, q; }",
        2.0_f64.ln(),
        "meet in one point",
    );
    // A sample leads to the bound of a guard, and not to it for a smaller parameter.
    loses(
        "model m { param p = 1; discrete x = 0; discrete y = 0;
           every 0.5 { y := y + 0.5*p; } jump j when y >= 1 { y := 0; x := x + 1; } }
        simulate s of m { horizon 0.7; sensitivity to p; }",
        0.5,
        "meet in one point",
    );
    // So does a step of time that is data.
    loses(
        "model m { param p = 2; discrete y = 0; state t = 0; t' = 1; signal r = floor(2*time);
           jump j when r >= p and y < 1 { y := 1; } }
        simulate s of m { horizon 1.4; sensitivity to p; }",
        1.0,
        "meet in one point",
    );
    // So does a jump.
    loses(
        "model m { param p = 1; state t = 0; t' = 1; discrete x = 0; discrete y = 0;
           jump i when t >= 0.5 { t := -10; y := p; } jump j when y >= 1 { y := 0; x := x + 1; } }
        simulate s of m { horizon 1; sensitivity to p; }",
        0.5,
        "meet in one point",
    );
    // A law reads a bend.
    loses(
        "model m { state x = -1; state y = 0; x' = 1; y' = 0; jump hit when x >= 0 { x := -1; y := abs(y); } }
        simulate s of m { horizon 1.5; sensitivity to y at 0; }",
        1.0,
        "meet in one point",
    );
    // Either ends the run, at one instant for these parameters alone.
    for condition in ["y >= 1 or z >= 1", "y >= 1 and z >= 1"] {
        loses(
            &format!(
                "model m {{ param p = 1; state y = 0; state z = 0; y' = p; z' = 2 - p; }}
                simulate s of m {{ horizon 2; stop when {condition}; sensitivity to p; }}"
            ),
            1.0,
            "meet in one point",
        );
    }
}

#[test]
fn surfaces_that_are_touched_have_no_derivative() {
    // The top of a parabola is on the surface.
    loses(
        "model m { param a = 1; state x = -0.5; state v = 1; x' = v; v' = -a - step(x); }
        simulate s of m { horizon 3; sensitivity to a; }",
        1.0,
        "tangentially",
    );
    // The top of a parabola is on the surface, of a relay and of a guard, in one step.
    for (behind, horizon) in [
        (
            "switch h = hysteresis(y, on = 1, off = -5, start = 0); x' = h;",
            1.5,
        ),
        ("x' = 0; jump j when y > 1 { x := 1; y := -100; }", 3.3),
    ] {
        loses(
            &format!(
                "model m {{ param p = 1; state y = 0; state x = 0; y' = 2*p*(1 - time); {behind} }}
                simulate s of m {{ horizon {horizon}; sensitivity to p; }}"
            ),
            1.0,
            "tangentially",
        );
    }
    // It is below the surface by less than the run is known, and that within a step.
    loses(
        "model m { param a = 1; state x = -0.5000000000001; state v = 1; x' = v; v' = -a - step(x); output e = 2*x; }
        simulate s of m { horizon 3; output every 0.125; sensitivity to a; }",
        1.0,
        "tangentially",
    );
}

/// What nothing but outputs looks at takes no state with it: an output has no derivative on its kink alone, has that behind
/// it where it is passed, and that of what it is elsewhere, where no step looks at its switch, too.
#[test]
fn outputs_on_kinks_have_no_derivative_alone() {
    let text = "model m { param a = 1; state x = 0; state y = -1; state v[2] = [1, 0.25];
          output rests = abs(x); output passes = abs(y); output size = max(norm(v), 0.5);
          x' = -x; y' = a; v' = -v*a; }
        simulate s of m { horizon 2; output at [0, 0.5, 1, 2]; sensitivity to a, x at 0; }";
    let run = run_at(text, 1e-10);
    assert!(!warned(&run), "{:?}", run.warnings);
    let [a, x] = [0, 1].map(|d| &run.samples.sensitivities[d]);
    for (at, t) in run.samples.time.iter().enumerate() {
        let near = |found: f64, expected: f64| {
            assert!(
                (found - expected).abs() <= 1e-9,
                "at {t}: {found} {expected}"
            );
        };
        near(x.states[0].at(at)[0], (-t).exp());
        assert!(x.outputs[0].at(at)[0].is_nan());
        near(a.outputs[0].at(at)[0], 0.0);
        let slope = if *t < 1.0 { -1.0 } else { 1.0 };
        near(a.outputs[1].at(at)[0], slope * t);
        near(x.outputs[1].at(at)[0], 0.0);
        let norm = 1.0625_f64.sqrt() * (-t).exp();
        near(
            a.outputs[2].at(at)[0],
            if norm > 0.5 { -t * norm } else { 0.0 },
        );
    }
}

/// The forms have nothing where nothing is known.
#[test]
fn what_is_lost_is_empty_in_csv_and_null_in_json() {
    let text = "model m { param a = 1; state x = -0.5; state v = 1; x' = v; v' = -a - step(x); output e = 2*x; }
        simulate s of m { horizon 2; output at [0.5, 1.5]; sensitivity to a; }";
    let project = Project::from_text("model.nsd", text);
    let run = project
        .run("s", &Options::default(), &mut ())
        .expect("it compiles");
    let csv = run.csv();
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        rows[0],
        ["time", "x", "v", "e", "d x/d a", "d v/d a", "d e/d a"]
    );
    let known = rows[1][4..]
        .iter()
        .map(|field| field.parse().expect("a number"));
    nsd_tests::assert_near(&known.collect::<Vec<f64>>(), &[-0.125, -0.5, -0.25], 1e-12);
    assert_eq!(rows[2][4..], ["", "", ""]);
    let json: serde_json::Value = serde_json::from_str(&run.json()).expect("it is JSON");
    let by = &json["sensitivities"][0];
    assert_eq!(by["until"].as_f64().map(f64::round), Some(1.0));
    for (of, name, exact) in [("states", "x", -0.125), ("outputs", "e", -0.25)] {
        let rows = &by[of][name];
        assert!(
            rows[0]
                .as_f64()
                .is_some_and(|found| (found - exact).abs() <= 1e-12),
            "{rows}"
        );
        assert!(rows[1].is_null(), "{rows}");
    }
}

/// The derivatives are given up where the run is canceled while they are found, and that is said.
#[test]
fn derivatives_end_where_runs_are_canceled() {
    use std::sync::atomic::{AtomicUsize, Ordering};
    let text = "model m { param a = 2; state x = 1; state v = 0; x' = v; v' = -a*x - 0.3*sign(v); }
        simulate s of m { horizon 40; sensitivity to a; }";
    let project = Project::from_text("model.nsd", text);
    let canceled = |at: usize| {
        let looks = std::sync::Arc::new(AtomicUsize::new(0));
        let own = looks.clone();
        let cancel = Cancel::asking(move || own.fetch_add(1, Ordering::Relaxed) == at);
        let options = Options {
            limit: Limit::default().canceled_by(&cancel),
            ..Options::default()
        };
        let run = project.run("s", &options, &mut ()).expect("it compiles");
        (run.trajectory, looks.load(Ordering::Relaxed))
    };
    let (run, n_looks) = canceled(usize::MAX);
    assert!(!warned(&run));
    let (run, _) = canceled(n_looks - 1);
    let told = run.warnings.iter().find(|warning| warning.code == "W0735");
    assert!(told.is_some_and(|told| told.message.contains("canceled")));
    assert!(
        run.samples.sensitivities[0]
            .until
            .is_some_and(|until| until > 0.0)
    );
}

/// A random piecewise affine system x' = A x + b + Σ_k step(c_k x - d_k) (B_k x + e_k), whose first entries are parameters.
pub(crate) fn affine(seed: u64) -> String {
    let mut random = Random(seed);
    let (n, surfaces) = (2 + random.below(2), 1 + random.below(2));
    let mut text = "model m { param p = 1; param r = 0.3; ".to_owned();
    let start: Vec<String> = (0..n)
        .map(|_| random.rounded(-1.0, 1.0).to_string())
        .collect();
    let _ = write!(text, "state x[{n}] = [{}];", start.join(", "));
    let mut row = |factor: &str| {
        let terms = (1..=n).map(|j| format!("{}*x[{j}]", random.rounded(-1.5, 1.5)));
        let terms: Vec<String> = terms.collect();
        format!(
            "{factor}*({} + {})",
            terms.join(" + "),
            random.rounded(-1.0, 1.0)
        )
    };
    let psi: Vec<String> = (0..surfaces)
        .map(|_| format!("{} - r*0.5", row("1")))
        .collect();
    for i in 1..=n {
        let mut rate = row(if i == 1 { "p" } else { "1" });
        for psi in &psi {
            let _ = write!(rate, " + step({psi})*{}", row("1"));
        }
        let _ = write!(text, "x[{i}]' = {rate};");
    }
    let _ = write!(
        text,
        "}} simulate s of m {{ horizon 3; sensitivity to p, r, x[1] at 0; }}"
    );
    text
}

/// Of 120 random systems each derivative is right or said to be lost; most are known, and many cross, slide and leave.
#[test]
fn random_systems_are_right_or_said_to_be_lost() {
    let (mut known, mut lost, mut unsure, mut events) = (0, 0, 0, 0);
    for seed in 0..120 {
        let text = affine(seed);
        let run = run_at(&text, 1e-13);
        if run.failure.is_some() {
            continue;
        }
        let plain = Project::from_text("model.nsd", &undifferentiated(&text));
        let exprs = Exprs::new();
        let mut session = Session::new(&exprs, &plain);
        for by in &run.samples.sensitivities {
            if by.until.is_some() {
                assert!(warned(&run));
                lost += 1;
                continue;
            }
            let (name, value) = value(&run, &by.to);
            let reference = extrapolated(&mut session, "s", (&name, value), 2e-4);
            // Another order of events within the difference, or one more, is no reference.
            let Some((reference, moves)) = reference.filter(|(_, moves)| *moves <= 1e-7) else {
                unsure += 1;
                continue;
            };
            for (found, reference) in slopes(&run, by).iter().zip(&reference) {
                let error = (found - reference).abs();
                assert!(
                    error <= 1e-8 * (1.0 + reference.abs()),
                    "seed {seed}, {}: {found} {reference} ({moves})\n{text}",
                    by.to
                );
            }
            events += by.events.len();
            known += 1;
        }
    }
    let counts =
        format!("{known} known, {lost} lost, {unsure} without a reference, {events} events");
    assert!(known >= 240 && events >= 180 && unsure <= 48, "{counts}");
}

/// Experiments of the examples that run by events, each by its first parameter that a run is differentiated by: the
/// derivatives of what it ends with are those of differences, or said to be lost.
#[test]
fn examples_are_right_or_said_to_be_lost() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .expect("there are examples")
        .flatten()
        .map(|file| file.path())
        .collect();
    files.sort();
    let (mut known, mut lost, mut unsure) = (0, 0, 0);
    for file in files
        .iter()
        .filter(|file| file.extension().is_some_and(|ext| ext == "nsd"))
    {
        let project = Project::load(file).expect("it is there");
        let exprs = Exprs::new();
        let mut session = Session::new(&exprs, &project);
        let simulations = project
            .experiments()
            .filter(|experiment| experiment.kind == ExperimentKind::Simulate);
        for experiment in simulations
            .map(|experiment| experiment.name.name.clone())
            .collect::<Vec<_>>()
        {
            let Some(run) = differentiated(&project, &experiment) else {
                continue;
            };
            // Differences compare ends that move, derivatives the fixed instant (`stops.rs`).
            if run.history.stop().is_some() {
                continue;
            }
            let by = &run.samples.sensitivities[0];
            if by.until.is_some() {
                assert!(warned(&run));
                lost += 1;
                continue;
            }
            let (name, value) = value(&run, &by.to);
            let of = (name.as_str(), value);
            let reference = extrapolated(&mut session, &experiment, of, 1e-4 * value.abs());
            let Some((reference, _)) = reference.filter(|(_, moves)| *moves <= 1e-5) else {
                unsure += 1;
                continue;
            };
            for (found, reference) in slopes(&run, by).iter().zip(&reference) {
                let size = 1.0 + reference.abs();
                let error = (found - reference).abs();
                assert!(
                    error <= 1e-4 * size,
                    "{}: {experiment}, {name}: {found} {reference}",
                    file.display()
                );
            }
            known += 1;
        }
    }
    let counts = format!("{known} known, {lost} lost, {unsure} without a reference");
    assert!(known >= 20 && unsure <= 8, "{counts}");
}

/// A run of an experiment that is differentiated by the first parameter of its model that is none of its form.
fn differentiated(project: &Project, experiment: &str) -> Option<Trajectory> {
    let options = |settings: Vec<(String, String)>| Options {
        settings,
        ends_alone: true,
        ..Options::default()
    };
    let plain = project
        .run(experiment, &options(Vec::new()), &mut ())
        .ok()?
        .trajectory;
    let is_event = plain.setup.method.name == "event" && plain.failure.is_none();
    let names = plain
        .setup
        .parameters
        .iter()
        .flat_map(|series| series.entry_names().into_iter().zip(series.at(0).to_vec()));
    let mut names = names.filter(|(_, value)| is_event && *value != 0.0);
    names.find_map(|(name, _)| {
        let words = format!("sensitivity to {name}");
        let options = options(vec![("sensitivity".to_owned(), words)]);
        Some(project.run(experiment, &options, &mut ()).ok()?.trajectory)
    })
}

/// What is zero has terms that move what is run: x' = p x and x' = 1 + p sign(x) are x₀ eᵖᵗ, and x₀ + (1 - p) t up to
/// t* = -x₀/(1 - p) and (1 + p) (t - t*) from then on. Where nothing but p makes it jump there may be no derivative.
#[test]
fn parameters_that_are_zero_have_derivatives() {
    let run = run_at(
        "model m { param p = 0; state x = 2; x' = p*x; } simulate s of m { horizon 3; sensitivity to p; }",
        1e-10,
    );
    assert!((slopes(&run, &run.samples.sensitivities[0])[0] - 6.0).abs() < 1e-9);
    let run = run_at(
        "model m { param p = 0; state x = -1; x' = 1 + p*sign(x); } simulate s of m { horizon 3; sensitivity to p; }",
        1e-10,
    );
    assert!(!warned(&run), "{:?}", run.warnings);
    let by_p = &run.samples.sensitivities[0];
    // x(3) = (1 + p) (3 - 1/(1 - p)).
    assert!((slopes(&run, by_p)[0] - 1.0).abs() < 1e-9, "{by_p:?}");
    let run = run_at(
        "model m { param p = 0; state x = 0; x' = -p*sign(x); } simulate s of m { horizon 1; sensitivity to p; }",
        1e-10,
    );
    let by_p = slopes(&run, &run.samples.sensitivities[0])[0];
    // A start on the surface: it slides for p > 0, and has two solutions for p < 0.
    assert!(by_p.is_nan() && warned(&run), "{by_p}");
}

/// Other methods, and what is no number of a run, are refused.
#[test]
fn what_has_no_sensitivity_is_refused() {
    let model =
        "model m { param a = 1; param zero = 0; param b = 2; state x = 1; x' = -a*x^b + x^zero; }";
    let code = |settings: &str| {
        let text = format!("{model} simulate s of m {{ horizon 1; {settings} }}");
        let project = Project::from_text("model.nsd", &text);
        let found = project.run("s", &Options::default(), &mut ());
        let told = found.err().map(|messages| messages.to_string());
        // What does not run is not right before either.
        assert_eq!(project.check().has_errors(), told.is_some(), "{settings}");
        told
    };
    let is_refused = |settings: &str, expected: &str| {
        let found = code(settings).expect("it is refused");
        assert!(found.contains(expected), "{found}");
    };
    assert_eq!(code("sensitivity to a, x at 0;"), None);
    is_refused("sensitivity to x;", "E0531");
    is_refused("sensitivity to a at 0;", "E0531");
    is_refused("sensitivity to zero;", "E0532");
    is_refused("sensitivity to b;", "E0532");
    is_refused("sensitivity to a, a;", "E0531");
    is_refused("sensitivity to nothing;", "E0101");
    is_refused(
        "method smoothing { epsilon = 1e-3; } sensitivity to a;",
        "E0532",
    );
    is_refused("method adaptive; sensitivity to a;", "E0532");
    assert_eq!(code("method fesd { steps = 10; } sensitivity to a;"), None);
    is_refused(
        "perturb every 0.1 by sphere(1e-3); sensitivity to a;",
        "E0532",
    );
}

/// What is named in `sensitivity to` is known where names are.
#[test]
fn names_of_sensitivities_are_in_the_index() {
    let text = "model m { param k = 1; state x = 1; x' = -k*x; }
        simulate s of m { horizon 1; sensitivity to k, x at 0; }";
    let index = Project::from_text("model.nsd", text).index();
    for name in ["k, x at", "x at"] {
        let found = index.at(text.find(name).expect("it is there") as u32);
        let found = found.expect("it is a name");
        let definition = index.definition(found.declared).expect("it is declared");
        assert_eq!(definition.name, name[..1]);
    }
}
