//! The next mode, where surfaces meet.
//!
//! On the surfaces I that meet in a point, find α_I ∈ [0, 1]^I with
//! φ_i > 0 ⇒ α_i = 1 and φ_i < 0 ⇒ α_i = 0. Surfaces that do not interact are decided
//! one group after the other, those whose rates decide before those that need
//! higher derivatives, which depend on the others' sides.

use smallvec::SmallVec;

use super::candidates::Enumeration;
use super::coupling::Coupling;
use super::dummy::Single;
use super::interacting::Several;
use super::judge::{Check, Judge, Verdict};
use crate::contact::velocities;
use crate::event::state::State;
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{BAND, UNTOLD};
use crate::hybrid::breakpoints::Pieces;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, HybridSystem, Note, Role, Settings, Side, Status};
use crate::integrate::drift::Projection;
use crate::integrate::singular_rates::{Rest, Roots, Settling};
use crate::selector::algebraic::Initialization;
use crate::selector::decided::{changes, innermost};
use crate::selector::selection::{Choice, Entry, Onset, fastest};

/// The share of its band within which a contact that is not met itself has no gap: less than what a contact is grazed
/// by, so that bodies that graze two others at once are not taken for jammed between them.
pub(crate) const TOUCH: f64 = 1.0 / 64.0;

/// Solutions looked for where one cannot be chosen: as many as three repelling surfaces have.
pub const MAX_NAMED: usize = 27;

/// What a new mode is found for.
pub(crate) enum Met {
    /// Switches on their surface, or at the end of their sliding.
    Surfaces(Few<usize>),
    /// New pieces of data, together with such switches.
    Breakpoint(Few<usize>),
}

/// A choice that rates and α do not rule out, and what each α is measured in.
struct Checked {
    choice: Choice,
    check: Check,
    units: Few<f64>,
}

/// Selects the mode that goes on from an event.
pub(crate) struct Selector<'a> {
    pub system: &'a HybridSystem,
    pub mode: &'a mut Mode,
    pub settings: &'a Settings,
    pub coupling: &'a Coupling,
    pub pieces: &'a mut Pieces,
    pub projection: &'a mut Projection,
}

impl Selector<'_> {
    pub(super) fn bands(&mut self) -> BandWidths<'_> {
        BandWidths { mode: self.mode }
    }

    /// Takes the sides that ψ have where the state is, and returns the switches on their surface: closed contacts that
    /// are `kept` where they are, too, whose gaps are rounding.
    pub(crate) fn place(
        &mut self,
        state: &mut State,
        horizon: f64,
        kept: &[usize],
    ) -> Result<Few<usize>, Status> {
        let all: Few<usize> = (0..state.point.sides.len()).collect();
        let before: Few<f64> = Few::from_slice(&state.point.alpha);
        Initialization::settle(self.mode, state, horizon)?;
        // ψ of a nested max depends on the sides of the inner one: settle from the inside out.
        for round in 0.. {
            let psi = self.mode.all_psi(&state.point);
            // Where one of time is met it has been decided, and ψ is rounding.
            let is_decided = |i: usize| state.selection.begun && self.system.switches[i].is_timed;
            let side = |(i, &psi): (usize, &f64)| match self.system.relay(i) {
                _ if is_decided(i) => state.point.sides[i],
                // A relay stays where ψ is zero.
                Some(_) if psi == 0.0 => state.point.sides[i],
                _ if self.system.role(i) != Role::Step => state.point.sides[i],
                _ if self.system.is_unilateral(i) || self.system.across(i).is_some() => Side::Plus,
                _ => Side::of(psi),
            };
            let wanted: Few<Side> = psi.iter().enumerate().map(side).collect();
            let changed = changes(&state.point.sides, &wanted);
            if changed.is_empty() {
                break;
            }
            if round > 2 * all.len() {
                return Err(Status::Restless {
                    switches: changed.into_vec(),
                });
            }
            let mut sides: Few<Side> = Few::from_slice(&state.point.sides);
            for i in innermost(self.system, &changed) {
                sides[i] = wanted[i];
            }
            state.point.set_sides(&sides);
            self.mode.move_to(&state.point);
        }
        self.bands().measure(state, &all, horizon);
        if !state.selection.begun {
            self.tell_gaps(state, horizon);
        }
        let below = |&&i: &&usize| {
            let is_kept = kept.contains(&i) || !self.system.is_unilateral(i);
            !is_kept && self.mode.psi(i) < -state.bands.width[i]
        };
        if let Some(&switch) = all.iter().find(below) {
            return Err(Status::Penetrates { switch });
        }
        let near: Few<bool> = (all.iter())
            .map(|&i| {
                let share = if self.system.is_struck(i) { TOUCH } else { 1.0 };
                kept.contains(&i) || self.mode.psi(i).abs() <= state.bands.within(i, share)
            })
            .collect();
        let near: Few<bool> = (all.iter())
            .map(|&i| near[i] && self.system.across(i).is_none_or(|other| near[other]))
            .collect();
        let is_kept =
            |i: usize| self.system.role(i) != Role::Step && state.point.sides[i] == Side::Slide;
        let on =
            |&i: &usize| near[i] && !is_kept(i) && self.system.slip_of(i).is_none_or(|of| near[of]);
        let on: Few<usize> = all.into_iter().filter(on).collect();
        state.bands.armed.fill(false);
        for &i in on
            .iter()
            .filter(|i| self.mode.system.switches[**i].is_nonlinear)
        {
            state.selection.entry[i] = match state.selection.begun {
                true => Entry::From(before[i]),
                false => Entry::Unknown,
            };
        }
        Ok(on)
    }

    /// Narrows the bands of all contacts where a run starts with a gap in doubt: within its band, and more than rounding
    /// of ψ. The bands then are at most a small share of how far gaps move in the run, or the rounding of ψ.
    fn tell_gaps(&mut self, state: &mut State, horizon: f64) {
        let contacts: Few<usize> = (0..state.point.sides.len())
            .filter(|&i| self.system.is_unilateral(i))
            .collect();
        let is_in_doubt = |&i: &usize| {
            let gap = self.mode.psi(i).abs();
            gap > UNTOLD * state.bands.rounding[i] && gap <= state.bands.width[i]
        };
        if contacts.iter().any(is_in_doubt) {
            let most = self.bands().most_at_start(&state.point, &contacts, horizon);
            state.bands.most_at_start = most;
            self.bands().measure(state, &contacts, horizon);
        }
    }

    /// The same where contacts that were closed before jumps stay where they are.
    pub(crate) fn place_kept(
        &mut self,
        state: &mut State,
        horizon: f64,
    ) -> Result<Few<usize>, Status> {
        let kept = std::mem::take(&mut state.jumps.kept);
        let on = self.place(state, horizon, &kept);
        state.jumps.kept = kept;
        on
    }

    /// Finds the next mode where `triggers` have reached their surface or stop to slide.
    pub(crate) fn change(
        &mut self,
        state: &mut State,
        triggers: &[usize],
        t1: f64,
    ) -> Result<(), Status> {
        let open = self.lead(state, triggers, t1)?;
        let selected = match Initialization::is_unsettled(self.mode, state, t1) {
            true => None,
            false => Some(self.select(state, &open, t1)),
        };
        match selected {
            // Algebraic states jump, with others or where their rows depend on each other.
            None | Some(Err(Status::Inconsistent { .. })) => {
                state.selection.leaving = None;
                let on = self.place_kept(state, t1 - state.point.t)?;
                self.select(state, &on, t1)
            }
            Some(selected) => selected,
        }
    }

    /// Chooses the sides of all switches that meet here and interact with `triggers`.
    fn select(&mut self, state: &mut State, triggers: &[usize], t1: f64) -> Result<(), Status> {
        let mut triggers: Few<usize> = triggers.into();
        self.reactivate_slips(state, &mut triggers, t1);
        // What made no difference may make one behind this event.
        triggers.extend(
            (0..state.bands.open.len()).filter(|&i| state.bands.open[i] && state.bands.armed[i]),
        );
        let others = triggers.iter().filter_map(|&i| self.system.across(i));
        let others: Few<usize> = others.collect();
        triggers.extend(others);
        triggers.sort_unstable();
        triggers.dedup();
        triggers.retain(|i| !self.has_no_rate(&state.point, *i));
        let triggers = &triggers[..];
        if triggers.len() > 1 {
            state.selection.leaving = None;
        }
        let meets = |i: &usize| state.point.sides[*i] == Side::Slide || state.bands.armed[*i];
        let is_met =
            |i: &usize| triggers.contains(i) || meets(i) && !self.system.switches[*i].leads();
        let meeting: Few<usize> = (0..state.point.sides.len())
            .filter(|i| is_met(i) && self.system.slip_of(*i).is_none_or(|of| is_met(&of)))
            .collect();
        self.bands().measure(state, &meeting, t1 - state.point.t);
        let mut groups: SmallVec<[Few<usize>; 2]> = SmallVec::new();
        for &trigger in triggers {
            if !groups.iter().any(|group| group.contains(&trigger)) {
                groups.push(self.coupling.interacting(trigger, &meeting));
            }
        }
        // What only looks at others is decided behind them.
        for &i in meeting.iter().filter(|i| self.coupling.only_watches(**i)) {
            let watches = |j: &usize| self.system.switches[i].couplings.contains(j);
            let known = |group: &Few<usize>| group.contains(&i);
            if groups.iter().flatten().any(watches) && !groups.iter().any(known) {
                groups.push(Few::from_slice(&[i]));
            }
        }
        let mut decided: Few<usize> = groups.iter().flatten().copied().collect();
        decided.sort_unstable();
        for behind in [false, true] {
            let mut tied = Vec::new();
            for group in &groups {
                let is_behind = group.iter().all(|&i| self.coupling.only_watches(i));
                let wanted = self.wanted(group, &decided);
                if is_behind == behind && !self.choose(state, group, &wanted, t1, false)? {
                    tied.push((group, wanted));
                }
            }
            for (group, wanted) in tied {
                self.choose(state, group, &wanted, t1, true)?;
            }
        }
        for &i in &meeting {
            state.bands.armed[i] = true;
        }
        // What was small before the event is zero after it.
        let deep = |&i: &usize| self.mode.surfaces.n_derivatives(i) > 0;
        if meeting.iter().any(deep) {
            if meeting
                .iter()
                .any(|&i| self.mode.system.switches[i].is_contact())
            {
                velocities::stabilize(self.mode, state);
            }
            self.mode.enter(&state.point.sides);
            self.mode.start_equations(&state.point);
            self.projection.project(self.mode, state);
        }
        Ok(())
    }

    /// True for a switch on its surface that only outputs look at, and whose ψ has no gradient here.
    fn has_no_rate(&mut self, point: &Point, switch: usize) -> bool {
        let mode = &mut *self.mode;
        if !mode.monitored.observers[switch] {
            return false;
        }
        mode.move_to(point);
        let surfaces = &mut mode.surfaces;
        surfaces.linearize(switch, &mode.memory.values);
        let mut gradient = surfaces.gradient(switch).iter();
        !gradient.all(|(_, g)| g.is_finite()) || !surfaces.time_gradient(switch).is_finite()
    }

    /// The sides asked for at a non-unique point: one for all, or one for each of the switches
    /// `decided` there, in order.
    pub(crate) fn wanted(&self, group: &[usize], decided: &[usize]) -> Few<Option<Side>> {
        let Settings { branch, below, .. } = &self.settings;
        let of_switch = |i: &usize| match branch[..] {
            [] => below.contains(i).then_some(Side::Minus),
            [side] => Some(side),
            _ => branch.get(decided.binary_search(i).ok()?).copied(),
        };
        group.iter().map(of_switch).collect()
    }

    /// Decides one group of interacting surfaces and sets its sides; false, with nothing set, where
    /// that takes the series and `series` does not allow it.
    pub(crate) fn choose(
        &mut self,
        state: &mut State,
        group: &[usize],
        wanted: &[Option<Side>],
        t1: f64,
        series: bool,
    ) -> Result<bool, Status> {
        if group.iter().any(|&i| self.mode.system.switches[i].rests()) {
            return self.choose_around_rest(state, group, wanted, t1, series);
        }
        let settling = Rest::new(self.mode, self.settings).settling(state, group);
        let mut sides: Few<Side> = Few::from_slice(&state.point.sides);
        for &i in group {
            sides[i] = Side::Slide;
            state.bands.open[i] = false;
        }
        self.mode.enter(&sides);
        for &i in group {
            let settles = settling.iter().any(|one| one.switch == i);
            self.take_order(state, i, settles);
        }
        self.mode
            .focus(state.point.t, &state.point.x, &state.point.alpha, group);
        if let ([switch], [wanted]) = (group, wanted)
            && self.mode.system.switches[*switch].is_nonlinear
        {
            return Single::new(self.mode, self.settings)
                .decide(state, *switch, *wanted, t1, series);
        }
        // What follows takes rates to be affine in each α.
        if group
            .iter()
            .any(|&i| self.mode.system.switches[i].is_nonlinear)
        {
            return Several::new(self.mode, self.settings).decide(state, group, wanted, t1);
        }
        if let &[switch] = group
            && let Some(choice) = Judge::new(self.mode, self.settings).clear(state, switch)
        {
            self.adopt(state, group, &choice, settling);
            return Ok(true);
        }
        let choices = Enumeration::new(self.mode, self.settings).choices(state, group)?;
        let most = fastest(&choices.found);
        let rates = Judge::new(self.mode, self.settings).rates(state, group, most);
        Judge::new(self.mode, self.settings).tell_faint(state, group);
        let measured = choices.found.into_iter().map(|choice| {
            let units = Judge::new(self.mode, self.settings).units(group, &choice, &rates);
            (choice, units)
        });
        let mut checked = Vec::new();
        for (choice, units) in measured.collect::<Vec<_>>() {
            match Judge::new(self.mode, self.settings).check(
                &state.point,
                group,
                &choice,
                &rates,
                &units,
            ) {
                Check::Inconsistent => {}
                Check::Tie if !series => return Ok(false),
                check => checked.push(Checked {
                    choice,
                    check,
                    units,
                }),
            }
        }
        let valid = self.confirm(state, group, checked, (t1, false));
        if !choices.all && valid.len() == 1 {
            state.report.note(Note::Unsearched {
                time: state.point.t,
                switches: group.to_vec(),
            });
        }
        let choice = self.only(group, wanted, valid, choices.singular)?;
        self.adopt(state, group, &choice, settling);
        Ok(true)
    }

    /// The choice that goes on: the only one, or the only one of several that is asked for.
    fn only(
        &self,
        group: &[usize],
        wanted: &[Option<Side>],
        mut valid: Vec<Choice>,
        is_singular: bool,
    ) -> Result<Choice, Status> {
        if valid.len() > 1 {
            let matches = |choice: &Choice| {
                let mut pairs = choice.sides.iter().zip(wanted);
                pairs.all(|(side, wanted)| wanted.is_none_or(|wanted| *side == wanted))
            };
            if valid.iter().filter(|choice| matches(choice)).count() != 1 {
                let name = |choice: &Choice| {
                    let sides = choice.sides.iter().copied();
                    group.iter().copied().zip(sides).collect()
                };
                return Err(Status::NonUnique(valid.iter().map(name).collect()));
            }
            valid.retain(matches);
        }
        valid.pop().ok_or_else(|| {
            let switches = group.to_vec();
            let is_equation = |&i: &usize| self.system.role(i) != Role::Step;
            if group.iter().any(is_equation) {
                Status::Inconsistent { switches }
            } else if is_singular {
                Status::Undetermined { switches }
            } else {
                Status::NoSolution { switches }
            }
        })
    }

    /// Sets the sides and α of a choice, and what they depart from.
    fn adopt(
        &mut self,
        state: &mut State,
        group: &[usize],
        choice: &Choice,
        settling: Vec<Settling>,
    ) {
        state.point.change_sides(group, &choice.sides);
        for (&i, &alpha) in group.iter().zip(&choice.alpha) {
            state.point.alpha[i] = alpha;
        }
        for one in settling {
            if state.point.sides[one.switch] == Side::Slide {
                let moved = state.point.x.iter_mut().zip(one.moves);
                moved.for_each(|(x, by)| *x += by);
            }
        }
        state
            .selection
            .onsets
            .retain(|one| !group.contains(&one.switches[0]));
        let onsets = Onset::all(self.mode, &state.point, group, choice);
        state.selection.onsets.extend(onsets);
    }

    /// Lets a switch of higher relative degree that is free be decided by its highest derivative where
    /// the lower ones vanish, or will at once, else by its rate.
    fn take_order(&mut self, state: &mut State, switch: usize, settles: bool) {
        let mode = &mut self.mode;
        let highest = mode.surfaces.n_derivatives(switch);
        let is_contact = mode.system.switches[switch].is_contact();
        mode.move_to(&state.point);
        let mut vanishes = |order: usize| {
            mode.surfaces.stand_for(switch, order);
            mode.surfaces.linearize(switch, &mode.memory.values);
            let size = mode.surfaces.weigh(switch, |j| state.scales.size(j));
            if order == 1 && is_contact {
                state.bands.still[switch] = BAND * size;
            }
            mode.surfaces.value(switch, &mode.memory.values).abs() <= BAND * size
        };
        let order = if (1..=highest).all(&mut vanishes) || settles {
            highest
        } else {
            0
        };
        mode.surfaces.stand_for(switch, order);
    }

    /// The choices that their series confirm, one for each solution: those from the states as they are, or, where there is none,
    /// from where closed contacts have stopped.
    fn confirm(
        &mut self,
        state: &mut State,
        group: &[usize],
        choices: Vec<Checked>,
        (t1, has_stopped): (f64, bool),
    ) -> Vec<Choice> {
        if let [one] = &choices[..]
            && matches!(one.check, Check::Consistent)
        {
            return choices.into_iter().map(|one| one.choice).collect();
        }
        let deep = (group.iter()).any(|&i| self.mode.surfaces.n_derivatives(i) > 0);
        let mut valid: Vec<(Choice, Option<Verdict>)> = Vec::new();
        for Checked {
            choice,
            check,
            units,
        } in &choices
        {
            let judge = Judge::new(self.mode, self.settings);
            let mut judge = if has_stopped { judge.stopped() } else { judge };
            let verdict = judge.verdict(state, group, choice, units, t1);
            let consistent = match check {
                Check::Tie => verdict.as_ref().is_some_and(|verdict| verdict.agrees),
                _ => true,
            };
            let known = |other: &(Choice, Option<Verdict>)| match (&verdict, &other.1) {
                (Some(a), Some(b)) => a.same_motion(b),
                _ => false,
            };
            let slides =
                |choice: &Choice| choice.sides.iter().filter(|s| **s == Side::Slide).count();
            let known = valid.iter().position(known).filter(|_| consistent);
            if let Some(at) = known {
                let sides = choice.sides.iter().zip(&valid[at].0.sides);
                for (&i, (side, other)) in group.iter().zip(sides) {
                    state.bands.open[i] |= side != other && !self.system.is_continuous(i);
                }
            }
            match known {
                _ if !consistent => {}
                None => valid.push((choice.clone(), verdict)),
                // Where a surface is kept by what keeps another one, it slides as well.
                Some(at) if deep && slides(choice) > slides(&valid[at].0) => {
                    valid[at] = (choice.clone(), verdict);
                }
                Some(_) => {}
            }
            // Without a choice of branch, it is enough to know that there are several.
            let Settings { branch, below, .. } = &self.settings;
            if valid.len() >= MAX_NAMED && branch.is_empty() && below.is_empty() {
                break;
            }
        }
        let is_contact = |&i: &usize| self.system.switches[i].is_contact();
        match valid.is_empty() && !has_stopped && group.iter().any(is_contact) {
            true => self.confirm(state, group, choices, (t1, true)),
            false => valid.into_iter().map(|(choice, _)| choice).collect(),
        }
    }

    /// Looks again at slip velocities that no rate has read so far, where a switch changes that made them so: at rest
    /// they are decided together.
    pub(crate) fn reactivate_slips(
        &mut self,
        state: &mut State,
        triggers: &mut Few<usize>,
        t1: f64,
    ) {
        for i in 0..state.point.sides.len() {
            let Some(other) = self.mode.system.second(i) else {
                continue;
            };
            let frees = &self.mode.system.switches[i].idle_above;
            let changes = triggers.iter().any(|trigger| frees.contains(trigger));
            if !changes || !self.mode.system.switches[i].is_free(&state.point.sides) {
                continue;
            }
            self.bands().measure(state, &[i, other], t1 - state.point.t);
            if state.bands.is_near(self.mode, i) {
                triggers.push(i);
            }
        }
    }

    /// Decides a group of which some switches may rest: the others first, whose rates do not depend on the sides of these,
    /// and then these, one after another until none changes. False, with nothing settled, where that takes series and
    /// `series` does not allow it.
    pub(crate) fn choose_around_rest(
        &mut self,
        state: &mut State,
        group: &[usize],
        wanted: &[Option<Side>],
        t1: f64,
        series: bool,
    ) -> Result<bool, Status> {
        if !series {
            return Ok(false);
        }
        let pairs = group.iter().copied().zip(wanted.iter().copied());
        let (roots, others): (Few<_>, Few<_>) =
            pairs.partition(|(i, _)| self.mode.system.switches[*i].rests());
        let mut sides: Few<Side> = Few::from_slice(&state.point.sides);
        let at_rest = roots.iter().map(|(i, _)| *i);
        let leaving: Few<usize> = at_rest.filter(|&i| sides[i] == Side::Slide).collect();
        roots.iter().for_each(|(i, _)| sides[*i] = Side::Slide);
        state.point.set_sides(&sides);
        if !others.is_empty() {
            let (others, wanted): (Few<usize>, Few<Option<Side>>) = others.into_iter().unzip();
            self.choose(state, &others, &wanted, t1, true)?;
        }
        for _ in 0..=roots.len() {
            let before = state.point.sides.clone();
            for &(i, wanted) in &roots {
                let side = Rest::new(self.mode, self.settings).decide(state, i, wanted, t1)?;
                state.point.change_sides(&[i], &[side]);
            }
            if state.point.sides == before {
                break;
            }
        }
        for &i in &leaving {
            if state.point.sides[i] != Side::Slide {
                let side = state.point.sides[i];
                Roots { mode: self.mode }.leave_rest(state, i, side);
            }
        }
        Ok(true)
    }

    /// Looks again at the slip velocities of contacts that are met, which nobody has watched while they were
    /// open.
    pub(crate) fn wake(&mut self, state: &mut State, on: &mut Few<usize>, t1: f64) {
        for slip in 0..state.point.sides.len() {
            let Some(contact) = self.system.slip_of(slip) else {
                continue;
            };
            if state.point.sides[contact] == Side::Slide || !on.contains(&contact) {
                continue;
            }
            let other = self.system.across(slip);
            let entries: Few<usize> = std::iter::once(slip).chain(other).collect();
            self.bands().measure(state, &entries, t1 - state.point.t);
            let speeds: Few<f64> = entries.iter().map(|&i| self.mode.psi(i)).collect();
            state.point.change_sides(
                &[slip],
                &[match other {
                    Some(_) => Side::Plus,
                    None => Side::of(speeds[0]),
                }],
            );
            let mut all = entries.iter().zip(&speeds);
            if all.all(|(&i, speed)| speed.abs() <= state.bands.width[i]) && !on.contains(&slip) {
                on.push(slip);
            }
        }
        on.sort_unstable();
    }
}
