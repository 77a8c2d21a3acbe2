//! What a step has left of gaps and rates of closed contacts, taken away in the metric of the mass.
//!
//! With the impulses δ of J P δ = J v, P = M⁻¹Jᵀ, the rates of contacts that are closed and the slip velocities of those
//! that stick are zero; with those of J P δ = g their gaps are:
//!
//! v⁺ = v - P δ,   q⁺ = q - ∂q'/∂v P δ,
//!
//! because the rate of a gap is ∇g·q'. This is the shortest way in the metric of M but for friction, which P contains
//! where a contact slips. Sizes of states are no measure here: what has always rested at zero is as small as its
//! rounding, and measured by that a body may turn by any angle for a gap of 1e-17.

use super::coulomb::redundancy::eliminate;
use super::rows::Rows;
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::sliding::Sliding;
use crate::hybrid::point::Point;

/// What mending takes.
#[derive(Default)]
pub(crate) struct Mend {
    /// The states that a projection has placed.
    pub(crate) placed: Vec<bool>,
    /// The least mobility of states in the norm of their sizes.
    pub(crate) least: Vec<f64>,
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

/// What is mended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Left {
    Gaps,
    Rates,
}

impl Mode {
    /// Finds what is mended in the present mode.
    pub(crate) fn find_mended(&mut self) {
        let mut rates = std::mem::take(&mut self.mend.rates);
        rates.clear();
        rates.resize(self.sides.len(), false);
        for component in self.equations.components() {
            let is_of_contact = |&i: &usize| self.is_contact(i) || self.system.slip_of(i).is_some();
            let alone = component.iter().all(is_of_contact);
            component.iter().for_each(|&i| rates[i] = alone);
        }
        self.mend.rates = rates;
    }

    /// Whether what a sliding switch stands for is mended: a derivative of this order or the highest one.
    pub(crate) fn is_mended(&self, switch: usize, order: Option<usize>) -> bool {
        match order {
            Some(_) => self.is_contact(switch),
            None => self.mend.rates[switch],
        }
    }

    /// Closes the gaps of closed contacts, and places the states that they depend on. The largest gap before, relative
    /// to the size of its terms.
    pub(crate) fn mend_gaps(&mut self, state: &mut State, placed: &mut [bool]) -> f64 {
        self.mend(state, placed, Left::Gaps)
    }

    /// Stops closed contacts, and what sticks; the largest rate before, relative to the size of its terms.
    pub(crate) fn mend_rates(&mut self, state: &mut State, placed: &mut [bool]) -> f64 {
        self.mend(state, placed, Left::Rates)
    }

    fn mend(&mut self, state: &mut State, placed: &mut [bool], left: Left) -> f64 {
        let is_left = |mode: &Mode, i: usize| match left {
            Left::Gaps => mode.is_contact(i),
            Left::Rates => mode.mend.rates[i],
        };
        if !self.sliding.iter().any(|&i| is_left(self, i)) {
            return 0.0;
        }
        self.move_to(&state.point);
        for at in 0..self.sliding.len() {
            let i = self.sliding[at];
            // Forces have no friction in them where α_t is ½, and those of friction do not vanish where α_n is 0.
            let alpha = match self.system.slip_of(i) {
                Some(_) => 0.5,
                None if self.is_contact(i) => 0.0,
                None => continue,
            };
            self.memory.values[1 + self.n + i] = alpha;
        }
        let equations: Sliding = std::mem::take(&mut self.equations);
        let mut mend = std::mem::take(&mut self.mend);
        mend.push.resize(self.n, 0.0);
        let mut worst = 0.0_f64;
        for component in equations.components() {
            mend.rows.clear();
            let rows = component.iter().copied();
            match left {
                Left::Gaps => mend.rows.extend(rows.filter(|&i| self.is_contact(i))),
                Left::Rates => mend.rows.extend(rows.filter(|&i| mend.rates[i])),
            }
            if mend.rows.is_empty() {
                continue;
            }
            let (found, is_off) = self.measure(state, &mut mend, placed, left);
            worst = worst.max(found);
            if !is_off {
                continue;
            }
            self.find_push(&mut mend);
            match left {
                Left::Gaps => self.shift_positions(&mut state.point, &mut mend, placed),
                Left::Rates => mend.pushed.iter().for_each(|&j| {
                    state.point.x[j] -= std::mem::take(&mut mend.push[j]);
                }),
            }
        }
        (self.equations, self.mend) = (equations, mend);
        worst
    }

    /// Takes note of what is left; how much in relation to the size of its terms, and whether that is more than rounding.
    fn measure(
        &mut self,
        state: &State,
        mend: &mut Mend,
        placed: &mut [bool],
        left: Left,
    ) -> (f64, bool) {
        mend.impulses.clear();
        mend.blocks.clear();
        let (mut worst, mut is_off) = (0.0_f64, false);
        for &i in &mend.rows {
            let highest = self.surfaces.n_derivatives(i);
            self.surfaces
                .stand_for(i, if left == Left::Gaps { 0 } else { highest });
            self.surfaces.linearize(i, &self.memory.values);
            let psi = self.psi(i);
            let size = self.weigh(i, |j| state.scales.size(j));
            is_off |= psi.abs() > f64::EPSILON * size;
            if size > 0.0 {
                worst = worst.max(psi.abs() / size);
            }
            mend.impulses.push(psi);
            if left == Left::Gaps {
                for &(j, _) in self.surfaces.gradient(i) {
                    placed[j] = true;
                    mend.blocks.push(self.field.block_of(j));
                }
                self.surfaces.stand_for(i, highest);
            }
        }
        (worst, is_off)
    }

    /// P δ.
    fn find_push(&mut self, mend: &mut Mend) {
        let Mend {
            rows,
            matrix,
            impulses,
            push,
            pushed,
            ..
        } = mend;
        Rows::linearize(self, rows);
        let n = rows.len();
        matrix.clear();
        matrix.resize(n * n, 0.0);
        for (row, &i) in matrix.chunks_exact_mut(n).zip(&*rows) {
            for &(state, g) in self.surfaces.gradient(i) {
                for (by, slope) in self.field.slopes(state) {
                    if let Ok(column) = rows.binary_search(&by) {
                        row[column] += g * slope;
                    }
                }
            }
        }
        eliminate(matrix, impulses, |at| {
            self.system.slip_of(rows[at]).is_some()
        });
        pushed.clear();
        for (&i, impulse) in rows.iter().zip(&*impulses) {
            for &block in self.field.of_switch(i) {
                for &state in self.field.states_of(block) {
                    let slopes = self.field.slopes(state).filter(|(by, _)| *by == i);
                    for (_, slope) in slopes {
                        push[state] += slope * impulse;
                        pushed.push(state);
                    }
                }
            }
        }
    }

    /// q - ∂q'/∂v P δ.
    fn shift_positions(&mut self, point: &mut Point, mend: &mut Mend, placed: &[bool]) {
        mend.blocks.sort_unstable();
        mend.blocks.dedup();
        for &block in &mend.blocks {
            let values = &self.memory.values;
            let moves = |of: usize, by: usize, value: f64| {
                if placed[of] {
                    point.x[of] -= value * mend.push[by];
                }
            };
            let functions = &mut self.library;
            self.field.jacobian_of(functions, block, values, moves);
        }
        mend.pushed.iter().for_each(|&j| mend.push[j] = 0.0);
    }
}
