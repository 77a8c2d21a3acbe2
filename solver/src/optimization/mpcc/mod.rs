//! Nonlinear programs with complementarity constraints.
//!
//! minimize f(w)   subject to   cl <= c(w) <= cu,   l <= w <= u,   0 <= a ⟂ b >= 0
//!
//! 1. **Relax.** In vertical form ([`Lifted`]) the pairs are replaced by a relaxation ([`Relaxed`]) whose parameter σ
//!    follows the barrier parameter of one interior-point run.
//! 2. **Polish.** At moderate σ one side of every pair is held at zero; the branch is an ordinary nonlinear program,
//!    and its solution has products that are exactly zero. An infeasible branch sends back to a smaller σ.
//! 3. **Certify.** Multipliers tell the stationarity class ([`Class`]). Where that is not S, a linear program with
//!    complementarity constraints decides about B-stationarity; a direction of descent is a better branch to polish.

mod branch;
mod certificate;
mod in_units;
mod lift;
pub mod linear;
mod local;
mod multistart;
mod observer;
mod options;
mod relaxed;
mod solution;
mod way;
mod work;

#[cfg(test)]
mod tests;

use std::sync::Arc;

use crate::optimization::ipm;
use crate::optimization::mpcc::branch::leave::{BOXES, gain};
use crate::optimization::mpcc::branch::polish::{Goal, Guess, Polished, polish};
use crate::optimization::mpcc::branch::reach::reach;
use crate::optimization::problem::{Mpcc, Nlp};
use crate::optimization::scaling::{Scaled, Sizes};
use branch::{Branch, choose};
use certificate::Certificate;
use in_units::InUnits;
use way::{DeadEnd, ways};
use work::{MAX_SWITCHES, Work};

pub use crate::optimization::mpcc::certificate::class::Class;
pub use crate::optimization::mpcc::certificate::unique::alternatives;
pub use crate::optimization::mpcc::relaxed::relaxation::{Relaxation, Steering};
pub use certificate::{Residuals, Tolerances};
pub use lift::Lifted;
pub use multistart::{MultiStart, Spread, deviate, multistart, perturbed};
pub use observer::{Observer, Program};
pub use options::{Homotopy, Iterations, Options, Trust};
pub use relaxed::{Coupling, Form, Relaxed};
pub use solution::{Multipliers, Solution, Stats, Status};

/// Finds a local minimum from where the problem starts.
///
/// Never fails: [`Solution::status`] says what was reached.
///
/// ```
/// use nsd_solver::optimization::mpcc::{self, Class, Options, Status};
/// use nsd_solver::optimization::problem::Side;
/// use nsd_solver::optimization::quadratic::{Function, Quadratic};
///
/// // minimize (x - 1)² + (y - 2)²   subject to   0 <= x ⟂ y >= 0, from (3, 0)
/// let objective = Function::default()
///     .product(0, 0, 1.0)
///     .product(1, 1, 1.0)
///     .linear(0, -2.0)
///     .linear(1, -4.0)
///     .constant(5.0);
/// let mut problem = Quadratic::new(2, objective, Vec::new())
///     .bound(0, 0.0, f64::INFINITY)
///     .bound(1, 0.0, f64::INFINITY)
///     .start(&[3.0, 0.0])
///     .complement(Side::Variable(0), Side::Variable(1));
///
/// let solution = mpcc::solve(&mut problem, &Options::default());
/// assert_eq!(solution.status, Status::Solved);
/// assert_eq!(solution.class, Class::S);
/// assert_eq!(solution.residuals.product, 0.0);
/// ```
///
/// # Panics
///
/// When a side of a pair has no finite lower bound.
pub fn solve(problem: &mut dyn Mpcc, options: &Options) -> Solution {
    let start = problem.start().to_vec();
    solve_from(problem, &start, options)
}

/// Finds a local minimum from a point, as [`solve`] does.
///
/// # Panics
///
/// When the point has more or fewer values than the problem has variables, sizes are those of another one, or as [`solve`].
pub fn solve_from(problem: &mut dyn Mpcc, start: &[f64], options: &Options) -> Solution {
    solve_observed(problem, start, options, &mut ())
}

/// Finds a local minimum from a point, as [`solve_from`] does, and tells of every iteration.
///
/// # Panics
///
/// As [`solve_from`].
pub fn solve_observed(
    problem: &mut dyn Mpcc,
    start: &[f64],
    options: &Options,
    observer: &mut dyn Observer,
) -> Solution {
    assert_eq!(start.len(), problem.n_variables(), "one value per variable");
    let Some(sizes) = &options.certificate.sizes else {
        return solve_lifted(problem, start, options, observer);
    };
    assert!(sizes.fit(problem), "sizes are those of the problem");
    let found = solve_scaled(problem, start, options, sizes, observer);
    // Where what was reached is much smaller than it was taken for, tolerances have been too large.
    let smaller = sizes.at(problem, &found.w).filter(|_| found.is_feasible());
    let Some(sizes) = smaller else {
        return found;
    };
    let options = Options {
        trust: Trust::First,
        effort: 0,
        certificate: Tolerances {
            sizes: Some(Arc::new(sizes.clone())),
            ..options.certificate.clone()
        },
        ..options.clone()
    };
    let mut finer = solve_scaled(problem, &found.w, &options, &sizes, observer);
    finer.stats.iterations += found.stats.iterations;
    finer.stats.seconds += found.stats.seconds;
    let is_kept = finer.status == Status::Solved || found.status != Status::Solved;
    if finer.is_feasible() && is_kept {
        return finer;
    }
    let residuals = residuals(problem, &found.w, &sizes);
    match residuals.violation.max(residuals.complementarity) <= options.feasibility {
        // Feasible to smaller tolerances, and not known to be stationary to them.
        true => Solution {
            status: match found.status {
                Status::Solved => Status::Feasible,
                status => status,
            },
            class: Class::None,
            residuals,
            stats: finer.stats,
            ..found
        },
        false => finer,
    }
}

/// Those of a point in units of these sizes.
fn residuals(problem: &mut dyn Mpcc, w: &[f64], sizes: &Sizes) -> Residuals {
    let mut scaled = Scaled::new(problem, sizes);
    let w = scaled.scaled(w);
    let mut lifted = Lifted::new(&mut scaled);
    let w = lifted.extend(&w);
    Residuals::new(&mut lifted, &w)
}

/// Finds a local minimum from a point, in units of these sizes.
fn solve_scaled(
    problem: &mut dyn Mpcc,
    start: &[f64],
    options: &Options,
    sizes: &Sizes,
    observer: &mut dyn Observer,
) -> Solution {
    let mut scaled = Scaled::new(problem, sizes);
    let start = scaled.scaled(start);
    let mut observer = InUnits {
        observer,
        objective: sizes.objective,
    };
    let options = Options {
        trust: options.trust.in_units(sizes.objective),
        ..options.clone()
    };
    let found = solve_lifted(&mut scaled, &start, &options, &mut observer);
    in_units::solution(scaled, sizes, found)
}

/// Finds a local minimum from a point, in the units of the problem.
fn solve_lifted(
    problem: &mut dyn Mpcc,
    start: &[f64],
    options: &Options,
    observer: &mut dyn Observer,
) -> Solution {
    let mut run = Work::new(options, observer);
    let mut lifted = Lifted::new(problem);
    let start = lifted.extend(start);
    let mut solution = if lifted.pairs().is_empty() {
        run.smooth(&mut lifted, &start)
    } else {
        run.complementary(&mut lifted, &start)
    };
    lifted.settle(None);
    solution.stats.seconds = run.clock.elapsed().as_secs_f64();
    solution
}

/// How often a branch is left for one in which another point means the same.
const MAX_MOVES: usize = 200;
/// An objective below this at a feasible point, where no stationary one is found, has no bound.
const UNBOUNDED: f64 = -1e10;

impl Work<'_> {
    /// A problem without pairs is that of the interior-point method, and polished as its only branch: bounds with small
    /// multipliers are not reached before.
    fn smooth(&mut self, lifted: &mut Lifted<'_>, start: &[f64]) -> Solution {
        if self.options.trust != Trust::No {
            let guess = Guess {
                w: start.to_vec(),
                y: vec![0.0; lifted.n_rows()],
            };
            let near = polish(lifted, &guess, &[], self.options.trust.goal(), self);
            if let Some(near) = near.ok().filter(|near| near.is_optimal) {
                return self.of_smooth(lifted, near);
            }
        }
        let mut program = Branch::new(lifted, &[], start);
        let found = self.minimize(
            Program::Smooth,
            &mut program,
            ipm::Options::default(),
            None,
            &mut (),
        );
        let residuals = Residuals::new(lifted, &found.w);
        let point = Guess {
            w: found.w,
            y: found.y,
        };
        if residuals.violation > self.options.feasibility
            || !found.objective.is_finite()
            || found.status == ipm::Status::Unbounded
        {
            let end = DeadEnd {
                w: point.w,
                residuals,
                status: found.status,
                branch: None,
            };
            return self.dead_end(lifted, end);
        }
        let polished = Polished {
            objective: found.objective,
            zeros: Vec::new(),
            residuals,
            is_optimal: found.status.is_solved(),
            falling: found.falling,
            point,
        };
        let best = match polish(lifted, &polished.point, &[], Goal::Solution, self) {
            Ok(finer) if finer.is_optimal => finer,
            _ => polished,
        };
        self.of_smooth(lifted, best)
    }

    /// The solution of a problem without pairs that a point is, or leads to where its Lagrangian curves down.
    fn of_smooth(&mut self, lifted: &mut Lifted<'_>, best: Polished) -> Solution {
        let best = self.fall(lifted, best);
        let certificate = self.certify(lifted, &best.point);
        let candidate = Candidate {
            best,
            certificate,
            others: 0,
        };
        self.feasible(lifted, candidate)
    }

    fn complementary(&mut self, lifted: &mut Lifted<'_>, start: &[f64]) -> Solution {
        let size = lifted.n_variables() + lifted.n_rows();
        let mut best: Option<Candidate> = None;
        let mut end: Option<DeadEnd> = None;
        if self.options.trust != Trust::No {
            let guess = Guess {
                w: start.to_vec(),
                y: vec![0.0; lifted.n_rows()],
            };
            let zeros = choose(lifted, start);
            match polish(lifted, &guess, &zeros, self.options.trust.goal(), self) {
                Ok(polished) => best = Some(self.improve(lifted, polished, &[])),
                Err(status) if self.options.trust.is_alone() => {
                    let residuals = Residuals::new(lifted, &guess.w);
                    let (w, branch) = (guess.w, Some(status));
                    let failed = DeadEnd {
                        w,
                        residuals,
                        status,
                        branch,
                    };
                    return self.dead_end(lifted, failed);
                }
                Err(_) => {}
            }
        }
        for (index, way) in ways(self.options).into_iter().enumerate() {
            let is_enough = |best: &Candidate| {
                self.options.trust.is_alone() || self.is_enough(best, index, size)
            };
            let is_over = |best: &Candidate| self.is_over() || is_enough(best);
            if best.as_ref().is_some_and(is_over) || index > 0 && self.is_over() {
                break;
            }
            self.stats.restarts = index;
            match way.follow(lifted, start, self) {
                Ok(polished) => {
                    let candidate = self.improve(lifted, polished, &[]);
                    if best.as_ref().is_none_or(|best| candidate.is_better(best)) {
                        best = Some(candidate);
                    }
                }
                Err(other) => {
                    if end.as_ref().is_none_or(|end| other.is_better(end)) {
                        end = Some(other);
                    }
                }
            }
        }
        match best {
            Some(best) => {
                let best = self.leave_weak(lifted, best);
                self.feasible(lifted, best)
            }
            None => self.dead_end(lifted, end.expect("one way was tried")),
        }
    }

    /// What is better than a point with a direction of descent, in boxes along it; the point itself where it has none.
    fn leave_weak(&mut self, lifted: &mut Lifted<'_>, best: Candidate) -> Candidate {
        let is_wanted = self.options.effort > 0 && !self.is_over();
        let Some(step) = best.certificate.descent.as_ref().filter(|_| is_wanted) else {
            return best;
        };
        lifted.settle(Some(&best.best.zeros));
        let Some(next) = self.leave(lifted, &best.best, step, &BOXES) else {
            return best;
        };
        self.stats.switches += 1;
        let next = self.improve(lifted, next, &BOXES);
        match next.is_better(&best) {
            true => next,
            false => best,
        }
    }

    /// Whether way `index` is not worth its time, in a problem with so many variables and rows.
    fn is_enough(&self, best: &Candidate, index: usize, size: usize) -> bool {
        let effort = self.stats.iterations.saturating_mul(size);
        let Options {
            effort: wanted,
            patience,
            ..
        } = *self.options;
        match best.is_stationary() {
            // What a start that is trusted leads to says nothing about other ways.
            _ if index == 0 => wanted == 0,
            true => effort > wanted,
            false => effort > patience,
        }
    }

    /// Takes better branches as long as the certificate finds them, or what is better in boxes of these widths.
    fn improve(&mut self, lifted: &mut Lifted<'_>, mut best: Polished, boxes: &[f64]) -> Candidate {
        let mut known: Option<Certificate> = None;
        loop {
            lifted.settle(Some(&best.zeros));
            let certificate = match known.take() {
                Some(certificate) => certificate,
                None => {
                    best = self.fall(lifted, best);
                    self.certify(lifted, &best.point)
                }
            };
            self.tell(&best, &certificate);
            let Some(step) = &certificate.descent else {
                match self.elsewhere(lifted, &best, &certificate) {
                    Elsewhere::Better(better) => {
                        best = better.0;
                        known = Some(better.1);
                    }
                    Elsewhere::Nothing(others) => {
                        return Candidate {
                            best,
                            certificate,
                            others,
                        };
                    }
                }
                continue;
            };
            if self.stats.switches >= MAX_SWITCHES || self.is_over() {
                return Candidate {
                    best,
                    certificate,
                    others: 0,
                };
            }
            match self.leave(lifted, &best, step, boxes) {
                Some(next) => {
                    self.stats.switches += 1;
                    best = next;
                }
                None => {
                    return Candidate {
                        best,
                        certificate,
                        others: 0,
                    };
                }
            }
        }
    }

    /// A better branch among those in which another point means the same as this one.
    fn elsewhere(
        &mut self,
        lifted: &mut Lifted<'_>,
        best: &Polished,
        certificate: &Certificate,
    ) -> Elsewhere {
        if self.stats.moves >= MAX_MOVES || self.options.patience == 0 {
            return Elsewhere::Nothing(0);
        }
        let size = best.objective.abs().max(1.0);
        let others = lifted.others(&best.point.w, &best.zeros, &certificate.y);
        let mut n_worse = 0;
        for (number, other) in others.into_iter().enumerate() {
            if self.is_over() {
                return Elsewhere::Nothing(0);
            }
            let (w, zeros) = lifted.moved(&other, &best.point.w, &best.zeros);
            // Multipliers of another branch are worse than none.
            let guess = Guess {
                y: vec![0.0; best.point.y.len()],
                w,
            };
            let below = best.objective - 1e-10 * size;
            let goal = match number {
                0 => Goal::Below(below),
                _ => Goal::Near(below),
            };
            let next = match polish(lifted, &guess, &zeros, goal, self) {
                Ok(next) => next,
                Err(status) => {
                    n_worse += usize::from(status == ipm::Status::Stopped);
                    continue;
                }
            };
            n_worse += usize::from(next.is_optimal && next.objective >= below);
            if next.objective < below {
                lifted.settle(Some(&next.zeros));
                let certificate = self.certify(lifted, &next.point);
                if certificate.class != Class::None {
                    self.stats.moves += 1;
                    return Elsewhere::Better(Box::new((next, certificate)));
                }
            }
        }
        Elsewhere::Nothing(n_worse)
    }

    /// The residuals of a point in the units of the problem.
    fn measured(&self, lifted: &mut Lifted<'_>, w: &[f64], residuals: Residuals) -> Residuals {
        match self.options.certificate.sizes.as_deref() {
            Some(sizes) => Residuals::measured(lifted, w, Some(sizes)),
            None => residuals,
        }
    }

    /// Goes to the nearest point that keeps the rows to little more than rounding, with its certificate; false where there is
    /// none.
    fn reaches_rows(&mut self, lifted: &mut Lifted<'_>, candidate: &mut Candidate) -> bool {
        let Candidate {
            best, certificate, ..
        } = candidate;
        lifted.settle(Some(&best.zeros));
        let Some(w) = reach(lifted, &best.zeros, &best.point.w, self) else {
            return false;
        };
        best.point.w = w;
        best.residuals = Residuals::new(lifted, &best.point.w);
        best.objective = lifted.objective(&best.point.w);
        *certificate = self.certify(lifted, &best.point);
        best.is_accurate()
    }

    fn feasible(&mut self, lifted: &mut Lifted<'_>, mut candidate: Candidate) -> Solution {
        if !candidate.best.is_accurate() && !self.reaches_rows(lifted, &mut candidate) {
            candidate.certificate.class = Class::None;
        }
        let status = candidate.status();
        let Candidate {
            best,
            certificate,
            others,
        } = candidate;
        let n = lifted.n_original();
        lifted.settle(Some(&best.zeros));
        let residuals = self.measured(lifted, &best.point.w, best.residuals);
        let biactive = self.options.certificate.biactive;
        let (y, reduced) = (certificate.y, &certificate.reduced);
        let multipliers =
            certificate::unique::multipliers(lifted, &best.point.w, (y, reduced), biactive);
        let mut w = best.point.w;
        w.truncate(n);
        Solution {
            status,
            w,
            objective: best.objective,
            residuals,
            multipliers,
            class: certificate.class,
            is_class_exact: certificate.is_exact,
            b_stationary: certificate.b_stationary,
            is_differentiable: certificate.is_differentiable,
            biactive: certificate.biactive,
            others,
            stats: self.stats,
        }
    }

    fn dead_end(&self, lifted: &mut Lifted<'_>, end: DeadEnd) -> Solution {
        let objective = lifted.objective(&end.w);
        let residuals = self.measured(lifted, &end.w, end.residuals);
        let mut w = end.w;
        w.truncate(lifted.n_original());
        Solution {
            status: match (end.status, self.options.limit.over()) {
                (ipm::Status::Unbounded, _) => Status::Unbounded,
                (ipm::Status::Over(over), _) | (_, Some(over)) => Status::Over(over),
                (ipm::Status::LocallyInfeasible, _) => Status::LocallyInfeasible,
                (ipm::Status::Solved | ipm::Status::Acceptable | ipm::Status::Stopped, _) => {
                    Status::NumericalFailure
                }
                // The relaxation has not become feasible, and the violation of its branch is least.
                _ if end.branch == Some(ipm::Status::LocallyInfeasible) => {
                    Status::LocallyInfeasible
                }
                (ipm::Status::IterationLimit, _) => Status::IterationLimit,
                (
                    ipm::Status::NumericalFailure(
                        ipm::Failure::EvaluationAtStart | ipm::Failure::Evaluation,
                    ),
                    _,
                ) => Status::Evaluation,
                (ipm::Status::NumericalFailure(_), _) => Status::NumericalFailure,
            },
            multipliers: Multipliers {
                rows: vec![0.0; lifted.n_rows()],
                lower: vec![0.0; w.len()],
                upper: vec![0.0; w.len()],
                pairs: vec![[0.0; 2]; lifted.pairs().len()],
            },
            w,
            objective,
            residuals,
            class: Class::None,
            is_class_exact: false,
            b_stationary: None,
            is_differentiable: false,
            biactive: Vec::new(),
            others: 0,
            stats: self.stats,
        }
    }
}

/// A feasible point and what it is.
struct Candidate {
    best: Polished,
    certificate: Certificate,
    /// Branches with other points that mean the same, none of which is better.
    others: usize,
}

/// What was found in branches with other points that mean the same.
enum Elsewhere {
    /// A point with its certificate.
    Better(Box<(Polished, Certificate)>),
    /// So many were tried.
    Nothing(usize),
}

impl Candidate {
    /// How a run ends here.
    fn status(&self) -> Status {
        let Certificate {
            class,
            b_stationary,
            ..
        } = self.certificate;
        match class {
            Class::None if self.best.objective < UNBOUNDED => Status::Unbounded,
            Class::None => Status::Feasible,
            _ if self.best.falling.is_some() => Status::Feasible,
            Class::S => Status::Solved,
            Class::M if b_stationary.is_none() => Status::Solved,
            _ if b_stationary == Some(true) => Status::Solved,
            _ => Status::Feasible,
        }
    }

    fn is_stationary(&self) -> bool {
        self.certificate.class != Class::None
    }

    /// Whether this is to be preferred: stationary points to what is none, then by the objective. A solution does not hide a
    /// lower point that is none.
    ///
    /// Where the objective is the same, a search for descent that met its limit says nothing against one that found it.
    fn is_better(&self, other: &Candidate) -> bool {
        let [found, known] = [self, other].map(|candidate| candidate.best.objective);
        let is_open = self.certificate.b_stationary.is_none();
        if is_open && other.certificate.descent.is_some() && (found - known).abs() <= gain(known) {
            return false;
        }
        match (self.is_stationary(), other.is_stationary()) {
            (true, false) => true,
            (false, true) => false,
            _ => found < known,
        }
    }
}

impl DeadEnd {
    /// Whether this is closer to being feasible.
    fn is_better(&self, other: &DeadEnd) -> bool {
        let size = |r: &Residuals| r.violation.max(r.complementarity);
        size(&self.residuals) < size(&other.residuals)
    }
}
