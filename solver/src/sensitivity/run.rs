//! What has been run, and how well that is known.

use std::sync::{Arc, Mutex};

use super::functions::Derivatives;
use crate::hybrid::{HybridSystem, Piecewise, write_pieces};
use crate::runtime::limit::Limit;
use crate::selector::coupling::Coupling;

/// What stays on a surface does so up to this part of its terms.
pub(super) const STAYS: f64 = 1e-6;
/// What a run knows of ψ and of states: this many tolerances of their terms.
const WIDTH: f64 = 100.0;
/// The same of a surface that is met at a small angle.
const NEAR: f64 = 10.0;

/// Tangents are known to this share of how large they have been, at best.
const FADED: f64 = 1e-3;

/// The tolerance of a run, and what is known within it.
#[derive(Clone, Copy)]
pub(crate) struct Accuracy(pub f64);

impl Accuracy {
    /// The share of its terms up to which ψ is zero.
    pub fn width(self) -> f64 {
        WIDTH * self.0
    }

    /// The same where ψ is met at a small angle.
    pub fn closeness(self) -> f64 {
        NEAR * self.0
    }

    /// The share of how large tangents have been that is known of them at least, over that of their present terms.
    pub fn faded(self) -> f64 {
        f64::max(FADED, NEAR * self.0 / STAYS)
    }
}

/// What has been run.
pub(super) struct Run<'r> {
    pub system: Arc<HybridSystem>,
    pub coupling: &'r Coupling,
    /// Of each switch, whether nothing but outputs looks at it.
    pub observers: &'r [bool],
    pub data: &'r [Arc<Piecewise>],
    pub parameters: &'r [f64],
    /// The tolerance of the run, and that of tangents.
    pub accuracy: Accuracy,
    pub tolerance: f64,
    pub limit: &'r Limit,
    /// What is kept from pass to pass.
    pub derivatives: &'r Mutex<Derivatives>,
}

impl Run<'_> {
    /// The coefficients of data from an instant on.
    pub fn coefficients(&self, t: f64) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.system.n_coefficients()];
        write_pieces(self.data, t, &mut coefficients);
        coefficients
    }
}
