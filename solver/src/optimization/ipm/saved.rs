//! Points to come back to, and errors that become no smaller.

use super::problem::BarrierProblem;
use super::problem::iterate::Iterate;

/// So many acceptable points of one barrier problem, none with less than half the error of an earlier one, get no better.
const STALLED: usize = 3;

/// Errors up to this many times another one are nearly as good.
const NEARLY: f64 = 10.0;

/// A point that can be gone back to.
#[derive(Clone, Debug)]
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

    /// Saves the point of a problem with this optimality error.
    pub fn save(&mut self, problem: &BarrierProblem<'_>, error: f64) {
        let (own, at) = (self.v.len(), &problem.iterate);
        self.v.copy_from_slice(&at.v[..own]);
        self.y.copy_from_slice(&at.y);
        self.z_l.copy_from_slice(&at.z_l[..own]);
        self.z_u.copy_from_slice(&at.z_u[..own]);
        self.error = error;
        self.mu = problem.mu;
    }

    /// Keeps a point if it is the best one; among points that are nearly as good the one with the least μ.
    pub fn keep(&mut self, problem: &BarrierProblem<'_>, error: f64) {
        if error < self.error || problem.mu < self.mu && error < NEARLY * self.error {
            self.save(problem, error);
        }
    }

    pub fn restore(&self, at: &mut Iterate) {
        let own = self.v.len();
        at.v[..own].copy_from_slice(&self.v);
        at.y.copy_from_slice(&self.y);
        at.z_l[..own].copy_from_slice(&self.z_l);
        at.z_u[..own].copy_from_slice(&self.z_u);
    }
}

impl Stall {
    /// Whether the error of the barrier problem of μ at acceptable points has come to where rounding, or multipliers
    /// that are not unique, keep it.
    pub fn record(&mut self, mu: f64, error: f64) -> bool {
        if self.mu != mu || error <= 0.5 * self.error {
            *self = Stall {
                mu,
                error,
                count: 0,
            };
        }
        self.count += 1;
        self.count > STALLED
    }
}
