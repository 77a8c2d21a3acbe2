//! Nonlinear programs with complementarity constraints, the linear, quadratic and conic ones inside them, and least squares.

pub mod cell;
pub mod conic;
pub mod ipm;
pub mod kernels;
pub mod lcp;
pub mod least_squares;
pub mod mpcc;
pub mod nl;
pub mod problem;
pub mod qp;
pub mod quadratic;
pub mod scaling;
