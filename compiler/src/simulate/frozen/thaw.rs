//! The way back from numerical to physical time: what an observer sees of the original system.
//!
//! Steps during which the clock stands still are left out. What happened in them is one event: relays have switched,
//! states have jumped by laws.

use std::ops::ControlFlow;

use nsd_solver::fesd;
use nsd_solver::simulate::{Event, Observer, Outcome, Polynomials, Segment, Side, Stats, Status};

use crate::system::freezing::Frozen;

/// A clock slower than this stands still.
const STANDS: f64 = 1e-6;
/// The end of the horizon is reached to this, relative to it.
const NEAR: f64 = 1e-12;
/// Bounces this close, relative to the horizon, that become ever closer are on their way to a Zeno point.
const DENSE: f64 = 1e-6;
/// How much the ratio of successive intervals may still change where they are.
const SETTLED: f64 = 0.1;

/// Passes on a run in numerical time as one in physical time.
pub(super) struct Thaw<'t, 'e> {
    frozen: &'t Frozen<'e>,
    observer: &'t mut dyn Observer,
    horizon: f64,
    /// Physical time reached.
    t: f64,
    /// Sides of the switches of the original; empty before time has passed.
    sides: Vec<Side>,
    next: Vec<Side>,
    /// The state of the original at the start of the step.
    x: Vec<f64>,
    /// The state when the clock stopped.
    stopped: Option<Vec<f64>>,
    /// Laws that have acted since.
    fired: Vec<usize>,
    accumulates: bool,
    /// The last bounces of every contact.
    bounces: Vec<Vec<f64>>,
    /// Where infinitely many bounces would follow.
    pub limit: Option<f64>,
    /// Whether the clock stands still for good.
    pub stands: bool,
    /// Whether a run ends when time passes again.
    waits: bool,
    /// The state of the frozen system when it did.
    resumed: Option<Vec<f64>>,
}

/// The polynomials of the original's states and switches.
struct Thawed<'a> {
    inner: &'a dyn Polynomials,
    places: &'a [Option<usize>],
}

impl Polynomials for Thawed<'_> {
    fn degree(&self) -> usize {
        self.inner.degree()
    }

    fn x(&self, i: usize) -> &[f64] {
        self.inner.x(i)
    }

    fn alpha(&self, switch: usize) -> &[f64] {
        let place = self.places[switch];
        self.inner.alpha(place.expect("relays and contacts that bounce do not slide"))
    }
}

impl<'t, 'e> Thaw<'t, 'e> {
    pub fn new(frozen: &'t Frozen<'e>, horizon: f64, observer: &'t mut dyn Observer) -> Self {
        Thaw {
            frozen,
            observer,
            horizon,
            t: 0.0,
            sides: Vec::new(),
            next: vec![Side::Plus; frozen.places.len()],
            x: vec![0.0; frozen.n_states],
            stopped: None,
            fired: Vec::new(),
            accumulates: false,
            bounces: vec![Vec::new(); frozen.bounces.len()],
            limit: None,
            stands: false,
            waits: false,
            resumed: None,
        }
    }

    /// The sides of the original where a run is in these, with this state.
    fn read(&mut self, sides: &[Side], x: &[f64]) {
        for (next, place) in self.next.iter_mut().zip(&self.frozen.places) {
            *next = place.map_or(Side::Plus, |place| sides[place]);
        }
        for memory in &self.frozen.relays {
            self.next[memory.relay] = Side::of(x[memory.state] - 0.5);
        }
    }

    /// Tells what has happened at the present instant, if anything.
    fn tell(&mut self) {
        let accumulates = std::mem::take(&mut self.accumulates);
        let before = self.stopped.take();
        if self.sides.is_empty() {
            self.sides.clone_from(&self.next);
            for memory in &self.frozen.relays {
                let start = self.frozen.system.states[memory.state].initial;
                self.sides[memory.relay] = Side::of(start - 0.5);
            }
        }
        if self.sides != self.next || !self.fired.is_empty() {
            self.observer.event(&Event {
                time: self.t,
                x: &self.x,
                before: before.as_ref().unwrap_or(&self.x),
                jumps: &self.fired,
                from: &self.sides,
                to: &self.next,
                accumulates,
            });
        }
        self.fired.clear();
        self.sides.clone_from(&self.next);
    }

    /// Takes note of the bounces that have ended, and sees where they would accumulate.
    fn count(&mut self) {
        for (spring, times) in self.frozen.bounces.iter().zip(&mut self.bounces) {
            if !self.fired.contains(&spring.law) {
                continue;
            }
            times.push(self.t);
            let &[.., a, b, c, d] = &times[..] else {
                continue;
            };
            let (first, second, third) = (b - a, c - b, d - c);
            let (ratio, before) = (third / second, second / first);
            let settles = (ratio - before).abs() <= SETTLED * before && ratio < 1.0;
            if settles && third <= DENSE * self.horizon {
                let limit = d + third * ratio / (1.0 - ratio);
                self.limit = Some(limit).filter(|limit| *limit < self.horizon);
            }
        }
    }
}

impl Observer for Thaw<'_, '_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let (n, clock) = (self.frozen.n_states, self.frozen.clock);
        let advance = segment.end[clock] - segment.state_series(clock)[0];
        if advance < STANDS * segment.length {
            if self.stopped.is_none() {
                segment.state(0.0, &mut self.x);
                self.stopped = Some(self.x.clone());
            }
            for spring in &self.frozen.bounces {
                let closed = segment.sides[spring.switch] == Side::Minus;
                if closed && !self.fired.contains(&spring.law) {
                    self.fired.push(spring.law);
                }
            }
            return ControlFlow::Continue(());
        }
        if self.waits {
            let mut state = segment.end.to_vec();
            segment.state(0.0, &mut state);
            self.resumed = Some(state);
            return ControlFlow::Break(());
        }
        if self.t >= self.horizon {
            return ControlFlow::Continue(());
        }
        self.fired.sort_unstable();
        self.count();
        self.read(segment.sides, segment.end);
        segment.state(0.0, &mut self.x);
        self.tell();
        if self.limit.is_some() {
            return ControlFlow::Break(());
        }
        let mut length = segment.length;
        if (self.t + length - self.horizon).abs() <= NEAR * self.horizon {
            length = self.horizon - self.t;
            while self.t + length < self.horizon {
                length = length.next_up();
            }
        }
        let thawed = Thawed {
            inner: segment.polynomials(),
            places: &self.frozen.places,
        };
        let passed = Segment::new(self.t, length, &self.sides, &segment.end[..n], &thawed);
        self.t += length;
        self.observer.segment(&passed)
    }

    fn event(&mut self, event: &Event) {
        self.accumulates |= event.accumulates;
    }
}

impl fesd::Observer for Thaw<'_, '_> {}

/// Runs from one end of numerical time to the next until the clock has reached the horizon.
///
/// The clock is never faster than numerical time, so that no stretch goes beyond the horizon, but one that begins
/// while the clock stands still: it ends where time passes again. The outcome is that of the original, but for a
/// status that is not `Solved`, whose switches are those of the frozen system.
pub(super) fn drive<'t, 'e>(
    thaw: &mut Thaw<'t, 'e>,
    mut run: impl FnMut(f64, f64, &[f64], &mut Thaw<'t, 'e>) -> Outcome,
) -> Outcome {
    let (frozen, horizon) = (thaw.frozen, thaw.horizon);
    let states = &frozen.system.states;
    let mut x: Vec<f64> = states.iter().map(|state| state.initial).collect();
    let (mut tau, mut stats) = (0.0, Stats::default());
    loop {
        let left = horizon - x[frozen.clock];
        thaw.waits = thaw.stopped.is_some();
        let length = if thaw.waits { horizon } else { left };
        let mut outcome = run(tau, tau + length, &x, thaw);
        stats = sum(stats, outcome.stats);
        if let Some(state) = thaw.resumed.take() {
            (tau, x) = (outcome.time, state);
            continue;
        }
        if outcome.status == Status::Solved && thaw.waits {
            thaw.stands = true;
            outcome.status = Status::Stopped;
        }
        let arrived = horizon - outcome.x[frozen.clock] <= NEAR * horizon;
        if outcome.status == Status::Solved && !arrived {
            (tau, x) = (outcome.time, outcome.x);
            continue;
        }
        outcome.stats = stats;
        return thawed(thaw, outcome);
    }
}

/// The outcome in physical time, of the states and switches of the original.
fn thawed(thaw: &mut Thaw, outcome: Outcome) -> Outcome {
    let n = thaw.frozen.n_states;
    let first = |values: &[f64]| values.iter().take(n).copied().collect();
    if thaw.sides.is_empty() {
        thaw.read(&outcome.sides, &outcome.x);
        thaw.sides.clone_from(&thaw.next);
    }
    let places = thaw.frozen.places.iter().zip(&thaw.sides);
    let alpha = |(place, side): (&Option<usize>, &Side)| {
        place.map_or(0.5 + 0.5 * side.sign(), |place| outcome.alpha[place])
    };
    Outcome {
        time: thaw.t,
        x: first(&outcome.x),
        sides: thaw.sides.clone(),
        alpha: places.map(alpha).collect(),
        activity: first(&outcome.activity),
        moved: first(&outcome.moved),
        notes: Vec::new(),
        approaches: Vec::new(),
        ..outcome
    }
}

fn sum(a: Stats, b: Stats) -> Stats {
    Stats {
        steps: a.steps + b.steps,
        events: a.events + b.events,
        rejected: a.rejected + b.rejected,
        rhs_evaluations: a.rhs_evaluations + b.rhs_evaluations,
        functions: a.functions + b.functions,
        newton_iterations: a.newton_iterations + b.newton_iterations,
        factorizations: a.factorizations + b.factorizations,
        implicit_steps: a.implicit_steps + b.implicit_steps,
    }
}
