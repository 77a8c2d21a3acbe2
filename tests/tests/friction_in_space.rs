//! Friction in two directions, Coulomb's cone, from event to event against closed forms.

use std::f64::consts::PI;

use nsd_tests::{assert_near, end, run, solved, times};
use nsdc::report::{EventKind, Failure, Trajectory};

/// A body on the floor z = 0 under a force, with `options` of its contact.
fn body(q: [f64; 3], v: [f64; 3], force: &str, options: &str, run: &str) -> Trajectory {
    let text = format!(
        "model body {{
           state q[3] = {q:?};
           state v[3] = {v:?};
           q' = v;
           mechanics q, v {{
             mass = 1;
             force = {force};
             contact floor {{ gap = q[3]; {options} }}
           }}
         }}
         simulate this of body {{ tolerance 1e-12; {run} }}"
    );
    solved(&text, "this")
}

#[test]
fn a_ball_falls_slides_straight_and_stays() {
    let found = body(
        [0.0, 0.0, 1.0],
        [2.0, 1.0, 0.0],
        "[0, 0, -10]",
        "restitution = 0; friction = 0.2; slip = v[1..2];",
        "horizon 2;",
    );
    // Falls for √0.2; the impulse √20 takes 0.2 √20 of √5, and 0.2·10 the rest.
    let (fall, speed) = (0.2_f64.sqrt(), 5.0_f64.sqrt());
    let slides = speed - 0.2 * 20.0_f64.sqrt();
    let way = speed * fall + slides * slides / 4.0;
    assert_near(
        &end(&found, "q"),
        &[way * 2.0 / speed, way / speed, 0.0],
        1e-12,
    );
    assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
    assert_near(
        &times(&found, EventKind::Stick),
        &[fall + slides / 2.0],
        1e-12,
    );
}

/// A block that slides across a constant pull f = 1: with k = μ g/f and τ from 1 to 0,
/// v = (½ (τᵏ⁻¹ - τᵏ⁺¹), τᵏ), and it stops at t = k/(k² - 1).
#[test]
fn a_pull_from_the_side_turns_what_slides_until_it_stops() {
    for k in [1.5, 2.0, 3.0, 10.0_f64] {
        for turned in [0.0_f64, 0.7, 2.5] {
            let (c, s) = (turned.cos(), turned.sin());
            let slip = format!("slip = [{c:?}*v[1] + {s:?}*v[2], {c:?}*v[2] - {s:?}*v[1]];");
            let found = body(
                [0.0; 3],
                [0.0, 1.0, 0.0],
                "[1, 0, -10]",
                &format!("restitution = 0; friction = {:?}; {slip}", k / 10.0),
                "horizon 2;",
            );
            let square = k * k - 1.0;
            let stop = [0.25 / square, 2.0 * k / (4.0 * k * k - 1.0), 0.0];
            assert_near(&end(&found, "q"), &stop, 1e-9);
            assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
            assert_near(&times(&found, EventKind::Stick), &[k / square], 1e-9);
        }
    }
}

/// It slides against a pull of 3 with friction 1, rests for no time at all and comes back, along lines in many directions.
#[test]
fn what_is_pulled_back_turns_round_at_rest() {
    for direction in 0..16 {
        let (s, c) = (0.4 * f64::from(direction)).sin_cos();
        let found = body(
            [0.0; 3],
            [c, s, 0.0],
            &format!("[{:?}, {:?}, -10]", -3.0 * c, -3.0 * s),
            "restitution = 0; friction = 0.1; slip = v[1..2];",
            "horizon 1;",
        );
        // It stops at 1/4, 1/8 away.
        let place = 0.125 - 0.75 * 0.75;
        assert_near(&end(&found, "q"), &[c * place, s * place, 0.0], 1e-9);
        assert_near(&end(&found, "v"), &[-1.5 * c, -1.5 * s, 0.0], 1e-9);
    }
}

#[test]
fn a_force_inside_the_cone_holds_and_one_outside_moves() {
    let rest = |friction: f64| {
        let options = format!("restitution = 0; friction = {friction:?}; slip = v[1..2];");
        body([0.0; 3], [0.0; 3], "[3, 4, -10]", &options, "horizon 2;")
    };
    assert_near(&end(&rest(0.500001), "q"), &[0.0; 3], 0.0);
    // 5 - 10 μ along the force.
    let moved = rest(0.3);
    assert_near(&end(&moved, "q"), &[2.4, 3.2, 0.0], 1e-11);
    assert_near(&end(&moved, "v"), &[2.4, 3.2, 0.0], 1e-11);
}

#[test]
fn a_force_that_grows_sets_off_what_sticks() {
    let found = body(
        [0.0; 3],
        [0.0; 3],
        "[3*time, -4*time, -10]",
        "restitution = 0; friction = 0.5; slip = v[1..2];",
        "horizon 3;",
    );
    // 5 t reaches μ g = 5 at t = 1; from there on 5 (t - 1) accelerates.
    assert_near(&times(&found, EventKind::Slip), &[1.0], 1e-12);
    let way = 5.0 / 6.0 * 8.0;
    assert_near(&end(&found, "q"), &[0.6 * way, -0.8 * way, 0.0], 1e-10);
}

/// A force of constant size that turns with ω drags a body in a circle: with w = W e^{i(ωt - δ)},
/// F cos δ = μ g and F sin δ = ω W.
#[test]
fn a_force_that_turns_drags_in_a_circle() {
    let (force, omega, mu) = (5.0_f64, 3.0, 0.3);
    let delta = (10.0 * mu / force).acos();
    let speed = force * delta.sin() / omega;
    let found = body(
        [0.0; 3],
        [speed * delta.cos(), -speed * delta.sin(), 0.0],
        "[5*cos(3*time), 5*sin(3*time), -10]",
        "restitution = 0; friction = 0.3; slip = v[1..2];",
        "horizon 10;",
    );
    let at = |t: f64| [(omega * t - delta).sin(), -(omega * t - delta).cos()];
    let [start, last] = [at(0.0), at(10.0)];
    let q = [0, 1].map(|i| speed / omega * (last[i] - start[i]));
    assert_near(&end(&found, "q"), &[q[0], q[1], 0.0], 1e-9);
    let events = [EventKind::Stick, EventKind::Slip].map(|kind| times(&found, kind));
    assert!(events[0].is_empty(), "{events:?}");
}

#[test]
fn a_ball_that_bounces_loses_speed_along_one_line() {
    let found = body(
        [0.0, 0.0, 0.8],
        [-3.0, 4.0, 0.0],
        "[0, 0, -10]",
        "restitution = 0.5; friction = 0.25; slip = v[1..2];",
        "horizon 1.5;",
    );
    // Strikes with 4, 2, 1, .. after 0.4 and then every 2·2/10, 2·1/10, ..: t = 0.4, 0.8, 1, 1.1, .. to 1.2.
    // The impulses 6, 3, 1.5, .. take 0.25 times as much of a speed of 5.
    let (mut speed, mut way, mut flight) = (5.0_f64, 0.4 * 5.0, 0.4);
    let mut impulse = 6.0;
    for _ in 0..60 {
        speed -= 0.25 * impulse;
        way += speed * flight;
        (impulse, flight) = (impulse / 2.0, flight / 2.0);
    }
    let slides = speed / 2.5;
    assert!(slides > 0.3);
    way += speed * 0.3 - 1.25 * 0.09;
    assert_near(&end(&found, "q"), &[-0.6 * way, 0.8 * way, 0.0], 1e-9);
    let left = speed - 2.5 * 0.3;
    assert_near(&end(&found, "v"), &[-0.6 * left, 0.8 * left, 0.0], 1e-9);
}

/// A billiard ball with spin (Coriolis 1835): its slip velocity keeps its direction, so that it runs along a parabola
/// until it rolls, straight on.
#[test]
fn a_billiard_ball_runs_along_a_parabola_until_it_rolls() {
    let (v, spin, mu) = ([1.0_f64, 0.5], [6.0, -4.0], 0.2);
    let text = format!(
        "model ball {{
           state q[6] = 0;
           state v[6] = [{:?}, {:?}, 0, {:?}, {:?}, 3];
           q' = v;
           mechanics q, v {{
             mass = diag([2, 2, 2, 0.8*0.09, 0.8*0.09, 0.8*0.09]);
             force = [0, 0, -20, 0, 0, 0];
             contact cloth {{
               gap = q[3];
               restitution = 0;
               friction = {mu:?};
               slip = [v[1] - 0.3*v[5], v[2] + 0.3*v[4]];
             }}
           }}
         }}
         simulate this of ball {{ tolerance 1e-12; horizon 1; }}",
        v[0], v[1], spin[0], spin[1]
    );
    let found = solved(&text, "this");
    let w = [v[0] - 0.3 * spin[1], v[1] + 0.3 * spin[0]];
    let speed = w[0].hypot(w[1]);
    // w' = -μ g (1 + 5/2) w/|w|
    let rolls = speed / (3.5 * 10.0 * mu);
    assert_near(&times(&found, EventKind::Stick), &[rolls], 1e-12);
    let along = |i: usize| {
        let brake = 10.0 * mu * w[i] / speed;
        let left = v[i] - brake * rolls;
        (
            v[i] * rolls - 0.5 * brake * rolls * rolls + left * (1.0 - rolls),
            left,
        )
    };
    let [(x, vx), (y, vy)] = [0, 1].map(along);
    assert_near(&end(&found, "q")[..3], &[x, y, 0.0], 1e-11);
    assert_near(
        &end(&found, "v"),
        &[vx, vy, 0.0, -vy / 0.3, vx / 0.3, 3.0],
        1e-11,
    );
    // Rounding turns what all but rests, and does so no longer than that lasts.
    let estimate = found.quality.error_estimate.expect("there are two runs");
    assert!(estimate <= 1e-12, "{estimate:e}");
}

/// A groove of two planes at 45°: each pushes with g/√2, and both brake along it.
#[test]
fn two_cones_hold_what_slides_in_a_groove() {
    let text = "model groove {
         state q[3] = 0;
         state v[3] = [2, 0, 0];
         const c = sqrt(0.5);
         q' = v;
         mechanics q, v {
           mass = 1;
           force = [0, 0, -10];
           contact left { gap = c*(q[2] + q[3]); restitution = 0; friction = 0.2; slip = [v[1], c*(v[3] - v[2])]; }
           contact right { gap = c*(q[3] - q[2]); restitution = 0; friction = 0.2; slip = [v[1], c*(v[3] + v[2])]; }
         }
       }
       simulate this of groove { tolerance 1e-12; horizon 2; }";
    let found = solved(text, "this");
    let brake = 0.2 * 10.0 * 2.0_f64.sqrt();
    assert_near(&times(&found, EventKind::Stick), &[2.0 / brake; 2], 1e-12);
    assert_near(&end(&found, "q"), &[2.0 / brake, 0.0, 0.0], 1e-11);
    assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
}

/// In the same groove under forces along it, c up from the start: rest is the only motion below 2√2, and what slides
/// stops. Beyond, the planes may hold it between them as a wedge, up to 2√2/√(1 - μ²), or not.
#[test]
fn a_groove_holds_what_rests_in_it() {
    let groove = |speed: f64, force: &str, horizon: f64| {
        format!(
            "model groove {{
               state q[3] = 0;
               state v[3] = [{speed:?}, 0, 0];
               const c = sqrt(0.5);
               q' = v;
               mechanics q, v {{
                 mass = 1;
                 force = [{force}, -10];
                 contact left {{ gap = c*(q[2] + q[3]); restitution = 0; friction = 0.2; slip = [v[1], c*(v[3] - v[2])]; }}
                 contact right {{ gap = c*(q[3] - q[2]); restitution = 0; friction = 0.2; slip = [v[1], c*(v[3] + v[2])]; }}
               }}
             }}
             simulate this of groove {{ tolerance 1e-12; horizon {horizon:?}; }}"
        )
    };
    for force in ["time, 0.1*sin(time)", "0, time", "0.5, 0", "1, 0.5"] {
        let found = solved(&groove(0.0, force, 2.7), "this");
        assert_near(&end(&found, "q"), &[0.0; 3], 1e-13);
        assert_near(&end(&found, "v"), &[0.0; 3], 1e-13);
        assert!(times(&found, EventKind::Slip).is_empty());
    }
    // Both planes together push with 10 √2, whatever acts across.
    let hold = 2.0 * 2.0_f64.sqrt();
    for (force, pull) in [("0.5, 0", 0.5), ("1, 0.5", 1.0), ("-2, 0.3*time", -2.0)] {
        let found = solved(&groove(2.0, force, 2.5), "this");
        let stops = 2.0 / (hold - pull);
        assert_near(&times(&found, EventKind::Stick), &[stops; 2], 1e-11);
        assert_near(&end(&found, "q"), &[stops, 0.0, 0.0], 1e-11);
        assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
    }
    let found = run(&groove(0.0, "time, 0", 5.0), "this");
    let Some(Failure::Undetermined { time, contacts, .. }) = found.failure else {
        panic!("{:?}", found.failure);
    };
    assert!(contacts && (time - hold).abs() <= 1e-6, "{time}");
}

/// Newton's law with the cone for an impulse that no axis has: a plate of three masses that differ.
#[test]
fn an_impact_obeys_the_cone_where_masses_differ() {
    for (friction, sticks) in [(0.3, false), (5.0, true)] {
        let text = format!(
            "model plate {{
               state q[3] = [0, 0, 0.0];
               state v[3] = [1, 2, -1];
               q' = v;
               mechanics q, v {{
                 mass = [1, 0.3, 0; 0.3, 4, 0; 0, 0, 2];
                 force = [0, 0, 0];
                 contact floor {{ gap = q[3]; restitution = 0.5; friction = {friction:?}; slip = v[1..2]; }}
               }}
             }}
             simulate this of plate {{ horizon 0.1; }}"
        );
        let found = solved(&text, "this");
        let v = end(&found, "v");
        assert!((v[2] - 0.5).abs() <= 1e-12);
        // M (v⁺ - v⁻) is an impulse inside the cone of Λ = 2·1.5, against v⁺.
        let change = [v[0] - 1.0, v[1] - 2.0];
        let impulse = [
            change[0] + 0.3 * change[1],
            0.3 * change[0] + 4.0 * change[1],
        ];
        if sticks {
            assert_near(&v[..2], &[0.0; 2], 1e-12);
            continue;
        }
        let size = impulse[0].hypot(impulse[1]);
        assert!((size - 3.0 * friction).abs() <= 1e-12, "{size}");
        let speed = v[0].hypot(v[1]);
        assert_near(&impulse, &[0, 1].map(|i| -size * v[i] / speed), 1e-11);
    }
}

#[test]
fn a_body_at_rest_in_all_directions_stays_for_a_turn_of_the_force() {
    let found = body(
        [0.0; 3],
        [0.0; 3],
        "[2.9*cos(time), 2.9*sin(time), -10]",
        "restitution = 0; friction = 0.3; slip = v[1..2];",
        &format!("horizon {:?};", 2.0 * PI),
    );
    assert_near(&end(&found, "q"), &[0.0; 3], 1e-13);
    assert!(times(&found, EventKind::Slip).is_empty());
}

/// One block falls onto another one on a smooth floor: both slip until their friction has joined them, and what they
/// have together stays.
#[test]
fn a_block_on_another_one_that_has_no_friction_itself() {
    let text = "model stack {
         state a[3] = 0;
         state b[3] = [0, 0, 2];
         state u[3] = [1, 4, 0];
         state v[3] = [7, 3, 0];
         a' = u;
         b' = v;
         mechanics a, u { mass = 2; force = [0, 0, -20]; }
         mechanics b, v { mass = 1; force = [0, 0, -10]; }
         contact floor { gap = a[3]; restitution = 0; friction = 0; slip = u[1..2]; }
         contact top { gap = b[3] - a[3] - 1; restitution = 0; friction = 0.1; slip = v[1..2] - u[1..2]; }
       }
       simulate this of stack { tolerance 1e-12; horizon 5; }";
    let found = solved(text, "this");
    // The impulse √20 and the force 10 of the upper one, for the reduced mass 2/3.
    let (fall, brake) = (0.2_f64.sqrt(), 1.5);
    let speed = 37.0_f64.sqrt() - brake * 0.1 * 20.0_f64.sqrt();
    assert_near(
        &times(&found, EventKind::Stick),
        &[fall + speed / brake],
        1e-11,
    );
    let together = [(2.0 + 7.0) / 3.0, (8.0 + 3.0) / 3.0, 0.0];
    assert_near(&end(&found, "u"), &together, 1e-11);
    assert_near(&end(&found, "v"), &together, 1e-11);
    assert_near(
        &[end(&found, "a")[2], end(&found, "b")[2]],
        &[0.0, 1.0],
        1e-12,
    );
}

/// A mass that joins x and z: the floor bears λ = g + c a_x, so that its friction along u is μg/(1 + cμu_x), and a body
/// that slides straight on takes that as much longer.
#[test]
fn what_a_mass_joins_to_the_floor_stops() {
    for c in [0.2, -0.4] {
        for [x, y] in [[2.0_f64, 1.0_f64], [-2.0, 0.5], [0.0, 2.0]] {
            let speed = x.hypot(y);
            let brake = 3.0 / (1.0 + 0.3 * c * x / speed);
            let found = joined(c, [x, y], 0.0, 1e-12);
            assert_near(&times(&found, EventKind::Stick), &[speed / brake], 1e-11);
            assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
            let way = speed / brake / 2.0;
            assert_near(&end(&found, "q"), &[x * way, y * way, 0.0], 1e-11);
        }
    }
}

/// The same on a belt that starts from rest with an acceleration of U along x. With w = r (cos θ, sin θ) relative to it
/// and a = cμ, r' = -μg/(1 + a cos θ) - U cos θ and r θ' = U sin θ, hence
///
/// ln(r sin θ) = const - μg/U ∫ dθ/(sin θ (1 + a cos θ)),   t = ∫ r/(U sin θ) dθ up to θ = π.
///
/// What the floor bears turns with the slip velocity until that is rounding, and the height has always been zero.
#[test]
fn what_a_mass_joins_to_the_floor_stops_on_a_belt() {
    for (c, pull) in [(0.2_f64, 0.3_f64), (-0.4, 0.3), (0.4, 1.5)] {
        stops_on_a_belt(c, pull);
    }
}

fn stops_on_a_belt(c: f64, pull: f64) {
    let (brake, a) = (3.0, 0.3 * c);
    // By π - θ, in which 1 + cos θ does not cancel.
    let inner = |left: f64| {
        let (near, far) = ((0.5 * left).sin(), (0.5 * left).cos());
        (2.0 * far * far).ln() / (2.0 * (1.0 + a)) - (2.0 * near * near).ln() / (2.0 * (1.0 - a))
            + a / (1.0 - a * a) * (-a * left.cos()).ln_1p()
    };
    let start = PI - 1.0_f64.atan2(2.0);
    let constant = (5.0_f64.sqrt() * start.sin()).ln() + brake / pull * inner(start);
    let rate = |left: f64| {
        let speed = (constant - brake / pull * inner(left)).exp() / left.sin();
        speed / (pull * left.sin())
    };
    // Gauss's rule with three nodes, for y⁴ = (π - θ)/(π - θ₀): the integrand is a power of π - θ at its end.
    let n = 2000;
    let h = 1.0 / f64::from(n);
    let nodes = [(-0.6_f64.sqrt(), 5.0), (0.0, 8.0), (0.6_f64.sqrt(), 5.0)];
    let stops: f64 = (0..n)
        .flat_map(|k| nodes.map(|(at, weight)| (h * (f64::from(k) + 0.5 + 0.5 * at), weight)))
        .map(|(y, weight)| h * weight / 18.0 * 4.0 * start * y.powi(3) * rate(start * y.powi(4)))
        .sum();
    for (tolerance, within) in [(1e-6, 1e-7), (1e-8, 1e-9), (1e-10, 1e-11), (1e-12, 1e-11)] {
        let found = joined(c, [2.0, 1.0], pull, tolerance);
        assert_near(&times(&found, EventKind::Stick), &[stops], within);
        assert_near(&end(&found, "v"), &[2.0 * pull, 0.0, 0.0], 1e-12);
    }
}

/// A body of mass one whose mass joins x and z, on a belt.
fn joined(c: f64, [x, y]: [f64; 2], pull: f64, tolerance: f64) -> Trajectory {
    let text = format!(
        "model body {{
           state q[3] = 0;
           state v[3] = [{x:?}, {y:?}, 0];
           q' = v;
           mechanics q, v {{
             mass = [1, 0, {c:?}; 0, 1, 0; {c:?}, 0, 1];
             force = [0, 0, -10];
             contact floor {{ gap = q[3]; restitution = 0; friction = 0.3; slip = [v[1] - {pull:?}*time, v[2]]; }}
           }}
         }}
         simulate this of body {{ tolerance {tolerance:?}; horizon 2; }}"
    );
    solved(&text, "this")
}

/// A force F - b t along a line: a block slips, comes to rest at an instant that steps may end at, sticks, and slips back.
#[test]
fn what_comes_to_rest_at_the_end_of_a_step_sticks() {
    for force in [1.25, 1.5, 1.75, 2.0] {
        for slope in [0.5, 1.0, 2.0] {
            for horizon in [4.0, 5.0, 8.0] {
                for line in [[1.0, 0.0], [0.6, 0.8]] {
                    let [a, b] = line.map(|c| format!("{c:?}*({force:?} - {slope:?}*time)"));
                    let text = format!(
                        "model puck {{
                           state q[3] = [0, 0, 0]; state v[3] = [0, 0, 0];
                           q' = v;
                           mechanics q, v {{
                             mass = 1; force = [{a}, {b}, -10];
                             contact ground {{ gap = q[3]; restitution = 0; friction = 0.1; slip = [v[1], v[2]]; }}
                           }}
                         }}
                         simulate s of puck {{ horizon {horizon:?}; }}"
                    );
                    let (rest, back) = (2.0 * (force - 1.0) / slope, (force + 1.0) / slope);
                    let [first, second] =
                        [rest, horizon - back].map(|t: f64| t.clamp(0.0, horizon));
                    let way = 0.5 * (force - 1.0) * first * first
                        - slope * first.powi(3) / 6.0
                        - slope * second.powi(3) / 6.0;
                    let found = end(&solved(&text, "s"), "q");
                    let within = 1e-9 * (1.0 + way.abs());
                    assert_near(&found, &[line[0] * way, line[1] * way, 0.0], within);
                }
            }
        }
    }
}
