//! Solvers of the one-step problem of an island: contacts that push, stick and slip.

pub(crate) mod cone;
pub(crate) mod convex;
pub(crate) mod direct;
pub(crate) mod newton;
pub(crate) mod pivoting;
