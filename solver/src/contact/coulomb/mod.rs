//! Contacts with Coulomb's friction: forces, or impulses, that keep them from passing each other.
//!
//! W = J M⁻¹Jᵀ is what forces p of contacts change the rates r of gaps and the slip velocities by, r = q + W p. The
//! contact i has the force λ_i along its normal and the friction β_i against its slip, p = (λ, -β), and with the rates
//! r = (a, b)
//!
//! 0 ≤ λ - λ₀ ⟂ a ≥ 0,   β_i ∈ μ_i λ_i ∂|b_i|.
//!
//! It is the problem of accelerations and forces, of velocities and impulses, and without friction of displacements.
//! λ₀ is zero but for what Poisson's law gives back. Tangential dimensions are 0, 1 or 2.
//!
//! W is a matrix of numbers ([`problem::Delassus`]), or its factors J and D = M⁻¹Jᵀ with the velocities that change
//! ([`island::Island`]). `ladder` says which solver comes after which.

pub(crate) mod active_set;
pub(crate) mod convex;
pub(crate) mod dense;
pub(crate) mod distribution;
pub(crate) mod impact;
pub(crate) mod island;
pub(crate) mod islands;
pub(crate) mod ladder;
pub(crate) mod law;
pub(crate) mod lemke;
pub(crate) mod newton;
pub(crate) mod problem;
pub(crate) mod rows;
pub(crate) mod sweep;
#[cfg(test)]
mod tests;
