//! The least violation: what the line search falls back on.
//!
//! minimize ρ Σ(p + n) + ζ/2 ‖D (v - v_R)‖²   subject to   c(x) - s - b - p + n = 0,   l <= v <= u,   p, n >= 0
//!
//! with ζ = √μ and D_i = min(1, 1/|v_R,i|), by the same iteration; p and n are eliminated from the linear system, which
//! keeps its pattern. Wächter & Biegler 2006, section 3.3.

use super::form::Form;

pub(crate) const RHO: f64 = 1e3;

#[derive(Clone, Debug)]
pub(crate) struct Elastic {
    /// Whether the violation is minimized.
    pub is_active: bool,
    pub zeta: f64,
    /// v_R and D².
    reference: Vec<f64>,
    weights: Vec<f64>,
    /// μ and θ where the restoration began.
    pub mu: f64,
    pub theta: f64,
}

impl Elastic {
    pub fn new(own: usize) -> Self {
        Elastic {
            is_active: false,
            zeta: 0.0,
            reference: vec![0.0; own],
            weights: vec![0.0; own],
            mu: 0.0,
            theta: 0.0,
        }
    }

    /// Starts at the point v_R.
    pub fn start(&mut self, reference: &[f64], mu: f64, theta: f64) {
        self.is_active = true;
        self.mu = mu;
        self.theta = theta;
        self.reference.copy_from_slice(reference);
        for (weight, v) in self.weights.iter_mut().zip(reference) {
            *weight = v.abs().max(1.0).powi(-2);
        }
    }

    /// p and n of a row with residual r that are best for μ: ρ - μ/p = y, ρ - μ/n = -y.
    pub fn parts(r: f64, mu: f64) -> [f64; 2] {
        let (size, share) = (r.abs(), mu / (2.0 * RHO));
        let half = share - 0.5 * size;
        let root = (half * half + share * size).sqrt();
        // The root that does not cancel.
        let least = if half > 0.0 {
            half + root
        } else {
            share * size / (root - half)
        };
        let least = least.max(f64::MIN_POSITIVE.sqrt());
        if r > 0.0 {
            [r + least, least]
        } else {
            [least, least - r]
        }
    }

    /// The objective at the point loaded: that of the program, or of the least violation.
    pub fn objective(&self, form: &mut Form<'_>, v: &[f64]) -> f64 {
        if !self.is_active {
            return form.objective();
        }
        let distances = v.iter().zip(&self.reference).zip(&self.weights);
        let proximity: f64 = distances.map(|((v, r), d)| d * (v - r) * (v - r)).sum();
        RHO * v[self.reference.len()..].iter().sum::<f64>() + 0.5 * self.zeta * proximity
    }

    /// Its gradient.
    pub fn gradient(&self, form: &mut Form<'_>, v: &[f64], gradient: &mut [f64]) {
        if !self.is_active {
            let (own, slacks) = gradient.split_at_mut(form.shape.n);
            form.gradient(own);
            slacks.fill(0.0);
            return;
        }
        let own = self.reference.len();
        for i in 0..own {
            gradient[i] = self.zeta * self.weights[i] * (v[i] - self.reference[i]);
        }
        gradient[own..].fill(RHO);
    }

    /// Adds the curvature of the proximity to Σ.
    pub fn add_curvature(&self, sigma: &mut [f64]) {
        if self.is_active {
            for (sigma, weight) in sigma.iter_mut().zip(&self.weights) {
                *sigma += self.zeta * weight;
            }
        }
    }
}
