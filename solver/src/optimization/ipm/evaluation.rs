//! Values at the point and along a step.

use super::Run;
use super::direction::{DAMPING, Step};
use super::filter::Merit;
use super::form::NONE;
use super::solution::Failure;

impl Run<'_> {
    /// f, c and r at the point.
    pub(crate) fn evaluate_values(&mut self) {
        self.form.load(&self.v);
        let n = self.form.n;
        self.form.rows(&mut self.c);
        let nv = self.nv();
        self.form
            .residual(&self.c, &self.v[..nv], &mut self.residual);
        self.f = if self.is_restoration {
            self.elastic.objective(&self.v, n + self.form.n_slacks)
        } else {
            self.form.objective()
        };
    }

    /// All values and derivatives at the point.
    pub(crate) fn evaluate(&mut self) -> Result<(), Failure> {
        self.evaluate_values();
        self.evaluate_derivatives()
    }

    /// Derivatives at the point, whose values are known.
    pub(crate) fn evaluate_derivatives(&mut self) -> Result<(), Failure> {
        self.evaluate_gradients();
        let factor = if self.is_restoration { 0.0 } else { 1.0 };
        self.form.hessian(factor, &self.y, &mut self.hessian);
        let nv = self.nv();
        let sums = [
            &self.residual,
            &self.lagrangian[..nv],
            &self.jacobian,
            &self.hessian,
        ];
        let is_finite = self.f.is_finite()
            && sums
                .iter()
                .all(|values| values.iter().sum::<f64>().is_finite());
        is_finite.then_some(()).ok_or(Failure::Evaluation)
    }

    pub(crate) fn evaluate_gradients(&mut self) {
        let n = self.form.n;
        let nv = self.nv();
        self.form.jacobian(&mut self.jacobian);
        if self.is_restoration {
            let own = n + self.form.n_slacks;
            self.elastic.gradient(&self.v, own, &mut self.gradient);
        } else {
            self.form.gradient(&mut self.gradient[..n]);
            self.gradient[n..nv].fill(0.0);
        }
        self.lagrangian[..nv].copy_from_slice(&self.gradient[..nv]);
        let form = &self.form;
        form.jacobian
            .add_transposed(&self.jacobian, &self.y, &mut self.lagrangian[..n]);
        for (slope, attached) in self.lagrangian[n..nv].iter_mut().zip(&form.attached) {
            *slope += attached.sign * self.y[attached.row as usize];
        }
    }

    /// θ and φ at the point.
    pub(crate) fn merit(&self) -> Merit {
        Merit {
            theta: self.residual.iter().map(|r| r.abs()).sum(),
            phi: self.f + self.barrier_terms(&self.v),
        }
    }

    /// Σ of what the barrier adds to the objective.
    pub(crate) fn barrier_terms(&self, v: &[f64]) -> f64 {
        let (mut sum, mut damping) = (LogSum::default(), 0.0);
        let bounds = self.lower.iter().zip(&self.upper);
        for (&v, (&lower, &upper)) in v.iter().zip(bounds).take(self.nv()) {
            let (lower, upper) = (v - lower, upper - v);
            if lower < f64::INFINITY {
                sum.add(lower);
            }
            if upper < f64::INFINITY {
                sum.add(upper);
            }
            if (lower < f64::INFINITY) != (upper < f64::INFINITY) {
                damping += lower.min(upper);
            }
        }
        self.mu * (DAMPING * damping - sum.value())
    }

    /// θ and φ at v + α Δv, or nothing where they are no numbers. Slacks that can take up violation do.
    pub(crate) fn try_point(&mut self, step: &Step, alpha: f64) -> Option<Merit> {
        self.trials += 1;
        let (n, nv) = (self.form.n, self.nv());
        for i in 0..nv {
            self.trial[i] = self.v[i] + alpha * step.v[i];
        }
        self.form.load(&self.trial);
        self.form.rows(&mut self.trial_c);
        if !self.is_restoration {
            let least = self.mu.max(self.options.acceptable_tolerance);
            for (&slack, &c) in self.form.slacks.iter().zip(&self.trial_c) {
                if slack == NONE {
                    continue;
                }
                // Away from the only bound there is, which φ likes.
                let slack = slack as usize;
                if self.upper[slack] == f64::INFINITY && c > self.trial[slack] + least
                    || self.lower[slack] == f64::NEG_INFINITY && c < self.trial[slack] - least
                {
                    self.trial[slack] = c;
                }
            }
        }
        self.trial_f = if self.is_restoration {
            self.elastic.objective(&self.trial, n + self.form.n_slacks)
        } else {
            self.form.objective()
        };
        self.form
            .residual(&self.trial_c, &self.trial[..nv], &mut self.trial_residual);
        let merit = Merit {
            theta: self.trial_residual.iter().map(|r| r.abs()).sum(),
            phi: self.trial_f + self.barrier_terms(&self.trial),
        };
        (merit.theta.is_finite() && merit.phi.is_finite()).then_some(merit)
    }
}

/// Σ ln d over d > 0, by few logarithms; minus infinity if a d is not positive.
struct LogSum {
    sum: f64,
    product: f64,
}

impl Default for LogSum {
    fn default() -> Self {
        LogSum {
            sum: 0.0,
            product: 1.0,
        }
    }
}

impl LogSum {
    fn add(&mut self, d: f64) {
        self.product *= d.max(0.0);
        if !(1e-100..1e100).contains(&self.product) {
            self.sum += self.product.ln();
            self.product = 1.0;
        }
    }

    fn value(self) -> f64 {
        self.sum + self.product.ln()
    }
}

#[cfg(test)]
mod tests {
    use super::LogSum;

    #[test]
    fn few_logarithms_are_as_good_as_many() {
        let mut sum = LogSum::default();
        let values = (0..200).map(|i| 10.0_f64.powi(37 * i % 41 - 10 * (i % 5)));
        let expected: f64 = values.clone().map(f64::ln).sum();
        values.for_each(|value| sum.add(value));
        assert!((sum.value() - expected).abs() < 1e-9 * expected.abs());
        for outside in [0.0, -1.0] {
            let mut sum = LogSum::default();
            sum.add(outside);
            sum.add(-1.0);
            assert_eq!(sum.value(), f64::NEG_INFINITY);
        }
    }
}
