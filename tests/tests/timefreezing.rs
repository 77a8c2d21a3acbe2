//! Time-freezing against closed forms and against runs with jumps: printed forms, both methods, and what it refuses.

use nsd_tests::{assert_near, end, run, times, with_experiment};
use nsdc::lowering::dcs::{Formulation, lower_as};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

const HEATING: &str = "
    model heating {
      state y = 15;
      switch heater = hysteresis(y, on = 18, off = 20);
      y' = -0.2*y + 10*heater;
    }";

const BALL: &str = "
    model ball {
      param g = 9.81;
      param e = 0.9;
      state q = 1;
      state v = 0;
      q' = v;
      v' = -g;
      jump floor when q <= 0 and v < 0 { v := -e*v; }
    }";

const SLIDER: &str = "
    model slider {
      param mu = 0.3;
      state q[2] = [0, 1];
      state v[2] = [4, 0];
      q' = v;
      mechanics q, v {
        mass = eye(2);
        force = [0, -10];
        contact floor { gap = q[2]; restitution = 0; friction = mu; }
      }
    }";

const METHODS: [&str; 3] = [
    "method event;",
    "method fesd;",
    "method fesd { scheme = radau_iia(4); steps = 100; }",
];

/// The model in an experiment with `lower timefreezing`, by every method that takes it.
fn each_way(model: &str, settings: &str, mut check: impl FnMut(&Trajectory)) {
    let name = model.split_whitespace().nth(1).unwrap_or_default();
    for method in METHODS {
        let experiment = format!(
            "{model} simulate this of {name} {{ {settings} lower timefreezing; {method} }}"
        );
        let trajectory = run(&experiment, "this");
        assert_eq!(
            trajectory.status,
            Status::Solved,
            "{method} {:?}",
            trajectory.failure
        );
        trajectory
            .verify()
            .expect("a run keeps the invariants of `Trajectory`");
        check(&trajectory);
    }
}

#[test]
fn a_relay_switches_at_the_times_of_its_closed_form() {
    // y tends to 50 while heating and to 0 while cooling.
    let (first, cool, heat) = (
        5.0 * (35.0_f64 / 30.0).ln(),
        5.0 * (20.0_f64 / 18.0).ln(),
        5.0 * (32.0_f64 / 30.0).ln(),
    );
    let expected: Vec<f64> = (0..8)
        .map(|k| first + f64::from((k + 1) / 2) * cool + f64::from(k / 2) * heat)
        .collect();
    let last = 50.0 - 32.0 * (-0.2 * (4.0 - expected[7])).exp();
    each_way(HEATING, "horizon 4;", |trajectory| {
        assert_near(&times(trajectory, EventKind::Relay), &expected, 1e-9);
        assert_near(&trajectory.history.switch_times(), &expected, 1e-9);
        assert_near(&end(trajectory, "y"), &[last], 1e-9);
        assert_eq!(trajectory.samples.time.last(), Some(&4.0));
        assert_eq!(trajectory.history.modes[0].mode, "on(heater)");
        assert_eq!(trajectory.history.modes[1].mode, "off(heater)");
    });
}

#[test]
fn a_relay_switches_so_by_events_too() {
    let text = format!("{HEATING} simulate this of heating {{ horizon 4; }}");
    let trajectory = run(&text, "this");
    let published = [
        0.770_753_4,
        1.297_556_0,
        1.620_248_6,
        2.147_051_2,
        2.469_743_8,
        2.996_546_3,
        3.319_239_0,
        3.846_041_5,
    ];
    assert_near(&times(&trajectory, EventKind::Relay), &published, 1e-7);
    assert_near(&end(&trajectory, "y"), &[18.970_318_67], 1e-7);
}

#[test]
fn values_are_reported_in_physical_time() {
    each_way(HEATING, "horizon 1; output y every 0.25;", |trajectory| {
        assert_eq!(trajectory.samples.time, [0.0, 0.25, 0.5, 0.75, 1.0]);
        let switches = 5.0 * (35.0_f64 / 30.0).ln();
        let y = |t: f64| match t < switches {
            true => 50.0 - 35.0 * (-0.2 * t).exp(),
            false => 20.0 * (-0.2 * (t - switches)).exp(),
        };
        let expected: Vec<f64> = trajectory.samples.time.iter().map(|&t| y(t)).collect();
        assert_near(&trajectory.samples.states[0].values, &expected, 1e-7);
    });
}

/// The first element on the wall is too long, and ends below it: that is no violation, since it is not taken.
#[test]
fn the_certificate_is_that_of_the_elements_that_are_taken() {
    let text = "
        model wall {
          state x[2] = [0.5, 0];
          region free where x[1] > 0 { x' = [x[2], -10]; }
          region contact where x[1] < 0 { x' = [x[2], -1000*x[1] - 5*x[2]]; }
        }
        simulate falls of wall { horizon 0.5; lower timefreezing; method fesd; }";
    let found = run(text, "falls");
    assert_eq!(found.status, Status::Solved);
    let violation = found.quality.certificate.max_violation;
    assert!(violation <= 1e-12, "{violation:e}");
}

#[test]
fn a_ball_bounces_as_its_law_says() {
    let (g, e) = (9.81_f64, 0.9);
    let (mut bounce, mut speed) = ((2.0 / g).sqrt(), e * (2.0 * g).sqrt());
    let mut bounces = vec![bounce];
    while bounce + 2.0 * speed / g < 3.0 {
        (bounce, speed) = (bounce + 2.0 * speed / g, e * speed);
        bounces.push(bounce);
    }
    let s = 3.0 - bounce;
    each_way(BALL, "horizon 3;", |trajectory| {
        assert_near(&end(trajectory, "q"), &[speed * s - 0.5 * g * s * s], 1e-8);
        assert_near(&end(trajectory, "v"), &[speed - g * s], 1e-8);
        assert_near(&times(trajectory, EventKind::Jump), &bounces, 1e-8);
    });
}

#[test]
fn bounces_that_accumulate_end_the_run() {
    for method in ["method event;", "method fesd;"] {
        let text = format!(
            "{BALL} simulate this of ball {{
               with {{ e = 0.5; q = 0.5; }} horizon 3; lower timefreezing; {method}
             }}"
        );
        let trajectory = run(&text, "this");
        let Some(Failure::Standstill { time, what, .. }) = &trajectory.failure else {
            panic!("{:?}", trajectory.failure);
        };
        let limit = 3.0 * (1.0_f64 / 9.81).sqrt();
        assert!(*time < limit && limit - time < 1e-5, "{time}");
        assert_eq!(*what, format!("bounces accumulate towards t = {limit:.6}"));
    }
}

#[test]
fn a_ball_that_rests_on_a_floor_that_bounces_ends_the_run() {
    let text = format!(
        "{BALL} simulate this of ball {{ with {{ q = 0; }} horizon 3; lower timefreezing; }}"
    );
    let failure = run(&text, "this").failure;
    assert!(
        matches!(failure, Some(Failure::Standstill { .. })),
        "{failure:?}"
    );
}

#[test]
fn a_start_below_the_floor_is_refused() {
    let text = format!(
        "{BALL} simulate this of ball {{ with {{ q = -0.1; }} horizon 3; lower timefreezing; }}"
    );
    let failure = run(&text, "this").failure;
    assert!(
        matches!(failure, Some(Failure::Penetrates { .. })),
        "{failure:?}"
    );
}

#[test]
fn a_thrown_ball_slips_and_sticks() {
    // Impact at sqrt(2 h/g) with speed sqrt(2 g h); the impulse takes mu times that off the slip velocity, and
    // mu g the rest.
    let (g, mu) = (10.0_f64, 0.3);
    let fall = (2.0 / g).sqrt();
    let slip = 4.0 - mu * g * fall;
    let stop = fall + slip / (mu * g);
    let x = 4.0 * fall + slip * slip / (2.0 * mu * g);
    each_way(SLIDER, "horizon 3;", |trajectory| {
        assert_near(&end(trajectory, "q"), &[x, 0.0], 1e-9);
        assert_near(&end(trajectory, "v"), &[0.0, 0.0], 1e-9);
        assert_near(&times(trajectory, EventKind::Jump), &[fall], 1e-9);
        assert_near(&times(trajectory, EventKind::ContactClose), &[fall], 1e-9);
        assert_near(&times(trajectory, EventKind::Stick), &[stop], 1e-9);
        let half = trajectory.dense.at(1.0).expect("there is a solution then");
        let s = 1.0 - fall;
        assert_near(
            &half[..4],
            &[
                4.0 * fall + slip * s - 0.5 * mu * g * s * s,
                0.0,
                slip - mu * g * s,
                0.0,
            ],
            1e-7,
        );
    });
}

#[test]
fn strong_friction_that_locks_a_rod_ends_the_run() {
    // J_n M⁻¹ (J_n - μ J_t) is negative for a slender rod that leans forward: Painlevé's paradox. Its mirror image
    // slips the other way.
    for side in [1, -1] {
        let rod = format!(
            "model rod {{
               state q[3] = [0, 0.6, {side}*pi/6];
               state v[3] = [-10*{side}, 0, 0];
               q' = v;
               mechanics q, v {{
                 mass = diag([1, 1, 1/32]);
                 force = [0, -9.81, 0];
                 contact tip {{
                   gap = q[2] - 0.5*cos(q[3]);
                   slip = v[1] - 0.5*cos(q[3])*v[3];
                   restitution = 0;
                   friction = 3;
                 }}
               }}
             }}
             simulate this of rod {{ horizon 1; lower timefreezing; }}"
        );
        let failure = run(&rod, "this").failure;
        assert!(
            matches!(failure, Some(Failure::Painleve { .. })),
            "{side}: {failure:?}"
        );
    }
}

/// Models whose runs with jumps and frozen runs must agree, with their horizons.
const MODELS: [(&str, f64); 9] = [
    (HEATING, 4.0),
    (BALL, 2.0),
    // Positions that are not orthogonal in the mass.
    (
        "model oblique {
           state q[2] = [0, 0.5];
           state v[2] = [1, 0];
           q' = v;
           mechanics q, v {
             mass = [2, 0.5; 0.5, 1];
             force = [0, -9.81];
             contact floor { gap = q[2] + 0.1*sin(3*q[1]); restitution = 0.8; }
           }
         }",
        1.5,
    ),
    (
        "model box {
           state q[2] = [0, 0];
           state v[2] = [3, 2];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [0, -1];
             contact left { gap = q[1] + 1; restitution = 0.9; }
             contact right { gap = 1 - q[1]; restitution = 0.8; }
             contact bottom { gap = q[2] + 1; restitution = 0.7; }
             contact top { gap = 1 - q[2]; restitution = 1; }
           }
         }",
        2.0,
    ),
    (
        "model lift {
           state q = 1;
           state v = 0;
           q' = v;
           mechanics q, v {
             mass = 2;
             force = -2*9.81;
             contact floor { gap = q - 0.2*sin(3*time); restitution = 0.6; }
           }
         }",
        1.2,
    ),
    // Two relays that do not hear of each other, and one state that both act on.
    (
        "model rooms {
           state y[2] = [15, 12];
           state mix = 0;
           switch near = hysteresis(y[1], on = 18, off = 20);
           switch far = hysteresis(y[2], on = 13, off = 14);
           y[1]' = -0.2*y[1] + 10*near;
           y[2]' = -0.3*y[2] + 9*far;
           mix' = near + 2*far*y[1];
         }",
        3.0,
    ),
    // Two inelastic walls at a right angle to each other: the ball is pressed into the corner.
    (
        "model corner {
           state q[2] = [0.3, 0.5];
           state v[2] = [-1, 0];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [-1, -9.81];
             contact wall { gap = q[1]; restitution = 0; }
             contact floor { gap = q[2]; restitution = 0; }
           }
         }",
        1.0,
    ),
    // The first bounce slips all the time, the second one sticks.
    (
        "model rubber {
           state q[2] = [0, 0.5];
           state v[2] = [2.5, 0];
           q' = v;
           mechanics q, v {
             mass = diag([1, 1]);
             force = [0, -9.81];
             contact floor { gap = q[2]; slip = v[1]; restitution = 0.7; friction = 0.3; }
           }
         }",
        1.0,
    ),
    // Masses that differ, and a wall that is no coordinate.
    (
        "model slope {
           state q[2] = [0, 0.5];
           state v[2] = [1, 0];
           q' = v;
           mechanics q, v {
             mass = diag([2, 2]);
             force = [0, -9.81];
             contact hill {
               gap = 0.6*q[1] + 0.8*q[2];
               slip = 0.8*v[1] - 0.6*v[2];
               restitution = 0.5;
               friction = 0.2;
             }
           }
         }",
        0.8,
    ),
];

#[test]
fn jumps_and_frozen_time_agree() {
    for (model, horizon) in MODELS {
        let name = model.split_whitespace().nth(1).unwrap_or_default();
        let text = format!("{model} simulate this of {name} {{ horizon {horizon:?}; }}");
        let jumps = run(&text, "this");
        assert_eq!(jumps.status, Status::Solved, "{name}: {:?}", jumps.failure);
        each_way(model, &format!("horizon {horizon:?};"), |frozen| {
            for (a, b) in jumps.samples.states.iter().zip(&frozen.samples.states) {
                let (a, b) = (
                    a.at(jumps.samples.time.len() - 1),
                    b.at(frozen.samples.time.len() - 1),
                );
                assert_near(b, a, 1e-7);
            }
            let kinds = |t: &Trajectory| {
                t.history
                    .events
                    .iter()
                    .map(|e| (e.kind, e.surface.clone()))
                    .collect::<Vec<_>>()
            };
            assert_eq!(kinds(frozen), kinds(&jumps), "{name}");
            let instants =
                |t: &Trajectory| t.history.events.iter().map(|e| e.time).collect::<Vec<_>>();
            assert_near(&instants(frozen), &instants(&jumps), 1e-7);
        });
    }
}

#[test]
fn printed_forms() {
    for (model, experiment) in [(HEATING, "heating"), (BALL, "ball"), (SLIDER, "slider")] {
        let text = format!(
            "{model} simulate this of {experiment} {{ horizon 4; lower timefreezing; method fesd; }}"
        );
        with_experiment(&text, "this", |compiled| {
            let system = compiled.lowered();
            system
                .verify()
                .expect("freezing keeps the invariants of `System`");
            insta::assert_snapshot!(format!("{experiment}.system"), system);
            for formulation in [Formulation::Stewart, Formulation::Step] {
                let dcs = lower_as(&system, formulation).expect("the systems are small");
                insta::assert_snapshot!(format!("{experiment}.{formulation}"), dcs);
            }
        });
    }
}

/// The program of frozen time lets the memory of a relay rest between its sides; no motion does.
#[test]
fn relays_of_optima_are_on_one_side() {
    let mut between = 0;
    for (horizon, weight, start) in [(4, 0.1, 0), (3, 0.1, 0), (4, 1.0, 1)] {
        let text = format!(
            "model m {{ state x = 0; switch h = hysteresis(x, on = 1, off = -1, start = {start}); state y = 0; control u in [-2, 2] = 0; x' = u; y' = h; }}
             optimize o of m {{ horizon {horizon}; intervals 4; elements 4; lower timefreezing; minimize -final(y) + {weight}*integral(u^2); final {{ x = 0; }} }}"
        );
        let found = nsd_tests::optimum(&text, "o");
        match &found.failure {
            None => nsd_tests::agrees(&found, 1e-5),
            Some(failure) => {
                assert!(failure.to_string().contains("two sides"), "{failure}");
                between += 1;
            }
        }
    }
    assert!(between > 0);
}

/// Bounces that become smaller and smaller beside switches on the speed, which hold it where both of their sides have nearly
/// the same rates of the gap: no ball is below its floor, whether a run gets beyond the bounces or says that it does not.
#[test]
fn small_bounces_stay_above_the_floor() {
    for threshold in [-2.0, -1.0, -0.5, 0.5, 1.0] {
        for restitution in [0.5, 0.7] {
            for rest in [
                "output s = sign(v + 2);",
                "state y = 0; y' = abs(v - 1);",
                "",
            ] {
                let text = format!(
                    "model m {{ state q = 1; state v = 1; q' = v;
                       mechanics q, v {{ mass = 1; force = -2*sign(v - {threshold}) - 3; }}
                       contact ground {{ gap = q; restitution = {restitution}; }} {rest} }}
                     simulate s of m {{ horizon 2; lower timefreezing; method fesd; }}"
                );
                let found = run(&text, "s");
                let q = &found.samples.states[0].values;
                let least = q.iter().copied().fold(0.0, f64::min);
                assert!(least > -1e-8, "{least:e} in\n{text}");
                assert!(found.quality.certificate.max_violation < 1e-6, "{text}");
            }
        }
    }
}

/// Air drags a block that slides on the floor as it does in flight: the surface of its drag is that of its friction.
#[test]
fn drag_and_friction_share_a_surface() {
    for force in ["-v[1]*abs(v[1])", "-sign(v[1])", "-0.1*max(v[1], 0)"] {
        let model = format!(
            "model m {{ state q[2] = [0, 1]; state v[2] = [1, 0]; q' = v;
               mechanics q, v {{ mass = 1; force = [{force}, -10];
                 contact c {{ gap = q[2]; restitution = 0; friction = 0.3; }} }} }}"
        );
        let last = |settings: &str| {
            let text = format!("{model} simulate run of m {{ horizon 0.8; {settings} }}");
            let found = run(&text, "run");
            assert_eq!(
                found.status,
                Status::Solved,
                "{settings}: {:?}",
                found.failure
            );
            [end(&found, "q"), end(&found, "v")].concat()
        };
        let exact = last("method event;");
        for method in ["event", "fesd"] {
            assert_near(
                &last(&format!("method {method}; lower timefreezing;")),
                &exact,
                1e-8,
            );
        }
    }
}

/// A dose of one within milliseconds, beside a thermostat: elements in numerical time do not end where it is.
#[test]
fn elements_in_numerical_time_tell_of_pulses() {
    let text =
        "model heat { state T = 15; state c = 0; switch h = hysteresis(T, on = 18, off = 21);
          T' = -0.2*(T - 10) + 4*h; c' = exp(-((time - 3.7)/0.001)^2)/(0.001*sqrt(pi)); }
        simulate e of heat { horizon 10; }
        simulate f of heat { horizon 10; lower timefreezing; method fesd; }";
    let [by_events, by_elements] = ["e", "f"].map(|experiment| run(text, experiment));
    assert_near(&end(&by_events, "c"), &[1.0], 1e-6);
    let is_told = |found: &Trajectory| found.warnings.iter().any(|w| w.code == "W0711");
    assert!(!is_told(&by_events));
    assert!(is_told(&by_elements) || (end(&by_elements, "c")[0] - 1.0).abs() < 1e-6);
}
