//! Statements of a model, entry by entry.

pub(crate) mod algebraic;
pub(crate) mod cones;
pub(crate) mod declare;
pub(crate) mod decompose;
pub(crate) mod dynamics;
pub(crate) mod hidden;
pub(crate) mod indicators;
pub(crate) mod jumps;
pub(crate) mod mechanics;
pub(crate) mod partition;
pub(crate) mod programs;
pub(crate) mod projections;
pub(crate) mod restitution;
pub(crate) mod switch;
pub(crate) mod tables;
