//! Other sequences of events, one change away.
//!
//! Where a relay, a contact or a jump comes next, what follows is another trajectory, and to first order nothing tells what
//! it costs: a threshold that a solution touches is none that it passes, and a program sees an event move to the end of its
//! control interval and not beyond it, where the control may have to jump. So every control is changed alone, in one
//! interval, by more and more, and where events come in other intervals than those of the solution, the program of that
//! sequence may be better.

use super::descent::{Candidate, Found, Search};
use super::reduced::{Kind, Quantity};

/// Changes of controls, as shares of their sizes.
const CHANGES: [f64; 6] = [0.01, -0.01, 0.25, -0.25, 1.0, -1.0];
/// How many sequences are looked into.
const MOST_SEQUENCES: usize = 3;

/// A point, and where its events are.
struct Sequence {
    events: Vec<usize>,
    point: Candidate,
}

impl Search<'_, '_, '_> {
    /// The best point of each other sequence of events, with what its violations add, the best first.
    pub fn through(&mut self) -> Found {
        let Some(base) = self.base else {
            return Found::Unknown;
        };
        let is_control = |quantity: &&Quantity| matches!(quantity.kind, Kind::Control(_));
        let controls = self.reduced.quantities.iter().filter(is_control);
        let controls: Vec<Quantity> = controls.copied().collect();
        let runs = CHANGES.len() * controls.len();
        if self.reduced.is_too_much(runs, base.steps) {
            return Found::Nothing;
        }
        let mut found: Vec<Sequence> = Vec::new();
        for control in &controls {
            for change in CHANGES {
                let other = changed(self, control, change);
                if let Some(other) = other.filter(|other| other.events != base.events) {
                    keep_best(&mut found, other);
                }
            }
        }
        found.sort_by(|a, b| a.point.merit.total_cmp(&b.point.merit));
        found.truncate(MOST_SEQUENCES);
        match found.is_empty() {
            true => Found::Nothing,
            false => Found::Descent {
                points: found.into_iter().map(|other| other.point).collect(),
                rate: 0.0,
                is_first_order: false,
            },
        }
    }
}

/// The solution with a control changed by a share of its size, if that is another point that has a run.
fn changed(search: &mut Search<'_, '_, '_>, control: &Quantity, change: f64) -> Option<Sequence> {
    let mut w = search.w.to_vec();
    let value = w[control.index] + change * control.size;
    w[control.index] = value.max(control.lower).min(control.upper);
    if w == search.w {
        return None;
    }
    let values = search.reduced.at(&w)?;
    Some(Sequence {
        point: search.candidate(w, &values),
        events: values.events,
    })
}

/// Adds a sequence, or its point to one that is known, if it is better.
fn keep_best(found: &mut Vec<Sequence>, other: Sequence) {
    match found.iter_mut().find(|known| known.events == other.events) {
        Some(known) if known.point.merit <= other.point.merit => {}
        Some(known) => *known = other,
        None => found.push(other),
    }
}
