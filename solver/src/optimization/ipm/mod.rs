//! A primal-dual interior-point method with a filter line search.
//!
//! Wächter & Biegler 2006, *On the implementation of an interior-point filter line-search algorithm for large-scale
//! nonlinear programming*; the names are theirs. See the crate's README for the notation.

mod barrier;
mod curvature;
mod direction;
mod evaluation;
mod filter;
mod form;
mod kkt;
mod line_search;
mod options;
mod progress;
mod residuals;
mod restoration;
mod saved;
mod solution;
mod start;

pub use options::{BarrierRule, Options};
pub use progress::{Observer, Progress};
pub use solution::{Failure, Point, Residuals, Solution, Status};

use crate::linalg::largest;
use crate::optimization::problem::Nlp;
use barrier::Barrier;
use direction::Step;
use filter::Filter;
use form::Form;
use kkt::Kkt;
use line_search::Search;
use residuals::Errors;
use restoration::Elastic;
use saved::{Saved, Stall};

const KAPPA_EPSILON: f64 = 10.0;
const TAU_MIN: f64 = 0.99;
const KAPPA_SIGMA: f64 = 1e10;
/// Absolute tolerances in the units of the problem: gradient of the Lagrangian, rows, complementarity.
const ABSOLUTE: [f64; 3] = [1.0, 1e-4, 1e-4];
const ABSOLUTE_ACCEPTABLE: [f64; 3] = [1e10, 1e-2, 1e-2];
/// So many steps in a row of less than this length lead nowhere.
const SHORT: f64 = 1e-6;
const MAX_SHORT: usize = 10;
/// The error of a barrier problem that has come to rounding is not tried with a μ below this.
const LAST_STALL: f64 = 1e-10;
/// A variable or objective beyond this is unbounded.
const BEYOND: f64 = 1e20;

/// Finds a local minimum of a nonlinear program, from `start` or from where the problem says.
///
/// Never fails: [`Solution::status`] says what was reached, [`Solution::residuals`] how far it is from a solution.
pub fn solve(
    nlp: &mut dyn Nlp,
    options: &Options,
    start: Option<&Point>,
    observer: &mut dyn Observer,
) -> Solution {
    let mu = start.map_or(options.mu_init, |point| point.mu);
    nlp.follow(mu.max(options.mu_target));
    let mut start = start.cloned();
    let mut iterations = 0;
    // Where a relaxation fixes or frees variables or rows on its way, the form is made anew.
    loop {
        let mut run = Run::new(nlp, options, iterations);
        let exit = run.run(start.as_ref(), observer);
        let (point, done) = (run.point(), run.iterations);
        let status = match exit {
            Exit::Reshaped => {
                iterations = done;
                start = Some(point);
                continue;
            }
            Exit::Ended(status) => status,
            // Only inner runs are restored.
            Exit::Restored => Status::NumericalFailure(Failure::Restoration),
        };
        let falling = run.falling(status);
        let factor_entries = run.kkt.n_entries();
        let has_lost_pivots = run.kkt.has_lost_pivots();
        let Point { w, y, z_l, z_u, mu } = point;
        let residuals = residuals::residuals(nlp, &w, &y, &z_l, &z_u);
        return Solution {
            objective: nlp.objective(&w),
            w,
            y,
            z_l,
            z_u,
            mu,
            status,
            residuals,
            iterations: done,
            factor_entries,
            has_lost_pivots,
            falling,
        };
    }
}

/// Why the iteration ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Exit {
    Ended(Status),
    /// Other variables are fixed or other rows are equations than before.
    Reshaped,
    /// The violation has decreased so far that the problem itself can go on.
    Restored,
}

struct Run<'a> {
    form: Form<'a>,
    options: &'a Options,
    kkt: Kkt,
    iterations: usize,
    /// The point: x, slacks and, while the violation is minimized, p and n; multipliers of rows and bounds.
    v: Vec<f64>,
    y: Vec<f64>,
    z_l: Vec<f64>,
    z_u: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Values at the point: objective, c, r, its gradient and that of the Lagrangian without bounds, derivatives.
    f: f64,
    c: Vec<f64>,
    residual: Vec<f64>,
    gradient: Vec<f64>,
    lagrangian: Vec<f64>,
    jacobian: Vec<f64>,
    hessian: Vec<f64>,
    /// Σ; right-hand side and solution of the linear system; residuals the step removes.
    sigma: Vec<f64>,
    rhs: Vec<f64>,
    reduced: Vec<f64>,
    target: Vec<f64>,
    step: Step,
    corrected: Step,
    trial: Vec<f64>,
    trial_f: f64,
    trial_c: Vec<f64>,
    trial_residual: Vec<f64>,
    mu: f64,
    tau: f64,
    barrier: Barrier,
    /// Whether rows or bounds have followed μ.
    follows: bool,
    filter: Filter,
    /// The filter of the problem itself while the violation is minimized.
    outer_filter: Filter,
    elastic: Elastic,
    is_restoration: bool,
    /// Of the last step: lengths, number of points tried.
    alpha: f64,
    alpha_dual: f64,
    trials: usize,
    n_tiny: usize,
    n_short: usize,
    n_acceptable: usize,
    /// Whether the error of the barrier problem becomes no smaller.
    stall: Stall,
    is_stalled: bool,
    /// Soft steps in a row, what they go back to, and the best acceptable point.
    n_soft: usize,
    saved: Saved,
    acceptable: Saved,
}

impl<'a> Run<'a> {
    fn new(nlp: &'a mut dyn Nlp, options: &'a Options, iterations: usize) -> Self {
        let form = Form::new(nlp);
        let (n, m) = (form.n, form.m);
        let n_all = n + form.attached.len();
        let all = || vec![0.0; n_all];
        let rows = || vec![0.0; m];
        Run {
            kkt: Kkt::new(&form, options),
            options,
            iterations,
            v: all(),
            y: rows(),
            z_l: all(),
            z_u: all(),
            lower: all(),
            upper: vec![f64::INFINITY; n_all],
            f: 0.0,
            c: rows(),
            residual: rows(),
            gradient: all(),
            lagrangian: all(),
            jacobian: vec![0.0; form.jacobian.n_entries()],
            hessian: vec![0.0; form.hessian.n_entries()],
            sigma: all(),
            rhs: vec![0.0; n + m],
            reduced: vec![0.0; n + m],
            target: rows(),
            step: Step::new(n_all, m),
            corrected: Step::new(n_all, m),
            trial: all(),
            trial_f: 0.0,
            trial_c: rows(),
            trial_residual: rows(),
            mu: options.mu_init,
            tau: TAU_MIN,
            barrier: Barrier::new(options.barrier, n + form.n_slacks, m),
            follows: false,
            filter: Filter::new(),
            outer_filter: Filter::new(),
            elastic: Elastic::new(n + form.n_slacks),
            is_restoration: false,
            alpha: 0.0,
            alpha_dual: 0.0,
            trials: 0,
            n_tiny: 0,
            n_short: 0,
            n_acceptable: 0,
            stall: Stall::default(),
            is_stalled: false,
            n_soft: 0,
            saved: Saved::new(n + form.n_slacks, m),
            acceptable: Saved::new(n + form.n_slacks, m),
            form,
        }
    }

    fn run(&mut self, start: Option<&Point>, observer: &mut dyn Observer) -> Exit {
        let exit = match self.start(start) {
            Ok(()) => self.iterate(observer),
            Err(status) => Exit::Ended(status),
        };
        match exit {
            Exit::Ended(status) => Exit::Ended(self.settle(status)),
            other => other,
        }
    }

    /// The iteration, for the problem itself and for the least violation.
    fn iterate(&mut self, observer: &mut dyn Observer) -> Exit {
        loop {
            let mut errors = self.errors();
            if let Some(exit) = self.check(&errors, observer) {
                return exit;
            }
            // The next barrier problem, when this one is solved to a multiple of μ.
            while self.decrease_mu(&errors) {
                if !self.form.has_shape() {
                    return Exit::Reshaped;
                }
                if let Err(failure) = self.evaluate() {
                    return Exit::Ended(Status::NumericalFailure(failure));
                }
                errors = self.errors();
            }
            // Newton's step, and as much of it as the filter accepts.
            self.target.copy_from_slice(&self.residual);
            let newton = self.newton_step();
            if let Some(over) = self.options.limit.over() {
                return Exit::Ended(Status::Over(over));
            }
            let is_step = newton.is_ok();
            let search = match newton {
                Ok(()) if self.is_ray() => return Exit::Ended(Status::Unbounded),
                Ok(()) => self.line_search(),
                Err(_) if !self.form.has_shape() => return Exit::Reshaped,
                Err(_) => Search::Failed,
            };
            self.n_tiny = if search == Search::Tiny {
                self.n_tiny + 1
            } else {
                0
            };
            self.n_short = if search == Search::Accepted && self.alpha < SHORT {
                self.n_short + 1
            } else {
                0
            };
            if search == Search::Failed || self.n_short >= MAX_SHORT {
                self.n_short = 0;
                if is_step && self.soft_step(&errors) {
                    self.iterations += 1;
                    continue;
                }
                if self.is_restoration || errors.primal <= 1e-2 * self.options.tolerance {
                    return Exit::Ended(Status::NumericalFailure(Failure::Restoration));
                }
                if let Some(exit) = self.restore(observer) {
                    return exit;
                }
                continue;
            }
            self.n_soft = 0;
            let dual = self.dual_length(&self.step, self.tau);
            self.accept(dual);
            if let Err(failure) = self.evaluate_derivatives() {
                return Exit::Ended(Status::NumericalFailure(failure));
            }
            self.iterations += 1;
        }
    }

    /// The number of variables that take part.
    fn nv(&self) -> usize {
        self.form.n
            + if self.is_restoration {
                self.form.attached.len()
            } else {
                self.form.n_slacks
            }
    }

    /// Whether the run ends here.
    fn check(&mut self, errors: &Errors, observer: &mut dyn Observer) -> Option<Exit> {
        let options = self.options;
        let error = self.optimality_error(errors, options.mu_target);
        let nv = self.nv();
        // A bound is active where its multiplier is larger than the distance from it; z = 0 where it is infinite.
        let lower = (0..nv).filter(|&i| self.z_l[i] >= self.v[i] - self.lower[i]);
        let upper = (0..nv).filter(|&i| self.z_u[i] >= self.upper[i] - self.v[i]);
        let n_active = lower.count() + upper.count();
        let progress = Progress {
            iteration: self.iterations,
            is_restoration: self.is_restoration,
            objective: self.objective(),
            primal: errors.primal,
            dual: errors.dual,
            mu: self.mu,
            gap: n_active as f64 * self.mu / self.form.objective_scale,
            step: largest(&self.step.v[..nv]),
            regularization: self.kkt.regularization,
            step_lengths: (self.alpha, self.alpha_dual),
            trials: self.trials,
            w: &self.form.w,
        };
        if observer.iteration(&progress).is_break() {
            return Some(Exit::Ended(Status::Stopped));
        }
        let [dual, primal, complementarity] = ABSOLUTE;
        // What follows μ has not arrived before μ has.
        let has_arrived = !self.follows || self.mu <= self.mu_floor();
        let is_converged = error <= options.tolerance && (has_arrived || self.is_restoration);
        if self.is_restoration {
            if self.is_restored() {
                return Some(Exit::Restored);
            }
            if is_converged {
                return Some(Exit::Ended(Status::LocallyInfeasible));
            }
        } else {
            if is_converged && self.is_within(errors, dual, primal, complementarity) {
                return Some(Exit::Ended(Status::Solved));
            }
            let [dual, primal, complementarity] = ABSOLUTE_ACCEPTABLE;
            let is_acceptable = error <= options.acceptable_tolerance
                && has_arrived
                && self.is_within(errors, dual, primal, complementarity);
            self.n_acceptable = if is_acceptable {
                self.keep_acceptable(error);
                self.n_acceptable + 1
            } else {
                0
            };
            self.is_stalled = is_acceptable && self.stalls(errors);
            // Smaller distances from bounds than these do not pay for more of it.
            let is_last = self.is_stalled && self.mu <= LAST_STALL.max(self.mu_floor());
            if is_last || self.n_acceptable >= options.acceptable_iterations {
                return Some(Exit::Ended(Status::Acceptable));
            }
            let is_beyond = largest(&self.v[..self.form.n]) > BEYOND
                || self.f < -BEYOND && errors.primal <= options.acceptable_tolerance;
            if is_beyond {
                return Some(Exit::Ended(Status::Unbounded));
            }
        }
        if self.iterations >= options.max_iterations {
            return Some(Exit::Ended(Status::IterationLimit));
        }
        let over = options.limit.over();
        over.map(|over| Exit::Ended(Status::Over(over)))
    }

    /// Goes to the trial point; multipliers stay near μ / distance.
    fn accept(&mut self, alpha_dual: f64) {
        let nv = self.nv();
        self.form.load(&self.trial);
        self.f = self.trial_f;
        self.c.copy_from_slice(&self.trial_c);
        self.residual.copy_from_slice(&self.trial_residual);
        self.alpha_dual = alpha_dual;
        self.v[..nv].copy_from_slice(&self.trial[..nv]);
        for (y, dy) in self.y.iter_mut().zip(&self.step.y) {
            *y += self.alpha * dy;
        }
        for i in 0..nv {
            self.z_l[i] += self.alpha_dual * self.step.z_l[i];
            self.z_u[i] += self.alpha_dual * self.step.z_u[i];
        }
        self.reset_multipliers(KAPPA_SIGMA);
        self.keep_interior();
    }

    /// z within μ / d divided and multiplied by `factor`. Wächter & Biegler 2006, eq. (16).
    fn reset_multipliers(&mut self, factor: f64) {
        for i in 0..self.nv() {
            let (lower, upper) = (self.v[i] - self.lower[i], self.upper[i] - self.v[i]);
            let clamp = |z: f64, d: f64| z.min(factor * self.mu / d).max(self.mu / (factor * d));
            self.z_l[i] = clamp(self.z_l[i], lower);
            self.z_u[i] = clamp(self.z_u[i], upper);
        }
    }

    /// Bounds that rounding has reached move outward a little.
    fn keep_interior(&mut self) {
        let least = f64::EPSILON * self.mu.min(1.0);
        let room = f64::EPSILON.powf(0.75);
        for i in 0..self.nv() {
            if self.v[i] - self.lower[i] < least {
                self.lower[i] = self.v[i] - room * self.v[i].abs().max(1.0);
            }
            if self.upper[i] - self.v[i] < least {
                self.upper[i] = self.v[i] + room * self.v[i].abs().max(1.0);
            }
        }
    }

    fn objective(&mut self) -> f64 {
        let f = if self.is_restoration {
            self.form.objective()
        } else {
            self.f
        };
        f / self.form.objective_scale
    }

    /// The point in the units of the problem.
    fn point(&mut self) -> Point {
        let form = &mut self.form;
        form.load(&self.v);
        let n_rows = form.nlp.n_rows();
        let mut point = Point {
            w: form.w.clone(),
            y: vec![0.0; n_rows],
            z_l: vec![0.0; form.w.len()],
            z_u: vec![0.0; form.w.len()],
            mu: self.mu,
        };
        for ((&row, &y), &scale) in form.rows.iter().zip(&self.y).zip(&form.row_scale) {
            point.y[row as usize] = scale * y / form.objective_scale;
        }
        for (i, &variable) in form.variables.iter().enumerate() {
            point.z_l[variable as usize] = self.z_l[i] / form.objective_scale;
            point.z_u[variable as usize] = self.z_u[i] / form.objective_scale;
        }
        form.complete(&mut point);
        point
    }
}

#[cfg(test)]
mod tests;
