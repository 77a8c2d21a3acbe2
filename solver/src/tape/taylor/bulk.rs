//! All orders of a step at once, where its operands are known up to the last one.
//!
//! Sums over orders turn into sums of rows, which several orders take part in at a time.

use wide::f64x4;

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

/// How many orders of a product are summed side by side.
const LANES: usize = 4;

/// `c` times the coefficients of a row from one on, for as many orders.
fn lanes(a: &[f64], from: usize, c: f64) -> f64x4 {
    let row: [f64; LANES] = a[from..from + LANES].try_into().expect("it has so many");
    f64x4::splat(c) * f64x4::from(row)
}

/// w_k = Σ_j b_j a_{k-j}; higher orders of b vanish.
fn multiply(w: &mut [f64], a: &[f64], b: &[f64]) {
    let whole = w.len() / LANES * LANES;
    for k in (0..whole).step_by(LANES) {
        let all = b.len().min(k + 1);
        let first = lanes(a, k, b[0]);
        let sums = (1..all).fold(first, |sums, j| sums + lanes(a, k - j, b[j]));
        w[k..k + LANES].copy_from_slice(sums.as_array());
    }
    // Orders in which not all have a part, and those left over.
    for j in 1..b.len() {
        let k = j.next_multiple_of(LANES).min(whole);
        for at in j..k {
            w[at] += b[j] * a[at - j];
        }
    }
    for k in whole..w.len() {
        w[k] = b[0] * a[k];
        for j in 1..b.len().min(k + 1) {
            w[k] += b[j] * a[k - j];
        }
    }
}

/// w_k = Σ_j a_j a_{k-j}, where products of two different orders occur twice.
fn square(w: &mut [f64], a: &[f64]) {
    let whole = w.len() / LANES * LANES;
    for k in (0..whole).step_by(LANES) {
        // All of these orders have such products, the middle ones only some.
        let middle = k / 2;
        let zero = f64x4::splat(0.0);
        let sums = (0..middle).fold(zero, |sums, j| sums + lanes(a, k - j, 2.0 * a[j]));
        let mut sums = sums.to_array();
        if k == 0 {
            sums[0] = w[0];
        } else {
            sums[0] += a[middle] * a[middle];
        }
        for (above, sum) in sums.iter_mut().enumerate().skip(1) {
            *sum += 2.0 * a[middle] * a[middle + above];
        }
        sums[2] += a[middle + 1] * a[middle + 1];
        sums[3] += 2.0 * a[middle + 1] * a[middle + 2];
        w[k..k + LANES].copy_from_slice(&sums);
    }
    for k in whole.max(1)..w.len() {
        let pairs = (0..k.div_ceil(2)).fold(0.0, |sum, j| sum + 2.0 * a[j] * a[k - j]);
        w[k] = match k % 2 {
            0 => pairs + a[k / 2] * a[k / 2],
            _ => pairs,
        };
    }
}
