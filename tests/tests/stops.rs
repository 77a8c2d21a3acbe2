//! Runs that end where a condition becomes true, against closed forms of the instant and of what is there.

use nsd_tests::random::Random;
use nsd_tests::{assert_near, codes, end, run, solved, times};
use nsdc::report::{EventKind, Failure, Status, Trajectory};
use nsdc::{Options, Project};

const G: f64 = 9.81;

/// A ball with these settings.
fn ball(settings: &str) -> String {
    format!(
        "model ball {{ param g = {G}; state q = 1; state v = 0; q' = v; v' = -g; output w = v^2; }}
         simulate s of ball {{ horizon 10; tolerance 1e-10; {settings} }}"
    )
}

fn last(run: &Trajectory) -> f64 {
    *run.samples.time.last().expect("there are rows")
}

fn warned(run: &Trajectory) -> Vec<&str> {
    run.warnings
        .iter()
        .map(|warning| warning.code.as_str())
        .collect()
}

/// Where the run has ended, by its event, its rows, its modes and what is drawn.
#[track_caller]
fn stopped_at(run: &Trajectory, time: f64, by: &str, within: f64) {
    assert_near(&[last(run)], &[time], within);
    let stop = run.history.stop().expect("a condition has ended the run");
    assert_eq!((stop.surface.as_str(), stop.time), (by, last(run)));
    assert_eq!(times(run, EventKind::Stop).len(), 1);
    assert_eq!(
        run.history.modes.last().map(|mode| mode.to),
        Some(last(run))
    );
}

#[test]
fn a_fall_ends_on_the_ground() {
    let (time, speed) = ((2.0 / G).sqrt(), -(2.0 * G).sqrt());
    for settings in [
        "stop when q <= 0;",
        "stop when q < 0;",
        "stop when not q > 0;",
        "stop when 0 >= q;",
        "stop when q <= 0 and v < 0;",
        "stop when q <= 0; output every 0.1;",
        "stop when q <= 0; output at [0, 0.2, 5];",
        "stop when q <= 0; output q, v;",
        "stop when q <= 0; output v;",
    ] {
        let found = solved(&ball(settings), "s");
        let stop = settings
            .strip_prefix("stop when ")
            .and_then(|rest| rest.split(';').next());
        stopped_at(&found, time, stop.expect("it stops"), 1e-14);
        assert_near(&end(&found, "v"), &[speed], 1e-12);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    }
    // What is asked for beyond the end is none of its rows.
    let found = solved(&ball("stop when q <= 0; output at [0, 0.2, 5];"), "s");
    assert_near(&found.samples.time, &[0.0, 0.2, time], 1e-14);
}

/// Decays with rates of their own: x falls to a after ln(1/a)/k.
#[test]
fn random_conditions_become_true_at_their_time() {
    let mut random = Random(11);
    for case in 0..80 {
        let mut draw = |lo: f64, hi: f64| random.rounded(lo, hi);
        let [k, l, a, b] = [
            draw(0.2, 3.0),
            draw(0.2, 3.0),
            draw(0.1, 0.9),
            draw(0.1, 0.9),
        ];
        let [s, t] = [(1.0 / a).ln() / k, (1.0 / b).ln() / l];
        let (condition, time) = match case % 5 {
            0 => (format!("x <= {a:?}"), s),
            1 => (format!("x <= {a:?} and y < {b:?}"), s.max(t)),
            2 => (format!("x < {a:?} or y <= {b:?}"), s.min(t)),
            3 => (format!("{a:?} >= x or not (y > {b:?})"), s.min(t)),
            // The first of two statements.
            _ => (format!("x <= {a:?}; stop when y <= {b:?}"), s.min(t)),
        };
        let text = format!(
            "model m {{ state x = 1; state y = 1; x' = -{k:?}*x; y' = -{l:?}*y; }}
             simulate s of m {{ horizon 100; tolerance 1e-11; stop when {condition}; }}"
        );
        let found = solved(&text, "s");
        assert!(
            (last(&found) - time).abs() <= 1e-10 * time,
            "{case}: {} {time}",
            last(&found)
        );
        assert_near(&end(&found, "x"), &[(-k * time).exp()], 1e-10);
        assert_near(&end(&found, "y"), &[(-l * time).exp()], 1e-10);
        assert_eq!(times(&found, EventKind::Stop).len(), 1, "{case}");
    }
}

/// A condition of time, of an input and of data.
#[test]
fn conditions_are_of_whatever_changes() {
    let model =
        "model m { input u; state x = 0; x' = u; let y = x - 0.5*u; signal s = sin(time); }";
    let text = |stop: &str| {
        format!(
            "{model} simulate s of m {{ with {{ u = 2*time; }} horizon 9; tolerance 1e-11; stop when {stop}; }}"
        )
    };
    for (stop, time) in [
        ("time >= 2.5", 2.5),
        ("y >= 2", 2.0),
        ("u > 3", 1.5),
        ("s < -0.5", std::f64::consts::PI * 7.0 / 6.0),
        ("abs(x - 4) <= 1", 3.0_f64.sqrt()),
    ] {
        stopped_at(&solved(&text(stop), "s"), time, stop, 1e-10);
    }
}

/// The end of a run that friction stops is a surface on which the state stays: `<=` holds there, `<` does not.
#[test]
fn rest_is_on_the_surface() {
    let text = |stop: &str| {
        format!(
            "model m {{ state v = 2; v' = -sign(v); }}
             simulate s of m {{ horizon 5; stop when {stop}; }}"
        )
    };
    for stop in ["v <= 0", "not v > 0", "v <= 0 and time > 1"] {
        let found = run(&text(stop), "s");
        assert_near(&[last(&found)], &[2.0], 1e-12);
        assert_eq!(times(&found, EventKind::Stop).len(), 1, "{stop}");
    }
    let found = solved(&text("v < 0"), "s");
    assert_eq!((last(&found), warned(&found)), (5.0, vec!["W0736"]));
}

/// At an impact the run ends before it, where the condition is about the gap, and behind it, where it is about the speed.
#[test]
fn impacts_end_runs_before_and_behind_them() {
    let jump = "state q = 1; state v = 0; q' = v; v' = -9.81;
      jump floor when q <= 0 and v < 0 { v := -0.5*v; }";
    let contact = "state q = 1; state v = 0; q' = v;
      mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.5; } }";
    let plastic = contact.replace("0.5", "0");
    let (time, speed) = ((2.0 / G).sqrt(), (2.0 * G).sqrt());
    for model in [jump, contact, &plastic] {
        let text = |stop: &str| {
            format!(
                "model m {{ {model} }} simulate s of m {{ horizon 5; tolerance 1e-10; stop when {stop}; }}"
            )
        };
        let before = solved(&text("q <= 0"), "s");
        stopped_at(&before, time, "q <= 0", 1e-12);
        assert_near(&end(&before, "v"), &[-speed], 1e-11);
        assert!(times(&before, EventKind::Jump).is_empty());
        if model != plastic {
            let behind = solved(&text("v > 0"), "s");
            stopped_at(&behind, time, "v > 0", 1e-12);
            assert_near(&end(&behind, "v"), &[0.5 * speed], 1e-11);
            assert_eq!(times(&behind, EventKind::Jump).len(), 1);
        }
        // Nothing of the model changes by a condition that is not met: a contact stays one.
        let never = solved(&text("q <= -1"), "s");
        let plain = solved(&text("time > 9"), "s");
        let modes = |run: &Trajectory| -> Vec<(f64, String)> {
            let modes = run.history.modes.iter();
            modes.map(|mode| (mode.from, mode.mode.clone())).collect()
        };
        assert_eq!(modes(&never), modes(&plain));
        assert!(warned(&never).contains(&"W0736"));
    }
}

/// A body on the floor, which is lifted from t = 1 on.
#[test]
fn a_contact_that_opens_ends_a_run() {
    let text = "model m { state q = 0; state v = 0; q' = v;
      mechanics q, v { mass = 1; force = 2*(time - 1); contact floor { gap = q; restitution = 0; } } }
      simulate s of m { horizon 3; tolerance 1e-10; stop when v >= 1; }
      simulate t of m { horizon 3; tolerance 1e-10; stop when q > 1/3; }";
    stopped_at(&solved(text, "s"), 2.0, "v >= 1", 1e-10);
    stopped_at(&solved(text, "t"), 2.0, "q > 1/3", 1e-10);
}

/// A sample and what it makes true: the run ends behind it.
#[test]
fn samples_end_runs() {
    let text = "model m { state x = 0; x' = 1; discrete n = 0; every 0.1 { n := n + 1; } }
      simulate s of m { horizon 3; stop when n > 4.5; }";
    let found = solved(text, "s");
    stopped_at(&found, 0.4, "n > 4.5", 1e-15);
    assert_near(&end(&found, "n"), &[5.0], 0.0);
}

#[test]
fn a_condition_that_is_never_met_is_told() {
    let found = solved(&ball("stop when q >= 2;"), "s");
    assert_eq!((last(&found), warned(&found)), (10.0, vec!["W0736"]));
    assert!(found.history.stop().is_none());
}

#[test]
fn a_condition_that_holds_at_the_start_is_told() {
    for (start, stop) in [
        ("q = -1;", "q <= 0"),
        ("q = 0;", "q <= 0"),
        ("q = 0;", "q < 0"),
        ("v = 1;", "v > 0.5"),
    ] {
        let text = ball(&format!("with {{ {start} }} stop when {stop};"));
        let failed = run(&text, "s");
        assert_eq!(failed.status, Status::NumericalFailure, "{start} {stop}");
        assert!(matches!(
            failed.failure,
            Some(Failure::StopsAtStart { time: 0.0, .. })
        ));
        assert!(failed.history.stop().is_none());
    }
    // Thrown up from the surface.
    let found = solved(&ball("with { q = 0; v = 3; } stop when q <= 0;"), "s");
    stopped_at(&found, 6.0 / G, "q <= 0", 1e-12);
}

#[test]
fn what_does_not_stop_is_refused() {
    for (settings, code) in [
        ("method fesd; stop when q <= 0;", "E0533"),
        ("method timestepping; stop when q <= 0;", "E0533"),
        ("method smoothing; stop when q <= 0;", "E0533"),
        ("method adaptive; stop when q <= 0;", "E0533"),
        ("lower timefreezing; stop when q <= 0;", "E0533"),
        ("stop when q;", "E0209"),
        ("stop when p <= 0;", "E0101"),
        ("stop when 1 > 0;", "E0308"),
        ("stop when g <= 0;", "E0308"),
        ("stop when q^2 < 0;", "E0404"),
    ] {
        assert_eq!(codes(&ball(settings)), [code], "{settings}");
    }
    let optimal = "model m { state x = 1; control u in [-1, 1]; x' = u; }
      optimize s of m { horizon 1; intervals 5; minimize integral(x^2); stop when x <= 0; }";
    assert_eq!(codes(optimal), ["E0516"]);
}

/// q = h - g t²/2 = 0 at t = sqrt(2 h/g): the instant moves, states have the derivatives at the fixed instant.
#[test]
fn the_instant_has_a_derivative() {
    let text = ball("stop when q <= 0; sensitivity to g, q at 0;");
    let project = Project::from_text("m.nsd", &text);
    let found = project.run("s", &Options::default(), &mut ());
    let found = found.expect("it is differentiated").trajectory;
    let time = (2.0 / G).sqrt();
    let row = found.samples.time.len() - 1;
    let exact = [
        (-0.5 * time / G, -0.5 * time * time, -time),
        (1.0 / (G * time), 1.0, 0.0),
    ];
    for (by, (moves, of_q, of_v)) in found.samples.sensitivities.iter().zip(exact) {
        assert_near(
            &[by.events.last().expect("it stops").derivative],
            &[moves],
            1e-12,
        );
        assert_near(by.states[0].at(row), &[of_q], 1e-12);
        assert_near(by.states[1].at(row), &[of_v], 1e-12);
        assert_near(by.outputs[0].at(row), &[2.0 * -G * time * of_v], 1e-11);
    }
    assert_eq!(warned(&found), Vec::<&str>::new());
}

/// The estimate sees the errors of the end, and of its instant: x' = -x³ + sin(3 t) loosely, and as well as it can be.
#[test]
fn the_estimate_is_that_of_the_end() {
    let text = |tolerance: &str| {
        format!(
            "model m {{ state x = 2; state y = 1; x' = -x^3 + sin(3*time); y' = x*y - y; }}
             simulate s of m {{ horizon 50; tolerance {tolerance}; stop when y <= 0.01; }}"
        )
    };
    let exact = solved(&text("1e-13"), "s");
    for tolerance in ["1e-2", "1e-4", "1e-6", "1e-8"] {
        let found = solved(&text(tolerance), "s");
        let estimate = found
            .quality
            .error_estimate
            .expect("runs estimate their error");
        let error = (last(&found) - last(&exact)).abs() / last(&exact);
        let error = error.max((end(&found, "x")[0] - end(&exact, "x")[0]).abs() / 2.0);
        assert!(
            error <= 10.0 * estimate,
            "{tolerance}: {error:e} {estimate:e}"
        );
        let aim: f64 = tolerance.parse().expect("a number");
        assert!(estimate <= aim, "{tolerance}: {estimate:e}");
    }
}

/// A parameter decides whether the run stops at all, and when.
#[test]
fn other_values_stop_at_other_times() {
    let project = Project::from_text("m.nsd", &ball("stop when q <= 0; output q, v;"));
    for g in [1.0_f64, 5.0, 20.0] {
        let options = Options {
            values: vec![("g".to_owned(), g)],
            ..Options::default()
        };
        let found = project
            .run("s", &options, &mut ())
            .expect("it runs")
            .trajectory;
        assert_near(&[last(&found)], &[(2.0 / g).sqrt()], 1e-12);
        assert_near(&end(&found, "v"), &[-(2.0 * g).sqrt()], 1e-11);
    }
    let options = Options {
        values: vec![("g".to_owned(), 1e-3)],
        ..Options::default()
    };
    let found = project
        .run("s", &options, &mut ())
        .expect("it runs")
        .trajectory;
    assert_eq!((last(&found), warned(&found)), (10.0, vec!["W0736"]));
}

/// Random errors end each run at its own time.
#[test]
fn disturbed_runs_end_at_their_own_time() {
    let text = "model m { state x = 1; x' = -0.1; }
      simulate s of m { horizon 30; perturb every 0.5 by gauss(0.05) seed 4; stop when x <= 0; }";
    let first = solved(text, "s");
    let second = solved(&text.replace("seed 4", "seed 5"), "s");
    assert!(first.history.stop().is_some() && second.history.stop().is_some());
    assert!((last(&first) - last(&second)).abs() > 1e-6);
}

/// Ends of runs of a model.
#[track_caller]
fn ends(model: &str, stops: &[(&str, Option<f64>)]) {
    for (stop, time) in stops {
        let text = format!(
            "model m {{ {model} }} simulate s of m {{ horizon 3; tolerance 1e-10; stop when {stop}; }}"
        );
        let found = run(&text, "s");
        assert!(
            found.status != Status::NumericalFailure,
            "{stop}: {:?}",
            found.failure
        );
        let stopped = found.history.stop().map(|event| event.time);
        let is_near = match (stopped, *time) {
            (Some(stopped), Some(time)) => (stopped - time).abs() <= 1e-9,
            (stopped, time) => stopped == time,
        };
        assert!(is_near, "{model} {stop}: {stopped:?}, not {time:?}");
    }
}

/// What stands on its surface makes `<=` and `>=` true, `<` and `>` false, whichever way they are written.
#[test]
fn what_stands_on_a_surface_is_on_it() {
    ends(
        "discrete n = 0; discrete d = 5; discrete z = 1; state x = 0; x' = 1;
         every 0.1 { n := n + 1; d := d - 1; } jump zero when x >= 0.75 and z > 0.5 { z := 0; }",
        &[
            ("n > 5", Some(0.5)),
            ("n >= 5", Some(0.4)),
            ("5 < n", Some(0.5)),
            ("-n < -5", Some(0.5)),
            ("not n <= 5", Some(0.5)),
            ("d <= 0", Some(0.4)),
            ("d < 0", Some(0.5)),
            ("z <= 0", Some(0.75)),
            ("z < 0", None),
        ],
    );
    ends(
        "signal r = floor(time/0.25); state x = 0; x' = 1;",
        &[("r > 7", Some(2.0)), ("r >= 7", Some(1.75))],
    );
    ends(
        "state a = 1; state b = 1; state c = 1; a' = -sign(a); b' = -sign(b); c' = -sign(c);",
        &[
            ("a < 0 or b < 0 or c < 0", None),
            ("a <= 0 and b <= 0 and c <= 0", Some(1.0)),
        ],
    );
}

/// Behind an impact that stops a ball, and where bounces end: q = v = 0.
#[test]
fn rest_behind_impacts_is_on_the_surface() {
    let ball = |e: &str| {
        format!(
            "state q = 1; state v = 0; q' = v;
             mechanics q, v {{ mass = 1; force = -9.81; contact floor {{ gap = q; restitution = {e}; }} }}"
        )
    };
    let time = (2.0 / G).sqrt();
    ends(
        &ball("0"),
        &[
            ("v > 0", None),
            ("v < -9", None),
            ("v >= 0 and time > 0.1", Some(time)),
            ("v <= 0 and q <= 0 and time > 1.5", Some(1.5)),
        ],
    );
    // Each bounce takes half of the time of the one before.
    ends(
        &ball("0.5"),
        &[
            ("q <= 0 and v > 0", None),
            ("v > 0 and q <= 0 and time > 2.5", None),
            ("v > 0", Some(time)),
        ],
    );
}

/// A relay flips where it is reached, and takes the state away.
#[test]
fn thresholds_of_relays_are_reached() {
    // 20 = 25 - 6 exp(-t/10)
    let time = 10.0 * 1.2_f64.ln();
    ends(
        "state T = 19; switch h = hysteresis(T, on = 18, off = 20, start = 1);
         T' = if h > 0.5 then (25 - T)/10 else -T/10;",
        &[
            ("T >= 20", Some(time)),
            ("T >= 20 and h > 0.5", Some(time)),
            ("T > 20", None),
            ("T > 20.5", None),
        ],
    );
}
