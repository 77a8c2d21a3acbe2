//! What an event does to tangents.

use super::adjoint::Costate;
use super::functions::{Functions, Linearized, Moved, Point};
use super::implied::Implied;
use super::jump::{Jumped, jumped};
use super::meeting::{Algebraic, Held, Known, Meeting, magnitudes};
use super::run::Run;
use super::sizes::{Recent, Sizes};
use super::why::Why;
use crate::event::recording::{EventRecord, Step};
use crate::expansion::series;
use crate::hybrid::{Effect, Law, Side};

/// A rate is none below this part of how large its terms have been of late.
const TANGENTIAL: f64 = 1e-12;
/// The same where nothing is known of how it bends.
const UNKNOWN: f64 = 1e-7;
/// A function of time, states and parameters to first order.
#[derive(Clone, Debug)]
pub(crate) struct Slope {
    pub time: f64,
    pub x: Vec<f64>,
    /// By direction.
    pub by: Vec<f64>,
}

impl Slope {
    /// Of derivatives by slots.
    pub(super) fn of(functions: &Functions, slopes: &[(usize, f64)]) -> Self {
        let n = functions.slots.n_states;
        let (mut time, mut x) = (0.0, vec![0.0; n]);
        for &(slot, slope) in slopes {
            match slot {
                0 => time += slope,
                slot if slot <= n => x[slot - 1] += slope,
                _ => {}
            }
        }
        let rest = vec![0.0; n];
        let still = Moved::still(&rest);
        let by = (0..functions.n_directions()).map(|d| functions.along(slopes, still, d)[0]);
        Slope {
            time,
            by: by.collect(),
            x,
        }
    }

    /// Of a row over t, states and directions.
    pub fn row(row: &[f64], n: usize) -> Self {
        Slope {
            time: row[0],
            x: row[1..=n].to_vec(),
            by: row[1 + n..].to_vec(),
        }
    }

    /// That row.
    pub fn entries(&self) -> Vec<f64> {
        [&[self.time], &self.x[..], &self.by].concat()
    }

    /// How large its derivatives are.
    pub fn magnitude(&self) -> Slope {
        let abs = |all: &[f64]| all.iter().map(|one| one.abs()).collect();
        Slope {
            time: self.time.abs(),
            x: abs(&self.x),
            by: abs(&self.by),
        }
    }

    /// Its derivative in a direction, with the size of its terms.
    pub fn along(&self, moved: Moved, direction: usize) -> [f64; 2] {
        let terms = |x: &[f64]| -> Vec<f64> {
            let states = self.x.iter().zip(x).map(|(a, b)| a * b);
            states
                .chain([self.time * moved.time, self.by[direction]])
                .collect()
        };
        let sizes = terms(moved.size).into_iter().map(f64::abs);
        [terms(moved.x).iter().sum(), sizes.sum()]
    }

    /// Whether both are the same up to rounding.
    pub fn is_near(&self, other: &Slope) -> bool {
        const SAME: f64 = 1e-12;
        let (own, other) = (self.entries(), other.entries());
        let mut pairs = own.iter().zip(&other);
        pairs.all(|(a, b)| (a - b).abs() <= SAME * (a.abs() + b.abs()))
    }

    /// Whether one is a multiple of the other.
    fn is_multiple(&self, other: &Slope) -> bool {
        /// sin² of an angle.
        const PARALLEL: f64 = 1e-12;
        let (a, b) = (self.entries(), other.entries());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (aa, ab, bb) = (dot(&a, &a), dot(&a, &b), dot(&b, &b));
        aa * bb - ab * ab <= PARALLEL * aa * bb
    }
}

/// An event of a run.
pub(super) struct Saltation<'a> {
    pub run: &'a Run<'a>,
    pub event: &'a EventRecord,
    /// The steps before and behind it, in its modes.
    pub last: Option<&'a Step>,
    pub next: Option<&'a Step>,
    /// The state before it.
    pub before: &'a [f64],
    pub sizes: &'a Sizes,
    /// Coefficients of data before and behind it.
    pub coefficients: [&'a [f64]; 2],
    pub is_start: bool,
    /// dt/dp by direction of the event before, where nothing lies between them.
    pub follows: Option<&'a [f64]>,
}

/// What is zero when an event takes place.
#[derive(Clone)]
struct Trigger {
    slopes: Vec<(usize, f64)>,
    rate: f64,
    switch: usize,
    /// How far it may be off.
    width: f64,
}

/// An event with what is the same in all directions.
pub(super) struct Prepared<'a> {
    of: &'a Saltation<'a>,
    before: Linearized,
    after: Linearized,
    /// None where the instant is known.
    trigger: Option<Trigger>,
    passes: bool,
    jumps: Vec<Jumped>,
    algebraic: Option<Algebraic>,
    /// What has to stay zero before it and behind it, but for rows that are known to.
    held: [Vec<Held>; 2],
    known: Vec<Slopes>,
}

/// (slot, derivative) of a function.
type Slopes = Vec<(usize, f64)>;

/// Why there is no derivative, and the switches that it is about.
type Failed = (Why, Vec<usize>);

impl<'a> Saltation<'a> {
    /// A point before or behind the event.
    fn point<'p>(&'p self, behind: bool, alpha: &'p [f64]) -> Point<'p> {
        let event = self.event;
        Point {
            t: event.time,
            x: if behind { &event.after } else { self.before },
            alpha,
            coefficients: self.coefficients[usize::from(behind)],
            parameters: self.run.parameters,
        }
    }

    fn sides(&self, behind: bool) -> &[Side] {
        if behind {
            &self.event.to
        } else {
            &self.event.from
        }
    }

    /// α on one side of the event, and the functions there.
    fn linearize(
        &self,
        functions: &mut Functions,
        behind: bool,
    ) -> Result<(Vec<f64>, Linearized), Why> {
        let sides = self.sides(behind);
        let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
        match (behind, self.last, self.next) {
            (false, Some(step), _) => step.alpha(step.length, &mut alpha),
            (true, _, Some(step)) => step.alpha(0.0, &mut alpha),
            _ => {}
        }
        let mode = functions.mode(sides);
        let linear = functions.solved(&mode, &self.point(behind, &[]), &mut alpha);
        let linear = linear.map_err(|_| Why::Singular)?;
        Ok((alpha, linear))
    }

    /// The switches that are met, but those that outputs alone look at; these where there are no others.
    fn met(&self) -> Vec<usize> {
        let met = self.event.met.iter().copied();
        let (observers, others): (Vec<usize>, Vec<usize>) =
            met.partition(|&i| self.run.observers[i]);
        if others.is_empty() { observers } else { others }
    }

    /// Whether it follows another one at once: what slides in the mode between them has α beyond its bounds.
    fn is_at_once(&self, functions: &Functions, alpha: &[f64]) -> bool {
        let is_beyond = |&i: &usize| {
            let limits = functions.system.switches[i].limits();
            let low = *limits
                .first()
                .filter(|_| limits.len() > 1)
                .unwrap_or(&f64::NEG_INFINITY);
            let high = *limits.last().unwrap_or(&f64::INFINITY);
            let known = self.run.accuracy.width();
            let is_out = alpha[i] < low - known || alpha[i] > high + known;
            self.event.from[i] == Side::Slide && is_out
        };
        self.follows.is_some() && self.met().iter().all(is_beyond)
    }

    /// Whether nothing but outputs sees the event, and fields that are the same on both sides: tangents pass through it.
    fn passes(&self, functions: &Functions) -> bool {
        let (event, met) = (self.event, &self.event.met);
        let meeting = self.meeting(false, &[]);
        let is_same = |i: usize| {
            let is_other = event.from[i] != event.to[i] && !self.run.observers[i];
            !is_other || meeting.is_passed(functions, i, met, &event.laws)
        };
        event.laws.is_empty() && !event.folds() && (0..event.from.len()).all(is_same)
    }

    /// What is the same in all directions.
    pub fn prepare(&'a self, functions: &mut Functions) -> Result<Prepared<'a>, Failed> {
        let event = self.event;
        let all = |why: Why| (why, event.met.clone());
        if event.is_limit() {
            return Err(all(Why::Accumulation));
        }
        if event.folds() {
            return Err(all(Why::Fold));
        }
        let (alpha, before) = self.linearize(functions, false).map_err(all)?;
        let (behind, after) = self.linearize(functions, true).map_err(all)?;
        let passes = self.passes(functions);
        let trigger = match event.is_scheduled || self.is_at_once(functions, &alpha) {
            true => None,
            false => Some(self.trigger(functions, &before, &alpha)),
        };
        let trigger = match trigger {
            Some(Err((why, _))) if passes && why != Why::Several => None,
            trigger => trigger.transpose()?,
        };
        let point = self.point(false, &alpha);
        let jumps = match event.laws.is_empty() {
            true => Vec::new(),
            false => jumped(
                functions,
                point,
                (event, self.run.coupling),
                &self.sizes.largest,
            )
            .map_err(all)?,
        };
        let meeting = self.meeting(true, &behind);
        let algebraic = match functions.system.algebraics.is_empty() {
            true => None,
            false => Some(meeting.algebraic(functions).map_err(all)?),
        };
        let (mut held, mut known) = ([Vec::new(), Vec::new()], Vec::new());
        if !passes {
            let trigger = trigger.as_ref();
            let all = [
                self.held(functions, false, (&before, &alpha), trigger),
                self.held(functions, true, (&after, &behind), trigger),
            ];
            (held, known) = self.open(functions, all, trigger, &jumps);
        }
        Ok(Prepared {
            of: self,
            before,
            after,
            trigger,
            passes,
            jumps,
            algebraic,
            held,
            known,
        })
    }

    /// What lies on surfaces and at bounds on one side of it.
    fn held(
        &self,
        functions: &mut Functions,
        behind: bool,
        (linear, alpha): (&Linearized, &[f64]),
        trigger: Option<&Trigger>,
    ) -> Vec<Held> {
        let meeting = self.meeting(behind, alpha);
        let known = Known {
            share: self.run.accuracy.width(),
            sizes: &self.sizes.largest,
            instant: trigger.map_or(0.0, |trigger| trigger.width / trigger.rate.abs()),
            f: &linear.f,
        };
        let met: Vec<usize> = match behind {
            true => Vec::new(),
            false => self.met(),
        };
        let plain = |i: &usize| self.event.from[*i] != Side::Slide && !self.run.observers[*i];
        let met: Vec<usize> = met.into_iter().filter(plain).collect();
        let laws: &[usize] = if behind { &[] } else { &self.event.laws };
        let but = trigger.filter(|_| !behind).map(|trigger| trigger.switch);
        let mut held = meeting.held(functions, &known, [&met, laws]);
        held.extend(meeting.bounded(functions, (linear, &known), but));
        held
    }

    /// Of that, what is not among the rows that vanish: those of what slides before the event, and of what triggers it, with
    /// which come those behind it that nothing changes.
    fn open(
        &self,
        functions: &Functions,
        [before, behind]: [Vec<Held>; 2],
        trigger: Option<&Trigger>,
        jumped: &[Jumped],
    ) -> ([Vec<Held>; 2], Vec<Slopes>) {
        // What slides at the start has not been asked for yet.
        let slides = |held: &&Held| held.slides && !self.is_start;
        let met = trigger.map(|trigger| trigger.slopes.clone());
        let known = before.iter().filter(slides).map(|held| held.slopes.clone());
        let known: Vec<Slopes> = known.chain(met).collect();
        let jumps = |&(slot, _): &(usize, f64)| {
            let is_set = |state| jumped.iter().any(|jump| jump.sets(state));
            let state = slot.checked_sub(1);
            state.is_some_and(|i| is_set(i) || functions.system.is_algebraic(i))
        };
        let is_open = |held: &Held| !known.contains(&held.slopes);
        let changes = |held: &Held| held.slopes.iter().any(jumps);
        let before = before.into_iter().filter(is_open).collect();
        let behind = behind.into_iter();
        let behind = behind.filter(|held| changes(held) || is_open(held));
        ([before, behind.collect()], known)
    }

    fn meeting<'p>(&'p self, behind: bool, alpha: &'p [f64]) -> Meeting<'p> {
        Meeting {
            point: self.point(behind, alpha),
            sides: self.sides(behind),
            observers: self.run.observers,
        }
    }

    /// What decides when it takes place: of all that is met, what changes fastest.
    fn trigger(
        &self,
        functions: &mut Functions,
        before: &Linearized,
        alpha: &[f64],
    ) -> Result<Trigger, Failed> {
        let (event, system) = (self.event, functions.system.clone());
        let mut found: Vec<(f64, Trigger)> = Vec::new();
        let met = self.met();
        for &i in &met {
            if system.is_idle(i, &event.from) {
                continue;
            }
            let slopes = match event.from[i] {
                Side::Slide if system.switches[i].limits().is_empty() => continue,
                Side::Slide => before.alpha(i),
                _ => {
                    let psi = functions.psi(i, 0, &event.from);
                    psi.slopes(&self.point(false, alpha), &mut functions.registers)
                }
            };
            let rate = rate_of(&slopes, &before.f);
            let weighed = |sizes: &Recent| weigh(&slopes, before.f.len(), |state| sizes.of(state));
            let by_time = slopes.iter().filter(|(slot, _)| *slot == 0);
            let by_time: f64 = by_time.map(|(_, slope)| slope.abs()).sum();
            let speed = weighed(&self.sizes.speeds) + by_time;
            let width = self.run.accuracy.closeness() * weighed(&self.sizes.states);
            let least = least_rate(speed, self.bend(functions, i, rate), width);
            if rate.is_nan() || rate.abs() <= least {
                continue;
            }
            found.push((
                rate.abs() / speed,
                Trigger {
                    slopes,
                    rate,
                    switch: i,
                    width,
                },
            ));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let Some((_, trigger)) = found.first().cloned() else {
            let is_none = met.is_empty();
            return Err((if is_none { Why::Unknown } else { Why::Grazing }, met));
        };
        // Laws of which one is met just before the other may make another state together, or end the run at one of two
        // instants.
        let of = |trigger: &Trigger| Slope::of(functions, &trigger.slopes);
        let first = of(&trigger);
        let stops = |law: &Law| {
            matches!(law.effect, Effect::Stop) && met.iter().any(|&i| law.guard.looks_at(i))
        };
        let ends = self.next.is_none() && system.laws.iter().any(stops);
        let has_laws = ends || !event.laws.is_empty();
        if has_laws && !found.iter().all(|(_, other)| first.is_multiple(&of(other))) {
            return Err((Why::Several, met));
        }
        Ok(trigger)
    }

    /// How the rate of what is met has changed over the last half of the step before.
    fn bend(&self, functions: &mut Functions, switch: usize, rate: f64) -> Option<f64> {
        let step = self.last?;
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let half = 0.5 * step.length;
        let before = match step.sides[switch] {
            Side::Slide => series::slope(step.row(n + switch), half),
            _ => {
                let (mut x, mut f, mut alpha) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
                step.state(half, &mut x, &mut f);
                step.alpha(half, &mut alpha);
                let point = Point {
                    t: step.start + half,
                    x: &x,
                    alpha: &alpha,
                    ..self.point(false, &[])
                };
                let psi = functions.psi(switch, 0, &step.sides);
                let slopes = psi.slopes(&point, &mut functions.registers);
                rate_of(&slopes, &f)
            }
        };
        Some((rate - before) / half)
    }
}

/// Below which rate a function that is known to a width is met tangentially, by the size of its terms, and how it bends.
pub(crate) fn least_rate(speed: f64, bend: Option<f64>, width: f64) -> f64 {
    match bend {
        Some(bend) => f64::max(TANGENTIAL * speed, (2.0 * bend.abs() * width).sqrt()),
        None => UNKNOWN * speed,
    }
}

/// How large the terms of a function by states are, by its slopes and the sizes of these.
pub(super) fn weigh(slopes: &[(usize, f64)], n: usize, size: impl Fn(usize) -> f64) -> f64 {
    let states = slopes.iter().filter(|(slot, _)| (1..=n).contains(slot));
    states
        .map(|&(slot, slope)| slope.abs() * size(slot - 1))
        .sum()
}

/// How a function changes in time, by its slopes and the rates of states.
pub(super) fn rate_of(slopes: &[(usize, f64)], f: &[f64]) -> f64 {
    let rates = slopes.iter().map(|&(slot, slope)| match slot {
        0 => slope,
        slot => slope * f.get(slot - 1).copied().unwrap_or(0.0),
    });
    rates.sum()
}

fn moved<'x>(x: &'x [f64], size: &'x [f64], time: f64) -> Moved<'x> {
    Moved { x, size, time }
}

/// What an event does to tangents, and nothing else of it.
pub(super) struct Crossing {
    /// The slopes of what triggers it, and its rate.
    trigger: Option<(Vec<(usize, f64)>, f64)>,
    /// Whether its instant is that of the event before.
    follows: bool,
    passes: bool,
    jumps: Vec<Jumped>,
    algebraic: Option<Algebraic>,
    /// f before and behind it.
    rates: [Vec<f64>; 2],
    /// Rows of x⁻ at its instant, of that and of parameters, which have to be zero and are not so for any direction.
    conditions: Vec<Costate>,
}

impl Crossing {
    /// The transpose of `cross`.
    pub fn transpose(&self, functions: &Functions, costate: &mut Costate) {
        if !self.passes {
            costate.time -= product(&self.rates[1], &costate.x);
            jumped_back(functions, (&self.jumps, self.algebraic.as_ref()), costate);
        }
        self.meet(functions, costate);
    }

    /// The rows of what has to be zero for its tangents, before it.
    pub fn conditions(&self, functions: &Functions) -> impl Iterator<Item = Costate> {
        self.conditions.iter().map(|row| {
            let mut row = row.clone();
            self.meet(functions, &mut row);
            row
        })
    }

    /// The transpose of x⁻ at the instant of the event, and of that.
    fn meet(&self, functions: &Functions, costate: &mut Costate) {
        if !self.passes {
            costate.time += product(&self.rates[0], &costate.x);
        }
        if self.follows {
            return;
        }
        let time = std::mem::take(&mut costate.time);
        if let Some((slopes, rate)) = &self.trigger {
            costate.add(functions.slots, slopes, -time / rate);
            costate.time = 0.0;
        }
    }
}

fn product(f: &[f64], x: &[f64]) -> f64 {
    f.iter().zip(x).map(|(f, x)| f * x).sum()
}

/// The transpose of what jumps.
fn jumped_back(
    functions: &Functions,
    (jumps, algebraic): (&[Jumped], Option<&Algebraic>),
    costate: &mut Costate,
) {
    if let Some(algebraic) = algebraic {
        algebraic.transpose(functions, costate);
    }
    for jump in jumps.iter().rev() {
        jump.transpose(costate);
    }
}

impl Prepared<'_> {
    /// What it does to tangents.
    pub fn crossing(self, functions: &Functions) -> Crossing {
        Crossing {
            conditions: self.conditions(functions),
            follows: self.trigger.is_none() && !self.of.event.is_scheduled,
            trigger: self.trigger.map(|trigger| (trigger.slopes, trigger.rate)),
            passes: self.passes,
            jumps: self.jumps,
            algebraic: self.algebraic,
            rates: [self.before.f, self.after.f],
        }
    }

    /// Rows of the state and the instant where it is met, of what has to be zero and does not follow for all directions from
    /// what is; what is behind it follows from that by what jumps. All parameters are directions here.
    fn conditions(&self, functions: &Functions) -> Vec<Costate> {
        let [before, behind] = &self.held;
        let has_guards = self.jumps.iter().any(|jump| !jump.guards.is_empty());
        if before.is_empty() && behind.is_empty() && !has_guards {
            return Vec::new();
        }
        let sizes = [functions.slots.n_states, self.of.run.parameters.len()];
        let row = |slopes: &[(usize, f64)]| Costate::of(functions.slots, slopes, sizes);
        let known = self.known.iter().map(|slopes| row(slopes).entries());
        // An instant that is known does not move.
        let fixed = self
            .of
            .event
            .is_scheduled
            .then(|| row(&[(0, 1.0)]).entries());
        let known = Implied::by(known.chain(fixed).collect());
        let both = |held: &Held| [row(&held.slopes), row(&magnitudes(&held.slopes))];
        let behind = behind.iter().map(|held| {
            let [mut own, mut size] = both(held);
            if let Some(algebraic) = &self.algebraic {
                algebraic.spread(functions, &own, &mut size);
            }
            jumped_back(functions, (&self.jumps, self.algebraic.as_ref()), &mut own);
            for jump in self.jumps.iter().rev() {
                jump.magnitude().transpose(&mut size);
            }
            [own, size]
        });
        let guards = self.jumps.iter().enumerate().flat_map(|(place, jump)| {
            let led = &self.jumps[..place];
            jump.guards.iter().map(move |held| {
                let [mut own, mut size] = both(held);
                for jump in led.iter().rev() {
                    jump.transpose(&mut own);
                    jump.magnitude().transpose(&mut size);
                }
                [own, size]
            })
        });
        let all = before.iter().map(both).chain(guards).chain(behind);
        let open = all.filter(|[own, size]| !known.has(own.entries(), &size.entries()));
        open.map(|[own, _]| own).collect()
    }

    /// dt/dp and the tangent behind the event, from that before it.
    pub fn cross(
        &self,
        functions: &Functions,
        tangent: &[f64],
        direction: usize,
    ) -> Result<(f64, Vec<f64>), Failed> {
        let of = self.of;
        let still = Moved::still(tangent);
        let time = match &self.trigger {
            Some(trigger) => -functions.along(&trigger.slopes, still, direction)[0] / trigger.rate,
            None if of.event.is_scheduled => 0.0,
            None => of.follows.map_or(f64::NAN, |by| by[direction]),
        };
        if self.passes {
            return Ok((time, tangent.to_vec()));
        }
        let mut x: Vec<f64> = (tangent.iter().zip(&self.before.f))
            .map(|(s, f)| s + f * time)
            .collect();
        let (f, faded) = (&self.before.f, of.run.accuracy.faded());
        let mut size = of.sizes.moved((tangent, time), f, direction, faded);
        let [before, behind] = &self.held;
        self.check(functions, before, (moved(&x, &size, time), direction))?;
        for jump in &self.jumps {
            self.check(functions, &jump.guards, (moved(&x, &size, time), direction))?;
            (x, size) = jump.apply(moved(&x, &size, time), direction);
        }
        if let Some(algebraic) = &self.algebraic {
            algebraic.keep(functions, &mut x, time, direction);
            let algebraics = &functions.system.algebraics;
            algebraics.iter().for_each(|&z| size[z] = 0.0);
            let sizes = algebraic.sizes(functions, moved(&x, &size, time), direction);
            for (&z, of) in algebraics.iter().zip(sizes) {
                size[z] = of;
            }
        }
        let sizes = x.iter().zip(&size).map(|(x, size)| x.abs().max(*size));
        let size: Vec<f64> = sizes.collect();
        self.check(functions, behind, (moved(&x, &size, time), direction))?;
        let slipped = x.iter().zip(&self.after.f).map(|(x, f)| x - f * time);
        let slipped: Vec<f64> = slipped.collect();
        match slipped.iter().all(|s| s.is_finite()) {
            true => Ok((time, slipped)),
            false => Err((Why::Unknown, of.event.met.clone())),
        }
    }

    /// What lies on surfaces and at bounds stays there to first order.
    fn check(
        &self,
        functions: &Functions,
        held: &[Held],
        (moved, direction): (Moved, usize),
    ) -> Result<(), Failed> {
        let mut held = held.iter();
        let left = held.find(|held| held.is_left(functions, moved, direction));
        match left.map(|held| held.switch) {
            Some(switch) if self.of.is_start => Err((Why::Start, vec![switch])),
            Some(switch) => Err((Why::Several, vec![switch])),
            None => Ok(()),
        }
    }
}
