//! Tells a caller, from time to time, how far a run is.

use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Time reached.
    pub time: f64,
    /// Where the run ends.
    pub horizon: f64,
    /// Steps so far.
    pub steps: usize,
    /// Changes of mode so far.
    pub events: usize,
    /// True in the run that estimates the error of the one before.
    pub estimates: bool,
}

/// Steps between two calls, after as many at each of which there is one: a call may ask for the time, which must not count
/// beside a step.
const STEPS: usize = 16;

/// Passes on what a run does, and calls `watch` on the way.
pub(super) struct Watched<'w> {
    observer: &'w mut dyn Observer,
    watch: &'w mut dyn FnMut(Progress),
    progress: Progress,
}

impl<'w> Watched<'w> {
    pub fn new(
        observer: &'w mut dyn Observer,
        horizon: f64,
        estimates: bool,
        watch: &'w mut dyn FnMut(Progress),
    ) -> Self {
        Watched {
            observer,
            watch,
            progress: Progress {
                time: 0.0,
                horizon,
                steps: 0,
                events: 0,
                estimates,
            },
        }
    }
}

impl Observer for Watched<'_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.progress.steps += 1;
        let is_told = self.progress.steps < STEPS || self.progress.steps.is_multiple_of(STEPS);
        if is_told {
            self.progress.time = segment.until;
            (self.watch)(self.progress);
        }
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.progress.events += 1;
        self.observer.event(event);
    }

    fn displace(&mut self, x: &mut [f64], roundings: &[f64]) {
        self.observer.displace(x, roundings);
    }

    fn displaces(&self) -> bool {
        self.observer.displaces()
    }
}
