//! Belts whose speeds step at known times: the slip jumps, and velocities do not.

use nsd_tests::{DataFiles, assert_near, end, solved, times, with_data};
use nsdc::report::{EventKind, Status};
use nsdc::simulate::{self, Request};

/// Friction on the block: 0.3*10.
const PULL: f64 = 3.0;

/// A block on a belt with this speed.
fn block(belt: &str, experiment: &str) -> String {
    format!(
        "model block {{
           state q[2] = [0, 0];
           state v[2] = [0, 0];
           q' = v;
           {belt}
           mechanics q, v {{
             mass = 2;
             force = [0, -20];
             contact road {{ gap = q[2]; restitution = 0; slip = v[1] - belt; friction = 0.3; }}
           }}
         }}
         simulate this of block {{ horizon 4; {experiment} }}"
    )
}

/// The belt has speed 2 from t = 1 to 3 and stands still before and after: the block takes 2/3 to follow either way.
#[test]
fn a_block_follows_a_belt_that_starts_and_stops() {
    let belt = "let belt = if time < 1 or time > 3 then 0 else 2;";
    let follows = 2.0 / PULL;
    let methods = [
        ("", 1e-12),
        ("lower timefreezing;", 1e-10),
        ("lower timefreezing; method fesd { steps = 40; }", 1e-10),
    ];
    for (method, tolerance) in methods {
        let trajectory = solved(&block(belt, method), "this");
        assert_near(&end(&trajectory, "q"), &[4.0, 0.0], tolerance);
        assert_near(&end(&trajectory, "v"), &[0.0, 0.0], tolerance);
        let slips = times(&trajectory, EventKind::Slip);
        assert_near(&slips, &[1.0, 3.0], tolerance);
        let sticks = times(&trajectory, EventKind::Stick);
        assert_near(&sticks, &[1.0 + follows, 3.0 + follows], tolerance);
        assert!(times(&trajectory, EventKind::Jump).is_empty(), "{method}");
    }
}

/// While it slips, the belt turns around: the block is at 1.5 then, and friction pulls it back.
#[test]
fn friction_turns_with_a_belt_that_turns_around() {
    let belt = "let belt = if time < 0.5 then 2 else -2;";
    let trajectory = solved(&block(belt, ""), "this");
    let sticks = 0.5 + 3.5 / PULL;
    assert_near(&times(&trajectory, EventKind::Stick), &[sticks], 1e-12);
    let left = sticks - 0.5;
    let way = 0.375 + 1.5 * left - 0.5 * PULL * left * left - 2.0 * (4.0 - sticks);
    assert_near(&end(&trajectory, "q"), &[way, 0.0], 1e-11);
}

/// A step of the belt to the speed that the block has by then: it sticks at once.
#[test]
fn a_belt_that_steps_to_the_speed_of_the_block_takes_it_along() {
    let belt = "let belt = if time < 0.5 then 2 else 1.5;";
    let trajectory = solved(&block(belt, ""), "this");
    assert_near(&times(&trajectory, EventKind::Stick), &[0.5], 1e-10);
    assert_near(&end(&trajectory, "q"), &[0.375 + 1.5 * 3.5, 0.0], 1e-10);
}

#[test]
fn speeds_of_belts_come_from_data_too() {
    let belt = "signal belt = table(\"belt.csv\", \"w\", fit = hold);";
    for (method, tolerance) in [("", 1e-12), ("method timestepping { steps = 4000; }", 2e-3)] {
        let data = "t,w\n0,0\n1,2\n3,0\n5,0\n".to_owned();
        let mut files = DataFiles(vec![("belt.csv", data)]);
        let text = block(belt, method);
        let trajectory = with_data(&text, &mut files, "this", |compiled| {
            simulate::run(&compiled.system, &compiled.settings, &Request::default())
        });
        assert_eq!(trajectory.status, Status::Solved);
        assert_near(&end(&trajectory, "q"), &[4.0, 0.0], tolerance);
        let slips = times(&trajectory, EventKind::Slip);
        assert_near(&slips, &[1.0, 3.0], tolerance);
    }
}

/// A block in space at a height, over a road of which the belt has the speed (4, 3) times a number.
fn in_space(height: &str, velocity: &str, belt: &str, friction: &str, horizon: u8) -> String {
    format!(
        "model block {{
           state q[3] = [0, 0, {height}];
           state v[3] = {velocity};
           q' = v;
           let belt = {belt};
           mechanics q, v {{
             mass = 1;
             force = [0, 0, -10];
             contact road {{ gap = q[3]; restitution = 0; slip = [v[1] - 4*belt, v[2] - 3*belt]; {friction}; }}
           }}
         }}
         simulate this of block {{ horizon {horizon}; }}"
    )
}

/// In space the slip jumps to (2, 1.5), and friction is along it until both entries are zero.
#[test]
fn a_slip_with_two_entries_jumps_to_one_direction() {
    // |w| = 2.5 is gone after 2.5/3, on a way of 2.5 less than the belt's half.
    let trajectory = solved(
        &in_space(
            "0",
            "[0, 0, 0]",
            "if time < 1 then 0 else 0.5",
            "friction = 0.3",
            3,
        ),
        "this",
    );
    let follows = 2.5 / PULL;
    assert_near(&times(&trajectory, EventKind::Slip), &[1.0], 1e-12);
    assert_near(
        &times(&trajectory, EventKind::Stick),
        &[1.0 + follows],
        1e-10,
    );
    let way = 2.5 * (2.0 - 0.5 * follows);
    assert_near(&end(&trajectory, "q"), &[0.8 * way, 0.6 * way, 0.0], 1e-10);

    // A block that slips with the belt standing still is taken along at the instant at which the belt has its speed.
    let step = "if time < 0.5 then 0 else 0.2";
    let trajectory = solved(
        &in_space("0", "[2, 1.5, 0]", step, "friction = 0.3", 3),
        "this",
    );
    assert_near(&times(&trajectory, EventKind::Stick), &[0.5], 1e-9);
    let way = 2.5 * 0.5 - 0.5 * PULL * 0.25 + 2.5;
    assert_near(&end(&trajectory, "q"), &[0.8 * way, 0.6 * way, 0.0], 1e-9);
}

/// A relay turns the belt around wherever the block comes to 1 or goes back to 0.5. With friction 1 it takes the block a
/// time 2 to follow, from speed 1 to -1, and half of that at the start.
#[test]
fn a_relay_turns_a_belt_around() {
    let plane = "
        state q[2] = [0, 0]; state v[2] = [0, 0];
        let force = [0, -10]; let height = q[2]; let w = [v[1] - belt];";
    let space = "
        state q[3] = [0, 0, 0]; state v[3] = [0, 0, 0];
        let force = [0, 0, -10]; let height = q[3]; let w = [v[1] - belt, v[2]];";
    for (space, zeros) in [(plane, vec![0.0; 2]), (space, vec![0.0; 3])] {
        let text = format!(
            "model block {{
               {space}
               q' = v;
               switch back = hysteresis(q[1], on = 1, off = 0.5);
               let belt = 1 - 2*back;
               mechanics q, v {{
                 mass = 1;
                 force = force;
                 contact road {{ gap = height; restitution = 0; slip = w; friction = 0.1; }}
               }}
             }}
             simulate this of block {{ horizon 10; }}"
        );
        let trajectory = solved(&text, "this");
        let sticks = times(&trajectory, EventKind::Stick);
        assert_near(&sticks, &[1.0, 3.5, 6.0, 8.5], 1e-9);
        let slips = times(&trajectory, EventKind::Slip);
        assert_near(&slips, &[1.5, 4.0, 6.5, 9.0], 1e-9);
        assert_near(&end(&trajectory, "q"), &zeros, 1e-8);
        assert_near(&end(&trajectory, "v"), &zeros, 1e-8);
    }
}

/// A belt that steps while the block falls is, to the impact, a belt that always had that speed: an impulse 10 of the
/// road gives 0.5 along the belt, and friction as much again until the end.
#[test]
fn a_belt_may_step_while_the_block_is_in_flight() {
    for belt in ["if time < 0.5 then 0 else 1", "1"] {
        let trajectory = solved(
            &in_space("5", "[0, 0, 0]", belt, "friction = 0.05", 2),
            "this",
        );
        assert_near(&times(&trajectory, EventKind::Jump), &[1.0], 1e-10);
        assert_near(&end(&trajectory, "q"), &[0.8 * 0.75, 0.6 * 0.75, 0.0], 1e-9);
        assert_near(&end(&trajectory, "v"), &[0.8, 0.6, 0.0], 1e-9);
    }
}

/// The block falls onto the belt at the instant at which this starts: from event to event, the impact knows nothing of
/// it, and in time-freezing it gives the block the speed 0.05*10.
#[test]
fn a_belt_that_starts_at_an_impact_starts_behind_it_or_before() {
    for (method, impulse) in [("", 0.0), ("lower timefreezing;", 0.5)] {
        let text = format!(
            "model block {{
               state q[2] = [0, 5];
               state v[2] = [0, 0];
               q' = v;
               let belt = if time < 1 then 0 else 2;
               mechanics q, v {{
                 mass = 1;
                 force = [0, -10];
                 contact road {{ gap = q[2]; restitution = 0; slip = v[1] - belt; friction = 0.05; }}
               }}
             }}
             simulate this of block {{ horizon 2; {method} }}"
        );
        let trajectory = solved(&text, "this");
        assert_near(&end(&trajectory, "v"), &[impulse + 0.5, 0.0], 1e-9);
    }
}

/// A fall from 1 with g = 2 strikes at t = 1. The belt that starts then would pull at the block in the impact, by
/// 0.3 times the impulse 3 of its normal velocity from -2 to 1: whether it does so is told, and nothing where it starts
/// before or after, where the block has no friction, or where the belt goes on as it was.
#[test]
fn a_belt_that_steps_at_the_instant_of_an_impact_is_told() {
    let codes = |belt: &str, friction: f64, impulse: f64| {
        let text = format!(
            "model block {{
               state q[2] = [0, 1];
               state v[2] = [0, 0];
               q' = v;
               {belt}
               mechanics q, v {{
                 mass = eye(2);
                 force = [0, -2];
                 contact road {{ gap = q[2]; restitution = 0.5; slip = v[1] - belt; friction = {friction}; }}
               }}
             }}
             simulate this of block {{ horizon 1.5; }}"
        );
        let found = solved(&text, "this");
        // The impact has the slip before the step, and the next one is behind the end.
        assert_near(&end(&found, "v"), &[impulse * friction, 0.0], 1e-10);
        let warnings = found.warnings.iter();
        warnings
            .map(|warning| warning.code.clone())
            .collect::<Vec<_>>()
    };
    let belt = |from: &str| format!("let belt = if time < {from} then 0 else 2;");
    let told = ["W0710"];
    assert_eq!(codes(&belt("1"), 0.3, 0.0), told);
    let relay = "switch runs = hysteresis(time, on = 1, off = -1, start = 0); let belt = 2*runs;";
    assert_eq!(codes(relay, 0.3, 0.0), told);
    assert!(codes(&belt("0.9"), 0.3, 3.0).is_empty());
    assert!(codes(&belt("1.1"), 0.3, 0.0).is_empty());
    assert!(codes(&belt("1"), 0.0, 0.0).is_empty());
    let still = "let belt = (if time < 1 then 0 else 2)*0;";
    assert!(codes(still, 0.3, 0.0).is_empty());
}
