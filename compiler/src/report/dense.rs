//! The solution between the reported instants, as polynomials.

/// Pieces that follow each other in time; none when a method knows its points only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dense {
    /// The pieces.
    pub pieces: Vec<Piece>,
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
        let mut values = vec![0.0; self.n_rows()];
        self.read(time, &mut values);
        values
    }

    /// The same of the first rows, by Horner's scheme, in which no row waits for another.
    pub fn read(&self, time: f64, values: &mut [f64]) {
        let s = time - self.from;
        values.fill(0.0);
        for k in (0..self.n_coefficients).rev() {
            let terms = self
                .coefficients
                .iter()
                .skip(k)
                .step_by(self.n_coefficients);
            for (value, c) in values.iter_mut().zip(terms) {
                *value = *value * s + c;
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
    use super::{Dense, Piece};

    #[test]
    fn the_second_piece_holds_where_two_meet() {
        let piece = |from, to, coefficients: &[f64]| Piece {
            from,
            to,
            n_coefficients: 2,
            coefficients: coefficients.to_vec(),
        };
        let dense = Dense {
            pieces: vec![
                piece(0.0, 1.0, &[0.0, 1.0, 0.0, 0.0]),
                piece(1.0, 2.0, &[1.0, -1.0, 1.0, 0.0]),
            ],
        };
        assert_eq!(dense.verify(1), Ok(()));
        assert!(dense.verify(3).is_err());
        assert_eq!(dense.at(0.5), Some(vec![0.5, 0.0]));
        assert_eq!(dense.at(1.0), Some(vec![1.0, 1.0]));
        assert_eq!(dense.at(2.0), Some(vec![0.0, 1.0]));
        assert_eq!(dense.at(-1.0), None);
    }
}
