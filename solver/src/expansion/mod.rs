//! The field of a mode, its surfaces and its sliding motion, expanded in Taylor series.

pub(crate) mod dense;
pub(crate) mod field;
pub(crate) mod layout;
pub(crate) mod mode;
pub(crate) mod monitor;
pub(crate) mod planes;
pub(crate) mod psi;
pub(crate) mod scales;
pub(crate) mod series;
pub(crate) mod sliding;
pub(crate) mod step_size;
pub(crate) mod surfaces;
pub(crate) mod taylor;
pub(crate) mod terms;

pub use dense::Polynomials;
