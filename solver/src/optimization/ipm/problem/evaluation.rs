//! Values of the program and its derivatives.

/// f, c and r at a point.
#[derive(Clone, Debug)]
pub(crate) struct Values {
    pub f: f64,
    pub c: Vec<f64>,
    pub residual: Vec<f64>,
}

/// Derivatives at a point: of the objective, of the Lagrangian without bounds, E and W.
#[derive(Clone, Debug)]
pub(crate) struct Derivatives {
    pub gradient: Vec<f64>,
    pub lagrangian: Vec<f64>,
    pub jacobian: Vec<f64>,
    pub hessian: Vec<f64>,
}

/// A point along a step, with its values.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub v: Vec<f64>,
    pub values: Values,
    /// The number of points that were tried.
    pub count: usize,
}

impl Values {
    pub fn new(m: usize) -> Self {
        Values {
            f: 0.0,
            c: vec![0.0; m],
            residual: vec![0.0; m],
        }
    }

    /// θ = ‖r‖₁.
    pub fn violation(&self) -> f64 {
        self.residual.iter().map(|r| r.abs()).sum()
    }
}

impl Derivatives {
    /// Whether ∇L of the first `nv` variables, the Jacobian and the Hessian are numbers.
    pub fn are_finite(&self, nv: usize) -> bool {
        [&self.lagrangian[..nv], &self.jacobian, &self.hessian]
            .iter()
            .all(|values| values.iter().sum::<f64>().is_finite())
    }
}

impl Trial {
    pub fn new(n_all: usize, m: usize) -> Self {
        Trial {
            v: vec![0.0; n_all],
            values: Values::new(m),
            count: 0,
        }
    }
}

/// Σ ln d over d > 0, by few logarithms; minus infinity if a d is not positive.
pub(crate) struct LogSum {
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
    pub fn add(&mut self, d: f64) {
        self.product *= d.max(0.0);
        if !(1e-100..1e100).contains(&self.product) {
            self.sum += self.product.ln();
            self.product = 1.0;
        }
    }

    pub fn value(self) -> f64 {
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
