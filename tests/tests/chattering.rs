//! Chattering that fades and never ends, and goes on as sliding where the experiment asks for it.

use nsd_tests::{end, run};
use nsdc::report::{Failure, Status, Trajectory};

const SLIDE: &str = "tolerance 1e-3; method event { max_events = 200000; } on chattering slide;";

fn averaged(model: &str, horizon: f64) -> Trajectory {
    let text =
        format!("model m {{ {model} }}\nsimulate run of m {{ horizon {horizon:?}; {SLIDE} }}");
    let found = run(&text, "run");
    assert_eq!(found.status, Status::Solved, "{model}: {:?}", found.failure);
    assert_eq!(found.history.averaged.len(), 1, "{model}");
    assert!(found.warnings.iter().any(|w| w.code == "W0722"), "{model}");
    found
}

fn close(found: f64, exact: f64, within: f64) {
    let error = (found - exact).abs();
    assert!(error <= within, "{found} instead of {exact}");
}

/// x' = u, e u' = -k sign(x - r) - u slides with x = r and u = r'; z adds up what the relay gives.
#[test]
fn a_lag_follows_its_set_point() {
    for (e, k, a, w) in [
        (0.01, 1.0, 0.3, 1.0),
        (0.005, 2.0, 0.5, 1.5),
        (0.02, 1.5, 0.1, 3.0),
    ] {
        let model = format!(
            "state x = 0.5; state u = 0; state z = 0; let r = {a:?}*sin({w:?}*time);
             x' = u; u' = (-{k:?}*sign(x - r) - u)/{e:?}; z' = {k:?}*sign(x - r);"
        );
        let horizon = 3.0;
        let found = averaged(&model, horizon);
        let (x, u) = (a * (w * horizon).sin(), a * w * (w * horizon).cos());
        close(end(&found, "x")[0], x, 1e-12);
        close(end(&found, "u")[0], u, 1e-12);
        // What is neglected is a speed of k/n behind n events, here 3125, and e times that in z.
        close(end(&found, "z")[0], 0.5 - x - e * u, 3.0 * e * k / 3125.0);
        let averaged = &found.history.averaged[0];
        assert_eq!(averaged.surfaces, ["x - r"]);
        // A parabola between two events at the speed 3k/(2n), whose second derivative is k/e where r rests.
        let n = found
            .history
            .events
            .iter()
            .filter(|event| event.time <= averaged.time)
            .count();
        let height = e * k * (1.5 / n as f64).powi(2) / 2.0;
        close(averaged.heights[0], height, 0.6 * height);
    }
}

/// No set of pairs comes behind the events, which are told long before there are too many.
#[test]
fn elements_end_before_events_without_end() {
    for (e, lowering) in [(0.01, "stewart"), (0.02, "step")] {
        let found = run(
            &format!(
                "model m {{ state x = 0.5; state u = 0; x' = u; u' = (-sign(x) - u)/{e:?}; }}
                 simulate run of m {{ horizon 10; method fesd {{ scheme = radau_iia(2); }} lower {lowering}; }}"
            ),
            "run",
        );
        assert_eq!(found.status, Status::IterationLimit, "{lowering}");
        let failure = found.failure.as_ref().expect("it has not come to the end");
        assert!(matches!(failure, Failure::Chattering { .. }), "{failure}");
        // x and u are at rest on the surface but for e k/n behind n events.
        assert!(found.history.events.len() < 1 << 15);
        close(end(&found, "x")[0], 0.0, 1e-9);
    }
}

/// r' grows until the relay no longer suffices, and x falls behind.
#[test]
fn what_slides_leaves_where_means_reach_their_bound() {
    let (e, horizon) = (0.01, 12.0);
    let model =
        format!("state x = 0.5; state u = 0; x' = u; u' = (-sign(x - 0.05*time^2) - u)/{e:?};");
    let found = averaged(&model, horizon);
    // r' + e r'' = 1
    let leaves = 10.0 - e;
    let last = found
        .history
        .switch_times()
        .last()
        .copied()
        .expect("it leaves");
    close(last, leaves, 1e-9);
    let (t, u) = (horizon - leaves, 0.1 * leaves);
    close(end(&found, "u")[0], 1.0 + (u - 1.0) * (-t / e).exp(), 1e-5);
    let fallen = 0.05 * leaves * leaves + t + (u - 1.0) * e * -(-t / e).exp_m1();
    close(end(&found, "x")[0], fallen, 1e-5);
}

/// Two genes come to rest at both thresholds; z' = y' but for what is neglected.
#[test]
fn a_network_comes_to_rest_where_its_thresholds_meet() {
    let found = averaged(
        "state x = 0.3; state y = 0.4; state z = 0;
         let a = step(x - 0.4); let b = step(y - 0.6);
         x' = 1 - b - x; y' = 2*(a - y); z' = 2*(a - y);",
        100.0,
    );
    close(end(&found, "x")[0], 0.4, 1e-12);
    close(end(&found, "y")[0], 0.6, 1e-12);
    let heights = &found.history.averaged[0].heights;
    assert!(
        heights.iter().all(|h| (1e-6..1e-2).contains(h)),
        "{heights:?}"
    );
    close(end(&found, "z")[0], 0.2, heights[1]);
}

/// The mean of a b over a cycle is not that of a times that of b: nothing is averaged.
#[test]
fn means_of_products_are_not_products_of_means() {
    let text = format!(
        "model m {{
           state x = 0.3; state y = 0.4; state z = 0;
           let a = step(x - 0.5); let b = step(y - 0.5);
           x' = 1 - b - x; y' = a - y; z' = a*b;
         }}
         simulate run of m {{ horizon 100; {SLIDE} }}"
    );
    let found = run(&text, "run");
    let failure = found
        .failure
        .map(|failure| nsdc::report::Warning::of(&failure).code);
    assert_eq!(failure.as_deref(), Some("E0733"));
    assert!(found.history.averaged.is_empty());
}
