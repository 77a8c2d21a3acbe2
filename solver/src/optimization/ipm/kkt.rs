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

use super::form::{Form, Sparse};
use super::options::Options;
use super::solution::Failure;
use crate::linalg::analyses::Analyses;
use crate::linalg::bunch_kaufman::BunchKaufman;
use crate::linalg::ldl::SparseLdl;
use crate::linalg::matching::{self, Weights, matching};
use crate::linalg::symmetric::{FactorFailure, Inertia, KktSolver};
use crate::optimization::problem::Pattern;
use crate::runtime::limit::Limit;

/// The least δ_w where μ is larger, relative to μ below, and where a static order loses its meaning.
const PERMANENT: f64 = 1e-8;
const PERMANENT_BY_MU: f64 = 0.1;
const LEAST_PERMANENT: f64 = 1e-10;
/// δ_c relative to the least δ_w: rows that nearly depend on each other need a small one, or the inertia is not theirs.
const DUAL: f64 = 1e-2;
const FIRST: f64 = 1e-4;
const DECREASE: f64 = 3.0;
const LARGEST_DECREASE: f64 = 243.0;
const LARGEST: f64 = 1e40;
const MAX_REFINEMENTS: usize = 8;
/// Residual relative to right-hand side and solution that ends the refinement, that is good, and that is of use.
const REFINED: f64 = 1e-10;
const GOOD: f64 = 1e-8;
const USABLE: f64 = 1e-5;
/// The diagonal of a variable counts against it as the partner of a row from 1 on, and no more beyond this.
const STIFFEST: f64 = 1e16;
/// A dense factorization of this size is affordable.
const MAX_DENSE: usize = 300;

pub(crate) struct Kkt {
    n: usize,
    m: usize,
    hessian_places: Vec<u32>,
    jacobian_places: Vec<u32>,
    diagonal_places: Vec<u32>,
    pattern: Pattern,
    values: Vec<f64>,
    /// The diagonal of H.
    curvature: Vec<f64>,
    /// What is added to H, and -Σ 1/w.
    diagonal: Vec<f64>,
    sparse: SparseLdl,
    dense: Option<BunchKaufman>,
    is_dense: bool,
    /// Pivots of a row and a variable, used from where the static order has lost one.
    paired: Option<SparseLdl>,
    pairs_pivots: bool,
    analyses: Analyses,
    pub has_lost_pivots: bool,
    /// δ_w of the matrix factored last, and the least δ_w.
    pub regularization: f64,
    limit: Limit,
    permanent: f64,
    last_correction: f64,
    was_corrected: bool,
    /// By what the next correction is smaller than the last: more the longer the first guess was enough.
    decrease: f64,
    /// Whether refinement with δ_c = 0 has failed for the matrix factored last.
    is_dependent: bool,
    residual: Vec<f64>,
    best: Vec<f64>,
}

impl Kkt {
    pub fn new(form: &Form<'_>, options: &Options) -> Self {
        let (n, m) = (form.n, form.m);
        let mut entries: Vec<(u32, u32)> = (0..(n + m) as u32).map(|i| (i, i)).collect();
        let list = |sparse: &Sparse, first: usize| -> Vec<(u32, u32)> {
            let rows = 0..sparse.starts.len() - 1;
            let row = |row: usize| {
                sparse.columns[sparse.range(row)]
                    .iter()
                    .map(move |&column| ((first + row) as u32, column))
            };
            rows.flat_map(row).collect()
        };
        let (hessian, jacobian) = (list(&form.hessian, 0), list(&form.jacobian, n));
        entries.extend(hessian.iter().chain(&jacobian));
        let pattern = Pattern::new(n + m, entries);
        let places = |list: &[(u32, u32)]| -> Vec<u32> {
            let place = |&(i, j): &(u32, u32)| {
                pattern.place(i as usize, j).expect("the entry was put in") as u32
            };
            list.iter().map(place).collect()
        };
        let diagonal: Vec<(u32, u32)> = (0..(n + m) as u32).map(|i| (i, i)).collect();
        Kkt {
            n,
            m,
            hessian_places: places(&hessian),
            jacobian_places: places(&jacobian),
            diagonal_places: places(&diagonal),
            values: vec![0.0; pattern.n_entries()],
            curvature: vec![0.0; n],
            diagonal: vec![0.0; n + m],
            sparse: options.analyses.ldl(&pattern, &[]),
            dense: (n + m <= MAX_DENSE).then(|| BunchKaufman::new(&pattern)),
            is_dense: false,
            paired: None,
            pairs_pivots: options.pairs_pivots,
            analyses: options.analyses.clone(),
            has_lost_pivots: false,
            pattern,
            regularization: 0.0,
            limit: options.limit.clone(),
            permanent: PERMANENT,
            last_correction: 0.0,
            was_corrected: false,
            decrease: DECREASE,
            is_dependent: false,
            residual: vec![0.0; n + m],
            best: vec![0.0; n + m],
        }
    }

    /// The number of entries of L below its diagonal.
    pub fn n_entries(&self) -> usize {
        self.sparse.n_entries()
    }

    /// Factors with the least δ_w that gives the right inertia; `sigma` is Σ of all variables at `mu`.
    pub fn factor(
        &mut self,
        form: &mut Form<'_>,
        hessian: &mut [f64],
        jacobian: &[f64],
        sigma: &[f64],
        mu: f64,
    ) -> Result<(), Failure> {
        self.fill(hessian, jacobian);
        let mut is_convexified = false;
        self.is_dependent = false;
        self.permanent = (PERMANENT_BY_MU * mu).clamp(LEAST_PERMANENT, PERMANENT);
        let expected = Inertia {
            positive: self.n,
            negative: self.m,
        };
        // What has been needed is likely to be needed again.
        let guess = self.last_correction / self.decrease;
        let mut correction = 0.0;
        if self.was_corrected && guess >= FIRST {
            correction = guess;
            self.permanent = PERMANENT;
            is_convexified = true;
            if form.convexify(hessian) {
                self.fill(hessian, jacobian);
            }
        }
        let mut n_corrections = usize::from(correction > 0.0);
        loop {
            if self.limit.is_over() {
                return Err(Failure::LinearSystem);
            }
            self.regularize(form, sigma, correction);
            self.is_dense = false;
            let found = self.factor_sparse(form, jacobian);
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
                    self.fill(hessian, jacobian);
                    continue;
                }
            }
            // Where the static order gives no answer, pivots may.
            if found.is_err() && self.factor_dense() == Some(expected) {
                break;
            }
            correction = match correction {
                0.0 if self.last_correction == 0.0 => FIRST,
                0.0 => (self.last_correction / self.decrease).max(FIRST * 1e-4),
                _ if self.last_correction == 0.0 => 100.0 * correction,
                _ => 8.0 * correction,
            };
            n_corrections += 1;
            if correction > LARGEST || correction.is_nan() {
                return Err(Failure::LinearSystem);
            }
        }
        self.was_corrected = correction > 0.0;
        if correction > 0.0 {
            self.last_correction = correction;
            self.decrease = match n_corrections {
                1 => (DECREASE * self.decrease).min(LARGEST_DECREASE),
                _ => DECREASE,
            };
        }
        Ok(())
    }

    /// Whether the matrix factored last has more than the permanent regularization.
    pub fn is_corrected(&self) -> bool {
        self.regularization > 2.0 * PERMANENT
    }

    /// The next matrix is factored without a guess of its correction first.
    pub fn forget_correction(&mut self) {
        self.was_corrected = false;
    }

    /// Takes over entries; the diagonal of H is kept apart.
    fn fill(&mut self, hessian: &[f64], jacobian: &[f64]) {
        self.values.fill(0.0);
        for (&place, &entry) in self.hessian_places.iter().zip(hessian) {
            self.values[place as usize] = entry;
        }
        for (&place, &entry) in self.jacobian_places.iter().zip(jacobian) {
            self.values[place as usize] = entry;
        }
        for (curvature, &place) in self.curvature.iter_mut().zip(&self.diagonal_places) {
            *curvature = self.values[place as usize];
        }
    }

    /// Pivots of one unknown, or of two once those have failed.
    fn factor_sparse(
        &mut self,
        form: &Form<'_>,
        jacobian: &[f64],
    ) -> Result<Inertia, FactorFailure> {
        if let Some(paired) = &mut self.paired {
            let found = paired.factor(&self.values);
            if found.is_ok() {
                return found;
            }
        } else {
            let found = self.sparse.factor(&self.values);
            self.has_lost_pivots |= found.is_err();
            let is_lost = matches!(found, Err(FactorFailure::ZeroPivot(_)));
            // Small systems are factored densely.
            if !is_lost || !self.pairs_pivots || self.dense.is_some() {
                return found;
            }
        }
        // None yet, or entries have become too small for the pairs that there were.
        let pairs = self.partners(form, jacobian);
        let paired = self.analyses.ldl(&self.pattern, &pairs);
        let paired = self.paired.insert(paired);
        paired.factor(&self.values)
    }

    /// Rows with a variable each, whose entry is large and whose diagonal is not.
    fn partners(&self, form: &Form<'_>, jacobian: &[f64]) -> Vec<[u32; 2]> {
        let stiffness = |column: u32| {
            let diagonal = self.values[self.diagonal_places[column as usize] as usize];
            diagonal.abs().clamp(1.0, STIFFEST)
        };
        let columns = &form.jacobian.columns;
        let entries = columns.iter().zip(jacobian);
        let weights: Vec<f64> = entries
            .map(|(&column, a)| a.abs() / stiffness(column).sqrt())
            .collect();
        let found = matching(&Weights {
            starts: &form.jacobian.starts,
            columns,
            weights: &weights,
            n_columns: self.n,
        });
        let rows = found.into_iter().zip(self.n as u32..);
        rows.filter(|pair| pair.0 != matching::NONE)
            .map(|(column, row)| [column, row])
            .collect()
    }

    fn factor_dense(&mut self) -> Option<Inertia> {
        let inertia = self.dense.as_mut()?.factor(&self.values).ok()?;
        self.is_dense = true;
        Some(inertia)
    }

    fn regularize(&mut self, form: &Form<'_>, sigma: &[f64], correction: f64) {
        let n = self.n;
        let delta = correction + self.permanent;
        self.regularization = delta;
        for (diagonal, sigma) in self.diagonal[..n].iter_mut().zip(sigma) {
            *diagonal = sigma + delta;
        }
        self.diagonal[n..].fill(0.0);
        for (attached, sigma) in form.attached.iter().zip(&sigma[n..]) {
            self.diagonal[n + attached.row as usize] -= 1.0 / (sigma + delta);
        }
        for i in 0..n {
            self.values[self.diagonal_places[i] as usize] = self.curvature[i] + self.diagonal[i];
        }
        for i in n..n + self.m {
            self.values[self.diagonal_places[i] as usize] =
                self.diagonal[i] - DUAL * self.permanent;
        }
    }

    /// Overwrites the right-hand side with the solution.
    pub fn solve(
        &mut self,
        form: &Form<'_>,
        hessian: &[f64],
        jacobian: &[f64],
        rhs: &[f64],
        solution: &mut [f64],
    ) -> Result<(), Failure> {
        // Without δ_c; with it where that does not converge.
        if !self.is_dependent {
            let error = self.refine(form, hessian, jacobian, rhs, solution, 0.0);
            if error <= GOOD {
                return Ok(());
            }
            self.is_dependent = true;
        }
        let error = self.refine(
            form,
            hessian,
            jacobian,
            rhs,
            solution,
            DUAL * self.permanent,
        );
        if error <= USABLE {
            return Ok(());
        }
        // Pivots are more accurate than refinement of a static order.
        if !self.is_dense && self.factor_dense().is_some() {
            let error = self.refine(
                form,
                hessian,
                jacobian,
                rhs,
                solution,
                DUAL * self.permanent,
            );
            if error <= USABLE {
                return Ok(());
            }
        }
        Err(Failure::LinearSystem)
    }

    /// The relative residual that is left.
    fn refine(
        &mut self,
        form: &Form<'_>,
        hessian: &[f64],
        jacobian: &[f64],
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
            let mut correction = std::mem::take(&mut self.residual);
            self.solve_once(&mut correction);
            for (solution, correction) in solution.iter_mut().zip(&correction) {
                *solution += correction;
            }
            self.residual = correction;
            self.subtract_product(form, hessian, jacobian, rhs, solution, delta);
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

    fn solve_once(&mut self, rhs: &mut [f64]) {
        match (&mut self.dense, &mut self.paired) {
            (Some(dense), _) if self.is_dense => dense.solve(rhs),
            (_, Some(paired)) => paired.solve(rhs),
            _ => self.sparse.solve(rhs),
        }
    }

    /// residual = rhs - K solution with δ_c = `delta`.
    fn subtract_product(
        &mut self,
        form: &Form<'_>,
        hessian: &[f64],
        jacobian: &[f64],
        rhs: &[f64],
        solution: &[f64],
        delta: f64,
    ) {
        let (n, residual) = (self.n, &mut self.residual);
        let (x, y) = solution.split_at(n);
        for i in 0..n {
            residual[i] = rhs[i] - self.diagonal[i] * x[i];
        }
        for i in n..n + self.m {
            residual[i] = rhs[i] - (self.diagonal[i] - delta) * solution[i];
        }
        let (dual, primal) = residual.split_at_mut(n);
        for row in 0..n {
            let range = form.hessian.range(row);
            let mut sum = 0.0;
            for (&column, &h) in form.hessian.columns[range.clone()]
                .iter()
                .zip(&hessian[range])
            {
                let column = column as usize;
                sum += h * x[column];
                if column != row {
                    dual[column] -= h * x[row];
                }
            }
            dual[row] -= sum;
        }
        for row in 0..self.m {
            let range = form.jacobian.range(row);
            let mut sum = 0.0;
            for (&column, &a) in form.jacobian.columns[range.clone()]
                .iter()
                .zip(&jacobian[range])
            {
                sum += a * x[column as usize];
                dual[column as usize] -= a * y[row];
            }
            primal[row] -= sum;
        }
    }
}

/// max |x_i|; NaN if one is.
pub(crate) fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m: f64, x| {
        if x.abs() > m || x.is_nan() {
            x.abs()
        } else {
            m
        }
    })
}
