//! The way back from numerical to physical time: what an observer sees of the original system.
//!
//! Steps during which the clock stands still are left out. What happened in them is one event: relays have switched,
//! states have jumped by laws. Where the clock is slower, in a contact that lasts, series are stretched. An inelastic
//! contact whose gap stays zero while nothing presses it is closed, too, with a force of zero.

use std::ops::ControlFlow;

use nsd_solver::event::{Cause, Clock, Clocked, Event, Observer, Segment};
use nsd_solver::expansion::Polynomials;
use nsd_solver::fesd;
use nsd_solver::hybrid::{Coefficient, Outcome, Side, Status};

use super::back_map::{BackMap, Struck};
use super::stretch::{Lasting, Stretched, constant};

/// Bounces this close, relative to the horizon, that become ever closer are on their way to a Zeno point.
const DENSE: f64 = 1e-6;
/// A gap is closed below this.
pub(super) const CLOSED: f64 = 1e-8;
/// A gap that is so small all along a step, relative to the largest state, stays zero.
const STAYS: f64 = 1e-11;
/// How much the ratio of successive intervals may still change where they are.
const SETTLED: f64 = 0.1;
/// Velocities behind an impact differ from those of its law by less, relative to the largest state.
const LAWFUL: f64 = 1e-6;

/// Why time does not go on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum End {
    /// Infinitely many bounces follow up to this time.
    Limit(f64),
    /// An elastic contact stays closed.
    Closed,
    /// Friction of a contact, by its switch in the frozen system, is stronger than what opens it.
    Locked(usize),
    /// A coefficient of a contact, by its switch in the frozen system, is one that no contact has.
    Outside(usize, Coefficient, f64),
    /// A contact, by its switch in the frozen system, is below its surface at the start.
    Below(usize),
    /// The velocities behind an impact are not those of its law.
    Unlawful,
}

impl End {
    /// The same of contacts as in a run of the original.
    pub fn status(self, map: &BackMap) -> Status {
        let original = |frozen: usize| {
            let mut contacts = map.contacts.iter();
            let contact = contacts.find(|contact| contact.switch == frozen);
            contact.expect("it is one of a contact").contact
        };
        match self {
            End::Limit(_) | End::Closed => Status::Accumulation,
            End::Unlawful => Status::Undetermined {
                switches: map.contacts.iter().map(|contact| contact.contact).collect(),
            },
            End::Locked(contact) => Status::Painleve {
                switch: original(contact),
            },
            End::Below(contact) => Status::Penetrates {
                switch: original(contact),
            },
            End::Outside(contact, coefficient, value) => Status::Coefficient {
                switch: original(contact),
                coefficient,
                value,
            },
        }
    }
}

/// States behind an impact at an instant by its law, none where there is no impact.
pub(crate) type Law<'l> = dyn FnMut(f64, &[f64]) -> Option<Vec<f64>> + 'l;

/// Where a run of the frozen system begins.
#[derive(Clone, Copy)]
pub(super) struct InitialPoint<'t> {
    /// Its state.
    pub x: &'t [f64],
    /// The values of its open parameters.
    pub parameters: &'t [f64],
}

/// A run in numerical time to an end, from a state.
pub(super) type Numerical<'r> = dyn FnMut(f64, &[f64], &mut Clocked<PhysicalTime>) -> Outcome + 'r;

/// Passes on a run in numerical time as one in physical time.
pub(super) struct PhysicalTime<'t> {
    map: &'t BackMap,
    initial: InitialPoint<'t>,
    /// Who is told; nobody, where a run only shows the clock.
    observer: Option<&'t mut dyn Observer>,
    clock: Clock,
    /// Physical time reached.
    t: f64,
    /// Sides of the switches of the original; empty before time has passed.
    sides: Vec<Side>,
    next: Vec<Side>,
    /// The state of the original at the start of the step.
    x: Vec<f64>,
    impacts: Impacts,
    closed: Closed,
    /// Set when time does not go on.
    end: Option<End>,
    /// The law of impacts, where the frozen system may do something else.
    law: Option<Box<Law<'t>>>,
}

/// The contacts that are closed: those that last, and those that stay so without a force.
#[derive(Default)]
struct Closed {
    lasting: Vec<Lasting>,
    idle: Vec<usize>,
}

/// What has happened since the clock stands still, and when contacts have bounced before.
struct Impacts {
    /// The state when the clock stopped.
    before: Option<Vec<f64>>,
    /// Laws that have acted since.
    fired: Vec<usize>,
    accumulates: bool,
    /// The last bounces of every contact.
    bounces: Vec<Vec<f64>>,
}

impl Impacts {
    /// Notes the contacts that act while the clock stands still.
    fn act(&mut self, map: &BackMap, sides: &[Side]) {
        for contact in &map.contacts {
            let comes = |speed: usize| sides[speed] == Side::Minus;
            let closed = sides[contact.switch] == Side::Minus;
            let acts = closed && contact.speed.is_none_or(comes);
            if acts && !self.fired.contains(&contact.law) {
                self.fired.push(contact.law);
            }
        }
    }

    /// Takes note of the bounces that have ended at an instant, and sees where they would accumulate.
    fn count(&mut self, map: &BackMap, t: f64, horizon: f64) -> Option<End> {
        let mut end = None;
        for (contact, times) in map.contacts.iter().zip(&mut self.bounces) {
            if contact.speed.is_some() || !self.fired.contains(&contact.law) {
                continue;
            }
            times.push(t);
            let found = accumulation(times);
            let found =
                found.filter(|(interval, limit)| *interval <= DENSE * horizon && *limit < horizon);
            end = found.map(|(_, limit)| End::Limit(limit)).or(end);
        }
        end
    }

    /// Where bounces accumulate that have become too short to compute.
    fn limit(&self) -> Option<End> {
        let mut found = self.bounces.iter().filter_map(|times| accumulation(times));
        found.next().map(|(_, limit)| End::Limit(limit))
    }
}

/// The polynomials of the original's states and switches.
struct InPhysicalTime<'a> {
    inner: &'a dyn Polynomials,
    places: &'a [Option<usize>],
    blind: &'a [usize],
    /// α of contacts without a force.
    free: Vec<f64>,
}

impl Polynomials for InPhysicalTime<'_> {
    fn degree(&self) -> usize {
        self.inner.degree()
    }

    fn x(&self, i: usize) -> &[f64] {
        self.inner.x(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        match self.places[switch] {
            Some(place) => self.inner.alpha(place),
            None => &self.free,
        }
    }

    fn unobserved(&self) -> &[usize] {
        self.blind
    }
}

impl<'t> PhysicalTime<'t> {
    pub fn new(
        map: &'t BackMap,
        initial: InitialPoint<'t>,
        clock: Clock,
        observer: Option<&'t mut dyn Observer>,
    ) -> Self {
        PhysicalTime {
            map,
            initial,
            observer,
            clock,
            t: 0.0,
            sides: Vec::new(),
            next: vec![Side::Plus; map.places.len()],
            x: vec![0.0; map.n_states],
            impacts: Impacts {
                before: None,
                fired: Vec::new(),
                accumulates: false,
                bounces: vec![Vec::new(); map.contacts.len()],
            },
            closed: Closed::default(),
            end: None,
            law: None,
        }
    }

    /// The sides of the original where a run is in these, with these states in the middle of a step and at its end.
    fn read(&mut self, sides: &[Side], [middle, x]: [&[f64]; 2]) {
        for (next, place) in self.next.iter_mut().zip(&self.map.places) {
            *next = place.map_or(Side::Plus, |place| sides[place]);
        }
        for memory in &self.map.relays {
            self.next[memory.relay] = Side::of(x[memory.state] - 0.5);
        }
        self.closed.lasting.clear();
        self.rest(sides, [middle, x]);
        let lasts = |speed: Option<usize>| speed.filter(|&speed| sides[speed] == Side::Slide);
        let resting = self.map.contacts.iter();
        let mut resting = resting
            .filter_map(|contact| Some((contact, lasts(contact.speed)?)))
            .peekable();
        if resting.peek().is_none() {
            return;
        }
        let seen = self.map.look(x, self.initial.parameters);
        for (contact, speed) in resting {
            self.next[contact.contact] = Side::Slide;
            self.closed.lasting.push(Lasting {
                contact: contact.contact,
                speed,
                strength: seen.strength(contact),
            });
        }
    }

    /// Takes the inelastic contacts that stay closed while nothing presses them: they have struck, were so before, or begin
    /// so, and their gaps stay zero.
    fn rest(&mut self, sides: &[Side], states: [&[f64]; 2]) {
        let before = std::mem::take(&mut self.closed.idle);
        let (map, parameters) = (self.map, self.initial.parameters);
        let is_known = |contact: &Struck| {
            let (law, contact) = (contact.law, contact.contact);
            self.sides.is_empty() || self.impacts.fired.contains(&law) || before.contains(&contact)
        };
        let is_free = |contact: &&Struck| {
            let speed = contact.speed.filter(|speed| sides[*speed] != Side::Slide);
            speed.is_some() && is_known(contact)
        };
        let mut left: Vec<&Struck> = map.contacts.iter().filter(is_free).collect();
        for x in states.into_iter().rev() {
            if left.is_empty() {
                return;
            }
            let seen = map.look(x, parameters);
            let size = x[..map.n_states]
                .iter()
                .fold(0.0, |m: f64, x| m.max(x.abs()));
            left.retain(|contact| seen.gap(contact).abs() <= STAYS * size);
        }
        self.closed.idle = left.iter().map(|contact| contact.contact).collect();
        for &contact in &self.closed.idle {
            self.next[contact] = Side::Slide;
        }
    }

    /// Why time does not go on where a contact has struck, at a state of the frozen system: its friction is negative,
    /// or closes it whatever pushes, or another one is closed that it acts on, with friction.
    fn refused(&self, x: &[f64]) -> Option<End> {
        let contacts = &self.map.contacts;
        let seen = self.map.look(x, self.initial.parameters);
        let strikes = |contact: usize| self.impacts.fired.contains(&contacts[contact].law);
        let is_closed = |contact: usize| seen.is_closed(&contacts[contact]);
        let mut rough = self.map.meeting.rough.iter();
        if rough.any(|&[a, b]| strikes(a) && is_closed(b) || strikes(b) && is_closed(a)) {
            return Some(End::Unlawful);
        }
        let mut struck = contacts
            .iter()
            .filter(|contact| self.impacts.fired.contains(&contact.law));
        struck.find_map(|contact| {
            if let Some(friction) = seen.friction(contact).filter(|friction| *friction < 0.0) {
                return Some(End::Outside(
                    contact.switch,
                    Coefficient::Friction,
                    friction,
                ));
            }
            (!seen.opens(contact)).then_some(End::Locked(contact.switch))
        })
    }

    /// Tells what has happened at the present instant, if anything.
    fn tell(&mut self) {
        let accumulates = std::mem::take(&mut self.impacts.accumulates);
        let before = self.impacts.before.take();
        if self.sides.is_empty() {
            self.sides.clone_from(&self.next);
            for memory in &self.map.relays {
                let start = self.initial.x[memory.state];
                self.sides[memory.relay] = Side::of(start - 0.5);
            }
        }
        let has_changed = self.sides != self.next || !self.impacts.fired.is_empty();
        if let Some(observer) = self.observer.as_mut().filter(|_| has_changed) {
            observer.event(&Event {
                time: self.t,
                x: &self.x,
                before: before.as_ref().unwrap_or(&self.x),
                decisions: &[],
                jumps: &self.impacts.fired,
                from: &self.sides,
                to: &self.next,
                accumulates,
                cause: Cause::default(),
            });
        }
        self.impacts.fired.clear();
        self.sides.clone_from(&self.next);
    }

    /// Whether states are behind an impact where its law wants them.
    fn is_lawful(&mut self) -> bool {
        let (Some(law), Some(before)) = (&mut self.law, &self.impacts.before) else {
            return true;
        };
        if self.impacts.fired.is_empty() {
            return true;
        }
        let size = self
            .x
            .iter()
            .chain(before)
            .fold(1.0, |m: f64, x| m.max(x.abs()));
        let exact = law(self.t, before);
        let exact = exact.as_ref().unwrap_or(before);
        let mut both = exact.iter().zip(&self.x);
        both.all(|(exact, x)| (exact - x).abs() <= LAWFUL * size)
    }
}

/// The last interval between bounces that become ever closer, and when infinitely many will have been.
fn accumulation(times: &[f64]) -> Option<(f64, f64)> {
    let &[.., a, b, c, d] = times else {
        return None;
    };
    let (first, second, third) = (b - a, c - b, d - c);
    let (ratio, before) = (third / second, second / first);
    let settles = (ratio - before).abs() <= SETTLED * before && ratio < 1.0;
    settles.then(|| (third, d + third * ratio / (1.0 - ratio)))
}

impl Observer for PhysicalTime<'_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let n = self.map.n_states;
        let Some(advance) = self.clock.advance(segment) else {
            if self.impacts.before.is_none() {
                segment.state(0.0, &mut self.x);
                self.impacts.before = Some(self.x.clone());
            }
            self.impacts.act(self.map, segment.sides);
            self.end = self.refused(segment.end);
            if self.end.is_some() {
                return ControlFlow::Break(());
            }
            return ControlFlow::Continue(());
        };
        let Clock { state, horizon } = self.clock;
        if self.t >= horizon {
            return ControlFlow::Continue(());
        }
        self.impacts.fired.sort_unstable();
        let limit = self.impacts.count(self.map, self.t, horizon);
        self.end = limit.or(self.end);
        let mut elastic = (self.map.contacts.iter()).filter(|contact| contact.speed.is_none());
        if elastic.any(|contact| segment.sides[contact.switch] == Side::Slide) {
            self.end = self.end.or(Some(End::Closed));
        }
        let mut middle = vec![0.0; segment.end.len()];
        segment.state(0.5 * segment.length, &mut middle);
        self.read(segment.sides, [&middle, segment.end]);
        segment.state(0.0, &mut self.x);
        if !self.is_lawful() {
            self.end = self.end.or(Some(End::Unlawful));
            return ControlFlow::Break(());
        }
        self.tell();
        if self.end.is_some() {
            return ControlFlow::Break(());
        }
        let lasts = !self.closed.lasting.is_empty();
        let mut length = if lasts { advance } else { segment.length };
        if self.clock.is_at_end(self.t + length) {
            length = horizon - self.t;
            while self.t + length < horizon {
                length = length.next_up();
            }
        }
        let (inner, places) = (segment.polynomials(), &self.map.places[..]);
        let of_frozen = segment.unobserved();
        let is_blind = |i: &usize| places[*i].is_some_and(|place| of_frozen.contains(&place));
        let blind: Vec<usize> = (0..places.len()).filter(is_blind).collect();
        let seen = InPhysicalTime {
            inner,
            places,
            blind: &blind,
            free: constant(1.0, inner.degree()),
        };
        let stretched = lasts.then(|| {
            // Of what slides there are series.
            let slides = places.iter().zip(&self.sides);
            let slides = slides.map(|(place, side)| place.filter(|_| *side == Side::Slide));
            let slides: Vec<Option<usize>> = slides.collect();
            Stretched::new(inner, state, n, &slides, &self.closed.lasting).without(&blind)
        });
        let dense: &dyn Polynomials = match &stretched {
            Some(stretched) => stretched,
            None => &seen,
        };
        let start = self.t;
        self.t += length;
        let end = &segment.end[..n];
        let passed = Segment::new(start, length, self.t, &self.sides, end, dense);
        match &mut self.observer {
            Some(observer) => observer.segment(&passed),
            None => ControlFlow::Continue(()),
        }
    }

    fn event(&mut self, event: &Event) {
        self.impacts.accumulates |= event.accumulates;
    }
}

impl fesd::Observer for PhysicalTime<'_> {}

/// Runs to the numerical time at which the clock is at the horizon, as long as impacts obey the law; `run` gets the end,
/// the state where it begins and what observes it.
///
/// The outcome is that of the original, but for a status that is not `Solved`, whose switches are those of the frozen
/// system.
pub(super) fn drive(
    map: &BackMap,
    initial: InitialPoint<'_>,
    horizon: f64,
    observer: &mut dyn Observer,
    law: Option<Box<Law>>,
    run: &mut Numerical,
) -> (Outcome, Option<End>) {
    let clock = Clock {
        state: map.clock,
        horizon,
    };
    let x = initial.x;
    let probe = || PhysicalTime::new(map, initial, clock, None);
    let end = clock.numerical_time(probe, |end, physical| run(end, x, physical));
    let mut physical = clock.watch(PhysicalTime::new(map, initial, clock, Some(observer)));
    physical.observer.law = law;
    let mut outcome = run(end, x, &mut physical);
    let mut physical = physical.observer;
    if outcome.status == Status::Solved && clock.is_missed(&outcome.x) {
        physical.end = Some(End::Closed);
        outcome.status = Status::Stopped;
    }
    if outcome.status == Status::Accumulation {
        physical.end = physical.impacts.limit().or(physical.end);
    }
    let outcome = to_physical_time(&mut physical, outcome);
    (outcome, physical.end)
}

/// The outcome in physical time, of the states and switches of the original.
fn to_physical_time(physical: &mut PhysicalTime, outcome: Outcome) -> Outcome {
    let n = physical.map.n_states;
    let first = |values: &[f64]| values.iter().take(n).copied().collect();
    if physical.sides.is_empty() {
        physical.read(&outcome.sides, [&outcome.x, &outcome.x]);
        physical.sides.clone_from(&physical.next);
    }
    let places = physical.map.places.iter().zip(&physical.sides);
    let alpha = |(place, side): (&Option<usize>, &Side)| {
        place.map_or(0.5 + 0.5 * side.sign(), |place| outcome.alpha[place])
    };
    Outcome {
        time: physical.t,
        x: first(&outcome.x),
        sides: physical.sides.clone(),
        alpha: places.map(alpha).collect(),
        activity: first(&outcome.activity),
        moved: first(&outcome.moved),
        notes: Vec::new(),
        approaches: Vec::new(),
        ..outcome
    }
}
