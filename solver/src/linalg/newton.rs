//! Newton's method: y ← y - J(y)⁻¹ r(y) until the change is small, or as small as rounding lets it be.

/// When iterates have converged. A change is relative to 1 + |y|.
pub(crate) struct Newton {
    /// Iterations at most.
    pub most: usize,
    /// A change that is small.
    pub converged: f64,
    /// A change that counts as rounding below this, once an iteration leaves more than half of it.
    pub rounding: f64,
}

impl Newton {
    /// Repeats `step`, which gives its change, until the iterates have converged; whether they do.
    pub fn iterate<E>(&self, mut step: impl FnMut() -> Result<f64, E>) -> Result<bool, E> {
        let mut last = f64::INFINITY;
        for _ in 0..self.most {
            let change = step()?;
            if self.has_converged(change, last) {
                return Ok(true);
            }
            if !change.is_finite() {
                return Ok(false);
            }
            last = change;
        }
        Ok(false)
    }

    /// Whether a change is the last one, after the one before.
    pub fn has_converged(&self, change: f64, last: f64) -> bool {
        change <= self.converged || (change <= self.rounding && change >= 0.5 * last)
    }
}

/// y ← y - δ; the change, which is no number where one of δ is none.
pub(crate) fn subtract(y: &mut [f64], delta: &[f64]) -> f64 {
    y.iter_mut().zip(delta).fold(0.0, |most: f64, (y, delta)| {
        *y -= delta;
        let change = delta.abs() / (1.0 + y.abs());
        if change > most || change.is_nan() {
            change
        } else {
            most
        }
    })
}
