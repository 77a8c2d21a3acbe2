//! Event-driven simulation of switched systems
//!
//! x' = f(t, x, α),   α_i ∈ step(ψ_i(t, x)),   f multi-affine in α, but for those of nonlinear switches.
//!
//! A mode fixes every switch to one side of its surface or to sliding on it.
//! Inside a mode the system is smooth and is expanded in a Taylor series, which
//! is at once the step, its dense output of the same order, and the series of
//! every switching function; where it is stiff, collocation polynomials take the
//! place of the series. Each turn of the loop is one such step, cut at the first
//! event inside it; the next mode follows from the rates on all surfaces that meet
//! there.

mod algebraic;
mod approach;
mod blind;
mod candidates;
mod chatter;
mod coefficients;
mod cones;
mod control;
pub(crate) mod dense;
mod depart;
mod disc;
mod drift;
mod dummy;
mod expansion;
mod field;
mod fold;
mod guide;
mod halt;
mod hidden;
mod impact;
mod implicit;
mod judge;
mod jump;
mod kick;
mod layout;
mod lead;
#[cfg(test)]
mod lead_tests;
mod meeting;
mod mend;
mod merge;
mod mode;
mod observer;
mod order;
mod persist;
mod pieces;
mod pivot;
mod psi;
mod radau;
mod rank;
mod rest;
pub(crate) mod roots;
mod rounding;
mod select;
pub(crate) mod series;
mod set_out;
mod settings;
mod several;
mod share;
mod sight;
mod singular;
mod sliding;
mod state;
mod status;
mod step;
mod stiffness;
mod surfaces;
mod system;
#[cfg(test)]
mod tests;
mod turn;
mod unseen;
mod window;
pub(crate) mod zeno;

use std::time::Instant;

pub use approach::{Approach, Visit};
use coefficients::Coefficients;
use dense::Dense;
pub use dense::Polynomials;
pub use guide::{Guide, Next, Standing};
pub use hidden::{Decision, SlidingMode};
use jump::{Jumps, Met};
pub use kick::{KickSize, Kicks};
use mode::Mode;
pub use observer::{Event, Observer, Segment};
use pieces::Pieces;
use roots::RootFinder;
pub use select::{Candidate, MAX_NAMED};
pub use settings::Settings;
use state::State;
pub use status::{Coefficient, Function, Note, Stats, Status};
use stiffness::Stiffness;
pub use system::{
    Affine, Block, Effect, Guard, Impact, Input, Law, Partials, Rates, Reset, Role, Smooth,
    Surface, SwitchedSystem,
};
use unseen::Unseen;

/// Where a switch stands relative to its surface ψ = 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Side {
    /// ψ < 0, α = 0.
    Minus,
    /// ψ = 0 and stays so; α is what keeps it there.
    Slide,
    /// ψ > 0, α = 1.
    Plus,
}

impl Side {
    /// -1, 0 or 1.
    pub fn sign(self) -> f64 {
        match self {
            Side::Minus => -1.0,
            Side::Slide => 0.0,
            Side::Plus => 1.0,
        }
    }

    /// The side of a value of ψ; zero belongs to `Plus`.
    pub fn of(value: f64) -> Side {
        if value < 0.0 { Side::Minus } else { Side::Plus }
    }
}

/// The end of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Why it ended.
    pub status: Status,
    /// When.
    pub time: f64,
    /// Where.
    pub x: Vec<f64>,
    /// The last mode.
    pub sides: Vec<Side>,
    /// α of the last mode.
    pub alpha: Vec<f64>,
    /// Mean size of the terms of each rate: times ε and the length of the run, what rounding may
    /// have done to a state that cancellation holds in place.
    pub activity: Vec<f64>,
    /// What rounding may have moved each state by, through the times of events.
    pub moved: Vec<f64>,
    /// Largest |ψ| seen on a sliding surface, relative to the size of its terms.
    pub drift: f64,
    /// Largest ‖x' - f‖ h at the end of a step, relative to the tolerance's scale.
    pub defect: f64,
    /// Largest residual of the complementarity problems of contacts, relative to the size of their rates.
    pub complementarity: f64,
    /// What it went on from although it could not be sure.
    pub notes: Vec<Note>,
    /// Surfaces with another field behind them that came close, in order of time.
    pub approaches: Vec<Approach>,
    /// Counts.
    pub stats: Stats,
}

/// Runs a system, keeping the functions it has met from one run to the next.
pub struct Simulator<'s, S> {
    system: &'s S,
    settings: Settings,
    order: usize,
    mode: Mode,
    /// Switches whose rates the α of a switch may occur in.
    coupled_by: Vec<Vec<usize>>,
    pieces: Pieces,
    roots: RootFinder,
    stiffness: Stiffness,
    jumps: Jumps,
    coefficients: Coefficients,
    unseen: Unseen,
    /// Memory that one run leaves to the next.
    state: State,
}

/// Events in a row without progress in time that count as an accumulation.
const MAX_STALLED: usize = 100;

impl<'s, S: SwitchedSystem> Simulator<'s, S> {
    /// A simulator without any mode yet.
    pub fn new(system: &'s S, settings: Settings) -> Self {
        let order = settings.series_order();
        let mut coupled_by = vec![Vec::new(); system.n_switches()];
        for rate in 0..system.n_switches() {
            for &alpha in system.couplings(rate) {
                coupled_by[alpha].push(rate);
            }
        }
        Simulator {
            system,
            order,
            stiffness: Stiffness::new(settings.local_tolerance()),
            settings,
            mode: Mode::new(system, order),
            coupled_by,
            pieces: Pieces::new(system),
            roots: RootFinder::new(order.max(stiffness::MOST_NODES)),
            jumps: Jumps::default(),
            coefficients: Coefficients::of(system),
            unseen: Unseen::default(),
            state: State::default(),
        }
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Order of the Taylor series.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Order of the implicit method that takes over where a mode is stiff.
    pub fn implicit_order(&self) -> usize {
        self.stiffness.order()
    }

    /// Calls `entry(row, column, value)` for every ∂f_row/∂x_column that is not structurally zero, at
    /// a point of a mode; α of switches that do not slide is that of their side.
    pub fn jacobian(
        &mut self,
        t: f64,
        x: &[f64],
        sides: &[Side],
        alpha: &[f64],
        entry: impl FnMut(usize, usize, f64),
    ) {
        self.mode.enter(self.system, sides);
        self.mode.set(t, x, alpha);
        self.mode.jacobian(self.system, entry);
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut impl Observer) -> Outcome {
        let limit = self.settings.time_limit;
        let deadline = limit.and_then(|limit| Instant::now().checked_add(limit));
        let known = self.mode.n_functions();
        let mut state = std::mem::take(&mut self.state);
        state.begin(t0, x0, self.system.n_switches());
        state.deadline = deadline;
        self.stiffness.reset();
        let (mut drift, mut defect) = (0.0, 0.0);
        let mut events = zeno::Events::default();
        let mut chatter = chatter::Chatter::default();
        // The mode before an accumulation of events, and where it ends.
        let mut limit: Option<(Box<[Side]>, f64)> = None;
        let started_at = self.start(&mut state, t1 - t0);
        if started_at.is_ok() && !self.jumps.fired.is_empty() {
            state.stats.events += 1;
            observer.event(&Event {
                time: state.t,
                x: &state.x,
                before: self.jumps.before(&state.x),
                jumps: &self.jumps.fired,
                decisions: &[],
                from: &state.sides,
                to: &state.sides,
                accumulates: false,
            });
        }
        state.begun = true;
        let status = match started_at {
            Err(status) => status,
            Ok(()) => loop {
                if !state.pending.is_empty() {
                    self.look_behind(&mut state);
                }
                if state.t >= t1 {
                    break Status::Solved;
                }
                if let Some(status) = self.limit(&mut state) {
                    break match status {
                        Status::EventLimit => chatter.at_limit(t1 - state.t),
                        status => status,
                    };
                }

                // Find the solution in the current mode and cut it at its first event.
                self.mode.enter(self.system, &state.sides);
                let goal = limit.as_ref().map_or(t1, |(_, end)| *end);
                let goal = goal.min(self.pieces.until);
                let kick = self.next_kick(state.t);
                let goal = goal.min(kick);
                let mut step = match self.step(&mut state, goal, t1) {
                    Ok(step) => step,
                    Err(status) => break status,
                };
                defect = f64::max(defect, step.defect);
                if !step.implicit {
                    self.mode.close_window(&mut state);
                }
                state.window = 0.0;

                // Advance, projecting the drift off the sliding surfaces.
                let start = state.t;
                if step.reaches_end {
                    (state.t, state.t_low) = (goal, 0.0);
                } else {
                    state.advance(step.length);
                }
                if !step.departs {
                    drift = f64::max(drift, self.mode.project(self.system, &mut state));
                }
                state.record(step.length);
                state.stats.steps += 1;
                // What sets off is expanded in the mode in which it sticks, and slips.
                let sides = match step.departs {
                    true => &state.sides,
                    false => &self.mode.sides,
                };
                let segment = Segment {
                    start,
                    length: step.length,
                    until: state.t,
                    sides,
                    end: &state.x,
                    dense: &self.dense(step.implicit),
                };
                if step.length > 0.0 && observer.segment(&segment).is_break() {
                    break Status::Stopped;
                }
                self.look_again(&mut state);
                if let Some(status) = step.ends {
                    break status;
                }
                if chatter.is_last() {
                    let mut x = state.x.clone();
                    self.dense(step.implicit)
                        .states_at(0.5 * step.length, &mut x);
                    self.measure(&mut chatter, &state, (start + 0.5 * step.length, &x));
                }

                // Where events accumulate, the mode changes at their limit.
                if let Some((from, _)) =
                    limit.take_if(|_| step.reaches_end || !step.triggers.is_empty())
                {
                    if step.reaches_end {
                        self.repay(&mut state);
                    }
                    observer.event(&Event {
                        time: state.t,
                        x: &state.x,
                        before: &state.x,
                        jumps: &[],
                        decisions: &[],
                        from: &from,
                        to: &state.sides,
                        accumulates: true,
                    });
                }

                // At an event, the rates on all surfaces that meet decide the next mode.
                self.disarm(&mut state);
                let passes = state.t >= self.pieces.until && state.t < t1;
                let kicked = state.t >= kick && state.t < t1;
                if step.triggers.is_empty() && !passes && !kicked {
                    continue;
                }
                if !step.triggers.is_empty() {
                    if !passes {
                        self.tell_apart(&mut state, &mut step.triggers, t1);
                    }
                    self.stiffness.after_event();
                    if !step.implicit && !passes {
                        self.mode
                            .open_window(&mut state, step.length, &step.triggers);
                    }
                    state.count_event(step.length, t1 - t0);
                    if state.stalled > MAX_STALLED {
                        break Status::Accumulation;
                    }
                }
                let from = state.sides.clone();
                state.decisions.clear();
                let changed = if self.has_jumps() {
                    let met = match passes {
                        true => Met::Breakpoint(step.triggers),
                        false => Met::Surfaces(step.triggers),
                    };
                    self.jump_and_change(&mut state, met, t1)
                } else if passes {
                    self.pass_breakpoint(&mut state, &step.triggers, t1)
                } else if step.triggers.is_empty() {
                    Ok(())
                } else {
                    self.change(&mut state, &step.triggers, t1)
                };
                let changed = match changed {
                    Ok(()) if kicked => self.kick(&mut state, kick, t1),
                    changed => changed,
                };
                if let Err(status) = changed {
                    break status;
                }
                state.fold = None;
                let jumped = !self.jumps.fired.is_empty();
                let folded = state.decisions.iter().any(|decision| decision.folds);
                if from == state.sides && !jumped && !folded {
                    continue;
                }
                self.stiffness.after_event();
                state.stats.events += 1;
                let slides = |sides: &[Side]| sides.iter().filter(|s| **s == Side::Slide).count();
                let more = slides(&state.sides) > slides(&from);
                if from != state.sides {
                    events.record(state.t, &from);
                    chatter.record(state.t, &state.x, &from);
                    if let Err(status) = self.average(&mut chatter, &mut state, t1) {
                        break status;
                    }
                }
                let end = match jumped {
                    true => self.jumps.limit(&mut state),
                    false => events.limit(&state.sides),
                };
                let end = end.filter(|end| more && *end < t1);
                let waits = end.filter(|end| *end > state.t);
                if jumped || waits.is_none() {
                    observer.event(&Event {
                        time: state.t,
                        x: &state.x,
                        before: self.jumps.before(&state.x),
                        jumps: &self.jumps.fired,
                        decisions: &state.decisions,
                        from: &from,
                        to: if waits.is_some() { &from } else { &state.sides },
                        accumulates: end.is_some() && waits.is_none(),
                    });
                    self.displace(&mut state, step.length, observer);
                }
                let undisturbed = t1.min(self.pieces.until).min(self.next_kick(state.t));
                if let Some(status) = self.chatters(&chatter, &state, undisturbed) {
                    if !self.settings.averages {
                        break status;
                    }
                    chatter.look_at_last();
                }
                limit = waits.map(|end| (from, end));
            },
        };
        state.stats.functions = self.mode.n_functions() - known;
        let by_time = |a: &Approach, b: &Approach| a.time.total_cmp(&b.time);
        state.approaches.sort_by(by_time);
        let elapsed = if state.t > t0 { state.t - t0 } else { 1.0 };
        let outcome = Outcome {
            status,
            time: state.t,
            x: state.x.clone(),
            sides: state.sides.to_vec(),
            alpha: state.alpha.clone(),
            activity: state.work.iter().map(|work| work / elapsed).collect(),
            moved: state.moved.iter().map(|squares| squares.sqrt()).collect(),
            drift,
            defect,
            complementarity: state.complementarity,
            notes: std::mem::take(&mut state.notes),
            approaches: std::mem::take(&mut state.approaches),
            stats: state.stats,
        };
        self.state = state;
        outcome
    }

    /// Lets an observer move the state by roundings: of each x, and of the terms of its rate over the last step.
    fn displace(&self, state: &mut State, length: f64, observer: &mut impl Observer) {
        if !observer.displaces() {
            return;
        }
        let before = self.jumps.before(&state.x);
        // What laws count is whole, and exact.
        let jumps = |i: usize| state.x[i] != before[i] && state.x[i].fract() != 0.0;
        let moves = |i: usize| self.mode.x_series(i)[1] != 0.0 || jumps(i);
        let rests = |i: usize| self.mode.is_algebraic[i] || !moves(i);
        let size = |i: usize| state.x[i].abs().max(state.activity[i] * length);
        let rounding = |i: usize| {
            if rests(i) {
                0.0
            } else {
                f64::EPSILON * size(i)
            }
        };
        let roundings: Vec<f64> = (0..state.x.len()).map(rounding).collect();
        observer.displace(&mut state.x, &roundings);
    }

    fn limit(&self, state: &mut State) -> Option<Status> {
        if state.stats.steps >= self.settings.max_steps {
            return Some(Status::StepLimit);
        }
        if state.stats.events >= self.settings.max_events {
            return Some(Status::EventLimit);
        }
        // A look at the clock costs as much as a small step; functions may take long to compile.
        let known = self.mode.n_functions();
        let compiled = std::mem::replace(&mut state.functions, known) < known;
        let due = compiled || state.stats.steps.is_multiple_of(16);
        (due && state.is_late()).then_some(Status::TimeLimit)
    }

    /// The polynomials of the last step.
    fn dense(&self, implicit: bool) -> Dense<'_> {
        match self.stiffness.method() {
            Some(radau) if implicit => Dense::Collocation(&self.mode, radau),
            _ => Dense::Taylor(&self.mode),
        }
    }

    /// A surface left tangentially is watched again once it is outside its band.
    fn disarm(&mut self, state: &mut State) {
        let left = |i: usize| state.armed[i] && state.sides[i] != Side::Slide;
        if !(0..state.armed.len()).any(left) {
            return;
        }
        self.mode.set(state.t, &state.x, &state.alpha);
        for i in 0..state.armed.len() {
            if state.armed[i] && state.sides[i] != Side::Slide {
                state.armed[i] = self.mode.is_near(i, state);
            }
        }
    }
}
