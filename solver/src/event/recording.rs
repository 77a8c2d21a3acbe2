//! A run as it was: steps with their polynomials, and events.

use std::ops::ControlFlow;

use crate::event::{Cause, Event, Observer, Segment};
use crate::expansion::Polynomials;
use crate::expansion::series;
use crate::hybrid::Side;
use crate::selector::Decision;

/// All steps and events of a run, in order.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    pub(crate) parts: Vec<Part>,
}

/// A step or an event.
#[derive(Clone, Debug)]
pub(crate) enum Part {
    Step(Step),
    Event(EventRecord),
}

/// A step in a mode.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub start: f64,
    pub length: f64,
    pub until: f64,
    pub sides: Box<[Side]>,
    pub end: Vec<f64>,
    n_coefficients: usize,
    /// Series of states and of all α, one after another.
    coefficients: Vec<f64>,
    unobserved: Vec<usize>,
}

/// An event that owns what it tells.
#[derive(Clone, Debug)]
pub(crate) struct EventRecord {
    pub time: f64,
    pub before: Vec<f64>,
    pub after: Vec<f64>,
    pub laws: Vec<usize>,
    pub from: Box<[Side]>,
    pub to: Box<[Side]>,
    pub met: Vec<usize>,
    /// Of the laws, by their places, switches on whose surface they have found the state.
    pub on: Vec<(usize, usize)>,
    pub is_scheduled: bool,
    decisions: Vec<Decision>,
    accumulates: bool,
    is_in_limit: bool,
}

impl Recording {
    /// Tells another observer what happened, until it has had enough.
    pub fn replay(&self, observer: &mut dyn Observer) {
        for part in &self.parts {
            let told = match part {
                Part::Step(step) => observer.segment(&step.segment()),
                Part::Event(event) => {
                    observer.event(&event.event());
                    ControlFlow::Continue(())
                }
            };
            if told.is_break() {
                break;
            }
        }
    }
}

impl Step {
    /// The series of a state, or behind all of them of an α.
    pub fn row(&self, at: usize) -> &[f64] {
        &self.coefficients[at * self.n_coefficients..(at + 1) * self.n_coefficients]
    }

    /// The state and its rate `tau` after the start.
    pub fn state(&self, tau: f64, x: &mut [f64], slope: &mut [f64]) {
        for (i, (x, slope)) in x.iter_mut().zip(slope).enumerate() {
            [*x, *slope] = series::value_and_slope(self.row(i), tau);
        }
    }

    /// The state `tau` after the start.
    pub fn values(&self, tau: f64, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            *x = series::value(self.row(i), tau);
        }
    }

    /// α of all switches `tau` after the start; 1/2 where it is not known, as of what nothing but outputs looks at.
    pub fn alpha(&self, tau: f64, alpha: &mut [f64]) {
        self.known_alpha(tau, alpha);
        let unknown = alpha.iter_mut().filter(|alpha| alpha.is_nan());
        unknown.for_each(|alpha| *alpha = 0.5);
    }

    /// The same, not a number where it is not known.
    pub fn known_alpha(&self, tau: f64, alpha: &mut [f64]) {
        for (i, alpha) in alpha.iter_mut().enumerate() {
            *alpha = series::value(self.row(self.end.len() + i), tau);
        }
    }

    fn segment(&self) -> Segment<'_> {
        let (start, length, until) = (self.start, self.length, self.until);
        Segment::new(start, length, until, &self.sides, &self.end, self)
    }
}

impl Polynomials for Step {
    fn degree(&self) -> usize {
        self.n_coefficients - 1
    }

    fn x(&self, i: usize) -> &[f64] {
        self.row(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        self.row(self.end.len() + switch)
    }

    fn unobserved(&self) -> &[usize] {
        &self.unobserved
    }
}

impl EventRecord {
    /// Whether events accumulate here, or the run goes on from here as if it was their limit.
    pub fn is_limit(&self) -> bool {
        self.accumulates || self.is_in_limit
    }

    /// Whether a sliding mode has ended in a fold.
    pub fn folds(&self) -> bool {
        self.decisions.iter().any(|decision| decision.folds)
    }

    fn event(&self) -> Event<'_> {
        Event {
            time: self.time,
            x: &self.after,
            before: &self.before,
            jumps: &self.laws,
            decisions: &self.decisions,
            from: &self.from,
            to: &self.to,
            accumulates: self.accumulates,
            cause: Cause {
                met: &self.met,
                on: &self.on,
                is_scheduled: self.is_scheduled,
                is_in_limit: self.is_in_limit,
            },
        }
    }
}

impl Part {
    pub fn step(&self) -> Option<&Step> {
        match self {
            Part::Step(step) => Some(step),
            Part::Event(_) => None,
        }
    }

    pub fn event(&self) -> Option<&EventRecord> {
        match self {
            Part::Step(_) => None,
            Part::Event(event) => Some(event),
        }
    }
}

impl Observer for Recording {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let mut coefficients = Vec::new();
        segment.write(&mut coefficients);
        self.parts.push(Part::Step(Step {
            start: segment.start,
            length: segment.length,
            until: segment.until,
            sides: segment.sides.into(),
            end: segment.end.to_vec(),
            n_coefficients: segment.order() + 1,
            coefficients,
            unobserved: segment.unobserved().to_vec(),
        }));
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.parts.push(Part::Event(EventRecord {
            time: event.time,
            before: event.before.to_vec(),
            after: event.x.to_vec(),
            laws: event.jumps.to_vec(),
            from: event.from.into(),
            to: event.to.into(),
            met: event.cause.met.to_vec(),
            on: event.cause.on.to_vec(),
            is_scheduled: event.cause.is_scheduled,
            decisions: event.decisions.to_vec(),
            accumulates: event.accumulates,
            is_in_limit: event.cause.is_in_limit,
        }));
    }
}
