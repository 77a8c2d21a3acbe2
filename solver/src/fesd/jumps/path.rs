//! The polynomials of states and α along a run.

use crate::event::Segment;
use crate::expansion::{Polynomials, series};
use crate::hybrid::Outcome;

/// Pieces that follow each other in time.
#[derive(Clone, Debug, Default)]
pub(crate) struct Path {
    pieces: Vec<Piece>,
}

/// Polynomials in t - `from` that hold from `from` to `to`.
#[derive(Clone, Debug)]
pub struct Piece {
    /// First instant.
    pub from: f64,
    /// Last instant.
    pub to: f64,
    /// How many states there are.
    pub n_states: usize,
    /// How many coefficients there are of each, constant term first.
    pub n_coefficients: usize,
    /// Those of all states, then those of all α.
    pub coefficients: Vec<f64>,
}

impl Path {
    /// Adds a step.
    pub fn push(&mut self, segment: &Segment) {
        let mut coefficients = Vec::new();
        segment.write(&mut coefficients);
        let from = self
            .pieces
            .last()
            .map_or(segment.start, |last| segment.start.max(last.to));
        self.pieces.push(Piece {
            from,
            to: segment.until,
            n_states: segment.end.len(),
            n_coefficients: segment.order() + 1,
            coefficients,
        });
    }

    /// Adds the last instant of a run, behind what jumps in it.
    pub fn end_at(&mut self, outcome: &Outcome) {
        if let Some(to) = self.pieces.last().map(|piece| piece.to) {
            self.pieces.push(Piece {
                from: to,
                to,
                n_states: outcome.x.len(),
                n_coefficients: 1,
                coefficients: [&outcome.x[..], &outcome.alpha].concat(),
            });
        }
    }

    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    pub fn pieces(&self) -> impl Iterator<Item = &Piece> {
        self.pieces.iter()
    }

    /// The piece that holds at an instant; where two meet, the second.
    pub fn around(&self, time: f64) -> Option<&Piece> {
        let after = self.pieces.partition_point(|piece| piece.from <= time);
        let piece = &self.pieces[after.checked_sub(1)?];
        (time <= piece.to).then_some(piece)
    }
}

impl Piece {
    /// All rows at an instant.
    pub(crate) fn at(&self, time: f64) -> Vec<f64> {
        let rows = self.coefficients.chunks_exact(self.n_coefficients);
        rows.map(|row| series::value(row, time - self.from))
            .collect()
    }

    fn row(&self, at: usize) -> &[f64] {
        &self.coefficients[at * self.n_coefficients..][..self.n_coefficients]
    }
}

impl Polynomials for Piece {
    fn degree(&self) -> usize {
        self.n_coefficients - 1
    }

    fn x(&self, i: usize) -> &[f64] {
        self.row(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        self.row(self.n_states + switch)
    }
}
