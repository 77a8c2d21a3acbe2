//! The elements that have been solved since the last report: of equal length in a step of the grid, up to the next
//! switch, or one as long as its defect allows.

use std::ops::ControlFlow;

use super::adaptive::ROUNDING;
use super::emit::{Elements, Observer, Polynomials};
use super::modes::{Mode, Modes};
use super::run::{NEAR, Run};
use super::system::hidden::Unsolved;
use super::watch::{BAND, Start, Values, Verdict};
use crate::event::Segment;
use crate::events::sensitivity::ROUNDINGS;
use crate::expansion::series;
use crate::fesd::element::Element;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::element::solved::Solved;
use crate::hybrid::Status;

/// Below this share of the largest state one may be rounding of terms that cancel.
const SMALL: f64 = 1e-8;

/// Elements from one switch, or end of a step, to the next.
pub(crate) struct Piece {
    pub elements: usize,
    /// The watched member that vanishes at its end.
    pub event: Option<usize>,
    /// Whether it ends with the step.
    pub reaches_end: bool,
}

impl Piece {
    /// One element.
    pub fn single(event: Option<usize>, reaches_end: bool) -> Self {
        Piece {
            elements: 1,
            event,
            reaches_end,
        }
    }
}

/// What a polynomial of a member may miss it by, as a share of its values (chosen by trial).
const FOLLOWS: f64 = 0.01;

/// Members below this share of what they have been are not looked at so closely.
const NEGLIGIBLE_MEMBER: f64 = 1e-6;

/// Members that are negative by this share of what they have been, or change by in an element, are missed.
const MISSED: f64 = 1e-6;

/// Halvings of an element in which a member is negative from the start although it must rise.
const MAX_HALVINGS: usize = 30;

/// A switch closer to the start of an element, relative to its length, is at the start; and one this
/// close to the end of a step is at its end.
const AT_ONCE: f64 = 1e-12;

/// Rounds that make the lengths before a switch equal, and how equal they become.
const MAX_ROUNDS: usize = 8;
const EQUAL: f64 = 1e-13;

/// The elements solved since the last one that was reported.
pub(crate) struct March {
    pub solved: Vec<Solved>,
    pub values: Values,
    pub polynomials: Polynomials,
}

impl March {
    /// Memory for elements of a scheme.
    pub fn new(scheme: &Scheme) -> Self {
        March {
            solved: Vec::new(),
            values: Values::new(scheme),
            polynomials: Polynomials::default(),
        }
    }

    /// Looks in every new mode which rates are rounding, where a state is small enough next to others to be nothing
    /// else: on a grid no element is rejected for it, and such states have no error to be relative to.
    pub fn know_rounding(&mut self, modes: &mut Modes, run: &Run) {
        let terms = &mut modes.all[run.place.mode].element.terms;
        if terms.has_looked || self.solved[0].h == 0.0 {
            return;
        }
        terms.has_looked = true;
        let largest = run.scale.iter().fold(0.0_f64, |size, x| size.max(*x));
        if run.scale.iter().any(|size| *size <= SMALL * largest) {
            let mode = &mut modes.all[run.place.mode];
            self.polynomials.write(&modes.scheme, mode, &self.solved[0]);
            self.misses_by_rounding(modes, run);
        }
    }

    /// Solves for up to `left` elements of equal length that end with the step, or with a switch.
    pub fn piece(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        end: f64,
        left: usize,
        length: f64,
    ) -> Result<Piece, Status> {
        let h = run.place.left(end) / left as f64;
        for at in 0..left {
            let Some(member) = self.element(modes, run, at, h)? else {
                continue;
            };
            let (switch, _) = self.solved[at].stop();
            // The last element of the step is kept for what comes after the switch.
            let count = match at + 1 {
                count if count == left && count > 1 => count - 1,
                count => count,
            };
            if at > 0 {
                self.equalize(
                    modes,
                    run,
                    count,
                    (switch - run.place.t) / count as f64,
                    member,
                )?;
            }
            // A switch within rounding of the end is one at the end.
            let reaches_end = end - switch <= AT_ONCE * length + NEAR * end.abs();
            if reaches_end {
                self.snap(run, count, end);
            }
            return Ok(Piece {
                elements: count,
                event: Some(member),
                reaches_end,
            });
        }
        Ok(Piece {
            elements: left,
            event: None,
            reaches_end: true,
        })
    }

    /// Solves for element `at` since the last report, which is h long unless a member vanishes in
    /// it. Returns that member.
    pub fn element(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        at: usize,
        h: f64,
    ) -> Result<Option<usize>, Status> {
        self.place(run, at);
        let mut tried = h;
        for _ in 0..MAX_HALVINGS {
            let Solved { t, ref x, .. } = self.solved[at];
            let mode = &mut modes.all[run.place.mode];
            if run.lengths.last > 0.0 {
                mode.element
                    .extrapolate(&modes.scheme, 1.0, tried / run.lengths.last);
            } else {
                mode.element.stages.guess(
                    &run.entry.rates,
                    &run.place.z_of(&mode.element.reduced.unknowns),
                );
                if at == 0 {
                    let departures = run.slips.departures_at(run.place.t);
                    mode.element.set_off(&modes.scheme, departures, tried);
                }
            }
            let stats = &mut run.record.stats;
            let solved = mode
                .element
                .solve(&modes.scheme, t, tried, x, &run.scale, stats);
            solved.map_err(|_| Status::Unsolved)?;
            self.evaluate(modes, run, at)?;
            // Only the first element after a switch has members that start at zero.
            let starts = if at == 0 { &run.entry.starts[..] } else { &[] };
            let scales = (&run.entry.sizes[..], run.entry.rate_scale * tried);
            match self.values.judge(&modes.scheme, starts, scales) {
                Verdict::Stays => {
                    run.lengths.last = tried;
                    if tried < h {
                        // Found nothing in a part of the element only: the whole is too long.
                        return Err(Status::Unsolved);
                    }
                    Self::note_least(modes, run, self.least_member(modes, run))?;
                    self.keep(modes, run, at);
                    return Ok(None);
                }
                Verdict::Leaves { sigma, member } if sigma <= AT_ONCE => {
                    // The switch is where the element starts: no member is negative in what is left of it.
                    self.keep(modes, run, at);
                    self.solved[at].h = 0.0;
                    run.lengths.last = 0.0;
                    return Ok(Some(member));
                }
                // A sliding mode that ends has no next node.
                Verdict::Leaves { member, .. }
                    if member == modes.all[run.place.mode].element.reduced.watched.len() =>
                {
                    return Err(Status::Unsolved);
                }
                Verdict::Leaves { sigma, member } => {
                    let end = (member, BAND * run.entry.sizes[member]);
                    let mode = &mut modes.all[run.place.mode];
                    let length =
                        mode.cut(&modes.scheme, sigma, end, &run.scale, &mut run.record.stats);
                    let length = length.map_err(|_| Status::Unsolved)?;
                    run.lengths.last = length;
                    self.evaluate(modes, run, at)?;
                    Self::note_least(modes, run, self.least_member(modes, run))?;
                    self.keep(modes, run, at);
                    return Ok(Some(member));
                }
                Verdict::Wrong { .. } => {
                    run.lengths.last = 0.0;
                    tried *= 0.5;
                }
            }
        }
        Err(Status::Unsolved)
    }

    /// Makes `count` elements equal that end where a member vanishes, near a length `h` each.
    fn equalize(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        count: usize,
        mut h: f64,
        member: usize,
    ) -> Result<(), Status> {
        let unsolved = |_: Unsolved| Status::Unsolved;
        let end = (member, BAND * run.entry.sizes[member]);
        let mut least = (0.0, 0);
        for _ in 0..MAX_ROUNDS {
            least = (0.0, 0);
            for at in 0..count {
                self.place(run, at);
                let Solved { t, ref x, .. } = self.solved[at];
                let mode = &mut modes.all[run.place.mode];
                let stats = &mut run.record.stats;
                let stages = &mut mode.element.stages;
                stages.unknowns.copy_from_slice(&self.solved[at].unknowns);
                mode.element
                    .solve(&modes.scheme, t, h, x, &run.scale, stats)
                    .map_err(unsolved)?;
                if at + 1 == count {
                    let hidden = &mut mode.hidden;
                    mode.element
                        .solve_to(&modes.scheme, hidden, end, &run.scale, stats)
                        .map_err(unsolved)?;
                }
                self.evaluate(modes, run, at)?;
                let found = self.least_member(modes, run);
                if found.0 < least.0 {
                    least = found;
                }
                self.keep(modes, run, at);
            }
            let last = self.solved[count - 1].h;
            run.lengths.last = last;
            if (last - h).abs() <= EQUAL * h || count == 1 {
                break;
            }
            h += (last - h) / count as f64;
        }
        Self::note_least(modes, run, least)
    }

    /// Where element `at` since the last report starts.
    fn place(&mut self, run: &Run, at: usize) {
        if self.solved.len() <= at {
            self.solved.resize_with(at + 1, Solved::default);
        }
        let n = run.place.x.len();
        let (before, here) = self.solved.split_at_mut(at);
        let here = &mut here[0];
        here.x.resize(n, 0.0);
        here.low.resize(n, 0.0);
        match before.last() {
            None => {
                (here.t, here.t_low) = (run.place.t, run.place.t_low);
                here.x.copy_from_slice(&run.place.x);
                here.low.copy_from_slice(&run.place.low);
            }
            Some(last) => {
                (here.t, here.t_low) = last.stop();
                last.end(&mut here.x, &mut here.low);
            }
        }
    }

    /// Takes over the element that the mode has solved, and `values` evaluated.
    fn keep(&mut self, modes: &mut Modes, run: &mut Run, at: usize) {
        let mode = &mut modes.all[run.place.mode];
        let (element, solved) = (&mode.element, &mut self.solved[at]);
        solved.h = element.stages.h;
        solved.unknowns.clone_from(&element.stages.unknowns);
        solved.mean.clone_from(&element.stages.mean);
        solved.w.clear();
        let w = self.values.w_at_end(&element.reduced);
        solved.w.extend_from_slice(w);
        self.values
            .alphas(&modes.scheme, element, &mut mode.hidden, &mut solved.alphas);
    }

    /// Evaluates the watched members of element `at` since the last report, which the mode has solved.
    fn evaluate(&mut self, modes: &mut Modes, run: &Run, at: usize) -> Result<(), Status> {
        let mode = &mut modes.all[run.place.mode];
        let evaluated = self
            .values
            .evaluate(&modes.scheme, &mode.element, &mut mode.hidden);
        evaluated.map_err(|_| Status::Unsolved)?;
        // No polynomial through what is not finite has a root.
        if !self.values.at_points.iter().all(|value| value.is_finite()) {
            return Err(Status::NotFinite);
        }
        let reduced = &mode.element.reduced;
        self.values
            .lower_stops(&modes.scheme, reduced, &run.entry.sizes);
        let unknowns = reduced.unknowns.iter().enumerate();
        let before = unknowns.map(|(k, &z)| match at {
            0 => run.place.z[z],
            _ => self.solved[at - 1].w[k],
        });
        let goes_on = self.values.starts_at(reduced, before);
        goes_on.then_some(()).ok_or(Status::Unsolved)
    }

    /// Moves the end of the last of `count` elements, which is within rounding, to the end of a step.
    fn snap(&mut self, run: &Run, count: usize, end: f64) {
        debug_assert!(run.place.t < end, "a step has a length");
        let last = &mut self.solved[count - 1];
        last.h = (end - last.t) - last.t_low;
    }

    /// The member that is farthest below zero in the element just evaluated, and by which share of its size.
    fn least_member(&self, modes: &Modes, run: &Run) -> (f64, usize) {
        let change = run.entry.rate_scale * modes.all[run.place.mode].element.stages.h;
        let mut least = (0.0, 0);
        for (member, size) in run.entry.sizes.iter().enumerate() {
            let values = self.values.of(&modes.scheme, member);
            let lowest = values
                .iter()
                .fold(0.0, |m, &value| if value < m { value } else { m });
            if lowest < 0.0 {
                let share = lowest / size.max(change).max(BAND);
                if share < least.0 {
                    least = (share, member);
                }
            }
        }
        least
    }

    /// Takes note of the least member of elements that are solved. One that is far below zero is on the wrong side of its
    /// surface.
    fn note_least(
        modes: &Modes,
        run: &mut Run,
        (least, member): (f64, usize),
    ) -> Result<(), Status> {
        if least < -MISSED {
            let reduced = &modes.all[run.place.mode].element.reduced;
            let watched = reduced.watched.get(member);
            let switches = watched.map(|watched| &modes.system.switches_of[watched.pair]);
            let switch = switches.and_then(|switches| switches.first());
            return Err(switch.map_or(Status::Unsolved, |&switch| Status::MissedSwitch { switch }));
        }
        run.record.least_member = run.record.least_member.min(least);
        Ok(())
    }

    /// How the members start in an element that follows on one of length `h` in the same mode: one that
    /// has not left zero yet starts as it did.
    fn go_on(&self, modes: &Modes, run: &mut Run, h: f64) {
        let entry = &mut run.entry;
        let sizes = entry.sizes.iter().enumerate();
        for (start, (member, size)) in entry.starts.iter_mut().zip(sizes) {
            let values = self.values.of(&modes.scheme, member).iter();
            let largest = values.fold(0.0_f64, |largest, value| largest.max(value.abs()));
            if *start != Start::Tangent || largest > BAND * size.max(entry.rate_scale * h) {
                *start = Start::Inside;
            }
        }
    }

    /// Whether the polynomials of the element just solved miss some rates by their rounding, and the terms of these are
    /// larger than was known of them.
    pub fn misses_by_rounding(&mut self, modes: &mut Modes, run: &Run) -> bool {
        let Mode { element, hidden } = &mut modes.all[run.place.mode];
        let Element {
            reduced,
            stages,
            terms,
            ..
        } = element;
        let solved = (&self.solved[0], &self.polynomials.series);
        terms.raise(&modes.scheme, reduced, stages, hidden, solved, &run.scale)
    }

    /// ‖x' - f‖ h between the nodes of the element just solved, relative to the size of each state.
    pub fn defect(&mut self, modes: &mut Modes, run: &Run, target: f64) -> f64 {
        if self.solved[0].h == 0.0 {
            return 0.0;
        }
        let (solved, scheme) = (&self.solved[0], &modes.scheme);
        let mode = &mut modes.all[run.place.mode];
        self.polynomials.write(scheme, mode, solved);
        let rows = &self.polynomials.series;
        let reduced = &mode.element.reduced;
        let (n, h) = (run.place.x.len(), solved.h);
        let algebraic = &modes.system.algebraic_states;
        let units = &modes.system.surfaces.units;
        let largest = units.largest(algebraic, &run.scale);
        let mut worst = 0.0_f64;
        for sigma in scheme.points.probes() {
            let tau = sigma * h;
            let x = (0..n).map(|i| series::value(rows.row(i), tau));
            mode.hidden
                .set(solved.t + tau, x, mode.element.stages.w(scheme.s / 2));
            if mode.hidden.solve(reduced).is_err() {
                return f64::INFINITY;
            }
            // Roots of members were looked for in polynomials, which have to be the members.
            for (member, value) in mode.hidden.eval(&reduced.members.tape).enumerate() {
                let stops = reduced.watched.get(member).is_some_and(|w| w.stops);
                let end = if stops {
                    BAND * run.entry.sizes[member]
                } else {
                    0.0
                };
                let value = value - end;
                let size = run.entry.sizes[member].max(run.entry.rate_scale * h);
                let floor = NEGLIGIBLE_MEMBER * size;
                if self.values.misses(scheme, member, (sigma, value), floor) > FOLLOWS {
                    return f64::INFINITY;
                }
            }
            for (i, f) in mode
                .hidden
                .eval(&reduced.equations.tape)
                .take(n)
                .enumerate()
            {
                let rate = series::slope(rows.row(i), tau);
                // What rounding leaves of the rate is no reason for a shorter element. Equations leave that of
                // their terms in all that they determine, a multiplier that is zero, too.
                let terms = match algebraic.contains(&i) {
                    true => largest * units.of_state(i),
                    false => h * mode.element.terms.activity[i],
                };
                let rounding = ROUNDING * terms / target;
                let scale = run.scale[i].max((h * rate).abs()).max(rounding);
                let scale = scale.max(f64::MIN_POSITIVE);
                let relative = h * (rate - f).abs() / scale;
                if relative.is_nan() {
                    return f64::INFINITY;
                }
                worst = worst.max(relative);
            }
        }
        worst
    }

    /// How long the event at the end of the last element is uncertain, at which a member has vanished; takes note of the
    /// rates before.
    pub fn uncertain(&mut self, modes: &Modes, run: &mut Run, member: usize) -> f64 {
        let h = run.lengths.last;
        let rounding = ROUNDINGS * f64::EPSILON * run.entry.sizes[member];
        for (i, before) in run.history.before.iter_mut().enumerate() {
            *before = series::slope(self.polynomials.series.row(i), h);
        }
        match self.values.uncertain(&modes.scheme, member, rounding) {
            share if share.is_finite() => h * share,
            _ => 0.0,
        }
    }

    /// Reports the elements solved since the last report, and moves the run to their end, which is
    /// `end` where the step ends there too.
    pub fn report(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        piece: &Piece,
        end: f64,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let count = piece.elements;
        let end = piece.reaches_end.then_some(end);
        let mode = &mut modes.all[run.place.mode];
        observer.elements(&Elements {
            reduced: &mode.element.reduced,
            numbers: &modes.numbers,
            solved: &self.solved[..count],
            member: piece.event,
            until: end.unwrap_or_else(|| self.solved[count - 1].stop().0),
        });
        for (at, solved) in self.solved[..count].iter().enumerate() {
            let start = solved.t;
            let length = match end.filter(|_| at + 1 == count) {
                Some(end) => {
                    run.place.go_to(end);
                    (end - start) - solved.t_low
                }
                None => {
                    (run.place.t, run.place.t_low) = solved.stop();
                    solved.h
                }
            };
            solved.end(&mut run.place.x, &mut run.place.low);
            run.count_step(modes.system, &mode.element.terms.activity, length)?;
            self.polynomials.write(&modes.scheme, mode, solved);
            let segment = Segment {
                start,
                length,
                until: run.place.t,
                sides: &mode.element.reduced.sides,
                end: &run.place.x,
                dense: &self.polynomials.series,
            };
            if length > 0.0 && observer.segment(&segment) == ControlFlow::Break(()) {
                return Err(Status::Stopped);
            }
            if observer.wants_multipliers() {
                let told = (&modes.scheme.points.at[..], &modes.system.surfaces.units);
                self.polynomials
                    .tell_multipliers(told, mode, solved, observer);
            }
        }
        let last = &self.solved[count - 1];
        for (&z, w) in mode.element.reduced.unknowns.iter().zip(&last.w) {
            run.place.z[z] = *w;
        }
        self.go_on(modes, run, last.h);
        Ok(())
    }
}
