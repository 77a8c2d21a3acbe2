//! A primal-dual interior-point method with a filter line search.
//!
//! Wächter & Biegler 2006, *On the implementation of an interior-point filter line-search algorithm for large-scale
//! nonlinear programming*; the names are theirs. See the crate's README for the notation.

mod barrier;
mod curvature;
mod direction;
mod filter;
mod kkt;
mod line_search;
mod options;
mod problem;
mod progress;
mod residuals;
mod saved;
mod solution;
mod start;
mod termination;

pub use options::{BarrierRule, Options};
pub use progress::{Observer, Progress};
pub use solution::{Failure, Point, Residuals, Solution, Status};

use std::ops::ControlFlow;

use crate::linalg::largest;
use crate::optimization::problem::Nlp;
use barrier::{Barrier, Rest};
use direction::NewtonSystem;
use line_search::{LineSearch, Search};
use problem::BarrierProblem;
use problem::errors::Errors;
use problem::iterate::Step;
use saved::Saved;
use termination::Termination;

/// So many steps in a row of less than this length lead nowhere.
const SHORT: f64 = 1e-6;
const MAX_SHORT: usize = 10;
/// By what factor a soft step has to reduce the error, and how many may follow each other.
const KAPPA_SOFT: f64 = 0.9999;
const MAX_SOFT: usize = 10;

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
        let (point, done) = (run.problem.point(), run.iterations);
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
        let factor_entries = run.newton.kkt.n_entries();
        let has_lost_pivots = run.newton.kkt.has_lost_pivots();
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
    problem: BarrierProblem<'a>,
    newton: NewtonSystem,
    step: Step,
    barrier: Barrier,
    line_search: LineSearch,
    termination: Termination,
    rest: Rest,
    iterations: usize,
    n_short: usize,
    /// Soft steps in a row, and what they go back to.
    n_soft: usize,
    saved: Saved,
}

impl<'a> Run<'a> {
    fn new(nlp: &'a mut dyn Nlp, options: &'a Options, iterations: usize) -> Self {
        let problem = BarrierProblem::new(nlp, options);
        let shape = &problem.form.shape;
        let (own, n_all, m) = (shape.own(), shape.n_all(), shape.m);
        Run {
            newton: NewtonSystem::new(&problem.form, options),
            step: Step::new(n_all, m),
            barrier: Barrier::new(options.barrier, own, m),
            line_search: LineSearch::new(n_all, m),
            termination: Termination::new(own, m),
            rest: Rest::default(),
            iterations,
            n_short: 0,
            n_soft: 0,
            saved: Saved::new(own, m),
            problem,
        }
    }

    fn run(&mut self, start: Option<&Point>, observer: &mut dyn Observer) -> Exit {
        let exit = match start::start(&mut self.problem, &mut self.newton, start) {
            Ok(()) => {
                let theta = self.problem.merit().theta;
                self.line_search.filter.start(theta);
                self.barrier.start(&self.problem);
                self.iterate(observer)
            }
            Err(status) => Exit::Ended(status),
        };
        match exit {
            Exit::Ended(status) => Exit::Ended(self.termination.settle(&mut self.problem, status)),
            other => other,
        }
    }

    /// The iteration, for the problem itself and for the least violation.
    fn iterate(&mut self, observer: &mut dyn Observer) -> Exit {
        loop {
            let mut errors = self.problem.errors();
            if let Some(exit) = self.check(&errors, observer) {
                return exit;
            }
            // The next barrier problem, when this one is solved to a multiple of μ.
            while let Some(mu) = self.barrier.next(&self.problem, &errors, &mut self.rest) {
                self.set_mu(mu);
                if !self.problem.form.has_shape() {
                    return Exit::Reshaped;
                }
                if let Err(failure) = self.problem.evaluate() {
                    return Exit::Ended(Status::NumericalFailure(failure));
                }
                errors = self.problem.errors();
            }
            // Newton's step, and as much of it as the filter accepts.
            let newton = self.newton_step();
            let options = self.problem.options;
            if let Some(over) = options.limit.over() {
                return Exit::Ended(Status::Over(over));
            }
            let search = match newton {
                Ok(()) if self.line_search.is_ray(&mut self.problem, &self.step) => {
                    return Exit::Ended(Status::Unbounded);
                }
                Ok(()) => {
                    self.line_search
                        .search(&mut self.problem, &mut self.newton, &mut self.step)
                }
                Err(_) if !self.problem.form.has_shape() => return Exit::Reshaped,
                Err(_) => Search::Failed,
            };
            if self.leads_nowhere(search) {
                self.n_short = 0;
                if newton.is_ok() && self.soft_step(&errors) {
                    self.iterations += 1;
                    continue;
                }
                let is_feasible = errors.primal <= 1e-2 * options.tolerance;
                if self.problem.is_restoration() || is_feasible {
                    return Exit::Ended(Status::NumericalFailure(Failure::Restoration));
                }
                if let Some(exit) = self.restore(observer) {
                    return exit;
                }
                continue;
            }
            self.n_soft = 0;
            let dual = (self.problem.iterate).dual_length(&self.step, self.problem.tau);
            self.accept(dual);
            if let Err(failure) = self.problem.evaluate_derivatives() {
                return Exit::Ended(Status::NumericalFailure(failure));
            }
            self.iterations += 1;
        }
    }

    /// Whether the line search has failed, or too many steps in a row have been short.
    fn leads_nowhere(&mut self, search: Search) -> bool {
        let count = |n: usize, holds: bool| if holds { n + 1 } else { 0 };
        self.rest.n_tiny = count(self.rest.n_tiny, search == Search::Tiny);
        let is_short = search == Search::Accepted && self.line_search.alpha < SHORT;
        self.n_short = count(self.n_short, is_short);
        search == Search::Failed || self.n_short >= MAX_SHORT
    }

    /// Whether the run ends here.
    fn check(&mut self, errors: &Errors, observer: &mut dyn Observer) -> Option<Exit> {
        let options = self.problem.options;
        let error = errors.optimality(&self.problem.iterate, options.mu_target);
        if self.report(errors, observer).is_break() {
            return Some(Exit::Ended(Status::Stopped));
        }
        if self.problem.is_restoration() {
            let merit = self.problem.restored();
            if merit.is_some_and(|merit| self.line_search.outer_filter.accepts(merit)) {
                return Some(Exit::Restored);
            }
            if Termination::is_converged(&self.problem, error) {
                return Some(Exit::Ended(Status::LocallyInfeasible));
            }
        } else {
            let (problem, rest) = (&self.problem, &mut self.rest);
            let status = self.termination.check(problem, errors, error, rest);
            if let Some(status) = status {
                return Some(Exit::Ended(status));
            }
        }
        if self.iterations >= options.max_iterations {
            return Some(Exit::Ended(Status::IterationLimit));
        }
        let over = options.limit.over();
        over.map(|over| Exit::Ended(Status::Over(over)))
    }

    fn report(&mut self, errors: &Errors, observer: &mut dyn Observer) -> ControlFlow<()> {
        let (problem, search) = (&mut self.problem, &self.line_search);
        let n_active = problem.iterate.n_active();
        observer.iteration(&Progress {
            iteration: self.iterations,
            is_restoration: problem.is_restoration(),
            objective: problem.objective(),
            primal: errors.primal,
            dual: errors.dual,
            mu: problem.mu,
            gap: n_active as f64 * problem.mu / problem.form.objective_scale,
            step: largest(&self.step.v[..problem.iterate.nv]),
            regularization: self.newton.kkt.regularization,
            step_lengths: (search.alpha, search.alpha_dual),
            trials: search.trial.count,
            w: &problem.form.w,
        })
    }

    /// Sets μ; whether rows or bounds have followed it.
    fn set_mu(&mut self, mu: f64) -> bool {
        self.line_search.filter.clear();
        let has_moved = self.problem.set_mu(mu);
        if has_moved {
            self.barrier.forget();
            self.termination.acceptable.clear();
        }
        has_moved
    }

    /// The step, for the present μ or for the one that is best.
    fn newton_step(&mut self) -> Result<(), Failure> {
        self.newton.factor(&mut self.problem)?;
        if let Some(mu) = self.barrier.choose(&self.problem, &mut self.newton)? {
            if !self.set_mu(mu) {
                self.barrier.combine(mu, &mut self.step);
                return Ok(());
            }
            if !self.problem.form.has_shape() {
                return Err(Failure::LinearSystem);
            }
            self.problem.evaluate()?;
            self.newton.factor(&mut self.problem)?;
        }
        self.newton.step(&self.problem, &mut self.step)
    }

    /// Goes to the trial point.
    fn accept(&mut self, alpha_dual: f64) {
        let search = &mut self.line_search;
        search.alpha_dual = alpha_dual;
        (self.problem).accept(&search.trial, &self.step, search.alpha, alpha_dual);
    }

    /// Takes the step that the line search has refused if it reduces the error of the barrier problem: near a solution it
    /// does, and the filter only sees rounding. Wächter & Biegler 2006, section 3.3.
    fn soft_step(&mut self, errors: &Errors) -> bool {
        let problem = &mut self.problem;
        // Far from feasible points the error may fall to where nothing is feasible.
        let is_near = errors.primal <= problem.options.acceptable_tolerance;
        if problem.is_restoration() || !is_near || self.n_soft >= MAX_SOFT {
            return false;
        }
        let before = errors.optimality(&problem.iterate, problem.mu);
        self.saved.save(problem, before);
        let (at, tau) = (problem.merit(), problem.tau);
        let dual = problem.iterate.dual_length(&self.step, tau);
        let alpha = problem.iterate.primal_length(&self.step, tau).min(dual);
        self.line_search.alpha = alpha;
        let trial = problem.try_point(&self.step, alpha, &mut self.line_search.trial);
        let mut is_better = false;
        if trial.is_some() {
            self.accept(alpha);
            let problem = &mut self.problem;
            is_better = problem.evaluate_derivatives().is_ok() && {
                let errors = problem.errors();
                errors.optimality(&problem.iterate, problem.mu) <= KAPPA_SOFT * before
            };
        }
        if is_better {
            self.line_search.filter.add(at);
            self.n_soft += 1;
        } else {
            self.saved.restore(&mut self.problem.iterate);
            // These values were finite before.
            let _ = self.problem.evaluate();
        }
        is_better
    }

    /// Goes to a point with less violation that the filter accepts, or says why there is none.
    fn restore(&mut self, observer: &mut dyn Observer) -> Option<Exit> {
        let at = self.problem.merit();
        self.line_search.filter.add(at);
        self.line_search.swap_filters();
        let mu = self.problem.enter_restoration(at.theta);
        let before = self.iterations;
        self.set_mu(mu);
        let exit = match self.problem.evaluate() {
            Ok(()) => {
                let theta = self.problem.merit().theta;
                self.line_search.filter.start(theta);
                self.iterate(observer)
            }
            Err(failure) => Exit::Ended(Status::NumericalFailure(failure)),
        };
        self.line_search.swap_filters();
        self.problem.leave_restoration();
        self.newton.estimate_multipliers(&mut self.problem);
        // What is not finite here ends the iteration at the next point.
        let _ = self.problem.evaluate();
        let violation = largest(&self.problem.values.residual);
        let tolerance = self.problem.options.tolerance;
        match exit {
            Exit::Restored => None,
            // Nothing is violated, and yet the filter does not take it: it starts anew.
            Exit::Ended(Status::LocallyInfeasible) if violation <= 1e2 * tolerance => {
                self.line_search.filter.clear();
                let is_stuck = self.iterations == before;
                is_stuck.then_some(Exit::Ended(Status::NumericalFailure(Failure::Restoration)))
            }
            _ => Some(exit),
        }
    }

    /// A direction of negative curvature at a solution. `None` also where the last step has shown that there is none.
    fn falling(&mut self, status: Status) -> Option<Vec<f64>> {
        let is_shown = self.line_search.alpha > 0.0 && !self.newton.kkt.is_corrected();
        if status != Status::Solved || is_shown || self.problem.form.shape.n == 0 {
            return None;
        }
        curvature::falling(&mut self.problem, &mut self.newton)
    }
}

#[cfg(test)]
mod tests;
