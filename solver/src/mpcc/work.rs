//! What is asked for, and what has been done so far.

use std::time::{Duration, Instant};

use super::options::Options;
use super::solution::Stats;
use crate::ipm;
use crate::problem::Nlp;

/// A run under way.
pub struct Work<'o> {
    /// What is asked for.
    pub options: &'o Options,
    /// Since when.
    pub clock: Instant,
    /// What it took.
    pub stats: Stats,
}

impl<'o> Work<'o> {
    /// Starts the clock.
    pub fn new(options: &'o Options) -> Self {
        Work {
            options,
            clock: Instant::now(),
            stats: Stats::default(),
        }
    }

    /// The time that is left, if it is limited.
    pub fn remaining(&self) -> Option<Duration> {
        let limit = self.options.time_limit?;
        Some(limit.saturating_sub(self.clock.elapsed()))
    }

    /// Whether the time is up.
    pub fn is_late(&self) -> bool {
        self.remaining().is_some_and(|left| left.is_zero())
    }

    /// An interior-point run, counted.
    pub fn minimize(
        &mut self,
        nlp: &mut dyn Nlp,
        settings: ipm::Options,
        start: Option<&ipm::Point>,
        observer: &mut dyn ipm::Observer,
    ) -> ipm::Solution {
        let settings = ipm::Options {
            time_limit: self.remaining(),
            max_iterations: self.options.max_iterations.min(settings.max_iterations),
            ..settings
        };
        let found = ipm::solve(nlp, &settings, start, observer);
        self.stats.iterations += found.iterations;
        found
    }
}
