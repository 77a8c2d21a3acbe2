//! Unmodelled errors: random vectors that are added to the state at equal intervals of time.

use crate::optimization::mpcc::deviate;

/// Random vectors d_k, added to the state at k times a period, k = 1, 2, ..
#[derive(Clone, Debug, PartialEq)]
pub struct Kicks {
    /// The period.
    pub every: f64,
    /// How large they are.
    pub size: KickSize,
    /// Vector number k depends on this, on k and on streams only.
    pub seed: u64,
    /// The stream of each state of the run: entry i of a vector depends on its own alone.
    pub streams: Vec<u64>,
    /// The streams of entries of the vectors that are no states of the run, but count in their norms.
    pub others: Vec<u64>,
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
    pub(crate) fn next(&self, t: f64) -> f64 {
        let number = (t / self.every).floor() + 1.0;
        // Rounding of the quotient.
        match number * self.every {
            next if next <= t => (number + 1.0) * self.every,
            next => next,
        }
    }

    /// Adds vector number `k`.
    pub(crate) fn apply(&self, k: u64, x: &mut [f64]) {
        let entry = |&stream: &u64| deviate(self.seed, k, stream);
        let scale = match self.size {
            KickSize::Deviation(deviation) => deviation,
            KickSize::Norm(norm) => {
                let all = self.streams.iter().chain(&self.others);
                let mut squares: Vec<f64> = all.map(|stream| entry(stream).powi(2)).collect();
                // The sum is the same in any order of states.
                squares.sort_unstable_by(f64::total_cmp);
                norm / squares.iter().sum::<f64>().sqrt()
            }
        };
        for (x, stream) in x.iter_mut().zip(&self.streams) {
            *x += scale * entry(stream);
        }
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
            streams: vec![7, 11, 13],
            others: Vec::new(),
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
    fn entries_belong_to_streams() {
        let all = Kicks {
            every: 0.1,
            size: KickSize::Norm(2.0),
            seed: 5,
            streams: vec![7, 11, 13],
            others: Vec::new(),
        };
        let part = Kicks {
            streams: vec![13, 7],
            others: vec![11],
            ..all.clone()
        };
        for k in 1..=100 {
            let (mut whole, mut two) = ([0.0; 3], [0.0; 2]);
            all.apply(k, &mut whole);
            part.apply(k, &mut two);
            assert_eq!(two, [whole[2], whole[0]]);
        }
    }

    #[test]
    fn instants_are_multiples_of_the_period() {
        let kicks = Kicks {
            every: 0.16,
            size: KickSize::Deviation(1.0),
            seed: 1,
            streams: Vec::new(),
            others: Vec::new(),
        };
        let mut t = 0.0;
        for k in 1..=1000 {
            t = kicks.next(t);
            assert_eq!(t, 0.16 * f64::from(k));
        }
    }
}
