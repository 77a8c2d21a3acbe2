//! Location of events along a step: roots, grazing, accumulation.

pub(crate) mod approach;
pub(crate) mod bands;
pub(crate) mod chattering;
pub(crate) mod grazing;
pub(crate) mod minima;
pub(crate) mod overlooked;
pub(crate) mod roots;
pub(crate) mod sensitivity;
pub(crate) mod simultaneous;
pub(crate) mod unseen;
pub(crate) mod zeno;

pub use approach::{Approach, Visit};
pub use overlooked::Overlooked;
