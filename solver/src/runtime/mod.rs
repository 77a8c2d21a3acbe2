//! What a run has besides numbers: a clock, limits, threads, and random numbers that are the same in every run.

pub mod clock;
pub mod limit;
pub(crate) mod pace;
pub mod random;
pub mod threads;
