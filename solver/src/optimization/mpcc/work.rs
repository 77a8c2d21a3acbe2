//! What is asked for, and what has been done so far.

use std::time::Duration;

use super::certificate::{Certificate, Tolerances, certify};
use super::lift::Lifted;
use super::observer::{Observer, Program, Shown};
use super::options::Options;
use super::solution::Stats;
use crate::optimization::ipm;
use crate::optimization::mpcc::branch::polish::{Guess, Polished};
use crate::optimization::mpcc::certificate::class::Class;
use crate::optimization::problem::Nlp;
use crate::runtime::clock::Instant;

/// How often a branch is left for a better one that the certificate finds.
pub(super) const MAX_SWITCHES: usize = 20;

/// A run under way.
pub struct Work<'o> {
    /// What is asked for.
    pub options: &'o Options,
    /// Since when.
    pub clock: Instant,
    /// The time that it had then, where that is limited.
    time: Option<Duration>,
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
            time: options.limit.left(),
            stats: Stats::default(),
            observer,
        }
    }

    /// Tolerances of a certificate, whose searches may take a share of a limited time.
    pub fn tolerances(&self) -> Tolerances {
        let limit = &self.options.limit;
        Tolerances {
            limit: match self.time {
                Some(time) => limit.sooner(time.mul_f64(CERTIFICATE)),
                None => limit.clone(),
            },
            analyses: self.options.analyses.clone(),
            ..self.options.certificate.clone()
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

    /// Whether the run has to end.
    pub fn is_over(&self) -> bool {
        self.options.limit.is_over()
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
        let allowed = self.options.iterations;
        let settings = ipm::Options {
            limit: self.options.limit.clone(),
            analyses: self.options.analyses.clone(),
            max_iterations: (allowed.run)
                .min(allowed.all.saturating_sub(self.stats.iterations))
                .min(settings.max_iterations),
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
