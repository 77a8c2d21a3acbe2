//! Stabilization of closed contacts: what a step has left of gaps and rates, taken away in the metric of the mass.
//!
//! With the impulses δ of J P δ = J v, P = M⁻¹Jᵀ, the rates of contacts that are closed and the slip velocities of those
//! that stick are zero; with those of J P δ = g their gaps are:
//!
//! v⁺ = v - P δ,   q⁺ = q - ∂q'/∂v P δ,
//!
//! because the rate of a gap is ∇g·q'. This is the shortest way in the metric of M but for friction, which P contains
//! where a contact slips. Sizes of states are no measure here: what has always rested at zero is as small as its
//! rounding, and measured by that a body may turn by any angle for a gap of 1e-17.

use super::rows::Rows;
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::sliding::Sliding;
use crate::hybrid::point::Point;
use crate::linalg::redundancy::eliminate;

/// Memory for the corrections of closed contacts.
#[derive(Default)]
pub(crate) struct Stabilization {
    /// Switches whose rates interact with those of contacts and their friction alone.
    rates: Vec<bool>,
    rows: Vec<usize>,
    matrix: Vec<f64>,
    impulses: Vec<f64>,
    /// Changes of velocities, and the states that have one.
    push: Vec<f64>,
    pushed: Vec<usize>,
    /// The blocks of positions.
    blocks: Vec<usize>,
}

/// What is zero for a closed contact.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Constraint {
    Gap,
    Rate,
}

impl Constraint {
    /// That of switches which stand for a derivative of this order, or for their highest.
    pub(crate) fn of(order: Option<usize>) -> Self {
        match order {
            Some(_) => Constraint::Gap,
            None => Constraint::Rate,
        }
    }
}

impl Stabilization {
    /// Finds what is stabilized in the present mode.
    pub(crate) fn find(&mut self, mode: &Mode) {
        self.rates.clear();
        self.rates.resize(mode.sides.len(), false);
        for component in mode.equations.components() {
            let is_of_contact = |&i: &usize| {
                mode.system.switches[i].is_contact() || mode.system.slip_of(i).is_some()
            };
            let alone = component.iter().all(is_of_contact);
            component.iter().for_each(|&i| self.rates[i] = alone);
        }
    }

    /// Whether the constraint of a sliding switch is stabilized: gaps are a lower derivative of what it stands for, and
    /// rates the highest one.
    pub(crate) fn takes(&self, mode: &Mode, switch: usize, constraint: Constraint) -> bool {
        match constraint {
            Constraint::Gap => mode.system.switches[switch].is_contact(),
            Constraint::Rate => self.rates[switch],
        }
    }

    /// Closes the gaps of closed contacts, and places the states that they depend on; or stops closed contacts, and what
    /// sticks. The largest gap or rate before, relative to the size of its terms.
    pub(crate) fn correct(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        placed: &mut [bool],
        constraint: Constraint,
    ) -> f64 {
        let mut sliding = mode.sliding.iter();
        if !sliding.any(|&i| self.takes(mode, i, constraint)) {
            return 0.0;
        }
        mode.move_to(&state.point);
        for at in 0..mode.sliding.len() {
            let i = mode.sliding[at];
            // Forces have no friction in them where α_t is ½, and those of friction do not vanish where α_n is 0.
            let alpha = match mode.system.slip_of(i) {
                Some(_) => 0.5,
                None if mode.system.switches[i].is_contact() => 0.0,
                None => continue,
            };
            mode.memory.values[1 + mode.n + i] = alpha;
        }
        let equations: Sliding = std::mem::take(&mut mode.equations);
        self.push.resize(mode.n, 0.0);
        let mut worst = 0.0_f64;
        for component in equations.components() {
            let mut rows = std::mem::take(&mut self.rows);
            rows.clear();
            let of_component = component.iter().copied();
            rows.extend(of_component.filter(|&i| self.takes(mode, i, constraint)));
            self.rows = rows;
            if self.rows.is_empty() {
                continue;
            }
            let (found, is_off) = self.measure(mode, state, placed, constraint);
            worst = worst.max(found);
            if !is_off {
                continue;
            }
            self.find_push(mode);
            match constraint {
                Constraint::Gap => self.shift_positions(mode, &mut state.point, placed),
                Constraint::Rate => self.pushed.iter().for_each(|&j| {
                    state.point.x[j] -= std::mem::take(&mut self.push[j]);
                }),
            }
        }
        mode.equations = equations;
        worst
    }

    /// Takes note of what is left; how much in relation to the size of its terms, and whether that is more than rounding.
    fn measure(
        &mut self,
        mode: &mut Mode,
        state: &State,
        placed: &mut [bool],
        constraint: Constraint,
    ) -> (f64, bool) {
        self.impulses.clear();
        self.blocks.clear();
        let (mut worst, mut is_off) = (0.0_f64, false);
        let is_gap = constraint == Constraint::Gap;
        for &i in &self.rows {
            let highest = mode.surfaces.n_derivatives(i);
            mode.surfaces.stand_for(i, if is_gap { 0 } else { highest });
            mode.surfaces.linearize(i, &mode.memory.values);
            let psi = mode.psi(i);
            let size = mode.surfaces.weigh(i, |j| state.scales.size(j));
            is_off |= psi.abs() > f64::EPSILON * size;
            if size > 0.0 {
                worst = worst.max(psi.abs() / size);
            }
            self.impulses.push(psi);
            if is_gap {
                for &(j, _) in mode.surfaces.gradient(i) {
                    placed[j] = true;
                    self.blocks.push(mode.field.block_of(j));
                }
                mode.surfaces.stand_for(i, highest);
            }
        }
        (worst, is_off)
    }

    /// P δ.
    fn find_push(&mut self, mode: &mut Mode) {
        let Stabilization {
            rows,
            matrix,
            impulses,
            push,
            pushed,
            ..
        } = self;
        Rows::linearize(mode, rows);
        let n = rows.len();
        matrix.clear();
        matrix.resize(n * n, 0.0);
        for (row, &i) in matrix.chunks_exact_mut(n).zip(&*rows) {
            for &(state, g) in mode.surfaces.gradient(i) {
                for (by, slope) in mode.field.slopes(state) {
                    if let Ok(column) = rows.binary_search(&by) {
                        row[column] += g * slope;
                    }
                }
            }
        }
        eliminate(matrix, impulses, |at| {
            mode.system.slip_of(rows[at]).is_some()
        });
        pushed.clear();
        for (&i, impulse) in rows.iter().zip(&*impulses) {
            for &block in mode.field.of_switch(i) {
                for &state in mode.field.states_of(block) {
                    let slopes = mode.field.slopes(state).filter(|(by, _)| *by == i);
                    for (_, slope) in slopes {
                        push[state] += slope * impulse;
                        pushed.push(state);
                    }
                }
            }
        }
    }

    /// q - ∂q'/∂v P δ for the states q that gaps depend on, which are `placed`; others in their blocks stay. Clears P δ.
    fn shift_positions(&mut self, mode: &mut Mode, point: &mut Point, placed: &[bool]) {
        self.blocks.sort_unstable();
        self.blocks.dedup();
        for &block in &self.blocks {
            let values = &mode.memory.values;
            let moves = |of: usize, by: usize, value: f64| {
                if placed[of] {
                    point.x[of] -= value * self.push[by];
                }
            };
            let functions = &mut mode.library;
            mode.field.jacobian_of(functions, block, values, moves);
        }
        self.pushed.iter().for_each(|&j| self.push[j] = 0.0);
    }
}
