//! Records a run: points, pieces of the dense output, events and modes.

pub(crate) mod elements;
pub(crate) mod modes;
pub(crate) mod pieces;
pub(crate) mod reported;
pub(crate) mod schedule;
use std::ops::ControlFlow;
use std::sync::Arc;

use nsd_solver::event::{Event, Observer, Segment};
use nsd_solver::hybrid::{Outcome, Side, Status};
use nsd_solver::selector::Decision;

use crate::report::{self, EventKind, ModeInterval, Piece, Series, Trajectory, curve};
use crate::simulate::outcome::limits::Limits;
use crate::simulate::record::modes::ModeNames;
use crate::simulate::record::reported::Reported;
use crate::system::System;
use crate::system::experiment::{Sampling, Settings};

/// When the mode changed, from what, to what, and what decided about nonlinear switches.
pub(super) type Change = (f64, Box<[Side]>, Box<[Side]>, Vec<Decision>);

/// Events of which the state behind them is kept.
const MOST_KEPT: usize = 4096;

/// Instants this close, relative to them, are one: that of a jump has the rounding of the steps up to it.
const SAME_INSTANT: f64 = 16.0 * f64::EPSILON;

/// States that have jumped.
#[derive(Clone, Debug)]
pub(super) struct Jump {
    pub time: f64,
    /// The laws, in order.
    laws: Vec<usize>,
    /// Points recorded before.
    pub n_points: usize,
    pub before: Vec<f64>,
    pub after: Vec<f64>,
}

/// A run, point by point and event by event.
#[derive(Clone, Debug, Default)]
pub(super) struct Record {
    /// Where it is to end.
    pub horizon: f64,
    /// Instants, and states and α at them, one after another.
    pub times: Vec<f64>,
    pub states: Vec<f64>,
    pub alphas: Vec<f64>,
    pub changes: Vec<Change>,
    pub jumps: Vec<Jump>,
    /// The states behind the first events, one after another.
    pub behind: Vec<f64>,
    /// Instants at which infinitely many events accumulate.
    accumulations: Vec<f64>,
}

impl Record {
    fn push(&mut self, t: f64, x: &[f64], alpha: &[f64]) {
        self.times.push(t);
        self.states.extend_from_slice(x);
        self.alphas.extend_from_slice(alpha);
    }

    /// Adds rows inside of steps, from their polynomials, and says which of all rows these are; nothing where there are none.
    fn divide(&mut self, system: &System, pieces: &[Piece]) -> Vec<bool> {
        let (n, m) = (system.states.len(), system.switches.len());
        let span = self.times.last().copied().unwrap_or(0.0);
        let mut lengths = pieces.iter().map(|piece| piece.to - piece.from);
        if !lengths.any(|length| curve::is_divided(length, span)) {
            return Vec::new();
        }
        let times = std::mem::take(&mut self.times);
        let states = std::mem::take(&mut self.states);
        let alphas = std::mem::take(&mut self.alphas);
        let parts = pieces.iter().flat_map(|piece| {
            let instants = curve::instants(piece.from, piece.to, span);
            instants.map(move |t| (t, piece))
        });
        let is_inside = |(t, piece): &(f64, &Piece)| piece.from < *t && *t < piece.to;
        let mut parts = parts.filter(is_inside).peekable();
        let mut inside = Vec::new();
        for (k, &t) in times.iter().enumerate() {
            while let Some((at, piece)) = parts.next_if(|(at, _)| *at < t) {
                let mut row = piece.at(at);
                let (x, alpha) = row[..n + m].split_at_mut(n);
                system.see(at, x, alpha);
                self.push(at, x, alpha);
                inside.push(true);
            }
            // An instant has one row.
            parts.next_if(|(at, _)| *at == t);
            self.push(t, &states[k * n..][..n], &alphas[k * m..][..m]);
            inside.push(false);
        }
        inside
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
            sampling: settings.sampling.clone(),
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
        match &self.sampling {
            Sampling::Method | Sampling::Curve => None,
            Sampling::Every(period) => Some(self.sampled as f64 * period),
            Sampling::At(instants) => instants.get(self.sampled).copied(),
        }
    }

    /// Where a jump is sampled, the instant of its two points, the first of which is recorded by then.
    fn before_jump(&mut self, event: &Event) -> Option<f64> {
        self.mark(event.from);
        let last = self.record.times.last().copied();
        if self.sampling.is_own() {
            if last.is_none() {
                self.x.copy_from_slice(event.before);
                self.push(event.time);
            }
            return Some(event.time);
        }
        let is_here = |t: &f64| (t - event.time).abs() <= SAME_INSTANT * event.time.abs();
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
        let t = self.record.times.last().map_or(t, |last| t.max(*last));
        self.system.see(t, &self.x, &mut self.alpha);
        self.record.push(t, &self.x, &self.alpha);
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
        let jumps_last = (self.record.jumps.last()).is_some_and(|jump| jump.time >= outcome.time);
        let is_known = self.record.times.last() == Some(&outcome.time)
            && (!jumps_last || self.record.states.ends_with(&outcome.x));
        if !is_known {
            self.x.copy_from_slice(&outcome.x);
            self.alpha.copy_from_slice(&outcome.alpha);
            self.push(outcome.time);
        }
        if self.dense
            && jumps_last
            && let Some(last) = self.pieces.last().map(|piece| piece.to)
        {
            let piece = pieces::of_instant(last, outcome, &self.system.data);
            self.pieces.push(piece);
        }
        let inside = match self.sampling {
            Sampling::Curve => self.record.divide(system, &self.pieces),
            _ => Vec::new(),
        };
        for group in &system.groups {
            let rows = self.record.states.chunks(system.states.len().max(1));
            trajectory.states.push(Series {
                name: group.name.clone(),
                shape: group.shape.clone(),
                values: rows
                    .flat_map(|row| group.entries.iter().map(|&entry| row[entry]))
                    .collect(),
            });
        }
        let points = [
            &self.record.times[..],
            &self.record.states,
            &self.record.alphas,
        ];
        [trajectory.outputs, trajectory.controls] = self.reported.series(system, points);
        trajectory.warnings.extend(self.limits.warnings());
        self.name_modes(names, outcome, trajectory);
        trajectory.time = self.record.times;
        if !inside.is_empty() {
            curve::thin(trajectory, &inside);
        }
        if self.dense {
            trajectory.dense.pieces = self.pieces;
        }
    }

    fn name_modes(&self, names: &ModeNames, outcome: &Outcome, trajectory: &mut Trajectory) {
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
        let mut jumps = self.record.jumps.iter().peekable();
        let instants = || changes.iter().map(|((time, ..), _)| *time);
        let ends = instants().chain([outcome.time]);
        let starts = [0.0].into_iter().chain(instants());
        let sides = [first]
            .into_iter()
            .chain(changes.iter().map(|((_, _, to, _), _)| &to[..]));
        trajectory.modes = starts
            .zip(ends)
            .zip(sides)
            .map(|((from, to), sides)| interval(from, to, sides))
            .collect();
        // A run that does not get away from its start has no mode.
        if outcome.time == 0.0 && self.record.changes.is_empty() {
            trajectory.modes.clear();
        }
        for ((time, from, to, _), what) in changes {
            while let Some(jump) = jumps.next_if(|jump| jump.time <= *time) {
                trajectory
                    .events
                    .extend(jump.events(names, &names.mode(from)));
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
                    trajectory.events.push(report::Event {
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
        let last = trajectory.modes.last().map(|mode| mode.mode.clone());
        let last = last.unwrap_or_default();
        trajectory
            .events
            .extend(jumps.flat_map(|jump| jump.events(names, &last)));
    }
}

impl Jump {
    /// One event per law, in a mode.
    fn events<'j>(
        &'j self,
        names: &'j ModeNames,
        mode: &'j str,
    ) -> impl Iterator<Item = report::Event> + 'j {
        self.laws.iter().map(move |&law| {
            let (surface, span) = names.law(law);
            report::Event {
                time: self.time,
                kind: EventKind::Jump,
                surface,
                from: mode.to_owned(),
                to: mode.to_owned(),
                span: Some(span),
                sliding: Vec::new(),
            }
        })
    }
}

/// States and α at instants, and jumps.
#[derive(Clone, Debug, Default)]
pub(crate) struct Points {
    times: Vec<f64>,
    states: Vec<f64>,
    alphas: Vec<f64>,
    jumps: Vec<Jump>,
}

impl Points {
    /// Takes note of a jump of states by laws.
    pub fn jump(&mut self, time: f64, mut laws: Vec<usize>, before: &[f64], after: &[f64]) {
        laws.sort_unstable();
        laws.dedup();
        self.jumps.push(Jump {
            time,
            laws,
            n_points: self.times.len(),
            before: before.to_vec(),
            after: after.to_vec(),
        });
    }

    /// The jumps alone.
    pub fn emptied(self) -> Self {
        Points {
            jumps: self.jumps,
            ..Points::default()
        }
    }

    /// Adds an instant behind the others.
    pub fn push(&mut self, time: f64, x: &[f64], alpha: &[f64]) {
        self.times.push(time);
        self.states.extend_from_slice(x);
        self.alphas.extend_from_slice(alpha);
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
        times: points.times,
        states: points.states,
        alphas: points.alphas,
        jumps: points.jumps,
        changes: changes.collect(),
        ..Record::default()
    };
    let reported = Arc::new(Reported::new(system, open));
    let recorder = Recorder {
        record,
        pieces,
        x,
        alpha,
        ..Recorder::new(system, settings, settings.tolerance, true, reported)
    };
    let mut trajectory = Trajectory {
        switches: (system.switches.iter())
            .map(|switch| switch.name.clone())
            .collect(),
        ..Trajectory::default()
    };
    recorder.fill(system, &names, &outcome, &mut trajectory);
    trajectory
}

impl Observer for Recorder<'_, '_> {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        let end = segment.until;
        self.limits.segment(segment);
        let has_rows_inside = self.sampling == Sampling::Curve
            && curve::is_divided(segment.length, self.record.horizon);
        if self.dense || has_rows_inside {
            let mut piece = pieces::of_segment(segment, end, &self.system.data);
            // Pieces of a run are without gaps.
            let last = self.pieces.last();
            piece.from = last.map_or(piece.from, |last| piece.from.max(last.to));
            self.pieces.push(piece);
        }
        if self.sampling.is_own() {
            if self.record.times.is_empty() {
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
            .filter(|t| *t <= end && *t <= self.record.horizon)
        {
            segment.state(t - segment.start, &mut self.x);
            segment.alpha(t - segment.start, &mut self.alpha);
            self.push(t);
            self.sampled += 1;
        }
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        if event.accumulates {
            self.record.accumulations.push(event.time);
        }
        if !event.jumps.is_empty() {
            let sampled = self.before_jump(event);
            self.record.jumps.push(Jump {
                time: event.time,
                laws: event.jumps.to_vec(),
                n_points: self.record.times.len(),
                before: event.before.to_vec(),
                after: event.x.to_vec(),
            });
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
