//! The linear system of a step, with the right inertia and without the bias of its regularization.
//!
//! ( H + Σ_x + δ_w    Jᵀ           ) (Δx)
//! ( J               -Σ 1/w - δ_c  ) (Δy)
//!
//! where what is attached to a row is eliminated: w = Σ_i + δ_w of each. δ_w, at least 1e-8 or a tenth of a small μ, and
//! δ_c, a hundredth of that, make a static order of pivots valid. The solution is refined with δ_c = 0, so that steps
//! reach the linearized rows, unless these depend on each other. δ_w is a proximal term: it shortens steps and does not
//! move where they end. There have to be n positive and m negative eigenvalues: first H gets what the program knows to be
//! missing, then δ_w grows (Wächter & Biegler 2006, algorithm IC).
//!
//! A row that is eliminated before its variables divides by δ_c, and what these have of their own may be lost. It is not
//! known then whether the inertia is right. Pivots of a row with one of its variables lose nothing, and have more fill.

mod factors;
mod matrix;

use super::options::Options;
use super::problem::form::Form;
use super::solution::Failure;
use crate::linalg::largest;
use crate::linalg::symmetric::Inertia;
use crate::runtime::limit::Limit;
use factors::Factors;
pub(crate) use matrix::Entries;
use matrix::Matrix;

/// The least δ_w where μ is larger, relative to μ below, and where a static order loses its meaning.
const PERMANENT: f64 = 1e-8;
const PERMANENT_BY_MU: f64 = 0.1;
const LEAST_PERMANENT: f64 = 1e-10;
/// δ_c relative to the least δ_w: rows that nearly depend on each other need a small one, or the inertia is not theirs.
const DUAL: f64 = 1e-2;
/// Of algorithm IC: the first correction, by what a guess is smaller than the last one (more once guesses suffice), and
/// the correction beyond which a matrix is given up.
const FIRST: f64 = 1e-4;
const DECREASE: f64 = 3.0;
const LARGEST_DECREASE: f64 = 243.0;
const LARGEST: f64 = 1e40;
const MAX_REFINEMENTS: usize = 8;
/// Residual relative to right-hand side and solution that ends the refinement, that is good, and that is of use.
const REFINED: f64 = 1e-10;
const GOOD: f64 = 1e-8;
const USABLE: f64 = 1e-5;

pub(crate) struct Kkt {
    matrix: Matrix,
    factors: Factors,
    correction: Correction,
    limit: Limit,
    /// δ_w of the matrix factored last, and the least δ_w.
    pub regularization: f64,
    permanent: f64,
    /// Whether refinement with δ_c = 0 has failed for the matrix factored last.
    is_dependent: bool,
    residual: Vec<f64>,
    best: Vec<f64>,
}

/// What δ_w had to be beyond the least one.
struct Correction {
    /// For the last matrix that needed it.
    last: f64,
    /// Whether the last matrix did.
    was_needed: bool,
    /// By what the next one is smaller than the last: more the longer the first guess was enough.
    decrease: f64,
}

impl Kkt {
    pub fn new(form: &Form<'_>, options: &Options) -> Self {
        let matrix = Matrix::new(form);
        let size = matrix.n + matrix.m;
        Kkt {
            factors: Factors::new(&matrix, options),
            matrix,
            correction: Correction {
                last: 0.0,
                was_needed: false,
                decrease: DECREASE,
            },
            limit: options.limit.clone(),
            regularization: 0.0,
            permanent: PERMANENT,
            is_dependent: false,
            residual: vec![0.0; size],
            best: vec![0.0; size],
        }
    }

    /// The number of entries of L below its diagonal.
    pub fn n_entries(&self) -> usize {
        self.factors.n_entries()
    }

    /// Whether a matrix has had no factors in the static order.
    pub fn has_lost_pivots(&self) -> bool {
        self.factors.has_lost_pivots
    }

    /// Factors the matrix with the first δ_w = permanent + correction that gives it n positive and m negative eigenvalues.
    /// Until then, in this order: the permanent part becomes 1e-8, H is convexified, a matrix without factors is pivoted
    /// densely, and the correction grows (Wächter & Biegler 2006, algorithm IC). Where the last matrix needed a
    /// correction, a smaller one, 1e-8 and the convexified H are the start.
    /// `sigma` is z_l/(v - l) + z_u/(u - v) of all variables.
    pub fn factor(
        &mut self,
        form: &mut Form<'_>,
        hessian: &mut [f64],
        jacobian: &[f64],
        sigma: &[f64],
        mu: f64,
    ) -> Result<(), Failure> {
        self.matrix.fill(hessian, jacobian);
        let mut is_convexified = false;
        self.is_dependent = false;
        self.permanent = (PERMANENT_BY_MU * mu).clamp(LEAST_PERMANENT, PERMANENT);
        let expected = Inertia {
            positive: self.matrix.n,
            negative: self.matrix.m,
        };
        let mut correction = self.correction.guess();
        if correction > 0.0 {
            self.permanent = PERMANENT;
            is_convexified = true;
            if form.convexify(hessian) {
                self.matrix.fill(hessian, jacobian);
            }
        }
        let mut n_corrections = usize::from(correction > 0.0);
        loop {
            if self.limit.is_over() {
                return Err(Failure::LinearSystem);
            }
            self.regularization = correction + self.permanent;
            let (delta_w, delta_c) = (self.regularization, DUAL * self.permanent);
            self.matrix.regularize(form, sigma, delta_w, delta_c);
            let rows = Entries {
                sparse: &form.jacobian,
                values: jacobian,
            };
            let found = self.factors.factor(&self.matrix, rows);
            if found == Ok(expected) {
                break;
            }
            if self.permanent < PERMANENT {
                self.permanent = PERMANENT;
                if found.is_err() {
                    continue;
                }
            }
            if !is_convexified && found.is_ok() {
                is_convexified = true;
                if form.convexify(hessian) {
                    self.matrix.fill(hessian, jacobian);
                    continue;
                }
            }
            // Where the static order gives no answer, pivots may.
            if found.is_err() && self.factors.factor_dense(&self.matrix) == Some(expected) {
                break;
            }
            correction = self.correction.larger(correction);
            n_corrections += 1;
            if correction > LARGEST || correction.is_nan() {
                return Err(Failure::LinearSystem);
            }
        }
        self.correction.record(correction, n_corrections);
        Ok(())
    }

    /// Whether the matrix factored last has more than the permanent regularization.
    pub fn is_corrected(&self) -> bool {
        self.regularization > 2.0 * PERMANENT
    }

    /// The next matrix is factored without a guess of its correction first.
    pub fn forget_correction(&mut self) {
        self.correction.was_needed = false;
    }

    /// Solves with H and J, refining the solution.
    pub fn solve(
        &mut self,
        blocks: [Entries<'_>; 2],
        rhs: &[f64],
        solution: &mut [f64],
    ) -> Result<(), Failure> {
        // Without δ_c; with it where that does not converge.
        if !self.is_dependent {
            let error = self.refine(blocks, rhs, solution, 0.0);
            if error <= GOOD {
                return Ok(());
            }
            self.is_dependent = true;
        }
        let dual = DUAL * self.permanent;
        if self.refine(blocks, rhs, solution, dual) <= USABLE {
            return Ok(());
        }
        // Pivots are more accurate than refinement of a static order.
        if !self.factors.is_dense
            && self.factors.factor_dense(&self.matrix).is_some()
            && self.refine(blocks, rhs, solution, dual) <= USABLE
        {
            return Ok(());
        }
        Err(Failure::LinearSystem)
    }

    /// The relative residual that is left.
    fn refine(
        &mut self,
        blocks: [Entries<'_>; 2],
        rhs: &[f64],
        solution: &mut [f64],
        delta: f64,
    ) -> f64 {
        let size = largest(rhs);
        if size == 0.0 {
            solution.fill(0.0);
            return 0.0;
        }
        self.residual.copy_from_slice(rhs);
        solution.fill(0.0);
        let mut least = f64::INFINITY;
        for _ in 0..MAX_REFINEMENTS {
            self.factors.solve(&mut self.residual);
            for (solution, correction) in solution.iter_mut().zip(&self.residual) {
                *solution += correction;
            }
            let (matrix, residual) = (&self.matrix, &mut self.residual);
            matrix.subtract_product(blocks, rhs, solution, delta, residual);
            let error = largest(&self.residual) / (size + largest(solution).min(1e6 * size));
            if error.is_nan() || error >= 0.9 * least {
                if error < least {
                    least = error;
                } else {
                    solution.copy_from_slice(&self.best);
                }
                break;
            }
            least = error;
            if least <= REFINED {
                break;
            }
            self.best.copy_from_slice(solution);
        }
        least
    }
}

impl Correction {
    /// What has been needed is likely to be needed again.
    fn guess(&self) -> f64 {
        let guess = self.last / self.decrease;
        if self.was_needed && guess >= FIRST {
            guess
        } else {
            0.0
        }
    }

    /// The next one where this is not enough.
    fn larger(&self, correction: f64) -> f64 {
        match correction {
            0.0 if self.last == 0.0 => FIRST,
            0.0 => (self.last / self.decrease).max(FIRST * 1e-4),
            _ if self.last == 0.0 => 100.0 * correction,
            _ => 8.0 * correction,
        }
    }

    /// Takes note of one that was enough, after so many.
    fn record(&mut self, correction: f64, n_corrections: usize) {
        self.was_needed = correction > 0.0;
        if self.was_needed {
            self.last = correction;
            self.decrease = match n_corrections {
                1 => (DECREASE * self.decrease).min(LARGEST_DECREASE),
                _ => DECREASE,
            };
        }
    }
}
