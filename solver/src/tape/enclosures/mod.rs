//! Enclosures of the values of a tape, and running errors.

pub(crate) mod ball;
pub(crate) mod hiding;
pub(crate) mod rounded;
pub(crate) mod tame;
