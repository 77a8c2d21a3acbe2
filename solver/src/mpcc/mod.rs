//! Nonlinear programs with complementarity constraints.

mod certificate;
mod class;
mod dual;
mod lift;
mod linear;
mod local;
mod lpec;
mod relaxation;
mod relaxed;

#[cfg(test)]
mod certificate_tests;
#[cfg(test)]
mod relaxed_tests;

pub use certificate::{Residuals, Tolerances};
pub use class::Class;
pub use lift::Lifted;
pub use relaxation::{Relaxation, Steering};
pub use relaxed::{Coupling, Form, Relaxed};
