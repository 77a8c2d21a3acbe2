//! The least violation: what the line search falls back on.
//!
//! minimize ρ Σ(p + n) + ζ/2 ‖D (v - v_R)‖²   subject to   c(x) - s - b - p + n = 0,   l <= v <= u,   p, n >= 0
//!
//! with ζ = √μ and D_i = min(1, 1/|v_R,i|), by the same iteration; p and n are eliminated from the linear system, which
//! keeps its pattern. Wächter & Biegler 2006, section 3.3.

use super::filter::Merit;
use super::progress::Observer;
use super::solution::{Failure, Status};
use super::{Exit, Run};
use crate::linalg::largest;

const RHO: f64 = 1e3;
/// The violation has to fall to this share.
const KAPPA_RESTO: f64 = 0.9;
/// Multipliers of bounds do not come back larger than this.
const Z_MAX: f64 = 1e3;

#[derive(Clone, Debug)]
pub(crate) struct Elastic {
    pub zeta: f64,
    /// v_R and D².
    reference: Vec<f64>,
    weights: Vec<f64>,
    /// μ and θ where the restoration began.
    mu: f64,
    theta: f64,
}

impl Elastic {
    pub fn new(own: usize) -> Self {
        Elastic {
            zeta: 0.0,
            reference: vec![0.0; own],
            weights: vec![0.0; own],
            mu: 0.0,
            theta: 0.0,
        }
    }

    pub fn objective(&self, v: &[f64], own: usize) -> f64 {
        let distances = v.iter().zip(&self.reference).zip(&self.weights);
        let proximity: f64 = distances.map(|((v, r), d)| d * (v - r) * (v - r)).sum();
        RHO * v[own..].iter().sum::<f64>() + 0.5 * self.zeta * proximity
    }

    pub fn gradient(&self, v: &[f64], own: usize, gradient: &mut [f64]) {
        for i in 0..own {
            gradient[i] = self.zeta * self.weights[i] * (v[i] - self.reference[i]);
        }
        gradient[own..].fill(RHO);
    }
}

impl Run<'_> {
    /// Goes to a point with less violation that the filter accepts, or says why there is none.
    pub(crate) fn restore(&mut self, observer: &mut dyn Observer) -> Option<Exit> {
        let (m, own) = (self.form.m, self.nv());
        let at = self.merit();
        self.filter.add(at);
        std::mem::swap(&mut self.filter, &mut self.outer_filter);
        let elastic = &mut self.elastic;
        elastic.mu = self.mu;
        elastic.theta = at.theta;
        elastic.reference.copy_from_slice(&self.v[..own]);
        for (weight, v) in elastic.weights.iter_mut().zip(&self.v) {
            *weight = v.abs().max(1.0).powi(-2);
        }
        // p and n that are best for this μ: ρ - μ/p = y, ρ - μ/n = -y. Their y is as large as ρ and would bring curvature
        // from far away; the first step finds it.
        self.y.fill(0.0);
        let mu = self.mu.max(largest(&self.residual));
        for j in 0..m {
            let r = self.residual[j];
            let (size, share) = (r.abs(), mu / (2.0 * RHO));
            let half = share - 0.5 * size;
            let root = (half * half + share * size).sqrt();
            // The root that does not cancel.
            let least = if half > 0.0 {
                half + root
            } else {
                share * size / (root - half)
            };
            let least = least.max(f64::MIN_POSITIVE.sqrt());
            let (p, n) = if r > 0.0 {
                (r + least, least)
            } else {
                (least, least - r)
            };
            for (place, value) in [(own + j, p), (own + m + j, n)] {
                self.v[place] = value;
                self.z_l[place] = mu / value;
            }
        }
        for z in self.z_l[..own].iter_mut().chain(&mut self.z_u[..own]) {
            *z = z.min(RHO);
        }
        self.is_restoration = true;
        let before = self.iterations;
        self.set_mu(mu);
        let exit = match self.evaluate() {
            Ok(()) => {
                let theta = self.merit().theta;
                self.filter.start(theta);
                self.iterate(observer)
            }
            Err(failure) => Exit::Ended(Status::NumericalFailure(failure)),
        };
        self.return_to_problem();
        let violation = largest(&self.residual);
        match exit {
            Exit::Restored => None,
            // Nothing is violated, and yet the filter does not take it: it starts anew.
            Exit::Ended(Status::LocallyInfeasible) if violation <= 1e2 * self.options.tolerance => {
                self.filter.clear();
                let is_stuck = self.iterations == before;
                is_stuck.then_some(Exit::Ended(Status::NumericalFailure(Failure::Restoration)))
            }
            _ => Some(exit),
        }
    }

    fn return_to_problem(&mut self) {
        self.is_restoration = false;
        std::mem::swap(&mut self.filter, &mut self.outer_filter);
        self.mu = self.elastic.mu;
        self.tau = (1.0 - self.mu).max(super::TAU_MIN);
        for i in 0..self.nv() {
            self.z_l[i] = (self.mu / (self.v[i] - self.lower[i])).min(Z_MAX);
            self.z_u[i] = (self.mu / (self.upper[i] - self.v[i])).min(Z_MAX);
        }
        self.evaluate_values();
        self.evaluate_gradients();
        self.estimate_multipliers();
        // What is not finite here ends the iteration at the next point.
        let _ = self.evaluate();
    }

    /// Whether the problem itself can go on from here.
    pub(crate) fn is_restored(&mut self) -> bool {
        let (m, own) = (self.form.m, self.form.n + self.form.n_slacks);
        let elastic = |j: usize| self.v[own + j] - self.v[own + m + j];
        let violations = self
            .residual
            .iter()
            .enumerate()
            .map(|(j, r)| (r + elastic(j)).abs());
        let theta: f64 = violations.sum();
        if theta > KAPPA_RESTO * self.elastic.theta {
            return false;
        }
        let f = self.form.objective();
        self.is_restoration = false;
        let phi = f + self.elastic.mu / self.mu * self.barrier_terms(&self.v);
        self.is_restoration = true;
        f.is_finite() && self.outer_filter.accepts(Merit { theta, phi })
    }

    /// The curvature of the objective of the restoration.
    pub(crate) fn add_proximity_curvature(&mut self) {
        if self.is_restoration {
            for (sigma, weight) in self.sigma.iter_mut().zip(&self.elastic.weights) {
                *sigma += self.elastic.zeta * weight;
            }
        }
    }
}
