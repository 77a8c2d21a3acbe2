//! Gaps with kinks: the smallest of several, and distances from corners.

use nsd_tests::{assert_near, end, solved, times};
use nsdc::report::EventKind;

const G: f64 = 9.81;

/// A ball in a box, by one gap.
const BOX: &str = "
    model box {
      state q[2] = [0.3, 0.4];
      state v[2] = [0.7, -0.31];
      q' = v;
      mechanics q, v {
        mass = 1;
        force = [0, 0];
        contact wall { gap = min(q[1], 1 - q[1], q[2], 1 - q[2]); restitution = 1; }
      }
    }";

/// A ball over two planes that meet at the origin, with normals at right angles.
const GROOVE: &str = "
    model groove {
      param e = 0;
      const s = sqrt(0.5);
      state q[2] = [0.3, 1];
      state v[2] = [0, 0];
      q' = v;
      mechanics q, v {
        mass = 1;
        force = [0, -9.81];
        contact wall { gap = s*(q[2] - abs(q[1])); restitution = e; }
      }
    }";

/// A disc of radius 0.3 over one step of stairs.
const STEP: &str = "
    model step {
      param r = 0.3;
      state q[2] = [-0.2, 0.3];
      state v[2] = [0.5, 0];
      q' = v;
      mechanics q, v {
        mass = 1;
        force = [0, -9.81];
        contact ground { gap = min(norm(max(q, 0)) - r, q[2] + 1 - r); restitution = 0; }
      }
    }";

/// The motion between two walls at 0 and 1.
fn triangle(start: f64, speed: f64, time: f64) -> f64 {
    let turns = (start + speed * time).rem_euclid(2.0);
    turns.min(2.0 - turns)
}

#[test]
fn one_gap_is_a_box_by_every_method() {
    let right = [triangle(0.3, 0.7, 5.0), triangle(0.4, -0.31, 5.0)];
    let struck = [0.7 / 0.7, 0.4 / 0.31, 1.7 / 0.7, 2.7 / 0.7, 1.4 / 0.31];
    let methods = [
        ("", 1e-12),
        ("lower timefreezing;", 1e-9),
        ("method fesd { steps = 40; } lower impact;", 1e-9),
        ("method fesd { steps = 40; } lower timefreezing;", 1e-9),
        ("method timestepping { steps = 4000; }", 2e-3),
    ];
    for (method, tolerance) in methods {
        let text = format!("{BOX} simulate this of box {{ horizon 5; {method} }}");
        let trajectory = solved(&text, "this");
        assert_near(&end(&trajectory, "q"), &right, tolerance);
        assert_near(
            &times(&trajectory, EventKind::Jump),
            &struck,
            2.0 * tolerance,
        );
        let surfaces = trajectory
            .history
            .events
            .iter()
            .map(|event| event.surface.as_str());
        let surfaces: Vec<&str> = surfaces.collect();
        let expected = ["wall[2]", "wall[3]", "wall[1]", "wall[2]", "wall[4]"];
        assert_eq!(surfaces, expected, "{method}");
    }
}

#[test]
fn a_ball_comes_to_rest_in_a_groove() {
    // It falls to y = 0.3 in t_1, slides with what is left along the plane, g t_1/sqrt(2), and stops in the corner.
    let first = (2.0 * 0.7 / G).sqrt();
    let (speed, slope) = (G * first * 0.5_f64.sqrt(), G * 0.5_f64.sqrt());
    let way = 0.3 * 2.0_f64.sqrt();
    let second = first + ((speed * speed + 2.0 * slope * way).sqrt() - speed) / slope;
    let methods = [
        ("", 1e-12),
        ("lower impact; method fesd { steps = 40; }", 1e-9),
        ("method timestepping { steps = 4000; }", 1e-3),
    ];
    for (method, tolerance) in methods {
        let text = format!("{GROOVE} simulate this of groove {{ horizon 2; {method} }}");
        let trajectory = solved(&text, "this");
        assert_near(&end(&trajectory, "q"), &[0.0, 0.0], tolerance);
        assert_near(&end(&trajectory, "v"), &[0.0, 0.0], tolerance);
        let jumps = times(&trajectory, EventKind::Jump);
        assert_near(&jumps, &[first, second], tolerance.max(1e-10));
        let sides = times(&trajectory, EventKind::ContactClose);
        assert_near(&sides, &[first, second], tolerance.max(1e-10));
    }
}

#[test]
fn a_ball_in_the_corner_of_a_groove_stays_or_bounces_off_both_planes() {
    let rest = format!("{GROOVE} simulate this of groove {{ with {{ q = [0, 0]; }} horizon 1; }}");
    let trajectory = solved(&rest, "this");
    assert_near(&end(&trajectory, "q"), &[0.0, 0.0], 1e-14);
    assert!(trajectory.history.events.is_empty());

    // Thrown into the corner with speed 2 it goes back with e times that, and again after 2 e 2/g, e times as long, ..
    let text = format!(
        "{GROOVE} simulate this of groove {{ with {{ e = 0.5; q = [0, 0]; v = [0, -2]; }} horizon 0.35; }}"
    );
    let trajectory = solved(&text, "this");
    let bounces = [0.0, 2.0 / G, 3.0 / G];
    let both: Vec<f64> = bounces.iter().flat_map(|&time| [time, time]).collect();
    assert_near(&times(&trajectory, EventKind::Jump), &both, 1e-10);
    let (time, speed) = (0.35 - 3.0 / G, 0.25);
    assert_near(
        &end(&trajectory, "q"),
        &[0.0, speed * time - 0.5 * G * time * time],
        1e-10,
    );
}

/// When a disc that slides over an edge with the speed u leaves it: the angle θ from upright and the time on the edge.
/// u² + 2 g r (1 - cos θ) = g r cos θ, and θ' = sqrt(u² + 2 g r (1 - cos θ))/r, by Simpson's rule.
fn over_the_edge(r: f64, u: f64) -> (f64, f64) {
    let angle = ((u * u + 2.0 * G * r) / (3.0 * G * r)).acos();
    let rate = |theta: f64| (u * u + 2.0 * G * r * (1.0 - theta.cos())).sqrt() / r;
    let n = 2000;
    let h = angle / f64::from(n);
    let weight = |k: i32| match k {
        0 => 1.0,
        k if k == n => 1.0,
        k if k % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let sum: f64 = (0..=n).map(|k| weight(k) / rate(f64::from(k) * h)).sum();
    (angle, sum * h / 3.0)
}

#[test]
fn a_disc_slides_over_an_edge_and_leaves_it() {
    let text = format!("{STEP} simulate this of step {{ horizon 1.3; tolerance 1e-11; }}");
    let trajectory = solved(&text, "this");
    let (r, u) = (0.3, 0.5);
    let (angle, on_edge) = over_the_edge(r, u);
    let leaves = 0.4 + on_edge;
    assert_near(&times(&trajectory, EventKind::ContactOpen), &[leaves], 1e-9);
    // A parabola from there, to the ground below.
    let speed = (G * r * angle.cos()).sqrt();
    let (x, y) = (r * angle.sin(), r * angle.cos());
    let (vx, vy) = (speed * angle.cos(), -speed * angle.sin());
    let height = y + 1.0 - r;
    let falls = (vy + (vy * vy + 2.0 * G * height).sqrt()) / G;
    assert_near(
        &times(&trajectory, EventKind::Jump),
        &[leaves + falls],
        1e-9,
    );
    let right = [x + vx * (1.3 - leaves), r - 1.0];
    assert_near(&end(&trajectory, "q"), &right, 1e-9);
    assert_near(&end(&trajectory, "v"), &[vx, 0.0], 1e-9);
}

#[test]
fn a_disc_strikes_the_end_of_a_beam() {
    // The beam from x = 0 to 1; the disc falls beside its end, its centre 0.18 behind it.
    let text = "
        model beam {
          param r = 0.3;
          state q[2] = [1.18, 1];
          state v[2] = [0, 0];
          q' = v;
          mechanics q, v {
            mass = 1;
            force = [0, -9.81];
            contact beam { gap = norm([q[1] - clamp(q[1], 0, 1), q[2]]) - r; restitution = 1; }
          }
        }
        simulate this of beam { horizon 0.6; tolerance 1e-11; }";
    let trajectory = solved(text, "this");
    // The normal there is (0.6, 0.8).
    let time = (2.0 * (1.0 - 0.24) / G).sqrt();
    assert_near(&times(&trajectory, EventKind::Jump), &[time], 1e-10);
    let (speed, left) = (G * time, 0.6 - time);
    let (vx, vy) = (2.0 * 0.8 * 0.6 * speed, (2.0 * 0.64 - 1.0) * speed);
    let right = [1.18 + vx * left, 0.24 + vy * left - 0.5 * G * left * left];
    assert_near(&end(&trajectory, "q"), &right, 1e-9);
}

#[test]
fn friction_of_a_feature_is_along_its_own_plane() {
    // In a groove with normals (±3, 4)/5 a ball slides down one plane with the acceleration g (3/5 - 4/5 mu).
    let text = "
        model groove {
          state q[2] = [0.8, 0.6];
          state v[2] = [0, 0];
          q' = v;
          mechanics q, v {
            mass = 2;
            force = [0, -19.62];
            contact wall { gap = 0.8*q[2] - 0.6*abs(q[1]); restitution = 0; friction = 0.25; }
          }
        }
        simulate this of groove { horizon 0.5; }
        simulate steps of groove { horizon 0.5; method timestepping { steps = 2000; } }
        simulate elements of groove { horizon 0.5; method fesd { steps = 20; } lower impact; }";
    let way = 0.5 * G * (0.6 - 0.25 * 0.8) * 0.25;
    let right = [0.8 - 0.8 * way, 0.6 - 0.6 * way];
    for (experiment, tolerance) in [("this", 1e-12), ("steps", 1e-3), ("elements", 1e-9)] {
        let trajectory = solved(text, experiment);
        assert_near(&end(&trajectory, "q"), &right, tolerance);
    }
}

#[test]
fn features_have_numbers_that_no_parameter_changes() {
    // The floor has a bend where a is not zero, w is no surface, and the wall at 1 is the fourth in any case.
    let box_of = |a: f64| {
        format!(
            "model bent {{
               param a = {a};
               param w = 1;
               state q[2] = [0.5, 0.5];
               state v[2] = [1, 0];
               q' = v;
               mechanics q, v {{
                 mass = 1;
                 force = [0, 0];
                 contact wall {{ gap = min(q[2] - a*abs(q[1]), w, 1 - q[1]); restitution = 1; }}
               }}
             }}
             simulate this of bent {{ horizon 1; expect mode at 0.2 is open(wall[4]); expect events(jump, wall[4]) ~ [0.5] within 1e-12; }}"
        )
    };
    for a in [0.0, 0.1] {
        let trajectory = solved(&box_of(a), "this");
        let surfaces = trajectory
            .history
            .events
            .iter()
            .map(|event| event.surface.as_str());
        assert_eq!(surfaces.collect::<Vec<_>>(), ["wall[4]"], "{a}");
        assert_near(&times(&trajectory, EventKind::Jump), &[0.5], 1e-12);
    }
    // Of one that is left too.
    let text = box_of(0.0).replace("q[2] - a*abs(q[1])", "2 - a*abs(q[1])");
    let trajectory = solved(&text, "this");
    let surfaces = trajectory
        .history
        .events
        .iter()
        .map(|event| event.surface.as_str());
    assert_eq!(surfaces.collect::<Vec<_>>(), ["wall[4]"]);
}

/// A disc on a long beam, or on a plane, that is pulled with 3: friction of 1 lets it go faster than 1, and friction of 5
/// slows it down to that.
#[test]
fn friction_on_a_bent_surface_may_jump() {
    for gap in [
        "norm([q[1] - clamp(q[1], -100, 100), q[2]]) - 0.3",
        "q[2] - 0.3",
    ] {
        let text = format!(
            "model disc {{
               state q[2] = [0, 0.3];
               state v[2] = [0.2, 0];
               q' = v;
               mechanics q, v {{
                 mass = 1;
                 force = [3, -10];
                 contact beam {{ gap = {gap}; restitution = 0; friction = if v[1] > 1 then 0.5 else 0.1; }}
               }}
             }}
             simulate this of disc {{ horizon 2; }}"
        );
        let trajectory = solved(&text, "this");
        assert_near(&times(&trajectory, EventKind::EnterSliding), &[0.4], 1e-10);
        assert_near(&end(&trajectory, "q"), &[0.24 + 1.6, 0.3], 1e-10);
        assert_near(&end(&trajectory, "v"), &[1.0, 0.0], 1e-10);
    }
}

/// Friction ends at the edge, where the gap bends: the same surface does both, and is crossed.
#[test]
fn friction_may_jump_where_a_gap_bends() {
    let text = "
        model step {
          state q[2] = [-0.2, 0.3];
          state v[2] = [0.5, 0];
          q' = v;
          mechanics q, v {
            mass = 1;
            force = [0, -9.81];
            contact ground { gap = norm(max(q, 0)) - 0.3; restitution = 0; friction = if q[1] > 0 then 0 else 0.05; }
          }
        }
        simulate this of step { horizon 1.3; tolerance 1e-11; }";
    let trajectory = solved(text, "this");
    let u = (0.25 - 2.0 * 0.05 * G * 0.2_f64).sqrt();
    let edge = (0.5 - u) / (0.05 * G);
    let crossed = trajectory.history.events.iter().map(|event| event.time);
    assert!(
        crossed.clone().any(|time| (time - edge).abs() < 1e-9),
        "{edge}"
    );
    let leaves = edge + over_the_edge(0.3, u).1;
    assert_near(&times(&trajectory, EventKind::ContactOpen), &[leaves], 1e-8);
}
