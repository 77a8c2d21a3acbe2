//! How a run ends.

use crate::runtime::limit::Over;

/// Why it ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The point satisfies the optimality conditions to the tolerance.
    Solved,
    /// It satisfies them to the acceptable tolerance only, and no better point was reached.
    Acceptable,
    /// The violation of the constraints is locally least, and not zero.
    LocallyInfeasible,
    /// The variables or the objective go beyond all bounds.
    Unbounded,
    /// The largest number of iterations was reached.
    IterationLimit,
    /// The limit is over.
    Over(Over),
    /// The observer stopped the run.
    Stopped,
    /// No further step was found.
    NumericalFailure(Failure),
}

/// What failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Functions or derivatives at the start are not finite.
    EvaluationAtStart,
    /// Derivatives at an iterate are not finite.
    Evaluation,
    /// The linear system could not be solved.
    LinearSystem,
    /// Neither the line search nor the restoration found a better point.
    Restoration,
}

impl Status {
    /// Whether the point is a solution to the tolerance.
    pub fn is_solved(self) -> bool {
        self == Status::Solved
    }
}

/// Where to start from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// The variables.
    pub w: Vec<f64>,
    /// Multipliers of the rows.
    pub y: Vec<f64>,
    /// Multipliers of the lower bounds of the variables, not negative.
    pub z_l: Vec<f64>,
    /// Multipliers of the upper bounds of the variables, not negative.
    pub z_u: Vec<f64>,
    /// The barrier parameter, positive.
    pub mu: f64,
}

/// By how much the optimality conditions are missed, in the units of the problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residuals {
    /// The largest violation of a row or bound.
    pub primal: f64,
    /// The largest entry of the gradient of the Lagrangian.
    pub dual: f64,
    /// The largest product of a multiplier and the distance from its bound.
    pub complementarity: f64,
}

/// The last point of a run.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The variables, within their bounds.
    pub w: Vec<f64>,
    /// Multipliers of the rows.
    pub y: Vec<f64>,
    /// Multipliers of the lower bounds of the variables.
    pub z_l: Vec<f64>,
    /// Multipliers of the upper bounds of the variables.
    pub z_u: Vec<f64>,
    /// The objective.
    pub objective: f64,
    /// The barrier parameter.
    pub mu: f64,
    /// Why the run ended.
    pub status: Status,
    /// What is left.
    pub residuals: Residuals,
    /// The number of iterations.
    pub iterations: usize,
    /// Entries of L in the factorization of the system of a step: what memory and time grow with.
    pub factor_entries: usize,
    /// Whether the static order has lost a pivot, so that there may have been corrections without need.
    pub has_lost_pivots: bool,
    /// Where the point satisfies the optimality conditions and is no minimum to second order: a direction along the rows
    /// and the active bounds in which the Lagrangian curves down, with a largest entry of 1.
    pub falling: Option<Vec<f64>>,
}
