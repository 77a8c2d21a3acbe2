//! Friction in two directions in frozen time, against closed forms.

use nsd_tests::bodies::Body;
use nsd_tests::{assert_near, end, optimum, run, times, with_experiment};
use nsdc::lowering::dcs::{Formulation, lower_as};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

const ROADS: [&str; 2] = [
    "lower timefreezing; method fesd { scheme = radau_iia(4); }",
    "lower timefreezing; method event;",
];
/// By elements and by events, whose tolerance is 1e-8.
const WITHIN: f64 = 1e-7;

/// Moves a body by all roads.
fn roads(body: &Body, horizon: f64, mut check: impl FnMut(&Trajectory)) {
    for road in ROADS {
        let found = by(&body.model(), horizon, road);
        assert_eq!(found.status, Status::Solved, "{road} {:?}", found.failure);
        found.verify().expect("the invariants of `Trajectory`");
        check(&found);
    }
}

fn by(model: &str, horizon: f64, road: &str) -> Trajectory {
    run(
        &format!("{model} simulate this of m {{ horizon {horizon:?}; {road} }}"),
        "this",
    )
}

#[track_caller]
fn close(found: &[f64], exact: &[f64]) {
    assert_near(found, exact, WITHIN);
}

const BALL: Body = Body {
    q: [0.0, 0.0, 1.0],
    v: [2.0, 1.0, 0.0],
    force: [0.0, 0.0, -10.0],
    friction: 0.2,
    restitution: 0.0,
    turned: 0.0,
};

/// It falls for √0.2, loses μ√20 of its speed √5, and slides on by (√5 - μ√20)²/(2μg), along (2, 1).
#[test]
fn a_thrown_ball_slides_along_its_line_and_rests() {
    let (fall, left) = (0.2_f64.sqrt(), 5.0_f64.sqrt() - 0.2 * 20.0_f64.sqrt());
    let way = (1.0 + left * left / 4.0) / 5.0_f64.sqrt();
    for turned in [0.0, 0.3, 2.0] {
        let ball = Body { turned, ..BALL };
        roads(&ball, 2.0, |found| {
            close(&end(found, "q"), &[2.0 * way, way, 0.0]);
            close(&end(found, "v"), &[0.0; 3]);
            close(&times(found, EventKind::Jump), &[fall]);
            close(&times(found, EventKind::ContactClose), &[fall]);
            close(&times(found, EventKind::Stick), &[fall + left / 2.0]);
            let modes: Vec<&str> = found
                .history
                .modes
                .iter()
                .map(|m| m.mode.as_str())
                .collect();
            assert_eq!(modes, ["open(floor)", "slip(floor)", "stick(floor)"]);
        });
    }
}

/// Every bounce takes μ (1 + e) times the speed of the fall off the slip, until there is none.
#[test]
fn a_ball_that_bounces_slips_along_its_line() {
    let (e, mu) = (0.5, 0.2);
    let ball = Body {
        restitution: e,
        turned: 0.3,
        ..BALL
    };
    let (mut t, mut speed, mut slip, mut way) =
        (0.2_f64.sqrt(), 20.0_f64.sqrt(), 5.0_f64.sqrt(), 1.0);
    let mut bounces = vec![t];
    for _ in 0..2 {
        slip = (slip - mu * (1.0 + e) * speed).max(0.0);
        speed *= e;
        let flight = speed / 5.0;
        t += flight;
        way += slip * flight;
        bounces.push(t);
    }
    assert!(slip == 0.0 || slip > 0.1);
    // At the third bounce what is left of the slip stops.
    slip = (slip - mu * (1.0 + e) * speed).max(0.0);
    let s = 0.1;
    way += slip * s;
    let direction = [2.0 / 5.0_f64.sqrt(), 1.0 / 5.0_f64.sqrt()];
    roads(&ball, t + s, |found| {
        close(&times(found, EventKind::Jump), &bounces);
        let height = e * speed * s - 5.0 * s * s;
        close(
            &end(found, "q"),
            &[direction[0] * way, direction[1] * way, height],
        );
        let up = e * speed - 10.0 * s;
        close(
            &end(found, "v"),
            &[direction[0] * slip, direction[1] * slip, up],
        );
    });
}

/// A block with the velocity C along y, under a constant pull f along x: with μg = k f, k > 1, and τ falling from 1
/// to 0, v_y = C τ^k and v_x = C/2 (τ^(k-1) - τ^(k+1)), at t = C/(2f) (∫_τ^1 s^(k-2) + s^k ds).
#[test]
fn a_pulled_block_slides_along_a_curve_and_stops() {
    for (k, f, c, turned) in [(2.0, 2.0, 3.0, 0.0), (3.0, 1.5, 2.0, 0.7)] {
        let part = |n: f64, tau: f64| (1.0 - tau.powf(n)) / n;
        let at = |tau: f64| {
            let t = c / (2.0 * f) * (part(k - 1.0, tau) + part(k + 1.0, tau));
            let x = c * c / (4.0 * f) * (part(2.0 * k - 2.0, tau) - part(2.0 * k + 2.0, tau));
            let y = c * c / (2.0 * f) * (part(2.0 * k - 1.0, tau) + part(2.0 * k + 1.0, tau));
            let speed = 0.5 * c * (tau.powf(k - 1.0) - tau.powf(k + 1.0));
            (t, [x, y, 0.0, speed, c * tau.powf(k), 0.0])
        };
        let block = Body {
            q: [0.0; 3],
            v: [0.0, c, 0.0],
            force: [f, 0.0, -10.0],
            friction: k * f / 10.0,
            turned,
            ..BALL
        };
        let state = |found: &Trajectory| [end(found, "q"), end(found, "v")].concat();
        let (t, half) = at(0.5);
        roads(&block, t, |found| close(&state(found), &half));
        let (stop, whole) = at(0.0);
        roads(&block, 1.3 * stop, |found| {
            close(&state(found), &whole);
            assert_eq!(times(found, EventKind::Stick).len(), 1);
        });
    }
}

/// Gravity 10 with the share (1.2, 1.6) along a plane that is tilted, and 9.6 across it.
#[test]
fn a_block_on_a_tilted_plane_sticks_or_slides_straight_down() {
    for turned in [0.0, 0.4, 2.0] {
        let block = |friction: f64| Body {
            q: [0.3, -0.2, 0.0],
            v: [0.0; 3],
            force: [1.2, 1.6, -9.6],
            friction,
            turned,
            ..BALL
        };
        roads(&block(2.2 / 9.6), 1.0, |found| {
            close(&end(found, "q"), &[0.3, -0.2, 0.0]);
            close(&end(found, "v"), &[0.0; 3]);
        });
        roads(&block(1.0 / 9.6), 1.0, |found| {
            close(&end(found, "q"), &[0.6, 0.2, 0.0]);
            close(&end(found, "v"), &[0.6, 0.8, 0.0]);
        });
    }
}

/// A pull k t along (3, 4) moves a block once it is as large as friction, and from there its speed is k/2 times the square
/// of the time.
#[test]
fn a_block_that_is_pulled_harder_and_harder_breaks_loose() {
    let model = "model m {
        state q[3] = [0, 0, 0];
        state v[3] = [0, 0, 0];
        q' = v;
        mechanics q, v {
          mass = eye(3);
          force = [1.2*time, 1.6*time, -10];
          contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = 0.1; }
        }
      }";
    for road in ROADS {
        let found = by(model, 1.5, road);
        assert_eq!(found.status, Status::Solved, "{road} {:?}", found.failure);
        close(&times(&found, EventKind::Slip), &[0.5]);
        let way = 2.0 / 6.0;
        close(&end(&found, "q"), &[0.6 * way, 0.8 * way, 0.0]);
        close(&end(&found, "v"), &[0.6, 0.8, 0.0]);
    }
}

/// Without slip there is nothing for friction to do, in flight and on the floor.
#[test]
fn a_ball_that_falls_straight_down_stays_on_its_line() {
    let fall = 0.2_f64.sqrt();
    let ball = Body {
        v: [0.0; 3],
        ..BALL
    };
    roads(&ball, 1.0, |found| {
        close(&end(found, "q"), &[0.0; 3]);
        close(&times(found, EventKind::Stick), &[fall]);
    });
    let bouncing = Body {
        restitution: 0.5,
        ..ball
    };
    let left = 1.0 - fall * 2.0;
    roads(&bouncing, 1.0, |found| {
        close(&times(found, EventKind::Jump), &[fall, 2.0 * fall]);
        let speed = 20.0_f64.sqrt() / 4.0;
        close(
            &end(found, "q"),
            &[0.0, 0.0, speed * left - 5.0 * left * left],
        );
    });
}

/// A block that slides along (3, 4) is pushed along its line, by symmetry: with controls that are constant on intervals
/// with the middles t_k, u_k = λ (T - t_k) for the least Σ h u_k² + 10 (s - s_T)².
#[test]
fn the_least_push_along_the_line_of_slip() {
    let model = "model m {
        state q[3] = [0, 0, 0];
        state v[3] = [1.2, 1.6, 0];
        control u[2] in [-5, 5] = [0, 0];
        q' = v;
        mechanics q, v {
          mass = eye(3);
          force = [u[1], u[2], -10];
          contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = 0.2; }
        }
      }
      optimize push of m {
        horizon 0.5; intervals 4; elements 2; scheme radau_iia(3); lower timefreezing;
        minimize integral(dot(u, u)) + final(10*((q[1] - 0.6)^2 + (q[2] - 0.8)^2));
      }";
    let found = optimum(model, "push");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    let (h, horizon) = (0.125, 0.5);
    let shares: Vec<f64> = (0..4).map(|k| horizon - h * (f64::from(k) + 0.5)).collect();
    let gain: f64 = shares.iter().map(|share| h * share * share).sum();
    let free = 2.0 * horizon - 0.5 * 2.0 * horizon * horizon;
    let lambda = 10.0 * (1.0 - free) / (1.0 + 10.0 * gain);
    let reached = free + lambda * gain;
    close(&end(&found, "q"), &[0.6 * reached, 0.8 * reached, 0.0]);
    let speed = 2.0 - 2.0 * horizon + lambda * h * shares.iter().sum::<f64>();
    close(&end(&found, "v"), &[0.6 * speed, 0.8 * speed, 0.0]);
}

/// Where the mass is not the same in all directions, friction that acts little by little turns the slip on the way: not
/// the law of the impact, which has one direction, that at its end.
#[test]
fn an_impact_that_turns_slip_is_told() {
    let model = "model m {
        state q[3] = [0, 0, 0.8];
        state v[3] = [7, 6.8, 0];
        q' = v;
        mechanics q, v {
          mass = [1, -1, 0; -1, 2, 0; 0, 0, 1];
          force = [0, 0, -10];
          contact floor { gap = q[3]; slip = [v[1], v[2]]; restitution = 0; friction = 0.5; }
        }
      }";
    for road in ROADS {
        let found = by(model, 1.0, road);
        let Some(Failure::Standstill { time, .. }) = found.failure else {
            panic!("{road} {:?}", found.failure);
        };
        assert!((time - 0.4).abs() <= 1e-6, "{time}");
    }
}

/// The frozen system of the ball, and its complementarity system.
#[test]
fn printed_forms() {
    let bouncing = Body {
        restitution: 0.5,
        ..BALL
    };
    for (name, body) in [("ball_in_space", BALL), ("bouncing_in_space", bouncing)] {
        let text = format!(
            "{} simulate frozen of m {{ horizon 1; lower timefreezing; method fesd; }}",
            body.model()
        );
        with_experiment(&text, "frozen", |compiled| {
            let system = compiled.lowered();
            system
                .verify()
                .expect("freezing keeps the invariants of `System`");
            insta::assert_snapshot!(format!("{name}.frozen"), system);
            let dcs = lower_as(&system, Formulation::Step).expect("the systems are small");
            insta::assert_snapshot!(format!("{name}.frozen.step"), dcs);
        });
    }
}
