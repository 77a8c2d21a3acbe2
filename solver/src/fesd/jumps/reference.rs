//! A run from event to event says where elements may meet, and what goes on in them: where a program starts.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::path::{Path, Piece};
use super::{CLOSED, Element};
use crate::event::{Event, Observer, Segment};
use crate::hybrid::{Outcome, Status};
use crate::optimization::problem::Bounds;

/// Instants closer than this, as a share of an interval, are one.
const CLOSEST: f64 = 1e-9;
/// α that is so close to 0 or 1 is, and a slip velocity that is so small is none.
const ROUNDING: f64 = 1e-9;
/// Slip with such a share of its largest velocity in two directions is none.
const AT_REST: f64 = 1e-9;
/// Instants of a piece of a run at which slip is looked at.
const LOOKS: usize = 8;
/// How far inside of its element α is read, as a share of it: at its ends it belongs to others.
const INSIDE: f64 = 1e-6;

/// A contact whose impulses act where elements meet.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Impact {
    /// Its switch.
    pub switch: usize,
    /// The place of its gap among z.
    pub gap: usize,
    /// The place of its force.
    pub force: usize,
    /// Its friction, where it is rough.
    pub slip: Option<Slip>,
}

impl Impact {
    /// The switch of its slip in one direction.
    pub(super) fn line(&self) -> Option<usize> {
        match self.slip? {
            Slip::Interval { switch, .. } => Some(switch),
            Slip::Disc { .. } => None,
        }
    }

    /// That switch, where the contact is open.
    pub fn idle(&self, alphas: &[f64]) -> Option<usize> {
        let slip = self.line();
        slip.filter(|_| 1.0 - alphas[self.switch] <= ROUNDING)
    }

    /// The places of all that it has among z.
    pub(super) fn places(&self) -> impl Iterator<Item = usize> {
        let slip = self.slip.iter().flat_map(|slip| match *slip {
            Slip::Interval { multipliers, .. } => multipliers.to_vec(),
            Slip::Disc {
                alphas: [first, second],
                speed,
            } => vec![first, second, speed],
        });
        [self.gap, self.force].into_iter().chain(slip)
    }
}

/// What says how a contact slips where elements meet.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub enum Slip {
    /// In one direction.
    Interval {
        /// Its switch.
        switch: usize,
        /// The places of λᵖ and λⁿ among z.
        multipliers: [usize; 2],
    },
    /// In two directions.
    Disc {
        /// The places of its α.
        alphas: [usize; 2],
        /// The place of γ = |w|.
        speed: usize,
    },
}

/// Slip velocities of all contacts.
#[derive(Clone, Debug, Default)]
pub struct Slips {
    /// Those in one direction.
    pub lines: Vec<f64>,
    /// Those in two.
    pub planes: Vec<[f64; 2]>,
}

/// A run in the modes of the model, whose only jumps are those of contacts.
#[derive(Clone, Debug)]
pub struct Reference {
    path: Path,
    /// Changes of sides, jumps, and slip that turns round.
    switches: Vec<f64>,
    /// When contacts strike, by number.
    strikes: Vec<(f64, usize)>,
    /// Instants at which infinitely many of these accumulate.
    accumulations: Vec<f64>,
    /// How it ended.
    pub outcome: Outcome,
}

impl Observer for Reference {
    fn segment(&mut self, segment: &Segment) -> ControlFlow<()> {
        self.path.push(segment);
        ControlFlow::Continue(())
    }

    fn event(&mut self, event: &Event) {
        if event.from != event.to || !event.jumps.is_empty() {
            self.switches.push(event.time);
        }
        if event.accumulates {
            self.accumulations.push(event.time);
        }
        let struck = event.jumps.iter().map(|&contact| (event.time, contact));
        self.strikes.extend(struck);
    }
}

impl Reference {
    /// Follows a run; `slips` are the slip velocities at an instant and a state.
    pub fn follow(
        run: impl FnOnce(&mut dyn Observer) -> Outcome,
        mut slips: impl FnMut(f64, &[f64]) -> Slips,
    ) -> Self {
        let mut reference = Reference {
            path: Path::default(),
            switches: Vec::new(),
            strikes: Vec::new(),
            accumulations: Vec::new(),
            outcome: Outcome::at(Status::Unsolved, 0.0, Vec::new(), Vec::new()),
        };
        reference.outcome = run(&mut reference);
        // What jumps in the last instant ends behind it.
        let (last, outcome) = (reference.strikes.last(), &reference.outcome);
        if last.is_some_and(|strike| strike.0 >= outcome.time) {
            reference.path.end_at(outcome);
        }
        let (path, n_states) = (&reference.path, outcome.x.len());
        let turns = turns(path, n_states, &mut slips);
        let crossings = crossings(path, n_states, &mut slips);
        reference
            .switches
            .extend(turns.into_iter().chain(crossings));
        reference.switches.sort_by(f64::total_cmp);
        reference
    }

    /// Whether it has got beyond its start.
    pub fn begins(&self) -> bool {
        !self.path.is_empty()
    }

    /// α of all switches at an instant.
    pub fn alphas(&self, time: f64) -> Option<Vec<f64>> {
        let (_, mut row) = self.at(time, time)?;
        Some(row.split_off(self.outcome.x.len()))
    }

    /// Which contacts push in the elements of an interval.
    pub fn closed(
        &self,
        impacts: &[Impact],
        (mut start, end): (f64, f64),
        elements: usize,
    ) -> Vec<Vec<bool>> {
        let lengths = cut(start, end, &self.switches, elements);
        let of = |h: f64| {
            let alphas = self.alphas(start + 0.5 * h);
            start += h;
            let pushes = |impact: &Impact| {
                let alphas = alphas.as_ref();
                alphas.is_some_and(|alphas| 1.0 - alphas[impact.switch] > ROUNDING)
            };
            impacts.iter().map(pushes).collect()
        };
        lengths.into_iter().map(of).collect()
    }

    /// Whether what has ended the run in an interval ends any other one: a coefficient that no contact has, or friction
    /// that leaves no motion.
    pub fn has_ended(&self, from: f64, to: f64) -> bool {
        let Outcome { status, time, .. } = &self.outcome;
        let ends = matches!(status, Status::Coefficient { .. } | Status::Painleve { .. });
        ends && (from..=to).contains(time)
    }

    /// Where infinitely many impacts accumulate in an interval.
    pub fn accumulates(&self, from: f64, to: f64) -> Option<f64> {
        let mut limits = self.accumulations.iter().copied();
        limits.find(|&time| from < time && time <= to)
    }

    /// How many parts the switches and impacts inside of an interval make of it.
    pub fn parts(&self, start: f64, end: f64) -> usize {
        cuts(start, end, &self.switches).len() - 1
    }

    /// Gives the lengths, states, impulses and multipliers of a step the values of the run in its interval. An impact
    /// that follows its start within the window is at its start.
    pub fn fill(&self, lowered: &mut impl Lowered, step: &Target, w: &mut [f64]) {
        let Target {
            elements,
            points,
            n_states,
            initial,
            bounds,
            interval: (mut start, end),
            window,
        } = *step;
        let mut set = |index: usize, value: f64| {
            let (lower, upper) = (bounds.lower[index], bounds.upper[index]);
            if value.is_finite() && lower != upper {
                w[index] = value.max(lower).min(upper);
            }
        };
        let (n, near) = (self.outcome.x.len(), CLOSEST * (end - start));
        let behind = self.last_strike(start, window);
        let switches: Vec<f64> = (self.switches.iter().copied())
            .filter(|t| !(start..=behind).contains(t))
            .collect();
        let lengths = cut(start, end, &switches, elements.len());
        for (j, (element, h)) in elements.iter().zip(lengths).enumerate() {
            set(element.length, h);
            if let Some(t) = element.start {
                set(t, start);
            }
            for (m, c) in points.iter().enumerate() {
                let inside = start + c.clamp(INSIDE, 1.0 - INSIDE) * h;
                let inside = inside.max(behind + INSIDE * h);
                let Some((row, within)) = self.at(start + c * h, inside) else {
                    continue;
                };
                let states = (element.states[m]..).zip(&row[..n_states]);
                states.for_each(|(i, &x)| set(i, x));
                let z = self.multipliers(lowered, [start + c * h, inside], [&row, &within]);
                let places = element.algebraics[m].iter().zip(&z);
                places.for_each(|(place, &z)| place.iter().for_each(|&i| set(i, z)));
                if m > 0 {
                    continue;
                }
                let until = if j == 0 { behind } else { start };
                let meeting = Meeting {
                    time: start,
                    struck: self.struck(start - near, until + near),
                    before: match j {
                        0 => Some(initial.to_vec()),
                        _ => self
                            .at(start, start - INSIDE * h)
                            .map(|(x, _)| x[..n].to_vec()),
                    },
                    behind: &row[..n],
                    z: &z,
                };
                let values = meeting.impulses(lowered);
                (element.impulses..)
                    .zip(values)
                    .for_each(|(i, y)| set(i, y));
            }
            start += h;
        }
    }

    /// The contacts that strike in an interval.
    fn struck(&self, from: f64, to: f64) -> Vec<usize> {
        let strikes = self.strikes.iter();
        let strikes = strikes.filter(|(t, _)| (from..=to).contains(t));
        strikes.map(|(_, contact)| *contact).collect()
    }

    /// The last impact that follows an instant within a window, or that instant.
    fn last_strike(&self, start: f64, window: f64) -> f64 {
        let times = self.strikes.iter().map(|strike| strike.0);
        let times = times.filter(|t| (start..=start + window).contains(t));
        times.fold(start, f64::max)
    }

    /// All rows at an instant, by the polynomial around another one; and there.
    fn at(&self, time: f64, inside: f64) -> Option<(Vec<f64>, Vec<f64>)> {
        let piece = self.path.around(inside)?;
        Some((piece.at(time), piece.at(inside)))
    }

    /// z for the states and α of a run: all rows at an instant, and those near by, inside of its element.
    fn multipliers(
        &self,
        lowered: &mut impl Lowered,
        instants: [f64; 2],
        [row, within]: [&[f64]; 2],
    ) -> Vec<f64> {
        let n = self.outcome.x.len();
        let (x, near, mut alphas) = (&row[..n], &within[..n], within[n..].to_vec());
        lowered.direct(&mut alphas, instants, near);
        let mut z = lowered.in_mode(instants, x, &alphas);
        // On the surface of a contact the sign of rounding says nothing, also where nothing presses.
        let largest = x.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for impact in lowered.impacts() {
            let force = 1.0 - alphas[impact.switch];
            if force > ROUNDING {
                (z[impact.gap], z[impact.force]) = (0.0, force);
            } else if z[impact.gap].abs() <= CLOSED * largest {
                z[impact.gap] = 0.0;
            }
        }
        z
    }
}

/// When slip velocities with two entries pass through rest, which is no change of the mode.
fn turns(path: &Path, n_states: usize, slips: &mut impl FnMut(f64, &[f64]) -> Slips) -> Vec<f64> {
    let ends = path
        .pieces()
        .map(|piece| [piece.from, piece.to].map(|t| slips(t, &piece.at(t)[..n_states]).planes));
    let ends: Vec<[Vec<[f64; 2]>; 2]> = ends.collect();
    let starts: Vec<f64> = path.pieces().map(|piece| piece.from).collect();
    let speed = |w: [f64; 2]| w[0].hypot(w[1]);
    let n_slips = ends.first().map_or(0, |[first, _]| first.len());
    let turns = (0..n_slips).flat_map(|k| {
        let speeds = ends.iter().flatten().map(|slips| speed(slips[k]));
        let largest = speeds.fold(0.0, f64::max);
        let meet = ends.windows(2).zip(&starts[1..]);
        meet.filter_map(move |(pair, &from)| {
            let [before, end] = [0, 1].map(|i| pair[0][i][k]);
            let behind = pair[1][1][k];
            let turns = before[0] * behind[0] + before[1] * behind[1] < 0.0;
            (turns && speed(end) <= AT_REST * largest).then_some(from)
        })
    });
    turns.collect()
}

/// When slip velocities with one entry pass through zero inside of pieces: those of open contacts, which are no switches
/// of the run.
fn crossings(
    path: &Path,
    n_states: usize,
    slips: &mut impl FnMut(f64, &[f64]) -> Slips,
) -> Vec<f64> {
    let mut at = |piece: &Piece, t: f64| slips(t, &piece.at(t)[..n_states]).lines;
    let mut crossings = Vec::new();
    for piece in path.pieces() {
        let length = piece.to - piece.from;
        let mut left = (piece.from, at(piece, piece.from));
        for look in 1..=LOOKS {
            let right = piece.from + length * look as f64 / LOOKS as f64;
            let right = (right, at(piece, right));
            for (k, (&from, &to)) in left.1.iter().zip(&right.1).enumerate() {
                if from * to < 0.0 {
                    let ahead = |t| at(piece, t)[k] * from;
                    crossings.push(bisect([left.0, right.0], ahead));
                }
            }
            left = right;
        }
    }
    crossings
}

/// Where a function that falls below zero does so, to rounding.
fn bisect([mut above, mut below]: [f64; 2], mut value: impl FnMut(f64) -> f64) -> f64 {
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = f64::midpoint(above, below);
        match value(middle) > 0.0 {
            true => above = middle,
            false => below = middle,
        }
    }
    below
}

/// What a run asks of a lowering of its system at an instant and a state.
pub trait Lowered {
    /// The contacts whose impulses act where elements meet.
    fn impacts(&self) -> &[Impact];

    /// Gives α of what slips in a plane, and of all slip at open contacts, which have any in a run, the direction of slip
    /// at a point: at an instant, with data and controls as they are at another one, since they may jump there.
    fn direct(&mut self, alphas: &mut [f64], instants: [f64; 2], x: &[f64]);

    /// z in the mode of these α, at such instants.
    fn in_mode(&mut self, instants: [f64; 2], x: &[f64], alphas: &[f64]) -> Vec<f64>;

    /// The rate of the gap and the restitution of a contact.
    fn law(&mut self, contact: usize, time: f64, x: &[f64]) -> [f64; 2];
}

/// The step of a program that a run gives values.
#[derive(Clone, Copy)]
pub struct Target<'t> {
    /// Its elements.
    pub elements: &'t [Element],
    /// Where the points of an element of length 1 are.
    pub points: &'t [f64],
    /// How many states it has.
    pub n_states: usize,
    /// The state where the first element begins.
    pub initial: &'t [f64],
    /// Those of all variables.
    pub bounds: Bounds<'t>,
    /// When it begins and ends.
    pub interval: (f64, f64),
    /// For so long behind its start there are no impacts.
    pub window: f64,
}

/// Where two elements meet.
struct Meeting<'m> {
    time: f64,
    /// The contacts that strike.
    struck: Vec<usize>,
    /// The state before, where it is known, and the one behind.
    before: Option<Vec<f64>>,
    behind: &'m [f64],
    /// z behind.
    z: &'m [f64],
}

impl Meeting<'_> {
    /// Impulses of all contacts, as far as they push, and the sides of friction behind them.
    fn impulses(&self, lowered: &mut impl Lowered) -> Vec<f64> {
        let mut values: Vec<f64> = (0..lowered.impacts().len())
            .map(|c| f64::from(u8::from(self.pushes(c, lowered))))
            .collect();
        let slips = lowered.impacts().iter().filter_map(|impact| impact.slip);
        values.extend(slips.flat_map(|slip| slip.sides(self.z)));
        values
    }

    /// Of contacts that are closed already, those push whose law holds as an equation.
    fn pushes(&self, contact: usize, lowered: &mut impl Lowered) -> bool {
        if self.struck.contains(&contact) {
            return true;
        }
        let is_closed = self.z[lowered.impacts()[contact].gap] == 0.0;
        let Some(before) = self.before.as_ref().filter(|_| !self.struck.is_empty()) else {
            return false;
        };
        let [old, _] = lowered.law(contact, self.time, before);
        let [new, restitution] = lowered.law(contact, self.time, self.behind);
        is_closed && (new + restitution * old).abs() <= ROUNDING
    }
}

impl Slip {
    /// α⁺ of friction, and β⁺ of a disc, for these multipliers.
    fn sides(self, z: &[f64]) -> Vec<f64> {
        match self {
            Slip::Interval {
                multipliers: [above, below],
                ..
            } => {
                vec![match (z[above] > ROUNDING, z[below] > ROUNDING) {
                    (true, _) => 1.0,
                    (_, true) => 0.0,
                    _ => 0.5,
                }]
            }
            Slip::Disc { alphas, speed } => match z[speed] > ROUNDING {
                true => vec![z[alphas[0]], z[alphas[1]], 0.0],
                false => vec![0.5, 0.5, 1.0],
            },
        }
    }
}

/// The lengths of the elements of an interval: cuts are switches, as far as there are elements for them.
pub fn cut(start: f64, end: f64, switches: &[f64], elements: usize) -> Vec<f64> {
    let mut cuts = cuts(start, end, switches);
    while cuts.len() - 1 > elements {
        // The shortest part joins a neighbour.
        let lengths = cuts.windows(2).map(|pair| pair[1] - pair[0]);
        let shortest = lengths
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .map_or(1, |(i, _)| i.clamp(1, cuts.len() - 2));
        cuts.remove(shortest);
    }
    let parts: Vec<f64> = cuts.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut counts = vec![1; parts.len()];
    for _ in parts.len()..elements {
        let each = |i: &usize| parts[*i] / counts[*i] as f64;
        let longest = (0..parts.len()).max_by(|a, b| each(a).total_cmp(&each(b)));
        counts[longest.expect("an interval has a part")] += 1;
    }
    let parts = parts.iter().zip(&counts);
    parts
        .flat_map(|(length, &count)| vec![length / count as f64; count])
        .collect()
}

/// The ends of an interval, and the switches inside of it that are not one.
fn cuts(start: f64, end: f64, switches: &[f64]) -> Vec<f64> {
    // Parts in which instants inside of them are told from their ends.
    let near = CLOSEST * (end - start) + f64::EPSILON / INSIDE * start.abs().max(end.abs());
    let inside = |t: &f64| *t > start + near && *t < end - near;
    let mut cuts = vec![start];
    cuts.extend(switches.iter().copied().filter(inside));
    cuts.push(end);
    cuts.dedup_by(|a, b| *a - *b <= near);
    cuts
}
