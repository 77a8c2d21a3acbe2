//! Friction in two directions in steps of time, against closed forms.

use nsd_tests::bodies::Body;
use nsd_tests::{distance, end, larger, run, times};
use nsdc::report::{EventKind, Status, Trajectory};

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

fn moved(body: &Body, horizon: f64, steps: usize) -> Trajectory {
    let model = body.model();
    solved(&format!(
        "{model}
         simulate this of m {{ horizon {horizon:?}; method timestepping {{ steps = {steps}; }} }}"
    ))
}

/// It falls for √0.2, loses μ√20 of its speed √5, and slides on by (√5 - μ√20)²/(2μg), along (2, 1).
#[test]
fn a_thrown_ball_slides_along_its_line_and_rests() {
    let ball = Body {
        q: [0.0, 0.0, 1.0],
        v: [2.0, 1.0, 0.0],
        force: [0.0, 0.0, -10.0],
        friction: 0.2,
        restitution: 0.0,
        turned: 0.3,
    };
    let left = 5.0_f64.sqrt() - 0.2 * 20.0_f64.sqrt();
    let way = (1.0 + left * left / 4.0) / 5.0_f64.sqrt();
    let exact = [2.0 * way, way, 0.0];
    assert!(distance(&exact, &[1.296_919, 0.648_460, 0.0]) < 1e-6);
    // Whether a step ends just before or just behind the impact is chance, so that errors of many grids are compared.
    let error = |coarse: usize| {
        let grids = (0..9).map(|k| coarse + coarse * k / 9);
        let errors = grids.map(|steps| distance(&end(&moved(&ball, 2.0, steps), "q"), &exact));
        errors.fold(0.0, larger)
    };
    let (coarse, fine) = (error(100), error(1600));
    let order = (coarse / fine).log(16.0);
    assert!(
        (0.8..1.2).contains(&order),
        "order {order}: {coarse}, {fine}"
    );
    let found = moved(&ball, 2.0, 4000);
    assert!(distance(&end(&found, "v"), &[0.0; 3]) <= 1e-12);
    let (closes, sticks) = (0.2_f64.sqrt(), 0.2_f64.sqrt() + left / 2.0);
    for (kind, exact) in [
        (EventKind::ContactClose, closes),
        (EventKind::Slip, closes),
        (EventKind::Stick, sticks),
    ] {
        let found = times(&found, kind);
        assert_eq!(found.len(), 1, "{kind:?} {found:?}");
        assert!(
            (found[0] - exact).abs() <= 1e-3,
            "{kind:?} {found:?} for {exact}"
        );
    }
}

/// A block with the velocity C along y, under a constant pull f along x: with μg = k f, k > 1, and τ falling from 1
/// to 0, v_y = C τ^k and v_x = C/2 (τ^(k-1) - τ^(k+1)), at t = C/(2f) (∫_τ^1 s^(k-2) + s^k ds).
struct Curve {
    k: f64,
    f: f64,
    c: f64,
}

impl Curve {
    fn time(&self, tau: f64) -> f64 {
        let part = |n: f64| (1.0 - tau.powf(n)) / n;
        self.c / (2.0 * self.f) * (part(self.k - 1.0) + part(self.k + 1.0))
    }

    /// q and v in the plane.
    fn state(&self, tau: f64) -> [f64; 4] {
        let Curve { k, f, c } = *self;
        let part = |n: f64| (1.0 - tau.powf(n)) / n;
        let x = c * c / (4.0 * f) * (part(2.0 * k - 2.0) - part(2.0 * k + 2.0));
        let y = c * c / (2.0 * f) * (part(2.0 * k - 1.0) + part(2.0 * k + 1.0));
        let speed = 0.5 * c * (tau.powf(k - 1.0) - tau.powf(k + 1.0));
        [x, y, speed, c * tau.powf(k)]
    }

    fn run(&self, turned: f64, horizon: f64, steps: usize) -> [f64; 4] {
        let block = Body {
            q: [0.0; 3],
            v: [0.0, self.c, 0.0],
            force: [self.f, 0.0, -10.0],
            friction: self.k * self.f / 10.0,
            restitution: 0.0,
            turned,
        };
        let found = moved(&block, horizon, steps);
        let (q, v) = (end(&found, "q"), end(&found, "v"));
        assert!(q[2].abs() <= 1e-12 && v[2].abs() <= 1e-12);
        [q[0], q[1], v[0], v[1]]
    }
}

#[test]
fn a_pulled_block_slides_along_a_curve() {
    for (k, f, c) in [(2.0, 2.0, 3.0), (3.0, 1.5, 2.0), (1.5, 4.0, 1.0)] {
        let curve = Curve { k, f, c };
        // While it slides, and when it has come to rest at x* = C²/(4f (k² - 1)), y* = 2C²k/(f (4k² - 1)).
        let stop = c * k / (f * (k * k - 1.0));
        assert!((curve.time(0.0) - stop).abs() <= 1e-14);
        let (half, whole) = (curve.state(0.5), curve.state(0.0));
        assert!((whole[0] - c * c / (4.0 * f * (k * k - 1.0))).abs() <= 1e-14);
        assert!((whole[1] - 2.0 * c * c * k / (f * (4.0 * k * k - 1.0))).abs() <= 1e-14);
        for (horizon, exact) in [(curve.time(0.5), half), (1.5 * stop, whole)] {
            let errors = [100, 1600].map(|steps| distance(&curve.run(0.7, horizon, steps), &exact));
            let order = (errors[0] / errors[1]).log(16.0);
            assert!(
                order > 0.9 && errors[1] <= 2e-3,
                "k = {k}: {errors:?}, order {order}"
            );
        }
    }
}

/// Gravity 10 with the share g_t = (a, b) along a plane that is tilted, and n across it.
#[test]
fn a_block_on_a_tilted_plane_sticks_or_slides_straight_down() {
    let (a, b, n) = (1.2, 1.6, 9.6);
    for turned in [0.0, 0.4, 2.0] {
        let block = |friction: f64| Body {
            q: [0.3, -0.2, 0.0],
            v: [0.0; 3],
            force: [a, b, -n],
            friction,
            restitution: 0.0,
            turned,
        };
        // It holds 2 of 9.6.
        let stays = moved(&block(2.02 / n), 1.0, 50);
        assert_eq!(end(&stays, "q"), [0.3, -0.2, 0.0]);
        assert_eq!(end(&stays, "v"), [0.0; 3]);
        assert_eq!(
            stays.history.modes.last().map(|m| m.mode.as_str()),
            Some("stick(floor)")
        );
        // The midpoint rule has a constant acceleration exactly.
        let slides = moved(&block(1.0 / n), 1.0, 50);
        let exact = [0.3 + 0.3, -0.2 + 0.4, 0.0, 0.6, 0.8, 0.0];
        let found = [end(&slides, "q"), end(&slides, "v")].concat();
        assert!(distance(&found, &exact) <= 1e-12, "{found:?}");
        assert_eq!(
            slides.history.modes.last().map(|m| m.mode.as_str()),
            Some("slip(floor)")
        );
    }
}

#[test]
fn directions_of_slip_may_be_turned() {
    let curve = Curve {
        k: 2.0,
        f: 2.0,
        c: 3.0,
    };
    let straight = curve.run(0.0, 2.0, 100);
    for turned in [0.1, 0.8, 1.6, 3.0, 5.5] {
        let found = curve.run(turned, 2.0, 100);
        assert!(
            distance(&found, &straight) <= 1e-11,
            "{turned}: {found:?} for {straight:?}"
        );
    }
}

/// An impact at which M⁻¹ is not the same in all directions: [2 1 0; 1 1 0; 0 0 1] takes friction 2 v' + .. to
/// v⁺ = v - M⁻¹ J_t β. With v⁺ = (3, 4) and β = 5 μ (3, 4)/5, μ = 1/2 and a speed of 4 of the fall, β = (1.2, 1.6), and
/// v⁻ = v⁺ + (4, 2.8).
#[test]
fn an_impact_turns_the_slip_of_an_uneven_mass() {
    for turned in [0.0_f64, 0.6, 2.5] {
        let (s, c) = turned.sin_cos();
        let found = solved(&format!(
            "model m {{
               state q[3] = [0, 0, 0];
               state v[3] = [7, 6.8, -4];
               q' = v;
               mechanics q, v {{
                 mass = [1, -1, 0; -1, 2, 0; 0, 0, 1];
                 force = zeros(3);
                 contact floor {{
                   gap = q[3];
                   slip = [{c:?}*v[1] + {s:?}*v[2], {c:?}*v[2] - {s:?}*v[1]];
                   restitution = 0; friction = 0.5;
                 }}
               }}
             }}
             simulate this of m {{ horizon 1; method timestepping {{ steps = 1; }} }}"
        ));
        let v = end(&found, "v");
        assert!(distance(&v, &[3.0, 4.0, 0.0]) <= 1e-12, "{v:?}");
    }
}

/// A stool of mass 2 on three legs at the distance R = 1/2 from its axis, with friction at the height of its centre:
/// each leg carries a third, and the spin slows down by 3 μ (m g/3) R / I until it stops.
fn stool(v: [f64; 2], spin: f64, horizon: f64, steps: usize) -> Trajectory {
    let legs = [0.0_f64, 1.0, 2.0].map(|k| {
        let (y, x) = (0.3 + k * std::f64::consts::TAU / 3.0).sin_cos();
        let (x, y) = (0.5 * x, 0.5 * y);
        format!(
            "contact leg{k} {{
               gap = q[3] + {x:?}*q[5] - {y:?}*q[4];
               slip = [v[1] - {y:?}*v[6], v[2] + {x:?}*v[6]];
               restitution = 0; friction = 0.3;
             }}"
        )
    });
    let [x, y] = v;
    solved(&format!(
        "model m {{
           state q[6] = zeros(6);
           state v[6] = [{x:?}, {y:?}, 0, 0, 0, {spin:?}];
           q' = v;
           mechanics q, v {{
             mass = [2, 0, 0, 0, 0, 0; 0, 2, 0, 0, 0, 0; 0, 0, 2, 0, 0, 0;
                     0, 0, 0, 0.1, 0, 0; 0, 0, 0, 0, 0.1, 0; 0, 0, 0, 0, 0, 0.25];
             force = [0, 0, -20, 0, 0, 0];
             {}
           }}
           output energy = v[1]^2 + v[2]^2 + v[3]^2 + 0.05*(v[4]^2 + v[5]^2) + 0.125*v[6]^2 + 20*q[3];
         }}
         simulate this of m {{ horizon {horizon:?}; method timestepping {{ steps = {steps}; }} }}",
        legs.join("\n")
    ))
}

#[test]
fn a_stool_on_three_legs_stops_to_spin() {
    // 3 μ (m g/3) R / I = 12.
    let spins = stool([0.0, 0.0], 6.0, 0.25, 50);
    let v = end(&spins, "v");
    assert!(
        distance(&v, &[0.0, 0.0, 0.0, 0.0, 0.0, 3.0]) <= 1e-10,
        "{v:?}"
    );
    // It slides while it spins, and both end together (Farkas, Bartels, Unger & Wolf 2003).
    let steps = 1000;
    let slides = stool([1.0, 0.4], 6.0, 1.0, steps);
    assert!(distance(&end(&slides, "v"), &[0.0; 6]) <= 1e-12);
    let energy = &slides
        .samples
        .outputs
        .iter()
        .find(|o| o.name == "energy")
        .expect("it is one")
        .values;
    for pair in energy.windows(2) {
        assert!(pair[1] <= pair[0] + 1e-12 * energy[0], "{pair:?}");
    }
    let speed = slides
        .samples
        .states
        .iter()
        .find(|s| s.name == "v")
        .expect("it is one");
    let ends = |at: &dyn Fn(&[f64]) -> f64| {
        let moves = (0..slides.samples.time.len()).filter(|&k| at(speed.at(k)).abs() > 1e-9);
        moves.map(|k| slides.samples.time[k]).fold(0.0, f64::max)
    };
    let (spin, slide) = (ends(&|v| v[5]), ends(&|v| v[0].hypot(v[1])));
    assert!(
        (spin - slide).abs() <= 2.0 / steps as f64 && spin > 0.3,
        "{spin}, {slide}"
    );
}

/// Three balls of radius 1 and mass 1 that touch on a floor, and one on them; none turns.
fn pyramid(friction: f64, horizon: f64, steps: usize) -> Trajectory {
    let far = 2.0 / 3.0_f64.sqrt();
    let mut start = vec![0.0, 0.0, 1.0 + (8.0_f64 / 3.0).sqrt()];
    let (mut lets, mut contacts) = (String::new(), String::new());
    for k in 0..3 {
        let (y, x) = (0.2 + f64::from(k) * std::f64::consts::TAU / 3.0).sin_cos();
        start.extend([far * x, far * y, 1.0]);
        // From ball k up to the one on top, and two directions across that.
        let at = 3 * k + 3;
        let (a, b, c) = (at + 1, at + 2, at + 3);
        lets += &format!(
            "let n{k} = [q[1] - q[{a}], q[2] - q[{b}], q[3] - q[{c}]];
             let l{k} = norm(n{k});
             let s{k} = norm([n{k}[3], n{k}[1]]);
             "
        );
        contacts += &format!(
            "contact top{k} {{
               gap = l{k} - 2;
               slip = [(n{k}[3]*(v[1] - v[{a}]) - n{k}[1]*(v[3] - v[{c}]))/s{k},
                       (s{k}^2*(v[2] - v[{b}])
                        - n{k}[2]*(n{k}[1]*(v[1] - v[{a}]) + n{k}[3]*(v[3] - v[{c}])))/(s{k}*l{k})];
               restitution = 0; friction = mu;
             }}
             contact floor{k} {{ gap = q[{c}] - 1; slip = [v[{a}], v[{b}]]; restitution = 0; friction = mu; }}
             "
        );
        let next = 3 * ((k + 1) % 3) + 3;
        contacts += &format!(
            "contact beside{k} {{
               gap = norm([q[{a}] - q[{}], q[{b}] - q[{}], q[{c}] - q[{}]]) - 2; restitution = 0;
             }}
             ",
            next + 1,
            next + 2,
            next + 3
        );
    }
    solved(&format!(
        "model m {{
           param mu = {friction:?};
           state q[12] = {start:?};
           state v[12] = zeros(12);
           q' = v;
           {lets}
           mechanics q, v {{
             mass = eye(12);
             force = [0, 0, -10, 0, 0, -10, 0, 0, -10, 0, 0, -10];
             {contacts}
           }}
           output energy = dot(v, v) + 20*(q[3] + q[6] + q[9] + q[12]);
         }}
         simulate this of m {{ horizon {horizon:?}; method timestepping {{ steps = {steps}; }} }}"
    ))
}

/// With c² = 2/3 and s² = 1/3 of the angle at which the top rests on the others, N c + T s = m g/3 there. These stay
/// where N s - T c is not above the 4/3 m g μ of the floor, with T up to μN: for 4 μ² s + 5 μ c - s ≥ 0.
#[test]
fn a_pyramid_of_balls_stands_or_falls() {
    let least = (22.0_f64.sqrt() - 5.0 * (2.0_f64 / 3.0).sqrt()) * 3.0_f64.sqrt() / 8.0;
    assert!((0.13..0.14).contains(&least));
    let stands = pyramid(1.02 * least, 1.0, 100);
    let speed = end(&stands, "v")
        .iter()
        .fold(0.0_f64, |most, v| most.max(v.abs()));
    assert!(speed <= 1e-9, "{speed}");
    let falls = pyramid(0.98 * least, 4.0, 800);
    let (q, v) = (end(&falls, "q"), end(&falls, "v"));
    assert!(q[2] < 2.0, "{q:?}, {v:?}");
    let energy = &falls
        .samples
        .outputs
        .iter()
        .find(|o| o.name == "energy")
        .expect("it is one")
        .values;
    for pair in energy.windows(2) {
        assert!(pair[1] <= pair[0] + 1e-12 * energy[0], "{pair:?}");
    }
    assert!(falls.quality.certificate.max_violation <= 1e-10);
}

/// A block that slides at 1 drags the plank below it, which no gap knows of: 1 - 2t and 2t until both have ½.
#[test]
fn friction_moves_a_body_that_is_in_no_gap() {
    for slip in ["v[1] - u[1]", "[v[1] - u[1], v[2] - u[2]]"] {
        let found = solved(&format!(
            "model pile {{
               state x[2] = zeros(2);
               state y[3] = zeros(3);
               state u[2] = zeros(2);
               state v[3] = [1, 0, 0];
               x' = u;
               y' = v;
               mechanics x, u {{ mass = eye(2); force = zeros(2); }}
               mechanics y, v {{ mass = eye(3); force = [0, 0, -10]; }}
               contact c {{ gap = y[3]; slip = {slip}; restitution = 0; friction = 0.2; }}
             }}
             simulate this of pile {{ horizon 1; method timestepping {{ steps = 400; }} }}"
        ));
        let speeds = [end(&found, "u")[0], end(&found, "v")[0]];
        assert!(distance(&speeds, &[0.5, 0.5]) <= 1e-12, "{slip} {speeds:?}");
        let ways = [end(&found, "x")[0], end(&found, "y")[0]];
        assert!(
            distance(&ways, &[0.4375, 0.5625]) <= 2e-3,
            "{slip} {ways:?}"
        );
        let sticks = times(&found, EventKind::Stick);
        assert!(distance(&sticks, &[0.25]) <= 2.5e-3, "{slip} {sticks:?}");
        // Nothing leaves the floor: what rounds to there says nothing of the error.
        assert!(
            found
                .quality
                .error_estimate
                .is_some_and(|error| error < 0.1)
        );
        // It lies there from the start.
        assert!(times(&found, EventKind::ContactClose).is_empty());
    }
}
