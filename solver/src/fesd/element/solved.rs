//! The unknowns of a solved element, and its end with compensated sums.

use crate::integrate::two_sum::two_sum;

/// An element that is solved.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solved {
    /// t₀, and what rounding took from it.
    pub t: f64,
    pub t_low: f64,
    pub h: f64,
    /// x₀, and what rounding took from it.
    pub x: Vec<f64>,
    pub low: Vec<f64>,
    pub unknowns: Vec<f64>,
    pub mean: Vec<f64>,
    /// α of the sliding switches at the points of the scheme, one row each.
    pub alphas: Vec<f64>,
    /// w at the end.
    pub w: Vec<f64>,
}

impl Solved {
    /// t₀ + h, and what rounding takes from it.
    pub fn stop(&self) -> (f64, f64) {
        two_sum(self.t, self.h + self.t_low)
    }

    /// x₀ + h Σ b_j V_j, added up with what rounding takes.
    pub fn end(&self, x: &mut [f64], low: &mut [f64]) {
        for i in 0..x.len() {
            (x[i], low[i]) = two_sum(self.x[i], self.h * self.mean[i] + self.low[i]);
        }
    }
}
