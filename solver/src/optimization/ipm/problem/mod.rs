//! The barrier problem at the iterate: the program, or its least violation, with logarithms of the distances from bounds.

pub(crate) mod elastic;
pub(crate) mod errors;
pub(crate) mod evaluation;
pub(crate) mod form;
pub(crate) mod iterate;

use super::filter::Merit;
use super::options::Options;
use super::solution::{Failure, Point};
use crate::linalg::largest;
use crate::optimization::problem::Nlp;
use elastic::{Elastic, RHO};
use errors::Errors;
use evaluation::{Derivatives, Trial, Values};
use form::{Form, NONE};
use iterate::{Iterate, Step};

const TAU_MIN: f64 = 0.99;
const KAPPA_SIGMA: f64 = 1e10;
/// The violation has to fall to this share.
const KAPPA_RESTO: f64 = 0.9;
/// Multipliers of bounds do not come back larger than this from a restoration.
const Z_MAX: f64 = 1e3;

pub(crate) struct BarrierProblem<'a> {
    pub form: Form<'a>,
    pub options: &'a Options,
    pub elastic: Elastic,
    pub iterate: Iterate,
    pub values: Values,
    pub derivatives: Derivatives,
    pub mu: f64,
    pub tau: f64,
    /// Whether rows or bounds have followed μ.
    follows: bool,
}

impl<'a> BarrierProblem<'a> {
    pub fn new(nlp: &'a mut dyn Nlp, options: &'a Options) -> Self {
        let form = Form::new(nlp);
        let (own, n_all, m) = (form.shape.own(), form.shape.n_all(), form.shape.m);
        BarrierProblem {
            options,
            elastic: Elastic::new(own),
            iterate: Iterate::new(own, n_all, m),
            values: Values::new(m),
            derivatives: Derivatives {
                gradient: vec![0.0; n_all],
                lagrangian: vec![0.0; n_all],
                jacobian: vec![0.0; form.jacobian.n_entries()],
                hessian: vec![0.0; form.hessian.n_entries()],
            },
            mu: options.mu_init,
            tau: TAU_MIN,
            follows: false,
            form,
        }
    }

    pub fn is_restoration(&self) -> bool {
        self.elastic.is_active
    }

    /// Whether what follows μ is where it stays: it has not arrived before μ has.
    pub fn has_arrived(&self) -> bool {
        !self.follows || self.mu <= self.options.mu_floor()
    }

    pub fn read_bounds(&mut self) {
        let at = &mut self.iterate;
        let relaxation = self.options.bound_relaxation;
        (self.form).read_bounds(relaxation, &mut at.lower, &mut at.upper);
    }

    /// μ, and τ that goes with it.
    pub fn assign_mu(&mut self, mu: f64) {
        self.mu = mu;
        self.tau = (1.0 - mu).max(TAU_MIN);
    }

    /// Sets μ; whether rows or bounds have followed it.
    pub fn set_mu(&mut self, mu: f64) -> bool {
        self.assign_mu(mu);
        if self.is_restoration() {
            self.elastic.zeta = mu.sqrt();
            return false;
        }
        if !self.form.nlp.follow(mu) {
            return false;
        }
        self.follows = true;
        let (form, relaxation) = (&mut self.form, self.options.bound_relaxation);
        self.iterate
            .move_bounds(|lower, upper| form.read_bounds(relaxation, lower, upper));
        self.iterate.keep_interior(mu);
        self.iterate.reset_multipliers(mu, KAPPA_SIGMA);
        true
    }

    /// f, c and r at the point.
    pub fn evaluate_values(&mut self) {
        let v = &self.iterate.v[..self.iterate.nv];
        let values = &mut self.values;
        self.form.load(v);
        self.form.rows(&mut values.c);
        self.form.residual(&values.c, v, &mut values.residual);
        values.f = self.elastic.objective(&mut self.form, v);
    }

    /// All values and derivatives at the point.
    pub fn evaluate(&mut self) -> Result<(), Failure> {
        self.evaluate_values();
        self.evaluate_derivatives()
    }

    /// Derivatives at the point, whose values are known.
    pub fn evaluate_derivatives(&mut self) -> Result<(), Failure> {
        self.evaluate_gradients();
        let factor = if self.is_restoration() { 0.0 } else { 1.0 };
        let derivatives = &mut self.derivatives;
        (self.form).hessian(factor, &self.iterate.y, &mut derivatives.hessian);
        let is_finite = self.values.f.is_finite()
            && self.values.residual.iter().sum::<f64>().is_finite()
            && derivatives.are_finite(self.iterate.nv);
        is_finite.then_some(()).ok_or(Failure::Evaluation)
    }

    pub fn evaluate_gradients(&mut self) {
        let (form, at) = (&mut self.form, &self.iterate);
        let (n, nv) = (form.shape.n, at.nv);
        let Derivatives {
            gradient,
            lagrangian,
            jacobian,
            ..
        } = &mut self.derivatives;
        form.jacobian(jacobian);
        self.elastic
            .gradient(form, &at.v[..nv], &mut gradient[..nv]);
        lagrangian[..nv].copy_from_slice(&gradient[..nv]);
        (form.jacobian).add_transposed(jacobian, &at.y, &mut lagrangian[..n]);
        for (slope, attached) in lagrangian[n..nv].iter_mut().zip(&form.shape.attached) {
            *slope += attached.sign * at.y[attached.row as usize];
        }
    }

    /// θ and φ at the point.
    pub fn merit(&self) -> Merit {
        let at = &self.iterate;
        Merit {
            theta: self.values.violation(),
            phi: self.values.f + at.barrier_terms(&at.v[..at.nv], self.mu),
        }
    }

    /// ∇φᵀΔv.
    pub fn slope(&self, step: &Step) -> f64 {
        let terms = (0..self.iterate.nv).map(|i| {
            let slope = self.derivatives.gradient[i] + self.mu * self.iterate.barrier_slope(i);
            slope * step.v[i]
        });
        terms.sum()
    }

    /// θ and φ at v + α Δv, or nothing where they are no numbers. Slacks that can take up violation do.
    pub fn try_point(&mut self, step: &Step, alpha: f64, trial: &mut Trial) -> Option<Merit> {
        trial.count += 1;
        let (at, values) = (&self.iterate, &mut trial.values);
        let v = &mut trial.v[..at.nv];
        for ((trial, v), dv) in v.iter_mut().zip(&at.v).zip(&step.v) {
            *trial = v + alpha * dv;
        }
        self.form.load(v);
        self.form.rows(&mut values.c);
        if !self.elastic.is_active {
            let least = self.mu.max(self.options.acceptable_tolerance);
            for (&slack, &c) in self.form.shape.slacks.iter().zip(&values.c) {
                if slack == NONE {
                    continue;
                }
                // Away from the only bound there is, which φ likes.
                let slack = slack as usize;
                if at.upper[slack] == f64::INFINITY && c > v[slack] + least
                    || at.lower[slack] == f64::NEG_INFINITY && c < v[slack] - least
                {
                    v[slack] = c;
                }
            }
        }
        values.f = self.elastic.objective(&mut self.form, v);
        self.form.residual(&values.c, v, &mut values.residual);
        let merit = Merit {
            theta: values.violation(),
            phi: values.f + at.barrier_terms(v, self.mu),
        };
        (merit.theta.is_finite() && merit.phi.is_finite()).then_some(merit)
    }

    /// Goes to the trial point; multipliers stay near μ / distance.
    pub fn accept(&mut self, trial: &Trial, step: &Step, alpha: f64, alpha_dual: f64) {
        self.form.load(&trial.v);
        self.values.f = trial.values.f;
        self.values.c.copy_from_slice(&trial.values.c);
        (self.values.residual).copy_from_slice(&trial.values.residual);
        self.iterate.advance(&trial.v, step, alpha, alpha_dual);
        self.iterate.reset_multipliers(self.mu, KAPPA_SIGMA);
        self.iterate.keep_interior(self.mu);
    }

    pub fn errors(&self) -> Errors {
        let target = self.options.mu_target;
        let (values, derivatives) = (&self.values, &self.derivatives);
        Errors::new(
            &self.iterate,
            &values.residual,
            &derivatives.lagrangian,
            target,
        )
    }

    /// Whether errors are within the absolute tolerances of dual, rows and complementarity: whatever the scaling, a
    /// solution misses no condition by more.
    pub fn is_within(&self, errors: &Errors, [dual, primal, complementarity]: [f64; 3]) -> bool {
        let scale = self.form.objective_scale;
        let residuals = self.values.residual.iter().zip(&self.form.row_scale);
        let violation = residuals.fold(0.0_f64, |m, (r, scale)| m.max(r.abs() / scale));
        let products = self.iterate.complementarity(self.options.mu_target);
        errors.dual / scale <= dual && violation <= primal && products / scale <= complementarity
    }

    /// Begins to minimize the violation, and says with which μ.
    pub fn enter_restoration(&mut self, theta: f64) -> f64 {
        let (m, own) = (self.form.shape.m, self.form.shape.own());
        let at = &mut self.iterate;
        self.elastic.start(&at.v[..own], self.mu, theta);
        at.nv = self.form.shape.n_all();
        // The y of p and n are as large as ρ and would bring curvature from far away; the first step finds it.
        at.y.fill(0.0);
        let mu = self.mu.max(largest(&self.values.residual));
        for (j, &r) in self.values.residual.iter().enumerate() {
            let [p, n] = Elastic::parts(r, mu);
            for (place, value) in [(own + j, p), (own + m + j, n)] {
                at.v[place] = value;
                at.z_l[place] = mu / value;
            }
        }
        for z in at.z_l[..own].iter_mut().chain(&mut at.z_u[..own]) {
            *z = z.min(RHO);
        }
        mu
    }

    /// Returns to the program itself, without multipliers of rows.
    pub fn leave_restoration(&mut self) {
        self.elastic.is_active = false;
        self.assign_mu(self.elastic.mu);
        let at = &mut self.iterate;
        at.nv = self.form.shape.own();
        for i in 0..at.nv {
            let [lower, upper] = at.distances(i);
            at.z_l[i] = (self.mu / lower).min(Z_MAX);
            at.z_u[i] = (self.mu / upper).min(Z_MAX);
        }
        self.evaluate_values();
        self.evaluate_gradients();
    }

    /// θ and φ of the program itself, if the violation has fallen far enough for it to go on from here.
    pub fn restored(&mut self) -> Option<Merit> {
        let (m, own) = (self.form.shape.m, self.form.shape.own());
        let v = &self.iterate.v;
        let elastic = |j: usize| v[own + j] - v[own + m + j];
        let residuals = self.values.residual.iter().enumerate();
        let theta: f64 = residuals.map(|(j, r)| (r + elastic(j)).abs()).sum();
        if theta > KAPPA_RESTO * self.elastic.theta {
            return None;
        }
        let f = self.form.objective();
        let terms = self.iterate.barrier_terms(&v[..own], self.mu);
        let phi = f + self.elastic.mu / self.mu * terms;
        f.is_finite().then_some(Merit { theta, phi })
    }

    /// The objective in the units of the problem.
    pub fn objective(&mut self) -> f64 {
        let f = if self.is_restoration() {
            self.form.objective()
        } else {
            self.values.f
        };
        f / self.form.objective_scale
    }

    /// The point in the units of the problem.
    pub fn point(&mut self) -> Point {
        self.form.point(&self.iterate, self.mu)
    }
}
