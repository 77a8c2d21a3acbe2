//! Where the iteration starts: scaling, a point between the bounds, multipliers.
//!
//! Wächter & Biegler 2006, sections 3.6 to 3.8.

use super::direction::NewtonSystem;
use super::problem::BarrierProblem;
use super::problem::evaluation::{Derivatives, Values};
use super::problem::form::Form;
use super::solution::{Failure, Point, Status};
use crate::linalg::largest;

/// Distance from bounds relative to their size.
const KAPPA_1: f64 = 1e-2;
/// Gradients above this size are scaled down to it, but by no more than the second number.
const LARGEST_GRADIENT: f64 = 100.0;
const LEAST_SCALE: f64 = 1e-8;
/// A warm start keeps multipliers within μ / distance divided and multiplied by this.
const WARM: f64 = 1e3;

/// Sets up the point and its values.
pub(crate) fn start(
    problem: &mut BarrierProblem<'_>,
    newton: &mut NewtonSystem,
    point: Option<&Point>,
) -> Result<(), Status> {
    let mut mu = problem.mu;
    if let Some(point) = point {
        mu = point.mu;
        for (w, &start) in problem.form.w.iter_mut().zip(&point.w) {
            *w = start;
        }
    }
    problem.assign_mu(mu.max(problem.options.mu_floor()));
    let push = match point {
        Some(_) => KAPPA_1.min(problem.mu),
        None => KAPPA_1,
    };
    problem.read_bounds();
    let (form, at) = (&mut problem.form, &mut problem.iterate);
    let (n, nv) = (form.shape.n, at.nv);
    let mut bounds = at.lower[..nv].iter().zip(&at.upper);
    if bounds.any(|(lower, upper)| lower > upper) {
        return Err(Status::LocallyInfeasible);
    }
    for i in 0..n {
        at.v[i] = form.w[form.shape.variables[i] as usize];
        at.push_inside(i, push);
    }
    form.load(&at.v);
    scale(form, &mut problem.values, &mut problem.derivatives).map_err(Status::NumericalFailure)?;
    problem.read_bounds();
    let (form, at) = (&mut problem.form, &mut problem.iterate);
    form.rows(&mut problem.values.c);
    for i in n..nv {
        at.v[i] = problem.values.c[form.shape.attached[i - n].row as usize];
        at.push_inside(i, push);
    }
    for i in 0..nv {
        at.z_l[i] = f64::from(u8::from(at.lower[i].is_finite()));
        at.z_u[i] = f64::from(u8::from(at.upper[i].is_finite()));
    }
    problem.evaluate_values();
    problem.evaluate_gradients();
    match point {
        Some(point) => take_multipliers(problem, point),
        None => newton.estimate_multipliers(problem),
    }
    problem
        .evaluate()
        .map_err(|_| Status::NumericalFailure(Failure::EvaluationAtStart))
}

/// Factors that bring gradients down to a moderate size.
fn scale(
    form: &mut Form<'_>,
    values: &mut Values,
    derivatives: &mut Derivatives,
) -> Result<(), Failure> {
    let n = form.shape.n;
    form.gradient(&mut derivatives.gradient[..n]);
    form.jacobian(&mut derivatives.jacobian);
    let size = largest(&derivatives.gradient[..n]);
    let f = form.objective();
    form.rows(&mut values.c);
    let sizes = [size, f, largest(&derivatives.jacobian), largest(&values.c)];
    if !sizes.iter().all(|size| size.is_finite()) {
        return Err(Failure::EvaluationAtStart);
    }
    let scale = |size: f64| (LARGEST_GRADIENT / size).clamp(LEAST_SCALE, 1.0);
    form.objective_scale = scale(size);
    for (row, factor) in form.row_scale.iter_mut().enumerate() {
        *factor = scale(largest(&derivatives.jacobian[form.jacobian.range(row)]));
    }
    Ok(())
}

fn take_multipliers(problem: &mut BarrierProblem<'_>, point: &Point) {
    let (form, at) = (&problem.form, &mut problem.iterate);
    let (shape, scale) = (&form.shape, form.objective_scale);
    for (j, &row) in shape.rows.iter().enumerate() {
        at.y[j] = point.y[row as usize] * scale / form.row_scale[j];
    }
    for (i, &variable) in shape.variables.iter().enumerate() {
        at.z_l[i] = point.z_l[variable as usize] * scale;
        at.z_u[i] = point.z_u[variable as usize] * scale;
    }
    for i in shape.n..shape.own() {
        let y = at.y[shape.attached[i - shape.n].row as usize];
        at.z_l[i] = (-y).max(0.0);
        at.z_u[i] = y.max(0.0);
    }
    at.reset_multipliers(problem.mu, WARM);
}
