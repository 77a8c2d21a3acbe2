//! Contacts by finite elements with jumps between them (`lower impact`): closed forms, agreement with runs from event to
//! event, orders, printed forms, and what is refused.

use nsd_tests::{agrees, assert_near, end, larger, run, solved_optimum, times, with_experiment};
use nsdc::lowering::dcs;
use nsdc::lowering::discretize;
use nsdc::lowering::discretize::{Grid, discretize};
use nsdc::report::{EventKind, Failure, Series, Status, Trajectory};

/// The last values of a series.
fn last(series: &Series) -> &[f64] {
    series.at(series.values.len() / series.n_entries() - 1)
}

#[track_caller]
fn close(value: f64, exact: f64, within: f64) {
    assert!((value - exact).abs() <= within, "{value} is not {exact}");
}

/// Experiment `o` of a text, which must solve.
#[track_caller]
fn solved(text: &str) -> Trajectory {
    nsd_tests::solved(text, "o")
}

/// A run by finite elements agrees with one from event to event, in its end and in what happens.
#[track_caller]
fn agree(model: &str, horizon: f64, method: &str, within: f64) -> Trajectory {
    let text = format!(
        "{model}
         simulate o of m {{ horizon {horizon}; lower impact; method fesd {{ {method} }} }}
         simulate e of m {{ horizon {horizon}; tolerance 1e-12; }}"
    );
    let (found, events) = (solved(&text), run(&text, "e"));
    assert_eq!(events.status, Status::Solved);
    for (series, exact) in found.samples.states.iter().zip(&events.samples.states) {
        let ends = [series, exact].map(last);
        for (value, exact) in ends[0].iter().zip(ends[1]) {
            close(*value, *exact, within);
        }
    }
    let happened = |run: &Trajectory| {
        let events = run.history.events.iter();
        let mut events: Vec<_> = events
            .map(|event| (event.time, event.kind, event.surface.clone()))
            .collect();
        events.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, &a.2).cmp(&(b.1, &b.2))));
        events
    };
    let (found_events, exact_events) = (happened(&found), happened(&events));
    assert_eq!(found_events.len(), exact_events.len(), "{found_events:?}");
    for (found, exact) in found_events.iter().zip(&exact_events) {
        close(found.0, exact.0, within);
    }
    let names = |events: &[(f64, EventKind, String)]| {
        let mut names: Vec<_> = events
            .iter()
            .map(|event| (event.1, event.2.clone()))
            .collect();
        names.sort();
        names
    };
    assert_eq!(names(&found_events), names(&exact_events));
    found
}

/// The fall takes √(2h/g), every bounce 2 e v/g of the speed v before it.
#[test]
fn a_ball_bounces() {
    let (g, e, h): (f64, f64, f64) = (9.81, 0.9, 1.0);
    let found = solved(
        "model m {
           state q = 1;
           state v = 0;
           q' = v;
           mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.9; } }
         }
         simulate o of m { horizon 3; lower impact; method fesd { steps = 12; elements = 3; } }",
    );
    let fall = (2.0 * h / g).sqrt();
    let (mut t, mut speed, mut instants) = (fall, g * fall, vec![fall]);
    while t + 2.0 * e * speed / g < 3.0 {
        speed *= e;
        t += 2.0 * speed / g;
        instants.push(t);
    }
    let jumps = times(&found, EventKind::Jump);
    assert_eq!(jumps.len(), instants.len());
    for (jump, instant) in jumps.iter().zip(&instants) {
        close(*jump, *instant, 1e-10);
    }
    let (up, left) = (e * speed, 3.0 - t);
    close(
        last(&found.samples.states[0])[0],
        up * left - 0.5 * g * left * left,
        1e-9,
    );
    close(last(&found.samples.states[1])[0], up - g * left, 1e-9);
    // The published state at 3 (peers' numbers have these digits).
    close(last(&found.samples.states[0])[0], 0.418_351_72, 1e-8);
    close(last(&found.samples.states[1])[0], -0.487_550_89, 1e-8);
    let estimate = found.quality.error_estimate.expect("a finer run");
    assert!(estimate < 1e-8, "{estimate}");
}

/// It falls for √(2h/g), loses μ √(2gh) of its speed, and μg from then on.
#[test]
fn a_ball_slips_and_sticks() {
    let (g, mu, h, u): (f64, f64, f64, f64) = (10.0, 0.2, 1.0, 3.0);
    let found = agree(
        "model m {
           state q[2] = [0, 1];
           state v[2] = [3, 0];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [0, -10];
             contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = 0.2; }
           }
         }",
        2.5,
        "scheme = radau_iia(3); steps = 5; elements = 3;",
        1e-9,
    );
    let slipping = u - mu * (2.0 * g * h).sqrt();
    let path = u * (2.0 * h / g).sqrt() + slipping * slipping / (2.0 * mu * g);
    close(last(&found.samples.states[0])[0], path, 1e-9);
    close(times(&found, EventKind::Stick)[0], u / (mu * g), 1e-9);
}

/// A thrown ball that a constant force pulls along the floor: it falls for √(2h/g), and its impact, with an impulse of
/// (1 + e) √(2gh), takes at most μ times that of the slip v + f t, which turns round in flight where f is against it.
#[test]
fn slip_turns_round_in_flight() {
    let (g, h, horizon): (f64, f64, f64) = (10.0, 0.5, 0.6);
    let fall = (2.0 * h / g).sqrt();
    // It sticks and is pulled back, or on; it turns before the impact, behind it, or both; at the impact itself.
    let cases = [
        (1.0, -1.0, 0.5, 0.8),
        (1.0, 1.0, 0.5, 0.8),
        (0.2, -1.0, 0.01, 0.8),
        (1.0, -3.0, 0.01, 0.8),
        (-0.2, 4.0, 0.5, 0.6),
        (0.4, -2.0, 0.1, 0.5),
        (1.0, -1.0 / fall, 0.5, 0.8),
    ];
    for (v, f, mu, e) in cases {
        let found = solved(&format!(
            "model m {{
               state q[2] = [0, {h}];
               state v[2] = [{v}, 0];
               q' = v;
               mechanics q, v {{
                 mass = eye(2);
                 force = [{f:?}, -{g}];
                 contact floor {{ gap = q[2]; restitution = {e}; friction = {mu}; }}
               }}
             }}
             simulate o of m {{ horizon {horizon}; lower impact; method fesd {{ steps = 10; }} }}"
        ));
        let before: f64 = v + f * fall;
        let most = mu * (1.0 + e) * g * fall;
        let (after, left) = (before - before.clamp(-most, most), horizon - fall);
        let place = (v + 0.5 * f * fall) * fall + (after + 0.5 * f * left) * left;
        assert_near(
            &end(&found, "q"),
            &[place, (e * g * fall - 0.5 * g * left) * left],
            1e-10,
        );
        assert_near(
            &end(&found, "v"),
            &[after + f * left, e * g * fall - g * left],
            1e-10,
        );
        assert_near(&times(&found, EventKind::Jump), &[fall], 1e-10);
        let iterations = found.quality.stats.newton_iterations;
        assert!(iterations <= 40, "{iterations}: it is known where it turns");
    }
}

/// √(2h/g) after it was let go it goes up with the restitution of that instant.
#[test]
fn a_restitution_may_depend_on_time() {
    let found = agree(
        "model m {
           state q = 1;
           state v = 0;
           q' = v;
           mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.7 + time/4; } }
         }",
        1.0,
        "steps = 10;",
        1e-9,
    );
    let (g, fall) = (9.81, (2.0_f64 / 9.81).sqrt());
    let up = (0.7 + 0.25 * fall) * g * fall;
    close(
        last(&found.samples.states[1])[0],
        up - g * (1.0 - fall),
        1e-9,
    );
}

/// The restitution is 0.7 + t/2 where it strikes: 1 is exceeded at the second time.
#[test]
fn a_run_ends_before_the_step_in_which_a_coefficient_is_out_of_its_range() {
    let found = run(
        "model m {
           state q = 1;
           state v = 0;
           state c = 0;
           q' = v;
           c' = 1;
           mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.7 + c/2; } }
         }
         simulate o of m { horizon 2; lower impact; method fesd { steps = 10; } }",
        "o",
    );
    found.verify().expect("the invariants of `Trajectory`");
    let (g, fall) = (9.81, (2.0_f64 / 9.81).sqrt());
    let up = (0.7 + 0.5 * fall) * g * fall;
    let Some(Failure::Coefficient { time, .. }) = &found.failure else {
        panic!("{:?} {:?}", found.status, found.failure)
    };
    close(*time, fall + 2.0 * up / g, 1e-9);
    // Steps are 0.2 long.
    let (end, flown) = (1.2, 1.2 - fall);
    close(found.samples.time[found.samples.time.len() - 1], end, 1e-12);
    let last_piece = found.dense.pieces.last().expect("it has begun");
    close(last_piece.to, end, 1e-12);
    close(
        last(&found.samples.states[0])[0],
        up * flown - 0.5 * g * flown * flown,
        1e-9,
    );
    close(last(&found.samples.states[1])[0], up - g * flown, 1e-9);
    assert_eq!(times(&found, EventKind::Jump).len(), 1);
}

const CRADLE: &str = "
    model m {
      param d = 0;
      param e = 1;
      state q[3] = [1, 2 + d, 3 + 2*d];
      state v[3] = [1, 0, 0];
      q' = v;
      mechanics q, v { mass = eye(3); force = zeros(3); }
      for i in 1..2 { contact touch { gap = q[i + 1] - q[i] - 1; restitution = e; } }
    }";

/// Newton's law of both contacts at once where the balls touch, one after the other where they do not.
#[test]
fn a_cradle_of_three_balls() {
    let third = 1.0 / 3.0;
    for (with, exact) in [
        ("d = 0; e = 1;", [-third, 2.0 * third, 2.0 * third]),
        ("d = 0; e = 0;", [third; 3]),
        ("d = 0.01; e = 1;", [0.0, 0.0, 1.0]),
    ] {
        let found = solved(&format!(
            "{CRADLE} simulate o of m {{
               with {{ {with} }}
               horizon 1; lower impact;
               method fesd {{ scheme = radau_iia(2); steps = 3; elements = 3; }}
             }}"
        ));
        for (v, exact) in last(&found.samples.states[1]).iter().zip(exact) {
            close(*v, exact, 1e-10);
        }
    }
}

/// Both walls are reached at 0.4, and kept.
#[test]
fn two_contacts_close_at_once() {
    let found = agree(
        "model m {
           state q[2] = [0.6, 0.4];
           state v[2] = [-1.5, -1];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [-1, -1];
             contact wall { gap = 3*q[1] - 0.08*3; restitution = 0; }
             contact floor { gap = q[2] + 0.08; restitution = 0; }
           }
         }",
        1.0,
        "scheme = radau_iia(2); steps = 3; elements = 3;",
        1e-10,
    );
    assert!(!times(&found, EventKind::Jump).is_empty());
}

#[test]
fn a_ball_on_a_moving_floor() {
    agree(
        "model m {
           state q = 1;
           state v = 0;
           q' = v;
           mechanics q, v {
             mass = 1;
             force = -9.81;
             contact floor { gap = q - 0.1*sin(6*time); restitution = 0.6; }
           }
         }",
        1.3,
        "steps = 10; elements = 3;",
        1e-8,
    );
}

/// A pendulum that strikes a wall: the order is that of the scheme, 2 s - 1, or better while it is not settled.
#[test]
fn the_order_is_that_of_the_scheme() {
    let model = "model m {
        state q = 1;
        state v = 0;
        q' = v;
        mechanics q, v { mass = 1; force = -9.81*sin(q); contact wall { gap = q + 0.3; restitution = 0.7; } }
      }";
    let exact = run(
        &format!("{model} simulate o of m {{ horizon 2; tolerance 1e-13; }}"),
        "o",
    );
    let error = |steps: usize, nodes: usize| {
        let found = solved(&format!(
            "{model} simulate o of m {{
               horizon 2; lower impact;
               method fesd {{ scheme = radau_iia({nodes}); steps = {steps}; elements = 2; }}
             }}"
        ));
        let both = found.samples.states.iter().zip(&exact.samples.states);
        both.fold(0.0, |most, (a, b)| {
            larger(most, (last(a)[0] - last(b)[0]).abs())
        })
    };
    for (nodes, steps, order) in [(2, 20, 3.0), (3, 6, 5.0)] {
        let (coarse, fine) = (error(steps, nodes), error(2 * steps, nodes));
        let seen = (coarse / fine).log2();
        assert!(seen > order - 0.5, "{seen}: {coarse:.2e} {fine:.2e}");
    }
}

/// Infinitely many impacts fit into no step: that is said, and nothing is made up.
#[test]
fn accumulating_bounces_are_refused() {
    let found = run(
        "model m {
           state q = 1;
           state v = 0;
           q' = v;
           mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q; restitution = 0.2; } }
         }
         simulate o of m {
           horizon 1; lower impact;
           method fesd { scheme = radau_iia(2); steps = 2; elements = 2; }
         }",
        "o",
    );
    assert_ne!(found.status, Status::Solved);
    // The first impact is at √(2/9.81), and each bounce behind it takes a fifth of the time of the one before.
    let limit = 1.5 * (2.0 / 9.81_f64).sqrt();
    match found.failure.expect("a reason") {
        Failure::Accumulation { time, .. } => close(time, limit, 1e-9),
        other => panic!("{other}"),
    }
}

const BALL: &str = "
    model ball {
      state q = 1;
      state v = 0;
      control u in [-1, 1] = 0;
      q' = v;
      mechanics q, v { mass = 1; force = u - 10; contact floor { gap = q; restitution = 0.8; } }
    }";

/// The optimum of experiment `o` of a text, which agrees with a run from event to event.
#[track_caller]
fn optimum(text: &str, within: f64) -> Trajectory {
    let found = solved_optimum(text, "o");
    agrees(&found, within);
    found
}

/// With 11 down until 0.4 it strikes the sooner, and with 9 behind it comes up the higher: q + v s - 9 s²/2 = 0.
#[test]
fn a_ball_is_thrown_down_to_come_up() {
    let found = optimum(
        &format!(
            "{BALL} optimize o of ball {{
               horizon 0.8; intervals 4; elements 3; scheme radau_iia(2);
               lower impact;
               minimize -final(q);
             }}"
        ),
        1e-7,
    );
    let (q, v): (f64, f64) = (1.0 - 0.5 * 11.0 * 0.16, -11.0 * 0.4);
    let s = (v + (v * v + 18.0 * q).sqrt()) / 9.0;
    let (left, speed) = (0.4 - s, -0.8 * (v - 9.0 * s));
    close(
        found.objective.expect("an optimum"),
        -(speed * left - 4.5 * left * left),
        1e-7,
    );
    close(times(&found, EventKind::Jump)[0], 0.4 + s, 1e-7);
}

/// With a acceleration downward, 1 is left after √(2/a) with 0.8 √(2 a); 0.3 is reached √0.68/√a before the top, which
/// is 0.8 √(2/a) after that. The ball is the faster, the larger a is.
#[test]
fn the_least_time_is_found() {
    let found = optimum(
        &format!(
            "{BALL} optimize o of ball {{
               horizon free in [0.2, 2] = 0.8; intervals 1; elements 3; scheme radau_iia(2);
               lower impact;
               minimize final(time);
               final {{ q = 0.3; v >= 0; }}
             }}"
        ),
        1e-7,
    );
    let least = (1.8 * 2.0_f64.sqrt() - 0.68_f64.sqrt()) / 11.0_f64.sqrt();
    close(found.objective.expect("an optimum"), least, 1e-7);
}

/// The ball lies on the floor all the time, and friction takes 0.2 · 10 off u: from v = 1 it gets 2 far in 1 s where
/// ∫ (1 - t) (u - 2) = 1, with the least ∫ u² = 12 for u = 6 (1 - t). With the u that it starts from it does not stop:
/// where a ball stops at the end of an interval there is another local minimum.
#[test]
fn a_ball_that_lies_is_pushed() {
    let found = optimum(
        "model ball {
           state q[2] = [0, 0];
           state v[2] = [1, 0];
           control u = 3;
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [u, -10];
             contact floor { gap = q[2]; slip = v[1]; restitution = 0; friction = 0.2; }
           }
         }
         optimize o of ball {
           horizon 1; intervals 4; elements 2; scheme radau_iia(2); controls linear;
           lower impact;
           minimize integral(u^2);
           final { q[1] = 2; }
         }",
        1e-6,
    );
    close(found.objective.expect("an optimum"), 12.0, 1e-6);
}

#[test]
fn printed_forms() {
    let text = "model ball {
           state q[2] = [0, 1];
           state v[2] = [1, 0];
           control u in [-1, 1] = 0;
           q' = v;
           mechanics q, v {
             mass = [2, 0; 0, 2];
             force = [u, -20];
             contact floor { gap = q[2]; slip = v[1]; restitution = 0.5; friction = 0.3; }
           }
         }
         optimize o of ball {
           horizon 1; intervals 2; elements 2; scheme radau_iia(2);
           lower impact;
           minimize -final(q[1]);
         }";
    with_experiment(text, "o", |compiled| {
        let (system, settings) = (&compiled.system, &compiled.settings);
        let dcs = dcs::lower(system, &settings.numerics.lowerings).expect("contacts give impulses");
        dcs.verify().expect("the invariants of `Dcs`");
        insta::assert_snapshot!("impulses_dcs", dcs);
        let task = settings.optimize.as_ref().expect("an optimization");
        let grid = Grid {
            start: 0.0,
            horizon: 1.0,
            steps: 2,
        };
        let program = discretize(&dcs, grid, &discretize::Options::optimize(task));
        let (program, _) = program.expect("it is small");
        program.verify().expect("the invariants of `Mpcc`");
        insta::assert_snapshot!("impulses_program", program);
    });
}
