//! Sweeps of frequency: cycles of events that become shorter and shorter are no accumulation where they go on, against an
//! integration of its own.

use nsd_tests::{run, solved, times};
use nsdc::report::{EventKind, Trajectory};

const GROWTH: f64 = 0.3;
const FORCE: f64 = 1.2;
const HORIZON: f64 = 14.0;

/// A phase whose frequency grows like exp(0.3 t).
fn phase(t: f64) -> f64 {
    ((GROWTH * t).exp() - 1.0) / GROWTH
}

/// When a block leaves rest, and when it is at rest again, under 1.2 sin(phase) against friction of 1: it breaks loose
/// where |sin| is 1/1.2, in closed form, and what it gains until it stops is integrated by Simpson's rule.
fn sticks_and_slips() -> Vec<(f64, f64)> {
    let mut found = Vec::new();
    let mut rests = 0.0;
    for half in 0.. {
        let sign = if half % 2 == 0 { 1.0 } else { -1.0 };
        let angle = f64::from(half) * std::f64::consts::PI + (1.0 / FORCE).asin();
        let leaves = (1.0 + GROWTH * angle).ln() / GROWTH;
        assert!(leaves > rests, "it rests before it breaks loose again");
        let rate = |t: f64| sign * FORCE * phase(t).sin() - 1.0;
        let gained = |t: f64, h: f64| h / 6.0 * (rate(t) + 4.0 * rate(t + 0.5 * h) + rate(t + h));
        let h = 1e-4 / (GROWTH * leaves).exp().min(100.0);
        let (mut t, mut v) = (leaves, 0.0);
        while t == leaves || v + gained(t, h) > 0.0 {
            v += gained(t, h);
            t += h;
        }
        let (mut low, mut high) = (0.0, h);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if v + gained(t, middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        rests = t + low;
        if rests > HORIZON {
            break;
        }
        found.push((leaves, rests));
    }
    found
}

fn block(settings: &str) -> String {
    format!(
        "model block {{
           state v = 0;
           v' = {FORCE}*sin((exp({GROWTH}*time) - 1)/{GROWTH}) - sign(v);
         }}
         simulate this of block {{ horizon {HORIZON:?}; {settings} }}"
    )
}

fn check(trajectory: &Trajectory, [leave, rest]: [EventKind; 2], within: f64) {
    let (left, rests) = (times(trajectory, leave), times(trajectory, rest));
    let exact = sticks_and_slips();
    assert!(exact.len() > 60, "{} cycles", exact.len());
    assert!(
        left.len() >= exact.len() && rests.len() == exact.len(),
        "{} and {} events",
        left.len(),
        rests.len()
    );
    for ((left, rests), (exact_left, exact_rests)) in left.iter().zip(&rests).zip(exact) {
        let error = (left - exact_left).abs().max((rests - exact_rests).abs());
        assert!(
            error <= within,
            "leaves at {left} and rests at {rests}, not {exact_left} and {exact_rests}"
        );
    }
    assert!(times(trajectory, EventKind::Zeno).is_empty());
}

const SLIDING: [EventKind; 2] = [EventKind::LeaveSliding, EventKind::EnterSliding];

#[test]
fn a_block_sticks_and_slips_at_every_frequency() {
    check(&solved(&block(""), "this"), SLIDING, 1e-9);
}

#[test]
fn a_block_sticks_and_slips_at_every_frequency_by_finite_elements() {
    check(&solved(&block("method fesd;"), "this"), SLIDING, 1e-7);
}

#[test]
fn a_contact_sticks_and_slips_at_every_frequency() {
    let text = format!(
        "model block {{
           state q[2] = 0;
           state v[2] = 0;
           q' = v;
           mechanics q, v {{
             mass = 1;
             force = [{FORCE}*sin((exp({GROWTH}*time) - 1)/{GROWTH}), -2];
             contact floor {{ gap = q[2]; restitution = 0; friction = 0.5; }}
           }}
         }}
         simulate this of block {{ horizon {HORIZON:?}; }}"
    );
    check(
        &solved(&text, "this"),
        [EventKind::Slip, EventKind::Stick],
        1e-9,
    );
}

/// The current of a boost converter goes up and down between two thresholds, faster as its capacitor is charged, and time
/// stands still while its relay switches.
#[test]
fn a_converter_switches_faster_and_faster_in_frozen_time() {
    let converter = |settings: &str| {
        format!(
            "model boost {{
               param L = 1e-3;
               param C = 1e-4;
               param R = 20;
               state i = 0;
               state u = 12;
               switch closed = hysteresis(i, on = 1.8, off = 2.2);
               i' = (12 - (1 - closed)*u)/L;
               u' = ((1 - closed)*i - u/R)/C;
             }}
             simulate this of boost {{ horizon 0.002; {settings} }}"
        )
    };
    let exact = times(&solved(&converter(""), "this"), EventKind::Relay);
    // Closed, the current grows by 12/L to 2.2, from 0 and later from 1.8.
    assert!((exact[0] - 2.2e-3 / 12.0).abs() <= 1e-12);
    for closed in exact[1..].chunks_exact(2) {
        assert!((closed[1] - closed[0] - 0.4e-3 / 12.0).abs() <= 1e-12);
    }
    for method in ["event", "fesd"] {
        let settings = format!("lower timefreezing; method {method};");
        let frozen = run(&converter(&settings), "this");
        assert_eq!(frozen.failure.map(|failure| failure.to_string()), None);
        let switched: Vec<f64> = (frozen.history.events.iter())
            .filter(|event| event.kind == EventKind::Relay)
            .map(|event| event.time)
            .collect();
        assert_eq!(switched.len(), exact.len(), "{method}");
        for (found, exact) in switched.iter().zip(&exact) {
            assert!(
                (found - exact).abs() <= 1e-9,
                "{method}: {found}, not {exact}"
            );
        }
        assert!(
            frozen
                .history
                .events
                .iter()
                .all(|event| event.kind != EventKind::Zeno)
        );
    }
}
