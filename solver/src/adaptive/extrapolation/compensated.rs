//! Sums that keep what rounding takes from them.

use crate::integrate::two_sum::two_sum;

/// Vectors in two parts, `low` being what rounding has kept out of `high`.
#[derive(Clone, Debug)]
pub struct Compensated {
    pub high: Vec<f64>,
    pub low: Vec<f64>,
}

impl Compensated {
    /// Zero in n dimensions.
    pub fn new(n: usize) -> Self {
        Compensated {
            high: vec![0.0; n],
            low: vec![0.0; n],
        }
    }

    /// Entry i is a + b.
    fn set(&mut self, i: usize, a: f64, b: f64) {
        (self.high[i], self.low[i]) = two_sum(a, b);
    }

    /// T_{j,k+1} from T_{j-1,k}, which stands here, and T_{j,k}.
    pub fn extrapolate(&mut self, new: &Compensated, factor: f64) {
        for i in 0..self.high.len() {
            let difference = (new.high[i] - self.high[i]) + (new.low[i] - self.low[i]);
            self.set(i, new.high[i], new.low[i] + difference * factor);
        }
    }
}

/// y_{i-1} and y_i of the modified midpoint rule.
pub struct Leapfrog {
    pub before: Compensated,
    pub here: Compensated,
}

impl Leapfrog {
    /// Memory for n states.
    pub fn new(n: usize) -> Self {
        Leapfrog {
            before: Compensated::new(n),
            here: Compensated::new(n),
        }
    }

    /// y₀, and y₁ = y₀ + h f.
    pub fn begin(&mut self, start: &[f64], h: f64, rates: &[f64]) {
        self.before.high.copy_from_slice(start);
        self.before.low.fill(0.0);
        for (i, (start, rate)) in start.iter().zip(rates).enumerate() {
            self.here.set(i, *start, h * rate);
        }
    }

    /// y_{i+1} = y_{i-1} + (2h) f(y_i).
    pub fn advance(&mut self, twice: f64, rates: &[f64]) {
        for (i, rate) in rates.iter().enumerate() {
            let step = twice * rate + self.before.low[i];
            self.before.set(i, self.before.high[i], step);
        }
        std::mem::swap(&mut self.before, &mut self.here);
    }

    /// T = ½ (y_n + y_{n-1} + h f(y_n)).
    pub fn smooth(&self, h: f64, rates: &[f64], result: &mut Compensated) {
        let Leapfrog { before, here } = self;
        for (i, rate) in rates.iter().enumerate() {
            let (a, b) = (here.high[i], before.high[i]);
            let step = h * rate + (here.low[i] + before.low[i]);
            result.set(i, 0.5 * a, 0.5 * b);
            result.set(i, result.high[i], result.low[i] + 0.5 * step);
        }
    }
}
