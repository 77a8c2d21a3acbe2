//! The pass from the start of a run to its end.

use wide::f64x4;

use super::asked::{Directions, EventTime, Moment, Sensitivities};
use super::functions::{Functions, Linearized, Moved, Point};
use super::meeting::{Algebraic, Held, Known, Meeting};
use super::run::Run;
use super::saltation::{Crossing, Saltation};
use super::sizes::Sizes;
use super::taylor::{LANES, Slopes, in_lanes, of_lane};
use super::variational::{self, Variational, Way};
use super::why::{Loss, Why};
use crate::event::recording::{EventRecord, Part, Recording, Step};
use crate::events::Approach;
use crate::hybrid::Side;
use crate::tape::Lane;

/// The tangents of a run, so far.
pub(super) struct Forward<'r> {
    run: &'r Run<'r>,
    functions: Functions<'r>,
    /// dx/dp by direction; none where it is not known.
    tangents: Vec<Option<Vec<f64>>>,
    found: Sensitivities,
    /// Where the run is, and its mode; none at the start.
    x: Vec<f64>,
    sides: Option<Box<[Side]>>,
    sizes: Sizes,
    coefficients: Vec<f64>,
    method: Variational,
    /// What has been done to tangents, where somebody wants to know.
    trace: Option<Trace>,
}

/// What a pass does to tangents, in order.
pub(super) enum Passed {
    /// A part of a step, which has this place in the recording.
    Part {
        place: usize,
        ends: [f64; 2],
        /// The slopes along it, where they are kept.
        slopes: Option<Box<Slopes>>,
        /// Whether it goes back: not where it was stiff, or where the run rests on a surface without sliding.
        goes_back: bool,
        rows: Vec<Row>,
    },
    /// What has to stay zero at the start.
    Start(Vec<Held>),
    /// Algebraic states follow from what keeps them.
    Kept(Algebraic),
    Event(Crossing),
    /// An instant between them.
    Row(Row),
}

/// What has been done to tangents so far.
#[derive(Default)]
struct Trace {
    passed: Vec<Passed>,
    /// How many numbers the slopes are that are kept.
    kept: usize,
}

impl Trace {
    /// Numbers of slopes that are kept; others are found again.
    const MOST: usize = 1 << 23;

    fn push(&mut self, passed: Passed) {
        self.passed.push(passed);
    }

    /// Slopes that are kept as long as there is room.
    fn kept(&mut self, slopes: Option<Slopes>) -> Option<Box<Slopes>> {
        let mut slopes = slopes.filter(|slopes| self.kept + slopes.size() <= Self::MOST)?;
        slopes.shrink();
        self.kept += slopes.size();
        Some(Box::new(slopes))
    }
}

/// An instant that was asked for.
pub(super) struct Row {
    pub instant: usize,
    /// How long after the start of its part.
    pub tau: f64,
    /// What slides, with the derivatives of α by slots.
    pub alpha: Vec<(usize, Vec<(usize, f64)>)>,
}

impl Row {
    fn new(instant: usize, tau: f64, linear: Option<&Linearized>) -> Self {
        let sliding = linear.iter().flat_map(|linear| {
            let all = linear.sliding.iter();
            all.map(|&i| (i, linear.alpha(i)))
        });
        Row {
            instant,
            tau,
            alpha: sliding.collect(),
        }
    }
}

/// A pass with all that it has done, and the functions that it knows.
pub(super) struct Traced<'r> {
    pub found: Sensitivities,
    pub functions: Functions<'r>,
    pub sizes: Sizes,
    pub passed: Vec<Passed>,
}

impl<'r> Forward<'r> {
    pub fn new(run: &'r Run<'r>, directions: &'r Directions, instants: &[Moment]) -> Self {
        let n = run.system.n_states();
        Forward {
            functions: Functions::new(run, &directions.parameters),
            tangents: directions.initial.iter().cloned().map(Some).collect(),
            found: Sensitivities::new(
                run.accuracy.width(),
                [n + run.system.n_switches(), directions.len()],
                instants,
            ),
            x: vec![0.0; n],
            sides: None,
            sizes: Sizes::new(n, directions.len()),
            coefficients: Vec::new(),
            method: Variational::new(run.tolerance),
            run,
            trace: None,
        }
    }

    /// Goes through a recorded run.
    pub fn follow(mut self, recording: &Recording, approaches: &[Approach]) -> Sensitivities {
        self.pass(recording, approaches);
        self.found
    }

    /// The same with all that it has done.
    pub fn traced(mut self, recording: &Recording, approaches: &[Approach]) -> Traced<'r> {
        self.trace = Some(Trace::default());
        self.pass(recording, approaches);
        Traced {
            found: self.found,
            functions: self.functions,
            sizes: self.sizes,
            passed: self.trace.unwrap_or_default().passed,
        }
    }

    fn pass(&mut self, recording: &Recording, approaches: &[Approach]) {
        let mut last = None;
        let mut approaches = approaches.iter().peekable();
        for (at, part) in recording.parts.iter().enumerate() {
            if self.tangents.iter().all(Option::is_none) {
                break;
            }
            let behind = &recording.parts[at + 1..];
            match part {
                Part::Step(step) => {
                    self.enter(step, behind);
                    self.step(step, (at, behind.is_empty()));
                    last = Some(step);
                    while let Some(approach) = approaches.next_if(|a| a.time <= step.until) {
                        self.approach(approach);
                    }
                }
                Part::Event(event) => {
                    let next = behind.iter().find_map(Part::step);
                    if self.sides.is_none() {
                        self.start_with(event, next);
                    }
                    self.instants_at(event.time, &event.before, &event.from);
                    self.event(event, [last, next]);
                    if behind.is_empty() {
                        self.instants_at(f64::INFINITY, &event.after, &event.to);
                    }
                }
            }
        }
    }

    /// Gives up some directions.
    fn lose(&mut self, time: f64, why: Why, switches: &[usize], directions: &[usize]) {
        for &d in directions {
            self.tangents[d] = None;
            let switches = switches.to_vec();
            self.found.lose(
                d,
                Loss {
                    time,
                    why,
                    switches,
                },
            );
        }
    }

    fn lose_all(&mut self, time: f64, why: Why, switches: &[usize]) {
        let known = |d: &usize| self.tangents[*d].is_some();
        let all: Vec<usize> = (0..self.tangents.len()).filter(known).collect();
        self.lose(time, why, switches, &all);
    }

    /// Comes to the start of a step.
    fn enter(&mut self, step: &Step, behind: &[Part]) {
        let n = self.x.len();
        let (mut x, mut slope) = (vec![0.0; n], vec![0.0; n]);
        // The start last: what follows is about x and its rate there.
        for share in [1.0, 0.5, 0.0] {
            step.state(share * step.length, &mut x, &mut slope);
            self.sizes.see(&x, &slope);
        }
        let coefficients = self.run.coefficients(step.start);
        let is_first = self.sides.is_none();
        let z = |z: &usize| (x[*z] - self.x[*z]).abs() > 1e-12 * self.sizes.largest[*z];
        let jumps = coefficients != self.coefficients || self.run.system.algebraics.iter().any(z);
        self.coefficients = coefficients;
        match self.sides.take() {
            None => {}
            Some(sides) if *sides != *step.sides => {
                let ends = behind.iter().find_map(Part::event);
                let accumulates = ends.is_some_and(|event| event.is_limit());
                self.changed(step, &sides, accumulates);
            }
            Some(_) => self.stay(step, &x),
        }
        self.sides = Some(step.sides.clone());
        if is_first || jumps {
            let mut alpha = vec![0.0; step.sides.len()];
            step.alpha(0.0, &mut alpha);
            self.keep_algebraic(step.start, &x, &step.sides, &alpha);
        }
        if is_first {
            self.start(step, &x, &slope);
        }
    }

    /// The mode is another one without an event.
    fn changed(&mut self, step: &Step, sides: &[Side], accumulates: bool) {
        let matters = |&i: &usize| {
            let system = &self.run.system;
            let is_idle = system.is_idle(i, sides) || system.is_idle(i, &step.sides);
            sides[i] != step.sides[i] && !is_idle && !self.run.observers[i]
        };
        let changed: Vec<usize> = (0..sides.len()).filter(matters).collect();
        let why = match accumulates {
            true => Why::Accumulation,
            false => Why::Unknown,
        };
        if !changed.is_empty() {
            self.lose_all(step.start, why, &changed);
        }
    }

    /// What a run without an event does between two steps is nothing: states move by what projection takes away.
    fn stay(&mut self, step: &Step, x: &[f64]) {
        const MOVED: f64 = 1e-6;
        let largest = &self.sizes.largest;
        let rounding = 1e-3 * self.run.accuracy.0 * crate::linalg::largest(largest);
        let moved = |i: usize| {
            let own = largest[i] + self.sizes.fastest[i] * step.length;
            let is_far = (x[i] - self.x[i]).abs() > MOVED * own + rounding;
            is_far && !self.run.system.is_algebraic(i)
        };
        if (0..x.len()).any(moved) {
            self.lose_all(step.start, Why::Unknown, &[]);
        }
    }

    /// At the start what lies on a surface has to stay there.
    fn start(&mut self, step: &Step, x: &[f64], slope: &[f64]) {
        let mut alpha = vec![0.0; step.sides.len()];
        step.alpha(0.0, &mut alpha);
        let coefficients = self.coefficients.clone();
        let meeting = Meeting {
            point: self.point(step.start, x, &alpha, &coefficients),
            sides: &step.sides,
            observers: self.run.observers,
        };
        let known = Known {
            share: self.run.accuracy.width(),
            sizes: &self.sizes.largest,
            instant: 0.0,
            f: slope,
        };
        let mut held = meeting.held(&mut self.functions, &known, [&[], &[]]);
        // A relay that flips at the start is at the threshold of the side that it remembers.
        let system = &self.run.system;
        let remembered = |(i, side): (usize, &Side)| system.relay(i).unwrap_or(*side);
        let begun: Vec<Side> = step.sides.iter().enumerate().map(remembered).collect();
        if begun != *step.sides {
            let meeting = Meeting {
                sides: &begun,
                ..meeting
            };
            let flipped = meeting.held(&mut self.functions, &known, [&[], &[]]);
            let flipped = flipped.into_iter();
            held.extend(flipped.filter(|held| begun[held.switch] != step.sides[held.switch]));
        }
        let mut lost = Vec::new();
        for (d, tangent) in self.tangents.iter().enumerate() {
            let Some(tangent) = tangent else { continue };
            let still = Moved::still(tangent);
            let left = held.iter();
            let left = { left }.find(|held| held.is_left(&self.functions, still, d));
            lost.extend(left.map(|held| (d, held.switch)));
        }
        if let Some(trace) = &mut self.trace {
            trace.push(Passed::Start(held));
        }
        for (d, switch) in lost {
            self.lose(step.start, Why::Start, &[switch], &[d]);
        }
    }

    fn point<'p>(
        &self,
        t: f64,
        x: &'p [f64],
        alpha: &'p [f64],
        coefficients: &'p [f64],
    ) -> Point<'p>
    where
        'r: 'p,
    {
        Point {
            t,
            x,
            alpha,
            coefficients,
            parameters: self.run.parameters,
        }
    }

    /// Algebraic states follow from what keeps them.
    fn keep_algebraic(&mut self, time: f64, x: &[f64], sides: &[Side], alpha: &[f64]) {
        if self.run.system.algebraics.is_empty() {
            return;
        }
        let coefficients = self.coefficients.clone();
        let meeting = Meeting {
            point: self.point(time, x, alpha, &coefficients),
            sides,
            observers: self.run.observers,
        };
        let algebraic = meeting.algebraic(&mut self.functions);
        let algebraic = match algebraic {
            Ok(algebraic) => algebraic,
            Err(why) => return self.lose_all(time, why, &[]),
        };
        for (d, tangent) in self.tangents.iter_mut().enumerate() {
            if let Some(tangent) = tangent {
                algebraic.keep(&self.functions, tangent, 0.0, d);
            }
        }
        if let Some(trace) = &mut self.trace {
            trace.push(Passed::Kept(algebraic));
        }
    }

    /// Takes the tangents along a step.
    fn step(&mut self, step: &Step, (place, is_last): (usize, bool)) {
        let mode = self.functions.mode(&step.sides);
        let way = Way {
            step,
            mode: &mode,
            coefficients: &self.coefficients,
            run: self.run,
            sizes: &self.sizes,
        };
        let (found, trace) = (&mut self.found, &mut self.trace);
        let mut seen = Seen::default();
        let see = |functions: &mut Functions, part: &mut variational::Part| {
            seen.take(functions, part);
            let mut rows = Vec::new();
            let wanted = trace.is_some().then_some(&mut rows);
            found.read(functions, way, (part, is_last), wanted);
            let resting = way.resting(functions, part.ends);
            if let Some(trace) = trace {
                let goes_back = part.slopes.is_some() && resting.is_empty();
                let slopes = trace.kept(part.slopes.take());
                trace.push(Passed::Part {
                    place,
                    ends: part.ends,
                    slopes,
                    goes_back,
                    rows,
                });
            }
            way.leaving(functions, part, &resting)
        };
        let lost = self
            .method
            .follow(&mut self.functions, way, &mut self.tangents, see);
        for (d, tangent, terms) in seen.0 {
            self.sizes.see_tangent(d, &tangent);
            self.sizes.add_terms(d, terms.into_iter());
        }
        for (d, why, switches, tau) in lost {
            self.lose(step.start + tau, why, &switches, &[d]);
        }
        self.x.clone_from(&step.end);
    }

    /// Comes to a jump at the start.
    fn start_with(&mut self, event: &EventRecord, next: Option<&Step>) {
        self.coefficients = self.run.coefficients(event.time);
        let mut alpha: Vec<f64> = event
            .from
            .iter()
            .map(|side| 0.5 + 0.5 * side.sign())
            .collect();
        if let Some(next) = next {
            next.alpha(0.0, &mut alpha);
        }
        self.keep_algebraic(event.time, &event.before, &event.from, &alpha);
    }

    /// The state before an event: where no law jumps, algebraic states may, which the event does not tell.
    fn state_before(&self, event: &EventRecord, last: Option<&Step>) -> Vec<f64> {
        let mut x = event.before.clone();
        if let Some(step) = last.filter(|_| event.laws.is_empty()) {
            for &z in &self.run.system.algebraics {
                x[z] = step.end[z];
            }
        }
        x
    }

    fn event(&mut self, event: &EventRecord, [last, next]: [Option<&Step>; 2]) {
        let still = vec![0.0; self.x.len()];
        self.sizes.see(&event.before, &still);
        self.sizes.see(&event.after, &still);
        let behind = self.run.coefficients(event.time);
        let before = self.found.events.last();
        let before = before.filter(|before| before.time == event.time);
        let state = self.state_before(event, last);
        let saltation = Saltation {
            run: self.run,
            event,
            before: &state,
            last: last.filter(|step| *step.sides == *event.from && step.until >= event.time),
            next: next.filter(|step| *step.sides == *event.to && step.start <= event.time),
            sizes: &self.sizes,
            coefficients: [&self.coefficients, &behind],
            is_start: self.sides.is_none(),
            follows: before.map(|before| &before.by[..]),
        };
        let mut by = vec![f64::NAN; self.tangents.len()];
        let mut failed = Vec::new();
        match saltation.prepare(&mut self.functions) {
            Err((why, switches)) => {
                let known = |d: &usize| self.tangents[*d].is_some();
                let all = (0..self.tangents.len()).filter(known);
                failed.extend(all.map(|d| (d, why, switches.clone())));
            }
            Ok(prepared) => {
                for (d, by) in by.iter_mut().enumerate() {
                    let Some(tangent) = &self.tangents[d] else {
                        continue;
                    };
                    match prepared.cross(&self.functions, tangent, d) {
                        Ok((time, tangent)) => {
                            *by = time;
                            self.tangents[d] = Some(tangent);
                        }
                        Err((why, switches)) => failed.push((d, why, switches)),
                    }
                }
                if let Some(trace) = &mut self.trace {
                    trace.push(Passed::Event(prepared.crossing(&self.functions)));
                }
            }
        }
        let speeds = self.sizes.speeds.all();
        for (d, time) in by.iter().enumerate().filter(|(_, time)| time.is_finite()) {
            let terms = speeds.iter().map(|speed| speed * time);
            self.sizes.add_terms(d, terms);
        }
        for (d, why, switches) in failed {
            self.lose(event.time, why, &switches, &[d]);
        }
        self.found.events.push(EventTime {
            time: event.time,
            by,
        });
        self.sizes.turn();
        self.method.restart();
        self.sides = Some(event.to.clone());
        self.x.clone_from(&event.after);
    }

    /// Takes down the instants up to one at which something happens, without a step that they are in.
    fn instants_at(&mut self, time: f64, x: &[f64], sides: &[Side]) {
        while let Some(instant) = self.found.next(0) {
            let is_here = instant.time < time || instant.time == time && !instant.is_behind;
            if !is_here {
                break;
            }
            let mut alpha: Vec<f64> = sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect();
            let coefficients = self.run.coefficients(instant.time);
            let mode = self.functions.mode(sides);
            let point = self.point(instant.time, x, &[], &coefficients);
            let linear = self.functions.solved(&mode, &point, &mut alpha);
            if let Some(trace) = &mut self.trace {
                let row = Row::new(self.found.n_points(), 0.0, linear.as_ref().ok());
                trace.push(Passed::Row(row));
            }
            let (functions, tangents) = (&self.functions, &self.tangents);
            let point = |row: &mut [f64]| {
                row[..x.len()].copy_from_slice(x);
                row[x.len()..].copy_from_slice(&alpha);
            };
            self.found.push(point, |d, row| {
                row[..x.len()].copy_from_slice(tangents[d].as_ref()?);
                slide(functions, linear.as_ref().ok()?, row, d);
                Some(())
            });
        }
    }

    /// A surface that was touched, or was not as far as that can be told.
    fn approach(&mut self, approach: &Approach) {
        let gradient = approach.gradient.iter();
        let size: f64 = gradient
            .map(|&(j, g)| g.abs() * self.sizes.states.of(j))
            .sum();
        let is_near =
            approach.distance.abs() <= approach.rounding.max(self.run.accuracy.closeness() * size);
        if is_near && !self.run.observers[approach.switch] {
            self.lose_all(approach.time, Why::Grazing, &[approach.switch]);
        }
    }
}

/// Behind the tangents of states, those of α of what slides.
fn slide(functions: &Functions, linear: &Linearized, whole: &mut [f64], direction: usize) {
    let (tangent, alpha) = whole.split_at_mut(linear.f.len());
    let [_, of_k] = linear.along(functions, Moved::still(tangent), direction);
    for (&i, of) in linear.sliding.iter().zip(of_k) {
        alpha[i] = of;
    }
}

/// What has been seen of tangents along a step: direction, tangent, and terms over time.
#[derive(Default)]
struct Seen(Vec<(usize, Vec<f64>, Vec<f64>)>);

impl Seen {
    fn take(&mut self, functions: &Functions, part: &variational::Part) {
        let known = part.tangents.iter().enumerate();
        let known: Vec<(usize, &[f64])> = known
            .filter_map(|(d, one)| Some((d, &one.as_ref()?.1[..])))
            .collect();
        for lanes in known.chunks(LANES) {
            match lanes {
                [_] => self.take_lanes::<f64>(functions, part, lanes),
                _ => self.take_lanes::<f64x4>(functions, part, lanes),
            }
        }
    }

    fn take_lanes<L: Lane>(
        &mut self,
        functions: &Functions,
        part: &variational::Part,
        lanes: &[(usize, &[f64])],
    ) {
        let [a, b] = part.ends;
        let ends: Vec<&[f64]> = lanes.iter().map(|&(_, end)| end).collect();
        let (ends, by): (Vec<L>, Vec<L>) = (
            in_lanes(&ends),
            functions.lanes(lanes.iter().map(|&(d, _)| d)),
        );
        let term = |slot, slope| functions.term_lanes(slot, slope, [&ends, &by]);
        let terms = part.middle.terms_lanes(functions.slots, term);
        for (lane, &(d, end)) in lanes.iter().enumerate() {
            let terms = of_lane(&terms, lane).into_iter();
            let terms = terms.map(|term| (b - a) * term).collect();
            self.0.push((d, end.to_vec(), terms));
        }
    }
}

impl Sensitivities {
    /// Takes down the instants inside of a part of a step, and in `rows` what slides there.
    fn read(
        &mut self,
        functions: &mut Functions,
        way: Way,
        (part, is_last): (&variational::Part, bool),
        mut rows: Option<&mut Vec<Row>>,
    ) {
        let [a, b] = part.ends;
        let step = way.step;
        let ends_step = b == step.length;
        while let Some(Moment { time, is_behind }) = self.next(0) {
            let is_inside = match ends_step {
                true => time < step.until || time == step.until && !is_behind || is_last,
                false => time - step.start <= b,
            };
            if !is_inside {
                break;
            }
            let tau = (time - step.start).clamp(a, b);
            let tau = if time >= step.until { b } else { tau };
            // Nothing but α asks for more than the tangent.
            let slides = !way.mode.sliding.is_empty();
            let linear = slides.then(|| way.linearize(functions, tau));
            if let Some(rows) = &mut rows {
                let linear = linear.as_ref().and_then(|linear| linear.as_ref().ok());
                rows.push(Row::new(self.n_points(), tau - a, linear));
            }
            let point = |row: &mut [f64]| {
                let (x, alpha) = row.split_at_mut(functions.slots.n_states);
                step.values(tau, x);
                step.known_alpha(tau, alpha);
            };
            let functions = &*functions;
            self.push(point, |d, row| {
                let (tangent, _) = part.tangents[d].as_ref()?;
                tangent.read(tau - a, row);
                if let Some(linear) = &linear {
                    slide(functions, linear.as_ref().ok()?, row, d);
                }
                Some(())
            });
        }
    }
}
