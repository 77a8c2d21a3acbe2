//! Names of modes and kinds of events.

use nsd_solver::hybrid::Side;
use nsd_solver::selector::Decision;

use crate::expr::{Expr, Var, variables_of};
use crate::model::When;
use crate::report::{self, EventKind};
use crate::source::Span;
use crate::system::{Role, System};

/// Turns sides into the words of the language.
pub(crate) struct ModeNames<'s, 'e> {
    system: &'s System<'e>,
    /// Switches that no partition shows.
    loose: Vec<usize>,
    /// Switches that guards of jumps look at and nothing else, and those that stand for data: they are no part of the mode.
    watched: Vec<bool>,
    /// Contacts with friction.
    rough: Vec<bool>,
    /// The partition of every switch that compares indicators: what it does shows in the regions only.
    indicated: Vec<Option<usize>>,
}

/// The change of one surface, or of the regions of a partition with indicators.
pub(crate) struct Change {
    pub kind: EventKind,
    pub surface: String,
    pub span: Option<Span>,
    /// The sliding modes there, where a nonlinear switch had to choose.
    pub sliding: Vec<report::SlidingMode>,
}

impl<'s, 'e> ModeNames<'s, 'e> {
    pub(crate) fn new(system: &'s System<'e>) -> Self {
        let shown = |i: &usize| {
            system
                .coupling
                .partitions
                .iter()
                .any(|partition| partition.switches.contains(i))
        };
        let partition_of = |i: usize| {
            let mut partitions = system.coupling.partitions.iter();
            partitions.position(|p| !p.indicators.is_empty() && p.switches.contains(&i))
        };
        let mut watched = only_watched(system);
        for (watched, switch) in watched.iter_mut().zip(&system.switches) {
            let steps = &system.exogenous.steps;
            *watched |= (switch.alpha.as_variable()).is_some_and(|alpha| steps.contains(&alpha));
        }
        ModeNames {
            system,
            loose: (0..system.switches.len())
                .filter(|i| !shown(i) && !watched[*i])
                .collect(),
            watched,
            rough: (0..system.switches.len())
                .map(|i| system.switches.iter().any(|other| other.slip_of == Some(i)))
                .collect(),
            indicated: (0..system.switches.len()).map(partition_of).collect(),
        }
    }

    /// The regions of a partition with indicators that a state is in or slides between.
    fn between(&self, partition: usize, sides: &[Side]) -> Vec<&'s str> {
        let fits = |&(k, on): &(usize, bool)| match sides[k] {
            Side::Slide => true,
            side => (side == Side::Plus) == on,
        };
        let regions = self.system.coupling.partitions[partition].regions.iter();
        let present = regions.filter(|region| region.literals.iter().flatten().all(fits));
        present.map(|region| region.name.as_str()).collect()
    }

    /// What changes between two modes: nothing where only indicators of other regions than the present ones cross.
    pub(crate) fn changes(&self, from: &[Side], to: &[Side]) -> Vec<Change> {
        let mut found = Vec::new();
        let mut told = vec![false; self.system.coupling.partitions.len()];
        for (i, switch) in self.system.switches.iter().enumerate() {
            let kind = match switch.slip_of {
                _ if switch.role == Role::Equation => continue,
                // Of a pair, what becomes zero is told.
                _ if switch.role != Role::Step && to[i] != Side::Slide => continue,
                // Both entries of a slip velocity stick or slip together.
                _ if self.is_second(i) => continue,
                Some(contact) => friction(from, to, i, contact),
                None => self.kind(i, from[i], to[i]),
            };
            let Some(kind) = kind.filter(|_| !self.watched[i]) else {
                continue;
            };
            let Some(partition) = self.indicated[i] else {
                found.push(Change {
                    kind,
                    surface: switch.name.clone(),
                    span: switch.spans.first().copied(),
                    sliding: Vec::new(),
                });
                continue;
            };
            let (before, after) = (self.between(partition, from), self.between(partition, to));
            if before == after || std::mem::replace(&mut told[partition], true) {
                continue;
            }
            let regions = self.system.coupling.partitions[partition].regions.iter();
            let names = regions.map(|region| region.name.as_str());
            let met = names.filter(|name| before.contains(name) || after.contains(name));
            found.push(Change {
                kind: match (before.len(), after.len()) {
                    (1, 1) => EventKind::Crossing,
                    (before, after) if after < before => EventKind::LeaveSliding,
                    _ => EventKind::EnterSliding,
                },
                surface: met.collect::<Vec<_>>().join(" | "),
                span: switch.spans.first().copied(),
                sliding: Vec::new(),
            });
        }
        found
    }

    /// The same, with what the dummy system has decided: folds, and choices among several sliding modes.
    pub(crate) fn decided(
        &self,
        from: &[Side],
        to: &[Side],
        decisions: &[Decision],
    ) -> Vec<Change> {
        let mut found = self.changes(from, to);
        for decision in decisions {
            let switch = &self.system.switches[decision.switch];
            let sliding = self.sliding_modes(decision);
            let told = found
                .iter()
                .position(|change| change.surface == switch.name);
            let changed = from[decision.switch] != to[decision.switch];
            let kind = match decision.folds {
                true => EventKind::Fold,
                false if changed && decision.modes.len() > 1 => EventKind::Branch,
                false => {
                    if let Some(at) = told {
                        found[at].sliding = sliding;
                    }
                    continue;
                }
            };
            let change = Change {
                kind,
                surface: switch.name.clone(),
                span: switch.spans.first().copied(),
                sliding,
            };
            // A fold is how the sliding ends; a branch is told besides what it leads to.
            match told {
                Some(at) if decision.folds => found[at] = change,
                Some(at) => found.insert(at + 1, change),
                None => found.push(change),
            }
        }
        found
    }

    /// The sliding modes of a nonlinear switch, by the values of its statement.
    fn sliding_modes(&self, decision: &Decision) -> Vec<report::SlidingMode> {
        let reading = self.system.switches[decision.switch].named.first();
        let value = |alpha: f64| reading.map_or(alpha, |reading| reading.value(alpha));
        // ∂α/∂s, for ψ and s of one orientation.
        let share = match reading {
            Some(reading) if reading.is_sign => 0.5,
            _ => 1.0,
        };
        let modes = decision.modes.iter().map(|mode| report::SlidingMode {
            value: value(mode.alpha),
            stability: share * mode.stability,
            taken: decision.taken == Some(mode.alpha),
        });
        let mut modes: Vec<_> = modes.collect();
        modes.sort_by(|a, b| a.value.total_cmp(&b.value));
        modes
    }

    /// Regions the state is in: those whose weight is 1.
    pub(crate) fn regions(&self, sides: &[Side]) -> Vec<String> {
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
            .coupling
            .partitions
            .iter()
            .flat_map(|partition| &partition.regions);
        regions
            .filter(|region| region.weight.eval(&value) == 1.0)
            .map(|region| region.name.clone())
            .collect()
    }

    /// The regions with indicators that the state slides between, by partition.
    pub(crate) fn sliding_between(&self, sides: &[Side]) -> Vec<Vec<&'s str>> {
        let partitions = self.system.coupling.partitions.iter().enumerate();
        let indicated = partitions.filter(|(_, partition)| !partition.indicators.is_empty());
        let sets = indicated.map(|(p, _)| self.between(p, sides));
        sets.filter(|set| set.len() > 1).collect()
    }

    /// `inside, sliding(x[1])`: regions, then what each remaining switch does.
    pub(crate) fn mode(&self, sides: &[Side]) -> String {
        let mut words = self.regions(sides);
        for set in self.sliding_between(sides) {
            words.push(format!("sliding({})", set.join(", ")));
        }
        for (i, side) in sides.iter().enumerate() {
            let is_hidden = self.indicated[i].is_some();
            if self.is_told_otherwise(i, sides) {
                continue;
            }
            if (*side == Side::Slide && !is_hidden) || self.loose.contains(&i) {
                words.push(self.word(i, *side));
            }
        }
        if words.is_empty() {
            "smooth".to_owned()
        } else {
            words.join(", ")
        }
    }

    /// True for the second entry of a slip velocity, which sticks and slips as the first one does.
    fn is_second(&self, switch: usize) -> bool {
        let across = self.system.switches[switch].across;
        across.is_some_and(|other| other < switch)
    }

    /// True for a slip velocity of an open contact, and for a closed contact with friction, which sticks or slips.
    fn is_told_otherwise(&self, switch: usize, sides: &[Side]) -> bool {
        let is_closed = |contact: usize| sides[contact] == Side::Slide;
        if self.is_second(switch) {
            return true;
        }
        match self.system.switches[switch].role {
            Role::Step => {}
            Role::Equation => return true,
            Role::Member(_) => return !is_closed(switch),
        }
        match self.system.switches[switch].slip_of {
            Some(contact) => !is_closed(contact),
            None => self.rough[switch] && is_closed(switch),
        }
    }

    /// One way to go on from a point: `sliding(x), above(y)`.
    pub(crate) fn branch(&self, candidate: &[(usize, Side)]) -> String {
        let is_told = |&&(i, side): &&(usize, Side)| match self.system.switches[i].role {
            Role::Step => !self.is_second(i),
            Role::Equation => false,
            Role::Member(_) => side == Side::Slide,
        };
        let words: Vec<String> = candidate
            .iter()
            .filter(is_told)
            .map(|&(i, side)| self.word(i, side))
            .collect();
        words.join(", ")
    }

    fn word(&self, switch: usize, side: Side) -> String {
        let word = self.side(switch, side).as_str();
        format!("{word}({})", self.system.switches[switch].name)
    }

    /// True for what is zero, or may be: a constraint of a projection, or a member of a pair.
    fn is_projected(&self, switch: usize) -> bool {
        self.system.is_projected(switch) || self.system.switches[switch].role != Role::Step
    }

    fn is_relay(&self, switch: usize) -> bool {
        self.system.switches[switch].relay.is_some()
    }

    /// The report's side of a switch.
    fn side(&self, switch: usize, side: Side) -> report::Side {
        if self.is_projected(switch) {
            return match side {
                Side::Slide => report::Side::Active,
                _ => report::Side::Inactive,
            };
        }
        if self.system.switches[switch].unilateral {
            return match side {
                Side::Slide => report::Side::Closed,
                _ => report::Side::Open,
            };
        }
        if self.system.switches[switch].slip_of.is_some() {
            return match side {
                Side::Slide => report::Side::Stick,
                _ => report::Side::Slip,
            };
        }
        match (side, self.is_relay(switch)) {
            (Side::Minus, false) => report::Side::Below,
            (Side::Slide, _) => report::Side::Sliding,
            (Side::Plus, false) => report::Side::Above,
            (Side::Minus, true) => report::Side::Off,
            (Side::Plus, true) => report::Side::On,
        }
    }

    /// The report's sides.
    pub(crate) fn sides(&self, sides: &[Side]) -> Vec<report::Side> {
        let sides = sides.iter().enumerate();
        sides.map(|(i, &side)| self.side(i, side)).collect()
    }

    /// What the change of one switch is called; none where it did not change.
    fn kind(&self, switch: usize, from: Side, to: Side) -> Option<EventKind> {
        let is_projected = self.is_projected(switch);
        let switch = &self.system.switches[switch];
        match (switch.relay, to) {
            _ if from == to => None,
            (Some(_), _) => Some(EventKind::Relay),
            (None, Side::Slide) if is_projected => Some(EventKind::Activate),
            (None, _) if is_projected => Some(EventKind::Deactivate),
            (None, Side::Slide) if switch.unilateral => Some(EventKind::ContactClose),
            (None, _) if switch.unilateral => Some(EventKind::ContactOpen),
            _ => kind(from, to),
        }
    }

    /// The event that a law is, by its index, in a mode.
    pub(crate) fn event(&self, time: f64, law: usize, mode: &str) -> report::Event {
        let (name, span) = law_of(self.system, law);
        let law = self.system.jumps.laws.get(law);
        report::Event {
            time,
            kind: match law.map(|law| (law.stops, law.when)) {
                Some((true, _)) => EventKind::Stop,
                Some((_, When::Every(_))) => EventKind::Sample,
                _ => EventKind::Jump,
            },
            surface: name.to_owned(),
            from: mode.to_owned(),
            to: mode.to_owned(),
            span: Some(span),
            sliding: Vec::new(),
        }
    }
}

/// Switches that occur in guards and resets of laws only.
fn only_watched(system: &System) -> Vec<bool> {
    if system.jumps.first_jump().is_none() && system.jumps.laws.is_empty() {
        return vec![false; system.switches.len()];
    }
    let recorded = system.recorded.signals();
    let regions = system
        .coupling
        .partitions
        .iter()
        .flat_map(|partition| &partition.regions);
    let used: Vec<Expr> = (system.states.iter().map(|state| state.rate))
        .chain(recorded.flat_map(|output| output.exprs.iter().copied()))
        .chain(system.recorded.limits.iter().map(|limit| limit.value))
        .chain(regions.map(|region| region.weight))
        .chain(system.switches.iter().map(|switch| switch.psi))
        .collect();
    let used = variables_of(&used);
    let is_used = |alpha: Expr| alpha.as_variable().is_some_and(|var| used.contains(&var));
    let named = |switch: &crate::system::Switch| !switch.named.is_empty();
    (system.switches.iter())
        .map(|switch| !is_used(switch.alpha) && !named(switch))
        .collect()
}

/// A law by its index: jumps come first, then contacts.
pub(crate) fn law_of<'s>(system: &'s System, law: usize) -> (&'s str, Span) {
    match law.checked_sub(system.jumps.laws.len()) {
        Some(contact) => {
            let contact = &system.jumps.contacts[contact];
            (&contact.name, contact.span)
        }
        None => (&system.jumps.laws[law].name, system.jumps.laws[law].span),
    }
}

/// What friction does in a contact that is closed, or has just closed.
fn friction(from: &[Side], to: &[Side], slip: usize, contact: usize) -> Option<EventKind> {
    let state = |sides: &[Side]| (sides[contact] == Side::Slide).then_some(sides[slip]);
    match (state(from), state(to)) {
        (_, None) => None,
        (before, Some(Side::Slide)) => (before != Some(Side::Slide)).then_some(EventKind::Stick),
        (before, Some(side)) => (before != Some(side)).then_some(EventKind::Slip),
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
