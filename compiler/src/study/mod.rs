//! Studies of an experiment: fits, orders of convergence, modes, sweeps.

pub mod fit;
pub mod modes;
pub mod order;
pub mod sweep;
