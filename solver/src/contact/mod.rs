//! Unilateral contacts with Coulomb friction: impacts, forces that last, slip onset, stabilization.

pub(crate) mod coefficients;
pub(crate) mod coulomb;
pub(crate) mod friction_disc;
pub(crate) mod impact;
pub(crate) mod impact_order;
pub(crate) mod prediction;
pub(crate) mod rows;
pub(crate) mod slip_onset;
pub(crate) mod slip_onset_beside;
pub(crate) mod stabilization;
pub(crate) mod sustained;
pub(crate) mod velocities;

pub use crate::hybrid::ImpactLaw;
