//! One scene, several roads: from event to event, in frozen time, and by finite elements with impulses where they meet
//! come to the same closed form, and say so where a road ends. Printed forms of all of them.

use nsd_tests::random::Random;
use nsd_tests::{assert_near, end, run, times, with_experiment};
use nsdc::lowering::dcs;
use nsdc::lowering::dcs::{Formulation, lower_as};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

const EVENTS: &str = "tolerance 1e-12;";
const FROZEN: [&str; 2] = [
    "lower timefreezing; method event;",
    "lower timefreezing; method fesd { scheme = radau_iia(4); }",
];
const IMPULSES: &str =
    "lower impact; method fesd { scheme = radau_iia(3); steps = 8; elements = 4; }";

/// The model `m` of a scene by all roads, each with how accurate it has to be: by events, in frozen time, by impulses.
fn roads(model: &str, horizon: f64, within: [f64; 3], mut check: impl FnMut(&Trajectory, f64)) {
    let [events, frozen, impulses] = within;
    let frozen = FROZEN.map(|road| (road, frozen));
    let all = [(EVENTS, events), (IMPULSES, impulses)];
    for (road, within) in all.into_iter().chain(frozen) {
        let found = by(model, horizon, road);
        assert_eq!(found.status, Status::Solved, "{road} {:?}", found.failure);
        found.verify().expect("the invariants of `Trajectory`");
        let violation = found.quality.certificate.max_violation;
        assert!(violation <= within.max(1e-9), "{road} {violation:e}");
        check(&found, within);
    }
}

fn by(model: &str, horizon: f64, road: &str) -> Trajectory {
    run(
        &format!("{model} simulate this of m {{ horizon {horizon:?}; {road} }}"),
        "this",
    )
}

fn ball(g: f64, e: f64, h: f64) -> String {
    format!(
        "model m {{
           state q = {h:?};
           state v = 0;
           q' = v;
           mechanics q, v {{ mass = 1; force = -{g:?}; contact floor {{ gap = q; restitution = {e:?}; }} }}
         }}"
    )
}

/// Instants of the bounces, and the state at the end.
fn bounces(g: f64, e: f64, h: f64, horizon: f64) -> (Vec<f64>, [f64; 2]) {
    let mut t = (2.0 * h / g).sqrt();
    let (mut speed, mut instants) = (e * g * t, vec![t]);
    while t + 2.0 * speed / g < horizon {
        t += 2.0 * speed / g;
        speed *= e;
        instants.push(t);
    }
    let s = horizon - t;
    (instants, [speed * s - 0.5 * g * s * s, speed - g * s])
}

/// The published numbers of two balls, and the state of a third one at 3.
#[test]
fn a_ball_bounces() {
    for (g, e, h, horizon) in [
        (10.0, 0.9, 1.0, 2.0),
        (9.81, 1.0, 0.8, 3.0),
        (9.81, 0.9, 1.0, 3.0),
    ] {
        let (instants, state) = bounces(g, e, h, horizon);
        roads(
            &ball(g, e, h),
            horizon,
            [1e-12, 1e-8, 1e-8],
            |found, within| {
                assert_near(&times(found, EventKind::Jump), &instants, within);
                assert_near(&[end(found, "q")[0], end(found, "v")[0]], &state, within);
            },
        );
    }
    let (instants, state) = bounces(10.0, 0.9, 1.0, 2.0);
    assert_near(&instants, &[0.447_214, 1.252_198, 1.976_684], 1e-6);
    // The last published digits are those of a method with an error of its own.
    assert_near(&state, &[0.073_297, 3.027_030], 5e-6);
}

/// Numbers in [0, 1) that look random and are always the same.
fn scatter(seed: u32) -> f64 {
    (43_758.545 * (12.9898 * (f64::from(seed) + 1.0)).sin())
        .fract()
        .abs()
}

/// Three falls long, where bounces do not accumulate yet.
#[test]
fn balls_follow_the_closed_form() {
    for k in 0..100 {
        let g = 1.0 + 19.0 * scatter(3 * k);
        let e = 0.5 + 0.5 * scatter(3 * k + 1);
        let h = 0.1 + 2.0 * scatter(3 * k + 2);
        let horizon = 2.6 * (2.0 * h / g).sqrt();
        let (instants, state) = bounces(g, e, h, horizon);
        let speed = (2.0 * g * h).sqrt().max(1.0);
        roads(
            &ball(g, e, h),
            horizon,
            [1e-11, 1e-8, 1e-8],
            |found, within| {
                assert_near(&times(found, EventKind::Jump), &instants, within);
                let found = [end(found, "q")[0], end(found, "v")[0]];
                assert_near(&found, &state, within * speed);
            },
        );
    }
}

/// It falls with a = g - up, loses μ times the speed of the fall, and slows down by μ a - along.
fn thrown(g: f64, mu: f64, [h, u]: [f64; 2], push: [f64; 2], horizon: f64) {
    let model = format!(
        "model m {{
           state q[2] = [0, {h:?}];
           state v[2] = [{u:?}, 0];
           q' = v;
           mechanics q, v {{
             mass = eye(2);
             force = [{:?}, {:?} - {g:?}];
             contact floor {{ gap = q[2]; slip = v[1]; restitution = 0; friction = {mu:?}; }}
           }}
         }}",
        push[0], push[1],
    );
    let a = g - push[1];
    let fall = (2.0 * h / a).sqrt();
    let slip = u + push[0] * fall - mu * a * fall;
    let drag = mu * a - push[0];
    let (rest, landed) = (fall + slip / drag, u * fall + 0.5 * push[0] * fall * fall);
    roads(&model, horizon, [1e-9, 1e-7, 1e-7], |found, within| {
        assert_near(&times(found, EventKind::ContactClose), &[fall], within);
        let (x, v) = match rest < horizon {
            true => {
                assert_near(&times(found, EventKind::Stick), &[rest], within);
                (landed + 0.5 * slip * slip / drag, 0.0)
            }
            false => {
                let s = horizon - fall;
                (landed + slip * s - 0.5 * drag * s * s, slip - drag * s)
            }
        };
        assert_near(&end(found, "q"), &[x, 0.0], within);
        assert_near(&end(found, "v"), &[v, 0.0], within);
    });
}

#[test]
fn a_ball_on_a_rough_floor_slips_and_rests() {
    thrown(10.0, 0.3, [1.0, 4.0], [0.0, 0.0], 3.0);
    thrown(10.0, 0.2, [1.0, 3.0], [0.0, 0.0], 2.5);
    thrown(9.81, 0.6, [0.5, 2.0], [0.0, 0.0], 1.2);
    // It slips all the time, and an external force pulls.
    thrown(10.0, 0.3, [0.06, 3.0], [0.0, 0.0], 0.2);
    thrown(10.0, 0.3, [1.0, 4.0], [1.0, 1.0], 3.0);
}

const CORNER: &str = "
    model m {
      state q[2] = [0.8, 0.5];
      state v[2] = [-1.5, -1];
      q' = v;
      mechanics q, v {
        mass = eye(2);
        force = [-1, -9.81];
        contact wall { gap = q[1]; restitution = 0; }
        contact floor { gap = q[2]; restitution = 0; }
      }
    }";

/// One wall after the other, and both are kept.
/// A wheel without spin falls from 0.2: its floor, whose gap knows nothing of the spin, makes it roll at once, with
/// v = 5/7 and r w = v from I = 2/5 m r².
#[test]
fn a_wheel_rolls_where_it_strikes() {
    let model = "
        model m {
          param r = 0.03;
          param mass = 0.17;
          state q[2] = [0, 0.2];
          state turned = 0;
          state v[2] = [1, 0];
          state w = 0;
          q' = v;
          turned' = w;
          mechanics q, v { mass = mass; force = [0, -mass*10]; }
          mechanics turned, w { mass = 0.4*mass*r^2; force = 0; }
          contact floor { gap = q[2]; restitution = 0; friction = 0.2; slip = v[1] - r*w; }
        }";
    let check = |found: &Trajectory, within: f64| {
        assert_near(&times(found, EventKind::Jump), &[0.2], within);
        assert_near(&end(found, "v"), &[5.0 / 7.0, 0.0], within);
        assert_near(&end(found, "w"), &[500.0 / 21.0], within);
    };
    roads(model, 1.0, [1e-12, 1e-8, 1e-8], check);
    let found = by(model, 1.0, "method timestepping { steps = 100; }");
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    check(&found, 1e-12);
}

#[test]
fn two_walls_keep_what_falls_on_them() {
    let reach = |q: f64, v: f64, a: f64| ((v * v + 2.0 * a * q).sqrt() - v) / a;
    let instants = [reach(0.5, 1.0, 9.81), reach(0.8, 1.5, 1.0)];
    roads(CORNER, 1.5, [1e-12, 1e-8, 1e-8], |found, within| {
        assert_near(&times(found, EventKind::Jump), &instants, within);
        assert_near(&times(found, EventKind::ContactClose), &instants, within);
        assert_near(&end(found, "q"), &[0.0, 0.0], within);
        assert_near(&end(found, "v"), &[0.0, 0.0], within);
    });
}

/// The same of other corners: by events of two walls and of three, and of two in frozen time, where what is held at zero is
/// known to rounding only.
#[test]
fn walls_keep_what_falls_on_them() {
    let mut random = Random(27);
    for case in 0..24 {
        let n = if case < 8 { 2 } else { 3 };
        let mut draw = |low: f64, high: f64| -> Vec<f64> {
            (0..n).map(|_| random.rounded(low, high)).collect()
        };
        let (q, v, g) = (draw(0.1, 1.0), draw(0.0, 2.0), draw(0.5, 12.0));
        let down = |values: &[f64]| values.iter().map(|x| -x).collect::<Vec<f64>>();
        let walls: String = (1..=n)
            .map(|k| format!("contact w{k} {{ gap = q[{k}]; restitution = 0; }}"))
            .collect();
        let model = format!(
            "model m {{
               state q[{n}] = {q:?}; state v[{n}] = {:?};
               q' = v;
               mechanics q, v {{ mass = eye({n}); force = {:?}; {walls} }}
             }}",
            down(&v),
            down(&g)
        );
        let reach = |k: usize| ((v[k] * v[k] + 2.0 * g[k] * q[k]).sqrt() - v[k]) / g[k];
        let mut instants: Vec<f64> = (0..n).map(reach).collect();
        instants.sort_by(f64::total_cmp);
        let horizon = instants[n - 1] + 0.5;
        // Three in frozen time take minutes.
        let roads = [(EVENTS, 1e-12), (FROZEN[0], 1e-8)].into_iter();
        for (road, within) in roads.take(4 - n) {
            let found = by(&model, horizon, road);
            assert_eq!(found.status, Status::Solved, "{road} {model}");
            assert_near(&times(&found, EventKind::ContactClose), &instants, within);
            assert_near(&end(&found, "q"), &vec![0.0; n], within);
            assert_near(&end(&found, "v"), &vec![0.0; n], within);
        }
    }
}

fn room([q, v]: [[f64; 2]; 2]) -> String {
    format!(
        "model m {{
           state q[2] = [{:?}, {:?}];
           state v[2] = [{:?}, {:?}];
           q' = v;
           mechanics q, v {{
             mass = 1;
             force = [0, 0];
             contact left  {{ gap = q[1]; restitution = 1; }}
             contact right {{ gap = 1 - q[1]; restitution = 1; }}
             contact floor {{ gap = q[2]; restitution = 1; }}
             contact roof  {{ gap = 1 - q[2]; restitution = 1; }}
           }}
         }}",
        q[0], q[1], v[0], v[1]
    )
}

/// Triangle waves, and the corner, where two walls are struck at once.
#[test]
fn a_ball_in_four_walls() {
    let wave = |s: f64| 1.0 - (s.rem_euclid(2.0) - 1.0).abs();
    let exact = [wave(0.3 + 4.1), wave(0.4 + 0.7 * 4.1)];
    roads(
        &room([[0.3, 0.4], [1.0, 0.7]]),
        4.1,
        [1e-12, 1e-8, 1e-8],
        |found, within| {
            assert_near(&end(found, "q"), &exact, within);
        },
    );
    roads(
        &room([[0.5, 0.5], [1.0, 1.0]]),
        1.7,
        [1e-12, 1e-8, 1e-8],
        |found, within| {
            assert_near(
                &times(found, EventKind::Jump),
                &[0.5, 0.5, 1.5, 1.5],
                within,
            );
            assert_near(&end(found, "q"), &[0.2, 0.2], within);
        },
    );
}

/// A body meets a wall without rebound, and falls on along it: nothing presses the wall, and it stays closed.
#[test]
fn what_nothing_presses_stays_closed() {
    let model = "model m {
        state q[2] = [0.97, 0.369]; state v[2] = [0.771, 0.422];
        q' = v;
        mechanics q, v {
          mass = 1; force = [0, -2];
          contact floor { gap = q[2]; restitution = 0; }
          contact wall { gap = 1.5 - q[1]; restitution = 0; }
        }
      }";
    let wall = (1.5 - 0.97) / 0.771;
    let floor = 0.5 * (0.422 + (0.422_f64.powi(2) + 4.0 * 0.369).sqrt());
    roads(model, 1.957, [1e-12, 1e-8, 1e-8], |found, within| {
        for kind in [EventKind::Jump, EventKind::ContactClose] {
            assert_near(&times(found, kind), &[wall, floor], within);
        }
        assert!(times(found, EventKind::ContactOpen).is_empty());
        let modes = found.history.modes.iter().map(|mode| mode.mode.as_str());
        let modes: Vec<&str> = modes.collect();
        let [open, wall, both] = modes[..] else {
            panic!("{modes:?}");
        };
        assert_eq!(open, "open(floor), open(wall)");
        assert_eq!(wall, "open(floor), closed(wall)");
        assert_eq!(both, "closed(floor), closed(wall)");
        assert_near(&end(found, "q"), &[1.5, 0.0], within);
    });
}

/// A body that begins on a floor without weight lies on it until it is lifted, at t = 1.
#[test]
fn what_is_closed_at_the_start_is_lifted_off() {
    let model = "model m {
        state q = 0; state v = 0; q' = v;
        mechanics q, v { mass = 1; force = step(time - 1); contact floor { gap = q; restitution = 0; } }
      }";
    for road in [EVENTS, FROZEN[0], IMPULSES] {
        let found = by(model, 2.0, road);
        assert_eq!(found.status, Status::Solved, "{road}");
        assert_near(&times(&found, EventKind::ContactOpen), &[1.0], 1e-8);
        assert_near(&end(&found, "q"), &[0.5], 1e-8);
    }
}

fn cradle(apart: f64, e: f64) -> String {
    format!(
        "model m {{
           state q[3] = [1, 2 + {apart:?}, 3 + 2*{apart:?}];
           state v[3] = [1, 0, 0];
           q' = v;
           mechanics q, v {{ mass = eye(3); force = zeros(3); }}
           for i in 1..2 {{ contact touch {{ gap = q[i + 1] - q[i] - 1; restitution = {e:?}; }} }}
         }}"
    )
}

#[test]
fn a_cradle_of_three_balls() {
    roads(
        &cradle(0.01, 1.0),
        1.0,
        [1e-12, 1e-8, 1e-8],
        |found, within| {
            assert_near(&times(found, EventKind::Jump), &[0.01, 0.02], within);
            assert_near(&end(found, "v"), &[0.0, 0.0, 1.0], within);
        },
    );
    // Of balls that touch only the first contact strikes, and the second one pushes.
    roads(
        &cradle(0.0, 0.0),
        1.0,
        [1e-12, 1e-8, 1e-8],
        |found, within| {
            assert_near(&times(found, EventKind::Jump), &[0.0], within);
            assert_near(&end(found, "v"), &[1.0 / 3.0; 3], within);
        },
    );
    // One bounce after the other is not the law of both: by impulses it is, and in frozen time it is not.
    let model = cradle(0.0, 1.0);
    let found = by(&model, 1.0, IMPULSES);
    assert_eq!(found.status, Status::Solved, "{:?}", found.failure);
    assert_near(&end(&found, "v"), &[-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0], 1e-8);
    assert_near(&times(&found, EventKind::Jump), &[0.0], 1e-12);
    for road in FROZEN {
        let failure = by(&model, 1.0, road).failure;
        let stops = matches!(failure, Some(Failure::Standstill { time, .. }) if time == 0.0);
        assert!(stops, "{failure:?}");
    }
}

/// A rod of length l, its angle measured from the vertical.
fn rod(l: f64, inertia: f64, mu: f64, [q, v]: [[f64; 3]; 2]) -> String {
    format!(
        "model m {{
           param l = {l:?};
           state q[3] = [{:?}, {:?}, {:?}];
           state v[3] = [{:?}, {:?}, {:?}];
           q' = v;
           mechanics q, v {{
             mass = diag([1, 1, {inertia:?}]);
             force = [0, -9.81, 0];
             contact lower {{
               gap = q[2] - l/2*cos(q[3]); slip = v[1] + l/2*cos(q[3])*v[3]; restitution = 0; friction = {mu:?};
             }}
             contact upper {{
               gap = q[2] + l/2*cos(q[3]); slip = v[1] - l/2*cos(q[3])*v[3]; restitution = 0; friction = {mu:?};
             }}
           }}
         }}",
        q[0], q[1], q[2], v[0], v[1], v[2]
    )
}

/// Two published rods: on one end in all roads; on both by events and impulses, and in frozen time that is told.
#[test]
fn a_rod_falls() {
    let (pi, quarter) = (std::f64::consts::PI, std::f64::consts::FRAC_PI_4);
    let first = [[0.0, 0.5 * quarter.cos() + 0.2, quarter], [2.0, 0.0, 0.0]];
    let second = [[0.0, 0.5, -pi / 6.0], [1.0, 0.0, 0.0]];
    for (model, slips, whole) in [
        (rod(1.0, 1.0 / 32.0, 0.7, first), 0.39, 0.6),
        (rod(0.5, 0.25 / 12.0, 0.7, second), 0.38, 0.8),
    ] {
        let exact = by(&model, slips, EVENTS);
        let struck = times(&exact, EventKind::Jump);
        assert_eq!(struck.len(), 1);
        roads(&model, slips, [1e-12, 1e-7, 1e-6], |found, within| {
            assert_near(&times(found, EventKind::Jump), &struck, within);
            for name in ["q", "v"] {
                assert_near(&end(found, name), &end(&exact, name), within);
            }
        });
        let exact = by(&model, whole, EVENTS);
        let flat = times(&exact, EventKind::Jump)[1];
        let found = by(&model, whole, IMPULSES);
        assert_near(&times(&found, EventKind::Jump), &[struck[0], flat], 1e-6);
        assert_near(&end(&found, "q"), &end(&exact, "q"), 1e-6);
        for road in FROZEN {
            let failure = by(&model, whole, road).failure;
            let stops = matches!(failure, Some(Failure::Standstill { time, .. }) if (time - flat).abs() <= 1e-6);
            assert!(stops, "{failure:?}");
        }
    }
}

/// Friction pulls the end of a rod into the floor where it strikes, √(2 · 0.1/g) after the start.
#[test]
fn painleves_paradox_is_told_on_every_road() {
    let angle = std::f64::consts::FRAC_PI_8;
    let start = [[0.0, 0.5 * angle.cos() + 0.1, angle], [10.0, 0.0, 0.0]];
    let model = rod(1.0, 1.0 / 32.0, 1.0, start);
    let strikes = (0.2_f64 / 9.81).sqrt();
    for road in [EVENTS, IMPULSES, FROZEN[0], FROZEN[1]] {
        let failure = by(&model, 0.2, road).failure;
        let Some(Failure::Painleve { time, name, .. }) = &failure else {
            panic!("{road} {failure:?}");
        };
        assert!((time - strikes).abs() <= 1e-9 && name == "lower", "{road}");
    }
}

/// The frozen systems, their complementarity systems, and those with impulses.
#[test]
fn printed_forms() {
    let scenes = [
        ("two_walls", CORNER.to_owned()),
        ("four_walls", room([[0.3, 0.4], [1.0, 0.7]])),
        ("cradle", cradle(0.01, 1.0)),
        ("clay", cradle(0.0, 0.0)),
        (
            "rod",
            rod(1.0, 0.03125, 0.7, [[0.0, 0.5, 0.75], [2.0, 0.0, 0.0]]),
        ),
        ("bouncing", ball(9.81, 0.9, 1.0)),
    ];
    for (name, model) in &scenes {
        let text = format!(
            "{model}
             simulate frozen of m {{ horizon 1; lower timefreezing; method fesd; }}
             simulate impulses of m {{ horizon 1; lower impact; method fesd; }}"
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
        with_experiment(&text, "impulses", |compiled| {
            let (system, settings) = (&compiled.system, &compiled.settings);
            let dcs =
                dcs::lower(system, &settings.numerics.lowerings).expect("contacts give impulses");
            dcs.verify().expect("the invariants of `Dcs`");
            insta::assert_snapshot!(format!("{name}.impulses"), dcs);
            let tex =
                dcs::tex(system, &settings.numerics.lowerings).expect("contacts give impulses");
            insta::assert_snapshot!(format!("{name}.tex"), tex);
        });
    }
    // A jump that is a contact, and one that is none.
    let jumps = "
        model m {
          param e = 0.9;
          state q = 1;
          state v = 0;
          state n = 0;
          q' = v;
          v' = -9.81;
          n' = 0;
          jump floor when q <= 0 and v < 0 { v := -e*v; }
          jump late when time >= 1 and n < 0.5 { n := 1; }
        }
        simulate this of m { horizon 1; }";
    with_experiment(jumps, "this", |compiled| {
        let tex = dcs::tex(&compiled.system, &compiled.settings.numerics.lowerings);
        insta::assert_snapshot!("jumps.tex", tex.expect("jumps are printed by their laws"));
    });
}
