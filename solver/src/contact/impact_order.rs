//! Impacts whose order is not known.
//!
//! Where several contacts are struck at one instant, all of them have one impact. One after the other they may leave
//! other velocities: with Newton's law these do not depend continuously on the gaps between the bodies. So contacts that
//! hang together and are struck within the tolerance of a run, but not at one instant, are told, where the first of them
//! matters. Gaps that are equal but for rounding are meant to be equal.
//!
//! A slip J_tᵀv - b(α) whose b steps where a contact is struck is the same question: the impact has the slip before the
//! step, and is told where it is another one with the slip behind it.

use super::impact::{Impacts, impact_of};
use crate::event::state::State;
use crate::expansion::scales::BAND;
use crate::hybrid::{Note, Side, Status};
use crate::selector::closing::Closing;

/// Roundings of their terms by which equal gaps differ.
const ROUNDINGS: f64 = 64.0;

/// Of more contacts it is not asked which was first.
const MOST: usize = 8;

/// Impacts one after the other, before they count as endless.
const MAX_ROUNDS: usize = 20;

impl Impacts<'_> {
    /// Takes note of contacts that are struck with those of `struck`, or almost, where it matters which one is first.
    /// `near` are the contacts without a gap.
    pub(crate) fn note_order(&mut self, state: &mut State, struck: &[usize], near: &[usize]) {
        let laws = 0..self.system.laws.len();
        let normals = laws.filter_map(|law| impact_of(&self.system, law));
        let normals: Vec<usize> = normals.map(|(normal, _)| normal).collect();
        let mut gaps: Vec<(usize, f64)> = Vec::new();
        self.mode.move_to(&state.point);
        for i in normals {
            let is_open = state.point.sides[i] != Side::Slide && !state.jumps.grazed.contains(&i);
            if is_open && let Some(gap) = self.gap(state, i) {
                gaps.push((i, gap));
            }
        }
        if gaps.len() < 2 {
            self.mode.enter(&state.point.sides);
            return;
        }
        let mut all: Vec<usize> = near
            .iter()
            .chain(gaps.iter().map(|(i, _)| i))
            .copied()
            .collect();
        all.sort_unstable();
        all.dedup();
        let mut known: Vec<usize> = Vec::new();
        for &first in struck {
            let group = self.coupling.interacting(first, &all);
            let of_group = || gaps.iter().filter(|(i, _)| group.contains(i));
            let members: Vec<usize> = of_group().map(|(i, _)| *i).collect();
            if known.contains(&first) || !members.contains(&first) {
                continue;
            }
            known.extend(&members);
            let (least, most) = of_group()
                .fold((f64::INFINITY, 0.0_f64), |(low, high), (_, gap)| {
                    (low.min(*gap), high.max(*gap))
                });
            let are_one = most - least <= ROUNDINGS * f64::EPSILON;
            if are_one || members.len() > MOST || !self.order_matters(state, &members, near) {
                continue;
            }
            state.report.note(Note::Together {
                time: state.point.t,
                switches: members,
            });
        }
        self.mode.enter(&state.point.sides);
        self.mode.move_to(&state.point);
    }

    /// The gap of a contact that is approached where the point is, relative to the size of its terms, if that is within
    /// the tolerance.
    fn gap(&mut self, state: &State, switch: usize) -> Option<f64> {
        let mode = &mut *self.mode;
        mode.surfaces.stand_for(switch, 0);
        let gap = mode.psi(switch).abs() * BAND / state.bands.width[switch];
        let is_near = gap <= self.settings.tolerance;
        (is_near && (Closing { mode }).speed(&state.scales, switch).is_some()).then_some(gap)
    }

    /// Takes note of `steps` that are met with the contacts of `struck` and behind which the impact is another one.
    pub(crate) fn note_steps(
        &mut self,
        state: &mut State,
        struck: &[usize],
        near: &[usize],
        steps: &[usize],
    ) {
        let before = self.tried(state, |impacts, state| {
            impacts.strike_together(state, struck, near)
        });
        for &step in steps {
            let (side, alpha) = (state.point.sides[step], state.point.alpha[step]);
            let other = match side {
                Side::Minus => (Side::Plus, 1.0),
                Side::Plus => (Side::Minus, 0.0),
                Side::Slide => continue,
            };
            (state.point.sides[step], state.point.alpha[step]) = other;
            let behind = self.tried(state, |impacts, state| {
                impacts.strike_together(state, struck, near)
            });
            (state.point.sides[step], state.point.alpha[step]) = (side, alpha);
            if before
                .iter()
                .zip(&behind)
                .any(|(a, b)| self.differ(state, a, b))
            {
                state.report.note(Note::Together {
                    time: state.point.t,
                    switches: [struck, &[step]].concat(),
                });
            }
        }
        self.mode.enter(&state.point.sides);
        self.mode.move_to(&state.point);
    }

    /// Whether velocities are others where one of these contacts is struck before the rest.
    fn order_matters(&mut self, state: &mut State, members: &[usize], near: &[usize]) -> bool {
        let mut ends: Vec<Vec<f64>> = Vec::new();
        for &first in members {
            ends.extend(self.tried(state, |impacts, state| {
                impacts.strike_in_turn(state, first, members, near)
            }));
        }
        ends.iter().any(|end| self.differ(state, end, &ends[0]))
    }

    /// Whether states differ by more than the tolerance.
    fn differ(&self, state: &State, one: &[f64], other: &[f64]) -> bool {
        one.iter().zip(other).enumerate().any(|(j, (a, b))| {
            (a - b).abs() > self.settings.tolerance * state.scales.largest[j].max(a.abs())
        })
    }

    /// The state behind an impact that does not take place.
    fn tried(
        &mut self,
        state: &mut State,
        strike: impl FnOnce(&mut Self, &mut State) -> Result<(), Status>,
    ) -> Option<Vec<f64>> {
        let x = state.point.x.clone();
        let alpha = state.point.alpha.clone();
        let complementarity = state.report.complementarity;
        let notes = state.report.notes.clone();
        let struck = strike(self, state);
        let end = std::mem::replace(&mut state.point.x, x);
        state.point.alpha = alpha;
        state.report.complementarity = complementarity;
        state.report.notes = notes;
        struck.is_ok().then_some(end)
    }

    /// Strikes one of these contacts, and those behind it that are approached then, until none is.
    fn strike_in_turn(
        &mut self,
        state: &mut State,
        first: usize,
        members: &[usize],
        near: &[usize],
    ) -> Result<(), Status> {
        let is_other = |i: &usize| *i != first && members.contains(i);
        let mut met: Vec<usize> = near.iter().copied().filter(|i| !is_other(i)).collect();
        met.push(first);
        self.strike_together(state, &[first], &met)?;
        met.extend(members);
        for _ in 0..MAX_ROUNDS {
            let mode = &mut *self.mode;
            mode.move_to(&state.point);
            let mut next = members.to_vec();
            next.retain(|&i| (Closing { mode }).speed(&state.scales, i).is_some());
            if next.is_empty() {
                break;
            }
            self.strike_together(state, &next, &met)?;
        }
        Ok(())
    }
}
