//! Coefficients of contacts that vary, and leave their range while a contact lasts, from event to event.

use nsd_tests::{end, run, times};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

/// A block on a floor, pushed along by `push` from a speed of `v`.
fn block(push: f64, v: f64, restitution: &str, friction: &str, horizon: f64) -> Trajectory {
    let text = text(push, v, restitution, friction, horizon);
    run(&text, "this")
}

fn text(push: f64, v: f64, restitution: &str, friction: &str, horizon: f64) -> String {
    format!(
        "model block {{
           state q[2] = [0, 0];
           state v[2] = [{v:?}, 0];
           q' = v;
           mechanics q, v {{
             mass = eye(2);
             force = [{push:?}, -10];
             contact sole {{ gap = q[2]; restitution = {restitution}; friction = {friction}; }}
           }}
         }}
         simulate this of block {{ horizon {horizon:?}; }}"
    )
}

/// When and how a run ended because of a coefficient; its label is at the contact.
fn outside(found: &Trajectory, text: &str) -> (f64, &'static str, String) {
    let Some(Failure::Coefficient {
        time,
        what,
        name,
        how,
        surfaces,
    }) = &found.failure
    else {
        panic!("{:?}", found.failure);
    };
    assert_eq!(found.status, Status::NumericalFailure);
    assert_eq!(name, "sole");
    let line = |at: usize| text[..at].matches('\n').count();
    let contact = text.find("contact sole").expect("the text has it");
    assert_eq!(line(surfaces[0].offset()), line(contact));
    // What has been recorded ends there, but for rounding.
    let last = found.samples.time.last().expect("a run has a start");
    assert!((last - time).abs() <= 1e-14, "{last}, not {time}");
    (*time, what, how.clone())
}

#[test]
fn friction_that_turns_negative_ends_a_run_where_it_does() {
    // At rest, slipping, and slipping over a floor whose friction depends on the place, v = 2.
    for (push, v, friction, exact) in [
        (0.0, 0.0, "0.3 - 0.2*time", 1.5),
        (0.1, 0.0, "0.3 - 0.2*time^2 - 0.1*time^4", 1.0),
        (5.0, 0.0, "0.3 - 0.2*time", 1.5),
        (5.0, 0.0, "cos(7*time)/4 + 0.1", ((-0.4_f64).acos()) / 7.0),
        (0.0, 2.0, "0.2 - 0.2*exp(20*q[1] - 20)", 1.0),
    ] {
        let text = text(push, v, "0", friction, 3.0);
        let found = run(&text, "this");
        let (time, what, how) = outside(&found, &text);
        assert_eq!((what, &how[..]), ("friction", "falls below 0"));
        if friction.contains('q') {
            assert!((end(&found, "q")[0] - exact).abs() <= 1e-9, "{friction}");
        } else {
            assert!((time - exact).abs() <= 1e-9, "{friction}: {time}");
        }
    }
}

/// Dips and peaks that are far narrower than the steps between them, in time and along the way.
#[test]
fn what_leaves_the_range_for_an_instant_ends_a_run() {
    for width in [1e-2, 1e-3, 1e-4, 1e-5] {
        let pulse = |of: &str, at: f64| format!("exp(-(({of} - {at})/{width:e})^2)");
        // 0.3 = 0.4 exp(-s²)
        let s = width * (4.0_f64 / 3.0).ln().sqrt();
        for at in [0.337, 1.3, 2.1] {
            let pulse = pulse("time", at);
            for v in [0.0, 2.0] {
                for (restitution, friction) in [
                    ("0".to_owned(), format!("0.3 - 0.4*{pulse}")),
                    (format!("0.3 - 0.4*{pulse}"), "0.1".to_owned()),
                    (format!("0.7 + 0.4*{pulse}"), "0".to_owned()),
                ] {
                    let text = text(0.0, v, &restitution, &friction, 3.0);
                    let (time, ..) = outside(&run(&text, "this"), &text);
                    assert!(
                        (time - (at - s)).abs() <= 1e-9,
                        "{width:e} {restitution} {friction}: {time}"
                    );
                }
            }
        }
        for at in [0.1, 0.337, 0.6] {
            let friction = format!("0.3 - 0.4*{}", pulse("q[1]", at));
            let text = text(0.0, 2.0, "0", &friction, 3.0);
            let found = run(&text, "this");
            outside(&found, &text);
            let place = end(&found, "q")[0];
            assert!((place - (at - s)).abs() <= 1e-9, "{friction}: {place}");
        }
    }
}

#[test]
fn restitution_that_leaves_its_range_ends_a_run_where_it_does() {
    for (restitution, said, exact) in [
        ("0.5 - q[1]", "falls below 0", 0.25),
        ("0.5 + q[1]", "rises above 1", 0.25),
        // Above 1 for a while, within one step.
        (
            "1.01 - (q[1] - 1)^2/2",
            "rises above 1",
            0.5 - 0.02_f64.sqrt() / 2.0,
        ),
        ("q[1] - 1", "is -1, which is not between 0 and 1", 0.0),
    ] {
        let text = text(0.0, 2.0, restitution, "0", 3.0);
        let (time, what, how) = outside(&run(&text, "this"), &text);
        assert_eq!((what, &how[..]), ("restitution", said));
        assert!((time - exact).abs() <= 1e-9, "{restitution}: {time}");
    }
}

#[test]
fn coefficients_that_come_to_a_bound_and_stay_in_their_range_are_good() {
    for (restitution, friction, horizon) in [
        ("0", "0.3*(time - 1)^2", 3.0),
        ("1 - (q[1] - 1)^2", "0", 0.9),
        ("0", "0.3*exp(-20*time)", 3.0),
    ] {
        for v in [0.0, 2.0] {
            let found = block(0.0, v, restitution, friction, horizon);
            let failure = &found.failure;
            assert_eq!(found.status, Status::Solved, "{friction}: {failure:?}");
        }
    }
}

/// Without friction nothing says what holds a body that sticks: the sliding mode is singular there, and the run says so.
#[test]
fn friction_that_comes_to_zero_under_a_body_at_rest_is_told() {
    for (friction, horizon) in [("max(0.3 - 0.2*time, 0)", 3.0), ("0.3 - 0.2*time", 1.5)] {
        let found = block(0.0, 2.0, "0", friction, horizon);
        let Some(Failure::SingularSliding { time, .. }) = found.failure else {
            panic!("{friction}: {:?}", found.failure);
        };
        assert!((time - 1.5).abs() <= 1e-9, "{friction}: {time}");
    }
}

#[test]
fn an_open_contact_has_no_coefficients() {
    // It leaves the floor at t = 1, as the friction turns negative half a second later.
    let found = run(
        "model block {
           state q[2] = [0, 0];
           state v[2] = [9, 0];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [0, 20*(time - 1)];
             contact sole { gap = q[2]; restitution = 0; friction = 0.3 - 0.2*time; }
           }
         }
         simulate this of block { horizon 3; }",
        "this",
    );
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    // 10/3 (t - 1)³ from t = 1 on.
    assert!((end(&found, "q")[1] - 80.0 / 3.0).abs() <= 1e-7);
}

#[test]
fn coefficients_switch_with_time() {
    let source = |restitution: &str, friction: &str, start: &str| {
        format!(
            "model ball {{
               state q[2] = [0, {start}];
               state v[2] = [2, 0];
               q' = v;
               mechanics q, v {{
                 mass = eye(2);
                 force = [0, -10];
                 contact floor {{ gap = q[2]; restitution = {restitution}; friction = {friction}; }}
               }}
             }}
             simulate this of ball {{ horizon 2; }}"
        )
    };
    // One bounce after another with the restitution of its time.
    let trajectory = run(&source("0.75 + 0.15*sign(time - 1)", "0", "0.45"), "this");
    assert_eq!(trajectory.status, Status::Solved);
    let (mut t, mut speed) = (0.3, 3.0);
    let mut bounces = Vec::new();
    // They would accumulate at 2.17.
    while t < 2.0 {
        bounces.push(t);
        speed *= if t < 1.0 { 0.6 } else { 0.9 };
        t += 2.0 * speed / 10.0;
    }
    let found = times(&trajectory, EventKind::Jump);
    assert_eq!(found.len(), bounces.len());
    for (found, exact) in found.iter().zip(&bounces) {
        assert!((found - exact).abs() <= 1e-12, "{found}, not {exact}");
    }
    let since = 2.0 - bounces[bounces.len() - 1];
    let height = speed * since - 5.0 * since * since;
    assert!((end(&trajectory, "q")[1] - height).abs() <= 1e-11);

    // From 2 to 1 at 0.2 g until 0.5, and to rest at 0.4 g.
    let trajectory = run(&source("0", "0.3 + 0.1*sign(time - 0.5)", "0"), "this");
    assert_eq!(trajectory.status, Status::Solved);
    let sticks = times(&trajectory, EventKind::Stick);
    assert!(sticks.len() == 1 && (sticks[0] - 0.75).abs() <= 1e-12);
    assert!((end(&trajectory, "q")[0] - 0.875).abs() <= 1e-12);
}
