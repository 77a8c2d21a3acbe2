//! From a system to what the solver takes: hybrid systems, complementarity systems, programs.

pub mod dcs;
pub mod discretize;
pub mod hybrid;
pub mod mpcc;
