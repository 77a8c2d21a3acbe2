//! Whether a choice of sides is a solution, and whether two are the same one.
//!
//! Rates and α decide where they are clearly off zero and off their bounds. Where
//! a rate vanishes or an α starts at its bound, the Taylor series in the choice's own
//! mode decide by their first non-negligible term, so that tangencies of any order
//! are the same rule.

use std::cmp::Ordering::{Greater, Less};

use crate::contact::friction_disc::{Disc, NearRest};
use crate::contact::prediction;
use crate::contact::slip_onset::SlipOnset;
use crate::contact::velocities;
use crate::event::state::State;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::scales::{ROUNDINGS, TIE};
use crate::expansion::series;
use crate::expansion::step_size::StepSize;
use crate::expansion::taylor::Expansion;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, Note, Role, Settings, Side};
use crate::integrate::singular::StraightSteps;
use crate::integrate::singular_rates::Roots;
use crate::linalg::DenseLu;
use crate::selector::closing::Bent;
use crate::selector::selection::{Choice, Onset};

/// Motions that differ less than this fraction of themselves are one.
const SAME: f64 = 1e-9;

/// Rounding of α = 1, which is no force.
const NO_FORCE: f64 = 8.0 * f64::EPSILON;

/// What an error grows by at most before motions are told apart.
const GROWTH: f64 = 1e6;

pub(crate) enum Check {
    Consistent,
    Inconsistent,
    /// Decided by the choice's own series.
    Tie,
}

/// What the series in a choice's own mode say.
pub(crate) struct Verdict {
    /// They stay on the choice's side of every surface.
    pub agrees: bool,
    /// A step of this length is accurate.
    h: f64,
    /// Terms c_k hᵏ of the states, k from 1, one state after another.
    terms: Vec<f64>,
    /// Per state, what rounding may have done to them.
    rounding: Vec<f64>,
}

impl Verdict {
    /// True when both mean the same motion of the states.
    pub(crate) fn same_motion(&self, other: &Verdict) -> bool {
        let order = self.terms.len() / self.rounding.len().max(1);
        let h = self.h.min(other.h);
        if h <= 0.0 {
            return true;
        }
        let shrink = |verdict: &Verdict, i: usize, k: usize| {
            verdict.terms[i * order + k] * (h / verdict.h).powi(k as i32 + 1)
        };
        (0..self.rounding.len()).all(|i| {
            let pairs = || (0..order).map(|k| (shrink(self, i, k), shrink(other, i, k)));
            let size = pairs().fold(0.0_f64, |m, (a, b)| m.max(a.abs()).max(b.abs()));
            let noise = self.rounding[i].max(other.rounding[i]);
            pairs().all(|(a, b)| (a - b).abs() <= SAME * size + noise)
        })
    }
}

/// Judges choices of sides by their rates and by their series.
pub(crate) struct Judge<'a> {
    mode: &'a mut Mode,
    settings: &'a Settings,
    /// Whether choices begin where their closed contacts have stopped, as the mode that is taken does. Of contacts that depend on
    /// each other those that are left open have no speed then.
    has_stopped: bool,
}

impl<'a> Judge<'a> {
    /// In a mode, as the settings of a run say.
    pub(crate) fn new(mode: &'a mut Mode, settings: &'a Settings) -> Self {
        Judge {
            mode,
            settings,
            has_stopped: false,
        }
    }

    /// Judges choices that begin where their closed contacts have stopped.
    pub(crate) fn stopped(self) -> Self {
        Judge {
            has_stopped: true,
            ..self
        }
    }

    /// Size of each rate of the group: |∇ψ|·|f| + |∂ψ/∂t| over all choices, of which `most` is the largest |f| of the states
    /// in focus, with the terms of f that cancel, and what would move ψ by its own size within a step. Where nothing acts,
    /// what rounding of forces that are zero does is a tie, and so is a rate that is rounding of what cancels within a
    /// gradient.
    pub(crate) fn rates(
        &mut self,
        state: &State,
        group: &[usize],
        most: impl Fn(usize) -> f64,
    ) -> Few<f64> {
        let mode = &mut self.mode;
        mode.vary(&state.point.alpha);
        mode.linearize(group);
        let states: Few<usize> = Few::from_slice(&mode.focus.states);
        let largest = |component: usize| {
            let at = states.partition_point(|&state| state < component);
            most(at).max(state.scales.activity[component])
        };
        let rate = |i: &usize| {
            let terms = mode.surfaces.weigh(*i, largest);
            let size = mode.surfaces.weigh(*i, |j| state.scales.size(j));
            let within_a_step = if state.scales.last_step > 0.0 {
                size / state.scales.last_step
            } else {
                0.0
            };
            let contacts = group
                .iter()
                .filter(|j| mode.system.switches[**j].is_contact());
            let push: f64 = contacts.map(|&j| mode.coupling(*i, j).abs()).sum();
            terms + mode.surfaces.time_gradient(*i).abs() + within_a_step + NO_FORCE / TIE * push
        };
        let rates: Few<f64> = group.iter().map(rate).collect();
        let rounded = |(&i, rate): (&usize, f64)| {
            let (surfaces, values) = (&mut mode.surfaces, &mode.memory.values);
            match mode.system.switches[i].is_plain() {
                true => rate + surfaces.running_error_of_phi(i, values, largest) / TIE,
                false => rate,
            }
        };
        group.iter().zip(rates).map(rounded).collect()
    }

    /// Tells of the surfaces of a group that forces keep which are so small that what rounding leaves of α = 1 - λ may matter:
    /// where without any force, no rate has been more than this part of what forces of one do, and more than rounding of these.
    pub(crate) fn tell_faint(&mut self, state: &mut State, group: &[usize]) {
        const FAINT: f64 = 0.01 * NO_FORCE / TIE;
        const NOTHING: f64 = 0.5 * f64::EPSILON;
        let mode = &mut *self.mode;
        let forces = group.iter().copied();
        let forces: Few<usize> = forces.filter(|&i| mode.system.is_unilateral(i)).collect();
        let pushed = &mut state.selection.pushed;
        let push = |mode: &Mode, i: usize| -> f64 {
            forces.iter().map(|&j| mode.coupling(i, j).abs()).sum()
        };
        // A contact that is struck has no force in its rate.
        let is_open = |&i: &usize| pushed[i] < FAINT && push(mode, i) > 0.0;
        if !forces.iter().any(is_open) {
            return;
        }
        let mut alpha: Few<f64> = Few::from_slice(&state.point.alpha);
        forces.iter().for_each(|&i| alpha[i] = 1.0);
        mode.vary(&alpha);
        mode.linearize(group);
        for &i in &forces {
            let push = push(mode, i);
            if push > 0.0 {
                pushed[i] = pushed[i].max(mode.phi(i).abs() / push);
            }
        }
        let most = forces.iter().fold(0.0, |most: f64, &i| most.max(pushed[i]));
        if NOTHING < most && most < FAINT {
            let time = state.point.t;
            let switches = forces.into_vec();
            state.report.note(Note::Faint { time, switches });
        }
    }

    /// What the rates and α say, in the mode where the group is free.
    pub(crate) fn check(
        &mut self,
        point: &Point,
        group: &[usize],
        choice: &Choice,
        rates: &[f64],
        units: &[f64],
    ) -> Check {
        self.mode.enter_choice(point, group, &choice.sides);
        let mode = &mut self.mode;
        let mut alpha: Few<f64> = Few::from_slice(&point.alpha);
        for (&i, &a) in group.iter().zip(&choice.alpha) {
            alpha[i] = a;
        }
        mode.vary(&alpha);
        mode.linearize(group);
        let mut tie = false;
        let sides = point.sides_with(group, &choice.sides);
        for (at, &i) in group.iter().enumerate() {
            if mode.system.is_idle(i, &sides) {
                continue;
            }
            // Positive inside, negative outside, relative to the natural size.
            let margin = match choice.sides[at] {
                _ if mode.system.is_second(i) => continue,
                side if mode.system.switches[i].is_in_disc() => Disc::of(Dense::Taylor(mode), i)
                    .map_or(0.0, |disc| disc.inside(side, &alpha, rates[at])),
                Side::Slide if mode.system.role(i) != Role::Step => continue,
                Side::Slide if mode.system.is_unilateral(i) => {
                    let force = 1.0 - choice.alpha[at];
                    let gain = mode.coupling(i, i).abs();
                    force
                        * if rates[at] > 0.0 {
                            gain / rates[at]
                        } else {
                            1.0
                        }
                }
                Side::Slide => choice.alpha[at].min(1.0 - choice.alpha[at]) / units[at],
                side if rates[at] > 0.0 => side.sign() * mode.phi(i) / rates[at],
                _ => 0.0,
            };
            // Of a contact that is open, what is slower than an impact is left to its series.
            let is_open = mode.system.switches[i].is_contact() && !mode.surfaces.is_deep(i);
            if margin.is_nan() || margin < -TIE && !is_open {
                return Check::Inconsistent;
            }
            tie |= margin <= TIE;
        }
        if tie { Check::Tie } else { Check::Consistent }
    }

    /// Sizes of the terms of all rates, with what they grow to within a step h where one state acts on another:
    /// exp(|J| h) times them, up to the order of the series. Forces of contacts are as large as they are known to be.
    fn spread(&mut self, state: &State, group: &[usize], units: &[f64], h: f64) -> Vec<f64> {
        let mut entries = Vec::new();
        let keep = |row, column, value: f64| entries.push((row, column, value.abs() * h));
        let mode = &mut self.mode;
        mode.field
            .jacobian(&mut mode.library, &mode.memory.values, keep);
        let mut spread = state.scales.activity.clone();
        let forces = group.iter().zip(units);
        let forces: Vec<_> = forces
            .filter(|(i, _)| self.mode.system.switches[**i].is_contact())
            .collect();
        // Masses couple states: what is left of a force in one is rounded as it is where it acts most.
        let slopes = |state: usize| self.mode.field.slopes(state);
        for &(&i, unit) in &forces {
            let of_contact = |state| slopes(state).filter(|(switch, _)| *switch == i);
            let acts = |state: &usize| of_contact(*state).next().is_some();
            let moved: Vec<usize> = (0..spread.len()).filter(acts).collect();
            let slopes = moved.iter().flat_map(|&state| of_contact(state));
            let most = slopes.fold(0.0_f64, |most, (_, slope)| most.max(slope.abs()));
            moved
                .into_iter()
                .for_each(|state| spread[state] += TIE * unit * most / ROUNDINGS);
        }
        let mut last = spread.clone();
        for k in 1..=self.mode.memory.order {
            let mut next = vec![0.0; last.len()];
            for &(row, column, value) in &entries {
                next[row] += value * last[column] / k as f64;
            }
            spread
                .iter_mut()
                .zip(&next)
                .for_each(|(sum, term)| *sum += term);
            last = next;
        }
        let most = GROWTH * state.scales.activity.iter().copied().fold(0.0, f64::max);
        spread.iter_mut().for_each(|size| *size = size.min(most));
        spread
    }

    /// What α of each of the group that slides is measured in, once rates are known: in what moves its ψ as fast as the
    /// rate is large, while the others that slide with it keep theirs. So an α is a tie at its bound exactly where the
    /// rate without it is one. 1 for others.
    pub(crate) fn units(&self, group: &[usize], choice: &Choice, rates: &[f64]) -> Few<f64> {
        let mode = &self.mode;
        let slides = |at: &usize| choice.sides[*at] == Side::Slide;
        let sliding: Few<usize> = (0..group.len()).filter(slides).collect();
        let factors = self.factors(group, &sliding);
        // 1/(A⁻¹)_ii, or A_ii where it is that, or A is singular.
        let gain = |at: usize| {
            let place = sliding.iter().position(|&other| other == at);
            let (Some(place), Some(factors)) = (place, &factors) else {
                return mode.coupling(group[at], group[at]).abs();
            };
            let mut column = vec![0.0; sliding.len()];
            column[place] = 1.0;
            factors.solve(&mut column);
            1.0 / column[place].abs()
        };
        let unit = |(at, &rate): (usize, &f64)| {
            let i = group[at];
            let gain = match mode.system.role(i) {
                _ if mode.system.is_unilateral(i) => mode.coupling(i, i).abs(),
                Role::Step if slides(&at) && !mode.system.switches[i].is_in_disc() => gain(at),
                _ => return 1.0,
            };
            let is_known = rate > 0.0 && gain > 0.0 && gain.is_finite();
            if is_known { rate / gain } else { 1.0 }
        };
        rates.iter().enumerate().map(unit).collect()
    }

    /// The couplings A of those of a group that slide, factored; none where there is one, or A is singular.
    fn factors(&self, group: &[usize], sliding: &[usize]) -> Option<DenseLu> {
        if sliding.len() < 2 {
            return None;
        }
        let pairs = sliding
            .iter()
            .flat_map(|&row| sliding.iter().map(move |&column| (row, column)));
        let matrix: Vec<f64> = pairs
            .map(|(row, column)| self.mode.coupling(group[row], group[column]))
            .collect();
        let mut factors = DenseLu::new(sliding.len());
        factors.factor(&matrix).is_ok().then_some(factors)
    }

    /// Expands a choice in its own mode; nothing where that is singular. True where some of it sets off from rest.
    fn expand_choice(
        &mut self,
        state: &mut State,
        (sides, alpha): (&[Side], &mut [f64]),
        onsets: &[Onset],
        root: Option<usize>,
        t1: f64,
    ) -> Option<bool> {
        Onset::hold(onsets, self.mode, sides);
        let tolerance = self.settings.local_tolerance();
        let left = t1 - state.point.t;
        if !onsets.is_empty()
            && SlipOnset::expand(self.mode, state, (alpha, onsets), tolerance, left)
        {
            return Some(true);
        }
        let mut x = match root {
            Some(i) => Roots { mode: self.mode }.onto_surface(state, i),
            None => state.point.x.clone(),
        };
        if root.is_none() && self.has_stopped {
            velocities::stop(self.mode, &state.point, sides, &mut x);
        }
        for onset in onsets {
            onset.nudge(self.mode, &state.point, &state.scales, &mut x, t1);
        }
        self.mode.enter(sides);
        let mut expansion = Expansion { mode: self.mode };
        expansion.around(state.point.t, &x, alpha).ok()?;
        Some(false)
    }

    /// What the series in the choice's own mode say; nothing where that mode is singular.
    pub(crate) fn verdict(
        &mut self,
        state: &mut State,
        group: &[usize],
        choice: &Choice,
        units: &[f64],
        t1: f64,
    ) -> Option<Verdict> {
        let (mut sides, mut alpha) = (state.point.sides.clone(), state.point.alpha.clone());
        for (at, &i) in group.iter().enumerate() {
            sides[i] = choice.sides[at];
            alpha[i] = choice.alpha[at];
        }
        let tolerance = self.settings.local_tolerance();
        let mut onsets = Onset::all(self.mode, &state.point, group, choice);
        // What another group has been found to set off with moves from now on.
        let others = state.selection.onsets.iter();
        onsets.extend(others.filter(|one| !group.contains(&one.switches[0])));
        let root = group
            .iter()
            .copied()
            .find(|&i| self.mode.system.switches[i].has_root);
        let departs = self.expand_choice(state, (&sides, &mut alpha), &onsets, root, t1)?;
        let sets_off = |i: usize| departs && onsets.iter().any(|d| d.switches.contains(&i));
        let mode = &mut self.mode;
        // At a root nothing but rates is known. Without roots, a series that is no number speaks against its mode.
        let is_smooth = match (root, mode.system.has_roots()) {
            (Some(_), _) => Expansion { mode }.cut_short(2),
            (None, has_roots) => !has_roots || Expansion { mode }.cut_short(usize::MAX),
        };
        state.scales.measure(mode, &mut state.bands);
        self.monitor_sides(state, group, &sides, sets_off);
        let longest = self.longest_step(state, group, t1);
        let h = self.step_size(state, departs, longest);
        // Where series end early, rates a moment later tell.
        let later = match is_smooth {
            true => Vec::new(),
            false => {
                StraightSteps { mode: self.mode }.rates_ahead(state, group, tolerance, longest)
            }
        };
        let mode = &self.mode;
        // A gap that is still open is struck behind this instant.
        let near = &state.jumps.near;
        let comes = |i: usize| {
            let c = mode.psi_series(i);
            let is_near = near.iter().any(|&(_, switch)| switch == i);
            mode.system.switches[i].is_contact() && !is_near && c[0] > 0.0 && c[1] < 0.0
        };
        let goes_there = |i: usize, side: Side| {
            let mut later = group.iter().zip(&later).filter(|(j, _)| **j == i);
            later.all(|(_, rate)| rate * side.sign() >= 0.0)
        };
        let stays = |((&i, side), unit): ((&usize, &Side), &f64)| match side {
            _ if mode.system.is_idle(i, &sides) => true,
            _ if mode.system.is_second(i) || sets_off(i) => true,
            Side::Slide => self.keeps_sliding(i, h, TIE * unit),
            _ if comes(i) => true,
            side => {
                let series = mode.psi_series(i);
                let leading = series::leading(series, h, state.bands.level(i, series, h));
                leading.map_or_else(|| goes_there(i, *side), |k| series[k] * side.sign() > 0.0)
            }
        };
        let agrees = (group.iter().zip(&choice.sides).zip(units)).all(stays);
        let terms = self.terms_of_step(h);
        let spread = self.spread(state, group, units, h);
        Some(Verdict {
            agrees,
            h,
            terms,
            rounding: spread.iter().map(|a| ROUNDINGS * a * h).collect(),
        })
    }
}

impl Judge<'_> {
    /// The choice of a switch alone with rates φ(0) and φ(1) on both sides, where these leave no doubt and f is φ's.
    ///
    /// Where they are no ties, and do not both lead away from the surface, it crosses if they have one sign, and slides if
    /// both lead to it. That is the only solution among all choices, and a clear one: φ is affine in α, so that its zero, where
    /// it has one, is off the ends of [0, 1] by min(|φ(0)|, |φ(1)|)/|∂φ/∂α| at least, which is no tie either. Twice a tie is
    /// more than what rounding does to these. Between them, f is no larger than at both.
    ///
    /// Where sliding has come to α = 1, φ(1) is a tie, and dα/dt > 0 rules out that it goes on. Beyond, f is that of sliding
    /// at this instant, along which φ stays zero: dφ(1)/dt = -∂φ/∂α dα/dt = (φ(0) - φ(1)) dα/dt > 0, and so it leaves. The same
    /// is true of α = 0.
    pub(crate) fn clear(&mut self, state: &State, switch: usize) -> Option<Choice> {
        if self.mode.system.is_struck(switch) {
            return self.opens(state, switch);
        }
        let mode = &mut *self.mode;
        let of_switch = &mode.system.switches[switch];
        let is_relay = mode.system.relay(switch).is_some();
        let is_sign = of_switch.is_plain() && !of_switch.is_in_disc() && !is_relay;
        if !is_sign || mode.system.is_idle(switch, &state.point.sides) {
            return None;
        }
        mode.surfaces.linearize(switch, &mode.memory.values);
        let mut alpha: Few<f64> = Few::from_slice(&state.point.alpha);
        let [(below, minus), (above, plus)] = [0.0, 1.0].map(|value| {
            alpha[switch] = value;
            mode.vary(&alpha);
            let f = mode.focus.states.iter().map(|&state| mode.field.f[state]);
            (mode.phi(switch), f.collect::<Few<f64>>())
        });
        let leaves = state.selection.leaving_to(switch, state.scales.last_step);
        let side = match (leaves, [below, above].map(|rate| rate.partial_cmp(&0.0))) {
            (Some(side), _) => side,
            (None, [Some(Greater), Some(Greater)]) => Side::Plus,
            (None, [Some(Less), Some(Less)]) => Side::Minus,
            (None, [Some(Greater), Some(Less)]) if !mode.system.is_continuous(switch) => {
                Side::Slide
            }
            _ => return None,
        };
        let most = |at: usize| minus[at].abs().max(plus[at].abs());
        let rate = self.rates(state, &[switch], most)[0];
        let is_clear = |phi: f64| phi > 2.0 * TIE * rate;
        let is_clear = match (leaves, side) {
            (Some(_), Side::Plus) => is_clear(below) && above.abs() <= TIE * rate,
            (Some(_), _) => is_clear(-above) && below.abs() <= TIE * rate,
            (None, _) => is_clear(below.abs()) && is_clear(above.abs()),
        };
        let zero = below / (below - above);
        let (alpha, f) = match side {
            Side::Minus => (0.0, minus),
            Side::Plus => (1.0, plus),
            Side::Slide => {
                let between = |(minus, plus): (&f64, &f64)| minus + zero * (plus - minus);
                (zero, minus.iter().zip(&plus).map(between).collect())
            }
        };
        (is_clear && rate > 0.0).then(|| Choice {
            sides: Few::from_slice(&[side]),
            alpha: Few::from_slice(&[alpha]),
            f,
        })
    }

    /// The choice of a contact alone that opens with a speed of its own: no force acts on it, if that leaves no doubt, and
    /// nothing bends it back before its gap is known to be open.
    fn opens(&mut self, state: &State, switch: usize) -> Option<Choice> {
        if self.mode.surfaces.is_deep(switch) {
            return None;
        }
        let mut alpha: Few<f64> = Few::from_slice(&state.point.alpha);
        alpha[switch] = 1.0;
        self.mode.eval(state.point.t, &state.point.x, &alpha);
        self.mode.linearize(&[switch]);
        let speed = self.mode.phi(switch);
        let f = (self.mode.focus.states.iter()).map(|&state| self.mode.field.f[state]);
        let f: Few<f64> = f.collect();
        self.mode.surfaces.stand_for(switch, 1);
        self.mode.linearize(&[switch]);
        let bend = self.mode.phi(switch);
        self.mode.surfaces.stand_for(switch, 0);
        if (Bent { speed, bend }).closes(state, switch) {
            return None;
        }
        let rate = self.rates(state, &[switch], |at| f[at].abs())[0];
        (rate > 0.0 && speed > 2.0 * TIE * rate).then(|| Choice {
            sides: Few::from_slice(&[Side::Plus]),
            alpha: Few::from_slice(&[1.0]),
            f,
        })
    }

    /// The time that is left, or what contacts that meet are predicted for.
    fn longest_step(&mut self, state: &State, group: &[usize], t1: f64) -> f64 {
        let left = t1 - state.point.t;
        let switches = &self.mode.system.switches;
        let meet = group.len() > 1 && group.iter().any(|&i| switches[i].is_contact());
        match meet {
            true => left.min(prediction::horizon(self.mode)),
            false => left,
        }
    }

    /// A step that states and ψ allow in the mode of a choice.
    fn step_size(&mut self, state: &State, departs: bool, longest: f64) -> f64 {
        let (mode, tolerance) = (&mut *self.mode, self.settings.local_tolerance());
        let step_size = StepSize { mode, tolerance };
        let h = step_size.of_states(&state.scales, longest);
        let h = step_size.of_psi(&state.bands, h);
        match departs {
            true => h,
            false => NearRest { mode, tolerance }.leaves_rest(&state.bands, h),
        }
    }

    /// Watches the ψ of those of a group that are off their surfaces, and do not set off from rest.
    fn monitor_sides(
        &mut self,
        state: &mut State,
        group: &[usize],
        sides: &[Side],
        sets_off: impl Fn(usize) -> bool,
    ) {
        self.mode.monitored.switches.clear();
        for &i in group {
            if sides[i] != Side::Slide && !self.mode.system.is_idle(i, sides) && !sets_off(i) {
                let (mode, bands) = (&mut *self.mode, &mut state.bands);
                Monitor { mode, bands }.expand(i);
                self.mode.monitored.switches.push(i);
            }
        }
    }

    /// Whether the series of a sliding switch keep it on its surface for a time h: an α within a tie of its bound goes
    /// inward.
    fn keeps_sliding(&self, switch: usize, h: f64, tie: f64) -> bool {
        if self.mode.system.role(switch) != Role::Step {
            return true;
        }
        if self.mode.system.switches[switch].is_in_disc() {
            let disc = Disc::of(Dense::Taylor(self.mode), switch);
            return disc.is_none_or(|disc| disc.goes_on(h));
        }
        let series = self.mode.alpha_series(switch);
        let inward = if series[0] <= tie && !self.mode.system.is_unilateral(switch) {
            1.0
        } else if series[0] >= 1.0 - tie {
            -1.0
        } else {
            return true;
        };
        series::leading(series, h, tie).is_none_or(|k| series[k] * inward > 0.0)
    }

    /// Terms c_k hᵏ of the states, k from 1, one state after another.
    fn terms_of_step(&self, h: f64) -> Vec<f64> {
        let order = self.mode.memory.order;
        let mut terms = Vec::with_capacity(self.mode.n * order);
        for i in 0..self.mode.n {
            let mut power = 1.0;
            terms.extend(self.mode.x_series(i)[1..=order].iter().map(|c| {
                power *= h;
                c * power
            }));
        }
        terms
    }
}
