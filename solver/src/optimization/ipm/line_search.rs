//! How far to go along a step: a filter line search with second-order corrections.
//!
//! Wächter & Biegler 2006, algorithm A, steps 3 to 5.

use super::direction::{Aim, NewtonSystem};
use super::filter::{Filter, GAMMA_PHI, GAMMA_THETA, Merit, at_most};
use super::problem::BarrierProblem;
use super::problem::evaluation::Trial;
use super::problem::iterate::Step;
use crate::linalg::largest;

const ETA: f64 = 1e-8;
const DELTA: f64 = 1.0;
const S_THETA: f64 = 1.1;
const S_PHI: f64 = 2.3;
const GAMMA_ALPHA: f64 = 0.05;
const KAPPA_SOC: f64 = 0.99;
const MAX_CORRECTIONS: usize = 4;
/// A step below this relative size is taken as it is: rounding hides what it changes.
const TINY: f64 = 10.0 * f64::EPSILON;
const NEARLY_FEASIBLE: f64 = 1e-4;
/// A step as long as this may be a ray; this many times as long, the objective still has to fall by this share.
const LONG: f64 = 1e7;
const FAR: f64 = 1e13;
const STILL: f64 = 1e-2;

/// How a line search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Search {
    Accepted,
    Tiny,
    Failed,
}

/// What a step promises at its start.
struct Prospect {
    at: Merit,
    /// The directional derivative of φ.
    slope: f64,
}

pub(crate) struct LineSearch {
    pub filter: Filter,
    /// The filter of the problem itself while the violation is minimized.
    pub outer_filter: Filter,
    pub trial: Trial,
    /// The step with second-order corrections, and the residuals that it removes.
    corrected: Step,
    target: Vec<f64>,
    /// Of the last step: lengths of variables and of multipliers.
    pub alpha: f64,
    pub alpha_dual: f64,
}

impl LineSearch {
    pub fn new(n_all: usize, m: usize) -> Self {
        LineSearch {
            filter: Filter::new(),
            outer_filter: Filter::new(),
            trial: Trial::new(n_all, m),
            corrected: Step::new(n_all, m),
            target: vec![0.0; m],
            alpha: 0.0,
            alpha_dual: 0.0,
        }
    }

    /// Goes from the problem itself to the least violation, or back.
    pub fn swap_filters(&mut self) {
        std::mem::swap(&mut self.filter, &mut self.outer_filter);
    }

    /// Finds the step length; the point accepted is in `self.trial`, and a correction in `step`.
    pub fn search(
        &mut self,
        problem: &mut BarrierProblem<'_>,
        newton: &mut NewtonSystem,
        step: &mut Step,
    ) -> Search {
        let full = problem.iterate.primal_length(step, problem.tau);
        self.trial.count = 0;
        let at = problem.merit();
        let prospect = Prospect {
            at,
            slope: problem.slope(step),
        };
        let relative = |(dv, v): (&f64, &f64)| dv.abs() / (1.0 + v.abs());
        let changes = step.v.iter().zip(&problem.iterate.v);
        let change = changes.take(problem.iterate.nv).map(relative);
        let is_feasible = largest(&problem.values.residual) <= NEARLY_FEASIBLE;
        if is_feasible && change.fold(0.0, f64::max) < TINY {
            return match problem.try_point(step, full, &mut self.trial) {
                Some(_) => {
                    self.alpha = full;
                    Search::Tiny
                }
                None => Search::Failed,
            };
        }
        let least = self.shortest(&prospect);
        let mut alpha = full;
        while alpha >= least || self.trial.count == 0 {
            let trial = problem.try_point(step, alpha, &mut self.trial);
            if let Some(trial) = trial.filter(|&trial| self.accepts(&prospect, trial, alpha)) {
                self.update_filter(&prospect, trial, alpha);
                self.alpha = alpha;
                return Search::Accepted;
            }
            let is_worse = trial.is_some_and(|trial| trial.theta >= at.theta);
            if self.trial.count == 1
                && is_worse
                && self.correct(problem, newton, &prospect, step, alpha)
            {
                return Search::Accepted;
            }
            alpha *= 0.5;
        }
        Search::Failed
    }

    /// Whether the objective falls along the step without end and no row objects.
    pub fn is_ray(&mut self, problem: &mut BarrierProblem<'_>, step: &Step) -> bool {
        let n = problem.form.shape.n;
        let length = largest(&step.v[..n]);
        let is_near = largest(&problem.values.residual) <= NEARLY_FEASIBLE;
        if problem.is_restoration() || length < LONG || !is_near {
            return false;
        }
        let is_free = problem.iterate.primal_length(step, 1.0 / FAR) == 1.0;
        let products = problem.derivatives.gradient.iter().zip(&step.v).take(n);
        let slope: f64 = products.map(|(g, dv)| g * dv).sum();
        let far = problem.try_point(step, FAR, &mut self.trial);
        let is_feasible = far.is_some_and(|far| far.theta <= f64::EPSILON.sqrt() * FAR * length);
        let change = self.trial.values.f - problem.values.f;
        is_free && slope < 0.0 && is_feasible && change < STILL * FAR * slope
    }

    /// Second-order corrections against the violation that the full step has brought.
    fn correct(
        &mut self,
        problem: &mut BarrierProblem<'_>,
        newton: &mut NewtonSystem,
        prospect: &Prospect,
        step: &mut Step,
        alpha: f64,
    ) -> bool {
        self.target.copy_from_slice(&problem.values.residual);
        let (mut length, mut theta) = (alpha, prospect.at.theta);
        for _ in 0..MAX_CORRECTIONS {
            for (target, residual) in self.target.iter_mut().zip(&self.trial.values.residual) {
                *target = length * *target + residual;
            }
            let aim = Aim {
                mu: problem.mu,
                share: 1.0,
                rows: Some(&self.target),
            };
            if newton.direction(problem, aim, &mut self.corrected).is_err() {
                return false;
            }
            length = (problem.iterate).primal_length(&self.corrected, problem.tau);
            let Some(trial) = problem.try_point(&self.corrected, length, &mut self.trial) else {
                return false;
            };
            if self.accepts(prospect, trial, alpha) {
                self.update_filter(prospect, trial, alpha);
                self.alpha = length;
                if newton.kkt.is_corrected() && !problem.is_restoration() {
                    self.corrected.y.copy_from_slice(&step.y);
                }
                std::mem::swap(step, &mut self.corrected);
                return true;
            }
            if trial.theta > KAPPA_SOC * theta {
                return false;
            }
            theta = trial.theta;
        }
        false
    }

    /// Steps below this length cannot be accepted. Wächter & Biegler 2006, eq. (23).
    fn shortest(&self, prospect: &Prospect) -> f64 {
        let (theta, slope) = (prospect.at.theta, prospect.slope);
        let mut least = GAMMA_THETA;
        if slope < 0.0 {
            least = least.min(GAMMA_PHI * theta / -slope);
            if theta <= self.filter.theta_min {
                least = least.min(DELTA * theta.powf(S_THETA) / (-slope).powf(S_PHI));
            }
        }
        // No length below this changes the point.
        (GAMMA_ALPHA * least).max(1e-14)
    }

    fn is_descent(&self, prospect: &Prospect, alpha: f64) -> bool {
        let Prospect { at, slope } = *prospect;
        slope < 0.0
            && at.theta <= self.filter.theta_min
            && alpha * (-slope).powf(S_PHI) > DELTA * at.theta.powf(S_THETA)
    }

    fn accepts(&self, prospect: &Prospect, trial: Merit, alpha: f64) -> bool {
        let Prospect { at, slope } = *prospect;
        let is_better = if self.is_descent(prospect, alpha) {
            at_most(trial.phi, at.phi + ETA * alpha * slope, at.phi)
        } else {
            at_most(trial.theta, (1.0 - GAMMA_THETA) * at.theta, at.theta)
                || at_most(trial.phi, at.phi - GAMMA_PHI * at.theta, at.phi)
        };
        is_better && self.filter.accepts(trial)
    }

    /// The filter keeps where an accepted step came from, unless it is a descent step.
    fn update_filter(&mut self, prospect: &Prospect, trial: Merit, alpha: f64) {
        let Prospect { at, slope } = *prospect;
        let is_armijo = at_most(trial.phi, at.phi + ETA * alpha * slope, at.phi);
        if !(self.is_descent(prospect, alpha) && is_armijo) {
            self.filter.add(at);
        }
    }
}
