//! The present point of a run, with what rounding has taken from it.

use crate::fesd::system::Zero;
use crate::fesd::system::pointwise::Point;

/// Where a run is.
pub(crate) struct Place {
    pub t: f64,
    /// What rounding took from t: lost, it would be the same after every switch of a long run, a drift of phase.
    pub t_low: f64,
    pub x: Vec<f64>,
    /// What rounding took from x, so that sums over many elements stay exact.
    pub low: Vec<f64>,
    pub z: Vec<f64>,
    pub zeros: Vec<Zero>,
    /// The mode of `zeros`.
    pub mode: usize,
}

impl Place {
    /// Moves to an instant that is known.
    pub fn go_to(&mut self, t: f64) {
        (self.t, self.t_low) = (t, 0.0);
    }

    /// The time to an instant.
    pub fn left(&self, end: f64) -> f64 {
        (end - self.t) - self.t_low
    }

    /// The values of some algebraic variables.
    pub fn z_of(&self, variables: &[usize]) -> Vec<f64> {
        variables.iter().map(|&i| self.z[i]).collect()
    }

    /// The point, where these numbers hold.
    pub fn point<'p>(&'p self, numbers: &'p [f64]) -> Point<'p> {
        Point {
            t: self.t,
            x: &self.x,
            numbers,
        }
    }
}
