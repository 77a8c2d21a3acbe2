//! What several runs of an experiment say together.

mod closed_loop;
mod ensemble;
mod fit;

pub use closed_loop::{ClosedLoop, Decision, Planned, Sampled, Times};
pub use ensemble::{Bands, Ensemble};
pub use fit::{Bound, Direction, Estimate, Fit, Measurements, Search};

/// What several runs say together.
#[derive(Clone, Debug, Default)]
pub struct Several {
    /// Those with other seeds.
    pub ensemble: Option<Ensemble>,
    /// Those with other parameters, beside measurements.
    pub fit: Option<Fit>,
    /// Plans of a controller, beside what has happened.
    pub closed_loop: Option<ClosedLoop>,
}
