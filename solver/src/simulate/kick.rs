//! Unmodelled errors: random vectors that are added to the state at equal intervals of time.

use super::state::State;
use super::{Simulator, Status, SwitchedSystem};
use crate::mpcc::perturbed;

/// Random vectors d_k, added to the state at k times a period, k = 1, 2, ..
#[derive(Clone, Debug, PartialEq)]
pub struct Kicks {
    /// The period.
    pub every: f64,
    /// How large they are.
    pub size: KickSize,
    /// Vector number k depends on this and on k only.
    pub seed: u64,
}

/// What is known of the size of random vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KickSize {
    /// Their norm: uniformly distributed on a sphere.
    Norm(f64),
    /// The standard deviation of every entry, independent normal deviates.
    Deviation(f64),
}

impl Kicks {
    /// The next instant after `t`.
    fn next(&self, t: f64) -> f64 {
        let number = (t / self.every).floor() + 1.0;
        // Rounding of the quotient.
        match number * self.every {
            next if next <= t => (number + 1.0) * self.every,
            next => next,
        }
    }

    /// Adds vector number `k`.
    pub(super) fn apply(&self, k: u64, x: &mut [f64]) {
        let deviates = perturbed(&vec![0.0; x.len()], 1.0, self.seed, k);
        let scale = match self.size {
            KickSize::Deviation(deviation) => deviation,
            KickSize::Norm(norm) => {
                let length = deviates.iter().map(|d| d * d).sum::<f64>().sqrt();
                norm / length
            }
        };
        for (x, d) in x.iter_mut().zip(deviates) {
            *x += scale * d;
        }
    }
}

impl<S: SwitchedSystem> Simulator<'_, S> {
    /// The next instant after the present one at which the state is kicked.
    pub(super) fn next_kick(&self, t: f64) -> f64 {
        let kicks = self.settings.kicks.as_ref();
        kicks.map_or(f64::INFINITY, |kicks| kicks.next(t))
    }

    /// Kicks the state at one of these instants, and finds the mode where it is then. Sliding does not survive where
    /// ψ leaves zero.
    pub(super) fn kick(&mut self, state: &mut State, instant: f64, t1: f64) -> Result<(), Status> {
        if let Some(kicks) = &self.settings.kicks {
            let number = (instant / kicks.every).round();
            kicks.apply(number as u64, &mut state.x);
        }
        self.stiffness.after_event();
        let on = self.place(state, t1 - state.t, &[])?;
        self.enter(state, on, t1)
    }
}

#[cfg(test)]
mod tests {
    use super::{KickSize, Kicks};

    #[test]
    fn vectors_are_uniform_on_a_sphere() {
        let kicks = Kicks {
            every: 0.1,
            size: KickSize::Norm(2.0),
            seed: 5,
        };
        let (mut mean, mut squares) = ([0.0; 3], [0.0; 3]);
        let n = 20_000;
        for k in 1..=n {
            let mut x = [0.0; 3];
            kicks.apply(k, &mut x);
            let norm = x.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((norm - 2.0).abs() < 1e-14, "{norm}");
            for (at, x) in x.iter().enumerate() {
                mean[at] += x / n as f64;
                squares[at] += x * x / n as f64;
            }
        }
        // Standard errors: 2/√(3n) = 0.008 and 4 √(4/45)/√n = 0.0084.
        assert!(mean.iter().all(|m| m.abs() < 0.035), "{mean:?}");
        assert!(
            squares.iter().all(|s| (s - 4.0 / 3.0).abs() < 0.04),
            "{squares:?}"
        );
    }

    #[test]
    fn instants_are_multiples_of_the_period() {
        let kicks = Kicks {
            every: 0.16,
            size: KickSize::Deviation(1.0),
            seed: 1,
        };
        let mut t = 0.0;
        for k in 1..=1000 {
            t = kicks.next(t);
            assert_eq!(t, 0.16 * f64::from(k));
        }
    }
}
