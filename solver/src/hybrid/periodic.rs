//! Instants that are known before a run: t_0 + k T, k = 0, 1, 2, ..
//!
//! Each is computed from its number k, so that no rounding adds up, and is known to a rounding of its own: two that are
//! closer than that, as 3 · 0.1 and 1 · 0.3 are, are one instant.

use serde::{Deserialize, Serialize};

/// Instants that differ by less than this share of their size are one.
const ONE: f64 = 8.0 * f64::EPSILON;

/// A period below this share of the time of an instant is lost in its rounding.
pub const LEAST_SHARE: f64 = 64.0 * f64::EPSILON;

/// The instants t_0 + k T.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Periodic {
    /// T > 0.
    pub period: f64,
    /// t_0 >= 0.
    pub offset: f64,
}

impl Periodic {
    /// Number k, at least 0.
    fn instant(&self, k: f64) -> f64 {
        self.offset + k.max(0.0) * self.period
    }

    /// The number of the instant next to t, which may be below 0.
    fn nearest(&self, t: f64) -> f64 {
        ((t - self.offset) / self.period).round()
    }

    /// The first instant behind t.
    pub(crate) fn next(&self, t: f64) -> f64 {
        let nearest = self.nearest(t);
        match self.instant(nearest) {
            next if next > t && !are_one(next, t) => next,
            _ => self.instant(nearest + 1.0),
        }
    }

    /// Whether t is one of the instants.
    pub(crate) fn holds(&self, t: f64) -> bool {
        are_one(self.instant(self.nearest(t)), t)
    }
}

/// Whether two instants are one.
pub(crate) fn are_one(a: f64, b: f64) -> bool {
    a == b || (a - b).abs() < ONE * a.abs().max(b.abs())
}

/// The last of the instants that are one with the first of them; infinity where there is none.
pub(crate) fn latest(instants: impl IntoIterator<Item = f64> + Clone) -> f64 {
    let first = (instants.clone().into_iter()).fold(f64::INFINITY, f64::min);
    let one = instants.into_iter().filter(|&t| are_one(t, first));
    one.fold(first, f64::max)
}

#[cfg(test)]
mod tests {
    use super::{Periodic, are_one};

    /// Walks from instant to instant: number k is k T, whatever came before.
    #[test]
    fn instants_are_multiples_of_the_period() {
        for (period, offset) in [
            (0.1, 0.0),
            (0.1, 0.02),
            (1e-3, 0.7),
            (3.0, 10.0),
            (0.3, 1e-9),
        ] {
            let instants = Periodic { period, offset };
            let mut t = -1.0;
            for k in 0..2000 {
                t = instants.next(t);
                assert_eq!(t, offset + f64::from(k) * period);
                assert!(instants.holds(t) && !instants.holds(t + 0.4 * period));
            }
        }
    }

    /// 3 · 0.1 is not 1 · 0.3 in binary numbers: behind either, the next instant of both is the one after it.
    #[test]
    fn instants_that_differ_by_rounding_are_one() {
        let [short, long] = [0.1, 0.3].map(|period| Periodic {
            period,
            offset: 0.0,
        });
        for k in 1..1000 {
            let (a, b) = (0.1 * f64::from(3 * k), 0.3 * f64::from(k));
            assert!(are_one(a, b) && short.holds(b) && long.holds(a));
            assert_eq!(short.next(b), 0.1 * f64::from(3 * k + 1));
            assert_eq!(long.next(a), 0.3 * f64::from(k + 1));
        }
    }
}
