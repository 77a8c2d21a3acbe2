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
