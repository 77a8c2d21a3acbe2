//! Functions of time from data, shared by every form after the syntax.
//!
//! r(t) = Σ_j c_kj (t - t_k)^j from row k on, of degree 0 for `hold`, 1 for `linear`, at most 3 for `cubic`.
//!
//! `hold` is continuous from the right and goes on after its last row; the others end there.

mod read;
mod source;
mod spline;
#[cfg(test)]
mod tests;

use std::fmt;
use std::sync::Arc;

use nsd_solver::hybrid::{Piece, Piecewise};

pub use read::Fault;
pub use source::{MAX_BYTES, Source, Sources};

/// What is between the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fit {
    /// The value of the last row.
    Hold,
    /// The straight line to the next row.
    Linear,
    /// The not-a-knot cubic spline.
    Cubic,
}

impl Fit {
    /// All of them, by their words.
    pub const ALL: [Fit; 3] = [Fit::Linear, Fit::Hold, Fit::Cubic];

    /// The word of the language.
    pub fn word(self) -> &'static str {
        match self {
            Fit::Hold => "hold",
            Fit::Linear => "linear",
            Fit::Cubic => "cubic",
        }
    }

    /// The rows it takes.
    pub fn n_rows(self) -> usize {
        match self {
            Fit::Hold => 1,
            Fit::Linear | Fit::Cubic => 2,
        }
    }

    /// Coefficients of a piece.
    fn n_coefficients(self) -> usize {
        match self {
            Fit::Hold => 1,
            Fit::Linear => 2,
            Fit::Cubic => 4,
        }
    }
}

impl fmt::Display for Fit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

/// A function of time that is made of pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// What is between the rows.
    pub fit: Fit,
    /// Rows of data.
    pub n_rows: usize,
    /// Times of the first and the last row.
    pub range: (f64, f64),
    /// The function.
    pub pieces: Arc<Piecewise>,
}

impl Table {
    /// The function through rows whose times increase; there are as many as the fit takes. What would be held, or a line,
    /// for no time is left out.
    pub fn new(fit: Fit, times: &[f64], values: &[f64]) -> Self {
        let n = times.len();
        let lasts = |&k: &usize| k + 1 == n || times[k] < times[k + 1];
        let (mut starts, coefficients) = match fit {
            Fit::Hold => {
                let mut kept: Vec<usize> = (0..n).filter(lasts).collect();
                kept.dedup_by(|k, last| values[*k] == values[*last]);
                let of = |list: &[f64]| kept.iter().map(|&k| list[k]).collect();
                (of(times), of(values))
            }
            Fit::Linear if times[n - 1] <= times[0] => (vec![times[0]], vec![values[n - 1], 0.0]),
            Fit::Linear => {
                let slope = |k: usize| (values[k + 1] - values[k]) / (times[k + 1] - times[k]);
                let lines = || (0..n - 1).filter(lasts);
                let pieces = lines().flat_map(|k| [values[k], slope(k)]);
                (lines().map(|k| times[k]).collect(), pieces.collect())
            }
            Fit::Cubic => (times[..n - 1].to_vec(), spline::coefficients(times, values)),
        };
        starts.shrink_to_fit();
        Table {
            fit,
            n_rows: n,
            range: (times[0], times[n - 1]),
            pieces: Arc::new(Piecewise::new(starts, coefficients)),
        }
    }

    /// Coefficients of every piece.
    pub fn n_coefficients(&self) -> usize {
        self.fit.n_coefficients()
    }

    /// The last instant at which it has a value.
    pub fn end(&self) -> f64 {
        match self.fit {
            Fit::Hold => f64::INFINITY,
            _ => self.range.1,
        }
    }

    /// The piece that holds from `t` on; beyond the data, the nearest one.
    pub fn piece(&self, t: f64) -> Piece<'_> {
        self.pieces.piece(t)
    }

    /// The value at `t`.
    pub fn value(&self, t: f64) -> f64 {
        self.piece(t).value(t)
    }

    /// The limit at `t` from before.
    pub fn before(&self, t: f64) -> f64 {
        self.piece(t.next_down()).value(t)
    }

    /// Whether it jumps at `t`.
    pub fn steps_at(&self, t: f64) -> bool {
        self.fit == Fit::Hold && self.before(t) != self.value(t)
    }
}

/// `linear: 12 rows on [0, 10]`
impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let rows = if self.n_rows == 1 { "row" } else { "rows" };
        let (first, last) = self.range;
        write!(f, "{} {rows} on [{first}, {last}]", self.n_rows)
    }
}
