//! Studies of an experiment: closed loops, fits, orders of convergence, modes, sweeps.

pub mod fit;
pub mod modes;
pub mod mpc;
pub mod order;
pub mod sweep;
