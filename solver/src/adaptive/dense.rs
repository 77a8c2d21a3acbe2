//! The polynomial of a step: derivatives in its middle, and values and slopes at its ends.
//!
//! In row j, differences of f around the middle give derivatives of the solution there,
//!
//! x^(κ) ≈ (n_j/2H)^(κ-1) Σ_q (-1)^q C(κ-1, q) f_{n/2 + κ-1 - 2q},
//!
//! with errors that are series in h². They are extrapolated over the rows with enough points, those
//! with n_j >= 2(κ-1). What is left of the values at the ends is taken up by four more powers (Hairer,
//! Nørsett & Wanner 1993, section II.9, dense output).

use super::extrapolation::{MOST_ROWS, substeps};
use crate::expansion::dense::ElementSeries;

/// Powers of the polynomial of a step, at most.
const MOST: usize = 2 * MOST_ROWS + 2;

/// What the rows of a step have around its middle.
pub struct Middle {
    n: usize,
    /// x in the middle, by row.
    states: Vec<Vec<f64>>,
    /// f at all points, by row.
    rates: Vec<Vec<f64>>,
}

impl Middle {
    pub fn new(n: usize) -> Self {
        let points = |row| substeps(row) + 1;
        Middle {
            n,
            states: vec![vec![0.0; n]; MOST_ROWS],
            rates: (1..=MOST_ROWS).map(|r| vec![0.0; n * points(r)]).collect(),
        }
    }

    /// x in the middle of a row.
    pub fn state_of(&mut self, row: usize) -> &mut [f64] {
        &mut self.states[row - 1]
    }

    /// f at the points of a row, one after the other.
    pub fn rates_of(&mut self, row: usize) -> &mut [f64] {
        &mut self.rates[row - 1]
    }

    /// Writes the polynomials in the time since the start of a step; `ends` are (x, f).
    pub fn interpolate(
        &self,
        length: f64,
        rows: usize,
        ends: [(&[f64], &[f64]); 2],
        n_switches: usize,
        series: &mut ElementSeries,
    ) {
        let last = (2 * rows).saturating_sub(3);
        let degree = last + 4;
        series.shape(self.n, n_switches, degree);
        for i in 0..self.n {
            // In powers of σ = τ/H - ½.
            let mut c = [0.0; MOST];
            for (power, c) in c.iter_mut().enumerate().take(last + 1) {
                *c = self.coefficient(i, power, rows, length);
            }
            let [(x0, f0), (x1, f1)] = ends;
            close(
                &mut c,
                last,
                [x0[i], x1[i]],
                [length * f0[i], length * f1[i]],
            );
            // In powers of τ/H, then of τ.
            for low in 0..degree {
                for k in (low..degree).rev() {
                    c[k] -= 0.5 * c[k + 1];
                }
            }
            let mut scale = 1.0;
            for (out, c) in series.row_mut(i).iter_mut().zip(c) {
                *out = c * scale;
                scale /= length;
            }
        }
    }

    /// H^κ x^(κ)/κ! of state i in the middle, extrapolated over the rows that have it.
    fn coefficient(&self, i: usize, power: usize, rows: usize, length: f64) -> f64 {
        let first = (power / 2).max(1);
        let mut table = [0.0; MOST_ROWS];
        for row in first..=rows {
            table[row - 1] = match power {
                0 => self.states[row - 1][i],
                _ => length * self.difference(i, power - 1, row) / factorial(power),
            };
            let own = (substeps(row) as f64).powi(2);
            for l in (first..row).rev() {
                let ratio = own / (substeps(l) as f64).powi(2);
                table[l - 1] = table[l] + (table[l] - table[l - 1]) / (ratio - 1.0);
            }
        }
        table[first - 1]
    }

    /// (n/2)^m Σ_q (-1)^q C(m, q) f_{n/2 + m - 2q}
    fn difference(&self, i: usize, order: usize, row: usize) -> f64 {
        let half = substeps(row) / 2;
        let mut binomial = 1.0;
        let mut sum = 0.0;
        for q in 0..=order {
            sum += binomial * self.rates[row - 1][(half + order - 2 * q) * self.n + i];
            binomial *= -((order - q) as f64) / (q + 1) as f64;
        }
        (half as f64).powi(order as i32) * sum
    }
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|k| k as f64).product()
}

/// Adds four powers above `last`, so that the values at σ = ∓½ are `x` and the slopes `slopes`.
fn close(c: &mut [f64; MOST], last: usize, x: [f64; 2], slopes: [f64; 2]) {
    // What the other powers leave, even and odd parts of the value and of the slope.
    let (mut even, mut odd) = (0.5 * (x[1] + x[0]), 0.5 * (x[1] - x[0]));
    let mut slope_of_even = 0.5 * (slopes[1] - slopes[0]);
    let mut slope_of_odd = 0.5 * (slopes[1] + slopes[0]);
    for (power, c) in c.iter().enumerate().take(last + 1) {
        let value = c * 0.5f64.powi(power as i32);
        let slope = 2.0 * power as f64 * value;
        match power % 2 {
            0 => (even, slope_of_even) = (even - value, slope_of_even - slope),
            _ => (odd, slope_of_odd) = (odd - value, slope_of_odd - slope),
        }
    }
    // a + b = value, 2 (p a + (p + 2) b) = slope for a = c_p/2^p, b = c_{p+2}/2^{p+2}.
    for p in [last + 1, last + 2] {
        let (value, slope) = match p % 2 {
            0 => (even, slope_of_even),
            _ => (odd, slope_of_odd),
        };
        let b = 0.5 * (0.5 * slope - p as f64 * value);
        let scale = 2f64.powi(p as i32);
        c[p] = (value - b) * scale;
        c[p + 2] = 4.0 * b * scale;
    }
}
