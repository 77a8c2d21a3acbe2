//! Chattering that fades and never ends, and what only looks like it.

use std::f64::consts::PI;

use super::{Case, Extent, Family, Promise};
use crate::random::Random;

pub fn families(extent: Extent) -> Vec<Family> {
    vec![endless(extent), passing(extent)]
}

/// Relays behind a lag, and networks of two genes: the number of events grows as an exponential of time.
fn endless(extent: Extent) -> Family {
    let (lags, networks) = extent.of((2, 1), (80, 60));
    let mut random = Random(17);
    let lags = (0..lags).map(|_| lag(&mut random)).collect::<Vec<_>>();
    let networks = (0..networks).map(|_| network(&mut random));
    Family {
        name: "chattering without end",
        about: "A relay behind a lag, and two genes of which one furthers and one represses the other: events follow each \
                other in times that fall as 1/n, which is told.",
        hardness: "model",
        cases: lags.into_iter().chain(networks).collect(),
    }
}

/// x' = u, e u' = -k sign(x) - u, whose events double in 3 e ln 2.
fn lag(random: &mut Random) -> Case {
    let e = 10.0_f64.powf(random.within(-4.0, -1.6));
    let (k, x) = (random.rounded(0.3, 4.0), random.rounded(0.1, 1.0));
    let model = format!("state x = {x:?}; state u = 0; x' = u; u' = (-{k:?}*sign(x) - u)/{e:e};");
    told(Case::new("lag", model, x / k + 3.0))
}

/// Each gene is on or off by the other one, and decays: the turns around the point of both thresholds shrink as 1/n.
fn network(random: &mut Random) -> Case {
    let mut one = || {
        (
            random.rounded(0.2, 0.8),
            random.rounded(0.3, 3.0),
            random.rounded(0.0, 1.0),
        )
    };
    let ((p, f, x), (q, g, y)) = (one(), one());
    let model = format!(
        "state x = {x:?}; state y = {y:?};
         x' = {f:?}*((if y > {q:?} then 0 else 1) - x); y' = {g:?}*((if x > {p:?} then 1 else 0) - y);"
    );
    told(Case::new("network", model, 1000.0))
}

fn told(case: Case) -> Case {
    case.by("event { max_events = 200000; }")
        .promises(Promise::Told("E0733"))
}

/// Cycles of constant or slowly growing pace, and chattering that the horizon or another switch ends in time.
fn passing(extent: Extent) -> Family {
    let count = extent.sweep(&[()], &[(); 24]).len();
    let mut random = Random(18);
    let of_each = |_| {
        [
            relay(&mut random),
            modulated(&mut random),
            sweep(&mut random),
            short(&mut random, None),
            short(&mut random, Some(0.3)),
        ]
    };
    Family {
        name: "switching that goes on or ends",
        about: "Relays with memory, pulse width modulation, a sweep of frequency, and lags with a relay whose horizon or \
                set point ends the chattering in time; closed forms and their bisection.",
        hardness: "model",
        cases: (0..count).flat_map(of_each).collect(),
    }
}

/// A relay with memory, up at the rate a and down at the rate b between -w and w: z counts the time of both.
fn relay(random: &mut Random) -> Case {
    let (a, b) = (random.rounded(0.5, 2.0), random.rounded(0.5, 2.0));
    let w = 1.0 / 1024.0;
    let (up, down) = (2.0 * w / a, 2.0 * w / b);
    let periods = 1500 + random.below(500);
    let model = format!(
        "state x = -{w:?}; state z = 0; switch h = hysteresis(x, on = -{w:?}, off = {w:?}, start = 1);
         x' = h*{a:?} - (1 - h)*{b:?}; z' = 2*h - 1;"
    );
    // A quarter of the way up.
    let horizon = periods as f64 * (up + down) + 0.25 * up;
    let known = periods as f64 * (up - down) + 0.25 * up;
    Case::new("relay", model, horizon)
        .ends("z", &[known], horizon)
        .by("event { max_events = 10000; }")
}

/// The sign of a sine, to a quarter of a period.
fn modulated(random: &mut Random) -> Case {
    let w = random.rounded(500.0, 2000.0);
    let periods = 1200 + random.below(500);
    let model = format!("state z = 0; z' = sign(sin({w:?}*time));");
    Case::new("modulation", model, (2.0 * periods as f64 + 0.5) * PI / w)
        .ends("z", &[0.5 * PI / w], 1.0)
        .by("event { max_events = 10000; }")
}

/// The sign of sin(c t²), whose k-th root is √(kπ/c).
fn sweep(random: &mut Random) -> Case {
    let c = random.rounded(50.0, 100.0);
    let roots = 2400 + random.below(200);
    let root = |k: usize| (k as f64 * PI / c).sqrt();
    let horizon = 0.5 * (root(roots) + root(roots + 1));
    let length = |k: usize| root(k + 1).min(horizon) - root(k);
    let sign = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 };
    let known = (0..=roots).map(|k| sign(k) * length(k)).sum();
    let model = format!("state z = 0; z' = sign(sin({c:?}*time^2));");
    Case::new("sweep", model, horizon)
        .ends("z", &[known], 1.0)
        .by("event { max_events = 10000; }")
}

/// How long a run goes on behind a step of its set point: longer than chattering would take to the limit of events.
const BEHIND: f64 = 1.2;

/// A lag that has met some thousands of events at the horizon, or when its set point `steps`, after which it meets few.
fn short(random: &mut Random, steps: Option<f64>) -> Case {
    let (e, x) = (random.rounded(0.05, 0.06), random.rounded(0.1, 0.2));
    // From 1 event on their number doubles in 3 e ln 2.
    let until = x + e * (3.0 * 4000.0_f64.ln() - 2.0);
    let mut lag = Lag { x, u: 0.0, e };
    lag.go(0.0, until);
    let set_point = match steps {
        None => "0".to_owned(),
        Some(r) => {
            lag.go(r, BEHIND);
            format!("(if time > {until:?} then {r:?} else 0)")
        }
    };
    let horizon = until + steps.map_or(0.0, |_| BEHIND);
    let model =
        format!("state x = {x:?}; state u = 0; x' = u; u' = (-sign(x - {set_point}) - u)/{e:?};");
    let end = Case::new("passing", model, horizon)
        .ends("x", &[lag.x], 1.0)
        .ends("u", &[lag.u], 1.0);
    end.by("event { max_events = 40000; }")
}

/// x' = u, e u' = -sign(x - r) - u from switch to switch.
struct Lag {
    x: f64,
    u: f64,
    e: f64,
}

impl Lag {
    /// Goes on for a time with a set point r.
    fn go(&mut self, r: f64, time: f64) {
        let mut left = time;
        let mut side = if self.x - r != 0.0 {
            (self.x - r).signum()
        } else {
            self.u.signum()
        };
        // On a side s, s (x - r) = h - t + (1 + s u) e (1 - exp(-t/e)) is concave.
        loop {
            let (h, pace) = (side * (self.x - r), 1.0 + side * self.u);
            let height = |t: f64| h - t - pace * self.e * (-t / self.e).exp_m1();
            let mut low = if pace > 1.0 { self.e * pace.ln() } else { 0.0 };
            let mut high = h + pace.max(0.0) * self.e;
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                *(if height(middle) > 0.0 {
                    &mut low
                } else {
                    &mut high
                }) = middle;
            }
            let root = high;
            let t = root.min(left);
            self.x = r + side * height(t);
            self.u = side * (pace * (-t / self.e).exp() - 1.0);
            if root >= left {
                return;
            }
            self.x = r;
            left -= root;
            side = -side;
        }
    }
}
