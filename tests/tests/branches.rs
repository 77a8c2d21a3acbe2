//! Where several solutions go on, every method says so: those that choose end there, those that cannot warn. So do all of an
//! impact at the end, which is one of two.

use nsd_tests::{codes_of_rows, run};
use nsdc::report::Trajectory;

/// Methods that take one of several solutions without a choice.
const TAKES_ONE: [&str; 3] = [
    "method adaptive;",
    "method timestepping { steps = 100; }",
    "method timestepping { steps = 77; scheme = gauss(2); }",
];

fn by(model: &str, settings: &str) -> Trajectory {
    run(
        &format!("model m {{ {model} }} simulate s of m {{ {settings} }}"),
        "s",
    )
}

/// What is said of several solutions.
fn told(found: &Trajectory) -> Option<&str> {
    let mut warnings = found.warnings.iter();
    let found = warnings.find(|warning| warning.code == "W0705")?;
    assert!(found.span.is_some(), "a line is named");
    Some(&found.message)
}

/// Surfaces that a run starts on, with the solutions that go on, by hand.
#[test]
fn a_start_with_several_solutions_is_told() {
    let cases = [
        // Both fields point away, or stay.
        (
            "state x = 0; x' = sign(x);",
            "sliding(x) | above(x) | below(x)",
        ),
        // x - y falls below with -1 and rises above with 1.
        (
            "state x = 0.5; state y = 0.5; x' = -1; y' = -1 - step(x - y);",
            "above(x - y) | below(x - y)",
        ),
        // Two surfaces at once, of which each takes away alone.
        (
            "state x = 0; state y = 0; x' = sign(x); y' = -sign(y) + 0.5;",
            "sliding(x) | above(x) | below(x)",
        ),
        // A parameter decides where the surface is.
        (
            "param c = 0.3; state x = c; x' = 2*sign(x - c);",
            "sliding(x - c) | above(x - c) | below(x - c)",
        ),
    ];
    for (model, ways) in cases {
        assert!(by(model, "horizon 1;").failure.is_some(), "{model}");
        for method in TAKES_ONE {
            let found = by(model, &format!("horizon 1; {method}"));
            let message = told(&found).unwrap_or_else(|| panic!("{model} by {method}"));
            let words = |text: &str| -> Vec<String> {
                let mut words: Vec<String> = text.split(" | ").map(str::to_owned).collect();
                words.sort();
                words
            };
            assert!(message.starts_with("at t = 0, several"), "{message}");
            let (_, named) = message.split_once("takes one: ").expect("they are named");
            // What slides beside is named with them.
            let named: Vec<String> = words(named);
            let is_named = |way: &String| named.iter().any(|named| named.contains(way.as_str()));
            assert!(words(ways).iter().all(is_named), "{message}");
        }
    }
}

/// Beside these, where one solution goes on from a surface: crossing, sliding, leaving, a tangency, rest.
#[test]
fn a_start_with_one_solution_is_not() {
    for model in [
        "state x = 0; x' = -sign(x) + 0.5;",
        "state x = 0; x' = 2 + sign(x);",
        "state x = 0; x' = time + step(x);",
        "state x = 0; state v = 0; x' = v; v' = 2 + sign(x);",
        "state x = 0; x' = max(x, 0);",
        "state x = 1e-6; x' = sign(x);",
        "state x = 0; state y = 0; x' = -sign(x) - 0.5*sign(y); y' = -sign(y) + 0.5*sign(x);",
    ] {
        assert!(by(model, "horizon 1;").failure.is_none(), "{model}");
        for method in TAKES_ONE {
            let found = by(model, &format!("horizon 1; {method}"));
            assert_eq!(told(&found), None, "{model} by {method}");
        }
    }
}

/// x rests on its surface from 1/2 on, until it is no longer held there: at once, or as a force turns. Steps stay.
#[test]
fn sliding_that_could_end_is_told_behind_the_start() {
    let at_once = "state x = 0.5; x' = (if time < 1 then -1 else 1)*sign(x);";
    let turning = "state x = 0.5; x' = (time - 1.2)*sign(x);";
    for (model, turns) in [(at_once, 1.0), (turning, 1.2)] {
        let settings =
            |horizon: f64| format!("horizon {horizon}; method timestepping {{ steps = 100; }}");
        let (before, behind) = (by(model, &settings(turns - 0.1)), by(model, &settings(2.0)));
        assert_eq!(told(&before), None, "{model}");
        let message = told(&behind).unwrap_or_else(|| panic!("{model}"));
        let instant = message["at t = ".len()..]
            .split_once(',')
            .map(|(t, _)| t.parse());
        let instant: f64 = instant.expect("an instant").expect("a number");
        assert!((turns..=2.0).contains(&instant), "{message}");
    }
}

/// Rows of a sweep have the code; a run that starts off the surface has none.
#[test]
fn rows_of_sweeps_tell_of_branches() {
    let text = "model m { param a = 0; state x = a; x' = sign(x - 0.25); }
                simulate s of m { horizon 1; method timestepping { steps = 20; } }";
    let codes = codes_of_rows(text, "s", ("a", &[0.2, 0.25, 0.3]));
    let codes: Vec<Option<&str>> = codes.iter().map(Option::as_deref).collect();
    assert_eq!(codes, [None, Some("W0705"), None]);
}

/// A ball falls for a second, or a mass comes at constant speed; with an end a little earlier or later there is no doubt.
#[test]
fn an_impact_at_the_end_is_told_by_all_methods() {
    let bodies = [
        "state x = 1; state v = 0; x' = v; mechanics x, v { mass = 1; force = -2; contact A { gap = x; restitution = 0.5; } }",
        "state x = 1; state v = -1; x' = v; v' = 0; jump A when x <= 0 and v < 0 { v := -v; }",
        "state x = 1e-3; state v = -1e-3; x' = v; mechanics x, v { mass = 1; force = 0; contact A { gap = x; restitution = 1; } }",
    ];
    let methods = [
        "",
        "method fesd; lower timefreezing;",
        "method event; lower timefreezing;",
        "method fesd; lower impact;",
    ];
    for body in bodies {
        for method in methods {
            if body.contains("jump") && method.contains("impact") {
                continue;
            }
            for (horizon, is_met) in [("0.999", false), ("1", true), ("1.001", false)] {
                let found = by(body, &format!("horizon {horizon}; {method}"));
                assert!(
                    found.failure.is_none(),
                    "{body} by {method} until {horizon}"
                );
                let told = found.warnings.iter().any(|w| w.code == "W0710");
                assert_eq!(told, is_met, "{body} by {method} until {horizon}");
            }
        }
    }
}
