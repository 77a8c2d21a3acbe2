//! Optimal control of what jumps, in frozen time: closed forms, agreement with runs from event to event, printed forms.

use nsd_tests::{agrees, solved_optimum, times, with_experiment};
use nsdc::lowering::dcs;
use nsdc::lowering::discretize;
use nsdc::lowering::discretize::{Grid, discretize};
use nsdc::report::{EventKind, Trajectory};

/// The optimum of experiment `o` of a text.
#[track_caller]
fn solved(text: &str) -> Trajectory {
    solved_optimum(text, "o")
}

#[track_caller]
fn close(value: f64, exact: f64, within: f64) {
    assert!((value - exact).abs() <= within, "{value} is not {exact}");
}

const BALL: &str = "
    model ball {
      state q = 1;
      state v = 0;
      control u in [-1, 1] = 0;
      q' = v;
      mechanics q, v {
        mass = 1;
        force = u - 10;
        contact floor { gap = q; restitution = 0.8; }
      }
    }";

/// Where the ball is at 0.8 if it falls with 11 until 0.4, and then moves with `rest` and bounces with 0.8.
fn thrown(rest: f64) -> (f64, f64) {
    let (q, v) = (1.0 - 0.5 * 11.0 * 0.16, -11.0 * 0.4);
    // q + v s - rest s²/2 = 0
    let s = (v + (v * v + 2.0 * rest * q).sqrt()) / rest;
    let left = 0.4 - s;
    let speed = -0.8 * (v - rest * s);
    (0.4 + s, speed * left - 0.5 * rest * left * left)
}

#[test]
fn a_ball_is_thrown_down_to_come_up() {
    let found = solved(&format!(
        "{BALL} optimize o of ball {{
           horizon 0.8; intervals 4; elements 3; scheme radau_iia(2);
           lower timefreezing;
           minimize -final(q);
         }}"
    ));
    let ((bounce, highest), (_, lower)) = (thrown(9.0), thrown(11.0));
    assert!(highest > lower);
    close(found.objective.expect("an optimum"), -highest, 1e-7);
    let bounces = times(&found, EventKind::Jump);
    assert_eq!(bounces.len(), 1, "{bounces:?}");
    close(bounces[0], bounce, 1e-7);
    assert_eq!(found.samples.time.last(), Some(&0.8));
    agrees(&found, 1e-7);
}

/// From 0.8, a ball without force bounces at 0.4, where the intervals meet: the program sees one side of that only, and
/// goes on from runs in which the ball bounces before.
#[test]
fn a_bounce_at_the_end_of_an_interval_is_left() {
    let stuck = |cost: &str, controls: &str| {
        solved(&format!(
            "{} optimize o of ball {{
               horizon 0.8; intervals 2; elements 3; scheme radau_iia(2); {controls}
               lower timefreezing;
               minimize {cost};
             }}",
            BALL.replace("q = 1;", "q = 0.8;")
        ))
    };
    // It falls with 11 until s, comes up with 0.8 of its speed, and moves with 11 until 0.4 and with 9 behind.
    let s = (1.6_f64 / 11.0).sqrt();
    let (up, left) = (0.8 * 11.0 * s, 0.4 - s);
    let (q, v) = (up * left - 5.5 * left * left, up - 11.0 * left);
    let found = stuck("-final(q)", "");
    let highest = q + 0.4 * v - 4.5 * 0.16;
    close(found.objective.expect("an optimum"), -highest, 1e-7);
    close(times(&found, EventKind::Jump)[0], s, 1e-7);
    agrees(&found, 1e-7);
    // It is the fastest downward if it is pushed downward all the time.
    let found = stuck("final(v)", "controls linear;");
    close(found.objective.expect("an optimum"), v - 11.0 * 0.4, 1e-7);
    agrees(&found, 1e-7);
    // Controls are straight lines from -1 through u at 0.4 to 1; 0.8 - 5 t² + (-t² / 2 + (1 + u) t³ / 2.4) is zero at s.
    let found = stuck("-final(q)", "controls linear;");
    let height = |u: f64| {
        let fall = |t: f64| {
            (
                0.8 - 5.5 * t * t + (1.0 + u) * t.powi(3) / 2.4,
                -11.0 * t + (1.0 + u) * t * t / 0.8,
            )
        };
        let s = (0..50).fold(0.4, |s, _| s - fall(s).0 / fall(s).1);
        // Without the bounce it would be at `fall`; the bounce adds a speed of 1.8 times that of the impact.
        let (q, v) = fall(0.4);
        let (q, v) = (q - 1.8 * fall(s).1 * (0.4 - s), v - 1.8 * fall(s).1);
        q + 0.4 * v - 5.0 * 0.16 + 0.16 * (u / 2.0 + (1.0 - u) / 6.0)
    };
    let highest = (0..=20_000).map(|i| height(f64::from(i) * 1e-4 - 1.0));
    let highest = highest.fold(f64::NEG_INFINITY, f64::max);
    close(found.objective.expect("an optimum"), -highest, 1e-7);
    agrees(&found, 1e-7);
}

/// With a acceleration downward, 1 is left after √(2/a) with 0.8 √(2 a); 0.3 is reached √0.68/√a before the top, which
/// is 0.8 √(2/a) after that. The ball is the faster, the larger a is.
#[test]
fn the_least_time_is_that_of_the_clock() {
    let found = solved(&format!(
        "{BALL} optimize o of ball {{
           horizon free in [0.2, 2] = 0.8; intervals 1; elements 3; scheme radau_iia(2);
           lower timefreezing;
           minimize final(time);
           final {{ q = 0.3; v >= 0; }}
         }}"
    ));
    let least = (1.8 * 2.0_f64.sqrt() - 0.68_f64.sqrt()) / 11.0_f64.sqrt();
    close(found.objective.expect("an optimum"), least, 1e-7);
    close(
        *found.samples.time.last().expect("a run has an end"),
        least,
        1e-7,
    );
    agrees(&found, 1e-7);
}

/// The ball lies on the floor all the time, and friction takes 0.2 · 10 off u: from v = 1 it gets 2 far in 1 s where
/// ∫ (1 - t) (u - 2) = 1, with the least ∫ u² = 12 for u = 6 (1 - t).
#[test]
fn a_ball_that_lies_is_pushed() {
    let found = solved(
        "model ball {
           state q[2] = [0, 0];
           state v[2] = [1, 0];
           control u = 0;
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [u, -10];
             contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = 0.2; }
           }
         }
         optimize o of ball {
           horizon 1; intervals 4; elements 2; scheme radau_iia(2); controls linear;
           lower timefreezing;
           minimize integral(u^2);
           final { q[1] = 2; }
         }",
    );
    close(found.objective.expect("an optimum"), 12.0, 1e-6);
    agrees(&found, 1e-6);
}

/// A heater with memory goes on at 18: the colder it is outside before, the sooner. Half a second later it is warmest
/// where u = 0 until 1/4, and 1 behind, as little of that is left until 18 is reached.
/// Where the guess has no speed and nothing touches, it makes no difference which side of zero the speed of the contact
/// is on, and no speed is a branch of its own: in the ones beside it, the same point is not stationary.
#[test]
fn a_disc_does_not_stay_where_its_speed_is_zero() {
    let found = solved(
        "model discs {
           state q1[2] = [-1, 0];
           state q2[2] = [1, 0];
           state v1[2] in [-5, 5] = [0, 0];
           state v2[2] in [-5, 5] = [0, 0];
           control u[2] in [-20, 20] = [0, 0];
           q1' = v1;
           q2' = v2;
           mechanics q1, v1 { mass = 2*eye(2); force = u - 2*v1/norm(v1 + [0.1, 0.1]); }
           mechanics q2, v2 { mass = eye(2); force = -2*v2/norm(v2 + [0.1, 0.1]); }
           contact touch { gap = norm(q1 - q2) - 0.5; restitution = 0; }
           let d1 = q1 - [1, 0];
           let d2 = q2 - [-1, 0];
         }
         optimize o of discs {
           horizon 3; intervals 2; elements 3; scheme radau_iia(2);
           lower timefreezing;
           minimize integral(10*dot(d1, d1) + 20*dot(d2, d2) + 0.1*dot(u, u))
             + 1000*final(dot(d1, d1) + dot(d2, d2) + dot(v1, v1) + dot(v2, v2));
         }",
    );
    // To stay costs 4 (3*(10 + 20) + 2000), and any push to the right less.
    let objective = found.objective.expect("it was solved");
    assert!(objective < 8000.0, "{objective}");
}

/// With q(1) = 0 it strikes the floor at the end and leaves with -e v: of ∫ 0.089 u² + (0 + 1.863)² + 0.445 e² v(1)² the
/// least is a linear system in u, v(1) and the multiplier of q(1) = 0. Any later impact costs 1 %.
#[test]
fn an_impact_at_the_end_is_found() {
    let found = solved(
        "model m {
           control u in [-5, 5] = 0.857;
           state q = 0.708; state v = -0.468;
           q' = v;
           mechanics q, v { mass = 1; force = u - 2; contact floor { gap = q; restitution = 0.667; } }
         }
         optimize o of m {
           horizon 1; intervals 6; elements 3; lower impact;
           minimize final((q + 1.863)^2 + 0.445*v^2) + integral(0.089*u^2);
         }",
    );
    let (h, a, r) = (1.0 / 6.0, 0.445 * 0.667 * 0.667, 0.089 / 6.0);
    // q(1) = 0.708 - 0.468 - 1 + Σ w u, v(1) = -0.468 - 2 + Σ h u, 2 r u + 2 a v(1) h + λ w = 0.
    let w = [11.0, 9.0, 7.0, 5.0, 3.0, 1.0].map(|k| h * k / 12.0);
    let squares: f64 = w.iter().map(|w| w * w).sum();
    let sum: f64 = w.iter().sum();
    let (a11, a12, b1) = (1.0 + a * h / r, 0.5 * h * sum / r, -2.468);
    let (a21, a22, b2) = (-a * h * sum / r, -0.5 * squares / r, 0.76);
    let det = a11 * a22 - a12 * a21;
    let (v, lambda) = ((b1 * a22 - a12 * b2) / det, (a11 * b2 - a21 * b1) / det);
    let u = w.map(|w| -(2.0 * a * v * h + lambda * w) / (2.0 * r));
    let cost: f64 = u.iter().map(|u| r * u * u).sum();
    let exact = 1.863 * 1.863 + a * v * v + cost;
    close(found.objective.expect("an optimum"), exact, 1e-8);
    assert_eq!(times(&found, EventKind::Jump), [1.0]);
}

#[test]
fn a_relay_switches_where_the_outside_lets_it() {
    let found = solved(
        "model heating {
           state y = 19;
           control u in [0, 1] = 0.5;
           switch heater = hysteresis(y, on = 18, off = 20, start = 0);
           y' = -0.2*(y - u) + 10*heater;
         }
         optimize o of heating {
           horizon 0.5; intervals 2; elements 3; scheme radau_iia(3);
           lower timefreezing;
           minimize -final(y);
         }",
    );
    // y is y₁ at 1/4, and 1 + (y₁ - 1) exp(-(t - 1/4)/5) until the heater is on.
    let middle = 19.0 * (-0.05_f64).exp();
    let on = 5.0 * ((middle - 1.0) / 17.0).ln();
    let warmest = 51.0 - 33.0 * (-0.2 * (0.25 - on)).exp();
    close(found.objective.expect("an optimum"), -warmest, 1e-6);
    close(times(&found, EventKind::Relay)[0], 0.25 + on, 1e-6);
    agrees(&found, 1e-6);
}

#[test]
fn printed_forms() {
    let text = format!(
        "{BALL} optimize o of ball {{
           horizon free in [0.2, 2] = 0.8; intervals 2; elements 2; scheme radau_iia(2);
           lower timefreezing;
           minimize integral(u^2) + final(time);
           final {{ q = 0.3; v >= 0; }}
         }}"
    );
    with_experiment(&text, "o", |compiled| {
        let (system, settings) = (compiled.lowered(), &compiled.settings);
        system.verify().expect("the invariants of `System`");
        insta::assert_snapshot!("ball.system", system);
        let dcs = dcs::lower(&system, &settings.numerics.lowerings).expect("it is small");
        insta::assert_snapshot!("ball.dcs", dcs);
        let task = settings.optimize.as_ref().expect("an optimization");
        let grid = Grid {
            start: 0.0,
            horizon: settings.horizon,
            steps: task.discretization.intervals,
        };
        let options = discretize::Options::optimize(task);
        let (mpcc, _) = discretize(&dcs, grid, &options).expect("it is small");
        insta::assert_snapshot!("ball.fesd", mpcc);
    });
}
