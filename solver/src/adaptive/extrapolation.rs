//! A step of the modified midpoint rule, extrapolated to step size zero.
//!
//! Row j makes n_j substeps of length h = H/n_j:
//!
//! y₁ = x + h f(x),   y_{i+1} = y_{i-1} + 2h f(y_i),   T_{j,1} = ½ (y_n + y_{n-1} + h f(y_n))
//!
//! The error of T_{j,1} is a series in h², so that
//!
//! T_{j,k+1} = T_{j,k} + (T_{j,k} - T_{j-1,k}) / ((n_j/n_{j-k})² - 1)
//!
//! has order 2k + 2. The numbers of substeps are 4, 8, 12, ..: the middle of the step is an even point in
//! each of them, where derivatives of the solution have such series too. (With 2, 6, 10, .. it would be
//! odd in each, but where f has one value before a quarter of a step and another behind, all rows agree
//! on the same wrong result.)
//!
//! All y are differences from x at the start of the step, with what rounding has kept out of x: far from zero, a step
//! moves x by less than its last digits. T_{9,9} is a sum of T_{j,1} with factors up to 100, and so are the errors of
//! rounding: the sums keep what rounding takes from them (Kahan 1965), and so does T (section II.9, round-off).

mod compensated;

use self::compensated::{Compensated, Leapfrog};
use super::dense::Middle;
use super::{DEFECTS, Field, LEAST_SCALE, Measure};
use crate::expansion::dense::ElementSeries;
use crate::expansion::series;

/// Rows of a step: order 18.
pub const MOST_ROWS: usize = 9;

/// n_j, from row 1 on.
pub fn substeps(row: usize) -> usize {
    4 * row
}

/// The rows of a step, and memory for them.
pub struct Extrapolation {
    n: usize,
    length: f64,
    rows: usize,
    /// x and f(x) at the start of the step, and what rounding has kept out of x.
    start: Vec<f64>,
    rates: Vec<f64>,
    low: Vec<f64>,
    /// Behind the j-th row, T_{j,j-l} in place l, without x at the start.
    table: Vec<Compensated>,
    /// x and f at the end of the step, and the sizes that errors of states are relative to.
    end: Vec<f64>,
    sizes: Vec<f64>,
    end_rates: Vec<f64>,
    /// y_{i-1} and y_i.
    substeps: Leapfrog,
    middle: Middle,
}

impl Extrapolation {
    /// Memory for n states.
    pub fn new(n: usize) -> Self {
        Extrapolation {
            n,
            length: 0.0,
            rows: 0,
            start: vec![0.0; n],
            rates: vec![0.0; n],
            low: vec![0.0; n],
            table: vec![Compensated::new(n); MOST_ROWS],
            end: vec![0.0; n],
            sizes: vec![0.0; n],
            end_rates: vec![0.0; n],
            substeps: Leapfrog::new(n),
            middle: Middle::new(n),
        }
    }

    /// Forgets the step before.
    pub fn begin(&mut self, length: f64, x: &[f64], rates: &[f64]) {
        (self.length, self.rows) = (length, 0);
        self.start.copy_from_slice(x);
        self.rates.copy_from_slice(rates);
    }

    /// Computes the next row, and gives its number, from 1 on.
    pub fn add_row(&mut self, field: &mut impl Field, t: f64) -> usize {
        self.rows += 1;
        let (row, n) = (self.rows, self.n);
        let steps = substeps(row);
        let h = self.length / steps as f64;
        let rates = self.middle.rates_of(row);
        rates[..n].copy_from_slice(&self.rates);
        self.substeps.begin(&self.low, h, &self.rates);
        for step in 1..=steps {
            let rates = &mut self.middle.rates_of(row)[step * n..(step + 1) * n];
            add(&mut self.end, &self.start, &self.substeps.here.high);
            field.rates(t + step as f64 * h, &self.end, rates);
            if step < steps {
                self.substeps.advance(2.0 * h, rates);
            } else {
                self.substeps.smooth(h, rates, &mut self.table[row - 1]);
            }
            // The middle is what has just been left behind.
            if step == steps / 2 {
                let middle = self.middle.state_of(row);
                middle.copy_from_slice(&self.substeps.before.high);
            }
        }
        for l in (0..row - 1).rev() {
            let ratio = steps as f64 / substeps(l + 1) as f64;
            let factor = 1.0 / (ratio * ratio - 1.0);
            let (left, right) = self.table.split_at_mut(l + 1);
            left[l].extrapolate(&right[0], factor);
        }
        row
    }

    /// x at the end of a step that has been closed.
    pub fn state(&self) -> &[f64] {
        &self.end
    }

    /// Forgets what rounding has kept out of x.
    pub fn restart(&mut self) {
        self.low.fill(0.0);
    }

    /// Moves on to the end of the step, and keeps what rounding keeps out of it.
    pub fn advance(&mut self) {
        let moved = &self.table[0];
        for i in 0..self.n {
            self.low[i] = (moved.high[i] - (self.end[i] - self.start[i])) + moved.low[i];
        }
    }

    /// Largest |T_{j,j} - T_{j,j-1}| of a state, relative to the tolerance and the size of that state: the largest |x| so
    /// far, or how far its rate takes it in the time `reach` where it has been zero so far.
    pub fn error(&mut self, measure: &Measure) -> f64 {
        if self.rows < 2 {
            return f64::INFINITY;
        }
        add(&mut self.end, &self.start, &self.table[0].high);
        let last = substeps(self.rows) * self.n;
        let last = &self.middle.rates_of(self.rows)[last..];
        for (i, size) in self.sizes.iter_mut().enumerate() {
            let moves = match measure.scale[i] <= LEAST_SCALE {
                true => measure.reach * self.rates[i].abs().max(last[i].abs()),
                false => 0.0,
            };
            *size = measure.scale[i].max(self.end[i].abs()).max(moves);
        }
        let [last, other] = [0, 1].map(|l| self.table[l].high.iter());
        let entries = last.zip(other).zip(&self.sizes);
        entries.fold(0.0, |most, ((x, other), size)| {
            larger(most, (x - other).abs() / (measure.tolerance * size))
        })
    }

    /// Evaluations of f for the rows so far: Σ n_j.
    pub fn evaluations(&self) -> usize {
        (1..=self.rows).map(substeps).sum()
    }

    /// Computes f at the end of the step, and its polynomials.
    pub fn close(
        &mut self,
        field: &mut impl Field,
        end: f64,
        n_switches: usize,
        series: &mut ElementSeries,
    ) {
        field.rates(end, &self.end, &mut self.end_rates);
        let ends = [
            (&self.low[..], &self.rates[..]),
            (&self.table[0].high[..], &self.end_rates[..]),
        ];
        let (length, rows) = (self.length, self.rows);
        self.middle
            .interpolate(length, rows, ends, n_switches, series);
        for (i, start) in self.start.iter().enumerate() {
            series.row_mut(i)[0] += start;
        }
    }

    /// f at the end of the step.
    pub fn end_rates(&self) -> &[f64] {
        &self.end_rates
    }

    /// Largest |x' - f(t, x)| H of the polynomials, relative to the size of each state.
    pub fn defect(&mut self, field: &mut impl Field, t: f64, polynomials: &ElementSeries) -> f64 {
        let mut most = 0.0;
        for share in DEFECTS {
            let tau = share * self.length;
            for (i, x) in self.substeps.before.high.iter_mut().enumerate() {
                *x = series::value(polynomials.row(i), tau);
            }
            let (x, rates) = (&self.substeps.before.high, &mut self.substeps.here.high);
            field.rates(t + tau, x, rates);
            for (i, (size, rate)) in self.sizes.iter().zip(&*rates).enumerate() {
                let slope = series::slope(polynomials.row(i), tau);
                most = larger(most, (slope - rate).abs() * self.length / size);
            }
        }
        most
    }
}

/// sum = a + b.
fn add(sum: &mut [f64], a: &[f64], b: &[f64]) {
    for (sum, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
        *sum = a + b;
    }
}

/// The larger one; what is no number is larger than all.
fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}
