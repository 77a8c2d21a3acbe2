//! What a run is asked for.

use super::certificate::Tolerances;
use super::relaxed::{Coupling, Form};
use crate::linalg::analyses::Analyses;
use crate::optimization::mpcc::branch::polish::Goal;
use crate::runtime::limit::Limit;

/// How σ is driven to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Homotopy {
    /// σ follows the barrier parameter within one interior-point run.
    Coupled(Coupling),
    /// One interior-point run for each σ, from `start` down to `stop` by `factor`.
    Sequential {
        /// The first σ, positive.
        start: f64,
        /// By what σ is multiplied, in (0, 1).
        factor: f64,
        /// The last σ.
        stop: f64,
    },
}

/// What a start says of the branch to look in: that in which its smaller sides are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Trust {
    /// Nothing.
    #[default]
    No,
    /// That branch is polished first.
    First,
    /// Nothing but that branch is tried.
    Alone,
    /// Nothing but that branch is tried, until it is known to have no objective below this.
    Below(f64),
}

impl Trust {
    /// Whether other branches than that of the start are not looked at.
    pub(crate) fn is_alone(self) -> bool {
        matches!(self, Trust::Alone | Trust::Below(_))
    }

    /// What is looked for in that branch, for an objective in units of a size.
    pub(crate) fn in_units(self, size: f64) -> Self {
        match self {
            Trust::Below(objective) => Trust::Below(objective / size),
            other => other,
        }
    }

    /// What the solution of that branch is wanted for.
    pub(super) fn goal(self) -> Goal {
        match self {
            Trust::Below(objective) => Goal::Below(objective),
            _ => Goal::Solution,
        }
    }
}

/// The largest numbers of iterations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Iterations {
    /// Of one interior-point run.
    pub run: usize,
    /// Of all of them.
    pub all: usize,
}

impl Default for Iterations {
    fn default() -> Self {
        Iterations {
            run: 3000,
            all: usize::MAX,
        }
    }
}

/// Settings of [`solve`](super::solve).
#[derive(Clone, Debug)]
pub struct Options {
    /// The relaxation.
    pub form: Form,
    /// How σ is driven to zero.
    pub homotopy: Homotopy,
    /// Whether the smaller sides at the start are zero at a feasible point near it.
    pub trust: Trust,
    /// The largest violation of a row, a bound or a pair of a point that counts as feasible.
    pub feasibility: f64,
    /// What the optimality error of a branch has to reach.
    pub tolerance: f64,
    /// Tolerances of the certificate.
    pub certificate: Tolerances,
    /// How many other ways are tried when one ends without a feasible point.
    pub max_restarts: usize,
    /// Other ways are tried for a smaller objective, too, as long as the iterations so far, times the numbers of
    /// variables and rows, are fewer than this. With zero, a feasible branch of a trusted start is enough.
    pub effort: usize,
    /// As long as they are fewer than this, counted likewise, a feasible point that is not stationary is not enough. With
    /// zero, its branch is not left for one in which another point means the same, either.
    pub patience: usize,
    /// How many iterations it may take.
    pub iterations: Iterations,
    /// When it ends.
    pub limit: Limit,
    /// Symbolic factorizations that are known, and those that are made.
    pub analyses: Analyses,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            form: Form::default(),
            homotopy: Homotopy::Coupled(Coupling::default()),
            trust: Trust::No,
            feasibility: 1e-6,
            tolerance: 1e-12,
            certificate: Tolerances::default(),
            max_restarts: 5,
            effort: 100_000,
            patience: 100_000,
            iterations: Iterations::default(),
            limit: Limit::default(),
            analyses: Analyses::default(),
        }
    }
}
