//! Sliding behind a fast filter: time constants of 1 and 1e-6, and a closed form.
//!
//! x' = z - s,   w' = -w + s,   z' = L (a sin t - z),   s ∈ sign(x)

#[path = "support/problem.rs"]
mod problem;
mod support;

use criterion::Criterion;
use nsd_tests::with_experiment;
use problem::Problem;
use serde_json::json;

/// L
const RATE: f64 = 1e6;

/// a
const AMPLITUDE: f64 = 1.5;

const HORIZON: f64 = 10.0;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let text = format!(
        "model filtered {{ \
           state x = 1; state w = 0; state z = 0; \
           switch s = sign(x); \
           x' = z - s; w' = -w + s; z' = {RATE:e}*({AMPLITUDE}*sin(time) - z); \
         }}\n\
         simulate bench of filtered {{ horizon {HORIZON}; }}"
    );
    with_experiment(&text, "bench", |compiled| {
        let problem = Problem {
            name: "stiff relay",
            compiled,
            exact: exact(HORIZON).to_vec(),
            errors: &[1e-4, 1e-6, 1e-8],
            script: "stiff.py",
            data: json!({ "rate": RATE, "amplitude": AMPLITUDE }),
        };
        problem.compare(&mut criterion);
    });
    criterion.final_summary();
}

/// z = a (L² sin t - L cos t + L e^(-L t))/(1 + L²)
fn z(t: f64) -> f64 {
    let factor = AMPLITUDE * RATE / (1.0 + RATE * RATE);
    factor * (RATE * t.sin() - t.cos() + (-RATE * t).exp())
}

/// ∫ z from 0
fn integral(t: f64) -> f64 {
    let factor = AMPLITUDE * RATE / (1.0 + RATE * RATE);
    factor * (RATE * (1.0 - t.cos()) - t.sin() + (1.0 - (-RATE * t).exp()) / RATE)
}

/// w of w' = -w + z without z's first moments, up to a multiple of e^-t.
fn followed(t: f64) -> f64 {
    let factor = AMPLITUDE * RATE / (1.0 + RATE * RATE);
    let (sine, cosine) = (factor * RATE, -factor);
    0.5 * ((sine + cosine) * t.sin() + (cosine - sine) * t.cos())
}

/// The final state: slips while |x| > 0, slides while |z| ≤ 1.
fn exact(end: f64) -> [f64; 3] {
    let (mut t, mut x, mut w, mut sign) = (0.0, 1.0, 0.0, 1.0_f64);
    loop {
        let (t0, x0, w0) = (t, x, w);
        let slips = |t: f64| x0 + integral(t) - integral(t0) - sign * (t - t0);
        let inside = |t: f64| {
            if sign == 0.0 {
                1.0 - z(t).abs()
            } else {
                sign * slips(t)
            }
        };
        let event = first_root(inside, t0, end);
        t = event.unwrap_or(end);
        let decay = (t0 - t).exp();
        w = if sign == 0.0 {
            followed(t) + (w0 - followed(t0)) * decay
        } else {
            sign + (w0 - sign) * decay
        };
        x = if sign == 0.0 { 0.0 } else { slips(t) };
        if event.is_none() {
            return [x, w, z(t)];
        }
        let slides = sign != 0.0 && z(t).abs() <= 1.0;
        sign = if slides { 0.0 } else { z(t).signum() };
        x = 0.0;
    }
}

/// Where a function that is positive just after `start` falls below zero.
fn first_root(f: impl Fn(f64) -> f64, start: f64, end: f64) -> Option<f64> {
    const STEP: f64 = 1e-4;
    let steps = ((end - start) / STEP).ceil() as usize;
    let at = |k: usize| (start + k as f64 * STEP).min(end);
    let k = (1..=steps).find(|&k| f(at(k)) < 0.0)?;
    let (mut low, mut high) = (at(k - 1), at(k));
    while high - low > f64::EPSILON * high {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if f(middle) < 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    Some(low)
}
