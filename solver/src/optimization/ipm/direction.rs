//! Newton steps of the barrier problem.
//!
//! With g = ∇f + Eᵀy the gradient of the Lagrangian without bounds and d = v - l, e = u - v,
//!
//! (W + z_l/d + z_u/e) Δv + Eᵀ Δy = -(g - μ/d + μ/e),   E Δv = -r,
//! Δz_l = μ/d - z_l - z_l/d Δv,   Δz_u = μ/e - z_u + z_u/e Δv.
//!
//! Infinite distances drop out by themselves.

use super::kkt::{Entries, Kkt};
use super::options::Options;
use super::problem::BarrierProblem;
use super::problem::form::Form;
use super::problem::iterate::Step;
use super::solution::Failure;
use crate::linalg::largest;

/// Estimates of multipliers beyond this are not used.
const Y_MAX: f64 = 1e3;
/// Multipliers this many times as large as those along the rows are the work of a correction.
const INFLATED: f64 = 3.0;

/// What a step shall reach.
#[derive(Clone, Copy)]
pub(crate) struct Aim<'a> {
    pub mu: f64,
    /// How much of the residuals is taken: with 0 the step depends on μ alone, linearly.
    pub share: f64,
    /// The residuals r of the rows; without, the step goes along the rows.
    pub rows: Option<&'a [f64]>,
}

/// The linear system of Newton's method, its right-hand side and its solution.
pub(crate) struct NewtonSystem {
    pub kkt: Kkt,
    /// Σ.
    sigma: Vec<f64>,
    pub rhs: Vec<f64>,
    pub reduced: Vec<f64>,
    tangential: Step,
}

impl NewtonSystem {
    pub fn new(form: &Form<'_>, options: &Options) -> Self {
        let (n_all, size) = (form.shape.n_all(), form.shape.n + form.shape.m);
        NewtonSystem {
            kkt: Kkt::new(form, options),
            sigma: vec![0.0; n_all],
            rhs: vec![0.0; size],
            reduced: vec![0.0; size],
            tangential: Step::new(n_all, form.shape.m),
        }
    }

    /// Factors the linear system at the point.
    pub fn factor(&mut self, problem: &mut BarrierProblem<'_>) -> Result<(), Failure> {
        let at = &problem.iterate;
        for (i, sigma) in self.sigma[..at.nv].iter_mut().enumerate() {
            let [lower, upper] = at.distances(i);
            *sigma = at.z_l[i] / lower + at.z_u[i] / upper;
        }
        problem.elastic.add_curvature(&mut self.sigma);
        self.factor_with_sigma(problem, problem.mu)
    }

    fn factor_with_sigma(
        &mut self,
        problem: &mut BarrierProblem<'_>,
        mu: f64,
    ) -> Result<(), Failure> {
        let derivatives = &mut problem.derivatives;
        self.kkt.factor(
            &mut problem.form,
            &mut derivatives.hessian,
            &derivatives.jacobian,
            &self.sigma[..problem.iterate.nv],
            mu,
        )
    }

    /// Solves the linear system for the right-hand side by the matrix factored last.
    pub fn solve(&mut self, problem: &BarrierProblem<'_>) -> Result<(), Failure> {
        let entries = |sparse, values| Entries { sparse, values };
        let (form, derivatives) = (&problem.form, &problem.derivatives);
        let blocks = [
            entries(&form.hessian, &derivatives.hessian[..]),
            entries(&form.jacobian, &derivatives.jacobian[..]),
        ];
        self.kkt.solve(blocks, &self.rhs, &mut self.reduced)
    }

    /// The step with an aim, by the matrix factored last.
    pub fn direction(
        &mut self,
        problem: &BarrierProblem<'_>,
        aim: Aim<'_>,
        step: &mut Step,
    ) -> Result<(), Failure> {
        let (at, shape) = (&problem.iterate, &problem.form.shape);
        let lagrangian = &problem.derivatives.lagrangian;
        let Aim { mu, share, rows } = aim;
        let (n, nv) = (shape.n, at.nv);
        let delta = self.kkt.regularization;
        let slope = |(i, slope): (usize, &f64)| share * slope + mu * at.barrier_slope(i);
        let slopes = lagrangian[..nv].iter().enumerate().map(slope);
        for (rhs, slope) in self.rhs[..n].iter_mut().zip(slopes.clone()) {
            *rhs = -slope;
        }
        match rows {
            Some(residuals) => {
                for (rhs, residual) in self.rhs[n..].iter_mut().zip(residuals) {
                    *rhs = -share * residual;
                }
            }
            None => self.rhs[n..].fill(0.0),
        }
        for (i, slope) in (n..nv).zip(slopes.skip(n)) {
            let attached = shape.attached[i - n];
            step.v[i] = slope;
            self.rhs[n + attached.row as usize] += attached.sign * slope / (self.sigma[i] + delta);
        }
        self.solve(problem)?;
        step.v[..n].copy_from_slice(&self.reduced[..n]);
        step.y.copy_from_slice(&self.reduced[n..]);
        for i in n..nv {
            let attached = shape.attached[i - n];
            let dy = step.y[attached.row as usize];
            step.v[i] = -(step.v[i] + attached.sign * dy) / (self.sigma[i] + delta);
        }
        for i in 0..nv {
            let ([d, e], dv) = (at.distances(i), step.v[i]);
            step.z_l[i] = (mu - at.z_l[i] * dv) / d - share * at.z_l[i];
            step.z_u[i] = (mu + at.z_u[i] * dv) / e - share * at.z_u[i];
        }
        if largest(&step.v[..nv]).is_finite() && largest(&step.y).is_finite() {
            Ok(())
        } else {
            Err(Failure::LinearSystem)
        }
    }

    /// The step for the present μ.
    pub fn step(&mut self, problem: &BarrierProblem<'_>, step: &mut Step) -> Result<(), Failure> {
        let aim = Aim {
            mu: problem.mu,
            share: 1.0,
            rows: Some(&problem.values.residual),
        };
        self.direction(problem, aim, step)?;
        if self.kkt.is_corrected() && !problem.is_restoration() {
            self.bound_multipliers(problem, step);
        }
        Ok(())
    }

    /// Takes the multipliers of the step along the rows alone, where those of the whole one are much larger: they have a
    /// part δ_w (E Eᵀ)⁻¹ r, which grows with the correction, brings curvature that asks for a larger one, and says nothing
    /// about the problem.
    fn bound_multipliers(&mut self, problem: &BarrierProblem<'_>, step: &mut Step) {
        let y = &problem.iterate.y;
        let size = |dy: &[f64]| {
            let sums = y.iter().zip(dy).map(|(y, dy)| (y + dy).abs());
            sums.fold(1.0, f64::max)
        };
        let whole = size(&step.y);
        if whole <= INFLATED * largest(y).max(1.0) {
            return;
        }
        let mut tangential = std::mem::take(&mut self.tangential);
        let aim = Aim {
            mu: problem.mu,
            share: 1.0,
            rows: None,
        };
        if self.direction(problem, aim, &mut tangential).is_ok()
            && whole > INFLATED * size(&tangential.y)
        {
            step.y.copy_from_slice(&tangential.y);
        }
        self.tangential = tangential;
    }

    /// Multipliers y that make the gradient of the Lagrangian least.
    pub fn estimate_multipliers(&mut self, problem: &mut BarrierProblem<'_>) {
        let (n, nv) = (problem.form.shape.n, problem.iterate.nv);
        problem.iterate.y.fill(0.0);
        problem.derivatives.hessian.fill(0.0);
        self.sigma[..nv].fill(1.0);
        if self.factor_with_sigma(problem, 1.0).is_err() {
            return;
        }
        let delta = self.kkt.regularization;
        self.rhs[n..].fill(0.0);
        for i in 0..nv {
            let at = &problem.iterate;
            let slope = problem.derivatives.gradient[i] - at.z_l[i] + at.z_u[i];
            if i < n {
                self.rhs[i] = -slope;
            } else {
                let attached = problem.form.shape.attached[i - n];
                self.rhs[n + attached.row as usize] += attached.sign * slope / (1.0 + delta);
            }
        }
        if self.solve(problem).is_ok() && largest(&self.reduced[n..]) <= Y_MAX {
            problem.iterate.y.copy_from_slice(&self.reduced[n..]);
        }
    }
}
