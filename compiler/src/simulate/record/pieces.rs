//! The polynomials of a recorded run, piece by piece.

use nsd_solver::event::Segment;

use crate::model::Data;
use crate::report::Piece;

/// The first instant of a run before what jumps in it, or the last one behind it, with x and α.
pub(crate) fn of_instant(time: f64, [x, alpha]: [&[f64]; 2], data: &[Data]) -> Piece {
    let data = data.iter().map(|data| data.table.value(time));
    let rows = x.iter().chain(alpha).copied();
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
    let mut coefficients = Vec::new();
    segment.write(&mut coefficients);
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
