//! Rates and switches of a system, once it is known which switches it has.

use crate::expr::{Expr, Var};
use crate::system::Switch;
use crate::system::regions::sample::Sampler;

/// f and ψ in α, and points to look at them.
pub(crate) struct Switched<'s, 'e> {
    pub rates: &'s [Expr<'e>],
    /// Frictions of contacts and masses of bodies.
    pub coefficients: &'s [Expr<'e>],
    pub switches: &'s [Switch<'e>],
    /// α of the switches.
    pub alphas: &'s [Var],
    pub sampler: &'s Sampler<'e>,
}
