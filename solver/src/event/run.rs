//! The loop of a run: step, event, next mode.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::jump::JumpLaws;
use super::{Cause, Event, Observer, Segment, Simulator};
use crate::event::state::{Report, State};
use crate::events::simultaneous::Simultaneous;
use crate::events::{Approach, chattering, zeno};
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::scales::Bands;
use crate::hybrid::periodic::{are_one, latest};
use crate::hybrid::point::Point;
use crate::hybrid::status::Stats;
use crate::hybrid::{Few, HybridSystem, Outcome, Piecewise, Settings, Side, Status};
use crate::integrate::step::Step;
use crate::runtime::pace::Pace;
use crate::selector::select::Met;

/// Gives data from an instant and a state on, where they do not go on as they are known, or ends a run.
pub type Decide<'d> = dyn FnMut(f64, &[f64]) -> ControlFlow<(), Option<Vec<Arc<Piecewise>>>> + 'd;

/// Events in a row without progress in time that count as an accumulation.
const MAX_STALLED: usize = 100;

/// What a run remembers of the steps and events behind it.
#[derive(Default)]
struct History {
    events: zeno::Events,
    chatter: chattering::Chatter,
    /// The mode before an accumulation of events, and where it ends.
    limit: Option<(Few<Side>, f64)>,
    violation: f64,
    pace: Pace,
    /// Events in a row without progress in time.
    stalled: usize,
    /// Functions taken up when the clock was looked at.
    functions: usize,
}

impl History {
    /// The limit that a run has come to.
    fn limit(&mut self, settings: &Settings, mode: &Mode, report: &Report) -> Option<Status> {
        if report.stats.steps >= settings.max_steps {
            return Some(Status::StepLimit);
        }
        if report.stats.events >= settings.max_events {
            return Some(Status::EventLimit);
        }
        // A look at the clock costs as much as a small step; functions may take long to compile.
        let known = mode.n_functions();
        let compiled = std::mem::replace(&mut self.functions, known) < known;
        let over = match compiled || report.stats.steps.is_multiple_of(16) {
            true => settings.limit.over(),
            false => settings.limit.canceled(),
        };
        over.map(Status::Over)
    }

    /// Where events accumulate, the mode changes at their limit.
    fn end_accumulation(
        &mut self,
        system: &HybridSystem,
        state: &mut State,
        step: &Step,
        observer: &mut dyn Observer,
    ) {
        let ends = step.reaches_end || !step.triggers.is_empty();
        let Some((from, _)) = self.limit.take_if(|_| ends) else {
            return;
        };
        if step.reaches_end {
            state.jumps.repay(system, &mut state.point);
        }
        observer.event(&Event {
            time: state.point.t,
            x: &state.point.x,
            before: &state.point.x,
            jumps: &[],
            decisions: &[],
            from: &from,
            to: &state.point.sides,
            accumulates: true,
            cause: Cause::default(),
        });
    }
}

/// What a step meets at its end besides its triggers.
#[derive(Clone, Copy)]
struct Meets {
    breakpoint: bool,
    kick: Option<f64>,
    /// Whether it is an instant at which laws jump.
    is_due: bool,
}

/// Instants behind a point that are known before the run.
struct Ahead {
    breakpoint: f64,
    kick: f64,
    /// Where laws jump.
    instant: f64,
}

impl Ahead {
    fn all(&self) -> [f64; 3] {
        [self.breakpoint, self.kick, self.instant]
    }

    /// Where a step ends at the latest, which is not to go beyond `end`.
    fn goal(&self, end: f64) -> f64 {
        match latest(self.all()) {
            goal if goal < end && !are_one(goal, end) => goal,
            _ => end,
        }
    }

    /// What is met where a step has ended.
    fn meets(&self, t: f64, t1: f64) -> Meets {
        let is_due = t >= self.instant || are_one(t, self.instant);
        let is_inside = t < t1;
        Meets {
            // What jumps at the end of a run reads data that go on there.
            breakpoint: (t >= self.breakpoint || are_one(t, self.breakpoint))
                && (is_inside || is_due),
            kick: (t >= self.kick && is_inside).then_some(self.kick),
            is_due,
        }
    }
}

/// The step before an event.
struct Before {
    /// Its mode.
    from: Few<Side>,
    /// What it met at its end, and whether its end was known before.
    met: Few<usize>,
    is_scheduled: bool,
    length: f64,
}

/// [`Simulator::run`] with data that are decided on the way: wherever data may change, `decide` is asked at the state before what
/// jumps there, and gives the last of them anew, from this instant on, or ends the run as `Stopped`.
pub fn run_decided(
    simulator: &mut Simulator,
    [t0, t1]: [f64; 2],
    x0: &[f64],
    observer: &mut dyn Observer,
    decide: &mut Decide<'_>,
) -> Outcome {
    let known = simulator.mode.n_functions();
    let mut state = std::mem::take(&mut simulator.state);
    state.begin(t0, x0, simulator.system.n_switches());
    simulator.stepper.stiffness.reset();
    simulator.stepper.order.reset();
    let mut history = History::default();
    let status = match simulator.begin(&mut state, [t0, t1], observer) {
        Err(status) => status,
        Ok(()) => loop {
            let went = simulator.go_on(&mut state, &mut history, [t0, t1], observer, decide);
            if let Err(status) = went {
                break status;
            }
        },
    };
    state.report.stats.functions = simulator.mode.n_functions() - known;
    let outcome = outcome(&mut state, &history, t0, status);
    simulator.state = state;
    outcome
}

/// Adds the steps of time whose instant is one with that of a sample, which may be earlier by rounding.
fn meet_steps(mode: &mut Mode, state: &State, triggers: &mut Few<usize>) {
    let t = state.point.t;
    mode.move_to(&state.point);
    for i in 0..state.point.sides.len() {
        let is_step = mode.system.switches[i].is_timed && mode.system.relay(i).is_none();
        if !is_step || triggers.contains(&i) {
            continue;
        }
        mode.surfaces.stand_for(i, 0);
        mode.surfaces.linearize(i, &mode.memory.values);
        let (psi, rate) = (mode.psi(i), mode.surfaces.time_gradient(i));
        // It is still ahead.
        let is_ahead = psi * rate <= 0.0 && rate * state.point.sides[i].sign() < 0.0;
        if is_ahead && are_one(t, t - psi / rate) {
            triggers.push(i);
        }
    }
    triggers.sort_unstable();
}

impl Simulator {
    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut dyn Observer) -> Outcome {
        let goes_on = &mut |_: f64, _: &[f64]| ControlFlow::Continue(None);
        run_decided(self, [t0, t1], x0, observer, goes_on)
    }

    /// Finds the first mode, with the jumps that are due at once.
    fn begin(
        &mut self,
        state: &mut State,
        [t0, t1]: [f64; 2],
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let started = self.start(state, t1 - t0);
        if started.is_ok() && !state.jumps.fired.is_empty() {
            state.report.stats.events += 1;
            observer.event(&Event {
                time: state.point.t,
                x: &state.point.x,
                before: state.jumps.before(&state.point.x),
                jumps: &state.jumps.fired,
                decisions: &[],
                from: &state.point.sides,
                to: &state.point.sides,
                accumulates: false,
                cause: Cause {
                    on: &state.jumps.known.read,
                    is_scheduled: true,
                    ..Cause::default()
                },
            });
        }
        state.selection.begun = true;
        match (started, state.jumps.known.stopped.take()) {
            (Ok(()), Some(law)) => Err(Status::StopsAtStart { law }),
            (started, _) => started,
        }
    }

    /// One step, and the next mode where it ends in an event; how the run ends where it does.
    fn go_on(
        &mut self,
        state: &mut State,
        history: &mut History,
        [t0, t1]: [f64; 2],
        observer: &mut dyn Observer,
        decide: &mut Decide<'_>,
    ) -> Result<(), Status> {
        self.mode.memory.order = self.stepper.order.full();
        if !state.approaches.pending.is_empty() {
            state
                .approaches
                .look_behind(&mut self.mode, &state.point, &state.bands);
        }
        if state.point.t >= t1 {
            return Err(Status::Solved);
        }
        if let Some(status) = history.limit(&self.settings, &self.mode, &state.report) {
            return Err(match status {
                Status::EventLimit => history.chatter.at_limit(t1 - state.point.t),
                status => status,
            });
        }
        let (time, stats) = (state.point.t, &state.report.stats);
        if (history.pace).falls_short(time, stats, self.settings.max_steps, t1) {
            return Err(Status::StepLimit);
        }

        // Find the solution in the current mode and cut it at its first event.
        self.mode.enter(&state.point.sides);
        let ahead = Ahead {
            breakpoint: self.pieces.until,
            kick: self.settings.next_kick(state.point.t),
            instant: self.system.next_instant(state.point.t),
        };
        let end = history.limit.as_ref().map_or(t1, |(_, end)| *end);
        let goal = ahead.goal(end);
        let mut step = self.stepper.step(&mut self.mode, state, goal, t1)?;
        self.take(state, history, &mut step, goal, observer)?;
        history.end_accumulation(&self.system, state, &step, observer);

        // At an event, the rates on all surfaces that meet decide the next mode.
        disarm(&mut self.mode, &state.point, &mut state.bands);
        let meets = ahead.meets(state.point.t, t1);
        if meets.breakpoint {
            take_data(&mut self.mode, &state.point, decide)?;
        }
        if meets.is_due {
            JumpLaws::new(&self.system, &mut self.mode).let_due(state);
            meet_steps(&mut self.mode, state, &mut step.triggers);
        }
        let is_known = meets.breakpoint || meets.kick.is_some() || meets.is_due;
        if step.triggers.is_empty() && !is_known {
            return Ok(());
        }
        self.locate(state, history, &mut step, meets, [t0, t1])?;
        let before = Before {
            from: Few::from_slice(&state.point.sides),
            met: step.triggers.clone(),
            is_scheduled: is_known,
            length: step.length,
        };
        self.mode.memory.order = self.stepper.order.full();
        self.next_mode(state, step.triggers, meets, t1)?;
        let jumped = !state.jumps.fired.is_empty();
        let stopped = state.jumps.known.stopped.is_some();
        let folded = state
            .selection
            .decisions
            .iter()
            .any(|decision| decision.folds);
        if *before.from == *state.point.sides && !jumped && !folded && !stopped {
            return Ok(());
        }
        self.record(state, history, before, t1, observer)?;
        match stopped {
            true => Err(Status::Solved),
            false => Ok(()),
        }
    }

    /// Moves to the end of a step, projecting the drift off the sliding surfaces, and hands the step on.
    fn take(
        &mut self,
        state: &mut State,
        history: &mut History,
        step: &mut Step,
        goal: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        history.violation = f64::max(history.violation, step.defect);
        if !step.implicit {
            state.window.close(&self.mode);
        }
        state.window.length = 0.0;
        let start = state.point.t;
        if step.reaches_end {
            (state.point.t, state.point.t_low) = (goal, 0.0);
        } else {
            state.point.advance(step.length);
        }
        if !step.departs {
            let drift = self.projection.project(&mut self.mode, state);
            history.violation = f64::max(history.violation, drift);
        }
        state.scales.record(&state.point.x, step.length);
        state.report.stats.steps += 1;
        // What sets off is expanded in the mode in which it sticks, and slips.
        let sides = match step.departs {
            true => &state.point.sides,
            false => &self.mode.sides,
        };
        let segment = Segment {
            start,
            length: step.length,
            until: state.point.t,
            sides,
            end: &state.point.x,
            dense: &self.stepper.dense(&self.mode, step.implicit),
        };
        if step.length > 0.0 && observer.segment(&segment).is_break() {
            return Err(Status::Stopped);
        }
        let (mode, bands) = (&mut self.mode, &mut state.bands);
        Monitor { mode, bands }.take_unobserved(&mut state.point);
        if let Some(status) = step.ends.take() {
            return Err(status);
        }
        if history.chatter.is_last() {
            let mut x = state.point.x.clone();
            self.stepper
                .dense(&self.mode, step.implicit)
                .states_at(0.5 * step.length, &mut x);
            let middle = (start + 0.5 * step.length, &x[..]);
            history.chatter.measure(&mut self.mode, state, middle);
        }
        Ok(())
    }

    /// Tells apart what a step has met at its end, and how well the instant is known.
    fn locate(
        &mut self,
        state: &mut State,
        history: &mut History,
        step: &mut Step,
        meets: Meets,
        [t0, t1]: [f64; 2],
    ) -> Result<(), Status> {
        if step.triggers.is_empty() {
            return Ok(());
        }
        if !meets.breakpoint {
            Simultaneous {
                selector: self.selector(),
            }
            .tell_apart(state, &mut step.triggers, t1);
        }
        self.stepper.stiffness.after_event();
        if !step.implicit && !meets.breakpoint {
            state.window.open(
                &self.mode,
                &state.scales,
                &state.bands,
                step.length,
                &step.triggers,
            );
        }
        let progresses = step.length > 1e-14 * (t1 - t0);
        history.stalled = if progresses { 0 } else { history.stalled + 1 };
        match history.stalled > MAX_STALLED {
            true => Err(Status::Accumulation),
            false => Ok(()),
        }
    }

    /// The mode behind the end of a step, with jumps and perturbations.
    fn next_mode(
        &mut self,
        state: &mut State,
        triggers: Few<usize>,
        meets: Meets,
        t1: f64,
    ) -> Result<(), Status> {
        state.selection.decisions.clear();
        if meets.breakpoint || meets.is_due || !self.system.laws.is_empty() {
            state.selection.leaving = None;
        }
        let met = match meets.breakpoint {
            true => Met::Breakpoint(triggers),
            false => Met::Surfaces(triggers),
        };
        self.pass(state, met, t1)?;
        state.selection.leaving = None;
        if let Some(kick) = meets.kick.filter(|_| state.jumps.known.stopped.is_none()) {
            self.kick(state, kick, t1)?;
        }
        state.selection.fold = None;
        Ok(())
    }

    /// Takes note of an event that has changed the mode or the state, behind a step.
    fn record(
        &mut self,
        state: &mut State,
        history: &mut History,
        before: Before,
        t1: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let from = &before.from;
        self.stepper.stiffness.after_event();
        state.report.stats.events += 1;
        state.report.stats.scheduled += usize::from(before.is_scheduled);
        let slides = |sides: &[Side]| sides.iter().filter(|s| **s == Side::Slide).count();
        let more = slides(&state.point.sides) > slides(from);
        if **from != *state.point.sides {
            history.events.record(state.point.t, from);
            history.chatter.record(state.point.t, &state.point.x, from);
            history.chatter.average(self, state, t1)?;
        }
        let jumped = !state.jumps.fired.is_empty();
        let end = match jumped {
            true => state.jumps.limit(&mut state.window),
            false => history.events.limit(&state.point.sides),
        };
        let end = end.filter(|end| more && *end < t1);
        let waits = end.filter(|end| *end > state.point.t);
        if jumped || waits.is_none() {
            observer.event(&Event {
                time: state.point.t,
                x: &state.point.x,
                before: state.jumps.before(&state.point.x),
                jumps: &state.jumps.fired,
                decisions: &state.selection.decisions,
                from,
                to: if waits.is_some() {
                    from
                } else {
                    &state.point.sides
                },
                accumulates: end.is_some() && waits.is_none(),
                cause: Cause {
                    met: &before.met,
                    on: &state.jumps.known.read,
                    is_scheduled: before.is_scheduled,
                    is_in_limit: waits.is_some(),
                },
            });
            displace(&self.mode, state, before.length, observer);
        }
        let undisturbed = t1
            .min(self.pieces.until)
            .min(self.settings.next_kick(state.point.t))
            .min(self.system.next_instant(state.point.t));
        let (mode, point) = (&mut self.mode, &state.point);
        let here = chattering::Here {
            t: point.t,
            x: &point.x,
            sides: &point.sides,
        };
        let psi = |t: f64, x: &[f64]| {
            mode.memory.set(t, x, &point.alpha);
            (0..point.sides.len()).map(|i| mode.psi(i)).collect()
        };
        let most = self.settings.max_events;
        if let Some(status) = (history.chatter).chatters(most, here, undisturbed, psi) {
            if !self.settings.averages {
                return Err(status);
            }
            history.chatter.look_at_last();
        }
        history.limit = waits.map(|end| (before.from, end));
        Ok(())
    }
}

/// Takes what is decided on where data may change.
fn take_data(mode: &mut Mode, point: &Point, decide: &mut Decide<'_>) -> Result<(), Status> {
    match decide(point.t, &point.x) {
        ControlFlow::Continue(None) => Ok(()),
        ControlFlow::Continue(Some(data)) => {
            let known = &mut mode.memory.data;
            let first = known.len() - data.len();
            known[first..].clone_from_slice(&data);
            Ok(())
        }
        ControlFlow::Break(()) => Err(Status::Stopped),
    }
}

/// Where a run from `t0` has ended, and how.
fn outcome(state: &mut State, history: &History, t0: f64, status: Status) -> Outcome {
    let by_time = |a: &Approach, b: &Approach| a.time.total_cmp(&b.time);
    state.approaches.known.sort_by(by_time);
    let elapsed = if state.point.t > t0 {
        state.point.t - t0
    } else {
        1.0
    };
    Outcome {
        status,
        time: state.point.t,
        x: state.point.x.clone(),
        sides: state.point.sides.to_vec(),
        alpha: state.point.alpha.clone(),
        activity: state
            .scales
            .work
            .iter()
            .map(|work| work / elapsed)
            .collect(),
        moved: state
            .window
            .moved
            .iter()
            .map(|squares| squares.sqrt())
            .collect(),
        violation: history.violation,
        complementarity: state.report.complementarity,
        notes: std::mem::take(&mut state.report.notes),
        approaches: std::mem::take(&mut state.approaches.known),
        stats: Stats {
            stopped_by: state.jumps.known.stopped.take(),
            ..state.report.stats
        },
    }
}

/// Lets an observer move the state by roundings: of each x, and of the terms of its rate over the last step.
fn displace(mode: &Mode, state: &mut State, length: f64, observer: &mut dyn Observer) {
    if !observer.displaces() {
        return;
    }
    let before = state.jumps.before(&state.point.x);
    // What laws count is whole, and exact.
    let jumps = |i: usize| state.point.x[i] != before[i] && state.point.x[i].fract() != 0.0;
    let moves = |i: usize| mode.x_series(i)[1] != 0.0 || jumps(i);
    let rests = |i: usize| mode.system.is_algebraic(i) || !moves(i);
    let size = |i: usize| {
        state.point.x[i]
            .abs()
            .max(state.scales.activity[i] * length)
    };
    let rounding = |i: usize| {
        if rests(i) {
            0.0
        } else {
            f64::EPSILON * size(i)
        }
    };
    let roundings: Vec<f64> = (0..state.point.x.len()).map(rounding).collect();
    observer.displace(&mut state.point.x, &roundings);
}

/// A surface left tangentially is monitored again once it is outside its band.
fn disarm(mode: &mut Mode, point: &Point, bands: &mut Bands) {
    let left = |i: usize| bands.armed[i] && point.sides[i] != Side::Slide;
    if !(0..bands.armed.len()).any(left) {
        return;
    }
    mode.move_to(point);
    for i in 0..bands.armed.len() {
        if bands.armed[i] && point.sides[i] != Side::Slide {
            let is_plain = mode.system.switches[i].is_plain();
            bands.armed[i] = bands.is_near(mode, i)
                || is_plain
                    && mode.psi(i).abs() <= mode.surfaces.running_error(i, &mode.memory.values);
        }
    }
}
