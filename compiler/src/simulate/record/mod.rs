//! Records a run: points, pieces of the dense output, events and modes.

mod course;
pub(crate) mod elements;
pub(crate) mod modes;
pub(crate) mod pieces;
pub(super) mod points;
pub(crate) mod reported;
pub(crate) mod schedule;
pub(super) mod sensed;
use std::ops::ControlFlow;
use std::sync::Arc;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::hybrid::{Outcome, Side, Status};
use nsd_solver::selector::Decision;

use crate::report::{self, EventKind, History, ModeInterval, Piece, Rows, Trajectory, curve};
use crate::simulate::outcome::limits::Limits;
use crate::simulate::record::course::Course;
use crate::simulate::record::modes::ModeNames;
use crate::simulate::record::points::{Behind, Points, is_one_instant};
use crate::simulate::record::reported::Reported;
use crate::system::System;
use crate::system::experiment::{Sampling, Settings};

/// When the mode changed, from what, to what, and what decided about nonlinear switches.
pub(super) type Change = (f64, Box<[Side]>, Box<[Side]>, Vec<Decision>);

/// Events of which the state behind them is kept.
const MOST_KEPT: usize = 4096;

/// A run, point by point and event by event.
#[derive(Clone, Debug, Default)]
pub(super) struct Record {
    /// Where it is to end.
    pub horizon: f64,
    pub points: Points,
    pub changes: Vec<Change>,
    /// The states behind the first events, one after another.
    pub behind: Vec<f64>,
    /// The least and the largest value of each state, at ends of steps and behind jumps; none before the first.
    pub ranges: Vec<[f64; 2]>,
    /// Instants at which infinitely many events accumulate.
    accumulations: Vec<f64>,
}

impl Record {
    fn widen(&mut self, x: &[f64]) {
        if self.ranges.is_empty() {
            self.ranges = x.iter().map(|&x| [x, x]).collect();
        }
        for ([low, high], &x) in self.ranges.iter_mut().zip(x) {
            (*low, *high) = (low.min(x), high.max(x));
        }
    }
}

/// Observes a run and keeps what the experiment asks for.
pub(super) struct Recorder<'s, 'e> {
    system: &'s System<'e>,
    sampling: Sampling,
    /// Instants sampled so far, of `Every` and `At`.
    sampled: usize,
    /// What is kept.
    pub record: Record,
    /// Whether the polynomials of all steps are kept; else, along curves, those of steps that are longer than a part of the
    /// horizon.
    dense: bool,
    pieces: Vec<Piece>,
    pub reported: Arc<Reported>,
    limits: Limits<'s, 'e>,
    x: Vec<f64>,
    alpha: Vec<f64>,
    /// Whether something has happened since the last step.
    has_turned: bool,
    /// The period of kicks of the state.
    kicks: Option<f64>,
}

impl<'s, 'e> Recorder<'s, 'e> {
    /// For a run with a tolerance; functions that it is reported by have been compiled. `dense` keeps polynomials.
    pub(super) fn new(
        system: &'s System<'e>,
        settings: &Settings,
        tolerance: f64,
        dense: bool,
        reported: Arc<Reported>,
    ) -> Self {
        let (n, m) = (system.states.len(), system.switches.len());
        Recorder {
            system,
            sampling: settings.recording.sampling.clone(),
            sampled: 0,
            record: Record {
                horizon: settings.horizon,
                ..Record::default()
            },
            dense,
            pieces: Vec::new(),
            limits: Limits::new(system, tolerance, &reported),
            reported,
            x: vec![0.0; n],
            alpha: vec![0.0; m],
            has_turned: false,
            kicks: settings.kicks.as_ref().map(|kicks| kicks.every),
        }
    }

    /// Takes α of a mode, where they are known.
    fn mark(&mut self, sides: &[Side]) {
        for (alpha, side) in self.alpha.iter_mut().zip(sides) {
            if *side != Side::Slide {
                *alpha = 0.5 + 0.5 * side.sign();
            }
        }
    }

    /// The next instant to sample, which may lie beyond the horizon.
    fn next_sample(&self) -> Option<f64> {
        let horizon = self.record.horizon;
        match &self.sampling {
            Sampling::Method | Sampling::Curve => None,
            Sampling::Every(period) => Some(points::multiple(*period, self.sampled, horizon)),
            Sampling::At(instants) => instants.get(self.sampled).copied(),
        }
    }

    /// Where a jump is sampled, the instant of its two points, the first of which is recorded by then.
    fn before_jump(&mut self, event: &Event) -> Option<f64> {
        self.mark(event.from);
        let last = self.record.points.last_instant();
        if self.sampling.is_own() {
            if last.is_none() {
                self.x.copy_from_slice(event.before);
                self.push(event.time);
            }
            return Some(event.time);
        }
        let is_here = |t: &f64| is_one_instant(*t, event.time);
        if let Some(last) = last.filter(is_here) {
            return Some(last);
        }
        let next = self.next_sample().filter(is_here)?;
        self.x.copy_from_slice(event.before);
        self.push(next);
        self.sampled += 1;
        Some(next)
    }

    fn push(&mut self, t: f64) {
        // Of the limit of a series of events, rounding may be before the last one of them.
        let last = self.record.points.last_instant();
        let t = last.map_or(t, |last| t.max(last));
        self.system.see(t, &self.x, &mut self.alpha);
        self.record.points.push(t, &self.x, &self.alpha);
    }

    /// Keeps the values behind the last row where a step begins at its instant and something may jump there.
    fn look_behind(&mut self, segment: &Segment) {
        let t = segment.start;
        let has_turned = std::mem::take(&mut self.has_turned);
        let points = &mut self.record.points;
        let Some(last) = points
            .last_instant()
            .filter(|last| is_one_instant(*last, t))
        else {
            return;
        };
        let is_kick = |every: f64| t > 0.0 && is_one_instant(t, (t / every).round() * every);
        let is_kicked = self.kicks.is_some_and(is_kick);
        if !has_turned && !is_kicked && !self.system.steps_at(last) {
            return;
        }
        let n = self.x.len();
        // At the limit of a series of events the state is continuous but for what the last ones of them would do.
        match self.record.accumulations.last() == Some(&t) && !is_kicked {
            true => self.x.copy_from_slice(points.last_state(n)),
            false => segment.state(0.0, &mut self.x),
        }
        segment.alpha(0.0, &mut self.alpha);
        self.system.see(t, &self.x, &mut self.alpha);
        points.go_on(Behind {
            x: self.x.clone(),
            alpha: self.alpha.clone(),
            is_certain: is_kicked,
        });
    }

    /// Names the recorded run.
    pub(super) fn fill(
        mut self,
        system: &System,
        names: &ModeNames,
        outcome: &Outcome,
        trajectory: &mut Trajectory,
    ) {
        // What jumps in the last instant has both values there, and the run ends with the second.
        let points = &self.record.points;
        let jumps_last = (points.jumps.last()).is_some_and(|jump| jump.time >= outcome.time);
        let is_known = points.last_instant() == Some(outcome.time)
            && (!jumps_last || points.states.ends_with(&outcome.x));
        if !is_known {
            self.x.copy_from_slice(&outcome.x);
            self.alpha.copy_from_slice(&outcome.alpha);
            self.push(outcome.time);
        }
        self.record.points.end(system);
        if self.dense {
            self.add_instants(jumps_last.then_some(outcome));
        }
        trajectory.warnings.extend(self.limits.warnings());
        trajectory.history = self.history(names, outcome);
        self.record.points.jumps = Vec::new();
        let pieces = Arc::new(self.pieces);
        let course = Course {
            points: self.record.points,
            pieces: match self.sampling {
                Sampling::Curve => pieces.clone(),
                _ => Arc::default(),
            },
            given: self.reported.given(system),
            reported: self.reported,
        };
        trajectory.samples = match course.is_whole() {
            true => Rows::of(course),
            false => course.seen(&|t, x, alpha| system.see(t, x, alpha)).into(),
        };
        if self.dense {
            trajectory.dense.pieces = pieces;
        }
    }

    /// Adds pieces of no length before what jumps at the first instant, and behind what jumps at the `last` one.
    fn add_instants(&mut self, last: Option<&Outcome>) {
        let data = &self.system.exogenous.data;
        let (Some(from), Some(to)) = (
            self.pieces.first().map(|piece| piece.from),
            self.pieces.last().map(|piece| piece.to),
        ) else {
            return;
        };
        if self.record.points.times.starts_with(&[from, from]) {
            let (x, alpha) = self.record.points.first([self.x.len(), self.alpha.len()]);
            let before = pieces::of_instant(from, [x, alpha], data);
            self.pieces.insert(0, before);
        }
        let last = last.map(|last| pieces::of_instant(to, [&last.x, &last.alpha], data));
        self.pieces.extend(last);
    }

    fn history(&self, names: &ModeNames, outcome: &Outcome) -> History {
        let changes: Vec<(&Change, Vec<modes::Change>)> = (self.record.changes.iter())
            .map(|change| (change, names.decided(&change.1, &change.2, &change.3)))
            .filter(|(_, what)| !what.is_empty())
            .collect();
        let first = self
            .record
            .changes
            .first()
            .map_or(&outcome.sides[..], |(_, from, ..)| from);
        let interval = |from: f64, to: f64, sides: &[Side]| ModeInterval {
            from,
            to,
            mode: names.mode(sides),
            contacts: Vec::new(),
            regions: names.regions(sides),
            between: (names.sliding_between(sides).into_iter())
                .map(|set| set.into_iter().map(str::to_owned).collect())
                .collect(),
            sides: names.sides(sides),
        };
        let mut jumps = self.record.points.jumps.iter().peekable();
        let instants = || changes.iter().map(|((time, ..), _)| *time);
        let ends = instants().chain([outcome.time]);
        let starts = [0.0].into_iter().chain(instants());
        let sides = [first]
            .into_iter()
            .chain(changes.iter().map(|((_, _, to, _), _)| &to[..]));
        let mut modes: Vec<ModeInterval> = (starts.zip(ends).zip(sides))
            .map(|((from, to), sides)| interval(from, to, sides))
            .collect();
        // A run that does not get away from its start has no mode.
        if outcome.time == 0.0 && self.record.changes.is_empty() {
            modes.clear();
        }
        let mut events = Vec::new();
        for ((time, from, to, _), what) in changes {
            while let Some(jump) = jumps.next_if(|jump| jump.time <= *time) {
                events.extend(jump.events(names, &names.mode(from)));
            }
            let (mode_from, mode_to) = (names.mode(from), names.mode(to));
            let limit = self.record.accumulations.contains(time);
            let mut ended: Vec<String> = Vec::new();
            for change in what {
                // What accumulates on a surface is told once, however many switches it has.
                let ends = limit && !ended.contains(&change.surface);
                ended.extend(ends.then(|| change.surface.clone()));
                let limit = ends.then_some(EventKind::Zeno);
                for kind in [Some(change.kind), limit].into_iter().flatten() {
                    events.push(report::Event {
                        time: *time,
                        kind,
                        surface: change.surface.clone(),
                        from: mode_from.clone(),
                        to: mode_to.clone(),
                        span: change.span,
                        sliding: change.sliding.clone(),
                    });
                }
            }
        }
        let last = modes.last().map_or("", |mode| &mode.mode);
        events.extend(jumps.flat_map(|jump| jump.events(names, last)));
        let stops = outcome.stats.stopped_by.into_iter();
        events.extend(stops.map(|law| names.event(outcome.time, law, last)));
        let switches = self.system.switches.iter();
        History {
            events,
            modes,
            switches: switches.map(|switch| switch.name.clone()).collect(),
            aliases: self.system.provenance.aliases.clone(),
            averaged: Vec::new(),
        }
    }
}

/// The trajectory of a run that another method has made: its points, its polynomials, and the sides of the switches
/// from some instants on; what is reported is compiled with some parameters open, by their numbers.
pub(crate) fn recorded(
    system: &System,
    settings: &Settings,
    points: Points,
    pieces: Vec<Piece>,
    sides: &[(f64, Box<[Side]>)],
    open: &[usize],
) -> Trajectory {
    let names = ModeNames::new(system);
    let (n, m) = (system.states.len(), system.switches.len());
    let last = |values: &[f64], n: usize| values[values.len() - n..].to_vec();
    let (x, alpha) = (last(&points.states, n), last(&points.alphas, m));
    let (first, end) = (sides.first(), sides.last());
    let whole = |sides: Option<&(f64, Box<[Side]>)>| {
        sides.map_or_else(|| vec![Side::Plus; m], |(_, sides)| sides.to_vec())
    };
    let time = points.times.last().copied().unwrap_or(0.0);
    let outcome = Outcome {
        alpha: alpha.clone(),
        ..Outcome::at(Status::Solved, time, x.clone(), whole(end.or(first)))
    };
    let changes = sides.windows(2).filter(|pair| pair[0].1 != pair[1].1);
    let changes = changes.map(|pair| {
        let (from, to) = (pair[0].1.clone(), pair[1].1.clone());
        (pair[1].0, from, to, Vec::new())
    });
    let record = Record {
        horizon: settings.horizon,
        points,
        changes: changes.collect(),
        ..Record::default()
    };
    let reported = Arc::new(Reported::new(system, open));
    let tolerance = settings.numerics.tolerance;
    let recorder = Recorder {
        record,
        pieces,
        x,
        alpha,
        ..Recorder::new(system, settings, tolerance, true, reported)
    };
    let mut trajectory = Trajectory::default();
    recorder.fill(system, &names, &outcome, &mut trajectory);
    trajectory
}

impl Observer for Recorder<'_, '_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let end = segment.until;
        self.look_behind(segment);
        if self.record.ranges.is_empty() {
            segment.state(0.0, &mut self.x);
            self.record.widen(&self.x);
        }
        self.record.widen(segment.end);
        self.limits.segment(segment);
        let has_rows_inside = self.sampling == Sampling::Curve
            && curve::is_divided(segment.length, self.record.horizon);
        if self.dense || has_rows_inside {
            let mut piece = pieces::of_segment(segment, end, &self.system.exogenous.data);
            // Pieces of a run are without gaps.
            let last = self.pieces.last();
            piece.from = last.map_or(piece.from, |last| piece.from.max(last.to));
            self.pieces.push(piece);
        }
        if self.sampling.is_own() {
            if self.record.points.times.is_empty() {
                segment.state(0.0, &mut self.x);
                segment.alpha(0.0, &mut self.alpha);
                self.push(segment.start);
            }
            self.x.copy_from_slice(segment.end);
            segment.alpha(segment.length, &mut self.alpha);
            self.push(end);
        }
        while let Some(t) = self
            .next_sample()
            .filter(|t| *t <= end || is_one_instant(*t, end))
            .filter(|t| *t <= self.record.horizon)
        {
            segment.state(t - segment.start, &mut self.x);
            segment.alpha(t - segment.start, &mut self.alpha);
            self.push(t);
            self.sampled += 1;
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        self.has_turned = true;
        self.record.widen(event.x);
        if event.accumulates {
            self.record.accumulations.push(event.time);
        }
        if !event.jumps.is_empty() {
            let sampled = self.before_jump(event);
            let laws = event.jumps.to_vec();
            (self.record.points).jump(event.time, laws, event.before, event.x);
            if let Some(t) = sampled {
                self.mark(event.to);
                self.x.copy_from_slice(event.x);
                self.push(t);
            }
        }
        if self.record.changes.len() < MOST_KEPT {
            self.record.behind.extend_from_slice(event.x);
        }
        self.record.changes.push((
            event.time,
            event.from.into(),
            event.to.into(),
            event.decisions.to_vec(),
        ));
    }
}
