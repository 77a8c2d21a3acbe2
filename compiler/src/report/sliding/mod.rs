//! The sliding modes of a nonlinear switch.

pub(crate) mod branches;
pub(crate) mod plane;
