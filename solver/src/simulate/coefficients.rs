//! Coefficients of contacts that last: a friction that turns negative, or a restitution that leaves [0, 1], ends the run
//! where it does.
//!
//! A coefficient is a function of time and states, which no switch looks at. While its contact is closed it is expanded
//! along each step, the step is no longer than its series holds, and the first root of what must not be negative cuts it.

use super::dense::Dense;
use super::layout::Memory;
use super::mode::Mode;
use super::roots::RootFinder;
use super::state::State;
use super::system::{Effect, Guard, Impact, Input};
use super::{Coefficient, Side, Status, SwitchedSystem, series};
use crate::tape::{self, Recurrences};

/// Below zero by less than this is rounding: coefficients have no unit, and one is large.
const ROUNDING: f64 = 1e-12;

/// Shares of a step at which a series is compared with its function.
const LOOKS: [f64; 4] = [0.23, 0.51, 0.77, 1.0];

/// A step is shortened by this as long as a series has not ended within it, and so often at most.
const SHORTER: f64 = 0.8;
const MAX_SHORTER: usize = 200;

/// The coefficients of all contacts that are no numbers.
pub(super) struct Coefficients {
    watched: Vec<Watched>,
    registers: Vec<f64>,
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
    pub(super) fn of(system: &impl SwitchedSystem) -> Self {
        let varies = |input: &Input| !matches!(input, Input::Number(_));
        let laws = system.laws().iter();
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
        }
    }

    /// Expands the coefficients of closed contacts along the states, and returns the part of a step h in which their
    /// series hold.
    pub(super) fn expand(&mut self, mode: &mut Mode, tolerance: f64, mut h: f64) -> f64 {
        for watched in &mut self.watched {
            if mode.sides[watched.switch] != Side::Slide {
                continue;
            }
            watched.expand(mode);
            let order = mode.order;
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

    /// True where the series are the functions in a step of this length, up to `allowed`. The last look is at its end.
    pub(super) fn agree(
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
                Dense::Taylor(mode).states_at(tau, &mut state.next);
                Dense::Taylor(mode).alphas_at(tau, &mut state.next_alpha);
                mode.set(state.t + tau, &state.next, &state.next_alpha);
                let tape = &watched.impact.numbers;
                let registers = &mut self.registers;
                registers.resize(tape.n_registers().max(watched.slots.len()), 0.0);
                for (register, &slot) in registers.iter_mut().zip(&watched.slots) {
                    *register = mode.memory.values[slot];
                }
                tape.run(registers);
                let rows = watched.rows(&mode.memory, mode.order);
                let mut pairs = rows.zip(tape.results(registers));
                if !pairs.all(|(c, value)| (series::value(c, tau) - value).abs() <= allowed) {
                    return false;
                }
            }
        }
        true
    }

    /// When a coefficient of a closed contact first leaves its range within a step of this length, and how the run ends
    /// there.
    pub(super) fn leave(
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
            let kinds = [Coefficient::Restitution, Coefficient::Friction];
            let rows = watched.rows(&mode.memory, mode.order).zip(kinds);
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
        let Mode {
            memory,
            sides,
            order,
            ..
        } = mode;
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
            tape::fill_all(steps, rows, weights, *order + 1, *stride);
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
    use crate::simulate::roots::RootFinder;

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
