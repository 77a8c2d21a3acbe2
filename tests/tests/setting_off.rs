//! What breaks loose in two directions, or turns until it rests, against closed forms and integrations of its own.

use std::f64::consts::PI;

use nsd_tests::random::Random;
use nsd_tests::{assert_near, end, solved, times};
use nsdc::report::{EventKind, Trajectory};

/// A block of mass one on the floor z = 0, at rest in the origin or with a speed, pressed down by 10.
fn block(v: [f64; 2], force: &str, friction: f64, horizon: f64) -> Trajectory {
    let [v1, v2] = v;
    let text = format!(
        "model block {{
           state q[3] = [0, 0, 0];
           state v[3] = [{v1:?}, {v2:?}, 0];
           q' = v;
           mechanics q, v {{
             mass = 1;
             force = [{force}, -10];
             contact floor {{ gap = q[3]; restitution = 0; friction = {friction:?}; slip = v[1..2]; }}
           }}
         }}
         simulate this of block {{ tolerance 1e-12; horizon {horizon:?}; }}"
    );
    solved(&text, "this")
}

/// What slides with speed u against friction: u' = rate(t, p, u) with |u| in its denominators, by the classical method
/// of order 4 in steps that are a share of |u|, in which its direction adapts. Ends at `to`, or at rest.
fn slides(
    mut t: f64,
    to: f64,
    mut y: [f64; 4],
    rate: impl Fn(f64, [f64; 4]) -> [f64; 2],
) -> (f64, [f64; 4]) {
    let field = |t: f64, y: [f64; 4]| {
        let [a, b] = rate(t, y);
        [y[2], y[3], a, b]
    };
    let along = |y: [f64; 4], k: [f64; 4], h: f64| [0, 1, 2, 3].map(|i| y[i] + h * k[i]);
    while t < to && y[2].hypot(y[3]) > 1e-13 {
        let h = (0.05 * y[2].hypot(y[3])).min(2e-4).min(to - t);
        let k1 = field(t, y);
        let k2 = field(t + 0.5 * h, along(y, k1, 0.5 * h));
        let k3 = field(t + 0.5 * h, along(y, k2, 0.5 * h));
        let k4 = field(t + h, along(y, k3, h));
        y = [0, 1, 2, 3].map(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        t = if h == to - t { to } else { t + h };
    }
    (t, y)
}

/// What slides `after` a force b(t) has left its cone of this radius: u = ½ k τ² b/|b| with k = |b|', which is right up
/// to τ³.
fn sets_off(after: f64, b: impl Fn(f64) -> [f64; 2], at: f64) -> [f64; 2] {
    let size = |t: f64| b(t)[0].hypot(b(t)[1]);
    let d = 1e-5;
    let k = (size(at + d) - size(at - d)) / (2.0 * d);
    b(at).map(|b| 0.5 * k * after * after * b / size(at))
}

/// Where a body of mass 1 is at an instant, and how fast, that a force b has pulled off a floor which takes 2 of it.
fn slides_off(leaves: f64, to: f64, b: impl Fn(f64) -> [f64; 2]) -> [f64; 4] {
    let after = 1e-4;
    let [u1, u2] = sets_off(after, &b, leaves);
    let third = after / 3.0;
    let start = [third * u1, third * u2, u1, u2];
    let (_, y) = slides(leaves + after, to, start, |t, y| {
        let speed = y[2].hypot(y[3]);
        [0, 1].map(|i| b(t)[i] - 2.0 * y[2 + i] / speed)
    });
    y
}

/// On a turntable that speeds up, ω = a t, a puck at r is held as long as r |(a, ω²)| ≤ μ g. In the frame of the table
/// it sets off with u' = ω² p - a J p - 2 ω J u - μ g u/|u|.
#[test]
fn a_puck_slides_off_a_turntable_that_speeds_up() {
    let g = 9.81;
    for (mu, a, r, horizon) in [
        (0.27, 2.79, 0.91, 0.4),
        (0.57, 2.02, 1.37, 1.04),
        (0.14, 0.96, 1.22, 1.22),
    ] {
        let brake: f64 = mu * g;
        let leaves = ((brake / r).powi(2) - a * a).powf(0.25) / a;
        let force = |t: f64, y: [f64; 4]| {
            let w = a * t;
            [
                w * w * y[0] + a * y[1] + 2.0 * w * y[3],
                w * w * y[1] - a * y[0] - 2.0 * w * y[2],
            ]
        };
        let after = 1e-4;
        let [u1, u2] = sets_off(after, |t| force(t, [r, 0.0, 0.0, 0.0]), leaves);
        let third = after / 3.0;
        let start = [r + third * u1, third * u2, u1, u2];
        let (_, y) = slides(leaves + after, horizon, start, |t, y| {
            let speed = y[2].hypot(y[3]);
            let b = force(t, y);
            [0, 1].map(|i| b[i] - brake * y[2 + i] / speed)
        });
        let (s, c) = (0.5 * a * horizon * horizon).sin_cos();
        let turned = |[x, y]: [f64; 2]| [c * x - s * y, s * x + c * y];
        let w = a * horizon;
        let q = turned([y[0], y[1]]);
        let v = turned([y[2] - w * y[1], y[3] + w * y[0]]);
        for tolerance in [1e-8, 1e-12] {
            let text = format!(
                "model puck {{
                   state q[3] = [{r:?}, 0, 0];
                   state v[3] = [0, 0, 0];
                   let W = {a:?}*time;
                   q' = v;
                   mechanics q, v {{
                     mass = 1;
                     force = [0, 0, -9.81];
                     contact floor {{
                       gap = q[3];
                       slip = [v[1] + W*q[2], v[2] - W*q[1]];
                       restitution = 0;
                       friction = {mu:?};
                     }}
                   }}
                 }}
                 simulate this of puck {{ tolerance {tolerance:e}; horizon {horizon:?}; }}"
            );
            let found = solved(&text, "this");
            let within = f64::max(tolerance, 1e-10);
            assert_near(&times(&found, EventKind::Slip), &[leaves], within);
            assert_near(&end(&found, "q")[..2], &q, within);
            assert_near(&end(&found, "v")[..2], &v, within);
            assert!(
                found.quality.stats.steps < 100,
                "{}",
                found.quality.stats.steps
            );
        }
    }
}

/// The root of a function that changes its sign between two points.
fn root(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match f(low) * f(middle) > 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

/// Along a line that is no axis, under c sin t against 2: to and fro, with rest in between.
#[test]
fn a_block_that_sets_off_again_goes_as_on_a_line() {
    let c = 3.0;
    let found = block([0.8, 0.6], "2.4*sin(time), 1.8*sin(time)", 0.2, 7.0);
    let stops = root(|t: f64| 1.0 + c * (1.0 - t.cos()) - 2.0 * t, 2.0, 3.6);
    let there = stops + c * (stops - stops.sin()) - stops * stops;
    let again = PI + (2.0 / c).asin();
    let speed = |t: f64| c * (again.cos() - t.cos()) + 2.0 * (t - again);
    let ends = root(speed, 5.0, 7.0);
    let late = ends - again;
    let back = c * (again.cos() * late - ends.sin() + again.sin()) + late * late;
    assert_near(&times(&found, EventKind::Stick), &[stops, ends], 1e-9);
    assert_near(&times(&found, EventKind::Slip), &[again], 1e-9);
    let way = there + back;
    assert_near(&end(&found, "q"), &[0.8 * way, 0.6 * way, 0.0], 1e-9);
    assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
    assert!(
        found.quality.stats.steps < 200,
        "{}",
        found.quality.stats.steps
    );
}

/// A push that turns on a slope: |b|² = s² + A² - 2 s A cos t is beyond the cone where cos t is below a bound.
#[test]
fn a_push_that_turns_sets_off_what_had_come_to_rest() {
    let (s, push, brake) = (2.9_f64, 2.5, 3.75);
    let found = block([0.0; 2], "2.9 - 2.5*cos(time), 2.5*sin(time)", 0.375, 8.0);
    let first = ((s * s + push * push - brake * brake) / (2.0 * s * push)).acos();
    let again = first + 2.0 * PI;
    assert_near(&times(&found, EventKind::Slip), &[first, again], 1e-9);
    let b = |t: f64| [s - push * t.cos(), push * t.sin()];
    let rate = |t: f64, y: [f64; 4]| {
        let speed = y[2].hypot(y[3]);
        [0, 1].map(|i| b(t)[i] - brake * y[2 + i] / speed)
    };
    let after = 1e-4;
    let from = |at: f64, p: [f64; 2]| {
        let [u1, u2] = sets_off(after, b, at);
        let third = after / 3.0;
        [p[0] + third * u1, p[1] + third * u2, u1, u2]
    };
    let (stops, rest) = slides(first + after, 7.0, from(first, [0.0; 2]), rate);
    assert_near(&times(&found, EventKind::Stick), &[stops], 1e-9);
    let (_, last) = slides(again + after, 8.0, from(again, [rest[0], rest[1]]), rate);
    assert_near(&end(&found, "q")[..2], &last[..2], 1e-9);
    assert_near(&end(&found, "v")[..2], &last[2..], 1e-9);
    assert!(
        found.quality.stats.steps < 300,
        "{}",
        found.quality.stats.steps
    );
}

/// Forces that grow and turn, from far inside the cone or along its rim.
#[test]
fn what_sets_off_slowly_does_so_in_few_steps() {
    type Push = fn(f64) -> [f64; 2];
    let cases: [(&str, Push, f64, f64); 3] = [
        ("2*time, time^2", |t| [2.0 * t, t * t], 0.5, 1.5),
        (
            "1.5 + 0.3*time, 0.5*time",
            |t| [1.5 + 0.3 * t, 0.5 * t],
            0.5,
            2.5,
        ),
        (
            "time*cos(20*time), time*sin(20*time)",
            |t| [t * (20.0 * t).cos(), t * (20.0 * t).sin()],
            1.5,
            2.5,
        ),
    ];
    for (force, b, low, high) in cases {
        let found = block([0.0; 2], force, 0.2, 4.0);
        let leaves = root(|t| b(t)[0].hypot(b(t)[1]) - 2.0, low, high);
        assert_near(&times(&found, EventKind::Slip), &[leaves], 1e-10);
        let y = slides_off(leaves, 4.0, b);
        assert_near(&end(&found, "q")[..2], &y[..2], 1e-9);
        assert_near(&end(&found, "v")[..2], &y[2..], 1e-9);
        assert!(
            found.quality.stats.steps < 300,
            "{}",
            found.quality.stats.steps
        );
    }
}

/// M v' = F + N n - μ N u/|u| with u₃ = 0 and a mass that joins all directions: it turns until it rests.
#[test]
fn a_body_whose_mass_joins_all_directions_comes_to_rest() {
    let text = "model body {
         state q[3] = [0, 0, 0];
         state v[3] = [1.2, -0.7, 0];
         q' = v;
         mechanics q, v {
           mass = [1, 0.3, 0; 0.3, 2, 0.1; 0, 0.1, 1.5];
           force = [0.5, 0.3, -15];
           contact floor { gap = q[3]; slip = v[1..2]; restitution = 0; friction = 0.15; }
         }
       }
       simulate this of body { tolerance 1e-12; horizon 2; }";
    let found = solved(text, "this");
    let mu = 0.15;
    let (stops, y) = slides(0.0, 2.0, [0.0, 0.0, 1.2, -0.7], |_, y| {
        let speed = y[2].hypot(y[3]);
        let [d, e] = [y[2] / speed, y[3] / speed];
        // N = 15 + v₂'/10 in the first two rows.
        let matrix = [[1.0, 0.3 + 0.1 * mu * d], [0.3, 2.0 + 0.1 * mu * e]];
        let rhs = [0.5 - 15.0 * mu * d, 0.3 - 15.0 * mu * e];
        let determinant = matrix[0][0] * matrix[1][1] - matrix[0][1] * matrix[1][0];
        [
            (rhs[0] * matrix[1][1] - matrix[0][1] * rhs[1]) / determinant,
            (matrix[0][0] * rhs[1] - matrix[1][0] * rhs[0]) / determinant,
        ]
    });
    assert_near(&times(&found, EventKind::Stick), &[stops], 1e-9);
    assert_near(&end(&found, "q"), &[y[0], y[1], 0.0], 1e-9);
    assert_near(&end(&found, "v"), &[0.0; 3], 1e-12);
}

/// Two blocks at once, pulled by forces of one size: each goes as one alone does.
#[test]
fn two_blocks_set_off_together() {
    let text = "model blocks {
         state q[6] = 0;
         state v[6] = 0;
         q' = v;
         mechanics q, v {
           mass = diag([1, 1, 1, 1, 1, 1]);
           force = [time, 0.5*time^2, -10 - (v[4] - v[1]), time, 0.5*time^2, -10 - (v[4] - v[1])];
           contact first { gap = q[3]; slip = v[1..2]; restitution = 0; friction = 0.2; }
           contact second { gap = q[6]; slip = v[4..5]; restitution = 0; friction = 0.2; }
         }
       }
       simulate this of blocks { tolerance 1e-12; horizon 4; }";
    let found = solved(text, "this");
    let b = |t: f64| [t, 0.5 * t * t];
    let leaves = root(|t| b(t)[0].hypot(b(t)[1]) - 2.0, 1.0, 2.0);
    assert_near(&times(&found, EventKind::Slip), &[leaves; 2], 1e-10);
    let y = slides_off(leaves, 4.0, b);
    assert_near(&end(&found, "q"), &[y[0], y[1], 0.0, y[0], y[1], 0.0], 1e-9);
    assert_near(&end(&found, "v"), &[y[2], y[3], 0.0, y[2], y[3], 0.0], 1e-9);
}

/// Two to four of them, whose normal forces know each other's velocities, by forces that grow in other ways: each goes
/// as it would alone, as long as they go together.
#[test]
fn any_blocks_set_off_together() {
    let mut random = Random(26);
    for _ in 0..24 {
        let n = 2 + random.below(3);
        let [a, c] = [0.4, 0.1].map(|least| random.rounded(least, 3.0 * least));
        let weight = random.rounded(0.1, 2.0);
        let b = |t: f64| [a * t, c * t * t];
        let leaves = root(|t| b(t)[0].hypot(b(t)[1]) - 2.0, 0.0, 20.0);
        let horizon = leaves + 1.5;
        let last = 3 * n - 2;
        let force = format!("{a:?}*time, {c:?}*time^2, -10 - {weight:?}*(v[{last}] - v[1])");
        let forces = vec![force; n].join(", ");
        let contact = |k: usize| {
            let (x, y, z) = (3 * k + 1, 3 * k + 2, 3 * k + 3);
            format!(
                "contact c{k} {{ gap = q[{z}]; slip = v[{x}..{y}]; restitution = 0; friction = 0.2; }}"
            )
        };
        let contacts: String = (0..n).map(contact).collect();
        let text = format!(
            "model blocks {{
               state q[{m}] = 0; state v[{m}] = 0;
               q' = v;
               mechanics q, v {{ mass = eye({m}); force = [{forces}]; {contacts} }}
             }}
             simulate this of blocks {{ tolerance 1e-12; horizon {horizon:?}; }}",
            m = 3 * n
        );
        let found = solved(&text, "this");
        assert_near(&times(&found, EventKind::Slip), &vec![leaves; n], 1e-9);
        let y = slides_off(leaves, horizon, b);
        assert_near(&end(&found, "v"), &[y[2], y[3], 0.0].repeat(n), 1e-7);
    }
}

/// A block that is exactly at rest at the end of a spring, while one at the other end sets off, as on a spring that is
/// fixed: in a direction that turns, or so slowly that it rests again after a few micrometres.
#[test]
fn a_block_stays_while_another_one_sets_off() {
    let grows = |t: f64| [0.95 * t * t, -0.39 * t];
    let force = ("0.95*time^2", "-0.39*time");
    one_stays(3.79, 0.5, 0.1, force, grows, &[0.6], 1.9);
    let turns = |t: f64| [1.93 * (1.98 * t).sin(), -0.66 * t];
    let force = ("1.93*sin(1.98*time)", "-0.66*time");
    one_stays(1.35, 2.0, 0.1, force, turns, &[0.7, 1.9], 3.0);
}

/// `before` are instants shortly before those at which it sets off.
fn one_stays(
    spring: f64,
    mass: f64,
    friction: f64,
    force: (&str, &str),
    push: impl Fn(f64) -> [f64; 2],
    before: &[f64],
    horizon: f64,
) {
    let brake = 10.0 * friction;
    let after = 1e-4;
    let (mut setting_off, mut resting) = (Vec::new(), Vec::new());
    let mut y = [0.0; 4];
    let last = before.len() - 1;
    for (at, &before) in before.iter().enumerate() {
        let place = [y[0], y[1]];
        let pull = |t: f64| [0, 1].map(|i| (push(t)[i] - spring * place[i]) / mass);
        let leaves = root(
            |t| pull(t)[0].hypot(pull(t)[1]) - brake,
            before,
            before + 0.2,
        );
        setting_off.push(leaves);
        let [u1, u2] = sets_off(after, pull, leaves);
        let third = after / 3.0;
        let start = [place[0] + third * u1, place[1] + third * u2, u1, u2];
        let (stops, end) = slides(leaves + after, horizon, start, |t, y| {
            let speed = y[2].hypot(y[3]);
            [0, 1].map(|i| (push(t)[i] - spring * y[i]) / mass - brake * y[2 + i] / speed)
        });
        y = end;
        if at < last {
            resting.push(stops);
        }
    }
    for tolerance in [1e-6, 1e-8, 1e-9, 1e-10, 1e-12] {
        let text = format!(
            "model blocks {{
               state q[6] = [0, 0, 0, 1, 0, 0];
               state v[6] = 0;
               q' = v;
               const k = {spring:?};
               mechanics q, v {{
                 mass = diag([1, 1, 1, {mass:?}, {mass:?}, {mass:?}]);
                 force = [k*(q[4] - q[1] - 1), k*(q[5] - q[2]), -10,
                   {} - k*(q[4] - q[1] - 1), {} - k*(q[5] - q[2]), -10*{mass:?}];
                 contact stays {{ gap = q[3]; slip = v[1..2]; restitution = 0; friction = 0.3; }}
                 contact goes {{ gap = q[6]; slip = v[4..5]; restitution = 0; friction = {friction:?}; }}
               }}
             }}
             simulate this of blocks {{ tolerance {tolerance:?}; horizon {horizon:?}; }}",
            force.0, force.1
        );
        let found = solved(&text, "this");
        let within = f64::max(1e-9, tolerance);
        assert_near(&times(&found, EventKind::Slip), &setting_off, within);
        assert_near(&times(&found, EventKind::Stick), &resting, within);
        let q = [0.0, 0.0, 0.0, 1.0 + y[0], y[1], 0.0];
        assert_near(&end(&found, "q"), &q, within);
        assert_near(&end(&found, "v"), &[0.0, 0.0, 0.0, y[2], y[3], 0.0], within);
        assert!(
            found.quality.stats.steps < 2000,
            "{}",
            found.quality.stats.steps
        );
    }
}
