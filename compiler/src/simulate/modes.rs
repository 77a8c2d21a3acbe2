//! Names of modes and kinds of events.

use nsd_solver::simulate::Side;

use crate::expr::Var;
use crate::report::{self, EventKind};
use crate::system::System;

/// Turns sides into the words of the language.
pub(super) struct ModeNames<'s, 'e> {
    system: &'s System<'e>,
    /// Switches that no partition shows.
    loose: Vec<usize>,
}

impl<'s, 'e> ModeNames<'s, 'e> {
    pub(super) fn new(system: &'s System<'e>) -> Self {
        let shown = |i: &usize| {
            system
                .partitions
                .iter()
                .any(|partition| partition.switches.contains(i))
        };
        ModeNames {
            system,
            loose: (0..system.switches.len()).filter(|i| !shown(i)).collect(),
        }
    }

    /// Regions the state is in: those whose weight is 1.
    pub(super) fn regions(&self, sides: &[Side]) -> Vec<String> {
        let value = |var: Var| {
            let at = self
                .system
                .switches
                .iter()
                .position(|switch| switch.alpha.as_variable() == Some(var));
            at.map_or(0.5, |i| 0.5 + 0.5 * sides[i].sign())
        };
        let regions = self
            .system
            .partitions
            .iter()
            .flat_map(|partition| &partition.regions);
        regions
            .filter(|region| region.weight.eval(&value) == 1.0)
            .map(|region| region.name.clone())
            .collect()
    }

    /// `inside, sliding(x[1])`: regions, then what each remaining switch does.
    pub(super) fn mode(&self, sides: &[Side]) -> String {
        let mut words = self.regions(sides);
        for (i, side) in sides.iter().enumerate() {
            if *side == Side::Slide || self.loose.contains(&i) {
                words.push(self.word(i, *side));
            }
        }
        if words.is_empty() {
            "smooth".to_owned()
        } else {
            words.join(", ")
        }
    }

    /// One way to go on from a point: `sliding(x), above(y)`.
    pub(super) fn branch(&self, candidate: &[(usize, Side)]) -> String {
        let words: Vec<String> = candidate
            .iter()
            .map(|&(i, side)| self.word(i, side))
            .collect();
        words.join(", ")
    }

    fn word(&self, switch: usize, side: Side) -> String {
        let word = self.side(switch, side).as_str();
        format!("{word}({})", self.system.switches[switch].name)
    }

    fn is_relay(&self, switch: usize) -> bool {
        self.system.switches[switch].relay.is_some()
    }

    /// The report's side of a switch.
    fn side(&self, switch: usize, side: Side) -> report::Side {
        match (side, self.is_relay(switch)) {
            (Side::Minus, false) => report::Side::Below,
            (Side::Slide, _) => report::Side::Sliding,
            (Side::Plus, false) => report::Side::Above,
            (Side::Minus, true) => report::Side::Off,
            (Side::Plus, true) => report::Side::On,
        }
    }

    /// The report's sides.
    pub(super) fn sides(&self, sides: &[Side]) -> Vec<report::Side> {
        let sides = sides.iter().enumerate();
        sides.map(|(i, &side)| self.side(i, side)).collect()
    }

    /// What the change of one switch is called; none where it did not change.
    pub(super) fn kind(&self, switch: usize, from: Side, to: Side) -> Option<EventKind> {
        match self.is_relay(switch) {
            true => (from != to).then_some(EventKind::Relay),
            false => kind(from, to),
        }
    }
}

fn kind(from: Side, to: Side) -> Option<EventKind> {
    match (from, to) {
        (from, to) if from == to => None,
        (_, Side::Slide) => Some(EventKind::EnterSliding),
        (Side::Slide, _) => Some(EventKind::LeaveSliding),
        _ => Some(EventKind::Crossing),
    }
}
