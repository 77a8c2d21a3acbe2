//! Events that are close together, but not one.
//!
//! Rounding does not tell apart events at a distance of some ε, so that those below `TOGETHER` are one.
//! The mode between them is skipped, which is no matter unless its field moves a state even in such a
//! short time, or is one in which the second surface is come to slowly: then the later ones are left to the next
//! step, and where rounding does not say which is first, the run says so.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::{Few, Note, Side};
use crate::selector::select::Selector;

/// Roundings of its terms below which ψ is zero.
const ROUNDINGS: f64 = 64.0;

/// Roundings of a rate that is zero.
const STILL: f64 = 8.0;

/// Of more surfaces that meet it is not asked which was first.
const MOST: usize = 8;

/// A mode that some of the surfaces lead to, with its rates.
struct Between {
    sides: Box<[Side]>,
    alpha: Vec<f64>,
    f: Vec<f64>,
}

/// Tells events apart that are close together.
pub(crate) struct Simultaneous<'a> {
    pub selector: Selector<'a>,
}

impl Simultaneous<'_> {
    /// Takes out of `triggers`, which meet here, those whose surfaces are reached later, where that makes
    /// a difference to a state above its tolerance.
    pub(crate) fn tell_apart(&mut self, state: &mut State, triggers: &mut Few<usize>, t1: f64) {
        let has_no_side = |&i: &usize| {
            let is_relay = self.selector.system.relay(i).is_some();
            is_relay || self.selector.system.across(i).is_some()
        };
        if triggers.len() < 2 || triggers.iter().any(has_no_side) {
            return;
        }
        let mode = &mut *self.selector.mode;
        mode.move_to(&state.point);
        let mut is_ahead = |i: usize| {
            let psi = mode.psi(i) * state.point.sides[i].sign();
            psi > ROUNDINGS * f64::EPSILON * state.bands.terms[i]
        };
        let (later, now): (Few<usize>, Few<usize>) =
            triggers.iter().copied().partition(|&i| is_ahead(i));
        let apart = !later.is_empty() && !now.is_empty();
        if apart && self.moves_between(state, &now, &later) {
            *triggers = now;
            return;
        }
        if state.is_bound(self.selector.mode, triggers) {
            return;
        }
        if apart
            && let Some(between) = self.between(state, &now, t1)
            && let Some(all) = self.between(state, triggers, t1)
            && (later.iter()).any(|&i| self.is_slow(state, i, [&between, &all], t1))
        {
            *triggers = now;
            return;
        }
        self.note_together(state, triggers, t1);
    }

    /// Whether a state moves where those of `now` have changed sides, until the others are met.
    fn moves_between(&mut self, state: &State, now: &[usize], later: &[usize]) -> bool {
        let mode = &mut *self.selector.mode;
        // The mode between: what is reached now has changed sides.
        let mut sides = state.point.sides.clone();
        let mut alpha = state.point.alpha.clone();
        for &i in now {
            sides[i] = match state.point.sides[i] {
                Side::Minus => Side::Plus,
                Side::Plus => Side::Minus,
                Side::Slide if alpha[i] < 0.5 => Side::Minus,
                Side::Slide => Side::Plus,
            };
            alpha[i] = if sides[i] == Side::Plus { 1.0 } else { 0.0 };
        }
        mode.eval(state.point.t, &state.point.x, &state.point.alpha);
        let before = mode.field.f.clone();
        mode.enter(&sides);
        mode.eval(state.point.t, &state.point.x, &alpha);
        mode.linearize(later);
        let lasts = later.iter().map(|&i| {
            let (psi, approach) = (mode.psi(i).abs(), -mode.phi(i) * sides[i].sign());
            if approach > 0.0 { psi / approach } else { 0.0 }
        });
        let lasts = lasts.fold(0.0, f64::max);
        let matters = (mode.field.f.iter().zip(&before))
            .enumerate()
            .any(|(j, (f, before))| {
                let size = state.scales.largest[j].max(state.point.x[j].abs());
                (f - before).abs() * lasts > self.selector.settings.tolerance * size
            });
        mode.enter(&state.point.sides);
        matters
    }

    /// Takes note of surfaces that count as met at once, where one may be met later by a time that matters.
    fn note_together(&mut self, state: &mut State, triggers: &[usize], t1: f64) {
        let Some(all) = self.between(state, triggers, t1) else {
            return;
        };
        for &i in triggers {
            if state.point.sides[i] == Side::Slide {
                continue;
            }
            // Nothing lies between two names of one surface.
            let others: Vec<usize> = triggers
                .iter()
                .copied()
                .filter(|&j| j != i && !self.is_one(state, [i, j]))
                .collect();
            if others.is_empty() {
                continue;
            }
            let Some(between) = self.between(state, &others, t1) else {
                continue;
            };
            if between.sides[i] == state.point.sides[i]
                && self.is_slow(state, i, [&between, &all], t1)
            {
                let switches = std::iter::once(i).chain(others).collect();
                let time = state.point.t;
                state.report.note(Note::Together { time, switches });
                return;
            }
        }
    }

    /// Whether two surfaces that meet here have one tangent plane, as far as rounding tells. Planes are compared by their
    /// numbers before: two of them are two.
    fn is_one(&mut self, state: &State, both: [usize; 2]) -> bool {
        let mode = &mut *self.selector.mode;
        if both
            .iter()
            .all(|&i| mode.planes.is_affine(i, &mode.surfaces))
        {
            return false;
        }
        mode.move_to(&state.point);
        mode.linearize(&both);
        let normals = both.map(|i| {
            let mut normal: Vec<f64> = vec![0.0; state.point.x.len() + 1];
            for &(j, g) in mode.surfaces.gradient(i) {
                normal[j] += g * state.scales.largest[j].max(state.point.x[j].abs());
            }
            normal[state.point.x.len()] = mode.surfaces.time_gradient(i) * state.point.t.abs();
            normal
        });
        let sizes = [0, 1].map(|k| normals[k].iter().fold(0.0_f64, |most, g| most.max(g.abs())));
        let known = [0, 1].map(|k| STILL * f64::EPSILON * state.bands.terms[both[k]] / sizes[k]);
        let at = [0, 1].map(|k| mode.psi(both[k]).abs() / sizes[k]);
        at.iter().zip(known).all(|(at, known)| *at <= known)
            && are_parallel(&normals[0], &normals[1])
    }

    /// The mode that these surfaces lead to; nothing where there is none.
    fn between(&mut self, state: &mut State, met: &[usize], t1: f64) -> Option<Between> {
        let kept = (
            state.point.x.clone(),
            state.point.sides.clone(),
            state.point.alpha.clone(),
            state.bands.armed.clone(),
            state.bands.width.clone(),
            state.report.notes.clone(),
        );
        let changed = self.selector.change(state, met, t1);
        let found = changed.is_ok().then(|| {
            let (sides, alpha) = (state.point.sides.clone(), state.point.alpha.clone());
            self.selector.mode.enter(&sides);
            self.selector
                .mode
                .eval(state.point.t, &state.point.x, &alpha);
            let f = self.selector.mode.field.f.clone();
            Between { sides, alpha, f }
        });
        (
            state.point.x,
            state.point.sides,
            state.point.alpha,
            state.bands.armed,
            state.bands.width,
            state.report.notes,
        ) = kept;
        self.selector.mode.enter(&state.point.sides);
        found
    }

    /// Whether a surface is come to so slowly in the mode between that a state moves otherwise until it is met.
    fn is_slow(&mut self, state: &State, i: usize, [between, all]: [&Between; 2], t1: f64) -> bool {
        let mode = &mut *self.selector.mode;
        mode.enter(&between.sides);
        mode.eval(state.point.t, &state.point.x, &between.alpha);
        mode.linearize(&[i]);
        let still = STILL * f64::EPSILON * mode.terms_of_phi(i);
        let approach = -mode.phi(i) * between.sides[i].sign();
        let distance = (mode.psi(i).abs()).max(STILL * f64::EPSILON * state.bands.terms[i]);
        mode.enter(&state.point.sides);
        if approach < -still {
            return false;
        }
        let lasts = (distance / approach.max(still)).min(t1 - state.point.t);
        (between.f.iter().zip(&all.f))
            .enumerate()
            .any(|(j, (between, all))| {
                let size = state.scales.largest[j].max(state.point.x[j].abs());
                (between - all).abs() * lasts > self.selector.settings.tolerance * size
            })
    }
}

/// Whether two vectors differ by a factor, but for rounding.
fn are_parallel(a: &[f64], b: &[f64]) -> bool {
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let rounding = ROUNDINGS * f64::EPSILON * size(a) * size(b);
    // a_i b_j = a_j b_i for the largest a_i.
    let largest = (0..a.len()).max_by(|&i, &j| a[i].abs().total_cmp(&a[j].abs()));
    largest.is_some_and(|i| {
        let mut pairs = a.iter().zip(b);
        rounding > 0.0 && pairs.all(|(c, d)| (a[i] * d - c * b[i]).abs() <= rounding)
    })
}

impl State {
    /// True where surfaces are those of contacts or of nonlinear switches, or too many.
    fn is_bound(&self, mode: &Mode, triggers: &[usize]) -> bool {
        let is_other =
            |i: &usize| mode.system.switches[*i].is_nonlinear || mode.system.is_unilateral(*i);
        triggers.len() > MOST || triggers.iter().any(is_other)
    }
}
