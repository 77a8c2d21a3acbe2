//! The solution between the reported instants, as polynomials.

use std::sync::Arc;

/// Instants at which a polynomial is evaluated at once.
const LANES: usize = 8;

/// Pieces that follow each other in time; none when a method knows its points only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dense {
    /// The pieces, from which rows are made, too.
    pub pieces: Arc<Vec<Piece>>,
}

/// Polynomials in `t - from` that hold from `from` to `to`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// First instant.
    pub from: f64,
    /// Last instant.
    pub to: f64,
    /// Coefficients per row, constant term first.
    pub n_coefficients: usize,
    /// One row per state entry, one per switch with its value α in [0, 1], one per function from data.
    pub coefficients: Vec<f64>,
}

impl Piece {
    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.coefficients
            .len()
            .checked_div(self.n_coefficients)
            .unwrap_or(0)
    }

    /// Values of all rows at `time`.
    pub fn at(&self, time: f64) -> Vec<f64> {
        let mut values = Vec::new();
        self.read(&[time], self.n_rows(), &mut values);
        values
    }

    /// Adds the values of the first rows at some instants, instant by instant. Horner's scheme takes several instants at
    /// once, none of which waits for another.
    pub fn read(&self, times: &[f64], n_rows: usize, values: &mut Vec<f64>) {
        for times in times.chunks(LANES) {
            let mut s = [0.0; LANES];
            for (s, time) in s.iter_mut().zip(times) {
                *s = time - self.from;
            }
            let first = values.len();
            values.resize(first + n_rows * times.len(), 0.0);
            let rows = self.coefficients.chunks(self.n_coefficients.max(1));
            for (at, row) in rows.take(n_rows).enumerate() {
                let mut sums = [0.0; LANES];
                for c in row.iter().rev() {
                    for (sum, s) in sums.iter_mut().zip(&s) {
                        *sum = *sum * s + c;
                    }
                }
                for (k, sum) in sums.iter().take(times.len()).enumerate() {
                    values[first + k * n_rows + at] = *sum;
                }
            }
        }
    }
}

impl Dense {
    /// Values of all rows at `time`; where two pieces meet, those of the second.
    pub fn at(&self, time: f64) -> Option<Vec<f64>> {
        let after = self.pieces.partition_point(|piece| piece.from <= time);
        let piece = self.pieces.get(after.checked_sub(1)?)?;
        Some(piece.at(time))
    }

    pub(super) fn verify(&self, n_switches: usize) -> Result<(), String> {
        let n_rows = self.pieces.first().map_or(n_switches, Piece::n_rows);
        if n_rows < n_switches || self.pieces.iter().any(|piece| piece.n_rows() != n_rows) {
            return Err("a piece does not have a row per state and switch".into());
        }
        if self.pieces.windows(2).any(|pair| pair[1].from < pair[0].to) {
            return Err("pieces overlap".into());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Arc, Dense, Piece};

    #[test]
    fn the_second_piece_holds_where_two_meet() {
        let piece = |from, to, coefficients: &[f64]| Piece {
            from,
            to,
            n_coefficients: 2,
            coefficients: coefficients.to_vec(),
        };
        let dense = Dense {
            pieces: Arc::new(vec![
                piece(0.0, 1.0, &[0.0, 1.0, 0.0, 0.0]),
                piece(1.0, 2.0, &[1.0, -1.0, 1.0, 0.0]),
            ]),
        };
        assert_eq!(dense.verify(1), Ok(()));
        assert!(dense.verify(3).is_err());
        assert_eq!(dense.at(0.5), Some(vec![0.5, 0.0]));
        assert_eq!(dense.at(1.0), Some(vec![1.0, 1.0]));
        assert_eq!(dense.at(2.0), Some(vec![0.0, 1.0]));
        assert_eq!(dense.at(-1.0), None);
    }
}
