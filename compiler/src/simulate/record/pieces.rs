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
    let mut coefficients = Vec::new();
    segment.write(&mut coefficients);
    let of_segment = Piece {
        from: segment.start,
        to: end,
        n_coefficients: segment.order() + 1,
        coefficients,
    };
    with_data(of_segment, data)
}

/// The same polynomials and those of data behind them, all of one degree, which may be that of data.
pub(crate) fn with_data(piece: Piece, data: &[Data]) -> Piece {
    if data.is_empty() {
        return piece;
    }
    let middle = 0.5 * (piece.from + piece.to);
    let around = |data: &Data| data.table.piece(middle).around(piece.from);
    let known: Vec<Vec<f64>> = data.iter().map(around).collect();
    let most = known.iter().map(Vec::len).max();
    let n_coefficients = most.unwrap_or(0).max(piece.n_coefficients);
    let rows = piece.coefficients.chunks(piece.n_coefficients);
    let rows = rows.chain(known.iter().map(Vec::as_slice));
    let mut coefficients = Vec::with_capacity(rows.size_hint().0 * n_coefficients);
    for (i, row) in rows.enumerate() {
        coefficients.extend_from_slice(row);
        coefficients.resize((i + 1) * n_coefficients, 0.0);
    }
    Piece {
        n_coefficients,
        coefficients,
        ..piece
    }
}
