//! Integration of a mode: Taylor series, or Radau IIA where it is stiff.

pub(crate) mod drift;
pub(crate) mod implicit;
pub(crate) mod order;
pub(crate) mod probes;
pub(crate) mod radau;
mod rounding;
pub(crate) mod singular;
pub(crate) mod singular_rates;
pub(crate) mod step;
pub(crate) mod stepper;
pub(crate) mod stiffness;
pub mod tableau;
pub(crate) mod two_sum;
pub(crate) mod watch;
