//! Optimal control on elements at whose ends no switch has to be, beside the detection of switches and closed forms.

use nsdc::report::{Status, Trajectory};
use nsdc::{Options, Project};

use nsd_tests::{agrees, assert_near, codes, end, fitted_order, optimum, solved_optimum};

fn best(model: &str, task: &str) -> Trajectory {
    solved_optimum(&format!("{model} optimize o of m {{ {task} }}"), "o")
}

/// As the command line runs it, from the guess that it says; or what is told instead.
fn launched(text: &str, experiment: &str) -> Result<Trajectory, String> {
    let project = Project::from_text("test.nsd", text);
    let run = project.run(experiment, &Options::default(), &mut ());
    run.map(|run| run.trajectory)
        .map_err(|told| told.to_string())
}

fn objective(found: &Trajectory) -> f64 {
    found.objective.expect("an optimum has one")
}

#[test]
fn where_nothing_switches_both_are_the_same() {
    let model =
        "model m { state x = 0; state v = 0; control u in [-1, 1] = 0; x' = v; v' = u*cos(time); }";
    for task in [
        "horizon 1; intervals 4; minimize integral(u^2); final { x = 0.1; }",
        "horizon 1; intervals [1, 2, 1]; minimize integral(u^2); final { x = 0.1; }",
        "horizon free in [0.5, 3] = 1; intervals 3; minimize integral(u^2) + final(time); final { x = 0.1; }",
        "horizon 1; intervals 3 free; minimize integral(u^2); final { x = 0.1; }",
    ] {
        for scheme in ["radau_iia(5)", "gauss(5)"] {
            let [detected, plain] = ["2", "plain(2)"].map(|elements| {
                best(
                    model,
                    &format!("{task} elements {elements}; scheme {scheme};"),
                )
            });
            agrees(&plain, 1e-7);
            assert_near(&[objective(&plain)], &[objective(&detected)], 1e-7);
        }
    }
}

#[test]
fn the_order_is_one_across_a_switch() {
    // x' = 3 below zero and 1 above: from -0.35 it is at 1 - 0.35/3 at t = 1.
    let exact = 1.0 - 0.35 / 3.0;
    let model = "model m { state x = -0.35; control u in [-1, 1] = 0.5; x' = u + (if x < 0 then 3 else 1); }";
    let task = "horizon 1; minimize integral(u^2);";
    let mut errors = Vec::new();
    for elements in [3, 6, 12, 24, 48] {
        let own = format!("{task} intervals 1; elements plain({elements}); scheme radau_iia(2);");
        let found = optimum(&format!("{model} optimize o of m {{ {own} }}"), "o");
        let error = (end(&found, "x")[0] - exact).abs();
        errors.push((elements, error));
        let warned = found.warnings.iter().any(|warning| warning.code == "W0709");
        assert!(warned || error < 1e-6, "{elements}: {error}");
    }
    let order = fitted_order(&errors);
    assert!((0.6..1.6).contains(&order), "{order}: {errors:?}");
    // An end of an element is at the switch where they are detected.
    let found = best(model, &format!("{task} intervals 1; elements 2;"));
    assert_near(&end(&found, "x"), &[exact], 1e-9);
}

#[test]
fn what_sticks_needs_no_switch() {
    // Dry friction from rest to rest: a force above it, then rest, then braking; the first one has to be 0.2 at least.
    let model = "model m { state x = 0; state v = 0; control u in [-1, 1] = 0.5; x' = v; v' = u - 0.2*sign(v); }";
    let task = "horizon 4; intervals 10; minimize integral(u^2); final { x = 1; v = 0; }";
    let [detected, plain] =
        ["3", "plain"].map(|elements| best(model, &format!("{task} elements {elements};")));
    agrees(&plain, 1e-8);
    assert_near(&[objective(&plain)], &[objective(&detected)], 1e-8);
}

#[test]
fn it_is_a_guess_for_the_detection_of_switches() {
    let text = "model m { state x = 0; state v = 0; control u in [-1, 1] = 0.5; x' = v; v' = u - 0.2*sign(v - 0.3); }
      optimize first of m { horizon 4; intervals 10; elements plain(2); scheme radau_iia(1); minimize integral(u^2); final { x = 2; v = 0; } }
      optimize o of m { horizon 4; intervals 10; elements 3; minimize integral(u^2); final { x = 2; v = 0; } guess { from first; } }
      optimize cold of m { horizon 4; intervals 10; elements 3; minimize integral(u^2); final { x = 2; v = 0; } }";
    let [found, cold] = ["o", "cold"].map(|name| launched(text, name).expect("it compiles"));
    assert_eq!([found.status, cold.status], [Status::Solved; 2]);
    agrees(&found, 1e-7);
    assert_near(&[objective(&found)], &[objective(&cold)], 1e-7);
}

#[test]
fn what_happens_at_instants_is_refused() {
    let ball = "model m { state q = 1; state v = 0; control u in [-9, 9] = 0; q' = v; mechanics q, v { mass = 1; force = u - 9.81; contact c { gap = q; restitution = 0.5; } } }";
    let nonlinear = "model m { state x = 1; control u in [-9, 9] = 0; switch s = sign(x) sliding nonlinear; x' = u - s + 0.1*s^2; }";
    for (model, task) in [(ball, "lower impact;"), (nonlinear, "")] {
        let text = format!(
            "{model} optimize o of m {{ horizon 1; intervals 2; elements plain; {task} minimize integral(u^2); }}"
        );
        let told = launched(&text, "o").expect_err("it is refused");
        assert!(
            told.contains("E0717") && told.contains("`elements plain`"),
            "{told}"
        );
    }
    let text = |elements: &str| {
        format!(
            "{ball} optimize o of m {{ horizon 1; intervals 2; elements {elements}; minimize integral(u^2); }}"
        )
    };
    assert_eq!(codes(&text("plain(0)")), ["E0504"]);
    assert_eq!(codes(&text("plain(1, 2)")), ["E0504"]);
}
