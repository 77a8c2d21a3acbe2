//! How a run ends.

use super::certificate::Residuals;
use crate::optimization::mpcc::certificate::class::Class;
use crate::runtime::limit::Over;

/// Why it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The point is feasible, all pairs are complementary, and it is S-stationary, or of another class and B-stationary:
    /// descent to first order is excluded; or it is M-stationary, and the search for descent met its limit. Where the
    /// Lagrangian is seen to curve down along the constraints, it is not.
    Solved,
    /// The point is feasible and all pairs are complementary, and it is none of this.
    Feasible,
    /// No way that was tried led to a feasible point, and the violation is locally least.
    LocallyInfeasible,
    /// The objective falls below -1e10 at points that are feasible, and no stationary one is found.
    Unbounded,
    /// The largest number of iterations was reached without a feasible point.
    IterationLimit,
    /// The limit is over, and no feasible point has been found.
    Over(Over),
    /// Functions or derivatives are not finite where they have to be.
    Evaluation,
    /// No further step was found, or no branch near the points of the relaxations was feasible.
    NumericalFailure,
}

impl std::fmt::Display for Status {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Status::Solved => "solved",
            Status::Feasible => "feasible",
            Status::LocallyInfeasible => "locally infeasible",
            Status::Unbounded => "unbounded",
            Status::IterationLimit => "iteration limit",
            Status::Over(Over::TimeLimit) => "time limit",
            Status::Over(Over::Canceled) => "canceled",
            Status::Evaluation => "not finite",
            Status::NumericalFailure => "numerical failure",
        })
    }
}

/// Multipliers in the sign convention of [`problem`](crate::optimization::problem).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Multipliers {
    /// y of the rows.
    pub rows: Vec<f64>,
    /// z of the lower bounds of the variables, not negative.
    pub lower: Vec<f64>,
    /// z of the upper bounds of the variables, not negative.
    pub upper: Vec<f64>,
    /// (ν_a, ν_b) of the pairs: the derivatives of the Lagrangian by a side that is zero, zero for one that is not.
    /// A side in several pairs has its multiplier at each of them.
    pub pairs: Vec<[f64; 2]>,
}

/// What a run took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Iterations of interior-point runs, all of them.
    pub iterations: usize,
    /// Relaxed programs.
    pub relaxed: usize,
    /// Programs of branches.
    pub branches: usize,
    /// Branches that were left for a better one.
    pub switches: usize,
    /// Branches that were left for one in which another point means the same.
    pub moves: usize,
    /// Other ways that were tried.
    pub restarts: usize,
    /// Entries of L in the largest factorization.
    pub factor_entries: usize,
    /// Seconds.
    pub seconds: f64,
    /// Those of certificates among them.
    pub certificate_seconds: f64,
}

/// The best point of a run and what is known about it.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Why it ended.
    pub status: Status,
    /// The variables.
    pub w: Vec<f64>,
    /// The objective.
    pub objective: f64,
    /// How far the point is from satisfying the problem.
    pub residuals: Residuals,
    /// Multipliers, zero where the point is not feasible.
    pub multipliers: Multipliers,
    /// The strongest stationarity class that was shown.
    pub class: Class,
    /// Whether stronger classes are excluded.
    pub is_class_exact: bool,
    /// Whether no feasible direction descends; `None` where that is not known.
    pub b_stationary: Option<bool>,
    /// Whether all functions and derivatives are finite at the point; no class is shown where they are not.
    pub is_differentiable: bool,
    /// Pairs with both sides zero.
    pub biactive: Vec<usize>,
    /// In how many other branches a point that means the same is known; near none of them the objective is smaller.
    pub others: usize,
    /// What the run took.
    pub stats: Stats,
}

impl Solution {
    /// Whether the point is feasible and all pairs are complementary.
    pub fn is_feasible(&self) -> bool {
        matches!(self.status, Status::Solved | Status::Feasible)
    }
}
