//! The mode that goes on from a point where surfaces meet.

pub(crate) mod algebraic;
pub(crate) mod candidates;
pub(crate) mod closing;
pub(crate) mod coupling;
pub(crate) mod decided;
#[cfg(test)]
mod decided_tests;
pub(crate) mod dummy;
pub(crate) mod fold;
pub(crate) mod interacting;
pub(crate) mod judge;
pub(crate) mod lemke;
pub(crate) mod mode_selector;
pub(crate) mod nonlinear;
pub(crate) mod select;
pub(crate) mod selection;

pub use crate::hybrid::status::Candidate;
pub use mode_selector::{ModeSelector, Next, Query};
pub use select::MAX_NAMED;
pub use selection::{Decision, SlidingMode};
