//! Where the iteration starts: scaling, a point between the bounds, multipliers.
//!
//! Wächter & Biegler 2006, sections 3.6 to 3.8.

use super::Run;
use super::solution::{Failure, Point, Status};
use crate::linalg::largest;

/// Distance from bounds relative to their size, and to the range between both.
const KAPPA_1: f64 = 1e-2;
const KAPPA_2: f64 = 1e-2;
/// Gradients above this size are scaled down to it, but by no more than the second number.
const LARGEST_GRADIENT: f64 = 100.0;
const LEAST_SCALE: f64 = 1e-8;
/// Estimates of multipliers beyond this are not used.
const Y_MAX: f64 = 1e3;
/// A warm start keeps multipliers within μ / distance divided and multiplied by this.
const WARM: f64 = 1e3;

impl Run<'_> {
    /// Sets up the point, its values and the filter.
    pub(crate) fn start(&mut self, point: Option<&Point>) -> Result<(), Status> {
        if let Some(point) = point {
            self.mu = point.mu;
            for (w, &start) in self.form.w.iter_mut().zip(&point.w) {
                *w = start;
            }
        }
        self.mu = self.mu.max(self.mu_floor());
        self.tau = (1.0 - self.mu).max(super::TAU_MIN);
        let push = if point.is_some() {
            KAPPA_1.min(self.mu)
        } else {
            KAPPA_1
        };
        self.read_bounds();
        let n = self.form.n;
        let nv = self.nv();
        if self.lower[..nv]
            .iter()
            .zip(&self.upper)
            .any(|(lower, upper)| lower > upper)
        {
            return Err(Status::LocallyInfeasible);
        }
        for i in 0..n {
            self.v[i] = self.form.w[self.form.variables[i] as usize];
            self.push_inside(i, push);
        }
        self.form.load(&self.v);
        self.scale().map_err(Status::NumericalFailure)?;
        self.read_bounds();
        self.form.rows(&mut self.c);
        for i in n..nv {
            self.v[i] = self.c[self.form.attached[i - n].row as usize];
            self.push_inside(i, push);
        }
        for i in 0..nv {
            self.z_l[i] = f64::from(u8::from(self.lower[i].is_finite()));
            self.z_u[i] = f64::from(u8::from(self.upper[i].is_finite()));
        }
        self.evaluate_values();
        self.evaluate_gradients();
        match point {
            Some(point) => self.take_multipliers(point),
            None => self.estimate_multipliers(),
        }
        self.evaluate()
            .map_err(|_| Status::NumericalFailure(Failure::EvaluationAtStart))?;
        let theta = self.merit().theta;
        self.filter.start(theta);
        self.start_barrier();
        Ok(())
    }

    fn read_bounds(&mut self) {
        let relaxation = self.options.bound_relaxation;
        self.form
            .read_bounds(relaxation, &mut self.lower, &mut self.upper);
    }

    /// Moves v_i away from its bounds. Wächter & Biegler 2006, section 3.6.
    fn push_inside(&mut self, i: usize, push: f64) {
        let (lower, upper) = (self.lower[i], self.upper[i]);
        let room =
            |bound: f64| (push * bound.abs().max(1.0)).min(push.min(KAPPA_2) * (upper - lower));
        let (low, high) = (lower + room(lower), upper - room(upper));
        if lower.is_finite() {
            self.v[i] = self.v[i].max(low);
        }
        if upper.is_finite() {
            self.v[i] = self.v[i].min(high);
        }
    }

    /// Factors that bring gradients down to a moderate size.
    fn scale(&mut self) -> Result<(), Failure> {
        let (n, form) = (self.form.n, &mut self.form);
        form.gradient(&mut self.gradient[..n]);
        form.jacobian(&mut self.jacobian);
        let size = largest(&self.gradient[..n]);
        let f = form.objective();
        form.rows(&mut self.c);
        let sizes = [size, f, largest(&self.jacobian), largest(&self.c)];
        if !sizes.iter().all(|size| size.is_finite()) {
            return Err(Failure::EvaluationAtStart);
        }
        let scale = |size: f64| (LARGEST_GRADIENT / size).clamp(LEAST_SCALE, 1.0);
        form.objective_scale = scale(size);
        for (row, factor) in form.row_scale.iter_mut().enumerate() {
            *factor = scale(largest(&self.jacobian[form.jacobian.range(row)]));
        }
        Ok(())
    }

    fn take_multipliers(&mut self, point: &Point) {
        let form = &self.form;
        let scale = form.objective_scale;
        for (j, &row) in form.rows.iter().enumerate() {
            self.y[j] = point.y[row as usize] * scale / form.row_scale[j];
        }
        for (i, &variable) in form.variables.iter().enumerate() {
            self.z_l[i] = point.z_l[variable as usize] * scale;
            self.z_u[i] = point.z_u[variable as usize] * scale;
        }
        for i in form.n..form.n + form.n_slacks {
            let y = self.y[form.attached[i - form.n].row as usize];
            self.z_l[i] = (-y).max(0.0);
            self.z_u[i] = y.max(0.0);
        }
        self.reset_multipliers(WARM);
    }

    /// Multipliers y that make the gradient of the Lagrangian least.
    pub(crate) fn estimate_multipliers(&mut self) {
        let (n, nv) = (self.form.n, self.nv());
        self.y.fill(0.0);
        self.hessian.fill(0.0);
        self.sigma[..nv].fill(1.0);
        let sigma = &self.sigma[..nv];
        if self
            .kkt
            .factor(
                &mut self.form,
                &mut self.hessian,
                &self.jacobian,
                sigma,
                1.0,
            )
            .is_err()
        {
            return;
        }
        let delta = self.kkt.regularization;
        self.rhs[n..].fill(0.0);
        for i in 0..nv {
            let slope = self.gradient[i] - self.z_l[i] + self.z_u[i];
            if i < n {
                self.rhs[i] = -slope;
            } else {
                let attached = self.form.attached[i - n];
                self.rhs[n + attached.row as usize] += attached.sign * slope / (1.0 + delta);
            }
        }
        if self.solve_reduced().is_ok() && largest(&self.reduced[n..]) <= Y_MAX {
            self.y.copy_from_slice(&self.reduced[n..]);
        }
    }

    /// Reads bounds that follow μ; what they have come too near to keeps its distance.
    pub(crate) fn move_bounds(&mut self) {
        let nv = self.nv();
        self.trial[..nv].copy_from_slice(&self.lower[..nv]);
        self.sigma[..nv].copy_from_slice(&self.upper[..nv]);
        self.read_bounds();
        for i in 0..nv {
            let (lower, upper) = (self.lower[i], self.upper[i]);
            let half = 0.5 * (upper - lower);
            let below = (self.v[i] - self.trial[i]).min(half);
            let above = (self.sigma[i] - self.v[i]).min(half);
            if self.v[i] - lower < 0.1 * below {
                self.v[i] = lower + below;
            }
            if upper - self.v[i] < 0.1 * above {
                self.v[i] = upper - above;
            }
        }
        self.keep_interior();
        self.reset_multipliers(super::KAPPA_SIGMA);
    }
}
