//! A run by finite elements as it was: its elements as they were solved, with what has ended them, and its events.

use std::ops::ControlFlow;
use std::sync::Arc;

use crate::event::{Event, Segment};
use crate::fesd::element::solved::Solved;
use crate::fesd::emit::{Elements, Observer};
use crate::fesd::system::Reduced;
use crate::hybrid::Side;

/// All elements and events of a run, in order.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    pub(super) parts: Vec<Part>,
    /// The elements that will be told as steps, too.
    known: usize,
}

/// What a run has done next.
#[derive(Clone, Debug)]
pub(super) enum Part {
    Piece(Piece),
    /// Switches have changed.
    Event {
        time: f64,
    },
    /// A step whose independent variable is not time, ahead of a fold, with what slides in it.
    Fold {
        time: f64,
        sliding: Vec<usize>,
    },
}

/// Elements of equal length in one active set, up to a switch or an instant that is known.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    pub reduced: Arc<Reduced>,
    /// What changes at breakpoints.
    pub numbers: Vec<f64>,
    pub elements: Vec<Solved>,
    /// The member that vanishes at its end; none where that is an instant.
    pub member: Option<usize>,
    pub until: f64,
}

impl Recording {
    /// The parts that are elements.
    pub(super) fn pieces(&self) -> impl DoubleEndedIterator<Item = (usize, &Piece)> {
        let parts = self.parts.iter().enumerate();
        parts.filter_map(|(at, part)| match part {
            Part::Piece(piece) => Some((at, piece)),
            _ => None,
        })
    }
}

impl crate::event::Observer for Recording {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        match self.known.checked_sub(1) {
            Some(left) => self.known = left,
            None => {
                let slides = |&i: &usize| segment.sides[i] == Side::Slide;
                self.parts.push(Part::Fold {
                    time: segment.start,
                    sliding: (0..segment.sides.len()).filter(slides).collect(),
                });
            }
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.parts.push(Part::Event { time: event.time });
    }
}

impl Observer for Recording {
    fn elements(&mut self, elements: &Elements) {
        let lasting = elements.solved.iter().filter(|solved| solved.h > 0.0);
        self.known += lasting.count();
        self.parts.push(Part::Piece(Piece {
            reduced: elements.reduced.clone(),
            numbers: elements.numbers.to_vec(),
            elements: elements.solved.to_vec(),
            member: elements.member,
            until: elements.until,
        }));
    }
}
