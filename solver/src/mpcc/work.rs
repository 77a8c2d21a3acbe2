//! What is asked for, and what has been done so far.

use std::time::{Duration, Instant};

use super::certificate::{Certificate, Tolerances, certify};
use super::class::Class;
use super::lift::Lifted;
use super::observer::{Observer, Program, Shown};
use super::options::Options;
use super::polish::{Guess, Polished};
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
    /// Who is told.
    observer: &'o mut dyn Observer,
}

/// The share of the time that the search for a certificate may take.
const CERTIFICATE: f64 = 0.1;

impl<'o> Work<'o> {
    /// Starts the clock.
    pub fn new(options: &'o Options, observer: &'o mut dyn Observer) -> Self {
        Work {
            options,
            clock: Instant::now(),
            stats: Stats::default(),
            observer,
        }
    }

    /// The time that is left, if it is limited.
    pub fn remaining(&self) -> Option<Duration> {
        let limit = self.options.time_limit?;
        Some(limit.saturating_sub(self.clock.elapsed()))
    }

    /// Tolerances of a certificate, whose searches may take a share of a limited time.
    pub fn tolerances(&self) -> Tolerances {
        let budget = |limit: Duration| limit.mul_f64(CERTIFICATE);
        let left = self.remaining().zip(self.options.time_limit.map(budget));
        Tolerances {
            deadline: left.map(|(left, budget)| Instant::now() + left.min(budget)),
            ..self.options.certificate
        }
    }

    /// The certificate of a feasible point, whose time is counted.
    pub fn certify(&mut self, lifted: &mut Lifted<'_>, point: &Guess) -> Certificate {
        let started = Instant::now();
        let certificate = certify(lifted, &point.w, &point.y, &self.tolerances());
        self.stats.certificate_seconds += started.elapsed().as_secs_f64();
        certificate
    }

    /// Tells of a point that is stationary.
    pub fn tell(&mut self, point: &Polished, certificate: &Certificate) {
        if certificate.class != Class::None {
            self.observer.stationary(point.objective, certificate.class);
        }
    }

    /// Whether the time is up.
    pub fn is_late(&self) -> bool {
        self.remaining().is_some_and(|left| left.is_zero())
    }

    /// An interior-point run, counted and shown.
    pub fn minimize(
        &mut self,
        program: Program,
        nlp: &mut dyn Nlp,
        settings: ipm::Options,
        start: Option<&ipm::Point>,
        inner: &mut dyn ipm::Observer,
    ) -> ipm::Solution {
        let settings = ipm::Options {
            time_limit: self.remaining(),
            max_iterations: self.options.max_iterations.min(settings.max_iterations),
            ..settings
        };
        self.observer.program(&program);
        let mut shown = Shown {
            program,
            observer: self.observer,
            inner,
        };
        let found = ipm::solve(nlp, &settings, start, &mut shown);
        self.stats.iterations += found.iterations;
        self.stats.factor_entries = self.stats.factor_entries.max(found.factor_entries);
        found
    }
}
