//! Friction of contacts that meets relays: discs that slip, roll, turn and come to rest on a rough slope.
//!
//! The contact pushes with m g cos φ all the time, so that its friction is a relay of the slip velocity like the others,
//! and the same motion is that of a model without a contact.

use nsd_tests::random::Random;
use nsd_tests::{end, run};
use nsdc::report::{Status, Trajectory};

/// A disc with rolling resistance and drag on its axle.
struct Disc {
    /// Mass, moment of inertia and radius.
    body: [f64; 3],
    friction: f64,
    /// Along and across the slope.
    gravity: [f64; 2],
    /// What a relay of w, and one of v, take.
    resistance: [f64; 2],
    /// v and w.
    start: [f64; 2],
}

impl Disc {
    fn random(random: &mut Random) -> Self {
        let mut of = |lo: f64, hi: f64| random.rounded(lo, hi);
        let angle = of(-0.3, 0.3);
        Disc {
            body: [of(0.2, 5.0), of(0.05, 2.0), of(0.2, 1.5)],
            friction: of(0.1, 0.9),
            gravity: [9.81 * angle.sin(), 9.81 * angle.cos()],
            resistance: [of(0.2, 4.0), of(0.2, 4.0)],
            start: [of(-3.0, 3.0), of(-6.0, 6.0)],
        }
    }

    /// With a contact, and with a relay of the slip velocity instead.
    fn models(&self) -> [String; 2] {
        let Disc {
            body: [m, inertia, radius],
            friction,
            gravity: [along, across],
            resistance: [of_w, of_v],
            start: [v, w],
        } = self;
        let states = format!("state q[3] = [0, {radius}, 0]; state v[3] = [{v}, 0, {w}]; q' = v;");
        let contact = format!(
            "model m {{ {states}
               mechanics q, v {{
                 mass = [{m}, 0, 0; 0, {m}, 0; 0, 0, {inertia}];
                 force = [{m}*{along} - {of_v}*sign(v[1]), -{m}*{across}, -{of_w}*sign(v[3])];
                 contact floor {{
                   gap = q[2] - {radius}; slip = v[1] + {radius}*v[3]; restitution = 0; friction = {friction};
                 }}
               }} }}"
        );
        let force = friction * m * across;
        let relays = format!(
            "model m {{ {states}
               let push = -{force}*sign(v[1] + {radius}*v[3]);
               v' = [{along} + (push - {of_v}*sign(v[1]))/{m}, 0, ({radius}*push - {of_w}*sign(v[3]))/{inertia}];
             }}"
        );
        [contact, relays]
    }
}

fn ended(model: &str) -> Trajectory {
    let found = run(
        &format!("{model} simulate run of m {{ horizon 4; tolerance 1e-10; }}"),
        "run",
    );
    assert_eq!(found.status, Status::Solved, "{model}: {:?}", found.failure);
    found
}

#[test]
fn contacts_and_relays_stop_discs_together() {
    let mut random = Random(40_725);
    let mut rests = 0;
    for _ in 0..60 {
        let disc = Disc::random(&mut random);
        let models = disc.models();
        let [with, without] = [&models[0], &models[1]].map(|model| ended(model));
        for name in ["q", "v"] {
            let pairs = end(&with, name).into_iter().zip(end(&without, name));
            for (a, b) in pairs {
                let error = (a - b).abs();
                assert!(error <= 1e-8 * b.abs().max(1.0), "{a} {b}: {}", models[0]);
            }
        }
        rests += usize::from(end(&with, "v").iter().all(|v| v.abs() < 1e-9));
    }
    assert!(rests >= 10, "{rests} came to rest");
}
