//! Coefficients of contacts that last: a friction that turns negative, or a restitution that leaves [0, 1], ends the run
//! where it does.
//!
//! A coefficient is a function of time and states, which no switch looks at. While its contact is closed it is expanded
//! along each step, the step is no longer than its series holds, and the first root of what must not be negative cuts it.
//!
//! A series does not know of a dip that is narrow beside its step. Therefore the step is divided, the widest part first,
//! until an enclosure of the coefficient over each part ([`Ball`]) keeps its range, or the coefficient in the middle of a
//! part is not what its series says, and the step is shortened.

use crate::event::state::State;
use crate::events::roots::RootFinder;
use crate::expansion::dense::Dense;
use crate::expansion::layout::Memory;
use crate::expansion::mode::Mode;
use crate::expansion::series;
use crate::hybrid::{Coefficient, Effect, Guard, HybridSystem, Impact, Input, Side, Status};
use crate::tape::{self, Ball, Recurrences};

/// Below zero by less than this is rounding: coefficients have no unit, and one is large.
const ROUNDING: f64 = 1e-12;

/// Shares of a step at which a series is compared with its function.
const LOOKS: [f64; 4] = [0.23, 0.51, 0.77, 1.0];

/// A step is shortened by this as long as a series has not ended within it, and so often at most.
const SHORTER: f64 = 0.8;
const MAX_SHORTER: usize = 200;

/// Parts of a step that are enclosed at most: a coefficient that stays at its bound keeps its range in none.
const MAX_PARTS: usize = 256;

/// What the rows of a contact's coefficients are.
const KINDS: [Coefficient; 2] = [Coefficient::Restitution, Coefficient::Friction];

/// The coefficients of all contacts that are no numbers.
pub(crate) struct Coefficients {
    watched: Vec<Watched>,
    registers: Vec<f64>,
    enclosing: Enclosing,
}

/// Memory for enclosures.
#[derive(Default)]
struct Enclosing {
    registers: Vec<Ball>,
    /// From where to where in the step.
    parts: Vec<(f64, f64)>,
}

/// The coefficients of one contact.
struct Watched {
    switch: usize,
    impact: Impact,
    /// Places of the inputs.
    slots: Vec<usize>,
    /// What computes their series, once it was needed.
    series: Option<Recurrences>,
}

impl Coefficients {
    pub(crate) fn of(system: &HybridSystem) -> Self {
        let varies = |input: &Input| !input.is_constant();
        let laws = system.laws.iter();
        let watched = laws.filter_map(|law| match (&law.guard, &law.effect) {
            (Guard::Strikes(switch), Effect::Impact(impact))
                if impact.inputs.iter().any(varies) =>
            {
                Some(Watched {
                    switch: *switch,
                    impact: impact.clone(),
                    slots: Vec::new(),
                    series: None,
                })
            }
            _ => None,
        });
        Coefficients {
            watched: watched.collect(),
            registers: Vec::new(),
            enclosing: Enclosing::default(),
        }
    }

    /// Expands the coefficients of closed contacts along the states, and returns the part of a step h in which their
    /// series hold.
    pub(crate) fn expand(&mut self, mode: &mut Mode, tolerance: f64, mut h: f64) -> f64 {
        for watched in &mut self.watched {
            if mode.sides[watched.switch] != Side::Slide {
                continue;
            }
            watched.expand(mode);
            let order = mode.memory.order;
            for c in watched.rows(&mode.memory, order) {
                let last = |h: f64| (order - 1..=order).map(move |k| c[k].abs() * h.powi(k as i32));
                for _ in 0..MAX_SHORTER {
                    if last(h).fold(0.0, f64::max) <= tolerance {
                        break;
                    }
                    h *= SHORTER;
                }
            }
        }
        h
    }

    /// True where the series are the functions in a step of this length, up to `allowed`, or both keep their range. The
    /// last look is at its end.
    pub(crate) fn agree(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        length: f64,
        allowed: f64,
    ) -> bool {
        for watched in &mut self.watched {
            if mode.sides[watched.switch] != Side::Slide {
                continue;
            }
            for share in LOOKS {
                let tau = share * length;
                Dense::Taylor(mode).states_at(tau, &mut state.trial.x);
                Dense::Taylor(mode).alphas_at(tau, &mut state.trial.alpha);
                mode.memory
                    .set(state.point.t + tau, &state.trial.x, &state.trial.alpha);
                let tape = &watched.impact.numbers;
                let registers = &mut self.registers;
                registers.resize(tape.n_registers().max(watched.slots.len()), 0.0);
                for (register, &slot) in registers.iter_mut().zip(&watched.slots) {
                    *register = mode.memory.values[slot];
                }
                tape.run(registers);
                let rows = watched.rows(&mode.memory, mode.memory.order);
                let mut pairs = rows.zip(tape.results(registers));
                if !pairs.all(|(c, value)| (series::value(c, tau) - value).abs() <= allowed) {
                    return false;
                }
            }
            if !watched.agrees_outside(mode, state.point.t, length, allowed, &mut self.enclosing) {
                return false;
            }
        }
        true
    }

    /// When a coefficient of a closed contact first leaves its range within a step of this length, and how the run ends
    /// there.
    pub(crate) fn leave(
        &self,
        roots: &mut RootFinder,
        mode: &Mode,
        length: f64,
    ) -> Option<(f64, Status)> {
        let mut first: Option<(f64, Status)> = None;
        for watched in &self.watched {
            if mode.sides[watched.switch] != Side::Slide {
                continue;
            }
            let rows = watched.rows(&mode.memory, mode.memory.order).zip(KINDS);
            let ranges = rows.flat_map(|(c, kind)| {
                let above = (kind == Coefficient::Restitution).then_some((c, kind, -1.0, 1.0));
                [Some((c, kind, 1.0, 0.0)), above].into_iter().flatten()
            });
            for (c, kind, sign, bound) in ranges {
                let reach = first.as_ref().map_or(length, |(tau, _)| *tau);
                // sign (c - bound) must not be negative.
                let mut inside: Vec<f64> = c.iter().map(|c| sign * c).collect();
                inside[0] -= sign * bound;
                let Some(tau) = first_below(roots, &inside, reach) else {
                    continue;
                };
                let value = series::value(c, tau);
                let status = Status::Coefficient {
                    switch: watched.switch,
                    coefficient: kind,
                    value,
                };
                first = Some((tau, status));
            }
        }
        first
    }
}

impl Watched {
    /// Expands along the states of the present mode.
    fn expand(&mut self, mode: &mut Mode) {
        let Mode { memory, sides, .. } = mode;
        let order = memory.order;
        if self.series.is_none() {
            let inputs = &self.impact.inputs;
            self.slots = inputs.iter().map(|&input| memory.slot(input)).collect();
            let rows: Vec<_> = inputs.iter().map(|&input| memory.row(input)).collect();
            let base = memory.rows.len();
            let series = Recurrences::new(&self.impact.numbers, &rows, base, memory.stride);
            memory.grow((series.end - base) / memory.stride);
            self.series = Some(series);
        }
        // α that do not slide are numbers, which rates know without a row.
        for &input in &self.impact.inputs {
            if let Input::Alpha(switch) = input
                && sides[switch] != Side::Slide
            {
                let row = memory.alpha(switch);
                memory.rows[row..row + memory.stride].fill(0.0);
                memory.rows[row] = 0.5 + 0.5 * sides[switch].sign();
            }
        }
        let Memory {
            rows,
            weights,
            stride,
            ..
        } = memory;
        let series = self.series.iter();
        for steps in series.flat_map(|series| [&series.timed, &series.moving]) {
            tape::fill_all(steps, rows, weights, order + 1, *stride);
        }
    }

    /// Whether the coefficients are their series wherever in a step they are not known to keep their range.
    fn agrees_outside(
        &self,
        mode: &Mode,
        t: f64,
        length: f64,
        allowed: f64,
        work: &mut Enclosing,
    ) -> bool {
        let tape = &self.impact.numbers;
        work.parts.clear();
        work.parts.push((0.0, length));
        let mut at = 0;
        while at < work.parts.len().min(MAX_PARTS) {
            let (from, to) = work.parts[at];
            at += 1;
            let middle = 0.5 * (from + to);
            self.enclose(mode, t, middle, to - middle, &mut work.registers);
            tape.run(&mut work.registers);
            let rows = self.rows(&mode.memory, mode.memory.order).zip(KINDS);
            let mut keep_range = true;
            for (ball, (c, kind)) in tape.results(&work.registers).zip(rows) {
                let is_series = (series::value(c, middle) - ball.middle).abs() <= allowed;
                if !is_series {
                    return false;
                }
                let is_below = kind == Coefficient::Friction || ball.high() <= 1.0 + ROUNDING;
                keep_range &= is_below && ball.low() >= -ROUNDING;
            }
            if !keep_range {
                work.parts.extend([(from, middle), (middle, to)]);
            }
        }
        true
    }

    /// What the inputs are within a radius of an instant of the step.
    fn enclose(&self, mode: &Mode, t: f64, tau: f64, radius: f64, inputs: &mut Vec<Ball>) {
        let along = |c: &[f64]| {
            let slope = series::steepest(c, tau + radius);
            Ball::new(series::value(c, tau), slope * radius)
        };
        let needed = self.impact.numbers.n_registers().max(self.slots.len());
        inputs.resize(needed, Ball::new(0.0, 0.0));
        let slots = self.impact.inputs.iter().zip(&self.slots);
        for (ball, (&input, &slot)) in inputs.iter_mut().zip(slots) {
            *ball = match input {
                Input::Time => Ball::new(t + tau, radius),
                Input::State(state) => along(mode.x_series(state)),
                Input::Alpha(switch) if mode.sides[switch] == Side::Slide => {
                    along(mode.alpha_series(switch))
                }
                Input::Alpha(_)
                | Input::Coefficient(_)
                | Input::Parameter(_)
                | Input::Number(_) => Ball::new(mode.memory.values[slot], 0.0),
            };
        }
    }

    /// The series of restitution and friction.
    fn rows<'m>(&self, memory: &'m Memory, order: usize) -> impl Iterator<Item = &'m [f64]> {
        let outputs = self.series.iter().flat_map(|series| series.outputs.clone());
        outputs.map(move |row| &memory.rows[row..=row + order])
    }
}

/// Where Σ c_k τᵏ first falls below zero in [0, h], but for rounding.
fn first_below(roots: &mut RootFinder, c: &[f64], h: f64) -> Option<f64> {
    let start = c[0] + ROUNDING;
    if start < 0.0 {
        return Some(0.0);
    }
    if h <= 0.0 {
        return None;
    }
    let tau = roots.first(start, &c[1..], h, 0.0)?.tau;
    // Back to where it is zero itself.
    let back = tau - series::value(c, tau) / series::slope(c, tau);
    Some(if (0.0..=tau).contains(&back) {
        back
    } else {
        tau
    })
}

#[cfg(test)]
mod tests {
    use super::first_below;
    use crate::events::roots::RootFinder;

    #[test]
    fn what_touches_zero_is_not_below_it() {
        let mut roots = RootFinder::new(4);
        let mut below = |c: &[f64], h: f64| first_below(&mut roots, c, h);
        assert_eq!(below(&[0.3, -0.1], 2.9), None);
        let tau = below(&[0.3, -0.1], 4.0).unwrap();
        assert!((tau - 3.0).abs() <= 1e-14, "{tau}");
        // (τ - 1)², and what is zero for good.
        assert_eq!(below(&[1.0, -2.0, 1.0], 3.0), None);
        assert_eq!(below(&[0.0, 0.0, 0.0], 3.0), None);
        // Below at once, and from zero on.
        assert_eq!(below(&[-0.1, 1.0], 3.0), Some(0.0));
        assert!(below(&[0.0, -1.0], 3.0).unwrap() <= 1e-11);
        // τ - τ² comes back to zero at 1.
        let tau = below(&[0.0, 1.0, -1.0], 3.0).unwrap();
        assert!((tau - 1.0).abs() <= 1e-11, "{tau}");
    }
}
