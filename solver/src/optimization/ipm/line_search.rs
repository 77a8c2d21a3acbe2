//! How far to go along a step: a filter line search with second-order corrections.
//!
//! Wächter & Biegler 2006, algorithm A, steps 3 to 5.

use super::Run;
use super::direction::Step;
use super::filter::{GAMMA_PHI, GAMMA_THETA, Merit, at_most};
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

impl Run<'_> {
    /// Finds the step length; the point accepted is in `self.trial`.
    pub(crate) fn line_search(&mut self) -> Search {
        let mut step = std::mem::take(&mut self.step);
        let search = self.search(&mut step);
        self.step = step;
        search
    }

    fn search(&mut self, step: &mut Step) -> Search {
        let full = self.primal_length(step, self.tau);
        self.trials = 0;
        let at = self.merit();
        let prospect = Prospect {
            at,
            slope: self.slope(step),
        };
        let relative = |(dv, v): (&f64, &f64)| dv.abs() / (1.0 + v.abs());
        let change = step.v.iter().zip(&self.v).take(self.nv()).map(relative);
        let is_feasible = largest(&self.residual) <= NEARLY_FEASIBLE;
        if is_feasible && change.fold(0.0, f64::max) < TINY {
            return match self.try_point(step, full) {
                Some(_) => {
                    self.alpha = full;
                    Search::Tiny
                }
                None => Search::Failed,
            };
        }
        let least = self.shortest(&prospect);
        let mut alpha = full;
        while alpha >= least || self.trials == 0 {
            let trial = self.try_point(step, alpha);
            if let Some(trial) = trial.filter(|&trial| self.accepts(&prospect, trial, alpha)) {
                self.update_filter(&prospect, trial, alpha);
                self.alpha = alpha;
                return Search::Accepted;
            }
            let is_worse = trial.is_some_and(|trial| trial.theta >= at.theta);
            if self.trials == 1 && is_worse && self.correct(&prospect, step, alpha) {
                return Search::Accepted;
            }
            alpha *= 0.5;
        }
        Search::Failed
    }

    /// Whether the objective falls along the step without end and no row objects.
    pub(crate) fn is_ray(&mut self) -> bool {
        let length = largest(&self.step.v[..self.form.n]);
        if self.is_restoration || length < LONG || largest(&self.residual) > NEARLY_FEASIBLE {
            return false;
        }
        let step = std::mem::take(&mut self.step);
        let is_free = self.primal_length(&step, 1.0 / FAR) == 1.0;
        let slope: f64 = self
            .gradient
            .iter()
            .zip(&step.v)
            .take(self.form.n)
            .map(|(g, dv)| g * dv)
            .sum();
        let far = self.try_point(&step, FAR);
        self.step = step;
        let is_feasible = far.is_some_and(|far| far.theta <= f64::EPSILON.sqrt() * FAR * length);
        is_free && slope < 0.0 && is_feasible && self.trial_f - self.f < STILL * FAR * slope
    }

    /// ∇φᵀΔv.
    fn slope(&self, step: &Step) -> f64 {
        let terms = (0..self.nv()).map(|i| {
            let slope = self.gradient[i] + self.mu * self.barrier_slope(i);
            slope * step.v[i]
        });
        terms.sum()
    }

    /// Second-order corrections against the violation that the full step has brought.
    fn correct(&mut self, prospect: &Prospect, step: &mut Step, alpha: f64) -> bool {
        let mut corrected = std::mem::take(&mut self.corrected);
        self.target.copy_from_slice(&self.residual);
        let (mut length, mut theta, mut is_accepted) = (alpha, prospect.at.theta, false);
        for _ in 0..MAX_CORRECTIONS {
            for (target, residual) in self.target.iter_mut().zip(&self.trial_residual) {
                *target = length * *target + residual;
            }
            if self.direction(self.mu, 1.0, &mut corrected).is_err() {
                break;
            }
            length = self.primal_length(&corrected, self.tau);
            let Some(trial) = self.try_point(&corrected, length) else {
                break;
            };
            if self.accepts(prospect, trial, alpha) {
                is_accepted = true;
                self.update_filter(prospect, trial, alpha);
                self.alpha = length;
                if self.kkt.is_corrected() && !self.is_restoration {
                    corrected.y.copy_from_slice(&step.y);
                }
                std::mem::swap(step, &mut corrected);
                break;
            }
            if trial.theta > KAPPA_SOC * theta {
                break;
            }
            theta = trial.theta;
        }
        self.corrected = corrected;
        is_accepted
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
