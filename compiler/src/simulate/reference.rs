//! A run from event to event says where elements may meet, and what goes on in them: where a program starts.

use nsd_solver::fesd::jumps::CLOSED;

use super::Request;
use crate::expr::Var;
use crate::limit::Limit;
use crate::lowering::dcs::{Friction, Impact, SlipLaw};
use crate::lowering::discretize::Layout;
use crate::lowering::mpcc::Bounds;
use crate::report::{Dense, EventKind, Failure, Piece, Trajectory};
use crate::system::System;
use crate::system::experiment::{EventOptions, Method, Sampling, Settings};

/// Instants closer than this, as a share of an interval, are one.
const CLOSEST: f64 = 1e-9;
/// α that is so close to 0 or 1 is, and a slip velocity that is so small is none.
const ROUNDING: f64 = 1e-9;
/// Slip with such a share of its largest velocity in two directions is none.
const AT_REST: f64 = 1e-9;
/// How far inside of its element α is read, as a share of it: at its ends it belongs to others.
const INSIDE: f64 = 1e-6;
/// How accurate the run is.
const TOLERANCE: f64 = 1e-11;

/// A run in the modes of the model.
pub(crate) struct ReferenceRun<'e> {
    system: System<'e>,
    dense: Dense,
    /// Changes of mode, jumps, and slip that turns round.
    switches: Vec<f64>,
    /// When contacts strike, by name.
    strikes: Vec<(f64, String)>,
    /// Instants at which infinitely many of these accumulate.
    accumulations: Vec<f64>,
    /// Why it ended before its horizon.
    pub failure: Option<Failure>,
}

impl<'e> ReferenceRun<'e> {
    /// What is run for an experiment: its system without outputs, from event to event.
    pub fn asked(system: &System<'e>, settings: &Settings<'e>) -> (System<'e>, Settings<'e>) {
        let mut system = system.clone();
        system.outputs.clear();
        let mut settings = settings.clone();
        settings.method = Method::Event(EventOptions::default());
        settings.sampling = Sampling::Method;
        settings.tolerance = TOLERANCE;
        settings.lowerings.clear();
        (settings.outputs, settings.optimize) = (None, None);
        (system, settings)
    }

    /// What is asked of the run, as long as the limit allows.
    pub fn request(limit: &Limit) -> Request {
        Request {
            dense: true,
            estimate: false,
            multipliers: false,
            limit: limit.clone(),
        }
    }

    /// A run of a system that has none but its states.
    pub fn of(system: System<'e>, run: Trajectory) -> Self {
        let jumps = run
            .events
            .iter()
            .filter(|event| event.kind == EventKind::Jump);
        let strikes = jumps.map(|event| (event.time, event.surface.clone()));
        let strikes: Vec<(f64, String)> = strikes.collect();
        let limits = run.events.iter();
        let limits = limits.filter(|event| event.kind == EventKind::Zeno);
        let modes = run.modes.iter().skip(1).map(|mode| mode.from);
        let mut reference = ReferenceRun {
            switches: modes.chain(strikes.iter().map(|strike| strike.0)).collect(),
            system,
            dense: run.dense,
            strikes,
            accumulations: limits.map(|event| event.time).collect(),
            failure: run.failure,
        };
        reference.switches.extend(reference.turns());
        reference.switches.sort_by(f64::total_cmp);
        reference
    }

    /// When slip velocities with two entries pass through rest, which is no change of the mode.
    fn turns(&self) -> Vec<f64> {
        let contacts = self.system.contacts.iter();
        let slips = contacts.filter_map(|contact| Some(&contact.friction.as_ref()?.slips));
        let mut found = Vec::new();
        for slips in slips.filter(|slips| slips.len() == 2) {
            let velocity = |piece: &Piece, time: f64| {
                let row = piece.at(time);
                let known = self.known(time, &row);
                [0, 1].map(|k| slips[k].velocity.eval(&known))
            };
            let pieces = self.dense.pieces.iter();
            let ends = pieces.map(|piece| [piece.from, piece.to].map(|t| velocity(piece, t)));
            let ends: Vec<[[f64; 2]; 2]> = ends.collect();
            let speed = |w: [f64; 2]| w[0].hypot(w[1]);
            let largest = ends.iter().flatten().map(|&w| speed(w)).fold(0.0, f64::max);
            let meet = ends.windows(2).zip(self.dense.pieces.windows(2));
            found.extend(meet.filter_map(|(ends, pieces)| {
                let ([before, end], [_, behind]) = (ends[0], ends[1]);
                let turns = before[0] * behind[0] + before[1] * behind[1] < 0.0;
                (turns && speed(end) <= AT_REST * largest).then_some(pieces[1].from)
            }));
        }
        found
    }

    /// What was run.
    pub fn system(&self) -> &System<'e> {
        &self.system
    }

    /// Whether it has got beyond its start.
    pub fn begins(&self) -> bool {
        !self.dense.pieces.is_empty()
    }

    /// α of all switches at an instant.
    pub fn alphas(&self, time: f64) -> Option<Vec<f64>> {
        let (row, _) = self.at(time, time)?;
        let n = self.system.states.len();
        Some(row[n..n + self.system.switches.len()].to_vec())
    }

    /// Which contacts push in the elements of an interval.
    pub fn closed(&self, mut start: f64, end: f64, elements: usize) -> Vec<Vec<bool>> {
        let contacts = &self.system.contacts;
        let lengths = cut(start, end, &self.switches, elements);
        let of = |h: f64| {
            let alphas = self.alphas(start + 0.5 * h);
            start += h;
            let pushes = |switch: usize| {
                let alphas = alphas.as_ref();
                alphas.is_some_and(|alphas| 1.0 - alphas[switch] > ROUNDING)
            };
            contacts
                .iter()
                .map(|contact| pushes(contact.switch))
                .collect()
        };
        lengths.into_iter().map(of).collect()
    }

    /// What has ended the run in an interval and ends any other one: a coefficient that no contact has, or friction
    /// that leaves no motion.
    pub fn ended(&self, from: f64, to: f64) -> Option<&Failure> {
        let in_it = |failure: &&Failure| match failure {
            Failure::Coefficient { time, .. } | Failure::Painleve { time, .. } => {
                (from..=to).contains(time)
            }
            _ => false,
        };
        self.failure.as_ref().filter(in_it)
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
    pub fn fill(&self, lowered: &mut impl Lowered<'e>, step: &Target, w: &mut [f64]) {
        let Target {
            layout,
            bounds,
            number: k,
            interval: (mut start, end),
            window,
        } = *step;
        let mut set = |index: usize, value: f64| {
            if value.is_finite() && !bounds[index].is_fixed() {
                w[index] = value.max(bounds[index].lower).min(bounds[index].upper);
            }
        };
        let (n, near) = (self.system.states.len(), CLOSEST * (end - start));
        let behind = self.last_strike(start, window);
        let switches: Vec<f64> = (self.switches.iter().copied())
            .filter(|t| !(start..=behind).contains(t))
            .collect();
        for (j, h) in (1..).zip(cut(start, end, &switches, layout.elements)) {
            set(layout.h(k, j), h);
            if let Some(t) = layout.t(k, j) {
                set(t, start);
            }
            for (m, c) in layout.points.iter().enumerate() {
                let inside = start + c.clamp(INSIDE, 1.0 - INSIDE) * h;
                let inside = inside.max(behind + INSIDE * h);
                let Some(rows) = self.at(start + c * h, inside) else {
                    continue;
                };
                let row = &rows.0;
                for (i, &value) in row[..layout.n_states()].iter().enumerate() {
                    set(layout.x(k, j, m) + i, value);
                }
                let z = self.multipliers(lowered, start + c * h, &rows);
                for (i, &z) in z.iter().enumerate() {
                    if let Some(index) = layout.z(k, j, m, i) {
                        set(index, z);
                    }
                }
                let Some(first) = layout.impulses(k, j).filter(|_| m == 0) else {
                    continue;
                };
                let until = if j == 1 { behind } else { start };
                let meeting = Meeting {
                    time: start,
                    struck: self.struck(start - near, until + near),
                    before: match j {
                        1 => Some(lowered.initial()),
                        _ => self
                            .at(start, start - INSIDE * h)
                            .map(|(x, _)| x[..n].to_vec()),
                    },
                    behind: &row[..n],
                    z: &z,
                };
                let values = meeting.impulses(lowered);
                let places = first..;
                places
                    .zip(values)
                    .for_each(|(index, value)| set(index, value));
            }
            start += h;
        }
    }

    /// The names of contacts that strike in an interval.
    fn struck(&self, from: f64, to: f64) -> Vec<&str> {
        let strikes = self.strikes.iter();
        let strikes = strikes.filter(|(t, _)| (from..=to).contains(t));
        strikes.map(|(_, name)| name.as_str()).collect()
    }

    /// The last impact that follows an instant within a window, or that instant.
    fn last_strike(&self, start: f64, window: f64) -> f64 {
        let times = self.strikes.iter().map(|strike| strike.0);
        let times = times.filter(|t| (start..=start + window).contains(t));
        times.fold(start, f64::max)
    }

    /// All rows at an instant, by the polynomial around another one; and there.
    fn at(&self, time: f64, inside: f64) -> Option<(Vec<f64>, Vec<f64>)> {
        let pieces = &self.dense.pieces;
        let after = pieces.partition_point(|piece| piece.from <= inside);
        let piece = pieces.get(after.checked_sub(1)?)?;
        (inside <= piece.to).then(|| (piece.at(time), piece.at(inside)))
    }

    /// States of a run, parameters, time and data.
    fn known(&self, time: f64, row: &[f64]) -> impl Fn(Var) -> f64 {
        let known = self.system.valuation(time, row, &[]);
        move |var: Var| known.number(var)
    }

    /// z for the states and α of a run: all rows at an instant, and those near by.
    fn multipliers(
        &self,
        lowered: &mut impl Lowered<'e>,
        time: f64,
        (row, within): &(Vec<f64>, Vec<f64>),
    ) -> Vec<f64> {
        let system = &self.system;
        let n = system.states.len();
        let mut alphas = within[n..n + system.switches.len()].to_vec();
        lowered.direct(&mut alphas, time, &within[..n]);
        let mut z = lowered.in_mode(time, &row[..n], &alphas);
        // On the surface of a contact the sign of rounding says nothing, also where nothing presses.
        let largest = row[..n].iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        for (impact, contact) in lowered.impacts().iter().zip(&system.contacts) {
            let force = 1.0 - alphas[contact.switch];
            if force > ROUNDING {
                (z[impact.gap], z[impact.force]) = (0.0, force);
            } else if z[impact.gap].abs() <= CLOSED * largest {
                z[impact.gap] = 0.0;
            }
        }
        z
    }
}

/// What a run asks of a lowering of its system at an instant and a state.
pub(crate) trait Lowered<'e> {
    /// The contacts whose impulses act where elements meet.
    fn impacts(&self) -> &[Impact<'e>];

    /// The state where the first element of a step begins.
    fn initial(&self) -> Vec<f64>;

    /// Gives α of what slips in a plane the direction of slip at a point.
    fn direct(&mut self, alphas: &mut [f64], time: f64, x: &[f64]);

    /// z in the mode of these α.
    fn in_mode(&mut self, time: f64, x: &[f64], alphas: &[f64]) -> Vec<f64>;

    /// The rate of the gap and the restitution of a contact.
    fn law(&mut self, contact: usize, time: f64, x: &[f64]) -> [f64; 2];
}

/// The step of a program that a run gives values.
#[derive(Clone, Copy)]
pub(crate) struct Target<'t> {
    pub layout: &'t Layout,
    pub bounds: &'t [Bounds],
    /// Its number, from 1.
    pub number: usize,
    pub interval: (f64, f64),
    /// For so long behind its start there are no impacts.
    pub window: f64,
}

/// Where two elements meet.
struct Meeting<'m> {
    time: f64,
    /// The names of the contacts that strike.
    struck: Vec<&'m str>,
    /// The state before, where it is known, and the one behind.
    before: Option<Vec<f64>>,
    behind: &'m [f64],
    /// z behind.
    z: &'m [f64],
}

impl Meeting<'_> {
    /// Impulses of all contacts, as far as they push, and the sides of friction behind them.
    fn impulses<'e>(&self, lowered: &mut impl Lowered<'e>) -> Vec<f64> {
        let pushes: Vec<f64> = (0..lowered.impacts().len())
            .map(|c| f64::from(u8::from(self.pushes(c, lowered))))
            .collect();
        let friction = lowered.impacts().iter();
        let friction = friction.filter_map(|impact| impact.friction.as_ref());
        let sides = friction.flat_map(|friction| sides_of(friction, self.z));
        pushes.into_iter().chain(sides).collect()
    }

    /// Of contacts that are closed already, those push whose law holds as an equation.
    fn pushes<'e>(&self, contact: usize, lowered: &mut impl Lowered<'e>) -> bool {
        let impact = &lowered.impacts()[contact];
        if self.struck.contains(&impact.name.as_str()) {
            return true;
        }
        let is_closed = self.z[impact.gap] == 0.0;
        let Some(before) = self.before.as_ref().filter(|_| !self.struck.is_empty()) else {
            return false;
        };
        let [old, _] = lowered.law(contact, self.time, before);
        let [new, restitution] = lowered.law(contact, self.time, self.behind);
        is_closed && (new + restitution * old).abs() <= ROUNDING
    }
}

/// α⁺ of friction, and β⁺ of a disc, for these multipliers.
fn sides_of(friction: &Friction, z: &[f64]) -> Vec<f64> {
    match friction.law {
        SlipLaw::Interval(multipliers) => {
            let [above, below] = multipliers.map(|i| z[i]);
            vec![match (above > ROUNDING, below > ROUNDING) {
                (true, _) => 1.0,
                (_, true) => 0.0,
                _ => 0.5,
            }]
        }
        SlipLaw::Disc { disc, .. } => {
            let [first, second] = disc.alphas.map(|i| z[i]);
            match z[disc.slip] > ROUNDING {
                true => vec![first, second, 0.0],
                false => vec![0.5, 0.5, 1.0],
            }
        }
    }
}

/// The lengths of the elements of an interval: cuts are switches, as far as there are elements for them.
pub(crate) fn cut(start: f64, end: f64, switches: &[f64], elements: usize) -> Vec<f64> {
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
    let near = CLOSEST * (end - start);
    let inside = |t: &f64| *t > start + near && *t < end - near;
    let mut cuts = vec![start];
    cuts.extend(switches.iter().copied().filter(inside));
    cuts.push(end);
    cuts.dedup_by(|a, b| *a - *b <= near);
    cuts
}
