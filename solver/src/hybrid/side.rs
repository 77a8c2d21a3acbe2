//! Sides of a switch.

use serde::{Deserialize, Serialize};
use smallvec::SmallVec;

/// A list that is short as a rule, as of the switches that meet at an event: so few entries take no memory of their own.
pub(crate) type Few<T> = SmallVec<[T; 8]>;

/// Where a switch stands relative to its surface ψ = 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum Side {
    /// ψ < 0, α = 0.
    Minus,
    /// ψ = 0 and stays so; α is what keeps it there.
    Slide,
    /// ψ > 0, α = 1.
    Plus,
}

impl Side {
    /// -1, 0 or 1.
    pub fn sign(self) -> f64 {
        match self {
            Side::Minus => -1.0,
            Side::Slide => 0.0,
            Side::Plus => 1.0,
        }
    }

    /// The side of a value of ψ; zero belongs to `Plus`.
    pub fn of(value: f64) -> Side {
        if value < 0.0 { Side::Minus } else { Side::Plus }
    }
}
