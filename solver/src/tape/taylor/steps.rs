//! One operation on rows of Taylor coefficients, and its recurrence order by order.

use super::recurrence::{convolve, convolve_weighted, square};
use super::row::{Row, UNBOUNDED};
use crate::runtime::limit::work;
use crate::tape::elementary::Rate;
use crate::tape::{Elementary, Op};

/// Order 0 of all steps: the values themselves.
pub(crate) fn start_all(steps: &[Step], data: &mut [f64], stride: usize) {
    work::add(steps.len());
    for step in steps {
        start(step, data, stride);
    }
}

/// Order `k >= 1` of all steps, from what they read up to order `k` and everything of lower order.
pub(crate) fn advance_all(
    steps: &[Step],
    data: &mut [f64],
    weights: &[f64],
    k: usize,
    stride: usize,
) {
    work::add(steps.len() * (k + 1));
    for step in steps {
        if k > step.degree as usize {
            continue;
        }
        let (w, a, b) = (step.out + k, step.a + k, step.b + k);
        match step.kind {
            Kind::Constant => {}
            Kind::Neg | Kind::SubtractFrom => data[w] = -data[a],
            Kind::Scale => data[w] = step.c * data[a],
            Kind::Offset => data[w] = data[a],
            Kind::Add => data[w] = data[a] + data[b],
            Kind::Sub => data[w] = data[a] - data[b],
            Kind::AddScaled => data[w] = data[a] + step.c * data[b],
            // A factor or a divisor that is constant in time.
            Kind::Mul if step.short == 0 => data[w] = data[step.b] * data[a],
            Kind::Div if step.short == 0 => data[w] = data[a] / data[step.b],
            _ => advance(step, data, weights, k, stride),
        }
    }
}

/// An operation on rows; `out`, `a` and `b` are where they start.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    pub(crate) kind: Kind,
    pub(crate) out: usize,
    pub(crate) a: usize,
    pub(crate) b: usize,
    /// The number of an operation that has one; how many factors the result of a product has.
    pub(crate) c: f64,
    /// The result is a polynomial in time of this degree at most: higher orders stay zero.
    pub(crate) degree: u32,
    /// The same for the operand that is convolved with another one.
    pub(crate) short: u32,
}

/// [`Op`] without its operands. Rows behind `out` that a recurrence needs are named in brackets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
// One byte says which it is, whatever its function: all orders of all steps ask.
#[repr(u8)]
pub(crate) enum Kind {
    Constant,
    Neg,
    Scale,
    Offset,
    SubtractFrom,
    Add,
    Sub,
    AddScaled,
    Mul,
    Div,
    Recip,
    Square,
    Sqrt,
    Power,
    /// [log a, b log a]
    Pow,
    /// [q], of the error function [q, a²]
    Apply(Elementary),
    /// [cos a]
    SinCos,
    /// [cosh a]
    SinhCosh,
    /// [a² + b²]
    Atan2,
}

impl Step {
    pub(crate) fn new(kind: Kind, out: usize, [a, b]: [Row; 2], c: f64) -> Self {
        // The shorter factor comes second.
        let (a, b) = match kind {
            Kind::Mul if a.degree < b.degree => (b, a),
            _ => (a, b),
        };
        let short = match kind {
            Kind::Mul => a.degree.min(b.degree),
            Kind::Div => b.degree,
            _ => a.degree,
        };
        let (by_a, by_b) = (a.degree, b.degree);
        let degree = match kind {
            Kind::Constant => 0,
            Kind::Neg | Kind::Scale | Kind::Offset | Kind::SubtractFrom => by_a,
            Kind::Add | Kind::Sub | Kind::AddScaled => by_a.max(by_b),
            Kind::Mul => by_a.saturating_add(by_b),
            Kind::Square => by_a.saturating_mul(2),
            Kind::Div if by_b == 0 => by_a,
            Kind::Pow | Kind::Atan2 if by_a == 0 && by_b == 0 => 0,
            Kind::Div | Kind::Pow | Kind::Atan2 => UNBOUNDED,
            _ if by_a == 0 => 0,
            _ => UNBOUNDED,
        };
        Step {
            kind,
            out,
            a: a.start,
            b: b.start,
            c,
            degree,
            short,
        }
    }
}

/// The inverse of a larger number is nothing beside the smallest state that counts.
const BEYOND: f64 = 1e270;

/// Order 0: the values themselves.
pub(crate) fn start(step: &Step, data: &mut [f64], stride: usize) {
    let (done, open) = data.split_at_mut(step.out);
    let (a, b, c) = (done.get(step.a).copied(), done.get(step.b).copied(), step.c);
    // Operands that an operation does not have point to the first row, which need not exist.
    let (a, b) = (a.unwrap_or(0.0), b.unwrap_or(0.0));
    let w = &mut open[0];
    match step.kind {
        Kind::Constant => *w = c,
        Kind::Neg => *w = -a,
        Kind::Scale => *w = c * a,
        Kind::Offset => *w = c + a,
        Kind::SubtractFrom => *w = c - a,
        Kind::Add => *w = a + b,
        Kind::Sub => *w = a - b,
        Kind::AddScaled => *w = a + c * b,
        Kind::Mul => *w = a * b,
        Kind::Div => *w = a / b,
        Kind::Recip => *w = 1.0 / a,
        Kind::Square => *w = a * a,
        Kind::Sqrt => *w = a.sqrt(),
        Kind::Power => *w = a.powf(c),
        Kind::Pow => {
            *w = a.powf(b);
            open[stride] = a.ln();
            open[2 * stride] = b * open[stride];
        }
        Kind::Apply(f) => {
            *w = f.value()(a);
            if let Some(q) = f.rate().helper(a, *w) {
                open[stride] = q;
            }
            if f.rate() == Rate::Gauss {
                open[2 * stride] = a * a;
            }
        }
        Kind::SinCos => (open[0], open[stride]) = (a.sin(), a.cos()),
        Kind::SinhCosh => (open[0], open[stride]) = (a.sinh(), a.cosh()),
        Kind::Atan2 => (open[0], open[stride]) = (a.atan2(b), a * a + b * b),
    }
}

/// Order `k >= 1` of a step that is not linear.
pub(crate) fn advance(step: &Step, data: &mut [f64], weights: &[f64], k: usize, stride: usize) {
    let (done, open) = data.split_at_mut(step.out);
    let (w, helpers) = open.split_at_mut(stride);
    let (a, b, c) = (step.a, step.b, step.c);
    let order = k as f64;
    // A polynomial of degree d has only the coefficients 1..=d besides the first.
    let d = k.min(step.short as usize);
    let row = |start: usize| &done[start..=start + k];
    // Σ j a_j v_{k-j} over j = 1..=k, for a row v that is known below k.
    let chain = |v: &[f64]| match d {
        1 => done[a + 1] * v[k - 1],
        _ => convolve_weighted(&weights[1..=d], &done[a + 1..=a + d], &v[k - d..k]),
    };
    // Σ j w_j v_{k-j} over j = 1..k.
    let inner = |w: &[f64], v: &[f64]| convolve_weighted(&weights[1..k], &w[1..k], &v[1..k]);
    match step.kind {
        Kind::Constant | Kind::Neg | Kind::Scale | Kind::Offset | Kind::SubtractFrom => {}
        Kind::Add | Kind::Sub | Kind::AddScaled => {}
        // w_k = Σ a_j b_{k-j}; b is the shorter one.
        Kind::Mul => w[k] = convolve(&done[b..=b + d], &row(a)[k - d..]),
        // Nothing, however its divisor moves: what terms beyond the largest number leave is none.
        Kind::Recip if done[a].abs() > BEYOND => w[k] = 0.0,
        Kind::Div if done[b].abs() > BEYOND && w[0].abs() < 1.0 / BEYOND => w[k] = 0.0,
        // w b = a:  w_k = (a_k - Σ_{j=1..k} b_j w_{k-j}) / b_0
        Kind::Div => {
            w[k] = (done[a + k] - convolve(&done[b + 1..=b + d], &w[k - d..k])) / done[b];
        }
        Kind::Recip => w[k] = -convolve(&done[a + 1..=a + d], &w[k - d..k]) / done[a],
        Kind::Square => w[k] = square(row(a)),
        // w² = a
        Kind::Sqrt => w[k] = (done[a + k] - square(&w[1..k])) / (2.0 * w[0]),
        // a w' = c w a':  k a_0 w_k = Σ_{j=1..k} (c j - (k - j)) a_j w_{k-j}
        Kind::Power => {
            let plain = convolve(&done[a + 1..=a + d], &w[k - d..k]);
            w[k] = ((c + 1.0) * chain(w) / order - plain) / done[a];
        }
        // w = exp(b log a)
        Kind::Pow => {
            let (log, exponent) = helpers.split_at_mut(stride);
            let (base, power) = (row(a), row(b));
            log[k] = (base[k] - inner(log, base) / order) / base[0];
            exponent[k] = convolve(power, &log[..=k]);
            w[k] = convolve_weighted(&weights[1..=k], &exponent[1..=k], &w[..k]) / order;
        }
        Kind::Apply(f) => match f.rate() {
            Rate::Exponential => w[k] = chain(w) / order,
            Rate::Logarithm => w[k] = (done[a + k] - inner(w, row(a)) / order) / done[a],
            Rate::Riccati(s) => {
                w[k] = chain(helpers) / order;
                helpers[k] = s * square(&w[..=k]);
            }
            Rate::Rational(s) => {
                helpers[k] = s * square(row(a));
                w[k] = (done[a + k] - inner(w, helpers) / order) / helpers[0];
            }
            Rate::Root { s, r, .. } => {
                helpers[k] = (s * square(row(a)) - square(&helpers[1..k])) / (2.0 * helpers[0]);
                w[k] = (r * done[a + k] - inner(w, helpers) / order) / helpers[0];
            }
            // q' = -q (a²)'
            Rate::Gauss => {
                let (q, squares) = helpers.split_at_mut(stride);
                w[k] = chain(q) / order;
                squares[k] = square(row(a));
                q[k] = -convolve_weighted(&weights[1..=k], &squares[1..=k], &q[..k]) / order;
            }
        },
        // s' = c a',  c' = -s a'
        Kind::SinCos => (w[k], helpers[k]) = (chain(helpers) / order, -chain(w) / order),
        Kind::SinhCosh => (w[k], helpers[k]) = (chain(helpers) / order, chain(w) / order),
        // q w' = b a' - a b',  q = a² + b²
        Kind::Atan2 => {
            let (y, x) = (row(a), row(b));
            helpers[k] = square(y) + square(x);
            let turn = convolve_weighted(&weights[1..=k], &y[1..], &x[..k])
                - convolve_weighted(&weights[1..=k], &x[1..], &y[..k]);
            w[k] = (turn - inner(w, helpers)) / order / helpers[0];
        }
    }
}

impl Kind {
    pub(crate) fn is_product(self) -> bool {
        matches!(self, Self::Mul | Self::Square)
    }

    /// How many factors and divisors the terms of a result have at most, where those of the operands have so many.
    pub(crate) fn factors(self, [a, b]: [f64; 2]) -> f64 {
        match self {
            Self::Constant => 0.0,
            Self::Neg | Self::Scale | Self::Offset | Self::SubtractFrom | Self::Recip => a,
            Self::Add | Self::Sub | Self::AddScaled => f64::max(a, b),
            Self::Mul | Self::Div => a + b,
            Self::Square => 2.0 * a,
            _ => 1.0,
        }
    }

    pub(crate) fn of(op: Op) -> Self {
        match op {
            Op::Constant(_) => Self::Constant,
            Op::Neg(_) => Self::Neg,
            Op::Scale(..) => Self::Scale,
            Op::Offset(..) => Self::Offset,
            Op::SubtractFrom(..) => Self::SubtractFrom,
            Op::Add(..) => Self::Add,
            Op::Sub(..) => Self::Sub,
            Op::AddScaled(..) => Self::AddScaled,
            Op::Mul(..) => Self::Mul,
            Op::Div(..) => Self::Div,
            Op::Recip(_) => Self::Recip,
            Op::Square(_) => Self::Square,
            Op::Sqrt(_) => Self::Sqrt,
            Op::Power(..) => Self::Power,
            Op::Pow(..) => Self::Pow,
            Op::Apply(f, _) => Self::Apply(f),
            Op::SinCos(_) => Self::SinCos,
            Op::SinhCosh(_) => Self::SinhCosh,
            Op::Atan2(..) => Self::Atan2,
        }
    }

    /// How many rows follow the first one.
    pub(crate) fn n_helpers(self) -> usize {
        match self {
            Self::Pow => 2,
            Self::SinCos | Self::SinhCosh | Self::Atan2 => 1,
            Self::Apply(f) => match f.rate() {
                Rate::Exponential | Rate::Logarithm => 0,
                Rate::Riccati(_) | Rate::Rational(_) | Rate::Root { .. } => 1,
                Rate::Gauss => 2,
            },
            _ => 0,
        }
    }
}
