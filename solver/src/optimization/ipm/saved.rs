//! Points to come back to, and soft restoration.
//!
//! Where the filter accepts no length of a step, the step may still reduce the optimality error of the barrier problem;
//! near a solution it does, and the filter only sees rounding. Wächter & Biegler 2006, section 3.3.

use super::Run;
use super::residuals::Errors;
use super::solution::Status;

/// By what factor a soft step has to reduce the error, and how many may follow each other.
const KAPPA_SOFT: f64 = 0.9999;
const MAX_SOFT: usize = 10;
/// So many acceptable points of one barrier problem, none with less than half the error of an earlier one, get no better.
const STALLED: usize = 3;

/// Errors up to this many times another one are nearly as good.
const NEARLY: f64 = 10.0;

/// A point that can be gone back to.
#[derive(Clone, Debug, Default)]
pub(crate) struct Saved {
    v: Vec<f64>,
    y: Vec<f64>,
    z_l: Vec<f64>,
    z_u: Vec<f64>,
    /// Its optimality error, infinite without a point, and its μ.
    pub error: f64,
    mu: f64,
}

/// How long the error of a barrier problem has not become smaller.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stall {
    mu: f64,
    error: f64,
    count: usize,
}

impl Saved {
    pub fn new(own: usize, m: usize) -> Self {
        Saved {
            v: vec![0.0; own],
            y: vec![0.0; m],
            z_l: vec![0.0; own],
            z_u: vec![0.0; own],
            error: f64::INFINITY,
            mu: f64::INFINITY,
        }
    }

    /// Without a point.
    pub fn clear(&mut self) {
        self.error = f64::INFINITY;
    }

    fn save(&mut self, run: &Run<'_>, error: f64) {
        let own = self.v.len();
        self.v.copy_from_slice(&run.v[..own]);
        self.y.copy_from_slice(&run.y);
        self.z_l.copy_from_slice(&run.z_l[..own]);
        self.z_u.copy_from_slice(&run.z_u[..own]);
        self.error = error;
        self.mu = run.mu;
    }

    fn restore(&self, run: &mut Run<'_>) {
        let own = self.v.len();
        run.v[..own].copy_from_slice(&self.v);
        run.y.copy_from_slice(&self.y);
        run.z_l[..own].copy_from_slice(&self.z_l);
        run.z_u[..own].copy_from_slice(&self.z_u);
    }
}

impl Run<'_> {
    /// Keeps an acceptable point if it is the best one; among points that are nearly as good the one with the least μ.
    pub(crate) fn keep_acceptable(&mut self, error: f64) {
        let best = &self.acceptable;
        if error < best.error || self.mu < best.mu && error < NEARLY * best.error {
            let mut saved = std::mem::take(&mut self.acceptable);
            saved.save(self, error);
            self.acceptable = saved;
        }
    }

    /// Whether the error of the barrier problem at acceptable points has come to where rounding, or multipliers that
    /// are not unique, keep it.
    pub(crate) fn stalls(&mut self, errors: &Errors) -> bool {
        let error = self.optimality_error(errors, self.mu);
        let stall = &mut self.stall;
        if stall.mu != self.mu || error <= 0.5 * stall.error {
            *stall = Stall {
                mu: self.mu,
                error,
                count: 0,
            };
        }
        stall.count += 1;
        stall.count > STALLED
    }

    /// Goes back to the best acceptable point of a run that ends without a solution.
    pub(crate) fn settle(&mut self, status: Status) -> Status {
        let is_unsolved = matches!(
            status,
            Status::NumericalFailure(_) | Status::LocallyInfeasible | Status::Acceptable
        );
        if !(is_unsolved && self.acceptable.error.is_finite()) {
            return status;
        }
        let saved = std::mem::take(&mut self.acceptable);
        saved.restore(self);
        Status::Acceptable
    }

    /// Takes the step that the line search has refused if it reduces the error of the barrier problem.
    pub(crate) fn soft_step(&mut self, errors: &Errors) -> bool {
        // Far from feasible points the error may fall to where nothing is feasible.
        let is_near = errors.primal <= self.options.acceptable_tolerance;
        if self.is_restoration || !is_near || self.n_soft >= MAX_SOFT {
            return false;
        }
        let before = self.optimality_error(errors, self.mu);
        let mut saved = std::mem::take(&mut self.saved);
        saved.save(self, before);
        let at = self.merit();
        let step = std::mem::take(&mut self.step);
        let dual = self.dual_length(&step, self.tau);
        self.alpha = self.primal_length(&step, self.tau).min(dual);
        let trial = self.try_point(&step, self.alpha);
        self.step = step;
        let mut is_better = false;
        if trial.is_some() {
            self.accept(self.alpha);
            is_better = self.evaluate_derivatives().is_ok() && {
                let errors = self.errors();
                self.optimality_error(&errors, self.mu) <= KAPPA_SOFT * before
            };
        }
        if is_better {
            self.filter.add(at);
            self.n_soft += 1;
        } else {
            saved.restore(self);
            // These values were finite before.
            let _ = self.evaluate();
        }
        self.saved = saved;
        is_better
    }
}
