//! Contacts that close for good, in frozen time by finite elements: the gap follows from its rate, and stays closed on
//! floors that move or bend, with steps of any length.

use nsd_tests::{end, run, times};
use nsdc::report::{EventKind, Status, Trajectory};

/// How elements are laid.
const METHODS: [&str; 4] = [
    "method fesd;",
    "method fesd { steps = 200; }",
    "method fesd { scheme = radau_iia(3); steps = 40; }",
    "method fesd { scheme = gauss(3); steps = 40; }",
];

const G: f64 = 9.81;

fn solved(model: &str, horizon: f64, method: &str) -> Trajectory {
    let text = format!(
        "{model} simulate this of m {{ horizon {horizon:?}; lower timefreezing; {method} }}"
    );
    let found = run(&text, "this");
    assert_eq!(found.status, Status::Solved, "{method} {:?}", found.failure);
    found.verify().expect("the invariants of `Trajectory`");
    let violation = found.quality.certificate.max_violation;
    assert!(violation <= 1e-11, "{method} {violation:e}");
    found
}

/// Where a function that falls has its zero.
fn root(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if f(middle) > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[track_caller]
fn near(found: f64, exact: f64, within: f64) {
    assert!((found - exact).abs() <= within, "{found} for {exact}");
}

/// A ball of mass 1 above a floor at `height`.
fn lift(height: &str, force: &str) -> String {
    format!(
        "model m {{
           state q = 1;
           state v = 0;
           q' = v;
           mechanics q, v {{
             mass = 1;
             force = {force};
             contact floor {{ gap = q - ({height}); restitution = 0; }}
           }}
         }}"
    )
}

/// A ball falls on a floor that moves, and goes with it.
#[test]
fn a_ball_stays_on_a_floor_that_moves() {
    type Height = fn(f64) -> [f64; 2];
    let floors: [(&str, Height); 6] = [
        ("0.1*time", |t| [0.1 * t, 0.1]),
        ("0.3*sin(5*time)", |t| {
            [0.3 * (5.0 * t).sin(), 1.5 * (5.0 * t).cos()]
        }),
        ("0.1*sin(9*time)", |t| {
            [0.1 * (9.0 * t).sin(), 0.9 * (9.0 * t).cos()]
        }),
        ("0.2 - 0.2*cos(4*time)", |t| {
            [0.2 - 0.2 * (4.0 * t).cos(), 0.8 * (4.0 * t).sin()]
        }),
        ("-0.05*time^3", |t| [-0.05 * t.powi(3), -0.15 * t * t]),
        ("0.2*exp(-time)", |t| [0.2 * (-t).exp(), -0.2 * (-t).exp()]),
    ];
    const HORIZON: f64 = 1.8;
    for (height, exact) in floors {
        let closes = root(|t| 1.0 - 0.5 * G * t * t - exact(t)[0], 0.0, 0.6);
        let [q, v] = exact(HORIZON);
        for method in METHODS {
            let found = solved(&lift(height, "-9.81"), HORIZON, method);
            near(times(&found, EventKind::Jump)[0], closes, 1e-11);
            near(end(&found, "q")[0], q, 1e-9);
            near(end(&found, "v")[0], v, 1e-8);
        }
    }
}

/// A force that grows lifts it off where it is what the floor asks for.
#[test]
fn a_ball_is_lifted_off_a_floor_that_moves() {
    let height = |t: f64| [0.05 * (3.0 * t).sin(), 0.15 * (3.0 * t).cos()];
    let opens = root(|t| 9.81 - 14.0 * t - 0.45 * (3.0 * t).sin(), 0.4, 1.0);
    let ([q, v], flight) = (height(opens), 1.5 - opens);
    let pull = 14.0 * opens - 9.81;
    let q = q + v * flight + pull * flight.powi(2) / 2.0 + 14.0 * flight.powi(3) / 6.0;
    let v = v + pull * flight + 14.0 * flight.powi(2) / 2.0;
    for method in METHODS {
        let model = lift("0.05*sin(3*time)", "14*time - 9.81");
        let found = solved(&model, 1.5, method);
        near(times(&found, EventKind::ContactOpen)[0], opens, 1e-8);
        near(end(&found, "q")[0], q, 1e-8);
        near(end(&found, "v")[0], v, 1e-8);
    }
}

/// In a bowl a point mass swings as a pendulum does: its angle is that of `L θ'' = -g sin θ` by events.
#[test]
fn the_order_on_a_bowl_is_that_of_the_scheme() {
    let model = "model m {
        state q[2] = [0.3, -0.5];
        state v[2] = [0, 0];
        q' = v;
        mechanics q, v { mass = eye(2); force = [0, -9.81]; contact bowl { gap = 1 - norm(q); restitution = 0; } }
      }";
    // The blow takes what is normal to the bowl, and leaves the tangential part.
    let (x, fall) = (0.3_f64, (1.0_f64 - 0.09).sqrt() - 0.5);
    let (closes, speed) = ((2.0 * fall / G).sqrt(), (2.0 * G * fall).sqrt());
    let text = format!(
        "model p {{
           state theta = {:?};
           state omega = {:?};
           theta' = omega;
           omega' = -9.81*sin(theta);
         }}
         simulate swings of p {{ horizon {:?}; tolerance 1e-14; }}",
        x.asin(),
        -speed * x,
        2.5 - closes
    );
    let exact = end(&run(&text, "swings"), "theta")[0];
    let error = |scheme: &str, steps: usize| {
        let method = format!("method fesd {{ scheme = {scheme}; steps = {steps}; }}");
        let found = solved(model, 2.5, &method);
        let q = end(&found, "q");
        near(q[0].hypot(q[1]), 1.0, 1e-12);
        (q[0].atan2(-q[1]) - exact).abs()
    };
    for (scheme, order) in [
        ("radau_iia(2)", 3.0),
        ("radau_iia(3)", 5.0),
        ("gauss(2)", 4.0),
    ] {
        let (coarse, fine) = (error(scheme, 40), error(scheme, 80));
        let seen = (coarse / fine).log2();
        assert!(
            (seen - order).abs() <= 0.4,
            "{scheme} {seen}: {coarse:.2e} {fine:.2e}"
        );
    }
}
