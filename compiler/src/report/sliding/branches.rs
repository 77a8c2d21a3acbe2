//! The sliding modes of a nonlinear switch along a line on its surface.

use crate::report::SlidingMode;

/// The sliding modes at one value of the state.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The value.
    pub at: f64,
    /// Ascending; none where the surface is not met.
    pub modes: Option<Vec<SlidingMode>>,
}

/// What begins or ends where the modes change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Two modes meet.
    Fold,
    /// A mode has the value of a side.
    Bound,
    /// Something else: several at once, or the end of the surface.
    Other,
}

/// Where the modes change.
#[derive(Clone, Copy, Debug)]
pub struct Boundary {
    /// The value of the state.
    pub at: f64,
    /// What happens there.
    pub change: Change,
    /// The value of the switch; none for other changes.
    pub value: Option<f64>,
}

/// The modes along a line.
#[derive(Clone, Debug)]
pub struct Map {
    /// Name of the switch.
    pub switch: String,
    /// Its values on both sides.
    pub sides: [f64; 2],
    /// Name of the state.
    pub state: String,
    /// The grid, refined next to boundaries.
    pub samples: Vec<Sample>,
    /// Ascending.
    pub boundaries: Vec<Boundary>,
}

impl Sample {
    /// Which modes attract, in order; none where the surface is not met.
    pub fn pattern(&self) -> Option<Vec<bool>> {
        let modes = self.modes.as_ref()?;
        Some(modes.iter().map(|mode| mode.stability < 0.0).collect())
    }
}
