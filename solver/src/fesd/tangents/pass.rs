//! The pass from the start of a run to its end.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::Of;
use super::active::{Active, Here, Parameters};
use super::element::{End, Motion, Start, motions};
use super::recording::{Part, Piece, Recording};
use super::rows::{Row, read};
use super::zero::{Known, rate, switches, weigh};
use crate::fesd::element::solved::Solved;
use crate::fesd::system::Reduced;
use crate::hybrid::Side;
use crate::linalg::Singular;
use crate::sensitivity::{
    Directions, EventTime, Loss, Moment, Moved, Sensitivities, Sizes, Why, least_rate,
};

/// Instants of a clock that stands still are this close, as a share of them, and what happens there is one event.
const ONE_INSTANT: f64 = 1e-9;

/// Rounding of rounding, over the share of its size up to which a tangent is none.
const ROUNDED: f64 = 1e6 * f64::EPSILON * f64::EPSILON;

/// The tangents of a run, so far.
pub(super) struct Pass<'r> {
    of: Of<'r>,
    parameters: Parameters,
    actives: FxHashMap<*const Reduced, Active>,
    /// How the end of the last element moves, by direction; none where that is not known.
    ends: Vec<Option<End>>,
    found: Sensitivities,
    sizes: Sizes,
    /// The piece before; none at the start.
    last: Option<Last>,
}

/// What a piece leaves.
struct Last {
    reduced: Arc<Reduced>,
    numbers: Vec<f64>,
    /// Where it ends.
    x: Vec<f64>,
    /// Of the switch that it ends at, what it is about, and how far its instant may be off.
    met: Option<(Vec<usize>, f64)>,
}

/// Why all directions are lost, and the switches that it is about.
type Failed = (Why, Vec<usize>);

impl<'r> Pass<'r> {
    pub fn new(of: Of<'r>, directions: &Directions, instants: &[Moment]) -> Self {
        let (n, d) = (of.system.n_states(), directions.len());
        let start = |x: &Vec<f64>| {
            Some(End {
                x: x.clone(),
                time: 0.0,
            })
        };
        Pass {
            parameters: Parameters::new(&directions.parameters, of.system.parameters.len()),
            actives: FxHashMap::default(),
            ends: directions.initial.iter().map(start).collect(),
            found: Sensitivities::new(
                of.accuracy.width(),
                [n + of.system.n_switches(), d],
                instants,
            ),
            sizes: Sizes::new(n, d),
            last: None,
            of,
        }
    }

    /// Goes through a recorded run.
    pub fn follow(mut self, recording: &Recording) -> Sensitivities {
        let last = recording.pieces().next_back().map(|(at, _)| at);
        for (at, part) in recording.parts.iter().enumerate() {
            // What has ended all derivatives may have been an event.
            let is_event = matches!(part, Part::Event { .. });
            if !is_event && self.ends.iter().all(Option::is_none) {
                break;
            }
            match part {
                Part::Piece(piece) => {
                    let own = self.ends_of(piece);
                    self.piece(piece, last == Some(at));
                    self.turn(piece.until, &own);
                }
                Part::Event { time } => self.event(*time),
                Part::Fold { time, sliding } => {
                    let last = self.last.as_ref();
                    let time = last.map_or(*time, |last| self.of.time(*time, &last.x));
                    self.lose_all(time, (Why::Fold, sliding.clone()));
                }
            }
        }
        self.found
    }

    fn lose(&mut self, time: f64, (why, switches): Failed, direction: usize) {
        self.ends[direction] = None;
        let loss = Loss {
            time,
            why,
            switches,
        };
        self.found.lose(direction, loss);
    }

    fn lose_all(&mut self, time: f64, failed: Failed) {
        for d in 0..self.ends.len() {
            if self.ends[d].is_some() {
                self.lose(time, failed.clone(), d);
            }
        }
    }

    /// The switches that a piece begins or ends with.
    fn ends_of(&self, piece: &Piece) -> Vec<usize> {
        let met = self.last.iter().filter_map(|last| last.met.as_ref());
        let at_end = piece
            .member
            .map(|k| switches(self.of.system, &piece.reduced, k));
        met.map(|met| &met.0)
            .chain(&at_end)
            .flatten()
            .copied()
            .collect()
    }

    /// Surfaces that were touched up to an instant, or were not as far as that can be told; on those of switches that the
    /// elements before it begin or end with these do so.
    fn turn(&mut self, until: f64, ends: &[usize]) {
        let place = self.of.turns.partition_point(|turn| turn.time <= until);
        let (now, later) = self.of.turns.split_at(place);
        self.of.turns = later;
        for turn in now.iter().filter(|turn| !ends.contains(&turn.switch)) {
            if turn.distance.abs() <= self.of.accuracy.closeness() * turn.size {
                self.lose_all(turn.time, (Why::Grazing, vec![turn.switch]));
            }
        }
    }

    fn event(&mut self, time: f64) {
        let clock = self.of.clock;
        let last = self.last.as_ref();
        let time = last.map_or(time, |last| self.of.time(time, &last.x));
        let before = self.found.events.last().filter(|_| clock.is_some());
        if before.is_some_and(|before| (time - before.time).abs() <= ONE_INSTANT * time.abs()) {
            return;
        }
        let by = |end: &Option<End>| match (end, clock) {
            (None, _) => f64::NAN,
            (Some(end), None) => end.time,
            (Some(end), Some(clock)) => end.x[clock],
        };
        let by = self.ends.iter().map(by).collect();
        self.found.events.push(EventTime { time, by });
        self.sizes.turn();
    }

    /// Takes tangents along elements of equal length.
    fn piece(&mut self, piece: &Piece, is_last: bool) {
        let key = Arc::as_ptr(&piece.reduced);
        let (n, parameters) = (self.of.system.n_states(), &self.parameters);
        let made = || {
            let sizes = (n, piece.numbers.len());
            Active::new(self.of.scheme, sizes, piece.reduced.clone(), parameters)
        };
        let mut active = self.actives.remove(&key).unwrap_or_else(made);
        active.set_numbers(&piece.numbers);
        let done = self.pass(&mut active, piece, is_last);
        self.actives.insert(key, active);
        if let Err(failed) = done {
            let first = &piece.elements[0];
            self.lose_all(self.of.time(first.t, &first.x), failed);
        }
    }

    fn pass(&mut self, active: &mut Active, piece: &Piece, is_last: bool) -> Result<(), Failed> {
        let nowhere = |why: Why| (why, Vec::new());
        let limited = self.of.limit.check();
        limited.map_err(|over| nowhere(over.into()))?;
        let reduced = &piece.reduced;
        if reduced.kept.is_some() || reduced.watched.iter().any(|watched| watched.stops) {
            return Err(nowhere(Why::Unknown));
        }
        let singular = |_: Singular| nowhere(Why::Singular);
        let start = self.enter(active, piece).map_err(singular)?;
        if piece.elements[0].h == 0.0 {
            self.pass_point(piece, &start);
            return Ok(());
        }
        let (rows, motions) = self.march(active, piece, is_last).map_err(singular)?;
        let last = &piece.elements[piece.elements.len() - 1];
        let end = self.at(active, last, true).map_err(singular)?;
        let x = self.end_of(last);
        self.sizes.see(&x, &end.f);
        let found = match piece.member {
            None => Ok((self.shifts(piece), None)),
            Some(member) => {
                let met = self.meet(active, piece, member, (&motions, &end));
                met.map(|(lengths, width)| (lengths, Some(width)))
            }
        };
        let about = piece.member.map(|k| switches(self.of.system, reduced, k));
        let width = found.as_ref().ok().and_then(|(_, width)| *width);
        self.last = Some(Last {
            reduced: reduced.clone(),
            numbers: piece.numbers.clone(),
            met: about.clone().zip(width),
            x,
        });
        match found {
            Ok((lengths, _)) => {
                self.write(rows, &lengths);
                self.leave(piece, motions, &lengths, &end.f);
                self.check_rest(piece, &start, &end);
            }
            Err(why) => {
                // Before the switch there are derivatives.
                self.write(rows, &self.shifts(piece));
                self.lose_all(self.time_behind(piece), (why, about.unwrap_or_default()));
            }
        }
        Ok(())
    }

    /// What is known at the start of an element, or at its end.
    fn at(&self, active: &mut Active, solved: &Solved, is_end: bool) -> Result<Here, Singular> {
        match is_end {
            true => {
                let (t, x) = (solved.stop().0, self.end_of(solved));
                active.here(t, (&x, &solved.w), &self.parameters)
            }
            false => {
                let n = solved.x.len();
                let per_node = n + active.reduced.unknowns.len();
                let w = &solved.unknowns[n..per_node];
                active.here(solved.t, (&solved.x, w), &self.parameters)
            }
        }
    }

    fn end_of(&self, solved: &Solved) -> Vec<f64> {
        let terms = solved.x.iter().zip(&solved.mean);
        terms.map(|(x, mean)| x + solved.h * mean).collect()
    }

    /// Comes to the start of elements.
    fn enter(&mut self, active: &mut Active, piece: &Piece) -> Result<Here, Singular> {
        let first = &piece.elements[0];
        let here = self.at(active, first, false)?;
        let time = self.of.time(first.t, &first.x);
        self.sizes.see(&first.x, &here.f);
        let last = self.last.as_ref();
        if last.is_some_and(|last| self.has_jumped(&last.x, &first.x)) {
            self.lose_all(time, (Why::Unknown, Vec::new()));
        }
        let last = self.last.as_ref();
        let is_other = |last: &Last| !Arc::ptr_eq(&last.reduced, &piece.reduced);
        let jumps = last.is_none_or(|last| last.numbers != piece.numbers);
        // A switch at a breakpoint is one before it or behind it.
        let met = last.and_then(|last| last.met.clone()).filter(|_| jumps);
        if let Some((switches, _)) = met {
            for d in 0..self.ends.len() {
                if self.ends[d].as_ref().is_some_and(|end| end.time != 0.0) {
                    self.lose(time, (Why::Several, switches.clone()), d);
                }
            }
        }
        let algebraic = &self.of.system.algebraic_states;
        if jumps && !algebraic.is_empty() {
            for (d, end) in self.ends.iter_mut().enumerate() {
                if let Some(end) = end {
                    here.keep(algebraic, &mut end.x, d)?;
                    add_algebraic(&mut self.sizes, algebraic, d, &end.x);
                }
            }
        }
        if self.last.as_ref().is_none_or(is_other) || jumps {
            self.check_start(piece, &here);
        }
        Ok(here)
    }

    /// Whether a state that no equation determines is not where it was.
    fn has_jumped(&self, before: &[f64], x: &[f64]) -> bool {
        const MOVED: f64 = 1e-6;
        let algebraic = &self.of.system.algebraic_states;
        let moved = |i: &usize| (x[*i] - before[*i]).abs() > MOVED * self.sizes.largest[*i];
        (0..x.len()).any(|i| moved(&i) && !algebraic.contains(&i))
    }

    fn known(&self, t: f64, instant: f64) -> Known<'_> {
        Known {
            t,
            share: self.of.accuracy.width(),
            instant,
            sizes: &self.sizes.largest,
        }
    }

    /// How large the terms of a motion are.
    fn sizes_of(&self, end: &End, f: &[f64], direction: usize) -> Vec<f64> {
        let back: Vec<f64> = end.x.iter().zip(f).map(|(x, f)| x - f * end.time).collect();
        let faded = self.of.accuracy.faded();
        let sizes = self.sizes.moved((&back, end.time), f, direction, faded);
        // What comes to an entry through others is at least rounding of what rounding leaves of the largest one.
        let least = ROUNDED * crate::linalg::largest(&back);
        sizes.into_iter().map(|size| size + least).collect()
    }

    /// What is zero where an active set begins stays so.
    fn check_start(&mut self, piece: &Piece, here: &Here) {
        let (first, last) = (&piece.elements[0], self.last.as_ref());
        let met = last.and_then(|last| last.met.as_ref());
        let known = self.known(first.t, met.map_or(0.0, |met| met.1));
        let zero: Vec<usize> = here.zero(&known).collect();
        let why = if last.is_none() {
            Why::Start
        } else {
            Why::Several
        };
        let slides = |i: &usize| piece.reduced.sides[*i] == Side::Slide;
        let mut lost = Vec::new();
        for (d, end) in self.ends.iter().enumerate() {
            let Some(end) = end else { continue };
            let size = self.sizes_of(end, &here.f, d);
            let moved = Moved {
                x: &end.x,
                size: &size,
                time: end.time,
            };
            if here.is_not_kept(moved, d) {
                let all = (0..piece.reduced.sides.len()).filter(slides);
                lost.push((d, all.collect()));
            } else if let Some(k) = here.left(zero.iter().copied(), moved, d) {
                lost.push((d, switches(self.of.system, &piece.reduced, k)));
            }
        }
        let time = self.of.time(first.t, &first.x);
        for (d, switches) in lost {
            self.lose(time, (why, switches), d);
        }
    }

    /// A switch where its element begins: it takes place at one instant with the one before, or not.
    fn pass_point(&mut self, piece: &Piece, here: &Here) {
        let first = &piece.elements[0];
        let Some(member) = piece.member else { return };
        for d in 0..self.ends.len() {
            let Some(end) = &self.ends[d] else { continue };
            let size = self.sizes_of(end, &here.f, d);
            let moved = Moved {
                x: &end.x,
                size: &size,
                time: end.time,
            };
            if let Some(k) = here.left([member].into_iter(), moved, d) {
                let about = switches(self.of.system, &piece.reduced, k);
                let time = self.of.time(first.t, &first.x);
                self.lose(time, (Why::Several, about), d);
            }
        }
        let about = switches(self.of.system, &piece.reduced, member);
        self.last = Some(Last {
            reduced: piece.reduced.clone(),
            numbers: piece.numbers.clone(),
            x: first.x.clone(),
            met: Some((about, 0.0)),
        });
    }

    /// Tangents along all elements of a piece, with those by their common length, and the rows inside of them.
    fn march(
        &mut self,
        active: &mut Active,
        piece: &Piece,
        is_last: bool,
    ) -> Result<(Vec<Row>, Vec<Option<Motion>>), Singular> {
        let n = self.of.system.n_states();
        let still = |end: &Option<End>| Some((end.clone()?, 0.0));
        let mut starts: Vec<Start> = self.ends.iter().map(still).collect();
        let of_length = End {
            x: vec![0.0; n],
            time: 0.0,
        };
        starts.push(Some((of_length, 1.0)));
        let (mut rows, mut found) = (Vec::new(), Vec::new());
        for (at, solved) in piece.elements.iter().enumerate() {
            found = motions(active, self.of.scheme, solved, &starts, &self.parameters)?;
            let ends_piece = at + 1 == piece.elements.len();
            let until = if ends_piece {
                piece.until
            } else {
                solved.stop().0
            };
            let ends = (until, is_last && ends_piece);
            let asked = (&self.found, &self.parameters);
            read(&self.of, asked, active, (solved, &found), ends, &mut rows);
            for (start, motion) in starts.iter_mut().zip(&found) {
                if let (Some((start, _)), Some(motion)) = (start, motion) {
                    *start = motion.end.clone();
                }
            }
        }
        Ok((rows, found))
    }

    /// How the length of the elements of a piece moves whose end stays, by direction.
    fn shifts(&self, piece: &Piece) -> Vec<f64> {
        let count = piece.elements.len() as f64;
        let shift = |end: &Option<End>| end.as_ref().map_or(f64::NAN, |end| -end.time / count);
        self.ends.iter().map(shift).collect()
    }

    /// The same where it ends at a switch, and how far the instant of that may be off.
    fn meet(
        &self,
        active: &mut Active,
        piece: &Piece,
        member: usize,
        (motions, end): (&[Option<Motion>], &Here),
    ) -> Result<(Vec<f64>, f64), Why> {
        let slope = &end.members[member].1;
        let own = rate(slope, &end.f);
        let width = self.of.accuracy.closeness() * weigh(slope, |i| self.sizes.states.of(i));
        let speed = weigh(slope, |i| self.sizes.speeds.of(i)) + slope.time.abs();
        let last = &piece.elements[piece.elements.len() - 1];
        let start = self.at(active, last, false);
        let bend = start.map(|start| (own - rate(&start.members[member].1, &start.f)) / last.h);
        if own.is_nan() || own.abs() <= least_rate(speed, bend.ok(), width) {
            return Err(Why::Grazing);
        }
        let along = |(d, motion): (usize, &Option<Motion>)| {
            motion.as_ref().map_or(f64::NAN, |motion| {
                let End { x, time } = &motion.end;
                let moved = Moved {
                    time: *time,
                    ..Moved::still(x)
                };
                slope.along(moved, d)[0]
            })
        };
        let mut along: Vec<f64> = motions.iter().enumerate().map(along).collect();
        let by_length = along.pop().unwrap_or(f64::NAN);
        let lengths = along.into_iter().map(|along| -along / by_length);
        Ok((lengths.collect(), width / own.abs()))
    }

    /// Writes the rows of a piece down.
    fn write(&mut self, rows: Vec<Row>, lengths: &[f64]) {
        let shape = (self.of.system.n_states(), self.of.clock);
        for row in rows {
            let (point, tangents) = row.whole(shape, lengths);
            let write = |row: &mut [f64]| row.copy_from_slice(&point);
            self.found.push(write, |d, row| {
                row.copy_from_slice(tangents[d].as_ref()?);
                Some(())
            });
        }
    }

    /// Comes to the end of a piece, where rates are these.
    fn leave(
        &mut self,
        piece: &Piece,
        mut motions: Vec<Option<Motion>>,
        lengths: &[f64],
        f: &[f64],
    ) {
        let (of_length, time) = (motions.pop().flatten(), self.time_behind(piece));
        for (d, motion) in motions.into_iter().enumerate() {
            let Some(motion) = motion.filter(|_| self.ends[d].is_some()) else {
                continue;
            };
            let (mut own, mut terms) = (motion.end, motion.terms);
            if let Some(by) = &of_length {
                own.time += lengths[d] * by.end.time;
                let all = own.x.iter_mut().zip(&mut terms).zip(&by.end.x);
                for ((x, term), by) in all {
                    *x += lengths[d] * by;
                    *term += (lengths[d] * by).abs();
                }
            }
            if piece.member.is_none() {
                own.time = 0.0;
            }
            let back = own.x.iter().zip(f).map(|(x, f)| x - f * own.time);
            self.sizes.see_tangent(d, &back.collect::<Vec<_>>());
            let speeds = self.sizes.speeds.all();
            let by_time = speeds.iter().map(|speed| speed * own.time);
            self.sizes.add_terms(d, by_time);
            self.sizes.add_terms(d, terms.into_iter());
            add_algebraic(&mut self.sizes, &self.of.system.algebraic_states, d, &own.x);
            let is_known = own.time.is_finite() && own.x.iter().all(|x| x.is_finite());
            self.ends[d] = Some(own);
            if !is_known {
                self.lose(time, (Why::Unknown, Vec::new()), d);
            }
        }
    }

    /// What else is zero at the end of a piece stays so: at a switch what is met with it, elsewhere what the run rests on.
    fn check_rest(&mut self, piece: &Piece, start: &Here, end: &Here) {
        let met = self.last.as_ref().and_then(|last| last.met.as_ref());
        let known = self.known(piece.until, met.map_or(0.0, |met| met.1));
        let first = &piece.elements[0];
        let at_start: Vec<usize> = start.zero(&self.known(first.t, 0.0)).collect();
        let why = if piece.member.is_some() {
            Why::Several
        } else {
            Why::Rests
        };
        let counts = |k: &usize| {
            Some(*k) != piece.member && (piece.member.is_some() || at_start.contains(k))
        };
        let zero: Vec<usize> = end.zero(&known).filter(counts).collect();
        let mut lost = Vec::new();
        for (d, own) in self.ends.iter().enumerate() {
            let Some(own) = own else { continue };
            let size = self.sizes_of(own, &end.f, d);
            let moved = Moved {
                x: &own.x,
                size: &size,
                time: own.time,
            };
            if let Some(k) = end.left(zero.iter().copied(), moved, d) {
                lost.push((d, switches(self.of.system, &piece.reduced, k)));
            }
        }
        let time = self.time_behind(piece);
        for (d, switches) in lost {
            self.lose(time, (why, switches), d);
        }
    }

    /// The time at the end of a piece that lies behind.
    fn time_behind(&self, piece: &Piece) -> f64 {
        let last = self.last.as_ref();
        last.map_or(piece.until, |last| self.of.time(piece.until, &last.x))
    }
}

/// Equations leave rounding of the largest tangent of what they determine in all of them.
fn add_algebraic(sizes: &mut Sizes, algebraic: &[usize], direction: usize, x: &[f64]) {
    let largest = algebraic.iter().map(|&i| x[i].abs()).fold(0.0, f64::max);
    let terms = (0..x.len()).map(|i| if algebraic.contains(&i) { largest } else { 0.0 });
    sizes.add_terms(direction, terms);
}
