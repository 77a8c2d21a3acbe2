//! What functions do within a step that the series at its start do not know of.
//!
//! Far from its middle a narrow pulse of a state, as exp(-((s - c)/w)²), vanishes with all its derivatives: the series
//! of a step that goes over it are those of zero, and the probes of the step see nothing. Which functions may hide
//! something is known from their own series (`tape/enclosures/hiding.rs`), or, where there are none, from enclosures. Then the step
//! is divided, the widest part first, until every enclosed function is tame over its part (`tape/enclosures/tame.rs`) or moves by
//! less than the tolerance, and in the middle of each part the functions are compared with the polynomials of the step.
//! What is still untamed when the parts are used up is told.

use crate::event::state::State;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::series;
use crate::hybrid::{Function, Note, Side};
use crate::integrate::probes::Comparison;
use crate::integrate::radau::Radau;
use crate::tape::{Ball, Tame};

/// Parts of a step that are enclosed at most.
const MAX_PARTS: usize = 1000;

/// Parts narrower than this share of a step are not divided.
const NARROWEST: f64 = 1e-13;

/// A function that may hide something: the rates of a block, or ψ of a switch.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Suspect {
    Rates(usize),
    Surface(usize),
}

/// Memory for looks at the parts of a step.
#[derive(Default)]
pub(crate) struct Unseen {
    suspects: Vec<Suspect>,
    /// Polynomials of t, x and α, one row each, in the order of the values of a point; empty for what does not move.
    rows: Vec<Vec<f64>>,
    registers: Vec<Tame>,
    /// From where to where in the step.
    parts: Vec<(f64, f64)>,
    /// The part to look at next.
    at: usize,
    length: f64,
    /// What is not tame in a part that is not divided any more.
    untamed: Option<Suspect>,
}

impl Unseen {
    /// True where the series of a step of this length are what they stand for between the probes, too, up to `allowed`,
    /// as far as functions are under suspicion; `sizes` are what differences of states are relative to. Leaves any point
    /// behind.
    pub(crate) fn vouches(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        length: f64,
        allowed: f64,
        sizes: &[f64],
    ) -> bool {
        if self.suspects.is_empty() {
            return true;
        }
        self.copy(Dense::Taylor(mode));
        self.begin(length);
        let margin = allowed / length;
        while let Some(tau) = self.next(mode, state.point.t, |i| margin * sizes[i]) {
            let mut step = Comparison {
                mode,
                scales: &state.scales,
                bands: &state.bands,
                length,
                allowed,
            };
            if !step.agrees_at(state.point.t, tau, &mut state.trial, sizes) {
                return false;
            }
        }
        self.tell(mode, state);
        true
    }

    /// Begins to look at the polynomials of an implicit step.
    pub(crate) fn begin_implicit(&mut self, mode: &mut Mode, radau: &Radau, length: f64) {
        self.suspect_all(mode);
        if !self.suspects.is_empty() {
            self.copy(Dense::Collocation(mode, radau, &[]));
        }
        self.begin(length);
    }

    /// Where there are no series, any function of those kinds may hide something.
    pub(crate) fn suspect_all(&mut self, mode: &mut Mode) {
        self.suspects.clear();
        let blocks = mode.field.list().hiding.iter().map(|(block, _)| *block);
        self.suspects.extend(blocks.map(Suspect::Rates));
        let surfaces = mode.monitored.switches.iter().copied();
        self.suspects.extend(surfaces.map(Suspect::Surface));
        self.suspects.dedup();
    }

    /// Looks which functions may hide something from their Taylor series.
    pub(crate) fn suspect(&mut self, mode: &Mode, length: f64) {
        self.suspects.clear();
        // Friction along w/|w| has a divisor that falls to zero at rest, and its own steps towards that.
        if mode.planes.slip(&mode.system, &mode.sides) {
            return;
        }
        let (memory, n) = (&mode.memory, mode.memory.order);
        for (block, step) in &mode.field.listed().hiding {
            let suspect = Suspect::Rates(*block);
            if self.suspects.last() != Some(&suspect)
                && step.may_hide(&memory.rows, length, n, memory.stride)
            {
                self.suspects.push(suspect);
            }
        }
        for &i in mode.monitored.switches.iter().chain(&mode.sliding) {
            if mode.surfaces.now(i).may_hide(memory, length, n) {
                self.suspects.push(Suspect::Surface(i));
            }
        }
    }

    /// Takes the polynomials of a step.
    fn copy(&mut self, dense: Dense) {
        let mode = dense.mode();
        self.rows.resize(mode.memory.values.len(), Vec::new());
        self.rows.iter_mut().for_each(Vec::clear);
        for i in 0..mode.n {
            self.rows[1 + i].extend_from_slice(dense.x(i));
        }
        for &i in &mode.sliding {
            self.rows[1 + mode.n + i].extend_from_slice(dense.alpha(i));
        }
    }

    fn begin(&mut self, length: f64) {
        self.parts.clear();
        self.parts.push((0.0, length));
        (self.at, self.length, self.untamed) = (0, length, None);
    }

    /// The next instant of a step from `t` at which its functions have to be compared with its polynomials; none once
    /// these are known to stand for the functions wherever they can be. A rate that moves by less than `margin` of its
    /// state over a part is known there.
    pub(crate) fn next(
        &mut self,
        mode: &Mode,
        t: f64,
        margin: impl Fn(usize) -> f64,
    ) -> Option<f64> {
        while self.at < self.parts.len() && !self.suspects.is_empty() {
            let (from, to) = self.parts[self.at];
            let middle = 0.5 * (from + to);
            let untamed = self.untamed_in(mode, t, middle, to - middle, &margin);
            let is_whole = self.at == 0;
            self.at += 1;
            let Some(suspect) = untamed else {
                // The probes have looked at the whole.
                if is_whole {
                    continue;
                }
                return Some(middle);
            };
            if to - from > NARROWEST * self.length {
                if self.parts.len() < MAX_PARTS {
                    self.parts.extend([(from, middle), (middle, to)]);
                } else {
                    self.untamed = Some(suspect);
                }
            }
            return Some(middle);
        }
        None
    }

    /// A function that is not tame within a radius of an instant of the step.
    fn untamed_in(
        &mut self,
        mode: &Mode,
        t: f64,
        tau: f64,
        radius: f64,
        margin: &impl Fn(usize) -> f64,
    ) -> Option<Suspect> {
        let Unseen {
            suspects,
            rows,
            registers,
            ..
        } = self;
        let input = |slot: usize| match rows.get(slot) {
            _ if slot == 0 => Ball::new(t + tau, radius),
            Some(row) if !row.is_empty() => {
                Ball::new(series::value(row, tau), series::motion(row, tau, radius))
            }
            _ => Ball::new(mode.memory.values[slot], 0.0),
        };
        let mut all = suspects.iter().copied();
        all.find(|&suspect| match suspect {
            Suspect::Rates(block) => {
                let mut is_known = true;
                mode.field.examine(block, input, registers, |state, rate| {
                    is_known &= rate.is_tame || rate.ball.radius <= margin(state);
                });
                !is_known
            }
            Suspect::Surface(i) => {
                let psi = mode.surfaces.now(i).enclose(input, registers);
                let is_off = |psi: &Tame| {
                    let side = Side::of(psi.ball.middle);
                    psi.ball.excludes_zero() && side == mode.sides[i]
                };
                psi.is_some_and(|psi| !(psi.is_tame || is_off(&psi)))
            }
        })
    }

    /// Tells of what could not be tamed.
    pub(crate) fn tell(&self, mode: &Mode, state: &mut State) {
        let Some(suspect) = self.untamed else {
            return;
        };
        let function = match suspect {
            Suspect::Rates(block) => Function::Rate(mode.field.states_of(block)[0]),
            Suspect::Surface(i) => Function::Surface(i),
        };
        state.report.note(Note::Unseen {
            time: state.point.t,
            function,
        });
    }
}
