//! Tells a caller, from time to time, how far a run is.

use std::ops::ControlFlow;

use nsd_solver::simulate::{Event, Observer, Segment};

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

/// Steps between two calls: a call may ask for the time, which must not count beside a step.
const STEPS: usize = 16;

/// Passes on what a run does, and calls `watch` on the way.
pub(super) struct Watched<'w, O> {
    observer: &'w mut O,
    watch: &'w mut dyn FnMut(Progress),
    progress: Progress,
}

impl<'w, O: Observer> Watched<'w, O> {
    pub fn new(
        observer: &'w mut O,
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

impl<O: Observer> Observer for Watched<'_, O> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.progress.steps += 1;
        if self.progress.steps.is_multiple_of(STEPS) {
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
