//! What a run is asked for.

use crate::linalg::analyses::Analyses;
use crate::runtime::limit::Limit;

/// A barrier problem is solved when its error is at most this many times μ.
pub(crate) const KAPPA_EPSILON: f64 = 10.0;

/// How the barrier parameter decreases.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BarrierRule {
    /// Fiacco and McCormick: when the barrier problem is solved to a multiple of μ. Wächter & Biegler 2006, eq. (7).
    Monotone,
    /// In every iteration by the quality function, as long as that makes progress. Nocedal, Wächter & Waltz 2009.
    Adaptive,
}

/// Settings of [`solve`](super::solve).
#[derive(Clone, Debug)]
pub struct Options {
    /// What the scaled optimality error has to reach, in (0, 1).
    pub tolerance: f64,
    /// The largest number of iterations.
    pub max_iterations: usize,
    /// When it ends.
    pub limit: Limit,
    /// Symbolic factorizations that are known, and those that are made.
    pub analyses: Analyses,
    /// The rule for μ.
    pub barrier: BarrierRule,
    /// μ at the start, where no point brings its own; positive.
    pub mu_init: f64,
    /// μ does not fall below this, and the complementarity products are driven to it; 0 or more.
    pub mu_target: f64,
    /// Bounds are moved outward by this much of their size, so that there is an interior; 0 or more.
    pub bound_relaxation: f64,
    /// The optimality error that is good enough where no better one is reached; at least the tolerance.
    pub acceptable_tolerance: f64,
    /// So many iterations in a row with an acceptable error end the run.
    pub acceptable_iterations: usize,
    /// Whether rows and variables are eliminated in pairs once the static order has lost a pivot: steps are exact then,
    /// and cost several times as much. Without, what is lost counts as curvature that is missing.
    pub pairs_pivots: bool,
}

impl Options {
    /// The least μ.
    pub(crate) fn mu_floor(&self) -> f64 {
        self.mu_target.max(self.tolerance / (KAPPA_EPSILON + 1.0))
    }
}

impl Default for Options {
    fn default() -> Self {
        Options {
            tolerance: 1e-8,
            max_iterations: 3000,
            limit: Limit::default(),
            analyses: Analyses::default(),
            barrier: BarrierRule::Monotone,
            mu_init: 0.1,
            mu_target: 0.0,
            bound_relaxation: 1e-8,
            acceptable_tolerance: 1e-6,
            acceptable_iterations: 15,
            pairs_pivots: false,
        }
    }
}
