//! What the rows of a run follow from: its points, and its polynomials between them.

use std::sync::Arc;

use crate::report::{self, Piece, Samples};
use crate::simulate::record::points::{Points, See, tidy};
use crate::simulate::record::reported::{Given, Reported};

/// Points of a run, polynomials with rows inside, and what rows show.
#[derive(Debug)]
pub(super) struct Course {
    pub points: Points,
    pub pieces: Arc<Vec<Piece>>,
    pub reported: Arc<Reported>,
    pub given: Given,
}

impl Course {
    /// Whether α inside of steps follow from their polynomials, without a look at a surface.
    pub fn is_whole(&self) -> bool {
        let [n, m] = self.reported.sizes();
        self.pieces.iter().all(|piece| {
            let alphas = &piece.coefficients[n * piece.n_coefficients..];
            let alphas = alphas.iter().take(m * piece.n_coefficients);
            alphas.copied().all(f64::is_finite)
        })
    }

    /// All rows, where `see` puts α that are not known.
    pub fn seen(&self, see: &See<'_>) -> Samples {
        let (reported, given) = (&self.reported, &self.given);
        match self.points.spread(reported.sizes(), &self.pieces, see) {
            None => reported.at(&self.points, given),
            Some((points, rows)) => {
                let mut samples = reported.at(&points, given);
                tidy(&mut samples, &rows);
                samples
            }
        }
    }
}

impl report::Course for Course {
    fn rows(&self) -> Samples {
        self.seen(&|_, _, _| {})
    }

    fn end(&self) -> Option<Samples> {
        // Whether the row behind the last point is one depends on all others.
        let is_point = !self.points.goes_on_at_end();
        let last = || self.points.last(self.reported.sizes());
        is_point.then(|| self.reported.at(&last(), &self.given))
    }
}
