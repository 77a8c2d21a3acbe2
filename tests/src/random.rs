//! Random numbers with a fixed seed.

use nsd_solver::runtime::random;

/// SplitMix64 (Steele, Lea, Flood 2014).
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// 64 bits, each as likely 0 as 1.
    pub fn bits(&mut self) -> u64 {
        random::next(&mut self.0)
    }

    /// In [0, 1), with all 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [-1, 1), a multiple of 1/1024: sums and products of few such numbers are exact.
    pub fn dyadic(&mut self) -> f64 {
        (self.bits() % 2048) as f64 / 1024.0 - 1.0
    }

    /// In [lo, hi).
    pub fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * 0.5 * (self.dyadic() + 1.0)
    }

    /// In [lo, hi), with four decimals.
    pub fn rounded(&mut self, lo: f64, hi: f64) -> f64 {
        (self.within(lo, hi) * 1e4).round() / 1e4
    }

    /// One of the first `n` numbers.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    /// One of some.
    pub fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}
