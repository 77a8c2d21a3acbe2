//! The polynomials of a recorded run, piece by piece.

use nsd_solver::event::Segment;
use nsd_solver::hybrid::Outcome;

use crate::model::Data;
use crate::report::Piece;

/// The last instant of a run, behind what jumps in it.
pub(crate) fn of_instant(time: f64, outcome: &Outcome, data: &[Data]) -> Piece {
    let data = data.iter().map(|data| data.table.value(time));
    let rows = outcome.x.iter().chain(&outcome.alpha).copied();
    Piece {
        from: time,
        to: time,
        n_coefficients: 1,
        coefficients: rows.chain(data).collect(),
    }
}

/// The segment's polynomials: states, then α of every switch, then data.
pub(crate) fn of_segment(segment: &Segment, end: f64, data: &[Data]) -> Piece {
    let n_coefficients = segment.order() + 1;
    let n_series = segment.end.len() + segment.sides.len() + data.len();
    let mut coefficients = Vec::with_capacity(n_series * n_coefficients);
    for i in 0..segment.end.len() {
        coefficients.extend_from_slice(segment.state_series(i));
    }
    for i in 0..segment.sides.len() {
        let is_known = !segment.unobserved().contains(&i);
        match segment.alpha_series(i) {
            None if !is_known => {
                coefficients.resize(coefficients.len() + n_coefficients, f64::NAN);
            }
            Some(series) => coefficients.extend_from_slice(series),
            None => {
                coefficients.push(0.5 + 0.5 * segment.sides[i].sign());
                coefficients.resize(coefficients.len() + n_coefficients - 1, 0.0);
            }
        }
    }
    for data in data {
        let known = data.table.piece(segment.start).around(segment.start);
        let rest = n_coefficients - known.len();
        coefficients.extend(known);
        coefficients.resize(coefficients.len() + rest, 0.0);
    }
    Piece {
        from: segment.start,
        to: end,
        n_coefficients,
        coefficients,
    }
}
