//! Chattering, many events, and long horizons.

use std::f64::consts::{PI, SQRT_2};

use super::{Case, Extent, Family, root};

const EPSILON: f64 = f64::EPSILON;

pub fn families(extent: Extent) -> Vec<Family> {
    vec![
        filtered_relay(extent),
        hysteresis(extent),
        many_events(extent),
        many_periods(extent),
        square_wave(extent),
    ]
}

/// A relay that acts through two filters: it switches back and forth about 6 times in 100 time constants.
fn filtered_relay(extent: Extent) -> Family {
    let horizon = 2.0;
    let case = |power: i32| {
        let rate = 10.0_f64.powi(power);
        let model = format!(
            "state x = 0.125; state u = 0; state w = 0;
             x' = 0.25 - w; u' = {rate:e}*(sign(x) - u); w' = {rate:e}*(u - w);"
        );
        let (times, [x, u, w]) = chatter(rate, horizon);
        let case = Case::new(format!("{rate:e}"), model, horizon);
        let case = case
            .ends("x", &[x], 0.125)
            .ends("u", &[u], 1.0)
            .ends("w", &[w], 1.0);
        // A phase that is wrong by rounding of t changes u by rate times that.
        case.switches_at(&times)
            .rounds(64.0 * EPSILON * rate)
            .both()
    };
    Family {
        name: "chattering behind filters",
        about: "x' = 1/4 - w, and sign(x) reaches w through two filters: a limit cycle that is as short as the \
                filters are fast; closed form between the crossings, to 64 roundings of time.",
        hardness: "rate of the filters",
        cases: extent
            .sweep(&[1, 2], &[1, 2, 3, 4])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// Crossings until the horizon, and (x, u, w) there.
fn chatter(rate: f64, horizon: f64) -> (Vec<f64>, [f64; 3]) {
    let flow = |[x, u, w]: [f64; 3], s: f64, tau: f64| {
        // u = s + a e^{-r τ}, w = s + (b + r a τ) e^{-r τ}.
        let (a, b, r) = (u - s, w - s, rate * tau);
        let decayed = (-r).exp();
        let lost = -(-r).exp_m1();
        let area = (b * lost + a * (lost - r * decayed)) / rate;
        [
            x + (0.25 - s) * tau - area,
            s + a * decayed,
            s + (b + a * r) * decayed,
        ]
    };
    let (mut t, mut s, mut now) = (0.0, 1.0, [0.125, 0.0, 0.0]);
    let mut times = Vec::new();
    let step = 0.25 / rate;
    loop {
        let x = |tau: f64| flow(now, s, tau)[0];
        // From its surface x leaves to the side of s.
        let mut k = 1.0;
        while x(k * step) * s > 0.0 && t + k * step < horizon {
            k += 1.0;
        }
        if x(k * step) * s > 0.0 {
            return (times, flow(now, s, horizon - t));
        }
        let tau = root(x, (k - 1.0).max(1e-3) * step, k * step);
        if t + tau >= horizon {
            return (times, flow(now, s, horizon - t));
        }
        now = flow(now, s, tau);
        now[0] = 0.0;
        (t, s) = (t + tau, -s);
        times.push(t);
    }
}

/// x goes up and down between ±d with the speeds 1 and 3.
fn hysteresis(extent: Extent) -> Family {
    let horizon = 1.0;
    let case = |power: i32| {
        let d = 2.0_f64.powi(-power);
        let model = format!(
            "state x = 0; state z = 0; switch h = hysteresis(x, on = {d:e}, off = {:e}, start = 0);
             x' = 1 - 4*h; z' = h;",
            -d
        );
        // Up to d, then down for 2 d/3 and up for 2 d.
        let period = 8.0 / 3.0 * d;
        let cycles = ((horizon - d) / period).floor();
        let rest = horizon - d - cycles * period;
        let on = rest.min(2.0 / 3.0 * d);
        let x = if rest < 2.0 / 3.0 * d {
            d - 3.0 * rest
        } else {
            rest - 2.0 / 3.0 * d - d
        };
        let z = cycles * 2.0 / 3.0 * d + on;
        let case = Case::new(format!("2^-{power}"), model, horizon);
        // Every switch rounds x and time.
        let rounding = 2.0 * cycles * EPSILON / d;
        case.ends("z", &[z], z).ends("x", &[x], d).rounds(rounding)
    };
    Family {
        name: "chattering of a relay with memory",
        about: "x goes up and down between ±d, 3/(4 d) times in all; the sum of the times it is on, closed form, \
                to one rounding for every switch.",
        hardness: "width d",
        cases: extent
            .sweep(&[4, 8], &[4, 6, 8, 10, 12, 14])
            .into_iter()
            .map(case)
            .collect(),
    }
}

/// Parabolas between crossings, 4 √2 for a period.
fn many_events(extent: Extent) -> Family {
    let case = |n: u32| {
        let horizon = 2.0 * SQRT_2 * f64::from(n);
        let exact = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
        let model = "state x = 1; state v = 0; x' = v; v' = -sign(x);";
        let case = Case::new(n, model, horizon).switches(n as usize);
        let case = case.ends("x", &[exact], 1.0).ends("v", &[0.0], SQRT_2);
        // The phase is a sum of as many times.
        let case = case.rounds(EPSILON * f64::from(n));
        case.both()
    };
    Family {
        name: "many events",
        about: "x'' = -sign(x): n crossings, parabolas between them; closed form, to one rounding for each.",
        hardness: "events n",
        cases: extent
            .sweep(&[100, 1000], &[100, 1000, 10_000, 100_000])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// x'' = -x, with a kink that bends it.
fn many_periods(extent: Extent) -> Family {
    let case = |n: u32| {
        let n = f64::from(n);
        let smooth = "state x = 1; state v = 0; x' = v; v' = -x;";
        let smooth = Case::new(n, smooth, 2.0 * PI * n);
        let smooth = smooth.ends("x", &[1.0], 1.0).ends("v", &[0.0], 1.0);
        // Half a turn with the frequency 1, half a turn with the frequency 2.
        let kinked = "state x = 0; state v = 1; x' = v; v' = -2.5*x + 1.5*abs(x);";
        let kinked = Case::new(n, kinked, 1.5 * PI * n);
        let kinked = kinked.ends("x", &[0.0], 1.0).ends("v", &[1.0], 1.0);
        // One rounding of time for every period, and as many as the horizon has.
        let rounding = 16.0 * EPSILON * n;
        [smooth, kinked].into_iter().flat_map(move |case| {
            let case = case.rounds(rounding);
            [case.clone(), case.by("fesd").accurate_if(n <= 1000.0)]
        })
    };
    Family {
        name: "many periods",
        about: "x'' = -x, and x'' = -(5 x - 3 |x|)/2: n periods; closed form, to 16 roundings for each.",
        hardness: "periods n",
        cases: extent
            .sweep(&[10, 100], &[10, 100, 1000, 10_000, 100_000])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}

/// The same with a clock: what drifts is the time alone.
fn square_wave(extent: Extent) -> Family {
    let case = |n: u32| {
        let n = f64::from(n);
        let model = "state x = 0; x' = sign(sin(time));";
        // From the middle of a wave on the other side, x is back at π/2.
        let horizon = 2.0 * PI * n + 0.5 * PI;
        let case = Case::new(n, model, horizon).ends("x", &[0.5 * PI], PI);
        let case = case.switches(2 * n as usize).rounds(16.0 * EPSILON * n);
        case.accurate_if(n <= 1000.0).both()
    };
    Family {
        name: "a square wave",
        about: "x' = sign(sin t) for n periods; closed form, to 16 roundings for each.",
        hardness: "periods n",
        cases: extent
            .sweep(&[10, 100], &[10, 100, 1000, 10_000, 100_000])
            .into_iter()
            .flat_map(case)
            .collect(),
    }
}
