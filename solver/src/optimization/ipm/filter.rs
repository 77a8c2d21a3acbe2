//! Pairs of violation θ and barrier function φ that no later point may be as bad as in both.
//!
//! Wächter & Biegler 2006, sections 2.3 and 3.4, with the constants of their implementation.

pub(crate) const GAMMA_THETA: f64 = 1e-5;
pub(crate) const GAMMA_PHI: f64 = 1e-8;
const CAPACITY: usize = 1024;

/// The violation ‖c‖₁ and the barrier function at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merit {
    pub theta: f64,
    pub phi: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct Filter {
    entries: Vec<Merit>,
    /// The violation no point may have.
    pub theta_max: f64,
    /// Below this violation the barrier function has to decrease.
    pub theta_min: f64,
}

impl Filter {
    pub fn new() -> Self {
        Filter {
            entries: Vec::with_capacity(CAPACITY),
            theta_max: f64::INFINITY,
            theta_min: 0.0,
        }
    }

    /// Empties the filter and takes its limits from the violation at the start.
    pub fn start(&mut self, theta: f64) {
        self.entries.clear();
        self.theta_max = 1e4 * theta.max(1.0);
        self.theta_min = 1e-4 * theta.max(1.0);
    }

    pub fn clear(&mut self) {
        self.entries.clear();
    }

    pub fn accepts(&self, trial: Merit) -> bool {
        trial.theta <= self.theta_max
            && self.entries.iter().all(|entry| {
                at_most(trial.theta, entry.theta, entry.theta)
                    || at_most(trial.phi, entry.phi, entry.phi)
            })
    }

    /// Forbids what is no better than `merit` by a margin.
    pub fn add(&mut self, merit: Merit) {
        self.add_entry(Merit {
            theta: (1.0 - GAMMA_THETA) * merit.theta,
            phi: merit.phi - GAMMA_PHI * merit.theta,
        });
    }

    /// Forbids what is no better than `entry` as it is.
    pub fn add_entry(&mut self, entry: Merit) {
        self.entries
            .retain(|old| old.theta < entry.theta || old.phi < entry.phi);
        self.entries.push(entry);
    }
}

/// a <= b up to rounding in numbers of the size of `base`.
pub(crate) fn at_most(a: f64, b: f64, base: f64) -> bool {
    a - b <= 10.0 * f64::EPSILON * base.abs()
}

#[cfg(test)]
mod tests {
    use super::{Filter, Merit};

    #[test]
    fn a_point_must_be_better_than_each_in_one_of_both() {
        let mut filter = Filter::new();
        filter.start(1.0);
        let merit = |theta, phi| Merit { theta, phi };
        filter.add(merit(1.0, 2.0));
        filter.add(merit(0.1, 3.0));
        assert!(filter.accepts(merit(0.5, 1.0)));
        assert!(filter.accepts(merit(0.5, 2.5)));
        assert!(filter.accepts(merit(0.01, 100.0)));
        assert!(!filter.accepts(merit(1.0, 2.0)));
        assert!(!filter.accepts(merit(0.1, 3.0)));
        assert!(!filter.accepts(merit(2.0, 2.5)));
        assert!(!filter.accepts(merit(2e4, -100.0)));
        // What is worse in both goes.
        filter.add(merit(0.0, 0.0));
        assert_eq!(filter.entries.len(), 1);
    }
}
