//! What a simulation says about a solution.

mod around;
mod choices;
pub(crate) mod confirm;
pub(crate) mod descent;
pub(crate) mod elsewhere;
pub(crate) mod idle;
mod onto;
mod pieces;
pub(crate) mod reduced;
pub(crate) mod runs;
pub(crate) mod simulated;
pub(crate) mod solved;
mod through;
