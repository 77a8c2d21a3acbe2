//! What rounding of states does to a run.
//!
//! f is asked at states that are rounded to ε |x|. A step of length H makes H (f(t, x + δ) - f(t, x)) of that, |δ| = ε |x|,
//! here with signs that change from step to step; those of all steps are independent.

use super::Field;

/// The sums of squares, and memory for a point.
pub struct Rounding {
    x: Vec<f64>,
    rates: Vec<f64>,
    squares: Vec<f64>,
}

impl Rounding {
    /// Of n states.
    pub fn new(n: usize) -> Self {
        Rounding {
            x: vec![0.0; n],
            rates: vec![0.0; n],
            squares: vec![0.0; n],
        }
    }

    /// Adds the `step`-th step, which ends at (t, x) with these rates.
    pub fn add(
        &mut self,
        field: &mut impl Field,
        step: usize,
        (t, x): (f64, &[f64]),
        rates: &[f64],
        length: f64,
    ) {
        for (i, (displaced, x)) in self.x.iter_mut().zip(x).enumerate() {
            let sign = 1.0 - 2.0 * ((step >> (i % 8)) & 1) as f64;
            *displaced = x + sign * f64::EPSILON * x.abs();
        }
        field.rates(t, &self.x, &mut self.rates);
        let rates = self.rates.iter().zip(rates);
        for (square, (displaced, rate)) in self.squares.iter_mut().zip(rates) {
            let moved = length * (displaced - rate);
            if moved.is_finite() {
                *square += moved * moved;
            }
        }
    }

    /// What it may have moved each state by.
    pub fn moved(self) -> Vec<f64> {
        self.squares.into_iter().map(f64::sqrt).collect()
    }
}
