//! Studies of an experiment: orders of convergence, modes, sweeps.

pub mod modes;
pub mod order;
pub mod sweep;
