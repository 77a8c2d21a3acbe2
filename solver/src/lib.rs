#![doc = include_str!("../README.md")]

pub mod adaptive;
pub mod cell;
pub mod fesd;
pub mod ipm;
pub mod kernels;
pub mod lcp;
pub mod linalg;
pub mod moreau;
pub mod mpcc;
pub mod nl;
pub mod problem;
pub mod qp;
pub mod quadratic;
pub mod simulate;
pub mod tableau;
pub mod tape;
