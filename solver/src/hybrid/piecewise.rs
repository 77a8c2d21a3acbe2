//! Functions of time that are made of polynomials, whose coefficients change from piece to piece.
//!
//! r = c_0 + s (c_1 + s (c_2 + s c_3)), s = t - q: the coefficients and q, where the piece begins, are numbers
//! that change at breakpoints.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// A function of time that is made of pieces, each a polynomial in t of the same degree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Piecewise {
    /// Where pieces begin, in order.
    starts: Vec<f64>,
    /// Their coefficients, one piece after another, constant terms first.
    coefficients: Vec<f64>,
}

/// A polynomial in `t - start`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece<'t> {
    /// Where it begins.
    pub start: f64,
    /// Where the next one begins; infinity for the last one.
    pub end: f64,
    /// Its coefficients, constant term first.
    pub coefficients: &'t [f64],
}

impl Piece<'_> {
    /// The value at `t`.
    pub fn value(&self, t: f64) -> f64 {
        let s = t - self.start;
        (self.coefficients.iter().rev()).fold(0.0, |sum, c| sum * s + c)
    }

    /// The coefficients around another instant.
    pub fn around(&self, t: f64) -> Vec<f64> {
        let (s, mut c) = (t - self.start, self.coefficients.to_vec());
        // Horner's scheme, again and again.
        for first in 0..c.len() {
            for k in (first + 1..c.len()).rev() {
                c[k - 1] += s * c[k];
            }
        }
        c
    }
}

impl Piecewise {
    /// Pieces that begin at increasing `starts`, at least one, with as many of the `coefficients` each.
    pub fn new(starts: Vec<f64>, coefficients: Vec<f64>) -> Self {
        assert!(
            !starts.is_empty() && coefficients.len().is_multiple_of(starts.len()),
            "every piece has as many coefficients"
        );
        Piecewise {
            starts,
            coefficients,
        }
    }

    /// Whether it is what [`Piecewise::new`] makes.
    pub(crate) fn is_sound(&self) -> bool {
        let is_ordered = self.starts.is_sorted_by(|a, b| a < b);
        let n = self.starts.len();
        n > 0 && is_ordered && self.coefficients.len().is_multiple_of(n)
    }

    /// Coefficients of every piece.
    pub fn n_coefficients(&self) -> usize {
        self.coefficients.len() / self.starts.len()
    }

    /// The piece that holds from `t` on; before the first one, that.
    pub fn piece(&self, t: f64) -> Piece<'_> {
        let after = self.starts.partition_point(|&start| start <= t);
        let k = after.max(1) - 1;
        let n = self.n_coefficients();
        Piece {
            start: self.starts[k],
            end: self.starts.get(k + 1).copied().unwrap_or(f64::INFINITY),
            coefficients: &self.coefficients[k * n..(k + 1) * n],
        }
    }

    /// Whether all coefficients are finite.
    pub fn is_finite(&self) -> bool {
        self.coefficients.iter().all(|c| c.is_finite())
    }
}

/// Writes for each of some data in turn where its piece that holds from `t` on begins, and its coefficients; the next
/// instant at which one of them changes, infinity where there is none.
pub fn write_pieces(data: &[Arc<Piecewise>], t: f64, coefficients: &mut [f64]) -> f64 {
    let mut places = coefficients.iter_mut();
    let mut until = f64::INFINITY;
    for data in data {
        let piece = data.piece(t);
        let numbers = std::iter::once(piece.start).chain(piece.coefficients.iter().copied());
        for (number, place) in numbers.zip(places.by_ref()) {
            *place = number;
        }
        until = until.min(piece.end);
    }
    until
}
