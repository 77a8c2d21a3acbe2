//! Other sequences of events, one change away.
//!
//! Where a relay, a contact or a jump comes next, what follows is another trajectory, and to first order nothing tells what
//! it costs: a threshold that a solution touches is none that it passes. And a program sees a switch move to the end of a
//! control interval and not beyond it. So every control is changed alone, in one interval, by more and more, and where
//! events come in other intervals than those of the solution, the program of that sequence may be better.

use super::descent::{Candidate, Found, Search};
use super::reduced::Kind;

/// Changes of controls, as shares of their sizes.
const CHANGES: [f64; 3] = [0.01, 0.25, 1.0];
/// How many sequences are looked into.
const MOST_SEQUENCES: usize = 3;

impl Search<'_, '_, '_> {
    /// A point of each other sequence of events, the one that is best with its violations first.
    pub fn through(&mut self) -> Found {
        let Some(base) = self.base else {
            return Found::Unknown;
        };
        let quantities = self.reduced.quantities.clone();
        let runs = 2 * CHANGES.len() * quantities.len();
        if !self.reduced.has_events() || self.reduced.is_too_much(runs, base.steps) {
            return Found::Nothing;
        }
        let mut points: Vec<(Vec<usize>, Candidate)> = Vec::new();
        for quantity in quantities {
            if !matches!(quantity.kind, Kind::Control(_)) {
                continue;
            }
            for change in CHANGES.into_iter().flat_map(|change| [change, -change]) {
                let mut w = self.w.to_vec();
                let value = w[quantity.index] + change * quantity.size;
                w[quantity.index] = value.max(quantity.lower).min(quantity.upper);
                let values = (w != self.w).then(|| self.reduced.at(&w)).flatten();
                if let Some(values) = values.filter(|values| values.events != base.events) {
                    let point = self.candidate(w, &values);
                    points.push((values.events, point));
                }
            }
        }
        points.sort_by(|(_, a), (_, b)| a.merit.total_cmp(&b.merit));
        let mut found: Vec<(Vec<usize>, Candidate)> = Vec::new();
        for (events, point) in points {
            if found.len() < MOST_SEQUENCES && found.iter().all(|(known, _)| *known != events) {
                found.push((events, point));
            }
        }
        match found.is_empty() {
            true => Found::Nothing,
            false => Found::Descent {
                points: found.into_iter().map(|(_, point)| point).collect(),
                rate: 0.0,
                is_first_order: false,
            },
        }
    }
}
