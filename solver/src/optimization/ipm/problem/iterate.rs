//! The iterate: variables between their bounds, with their multipliers, and what the barrier makes of the distances.
//!
//! d = v - l and e = u - v are the distances from the bounds; infinite ones drop out by themselves.

/// Weight of the distance of a variable from its only bound, so that it does not run away.
/// Wächter & Biegler 2006, section 3.7.
const DAMPING: f64 = 1e-5;
/// Distance from bounds relative to the range between both.
const KAPPA_2: f64 = 1e-2;

/// A change of all variables and multipliers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Step {
    pub v: Vec<f64>,
    pub y: Vec<f64>,
    pub z_l: Vec<f64>,
    pub z_u: Vec<f64>,
}

impl Step {
    pub fn new(n_all: usize, m: usize) -> Self {
        Step {
            v: vec![0.0; n_all],
            y: vec![0.0; m],
            z_l: vec![0.0; n_all],
            z_u: vec![0.0; n_all],
        }
    }
}

/// v, the multipliers y of rows and z of bounds, and the bounds l and u of v.
pub(crate) struct Iterate {
    /// How many variables take part: x and slacks and, while the violation is minimized, p and n.
    pub nv: usize,
    pub v: Vec<f64>,
    pub y: Vec<f64>,
    pub z_l: Vec<f64>,
    pub z_u: Vec<f64>,
    pub lower: Vec<f64>,
    pub upper: Vec<f64>,
    /// l and u before bounds moved.
    old: [Vec<f64>; 2],
}

impl Iterate {
    pub fn new(nv: usize, n_all: usize, m: usize) -> Self {
        let all = || vec![0.0; n_all];
        Iterate {
            nv,
            v: all(),
            y: vec![0.0; m],
            z_l: all(),
            z_u: all(),
            lower: all(),
            upper: vec![f64::INFINITY; n_all],
            old: [all(), all()],
        }
    }

    /// The distance of variable i from its lower bound and from its upper one.
    pub fn distances(&self, i: usize) -> [f64; 2] {
        [self.v[i] - self.lower[i], self.upper[i] - self.v[i]]
    }

    /// The derivative of the barrier terms of variable i with μ.
    pub fn barrier_slope(&self, i: usize) -> f64 {
        let [lower, upper] = self.distances(i);
        upper.recip() - lower.recip() + self.damping(i)
    }

    /// The derivative of the damping of variable i with μ and v_i.
    pub fn damping(&self, i: usize) -> f64 {
        match (self.lower[i].is_finite(), self.upper[i].is_finite()) {
            (true, false) => DAMPING,
            (false, true) => -DAMPING,
            _ => 0.0,
        }
    }

    /// Σ of what the barrier adds to the objective at `v`.
    pub fn barrier_terms(&self, v: &[f64], mu: f64) -> f64 {
        let (mut sum, mut damping) = (LogSum::default(), 0.0);
        let bounds = self.lower.iter().zip(&self.upper);
        for (&v, (&lower, &upper)) in v.iter().zip(bounds) {
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
        mu * (DAMPING * damping - sum.value())
    }

    /// max |d z - μ|.
    pub fn complementarity(&self, mu: f64) -> f64 {
        let products = self.products().map(|product| (product - mu).abs());
        products.fold(0.0_f64, f64::max)
    }

    /// The mean of d z, 0 without bounds.
    pub fn average_product(&self) -> f64 {
        let (sum, count) = self
            .products()
            .fold((0.0, 0_usize), |(sum, count), product| {
                (sum + product, count + 1)
            });
        if count == 0 { 0.0 } else { sum / count as f64 }
    }

    /// d z of every bound.
    fn products(&self) -> impl Iterator<Item = f64> {
        (0..self.nv).flat_map(|i| {
            let [lower, upper] = self.distances(i);
            let lower = (self.lower[i].is_finite()).then(|| self.z_l[i] * lower);
            let upper = (self.upper[i].is_finite()).then(|| self.z_u[i] * upper);
            lower.into_iter().chain(upper)
        })
    }

    /// The number of bounds that are active: z >= d. z = 0 where d is infinite.
    pub fn n_active(&self) -> usize {
        let is_active = |&i: &usize| self.z_l[i] >= self.v[i] - self.lower[i];
        let lower = (0..self.nv).filter(is_active).count();
        let is_active = |&i: &usize| self.z_u[i] >= self.upper[i] - self.v[i];
        lower + (0..self.nv).filter(is_active).count()
    }

    /// The longest step in (0, 1] along which no variable comes nearer to its bound than (1 - τ) of the distance.
    pub fn primal_length(&self, step: &Step, tau: f64) -> f64 {
        let mut length: f64 = 1.0;
        for i in 0..self.nv {
            let dv = step.v[i];
            let distance = if dv < 0.0 {
                self.v[i] - self.lower[i]
            } else {
                self.upper[i] - self.v[i]
            };
            if length * dv.abs() > tau * distance {
                length = tau * distance / dv.abs();
            }
        }
        length
    }

    /// The same for the multipliers of bounds.
    pub fn dual_length(&self, step: &Step, tau: f64) -> f64 {
        let mut length: f64 = 1.0;
        for (z, dz) in [(&self.z_l, &step.z_l), (&self.z_u, &step.z_u)] {
            for (&z, &dz) in z[..self.nv].iter().zip(dz) {
                if -length * dz > tau * z {
                    length = -tau * z / dz;
                }
            }
        }
        length
    }

    /// Goes to v and along the multipliers of the step.
    pub fn advance(&mut self, v: &[f64], step: &Step, alpha: f64, alpha_dual: f64) {
        self.v[..self.nv].copy_from_slice(&v[..self.nv]);
        for (y, dy) in self.y.iter_mut().zip(&step.y) {
            *y += alpha * dy;
        }
        for i in 0..self.nv {
            self.z_l[i] += alpha_dual * step.z_l[i];
            self.z_u[i] += alpha_dual * step.z_u[i];
        }
    }

    /// z within μ / d divided and multiplied by `factor`. Wächter & Biegler 2006, eq. (16).
    pub fn reset_multipliers(&mut self, mu: f64, factor: f64) {
        for i in 0..self.nv {
            let [lower, upper] = self.distances(i);
            let clamp = |z: f64, d: f64| z.min(factor * mu / d).max(mu / (factor * d));
            self.z_l[i] = clamp(self.z_l[i], lower);
            self.z_u[i] = clamp(self.z_u[i], upper);
        }
    }

    /// Bounds that rounding has reached move outward a little.
    pub fn keep_interior(&mut self, mu: f64) {
        let least = f64::EPSILON * mu.min(1.0);
        let room = f64::EPSILON.powf(0.75);
        for i in 0..self.nv {
            if self.v[i] - self.lower[i] < least {
                self.lower[i] = self.v[i] - room * self.v[i].abs().max(1.0);
            }
            if self.upper[i] - self.v[i] < least {
                self.upper[i] = self.v[i] + room * self.v[i].abs().max(1.0);
            }
        }
    }

    /// Moves v_i away from its bounds. Wächter & Biegler 2006, section 3.6.
    pub fn push_inside(&mut self, i: usize, push: f64) {
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

    /// Replaces l and u by what `read` says; variables that they have come too near to keep their distance.
    pub fn move_bounds(&mut self, read: impl FnOnce(&mut [f64], &mut [f64])) {
        let nv = self.nv;
        self.old[0][..nv].copy_from_slice(&self.lower[..nv]);
        self.old[1][..nv].copy_from_slice(&self.upper[..nv]);
        read(&mut self.lower, &mut self.upper);
        for i in 0..nv {
            let (lower, upper) = (self.lower[i], self.upper[i]);
            let half = 0.5 * (upper - lower);
            let below = (self.v[i] - self.old[0][i]).min(half);
            let above = (self.old[1][i] - self.v[i]).min(half);
            if self.v[i] - lower < 0.1 * below {
                self.v[i] = lower + below;
            }
            if upper - self.v[i] < 0.1 * above {
                self.v[i] = upper - above;
            }
        }
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
