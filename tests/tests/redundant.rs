//! Contacts that say what others say, and friction where nothing can slip: forces are not determined, and motion is.

use nsd_tests::random::Random;
use nsd_tests::{assert_near, end, run};
use nsdc::report::{Status, Trajectory};

/// A box on its lower edge, pushed to and fro, with contacts at these points of the edge.
struct Pushed {
    corner: f64,
    height: f64,
    friction: f64,
    start: [f64; 6],
    push: [f64; 2],
}

impl Pushed {
    /// That lies, or falls onto a corner.
    fn random(numbers: &mut Random) -> Self {
        let corner = numbers.rounded(0.2, 0.8);
        let height = numbers.rounded(0.1, 0.5);
        let turned = numbers.of(&[0.0, 1.0]) * numbers.rounded(-0.4, 0.4);
        let above = corner * f64::sin(turned).abs() + height * f64::cos(turned);
        let drop = if turned == 0.0 {
            0.0
        } else {
            numbers.rounded(0.02, 0.3)
        };
        let spin = if turned == 0.0 {
            0.0
        } else {
            numbers.rounded(-1.0, 1.0)
        };
        let slide = numbers.rounded(-2.0, 2.0);
        let fall = if turned == 0.0 {
            0.0
        } else {
            numbers.rounded(-1.0, 0.0)
        };
        Pushed {
            corner,
            height,
            friction: numbers.of(&[0.0, 0.3, 0.8]),
            start: [0.0, above + drop, turned, slide, fall, spin],
            push: [numbers.rounded(-6.0, 6.0), numbers.rounded(1.0, 5.0)],
        }
    }

    fn run(&self, points: &[f64]) -> Trajectory {
        let Pushed {
            corner,
            height: b,
            friction,
            start: [x, y, turned, vx, vy, spin],
            push: [force, rate],
        } = self;
        let contact = |(i, share): (usize, &f64)| {
            let p = share * corner;
            format!(
                "contact c{i} {{ gap = q[2] + ({p:?})*sin(q[3]) - {b:?}*cos(q[3]); restitution = 0; friction = {friction:?};
                   slip = v[1] - ({p:?})*sin(q[3])*v[3] + {b:?}*cos(q[3])*v[3]; }}"
            )
        };
        let contacts: String = points.iter().enumerate().map(contact).collect();
        let inertia = (corner * corner + b * b) / 3.0;
        let text = format!(
            "model m {{ state q[3] = [{x:?}, {y:?}, {turned:?}]; state v[3] = [{vx:?}, {vy:?}, {spin:?}]; q' = v;
               mechanics q, v {{ mass = [1, 0, 0; 0, 1, 0; 0, 0, {inertia:?}];
                 force = [{force:?}*cos({rate:?}*time), -9.81, 0]; {contacts} }} }}
             simulate s of m {{ horizon 1.5; tolerance 1e-9; }}"
        );
        run(&text, "s")
    }
}

/// Points between two corners touch the ground where both do, and push in their place.
#[test]
fn points_between_corners_change_nothing() {
    let mut numbers = Random(12);
    let (mut count, mut refused) = (0, Vec::new());
    for case in 0..60 {
        let pushed = Pushed::random(&mut numbers);
        let plain = pushed.run(&[-1.0, 1.0]);
        if plain.status != Status::Solved {
            continue;
        }
        count += 1;
        for points in [&[-1.0, 1.0, 0.0][..], &[-1.0, 1.0, 0.0, 0.5, -1.0 / 3.0]] {
            let found = pushed.run(points);
            if found.status != Status::Solved {
                refused.push(format!("{case}, {points:?}: {:?}", found.failure));
                continue;
            }
            for name in ["q", "v"] {
                assert_near(&end(&found, name), &end(&plain, name), 1e-6);
            }
        }
    }
    assert!(count >= 55 && refused.len() <= 1, "{count}, {refused:?}");
}

/// A pendulum that a force presses against a wall and takes away: along the wall it can move in no other way than off it, so
/// that friction changes nothing.
#[test]
fn friction_holds_no_body_that_only_opens() {
    let mut numbers = Random(3);
    for _ in 0..30 {
        let (slope, wall) = (numbers.rounded(-0.6, 0.6), numbers.rounded(-0.8, -0.3));
        let (push, rate) = (numbers.rounded(3.0, 12.0), numbers.rounded(2.0, 6.0));
        let (sin, cos) = (f64::sin(slope), f64::cos(slope));
        let start = numbers.rounded(-0.2, 0.4);
        if cos * f64::sin(start) - sin * f64::cos(start) - wall < 0.05 {
            continue;
        }
        let [smooth, rough] = [0.0, 0.5].map(|friction| {
            let text = format!(
                "model m {{ state q[1] = [{start:?}]; state v[1] = [0]; q' = v;
                   mechanics q, v {{ mass = 1; force = [-9.81*cos(q[1]) + {push:?}*sin({rate:?}*time)]; }}
                   contact A {{ gap = {cos:?}*sin(q[1]) - ({sin:?})*cos(q[1]) - ({wall:?}); restitution = 0;
                     slip = (-({cos:?})*sin(q[1]) + ({sin:?})*cos(q[1]))*v[1]; friction = {friction:?}; }} }}
                 simulate s of m {{ horizon 4; tolerance 1e-10; }}"
            );
            let found = run(&text, "s");
            assert_eq!(found.status, Status::Solved, "{text}: {:?}", found.failure);
            [end(&found, "q")[0], end(&found, "v")[0]]
        });
        assert_near(&rough, &smooth, 1e-7);
    }
}
