//! What contacts did during steps of time, in the words of a report.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::moreau::{Change, Observer as Contacts};

use super::strikes::Strikes;
use crate::report::{self, EventKind, ModeInterval, Side, Trajectory};
use crate::system::System;

/// Passes on what a run does, and keeps what contacts do.
pub(crate) struct Told<'w> {
    observer: &'w mut dyn Observer,
    /// Changes of contacts, in order of time.
    pub changes: Vec<(f64, usize, Change)>,
    pub strikes: Strikes,
}

impl<'w> Told<'w> {
    /// Before a run.
    pub fn to(observer: &'w mut dyn Observer) -> Self {
        Told {
            observer,
            changes: Vec::new(),
            strikes: Strikes::default(),
        }
    }
}

impl Observer for Told<'_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.strikes.step(segment.start, segment.until);
        self.observer.segment(segment)
    }

    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }
}

impl Contacts for Told<'_> {
    fn change(&mut self, time: f64, contact: usize, change: Change) {
        self.changes.push((time, contact, change));
        if change == Change::Strike {
            self.strikes.add(time, contact);
        }
    }
}

/// Adds events and modes; the run has ended at `end`.
pub(crate) fn write(
    system: &System,
    changes: &[(f64, usize, Change)],
    end: f64,
    trajectory: &mut Trajectory,
) {
    let whole = trajectory.history.modes.pop();
    trajectory.history.modes.clear();
    let sides = whole.map(|mode| mode.sides).unwrap_or_default();
    let name = |contact: usize| system.jumps.impulsive[contact].name.as_str();
    let mut closed: BTreeMap<usize, Side> = BTreeMap::new();
    let mut from = 0.0;
    let interval = |from: f64, to: f64, closed: &BTreeMap<usize, Side>| {
        let words = closed
            .iter()
            .map(|(&contact, side)| format!("{}({})", side.as_str(), name(contact)));
        let words: Vec<String> = words.collect();
        ModeInterval {
            from,
            to,
            mode: match words.is_empty() {
                true => "open".to_owned(),
                false => words.join(", "),
            },
            regions: Vec::new(),
            between: Vec::new(),
            sides: sides.clone(),
            contacts: closed.iter().map(|(&k, &side)| (k, side)).collect(),
        }
    };
    // What is closed at the start, and not struck there, begins so.
    let strikes = |contact: usize| {
        let at_start = changes.iter().take_while(|change| change.0 == 0.0);
        at_start
            .into_iter()
            .any(|&(_, other, change)| other == contact && change == Change::Strike)
    };
    for &(time, contact, change) in changes {
        let before = closed.get(&contact).copied().unwrap_or(Side::Open);
        let (kind, after) = match change {
            Change::Strike => (EventKind::Jump, before),
            Change::Close => (EventKind::ContactClose, Side::Closed),
            Change::Open => (EventKind::ContactOpen, Side::Open),
            Change::Stick => (EventKind::Stick, Side::Stick),
            Change::Slip => (EventKind::Slip, Side::Slip),
        };
        if after != before && time > from {
            trajectory.history.modes.push(interval(from, time, &closed));
            from = time;
        }
        match after {
            Side::Open => closed.remove(&contact),
            side => closed.insert(contact, side),
        };
        if time == 0.0 && !strikes(contact) {
            continue;
        }
        let word = |side: Side| format!("{}({})", side.as_str(), name(contact));
        trajectory.history.events.push(report::Event {
            time,
            kind,
            surface: name(contact).to_owned(),
            from: word(before),
            to: word(after),
            span: Some(system.jumps.impulsive[contact].span),
            sliding: Vec::new(),
        });
    }
    if end > from || trajectory.history.modes.is_empty() {
        trajectory.history.modes.push(interval(from, end, &closed));
    }
}
