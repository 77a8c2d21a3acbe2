//! A run as it was: steps with their polynomials, and events.

use std::ops::ControlFlow;

use crate::event::{Event, Observer, Segment};
use crate::expansion::series;
use crate::hybrid::Side;

/// All steps and events of a run, in order.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    pub(super) parts: Vec<Part>,
}

/// A step or an event.
#[derive(Clone, Debug)]
pub(super) enum Part {
    Step(Step),
    Event(Jump),
}

/// A step in a mode.
#[derive(Clone, Debug)]
pub(super) struct Step {
    pub start: f64,
    pub length: f64,
    pub until: f64,
    pub sides: Box<[Side]>,
    pub end: Vec<f64>,
    n_coefficients: usize,
    /// Series of states and of all α, one after another.
    coefficients: Vec<f64>,
}

/// An event.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    pub time: f64,
    pub before: Vec<f64>,
    pub after: Vec<f64>,
    pub laws: Vec<usize>,
    pub from: Box<[Side]>,
    pub to: Box<[Side]>,
    pub met: Vec<usize>,
    pub is_scheduled: bool,
    pub accumulates: bool,
    pub folds: bool,
}

impl Step {
    fn row(&self, at: usize) -> &[f64] {
        &self.coefficients[at * self.n_coefficients..(at + 1) * self.n_coefficients]
    }

    /// The state and its rate `tau` after the start.
    pub fn state(&self, tau: f64, x: &mut [f64], slope: &mut [f64]) {
        for (i, (x, slope)) in x.iter_mut().zip(slope).enumerate() {
            *x = series::value(self.row(i), tau);
            *slope = series::slope(self.row(i), tau);
        }
    }

    /// α of all switches `tau` after the start; 1/2 where it is not known, as of what nothing but outputs looks at.
    pub fn alpha(&self, tau: f64, alpha: &mut [f64]) {
        self.known_alpha(tau, alpha);
        let unknown = alpha.iter_mut().filter(|alpha| alpha.is_nan());
        unknown.for_each(|alpha| *alpha = 0.5);
    }

    /// The same, not a number where it is not known.
    fn known_alpha(&self, tau: f64, alpha: &mut [f64]) {
        for (i, alpha) in alpha.iter_mut().enumerate() {
            *alpha = series::value(self.row(self.end.len() + i), tau);
        }
    }
}

impl Recording {
    /// The state and all α at an instant; where something happens there, `behind` or before it. What slides without a step
    /// there has an α that is not a number.
    pub fn at(&self, t: f64, behind: bool, x: &mut [f64], alpha: &mut [f64]) {
        let jump = if behind {
            self.parts.last()
        } else {
            self.parts.first()
        };
        if let Some(Part::Event(jump)) = jump.filter(|part| part.time() == t) {
            let (state, sides) = match behind {
                true => (&jump.after, &jump.to),
                false => (&jump.before, &jump.from),
            };
            x.copy_from_slice(state);
            for (alpha, side) in alpha.iter_mut().zip(sides) {
                *alpha = match side {
                    Side::Minus => 0.0,
                    Side::Slide => f64::NAN,
                    Side::Plus => 1.0,
                };
            }
            return;
        }
        let is_past = |step: &Step| step.until < t || behind && step.until == t;
        let at = self.parts.partition_point(|part| match part {
            Part::Step(step) => is_past(step),
            Part::Event(jump) => jump.time < t || behind && jump.time == t,
        });
        let later = self.parts[at..].iter().find_map(Part::step);
        let earlier = || self.parts[..at].iter().rev().find_map(Part::step);
        if let Some(step) = later.or_else(earlier) {
            let tau = (t - step.start).clamp(0.0, step.length);
            step.state(tau, x, &mut vec![0.0; x.len()]);
            step.known_alpha(tau, alpha);
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

    /// When it ends.
    fn time(&self) -> f64 {
        match self {
            Part::Step(step) => step.until,
            Part::Event(jump) => jump.time,
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
        }));
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.parts.push(Part::Event(Jump {
            time: event.time,
            before: event.before.to_vec(),
            after: event.x.to_vec(),
            laws: event.jumps.to_vec(),
            from: event.from.into(),
            to: event.to.into(),
            met: event.cause.met.to_vec(),
            is_scheduled: event.cause.is_scheduled,
            accumulates: event.accumulates,
            folds: event.decisions.iter().any(|decision| decision.folds),
        }));
    }
}
