//! The next mode of a nonlinear switch on its surface: the dummy system dα/dτ = φ(α).
//!
//! It starts at the α of the side that the state comes from, or where the switch has slid, and ends at
//! the first sliding mode that it meets, or beyond 0 or 1, where the state leaves the surface (Jeffrey 2014, section 3).
//! At a fold it is at rest in the mode that ends: it goes on in the direction in which φ has its sign around it.
//! Where it starts at rest at a bound, the series of the side decide whether the state leaves there.

use super::judge::Judge;
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::TIE;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, Settings, Side, Status};
use crate::selector::nonlinear::ScalarRate;
use crate::selector::selection::{Choice, Decision, Entry, SlidingMode, fastest};

/// How the dummy system starts.
#[derive(Clone, Copy, PartialEq)]
enum Start {
    /// At rest in a fold, from which it goes up or down.
    Fold(f64, f64),
    /// At an α.
    At(f64),
    /// Nobody knows where.
    Unknown,
}

/// What the dummy system has led to.
enum End {
    /// A sliding mode.
    Slides(f64),
    Leaves(Side),
}

impl Start {
    /// Where a switch starts.
    fn of(state: &State, switch: usize) -> Self {
        let turn = state
            .selection
            .fold
            .as_ref()
            .and_then(|fold| fold.turn(switch));
        match (turn, state.selection.entry[switch]) {
            (Some(turn), _) => Start::Fold(turn.alpha, turn.direction),
            (_, Entry::Present) => Start::At(state.point.alpha[switch]),
            (_, Entry::From(alpha)) => Start::At(alpha),
            (_, Entry::Unknown) => Start::Unknown,
        }
    }

    /// Whether it may be at this end of α, 0 or 1.
    fn meets(&self, end: usize) -> bool {
        match *self {
            Start::At(alpha) => (alpha - end as f64).abs() <= TIE,
            Start::Fold(..) | Start::Unknown => true,
        }
    }

    /// Whether a rate that vanishes at this end leaves it to series what becomes of it.
    fn may_be_tied(&self, end: usize) -> bool {
        !matches!(self, Start::Fold(..)) && self.meets(end)
    }
}

/// Goes on with what the dummy system has led to; with all sliding modes, and whether it started in a fold.
fn take(state: &mut State, switch: usize, end: End, (modes, folds): (Vec<SlidingMode>, bool)) {
    let (side, alpha) = match end {
        End::Slides(alpha) => (Side::Slide, alpha),
        End::Leaves(side) => (side, 0.5 + 0.5 * side.sign()),
    };
    state.point.change_sides(&[switch], &[side]);
    state.point.alpha[switch] = alpha;
    state.selection.entry[switch] = Entry::Present;
    state.selection.decisions.push(Decision {
        switch,
        modes,
        taken: (side == Side::Slide).then_some(alpha),
        folds,
    });
}

/// From a double zero the next one is at least this far away.
const APART: f64 = 1e-4;

/// Decides a nonlinear switch that interacts with no other one.
pub(crate) struct Single<'a> {
    mode: &'a mut Mode,
    settings: &'a Settings,
}

impl<'a> Single<'a> {
    /// In a mode, as the settings of a run say.
    pub(crate) fn new(mode: &'a mut Mode, settings: &'a Settings) -> Self {
        Single { mode, settings }
    }

    /// Decides a nonlinear switch that interacts with no other one here; false, with nothing set, where that takes
    /// series and `series` does not allow it.
    pub(crate) fn decide(
        &mut self,
        state: &mut State,
        switch: usize,
        wanted: Option<Side>,
        t1: f64,
        series: bool,
    ) -> Result<bool, Status> {
        let start = Start::of(state, switch);
        let mut alphas = state.point.alpha.clone();
        let mut rate = ScalarRate::of(self.mode, switch, &mut alphas);
        let modes = rate.sliding_modes();
        let modes = modes.map_err(|_| Status::Undetermined {
            switches: vec![switch],
        })?;
        let ends = [0.0, 1.0].map(|end| rate.at(end)[0]);
        let sides = [Side::Minus, Side::Plus];
        let choices = sides.map(|side| self.choice(state, switch, side, 0.5 + 0.5 * side.sign()));
        let mut judge = Judge::new(self.mode, self.settings);
        let scale = judge.rates(state, &[switch], fastest(&choices))[0];
        let rests = ends.map(|rate| rate.abs() <= TIE * scale);
        let is_tied = [0, 1]
            .iter()
            .any(|&end| rests[end] && start.may_be_tied(end));
        if is_tied && !series {
            return Ok(false);
        }
        // The state leaves by its own series where φ vanishes.
        let mut leaves = [ends[0] < 0.0, ends[1] > 0.0];
        for end in 0..2 {
            if rests[end] && start.meets(end) {
                let verdict = Judge::new(self.mode, self.settings).verdict(
                    state,
                    &[switch],
                    &choices[end],
                    &[1.0],
                    t1,
                );
                leaves[end] = verdict.is_some_and(|verdict| verdict.agrees);
                self.look_at(&state.point, switch);
            }
        }
        let walk = |from: f64, up: bool, apart: f64| -> End {
            let ahead = |mode: &&SlidingMode| match up {
                true => mode.alpha > from + apart,
                false => mode.alpha < from - apart,
            };
            let next = match up {
                true => modes.iter().find(ahead),
                false => modes.iter().rev().find(ahead),
            };
            // A mode at the bound itself is left at once, or entered.
            let end = usize::from(up);
            let is_left =
                |mode: &SlidingMode| (mode.alpha - end as f64).abs() <= TIE && leaves[end];
            match next.filter(|mode| !is_left(mode)) {
                Some(mode) => End::Slides(mode.alpha),
                None => End::Leaves(sides[end]),
            }
        };
        let end = match start {
            Start::Fold(alpha, direction) => walk(alpha, direction > 0.0, APART),
            Start::At(alpha) => match (0..2).find(|&end| start.meets(end)) {
                Some(end) if leaves[end] => End::Leaves(sides[end]),
                Some(end) => walk(alpha, end == 0, TIE),
                None => self.follow(&state.point, switch, alpha, &modes, scale, walk),
            },
            Start::Unknown => self.name_ends(switch, &modes, leaves, wanted)?,
        };
        take(
            state,
            switch,
            end,
            (modes, matches!(start, Start::Fold(..))),
        );
        Ok(true)
    }

    /// A switch that has slid at `alpha` where something else changes: it stays on its branch where that is still
    /// there.
    fn follow(
        &mut self,
        point: &Point,
        switch: usize,
        alpha: f64,
        modes: &[SlidingMode],
        scale: f64,
        walk: impl Fn(f64, bool, f64) -> End,
    ) -> End {
        let mut alphas = point.alpha.clone();
        let mut rate = ScalarRate::of(self.mode, switch, &mut alphas);
        let [rate, ..] = rate.at(alpha);
        if rate.abs() > TIE * scale {
            return walk(alpha, rate > 0.0, 0.0);
        }
        let distance = |mode: &&SlidingMode| (mode.alpha - alpha).abs();
        let nearest = modes
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        match nearest {
            Some(mode) if distance(&mode) <= APART => End::Slides(mode.alpha),
            _ => walk(alpha, rate > 0.0, 0.0),
        }
    }

    /// Where a run starts on the surface: the only way to go on, or the one that is asked for.
    fn name_ends(
        &self,
        switch: usize,
        modes: &[SlidingMode],
        leaves: [bool; 2],
        wanted: Option<Side>,
    ) -> Result<End, Status> {
        let inside = |mode: &&SlidingMode| {
            let end = usize::from(mode.alpha > 0.5);
            (mode.alpha - end as f64).abs() > TIE || !leaves[end]
        };
        let slides: Vec<SlidingMode> = modes.iter().filter(inside).copied().collect();
        let mut ends: Vec<Side> = slides.iter().map(|_| Side::Slide).collect();
        let sides = [Side::Minus, Side::Plus];
        ends.extend((0..2).filter(|&end| leaves[end]).map(|end| sides[end]));
        let attracting = slides.iter().filter(|mode| mode.stability < 0.0);
        let attracting: Vec<f64> = attracting.map(|mode| mode.alpha).collect();
        match (&ends[..], wanted) {
            ([], _) => Err(Status::NoSolution {
                switches: vec![switch],
            }),
            ([Side::Slide], _) => Ok(End::Slides(slides[0].alpha)),
            ([side], _) => Ok(End::Leaves(*side)),
            (_, Some(Side::Slide)) if attracting.len() == 1 => Ok(End::Slides(attracting[0])),
            (_, Some(Side::Slide)) if slides.len() == 1 => Ok(End::Slides(slides[0].alpha)),
            (ends, Some(side)) if side != Side::Slide && ends.contains(&side) => {
                Ok(End::Leaves(side))
            }
            (ends, _) => Err(Status::NonUnique(
                ends.iter().map(|&side| vec![(switch, side)]).collect(),
            )),
        }
    }

    /// One side of a switch in focus, with the rates there.
    fn choice(&mut self, state: &State, switch: usize, side: Side, alpha: f64) -> Choice {
        let mut alphas = state.point.alpha.clone();
        alphas[switch] = alpha;
        let mode = &mut self.mode;
        mode.vary(&alphas);
        let states = mode.focus.states.iter();
        Choice {
            sides: Few::from_slice(&[side]),
            alpha: Few::from_slice(&[alpha]),
            f: states.map(|&state| mode.field.f[state]).collect(),
        }
    }

    /// Moves to where α of a switch on its surface is to be varied.
    pub(crate) fn look_at(&mut self, point: &Point, switch: usize) {
        let sides = point.sides_sliding(&[switch]);
        self.mode.enter(&sides);
        self.mode.focus(point.t, &point.x, &point.alpha, &[switch]);
    }
}
