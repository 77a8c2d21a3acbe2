//! When a point of the problem itself is good enough, or as good as it gets.

use super::barrier::Rest;
use super::problem::BarrierProblem;
use super::problem::errors::Errors;
use super::saved::{Saved, Stall};
use super::solution::Status;
use crate::linalg::largest;

/// Absolute tolerances in the units of the problem: gradient of the Lagrangian, rows, complementarity.
const ABSOLUTE: [f64; 3] = [1.0, 1e-4, 1e-4];
const ABSOLUTE_ACCEPTABLE: [f64; 3] = [1e10, 1e-2, 1e-2];
/// The error of a barrier problem that has come to rounding is not tried with a μ below this.
const LAST_STALL: f64 = 1e-10;
/// An objective that changes by a larger share from one point to the next is on its way: where curvature is less than what
/// regularizes it, a small gradient is left in many short steps.
const SETTLED: f64 = 1e-9;
/// A variable or objective beyond this is unbounded.
const BEYOND: f64 = 1e20;

/// Points with an acceptable error.
pub(crate) struct Termination {
    n_acceptable: usize,
    /// The objective of the last one.
    objective: f64,
    stall: Stall,
    /// The best of them.
    pub acceptable: Saved,
}

impl Termination {
    pub fn new(own: usize, m: usize) -> Self {
        Termination {
            n_acceptable: 0,
            objective: f64::NAN,
            stall: Stall::default(),
            acceptable: Saved::new(own, m),
        }
    }

    /// Whether the point converges to the optimality error asked for, of whatever is minimized.
    pub fn is_converged(problem: &BarrierProblem<'_>, error: f64) -> bool {
        error <= problem.options.tolerance && (problem.is_restoration() || problem.has_arrived())
    }

    /// How the run ends at a point of the problem itself with this optimality error, if it does.
    pub fn check(
        &mut self,
        problem: &BarrierProblem<'_>,
        errors: &Errors,
        error: f64,
        rest: &mut Rest,
    ) -> Option<Status> {
        let options = problem.options;
        if Self::is_converged(problem, error) && problem.is_within(errors, ABSOLUTE) {
            return Some(Status::Solved);
        }
        let is_acceptable = error <= options.acceptable_tolerance
            && problem.has_arrived()
            && problem.is_within(errors, ABSOLUTE_ACCEPTABLE);
        rest.is_stalled = false;
        let mut is_settled = false;
        if is_acceptable {
            self.acceptable.keep(problem, error);
            let objective = problem.values.f;
            let change = (objective - std::mem::replace(&mut self.objective, objective)).abs();
            is_settled = change <= SETTLED * objective.abs().max(1.0);
            self.n_acceptable = if is_settled { self.n_acceptable + 1 } else { 0 };
            let error = errors.optimality(&problem.iterate, problem.mu);
            rest.is_stalled = self.stall.record(problem.mu, error);
        } else {
            self.n_acceptable = 0;
        }
        // Smaller distances from bounds than these do not pay for more of it.
        let is_last =
            rest.is_stalled && is_settled && problem.mu <= LAST_STALL.max(options.mu_floor());
        if is_last || self.n_acceptable >= options.acceptable_iterations {
            return Some(Status::Acceptable);
        }
        let is_beyond = largest(&problem.iterate.v[..problem.form.shape.n]) > BEYOND
            || problem.values.f < -BEYOND && errors.primal <= options.acceptable_tolerance;
        is_beyond.then_some(Status::Unbounded)
    }

    /// Goes back to the best acceptable point of a run that ends without a solution.
    pub fn settle(&self, problem: &mut BarrierProblem<'_>, status: Status) -> Status {
        let is_unsolved = matches!(
            status,
            Status::NumericalFailure(_) | Status::LocallyInfeasible | Status::Acceptable
        );
        if !(is_unsolved && self.acceptable.error.is_finite()) {
            return status;
        }
        self.acceptable.restore(&mut problem.iterate);
        Status::Acceptable
    }
}
