//! All orders of a step at once, where its operands are known up to the last one.
//!
//! Sums over orders turn into sums of rows, which several orders take part in at a time.

use super::steps::{Kind, Step, advance, start};
use crate::runtime::limit::work;

/// The orders below `n` of all steps, from operands that are known that far.
pub(crate) fn fill_all(steps: &[Step], data: &mut [f64], weights: &[f64], n: usize, stride: usize) {
    work::add(steps.len() * n * n / 2);
    for step in steps {
        start(step, data, stride);
        let last = (n - 1).min(step.degree as usize);
        if last > 0 {
            fill(step, data, weights, last, stride);
        }
    }
}

/// The orders from 1 to `last`.
fn fill(step: &Step, data: &mut [f64], weights: &[f64], last: usize, stride: usize) {
    let (done, open) = data.split_at_mut(step.out);
    let (w, helpers) = open.split_at_mut(stride);
    let row = |start: usize| &done[start..=start + last];
    let (a, b, c) = (step.a, step.b, step.c);
    match step.kind {
        Kind::Constant => {}
        Kind::Neg | Kind::SubtractFrom => unary(w, row(a), |a| -a),
        Kind::Scale => unary(w, row(a), |a| c * a),
        Kind::Offset => unary(w, row(a), |a| a),
        Kind::Add => binary(w, row(a), row(b), |a, b| a + b),
        Kind::Sub => binary(w, row(a), row(b), |a, b| a - b),
        Kind::AddScaled => binary(w, row(a), row(b), |a, b| a + c * b),
        Kind::Mul => {
            let shorter = &done[b..=b + last.min(step.short as usize)];
            multiply(&mut w[..=last], row(a), shorter);
        }
        Kind::Square => square(&mut w[..=last], row(a)),
        // s' = c a',  c' = -s a',  where a' is a number
        Kind::SinCos if step.short == 1 => {
            for k in 1..=last {
                let rate = done[a + 1] / k as f64;
                (w[k], helpers[k]) = (rate * helpers[k - 1], -(rate * w[k - 1]));
            }
        }
        _ => (1..=last).for_each(|k| advance(step, data, weights, k, stride)),
    }
}

fn unary(w: &mut [f64], a: &[f64], f: impl Fn(f64) -> f64) {
    for (w, &a) in w.iter_mut().zip(a).skip(1) {
        *w = f(a);
    }
}

fn binary(w: &mut [f64], a: &[f64], b: &[f64], f: impl Fn(f64, f64) -> f64) {
    for ((w, &a), &b) in w.iter_mut().zip(a).zip(b).skip(1) {
        *w = f(a, b);
    }
}

/// w_k = Σ_j b_j a_{k-j}; higher orders of b vanish.
fn multiply(w: &mut [f64], a: &[f64], b: &[f64]) {
    for (w, a) in w.iter_mut().zip(a) {
        *w = b[0] * a;
    }
    for (j, b) in b.iter().enumerate().skip(1) {
        for (w, a) in w[j..].iter_mut().zip(a) {
            *w += b * a;
        }
    }
}

/// w_k = Σ_j a_j a_{k-j}, where products of two different orders occur twice.
fn square(w: &mut [f64], a: &[f64]) {
    w[1..].fill(0.0);
    let n = w.len();
    for j in 0..n.div_ceil(2) {
        if j > 0 {
            w[2 * j] += a[j] * a[j];
        }
        let twice = 2.0 * a[j];
        for (w, a) in w[2 * j + 1..].iter_mut().zip(&a[j + 1..]) {
            *w += twice * a;
        }
    }
}
