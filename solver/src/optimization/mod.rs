//! Nonlinear programs with complementarity constraints, and the linear, quadratic and conic ones inside them.

pub mod cell;
pub mod conic;
pub mod ipm;
pub mod kernels;
pub mod lcp;
pub mod mpcc;
pub mod nl;
pub mod problem;
pub mod qp;
pub mod quadratic;
