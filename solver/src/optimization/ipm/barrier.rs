//! The barrier parameter: monotone, or chosen in every iteration by the quality function.
//!
//! The step is Δ(μ) = Δ₀ + μ Δ₁, affine in μ. The quality function is the linearized optimality error at the end of
//! the longest such step,
//!
//! q(μ) = (1 - α_d)² ‖∇L‖²/n + (1 - α_p)² ‖r‖²/m + ‖(d + α_p Δd)(z + α_d Δz)‖²/n_c,
//!
//! Nocedal, Wächter & Waltz 2009, eq. (4.2), with squares as in the implementation of Wächter & Biegler. Where violation
//! and objective do not both get away from what they have been, μ is kept until its barrier problem is solved.

use super::direction::Step;
use super::filter::{Filter, Merit};
use super::options::BarrierRule;
use super::residuals::Errors;
use super::solution::Failure;
use super::{KAPPA_EPSILON, Run, TAU_MIN};
use crate::linalg::largest;

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
/// Multipliers this many times as large as those along the rows are the work of a correction.
const INFLATED: f64 = 3.0;
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

impl Run<'_> {
    /// The least μ.
    pub(crate) fn mu_floor(&self) -> f64 {
        let options = self.options;
        options
            .mu_target
            .max(options.tolerance / (KAPPA_EPSILON + 1.0))
    }

    /// Sets what μ depends on at the start of a run.
    pub(crate) fn start_barrier(&mut self) {
        self.barrier.largest = MU_MAX * self.average_product().max(self.mu);
        self.barrier.past.clear();
    }

    /// Whether μ has changed, by the rule of Fiacco and McCormick. In free mode this ends the mode where progress fails.
    pub(crate) fn decrease_mu(&mut self, errors: &Errors) -> bool {
        let floor = self.mu_floor();
        let is_adaptive = !self.is_restoration && self.options.barrier == BarrierRule::Adaptive;
        if is_adaptive {
            let progresses = self.n_tiny == 0 && self.progresses(errors);
            if progresses {
                self.barrier.is_free = true;
                return false;
            }
            if self.barrier.is_free {
                self.barrier.is_free = false;
                let mu = (KEPT * self.average_product()).clamp(floor, self.barrier.largest);
                self.n_tiny = 0;
                self.set_mu(mu);
                return true;
            }
        }
        let error = self.optimality_error(errors, self.mu);
        let is_solved = error <= KAPPA_EPSILON * self.mu || self.is_stalled || self.n_tiny >= 2;
        if self.mu <= floor || !is_solved {
            return false;
        }
        (self.n_tiny, self.is_stalled) = (0, false);
        self.set_mu((KAPPA_MU * self.mu).min(self.mu.powf(THETA_MU)).max(floor));
        true
    }

    /// Whether violation and objective are not both as bad as they have been; then they are remembered.
    fn progresses(&mut self, errors: &Errors) -> bool {
        let margin = MARGIN * self.optimality_error(errors, 0.0).min(1.0);
        let theta = self.residual.iter().map(|r| r.abs()).sum();
        let at = Merit { theta, phi: self.f };
        if !self.barrier.past.accepts(at) {
            return false;
        }
        self.barrier.past.add_entry(Merit {
            theta: theta - margin,
            phi: self.f - margin,
        });
        true
    }

    /// Sets μ; whether rows or bounds have followed it.
    pub(crate) fn set_mu(&mut self, mu: f64) -> bool {
        self.mu = mu;
        self.filter.clear();
        self.tau = (1.0 - mu).max(TAU_MIN);
        if self.is_restoration {
            self.elastic.zeta = mu.sqrt();
        } else if self.form.nlp.follow(mu) {
            self.follows = true;
            self.move_bounds();
            self.barrier.past.clear();
            self.acceptable.clear();
            return true;
        }
        false
    }

    fn average_product(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0_usize);
        for i in 0..self.nv() {
            if self.lower[i].is_finite() {
                sum += self.z_l[i] * (self.v[i] - self.lower[i]);
                count += 1;
            }
            if self.upper[i].is_finite() {
                sum += self.z_u[i] * (self.upper[i] - self.v[i]);
                count += 1;
            }
        }
        if count == 0 { 0.0 } else { sum / count as f64 }
    }

    /// The step, for the present μ or for the one that is best.
    pub(crate) fn newton_step(&mut self) -> Result<(), Failure> {
        self.factor()?;
        let is_free = self.barrier.is_free && !self.is_restoration;
        let average = if is_free { self.average_product() } else { 0.0 };
        if average == 0.0 {
            return self.plain_step();
        }
        let barrier = &mut self.barrier;
        let mut affine = std::mem::take(&mut barrier.affine);
        let mut centering = std::mem::take(&mut barrier.centering);
        let mut products = std::mem::take(&mut barrier.products);
        let chosen = self.choose_mu(&mut affine, &mut centering, &mut products, average);
        self.barrier.affine = affine;
        self.barrier.centering = centering;
        self.barrier.products = products;
        let mu = chosen?;
        if self.set_mu(mu) {
            if !self.form.has_shape() {
                return Err(Failure::LinearSystem);
            }
            self.evaluate()?;
            self.factor()?;
            self.target.copy_from_slice(&self.residual);
            return self.plain_step();
        }
        let (affine, centering) = (&self.barrier.affine, &self.barrier.centering);
        let combine = |to: &mut [f64], a: &[f64], c: &[f64]| {
            for ((to, a), c) in to.iter_mut().zip(a).zip(c) {
                *to = a + mu * c;
            }
        };
        combine(&mut self.step.v, &affine.v, &centering.v);
        combine(&mut self.step.y, &affine.y, &centering.y);
        combine(&mut self.step.z_l, &affine.z_l, &centering.z_l);
        combine(&mut self.step.z_u, &affine.z_u, &centering.z_u);
        Ok(())
    }

    fn plain_step(&mut self) -> Result<(), Failure> {
        let mut step = std::mem::take(&mut self.step);
        let result = self.direction(self.mu, 1.0, &mut step);
        if result.is_ok() && self.kkt.is_corrected() && !self.is_restoration {
            self.tangential_multipliers(&mut step);
        }
        self.step = step;
        result
    }

    /// The multipliers of the step along the rows alone. Those of the whole one have a part δ_w (E Eᵀ)⁻¹ r, which grows
    /// with the correction, brings curvature that asks for a larger one, and says nothing about the problem.
    fn tangential_multipliers(&mut self, step: &mut Step) {
        let size = |y: &[f64], dy: &[f64]| {
            let sums = y.iter().zip(dy).map(|(y, dy)| (y + dy).abs());
            sums.fold(1.0, f64::max)
        };
        let whole = size(&self.y, &step.y);
        if whole <= INFLATED * largest(&self.y).max(1.0) {
            return;
        }
        let mut tangential = std::mem::take(&mut self.corrected);
        self.target.fill(0.0);
        if self.direction(self.mu, 1.0, &mut tangential).is_ok()
            && whole > INFLATED * size(&self.y, &tangential.y)
        {
            step.y.copy_from_slice(&tangential.y);
        }
        self.target.copy_from_slice(&self.residual);
        self.corrected = tangential;
    }

    /// The μ that makes the quality function least.
    fn choose_mu(
        &mut self,
        affine: &mut Step,
        centering: &mut Step,
        products: &mut Products,
        average: f64,
    ) -> Result<f64, Failure> {
        self.direction(0.0, 1.0, affine)?;
        self.direction(1.0, 0.0, centering)?;
        products.clear();
        let (mut dual, nv) = (0.0, self.nv());
        for i in 0..nv {
            dual += (self.lagrangian[i] - self.z_l[i] + self.z_u[i]).powi(2);
            let (da, dc) = (affine.v[i], centering.v[i]);
            if self.lower[i].is_finite() {
                let d = [self.v[i] - self.lower[i], da, dc];
                products.push(d, [self.z_l[i], affine.z_l[i], centering.z_l[i]]);
            }
            if self.upper[i].is_finite() {
                let d = [self.upper[i] - self.v[i], -da, -dc];
                products.push(d, [self.z_u[i], affine.z_u[i], centering.z_u[i]]);
            }
        }
        let dual = dual / nv as f64;
        let squares = self.residual.iter().map(|r| r * r);
        let primal = squares.sum::<f64>() / self.form.m.max(1) as f64;
        let n_products = products.d.len() as f64;
        let tau = self.tau;
        let quality = |mu: f64| {
            let (alpha_p, alpha_d, squares) = products.after(mu, tau);
            (1.0 - alpha_d).powi(2) * dual + (1.0 - alpha_p).powi(2) * primal + squares / n_products
        };
        let floor = self.mu_floor();
        let ceiling = (SIGMA[1] * average).min(self.barrier.largest);
        if ceiling <= floor {
            return Ok(floor);
        }
        let least = (SIGMA[0] * average).clamp(floor, ceiling);
        let here = average.clamp(least, ceiling);
        // Which side of the present average is better?
        let range = if quality(here) < quality((1.0 - SECTION) * here) {
            [here, ceiling]
        } else {
            [least, here]
        };
        Ok(golden_section(range, quality))
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
