//! The barrier parameter: monotone, or chosen in every iteration by the quality function.
//!
//! The step is Δ(μ) = Δ₀ + μ Δ₁, affine in μ. The quality function is the linearized optimality error at the end of
//! the longest such step,
//!
//! q(μ) = (1 - α_d)² ‖∇L‖²/n + (1 - α_p)² ‖r‖²/m + ‖(d + α_p Δd)(z + α_d Δz)‖²/n_c,
//!
//! Nocedal, Wächter & Waltz 2009, eq. (4.2), with squares as in the implementation of Wächter & Biegler. Where violation
//! and objective do not both get away from what they have been, μ is kept until its barrier problem is solved.

use super::direction::{Aim, NewtonSystem};
use super::filter::{Filter, Merit};
use super::options::{BarrierRule, KAPPA_EPSILON};
use super::problem::BarrierProblem;
use super::problem::errors::Errors;
use super::problem::iterate::Step;
use super::solution::Failure;

const KAPPA_MU: f64 = 0.2;
const THETA_MU: f64 = 1.5;
/// μ is at most this share of the average product at the start, and at most and at least these shares of the present one.
const MU_MAX: f64 = 1e3;
const SIGMA: [f64; 2] = [1e-6, 1e2];
/// What the golden section search ends with.
const MAX_SECTIONS: usize = 8;
const SECTION: f64 = 1e-2;
/// μ relative to the average product, where it starts to be kept.
const KEPT: f64 = 0.8;
/// The margin by which progress has to exceed what was.
const MARGIN: f64 = 1e-5;

/// What the choice of μ remembers.
#[derive(Clone, Debug)]
pub(crate) struct Barrier {
    /// Whether μ is free in every iteration.
    is_free: bool,
    /// Violations and objectives that have been.
    past: Filter,
    /// The largest μ.
    largest: f64,
    affine: Step,
    centering: Step,
    products: Products,
}

/// Signs that the barrier problem is solved as far as rounding lets it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rest {
    /// The number of tiny steps in a row.
    pub n_tiny: usize,
    /// Whether the error becomes no smaller.
    pub is_stalled: bool,
}

/// Distances and multipliers of all bounds and their changes, for the quality function.
#[derive(Clone, Debug, Default)]
struct Products {
    d: Vec<f64>,
    z: Vec<f64>,
    d_affine: Vec<f64>,
    d_centering: Vec<f64>,
    z_affine: Vec<f64>,
    z_centering: Vec<f64>,
}

impl Products {
    fn clear(&mut self) {
        for list in [
            &mut self.d,
            &mut self.z,
            &mut self.d_affine,
            &mut self.d_centering,
            &mut self.z_affine,
            &mut self.z_centering,
        ] {
            list.clear();
        }
    }

    fn push(&mut self, d: [f64; 3], z: [f64; 3]) {
        self.d.push(d[0]);
        self.d_affine.push(d[1]);
        self.d_centering.push(d[2]);
        self.z.push(z[0]);
        self.z_affine.push(z[1]);
        self.z_centering.push(z[2]);
    }

    /// The longest step that keeps `value` positive.
    fn length(value: &[f64], affine: &[f64], centering: &[f64], mu: f64, tau: f64) -> f64 {
        let changes = affine.iter().zip(centering).map(|(a, c)| a + mu * c);
        let fastest = changes
            .zip(value)
            .fold(0.0_f64, |fastest, (change, value)| {
                fastest.max(-change / value)
            });
        if fastest > tau { tau / fastest } else { 1.0 }
    }

    /// α_p, α_d and the sum of the squares of the products after the step.
    fn after(&self, mu: f64, tau: f64) -> (f64, f64, f64) {
        let primal = Self::length(&self.d, &self.d_affine, &self.d_centering, mu, tau);
        let dual = Self::length(&self.z, &self.z_affine, &self.z_centering, mu, tau);
        let d = self.d.iter().zip(&self.d_affine).zip(&self.d_centering);
        let z = self.z.iter().zip(&self.z_affine).zip(&self.z_centering);
        let squares = d.zip(z).map(|(((d, da), dc), ((z, za), zc))| {
            let product = (d + primal * (da + mu * dc)) * (z + dual * (za + mu * zc));
            product * product
        });
        (primal, dual, squares.sum())
    }
}

impl Barrier {
    pub fn new(rule: BarrierRule, n_all: usize, m: usize) -> Self {
        let (n_all, m) = if rule == BarrierRule::Adaptive {
            (n_all, m)
        } else {
            (0, 0)
        };
        let list = || Vec::with_capacity(2 * n_all);
        Barrier {
            is_free: rule == BarrierRule::Adaptive,
            past: Filter::new(),
            largest: f64::INFINITY,
            affine: Step::new(n_all, m),
            centering: Step::new(n_all, m),
            products: Products {
                d: list(),
                z: list(),
                d_affine: list(),
                d_centering: list(),
                z_affine: list(),
                z_centering: list(),
            },
        }
    }

    /// Sets what μ depends on at the start of a run.
    pub fn start(&mut self, problem: &BarrierProblem<'_>) {
        self.largest = MU_MAX * problem.iterate.average_product().max(problem.mu);
        self.past.clear();
    }

    /// Forgets what has been, where rows or bounds have moved.
    pub fn forget(&mut self) {
        self.past.clear();
    }

    /// The next μ, by the rule of Fiacco and McCormick, if it changes. In free mode this ends the mode where progress
    /// fails.
    pub fn next(
        &mut self,
        problem: &BarrierProblem<'_>,
        errors: &Errors,
        rest: &mut Rest,
    ) -> Option<f64> {
        let floor = problem.options.mu_floor();
        if !problem.is_restoration() && problem.options.barrier == BarrierRule::Adaptive {
            if rest.n_tiny == 0 && self.progresses(problem, errors) {
                self.is_free = true;
                return None;
            }
            if self.is_free {
                self.is_free = false;
                rest.n_tiny = 0;
                let average = problem.iterate.average_product();
                return Some((KEPT * average).clamp(floor, self.largest));
            }
        }
        let mu = problem.mu;
        let error = errors.optimality(&problem.iterate, mu);
        let is_solved = error <= KAPPA_EPSILON * mu || rest.is_stalled || rest.n_tiny >= 2;
        if mu <= floor || !is_solved {
            return None;
        }
        *rest = Rest::default();
        Some((KAPPA_MU * mu).min(mu.powf(THETA_MU)).max(floor))
    }

    /// Whether violation and objective are not both as bad as they have been; then they are remembered.
    fn progresses(&mut self, problem: &BarrierProblem<'_>, errors: &Errors) -> bool {
        let margin = MARGIN * errors.optimality(&problem.iterate, 0.0).min(1.0);
        let (theta, phi) = (problem.values.violation(), problem.values.f);
        if !self.past.accepts(Merit { theta, phi }) {
            return false;
        }
        self.past.add_entry(Merit {
            theta: theta - margin,
            phi: phi - margin,
        });
        true
    }

    /// The μ that makes the quality function least, in free mode and where there are bounds.
    pub fn choose(
        &mut self,
        problem: &BarrierProblem<'_>,
        newton: &mut NewtonSystem,
    ) -> Result<Option<f64>, Failure> {
        if !self.is_free || problem.is_restoration() {
            return Ok(None);
        }
        let average = problem.iterate.average_product();
        if average == 0.0 {
            return Ok(None);
        }
        for (mu, share, step) in [
            (0.0, 1.0, &mut self.affine),
            (1.0, 0.0, &mut self.centering),
        ] {
            let rows = Some(&problem.values.residual[..]);
            newton.direction(problem, Aim { mu, share, rows }, step)?;
        }
        let nv = problem.iterate.nv;
        let dual = self.collect(problem) / nv as f64;
        let squares = problem.values.residual.iter().map(|r| r * r);
        let primal = squares.sum::<f64>() / problem.form.shape.m.max(1) as f64;
        let (products, tau) = (&self.products, problem.tau);
        let n_products = products.d.len() as f64;
        let quality = |mu: f64| {
            let (alpha_p, alpha_d, squares) = products.after(mu, tau);
            (1.0 - alpha_d).powi(2) * dual + (1.0 - alpha_p).powi(2) * primal + squares / n_products
        };
        let floor = problem.options.mu_floor();
        let ceiling = (SIGMA[1] * average).min(self.largest);
        if ceiling <= floor {
            return Ok(Some(floor));
        }
        let least = (SIGMA[0] * average).clamp(floor, ceiling);
        let here = average.clamp(least, ceiling);
        // Which side of the present average is better?
        let range = if quality(here) < quality((1.0 - SECTION) * here) {
            [here, ceiling]
        } else {
            [least, here]
        };
        Ok(Some(golden_section(range, quality)))
    }

    /// Collects the products of all bounds and their changes; ‖∇L‖².
    fn collect(&mut self, problem: &BarrierProblem<'_>) -> f64 {
        let (at, lagrangian) = (&problem.iterate, &problem.derivatives.lagrangian);
        let (affine, centering) = (&self.affine, &self.centering);
        self.products.clear();
        let mut dual = 0.0;
        for (i, slope) in lagrangian[..at.nv].iter().enumerate() {
            dual += (slope - at.z_l[i] + at.z_u[i]).powi(2);
            let ([lower, upper], da, dc) = (at.distances(i), affine.v[i], centering.v[i]);
            if at.lower[i].is_finite() {
                let z = [at.z_l[i], affine.z_l[i], centering.z_l[i]];
                self.products.push([lower, da, dc], z);
            }
            if at.upper[i].is_finite() {
                let z = [at.z_u[i], affine.z_u[i], centering.z_u[i]];
                self.products.push([upper, -da, -dc], z);
            }
        }
        dual
    }

    /// The step for μ.
    pub fn combine(&self, mu: f64, step: &mut Step) {
        let (affine, centering) = (&self.affine, &self.centering);
        let combine = |to: &mut [f64], a: &[f64], c: &[f64]| {
            for ((to, a), c) in to.iter_mut().zip(a).zip(c) {
                *to = a + mu * c;
            }
        };
        combine(&mut step.v, &affine.v, &centering.v);
        combine(&mut step.y, &affine.y, &centering.y);
        combine(&mut step.z_l, &affine.z_l, &centering.z_l);
        combine(&mut step.z_u, &affine.z_u, &centering.z_u);
    }
}

/// Where in [a, b], a > 0, a function is least, on a logarithmic scale.
fn golden_section([a, b]: [f64; 2], function: impl Fn(f64) -> f64) -> f64 {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (a.ln(), b.ln());
    let at = |x: f64| function(x.exp());
    let (mut x1, mut x2) = (high - golden * (high - low), low + golden * (high - low));
    let (mut f1, mut f2) = (at(x1), at(x2));
    for _ in 0..MAX_SECTIONS {
        if high - low < SECTION {
            break;
        }
        if f1 > f2 {
            (low, x1, f1) = (x1, x2, f2);
            x2 = low + golden * (high - low);
            f2 = at(x2);
        } else {
            (high, x2, f2) = (x2, x1, f1);
            x1 = high - golden * (high - low);
            f1 = at(x1);
        }
    }
    // The ends are not within the search.
    let candidates = [
        (x1, f1),
        (x2, f2),
        (a.ln(), at(a.ln())),
        (b.ln(), at(b.ln())),
    ];
    let best = candidates.into_iter().min_by(|p, q| p.1.total_cmp(&q.1));
    best.map_or(b, |(x, _)| x.exp().clamp(a, b))
}

#[cfg(test)]
mod tests {
    use super::golden_section;

    #[test]
    fn the_golden_section_finds_minima_inside_and_at_the_ends() {
        let square = |center: f64| move |x: f64| (x.ln() - center.ln()).powi(2);
        for (center, tolerance) in [(1e-3, 0.5), (1e-6, 1e-9), (1.0, 1e-9)] {
            let found = golden_section([1e-6, 1.0], square(center));
            assert!(
                (found / center - 1.0).abs() < tolerance,
                "{found} instead of {center}"
            );
        }
    }
}
