//! Contacts in steps of time against closed forms, and what must hold of piles.

use nsd_tests::{end, larger, run, times};
use nsdc::report::{EventKind, Failure, Status, Trajectory};

/// A ball of mass 2 above a floor.
fn ball(e: f64, height: f64, horizon: f64, steps: usize) -> Trajectory {
    let text = format!(
        "model ball {{
           state q = {height:?};
           state v = 0;
           q' = v;
           mechanics q, v {{ mass = 2; force = -2*9.81; contact floor {{ gap = q; restitution = {e:?}; }} }}
           output energy = v^2 + 2*9.81*q;
         }}
         simulate this of ball {{ horizon {horizon:?}; method timestepping {{ steps = {steps}; }} }}"
    );
    solved(&text)
}

fn solved(text: &str) -> Trajectory {
    let trajectory = run(text, "this");
    assert_eq!(
        trajectory.status,
        Status::Solved,
        "{:?}",
        trajectory.failure
    );
    assert_eq!(trajectory.verify(), Ok(()));
    trajectory
}

/// No value of an output is above the one before by more than a share of the first.
fn never_grows(trajectory: &Trajectory, share: f64) {
    let energy = trajectory
        .samples
        .outputs
        .iter()
        .find(|o| o.name == "energy");
    let values = &energy.expect("the model has an energy").values;
    for pair in values.windows(2) {
        assert!(
            pair[1] <= pair[0] + share * values[0],
            "{pair:?} of {}",
            values[0]
        );
    }
}

#[test]
fn a_ball_bounces_with_order_one() {
    let (g, e, horizon) = (9.81_f64, 0.9, 3.0);
    let (mut bounce, mut speed) = ((2.0 / g).sqrt(), e * (2.0 * g).sqrt());
    let mut bounces = vec![bounce];
    while bounce + 2.0 * speed / g < horizon {
        (bounce, speed) = (bounce + 2.0 * speed / g, e * speed);
        bounces.push(bounce);
    }
    let s = horizon - bounce;
    let exact = speed * s - 0.5 * g * s * s;
    // Whether a step ends just before or just behind a bounce is chance, so that errors of many grids are compared.
    let error = |coarse: usize| {
        let grids = (0..9).map(|k| coarse + coarse * k / 9);
        let errors = grids.map(|steps| (end(&ball(e, 1.0, horizon, steps), "q")[0] - exact).abs());
        errors.fold(0.0, larger)
    };
    let order = (error(300) / error(4800)).log(16.0);
    assert!((0.8..1.2).contains(&order), "order {order}");
    let fine = ball(e, 1.0, horizon, 30_000);
    never_grows(&fine, 1e-12);
    let found = times(&fine, EventKind::Jump);
    assert_eq!(found.len(), bounces.len());
    for (found, exact) in found.iter().zip(&bounces) {
        assert!((found - exact).abs() <= 1e-3, "{found}, not {exact}");
    }
}

#[test]
fn the_estimate_of_a_bouncing_ball_is_that_of_its_error() {
    // An elastic ball: each flight takes 2 s/g, and the first one ends at the root of 1.5 - t - g t²/2.
    let g = 9.81_f64;
    let speed = (1.0 + 3.0 * g).sqrt();
    let first = (speed - 1.0) / g;
    let exact = |t: f64| {
        let s = (t - first).rem_euclid(2.0 * speed / g);
        [speed * s - 0.5 * g * s * s, speed - g * s]
    };
    for (k, rows) in [
        (1, ""),
        (2, ""),
        (8, ""),
        (25, ""),
        (32, ""),
        (8, "output every 0.0013;"),
    ] {
        let steps = 200 * k;
        let trajectory = solved(&format!(
            "model ball {{
               state q = 1.5; state v = -1; q' = v;
               mechanics q, v {{ mass = 1; force = -9.81; contact floor {{ gap = q; restitution = 1; }} }}
             }}
             simulate this of ball {{
               horizon 2; method timestepping {{ steps = {steps}; }} {rows}
             }}"
        ));
        assert!(trajectory.warnings.is_empty(), "{:?}", trajectory.warnings);
        let estimate = trajectory.quality.error_estimate.unwrap_or(f64::NAN);
        let at_end = exact(2.0);
        let errors = [
            (end(&trajectory, "q")[0] - at_end[0]).abs() / 1.5,
            (end(&trajectory, "v")[0] - at_end[1]).abs() / speed,
        ];
        let error = larger(errors[0], errors[1]);
        assert!(
            error <= 2.0 * estimate,
            "{steps} steps: {error} and {estimate}"
        );
        assert!(estimate <= 30.0 / steps as f64, "{steps} steps: {estimate}");
    }
}

#[test]
fn bounces_that_accumulate_end_in_a_closed_contact() {
    let trajectory = ball(0.5, 0.5, 3.0, 6000);
    never_grows(&trajectory, 1e-12);
    // Zeno: the fall, and a geometric series of flights.
    let limit = 3.0 * (1.0_f64 / 9.81).sqrt();
    let closed = times(&trajectory, EventKind::ContactClose);
    assert_eq!(closed.len(), 1);
    assert!((closed[0] - limit).abs() <= 0.01, "{closed:?}, not {limit}");
    let (q, v) = (end(&trajectory, "q")[0], end(&trajectory, "v")[0]);
    assert!(q.abs() <= 1e-12 && v.abs() <= 1e-12, "{q}, {v}");
    let last = trajectory.history.modes.last().expect("a run has a mode");
    assert_eq!(last.mode, "closed(floor)");
}

/// A block on a slope of angle θ, which moves along and across it.
fn block(mu: f64, v: f64, steps: usize) -> Trajectory {
    solved(&format!(
        "model block {{
           param theta = 0.4;
           state q[2] = [0, 0];
           state v[2] = [{v:?}, 0];
           q' = v;
           mechanics q, v {{
             mass = eye(2);
             force = 9.81*[sin(theta), -cos(theta)];
             contact slope {{ gap = q[2]; restitution = 0; friction = {mu:?}; }}
           }}
         }}
         simulate this of block {{ horizon 1; method timestepping {{ steps = {steps}; }} }}"
    ))
}

#[test]
fn a_block_on_a_slope_sticks_and_slips() {
    let (sin, cos) = 0.4_f64.sin_cos();
    // tan 0.4 = 0.42: it stays.
    let stays = block(0.5, 0.0, 200);
    assert_eq!(end(&stays, "q"), [0.0, 0.0]);
    assert_eq!(
        stays.history.modes.last().map(|m| m.mode.as_str()),
        Some("stick(slope)")
    );
    // It slides, which the midpoint rule has exactly.
    let slides = block(0.3, 0.0, 200);
    let q = end(&slides, "q");
    assert!(
        (q[0] - 0.5 * 9.81 * (sin - 0.3 * cos)).abs() <= 1e-10,
        "{q:?}"
    );
    assert!(q[1].abs() <= 1e-10);
    assert_eq!(
        slides.history.modes.last().map(|m| m.mode.as_str()),
        Some("slip(slope)")
    );
    // Uphill, until friction has stopped it for good.
    let brake = 9.81 * (0.5 * cos - sin);
    let stops = block(0.5, 0.3, 4000);
    let q = end(&stops, "q");
    assert!((q[0] - 0.09 / (2.0 * brake)).abs() <= 1e-4, "{q:?}");
    let stick = times(&stops, EventKind::Stick);
    assert_eq!(stick.len(), 1);
    assert!((stick[0] - 0.3 / brake).abs() <= 1e-3, "{stick:?}");
}

#[test]
fn touching_balls_strike_as_one() {
    // Newton's law of all contacts at once: the balls that are struck go on with two thirds each.
    let trajectory = solved(
        "model cradle {
           state q[3] = [1, 2, 3];
           state v[3] = [1, 0, 0];
           q' = v;
           mechanics q, v { mass = eye(3); force = zeros(3); }
           for i in 1..2 { contact touch { gap = q[i+1] - q[i] - 1; restitution = 1; } }
         }
         simulate this of cradle { horizon 1; method timestepping { steps = 10; } }",
    );
    let v = end(&trajectory, "v");
    let expected = [-1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
    for (v, exact) in v.iter().zip(expected) {
        assert!((v - exact).abs() <= 1e-12, "{v}, not {exact}");
    }
}

#[test]
fn an_impulse_moves_what_the_mass_couples() {
    // Nothing pushes along the floor, so that 2 v₁ + v₂/2 stays as it is through every bounce.
    let trajectory = solved(
        "model oblique {
           state q[2] = [0, 0.5];
           state v[2] = [1, 0];
           q' = v;
           mechanics q, v {
             mass = [2, 0.5; 0.5, 1];
             force = [0, -9.81];
             contact floor { gap = q[2]; restitution = 0.8; }
           }
         }
         simulate this of oblique { horizon 1; method timestepping { steps = 500; } }",
    );
    assert!(!times(&trajectory, EventKind::Jump).is_empty());
    let v = end(&trajectory, "v");
    let momentum = 2.0 * v[0] + 0.5 * v[1];
    assert!((momentum - 2.0).abs() <= 1e-12, "{momentum}");
}

#[test]
fn a_long_row_of_discs_is_struck_as_one() {
    // Twelve discs that touch go on with a twelfth of the speed of the first: no contact of the row may be overlooked.
    let trajectory = solved(
        "model disc {
           state q[2];
           state v[2];
           q' = v;
           mechanics q, v { mass = eye(2); force = [0, 0]; }
         }
         model row {
           const n = 12;
           part ball[i in 1..n] = disc { q = [0.2*i, 0]; v = [max(0, 2 - i), 0]; }
           for i in 1..n, j in i+1..n {
             contact pair { gap = norm(ball[i].q - ball[j].q) - 0.2; restitution = 0; }
           }
         }
         simulate this of row { horizon 1; method timestepping { steps = 100; } }",
    );
    for i in 1..=12 {
        let v = end(&trajectory, &format!("ball[{i}].v"));
        assert!((v[0] - 1.0 / 12.0).abs() <= 1e-12, "{i}: {}", v[0]);
    }
}

#[test]
fn bodies_at_the_edges_of_their_boxes_are_not_overlooked() {
    // Two rows of carts on one line, far from each other but for the last of the one, which strikes the first of the
    // other.
    let trajectory = solved(
        "model cart { state q; state v = 0; q' = v; mechanics q, v { mass = 1; force = 0; } }
         model rows {
           part left[i in 1..4] = cart { q = 100*(i - 4); v = max(0, i - 3); }
           part right[i in 1..4] = cart { q = 0.5 + 100*(i - 1); }
           for i in 1..4, j in 1..4 {
             contact pair { gap = right[j].q - left[i].q; restitution = 1; }
           }
         }
         simulate this of rows { horizon 1; method timestepping { steps = 100; } }",
    );
    assert_eq!(end(&trajectory, "left[4].v"), [0.0]);
    assert_eq!(end(&trajectory, "right[1].v"), [1.0]);
}

/// Discs in a bin.
fn pile(n: usize, width: f64, e: f64, friction: &str, horizon: f64, steps: usize) -> Trajectory {
    solved(&format!(
        "model disc {{
           param r = 0.1;
           state q[2];
           state v[2] = [0, 0];
           q' = v;
           mechanics q, v {{ mass = eye(2); force = [0, -9.81]; }}
           output energy = dot(v, v)/2 + 9.81*q[2];
         }}
         model bin {{
           const n = {n};
           param width = {width:?};
           part ball[i in 1..n] = disc {{ q = [width/2 + 0.05*sin(7*i), 0.25*i]; }}
           for i in 1..n {{
             contact floor {{ gap = ball[i].q[2] - ball[i].r; restitution = {e:?}; {friction} }}
             contact left {{ gap = ball[i].q[1] - ball[i].r; restitution = {e:?}; {friction} }}
             contact right {{ gap = width - ball[i].q[1] - ball[i].r; restitution = {e:?}; {friction} }}
           }}
           for i in 1..n, j in i+1..n {{
             contact pair {{ gap = norm(ball[i].q - ball[j].q) - ball[i].r - ball[j].r; restitution = {e:?}; {friction} }}
           }}
           output energy = sum(ball[i].energy for i in 1..n);
           output clearance = min(norm(ball[i].q - ball[j].q) - ball[i].r - ball[j].r for i in 1..n, j in i+1..n);
         }}
         simulate this of bin {{ horizon {horizon:?}; method timestepping {{ steps = {steps}; }} }}"
    ))
}

/// The largest speed at the end.
fn speed(trajectory: &Trajectory, n: usize) -> f64 {
    let speed = |i: usize| {
        let v = end(trajectory, &format!("ball[{i}].v"));
        v[0].hypot(v[1])
    };
    (1..=n).map(speed).fold(0.0, f64::max)
}

#[test]
fn piles_come_to_rest_without_depth_and_without_energy() {
    for (width, e, friction) in [
        (0.7, 0.0, ""),
        (0.7, 0.3, ""),
        (0.7, 0.0, "friction = 0.3;"),
    ] {
        let n = 6;
        let trajectory = pile(n, width, e, friction, 3.0, 3000);
        never_grows(&trajectory, 1e-9);
        let clearance = trajectory
            .samples
            .outputs
            .iter()
            .find(|o| o.name == "clearance");
        let least = clearance.map(|o| o.values.iter().copied().fold(f64::INFINITY, f64::min));
        assert!(least >= Some(-1e-9), "{least:?}");
        assert!(trajectory.quality.certificate.max_violation <= 1e-9);
        assert!(trajectory.quality.stats.complementarity_residual <= 1e-9);
        // Without friction a disc may slide along the floor for ever, slowly: they have fallen with some 5 m/s.
        let most = if friction.is_empty() { 0.1 } else { 1e-6 };
        let speed = speed(&trajectory, n);
        assert!(speed <= most, "{speed}");
    }
}

/// Discs that lie between two others push both of them in the same step: one after the other they would sink, and never
/// stop.
#[test]
fn discs_that_fill_their_bin_come_to_rest() {
    let trajectory = solved(
        "model disc { state q[2]; state v[2] = [0, 0]; q' = v; mechanics q, v { mass = eye(2); force = [0, -9.81]; } }
         model bin {
           const n = 9;
           const width = 0.74;
           const x = [0.14, 0.3766, 0.6099, 0.1484, 0.3727, 0.5957, 0.1308, 0.3605, 0.5948];
           const y = [0.13, 0.13, 0.13, 0.36, 0.36, 0.36, 0.59, 0.59, 0.59];
           part ball[i in 1..n] = disc { q = [x[i], y[i]]; }
           for i in 1..n {
             contact floor { gap = ball[i].q[2] - 0.1; restitution = 0.3; }
             contact left { gap = ball[i].q[1] - 0.1; restitution = 0.3; }
             contact right { gap = width - ball[i].q[1] - 0.1; restitution = 0.3; }
           }
           for i in 1..n, j in i+1..n {
             contact pair { gap = norm(ball[i].q - ball[j].q) - 0.2; restitution = 0.3; }
           }
         }
         simulate this of bin { horizon 4; method timestepping { steps = 2000; } }",
    );
    let speed = speed(&trajectory, 9);
    assert!(speed <= 1e-9, "{speed}");
}

/// What rests keeps its energy: bodies that stand still do not move, however many steps go by.
#[test]
fn a_pile_at_rest_keeps_its_energy() {
    let n = 30;
    let numbers = |f: &dyn Fn(usize) -> f64| -> Vec<f64> { (0..n).map(f).collect() };
    let x = numbers(&|i| 0.14 + 0.23 * (i % 6) as f64 + 0.01 * (7.0 * i as f64).sin());
    let y = numbers(&|i| 0.13 + 0.23 * (i / 6) as f64);
    let trajectory = solved(&format!(
        "model disc {{
           state q[2]; state v[2] = [0, 0]; q' = v;
           mechanics q, v {{ mass = eye(2); force = [0, -9.81]; }}
           output energy = dot(v, v)/2 + 9.81*q[2];
         }}
         model bin {{
           const n = {n};
           const x = {x:?};
           const y = {y:?};
           part ball[i in 1..n] = disc {{ q = [x[i], y[i]]; }}
           for i in 1..n {{
             contact floor {{ gap = ball[i].q[2] - 0.1; restitution = 0.3; }}
             contact left {{ gap = ball[i].q[1] - 0.1; restitution = 0.3; }}
             contact right {{ gap = 1.43 - ball[i].q[1] - 0.1; restitution = 0.3; }}
           }}
           for i in 1..n, j in i+1..n {{
             contact pair {{ gap = norm(ball[i].q - ball[j].q) - 0.2; restitution = 0.3; }}
           }}
           output energy = sum(ball[i].energy for i in 1..n);
           output speed = max(norm(ball[i].v) for i in 1..n);
         }}
         simulate this of bin {{ horizon 2.2; method timestepping {{ steps = 1100; }} output energy, speed; }}"
    ));
    never_grows(&trajectory, 1e-9);
    let values = |name: &str| {
        let output = trajectory.samples.outputs.iter().find(|o| o.name == name);
        &output.expect("the model has it").values
    };
    let (energy, speed) = (values("energy"), values("speed"));
    let rest = speed.iter().rposition(|speed| *speed > 0.0);
    let rest = rest.map_or(0, |last| last + 1);
    assert!(rest < 1050, "at rest from step {rest} on");
    let mut least = energy[rest];
    for later in &energy[rest..] {
        assert!(later - least <= 1e-9 * energy[0], "{later} after {least}");
        least = least.min(*later);
    }
}

/// A body that has stood still on a rough floor moves when it is struck, as Coulomb's law says.
#[test]
fn what_stands_still_is_struck() {
    let trajectory = solved(
        "model blocks {
           state a[2] = [1, 0]; state b[2] = [0, 0.5]; state u[2] = [0, 0]; state v[2] = [1, 0];
           a' = u; b' = v;
           mechanics a, u { mass = eye(2); force = [0, -9.81]; contact floor { gap = a[2]; restitution = 0; friction = 0.1; } }
           mechanics b, v { mass = eye(2); force = [0, 0]; contact bump { gap = a[1] - b[1] - 0.5; restitution = 1; } }
         }
         simulate this of blocks { horizon 3; method timestepping { steps = 3000; } }",
    );
    let (a, u) = (end(&trajectory, "a"), end(&trajectory, "u"));
    // It takes over 1 m/s at t = 0.5, and friction stops it within v²/(2μg).
    assert!((a[0] - 1.0 - 1.0 / (0.2 * 9.81)).abs() <= 3e-3, "{a:?}");
    assert_eq!((u, a[1]), (vec![0.0, 0.0], 0.0));
}

/// Forces that change after half a second set in motion what has stood still.
#[test]
fn what_stands_still_is_pushed() {
    let pushed = solved(
        "model block {
           state q[2] = [0, 0]; state v[2] = [0, 0];
           q' = v;
           mechanics q, v {
             mass = eye(2);
             force = [40*max(time - 0.5, 0), -9.81];
             contact floor { gap = q[2]; restitution = 0; friction = 0.5; }
           }
         }
         simulate this of block { horizon 1; method timestepping { steps = 2000; } }",
    );
    // It slips once 40 (t - 0.5) = μg.
    let s = 0.5_f64 - 0.5 * 9.81 / 40.0;
    let q = end(&pushed, "q");
    assert!((q[0] - 20.0 / 3.0 * s.powi(3)).abs() <= 2e-3, "{q:?}");
    assert_eq!(q[1], 0.0);
    // One block is held up against a stop, and carries another, until the force is less than the weight of both.
    let carried = solved(
        "model blocks {
           state a = 0; state b = 1; state u = 0; state v = 0;
           a' = u; b' = v;
           mechanics a, u { mass = 1; force = 60 - 100*max(time - 0.5, 0) - 9.81; contact stop { gap = -a; restitution = 0; } }
           mechanics b, v { mass = 1; force = -9.81; contact load { gap = b - a - 1; restitution = 0; } }
         }
         simulate this of blocks { horizon 1.05; method timestepping { steps = 2100; } }",
    );
    let s = 0.55 - (60.0 - 2.0 * 9.81) / 100.0;
    let fall = 50.0 / 6.0 * s * s * s;
    let (a, b) = (end(&carried, "a")[0], end(&carried, "b")[0]);
    assert!(
        (a + fall).abs() <= 1e-3 && (b - 1.0 + fall).abs() <= 1e-3,
        "{a}, {b}"
    );
}

/// A floor that time moves carries what stands on it.
#[test]
fn what_stands_on_a_moving_floor_moves() {
    let trajectory = solved(
        "model ball {
           state q = 0; state v = 0;
           q' = v;
           mechanics q, v { mass = 1; force = -9.81; contact floor { gap = q - 0.1*(1 - cos(2*pi*time)); restitution = 0; } }
         }
         simulate this of ball { horizon 0.5; method timestepping { steps = 500; } }",
    );
    let q = end(&trajectory, "q")[0];
    assert!((q - 0.2).abs() <= 1e-3, "{q}");
}

/// A coefficient that leaves its range in the run ends it.
#[test]
fn coefficients_keep_their_range() {
    for (law, what) in [
        (
            "restitution = 0.9 + v[2]/4;",
            "the restitution of `floor` is -",
        ),
        (
            "restitution = 0; friction = 0.1 - time;",
            "the friction of `floor` is -",
        ),
    ] {
        // Time that stands still takes restitutions that are numbers.
        let frozen = law.contains("friction").then_some("lower timefreezing;");
        let methods = [
            "",
            "method timestepping { steps = 1000; }",
            "lower impact; method fesd { steps = 20; }",
        ];
        for method in methods.into_iter().chain(frozen) {
            let trajectory = run(
                &format!(
                    "model ball {{
                       state q[2] = [0, 1];
                       state v[2] = [1, 0];
                       q' = v;
                       mechanics q, v {{ mass = eye(2); force = [0, -9.81]; contact floor {{ gap = q[2]; {law} }} }}
                     }}
                     simulate this of ball {{ horizon 1; {method} }}"
                ),
                "this",
            );
            let failure = trajectory.failure.expect("it ends");
            assert!(failure.to_string().contains(what), "{failure}");
        }
    }
}

#[test]
fn bodies_far_apart_cost_no_gaps() {
    let text = |apart: f64| {
        format!(
            "model field {{
               const n = 12;
               state q[n] = [{apart:?}*i for i in 1..n];
               state v[n] = zeros(n);
               q' = v;
               mechanics q, v {{ mass = eye(n); force = -q; }}
               for i in 1..n, j in i+1..n {{ contact pair {{ gap = q[j] - q[i] - 0.1; restitution = 0; }} }}
             }}
             simulate this of field {{ horizon 0.1; method timestepping {{ steps = 100; }} }}"
        )
    };
    let gaps = |apart: f64| {
        let trajectory = solved(&text(apart));
        let options = trajectory.setup.method.options.iter();
        let mut gaps = options
            .filter(|option| option.0 == "gaps")
            .map(|option| &option.1);
        match gaps.next_back() {
            Some(nsdc::report::MethodOption::Number(gaps)) => *gaps,
            _ => panic!("no number of gaps"),
        }
    };
    // 66 contacts of one body, twice looked at in each of 100 steps, would be 13200.
    assert!(gaps(10.0) <= 3000.0, "{}", gaps(10.0));
}

/// A ball that comes down on a floor at this height, at a speed that a step shows however far away zero is.
fn far(floor: f64, force: f64) -> Trajectory {
    solved(&format!(
        "model far {{
           param floor = {floor:?};
           state q = {floor:?} + 8;
           state v = -4;
           q' = v;
           mechanics q, v {{ mass = 1; force = {force:?}; contact ground {{ gap = q - floor; restitution = 0.5; }} }}
         }}
         simulate this of far {{ horizon 8; method timestepping {{ steps = 16; }} }}"
    ))
}

/// Where a ball is above its floor at the end, its velocity there, and its events.
fn flight(floor: f64, force: f64) -> (f64, f64, Vec<(EventKind, f64)>) {
    let run = far(floor, force);
    let events = run
        .history
        .events
        .iter()
        .map(|event| (event.kind, event.time));
    (
        end(&run, "q")[0] - floor,
        end(&run, "v")[0],
        events.collect(),
    )
}

#[test]
fn balls_bounce_far_from_zero_as_they_do_near_it() {
    use EventKind::{ContactClose, Jump};
    // Steps of 1/2 move these balls by multiples of 1/2, which 1e15 has no rounding of. The one meets the floor at the
    // end of its fourth step. The other is 2 above it and 5/2 below it at the ends of its third, and at rest from t = 7/2
    // on, with a rebound that does not outlast a step.
    let uniform = (12.0, 2.0, vec![(Jump, 2.0)]);
    let strikes = 1.0 + 0.5 * (2.0 / 4.5);
    let falling = (0.0, 0.0, vec![(Jump, strikes), (ContactClose, 3.5)]);
    for floor in [0.0, 1e3, 1e6, 1e9, 1.7e12, 1e15, -1e15] {
        assert_eq!(flight(floor, 0.0), uniform, "at {floor}");
        assert_eq!(flight(floor, -4.0), falling, "at {floor}");
    }
    // Steps of 1/2 move the third by multiples of 1/16: numbers near 1e15 are 1/8 apart, so that each of 16 steps may be
    // 1/16 off.
    let rising = (5.25, -0.625, vec![(Jump, 1.5 + 0.5 * (1.4375 / 2.4375))]);
    for floor in [0.0, 1e3, 1e6, 1e9, 1.7e12] {
        assert_eq!(flight(floor, -0.5), rising, "at {floor}");
    }
    for floor in [1e15, -1e15] {
        let (height, velocity, events) = flight(floor, -0.5);
        assert!((height - rising.0).abs() <= 1.0, "{height} at {floor}");
        assert_eq!(velocity, rising.1, "at {floor}");
        assert_eq!(events.len(), 1, "{events:?} at {floor}");
    }
}

/// Two bodies, the first of them on its floor at 1e15, the second at this place above its own.
fn beside_a_far_body(floor: f64, place: f64) -> Trajectory {
    run(
        &format!(
            "model two {{
               param f[2] = [1e15, {floor:?}];
               state q[2] = [1e15, {place:?}];
               state v[2] = [0, 0];
               q' = v;
               mechanics q, v {{
                 mass = eye(2);
                 force = [-1, -1];
                 contact first {{ gap = q[1] - f[1]; restitution = 0; }}
                 contact second {{ gap = q[2] - f[2]; restitution = 0; }}
               }}
             }}
             simulate this of two {{ horizon 0.8; method timestepping {{ steps = 80; }} }}"
        ),
        "this",
    )
}

/// A gap has the rounding of the positions that it balances, and not that of another contact of the same form.
#[test]
fn bodies_fall_beside_bodies_far_away() {
    let falls = beside_a_far_body(0.25, 0.75);
    assert_eq!(falls.status, Status::Solved, "{:?}", falls.failure);
    let q = end(&falls, "q");
    assert_eq!(q[0], 1e15);
    assert!((q[1] - 0.43).abs() <= 1e-12, "{q:?}");
    let below = beside_a_far_body(1e9, 1e9 - 0.1).failure;
    assert!(
        matches!(below, Some(Failure::Penetrates { .. })),
        "{below:?}"
    );
}

/// Where a body may start does not depend on how long steps are: nine digits of its place are enough as long as what
/// they leave open does not show in the run.
#[test]
fn starts_are_refused_whatever_steps_are() {
    let body = |floor: f64, depth: f64, horizon: f64, steps: usize| {
        run(
            &format!(
                "model body {{
                   state q = {floor:?} - {depth:?};
                   state v = 0;
                   q' = v;
                   mechanics q, v {{ mass = 1; force = -1; contact ground {{ gap = q - {floor:?}; restitution = 0; }} }}
                 }}
                 simulate this of body {{ horizon {horizon:?}; method timestepping {{ steps = {steps}; }} }}"
            ),
            "this",
        )
    };
    for steps in [1, 10, 1000, 10_000] {
        for (floor, depth, horizon) in [(1.0, 1e-10, 1.0), (1.0, 1e-10, 0.01), (1e6, 1e-4, 1.0)] {
            let rests = body(floor, depth, horizon, steps);
            let case = format!("{floor} - {depth}, {steps} steps to {horizon}");
            assert_eq!(rests.status, Status::Solved, "{case}");
            let q = end(&rests, "q")[0];
            assert!((q - floor).abs() <= 1.01 * depth, "{q}: {case}");
        }
        let below = body(1e6, 1e-4, 0.01, steps).failure;
        assert!(
            matches!(below, Some(Failure::Penetrates { .. })),
            "{below:?} in {steps} steps"
        );
    }
}

/// What 1e15 and 1 balance is known to four roundings, 0.9; what 3 and 1 balance is, whatever is far away beside them.
#[test]
fn gaps_that_rounding_tells_apart_are_told_apart() {
    let body = |height: &str, place: &str, floor: &str, weight: f64| {
        format!(
            "model body {{
               state q[2] = [{place}, {height}];
               state v[2] = [1, 0];
               q' = v;
               mechanics q, v {{
                 mass = eye(2);
                 force = [0, -{weight:?}];
                 contact ground {{ gap = q[2] - {floor}; restitution = 0; friction = 0.5; }}
               }}
             }}
             simulate this of body {{ horizon 1; method timestepping {{ steps = 8; }} }}"
        )
    };
    for (height, place, floor) in [
        ("1e15 + 1", "0", "1e15"),
        ("1e15 + 1", "1e15", "1e15"),
        ("4", "1e15", "3"),
        ("-1e15 + 1", "0", "(-1e15)"),
    ] {
        let run = solved(&body(height, place, floor, 0.0));
        assert_eq!(end(&run, "v"), [1.0, 0.0], "{height} above {floor}");
        assert!(run.history.events.is_empty(), "{height} above {floor}");
    }
    let starts_below = run(&body("1e15 - 2", "0", "1e15", 0.0), "this").failure;
    assert!(
        matches!(starts_below, Some(Failure::Penetrates { .. })),
        "{starts_below:?}"
    );
    // What rests far away is slowed by friction.
    let rests = solved(&body("1e15", "1e15", "1e15", 1.0));
    assert_eq!(end(&rests, "q")[1], 1e15);
    assert!(end(&rests, "v")[0] < 0.6);
}
