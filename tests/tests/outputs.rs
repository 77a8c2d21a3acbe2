//! What an `output` list keeps and leaves out, and what a run says about bounds.

use nsd_tests::{end, run};
use nsdc::report::{Status, Trajectory};

/// Friction blocks on springs beside an oscillator that nothing else reads.
const CHAIN: &str = "
model chain {
  state q[3] = [0, 1, 2.5];
  state v[3] = [1, 0, -1];
  state p[2] = [1, 0];
  let stretch = q[2] - q[1];
  switch s = sign(v[1]);
  for i in 1..3 { q[i]' = v[i]; }
  v[1]' = q[2] - q[1] - 1 - 0.3*s;
  v[2]' = q[1] - q[2] + 1 - 0.2*sign(v[2]);
  v[3]' = q[2] - q[3] - 0.4*sign(v[3]);
  p' = [p[2], -p[1] - sign(p[2] - 0.1)];
}
simulate full of chain { horizon 6; }
simulate pruned of chain { horizon 6; output q[1], v[2], stretch, s every 0.25; }
";

fn solved(text: &str, experiment: &str) -> Trajectory {
    let trajectory = run(text, experiment);
    assert_eq!(trajectory.status, Status::Solved);
    trajectory
}

#[test]
fn what_is_kept_moves_as_it_does_in_the_whole() {
    let full = solved(CHAIN, "full");
    let pruned = solved(CHAIN, "pruned");
    let (q, v) = (end(&full, "q"), end(&full, "v"));
    assert!((end(&pruned, "q[1]")[0] - q[0]).abs() < 1e-8);
    assert!((end(&pruned, "v[2]")[0] - v[1]).abs() < 1e-8);
    assert!((end(&pruned, "stretch")[0] - (q[1] - q[0])).abs() < 1e-8);
    assert_eq!(pruned.history.switches, ["v[2]", "s"]);
    assert_eq!(
        pruned.setup.skipped,
        [
            "states q[3], v[3], p[1..2]",
            "switch `v[3]`",
            "switch `p[2] - 0.1`"
        ]
    );
    let times = |run: &Trajectory, surface: &str| {
        let events = run
            .history
            .events
            .iter()
            .filter(|event| event.surface == surface);
        events.map(|event| event.time).collect::<Vec<_>>()
    };
    for surface in ["s", "v[2]"] {
        let (all, own) = (times(&full, surface), times(&pruned, surface));
        assert_eq!(all.len(), own.len());
        assert!(!own.is_empty());
        assert!(all.iter().zip(&own).all(|(a, b)| (a - b).abs() < 1e-7));
    }
}

/// A model with one of everything that can be recorded: each has a closed form.
const KINDS: &str = "
model drive {
  input w; input push = 2;
  state x = -1;
  signal r = cos(time);
  let double = 2*x;
  switch s = sign(x) sliding linear;
  output force = w - 2*s;
  x' = force;
}
model whole {
  control u = 3;
  part d = drive { w = 0.5; }
  let both = [d.x, d.double];
}
simulate all of whole {
  horizon 1;
  output d.x, d.w, d.push, d.r, d.double, d.s, d.force, u, both[2], both at [0, 0.2, 1];
}";

#[test]
fn everything_that_moves_can_be_recorded() {
    let run = solved(KINDS, "all");
    assert_eq!(run.samples.time, [0.0, 0.2, 1.0]);
    // From -1 with 2.5 to the surface at 0.4, where 0.5 - 2 s = 0.
    let expected: [(&str, &[f64]); 8] = [
        ("d.w", &[0.5, 0.5, 0.5]),
        ("d.push", &[2.0, 2.0, 2.0]),
        ("d.r", &[1.0, 0.2f64.cos(), 1f64.cos()]),
        ("d.double", &[-2.0, -1.0, 0.0]),
        ("d.s", &[-1.0, -1.0, 0.25]),
        ("d.force", &[2.5, 2.5, 0.0]),
        ("both[2]", &[-2.0, -1.0, 0.0]),
        ("both", &[-1.0, -2.0, -0.5, -1.0, 0.0, 0.0]),
    ];
    let names: Vec<&str> = run
        .samples
        .outputs
        .iter()
        .map(|series| series.name.as_str())
        .collect();
    assert_eq!(names, expected.map(|(name, _)| name));
    for (series, (name, values)) in run.samples.outputs.iter().zip(expected) {
        let distance = series.values.iter().zip(values).map(|(a, b)| (a - b).abs());
        assert_eq!(series.values.len(), values.len());
        assert!(
            distance.fold(0.0, f64::max) < 1e-8,
            "{name}: {:?}",
            series.values
        );
    }
    assert_eq!(run.samples.controls[0].name, "u");
    assert_eq!(run.samples.controls[0].values, [3.0; 3]);
}

/// Warnings of a run, by code and message.
fn warnings(text: &str) -> Vec<String> {
    let run = solved(text, "run");
    let warnings = run.warnings.iter();
    warnings
        .map(|warning| format!("{}: {}", warning.code, warning.message))
        .collect()
}

#[test]
fn a_state_that_leaves_its_bounds_is_found_between_reported_instants() {
    // 2 t - t^2 is above 0.99 from 0.9 to 1.1.
    let text = "
model m { state x in [0, 0.99] = 0; x' = 2 - 2*time; }
simulate run of m { horizon 2; output x at [0, 2]; }";
    let expected = "W0703: state `x` leaves [0, 0.99] at t = 0.9, where it is 0.99";
    assert_eq!(warnings(text), [expected]);
    assert_eq!(warnings(&text.replace("0.99", "1")), [""; 0]);
    let infinite = text.replace("[0, 0.99]", "[-1, inf]");
    assert_eq!(warnings(&infinite), [""; 0]);
}

#[test]
fn sliding_along_a_bound_does_not_leave_it() {
    let text = "
model m { state x in [0, 2] = 1; x' = -sign(x) + 0.5*sin(time); }
simulate run of m { horizon 20; }";
    assert_eq!(warnings(text), [""; 0]);
}

#[test]
fn controls_are_held_against_their_domain() {
    let model = "
model heater { state heat = 15; control on in {0, 1} = 0; heat' = 10*on - heat/2; }
model whole { part h = heater { on = 0.5*heat; } state heat = 2; heat' = -1; }
";
    let run = |with: &str| {
        let text = format!("{model} simulate run of heater {{ with {{ {with} }} horizon 3; }}");
        warnings(&text)
    };
    assert_eq!(run(""), [""; 0]);
    assert_eq!(run("on = 1;"), [""; 0]);
    assert_eq!(run("on = if heat < 14 then 1 else 0;").len(), 1);
    assert_eq!(run("on = if time < 1 then 1 else 0;"), [""; 0]);
    let warning = "W0704: control `on` is not in {0, 1} at t = 0, where it is 0.5";
    assert_eq!(run("on = heat/30;"), [warning]);
    let part = format!("{model} simulate run of whole {{ horizon 1; }}");
    let found = warnings(&part);
    assert!(
        found[0].starts_with("W0704: input `h.on` is not in {0, 1} at t = "),
        "{found:?}"
    );
}

/// |v| has no derivative at v = 0: a block that stops at t = 2, one that turns back at t = 1, and one at rest.
const NORMS: &str = "
model norms {
  state v = 2;
  state w = 1;
  state r[2] = [0, 0];
  v' = -sign(v);
  w' = -1;
  r' = [0, 0];
  output fast = max(norm([v, 0]), norm(r));
  output turns = max(norm([w, 0]), 0.25);
  output least = min(norm(r), norm([v, 0]), norm([w, 0]));
  output speed = norm([v, 0]);
}
simulate steps of norms { horizon 3; }
simulate listed of norms { horizon 3; output fast, turns, least, speed every 0.05; }
";

#[test]
fn outputs_need_values_and_no_derivatives() {
    for experiment in ["steps", "listed"] {
        let found = solved(NORMS, experiment);
        let series = |name: &str| {
            let mut outputs = found.samples.outputs.iter();
            let output = outputs.find(|output| output.name == name);
            &output.expect("it is recorded").values
        };
        assert!(found.samples.time.len() > 2);
        for (k, &t) in found.samples.time.iter().enumerate() {
            let (v, w) = ((2.0 - t).max(0.0), (1.0 - t).abs());
            for (name, exact) in [
                ("fast", v),
                ("turns", w.max(0.25)),
                ("least", 0.0),
                ("speed", v),
            ] {
                let value = series(name)[k];
                assert!((value - exact).abs() <= 1e-9, "{name} at {t}: {value}");
            }
        }
    }
}

/// Without states there are no equations to solve, and a step is a value like another.
#[test]
fn a_model_without_states_runs_by_every_method() {
    let methods = [
        "event;",
        "adaptive;",
        "fesd;",
        "fesd { steps = 4; }",
        "fesd; lower stewart;",
        "event; lower timefreezing;",
        "fesd; lower timefreezing;",
        "timestepping { steps = 10; }",
    ];
    for output in ["2*time", "step(time - 0.5)"] {
        for method in methods {
            let text = format!(
                "model m {{ output y = {output}; }} simulate s of m {{ horizon 1; method {method} }}"
            );
            let found = solved(&text, "s");
            assert_eq!(found.samples.time.last(), Some(&1.0), "{text}");
        }
    }
}

/// An instant of the output at which a state jumps has both its values.
#[test]
fn a_jump_at_an_instant_of_the_output_is_on_both_sides_of_it() {
    let text = "model m { state x = 0; x' = 1; jump reset when time >= 1 and x < 5 { x := 10; } }
        simulate sampled of m { horizon 2; output x every 0.5; }
        simulate at_end of m { horizon 1; output x every 0.5; }";
    let found = solved(text, "sampled");
    assert_eq!(found.samples.time, [0.0, 0.5, 1.0, 1.0, 1.5, 2.0]);
    assert_eq!(
        found.samples.states[0].values,
        [0.0, 0.5, 1.0, 10.0, 10.5, 11.0]
    );
    let found = solved(text, "at_end");
    assert_eq!(found.samples.time, [0.0, 0.5, 1.0, 1.0]);
    assert_eq!(found.samples.states[0].values, [0.0, 0.5, 1.0, 10.0]);
}

/// Where the horizon is a multiple of the period but for rounding, the end is one row.
#[test]
fn the_last_of_equal_periods_is_the_end() {
    for (period, count) in [(0.1, 3), (0.3, 3), (0.7, 9), (0.1, 1000), (1e-3, 57)] {
        let horizon = format!("{:.6}", period * f64::from(count));
        for method in [
            "event;",
            "adaptive;",
            "fesd { steps = 7; }",
            "timestepping { steps = 7; }",
        ] {
            let text = format!(
                "model m {{ state x = 0; x' = 1; }} simulate s of m {{ horizon {horizon}; method {method} output x every {period}; }}"
            );
            let times = solved(&text, "s").samples.time.clone();
            assert_eq!(times.len(), 1 + count as usize, "{text}");
            assert_eq!(times.last(), horizon.parse().ok().as_ref(), "{text}");
        }
    }
}

/// What is infinite at some points, by an overflow, is no bound that is infinite.
#[test]
fn what_overflows_at_some_states_keeps_its_switch() {
    let text = "model m { param lo = -inf; state x = 3; state y = 0; y' = 0; x' = -min(x, exp(1e4*y)); output z = max(lo, y); }
        simulate run of m { horizon 1; }";
    let found = solved(text, "run");
    assert!((end(&found, "x")[0] - 2.0).abs() <= 1e-9);
}

/// A bound that is infinite is never met, so that there is no switch for it.
#[test]
fn infinite_bounds_are_no_switches() {
    let forms = [
        "-sat(x, lo, 1)",
        "-min(x, 1)",
        "-max(min(x, 1), lo)",
        "-clamp(x, lo, 1)",
        "max(-x, -1) + min(0, -lo)",
    ];
    for form in forms {
        let model = format!("model m {{ param lo = -inf; state x = 3; x' = {form}; }}");
        for method in ["event", "fesd", "adaptive"] {
            let text = format!("{model} simulate run of m {{ horizon 5; method {method}; }}");
            let found = solved(&text, "run");
            assert_eq!(found.history.switches.len(), 1, "{form}");
            let x = end(&found, "x")[0];
            assert!((x - f64::exp(-3.0)).abs() <= 1e-8, "{form} {method}: {x}");
        }
    }
}

/// Roots and logarithms of what is cut off, on sides on which another piece of it has none.
#[test]
fn what_has_no_value_on_other_sides_has_one_on_its_own() {
    let x: f64 = 0.9;
    let cases: [(&str, f64); 8] = [
        ("cbrt(max(x, 0.2))", x.cbrt()),
        ("cbrt(min(x, -0.2))", (-0.2_f64).cbrt()),
        ("cbrt(sat(x, -0.7, 1.1))", x.cbrt()),
        ("sqrt(abs(max(x, 0.2)))", x.sqrt()),
        ("sqrt(sat(x, -0.7, 1.1))", x.sqrt()),
        ("abs(min(x, 2))^1.5", x.powf(1.5)),
        ("log(sat(x, -0.7, 1.1))", x.ln()),
        ("1/deadzone(x, 0.1)", 1.0 / (x - 0.1)),
    ];
    for (expression, exact) in cases {
        let text = format!(
            "model m {{ state x = 0.7; state y = 0; x' = 0.2; y' = 0; output o = {expression}; }}
             simulate s of m {{ horizon 1; }}"
        );
        let found = solved(&text, "s");
        assert!(
            (end(&found, "o")[0] - exact).abs() < 1e-12,
            "{expression}: {:?}",
            end(&found, "o")
        );
    }
}

/// No state depends on an output, so that a run goes on where one has no value.
#[test]
fn an_output_without_a_value_is_told() {
    let text = "model m { state x = 0; x' = 1; output z = sqrt(0.5 - x); output y = log(2 - x); }
        simulate both of m { horizon 1; output z, y every 0.25; }
        simulate one of m { horizon 1; output y every 0.25; }
        simulate before of m { horizon 0.25; }";
    let told = |experiment: &str| {
        let warnings = solved(text, experiment).warnings;
        let own = warnings
            .into_iter()
            .filter(|warning| warning.code == "W0739");
        own.map(|warning| warning.message).collect::<Vec<String>>()
    };
    let message = "the output `z` has no finite value at time = 0.750000, and at 1 more instants that are reported";
    assert_eq!(told("both"), [message]);
    for experiment in ["one", "before"] {
        assert!(told(experiment).is_empty(), "{experiment}");
    }
}
