//! The pass from the start of a run to its end.

use std::sync::Arc;

use super::functions::{Functions, Moved, Point};
use super::recording::{Jump, Part, Recording, Step};
use super::saltation::{Meeting, Saltation};
use super::variational::{Piece, Variational, Way};
use super::{Directions, Loss, Why};
use crate::events::Approach;
use crate::hybrid::{HybridSystem, Piecewise, Side, write_pieces};

/// What has been run.
pub(super) struct Run<'r> {
    pub system: Arc<HybridSystem>,
    pub data: &'r [Arc<Piecewise>],
    pub parameters: &'r [f64],
    /// That of tangents.
    pub tolerance: f64,
}

impl Run<'_> {
    /// The coefficients of data from an instant on.
    pub fn coefficients(&self, t: f64) -> Vec<f64> {
        let mut coefficients = vec![0.0; self.system.n_coefficients()];
        write_pieces(self.data, t, &mut coefficients);
        coefficients
    }
}

/// When something happened, and how that moves with each direction.
#[derive(Clone, Debug, PartialEq)]
pub struct EventTime {
    /// When.
    pub time: f64,
    /// dt/dp by direction; not a number where it is not known.
    pub by: Vec<f64>,
}

/// The derivatives of a run.
pub struct Sensitivities {
    /// The instants of all events, in order.
    pub events: Vec<EventTime>,
    /// From when on directions are not known.
    pub lost: Vec<Option<Loss>>,
    pieces: Vec<Piece>,
    method: Variational,
}

impl Sensitivities {
    /// dx/dp at an instant, and behind it those of all α; where something happens there, `behind` or before it. False where
    /// they are not known.
    pub fn at(&self, t: f64, behind: bool, direction: usize, tangent: &mut [f64]) -> bool {
        let at = match behind {
            true => self.pieces.partition_point(|piece| piece.to <= t),
            false => self.pieces.partition_point(|piece| piece.to < t),
        };
        let at = at.min(self.pieces.len().saturating_sub(1));
        let values = self.pieces.get(at).filter(|piece| {
            let slack = 1e-9 * (piece.to - piece.from) + 1e-13 * t.abs();
            t >= piece.from - slack && t <= piece.to + slack
        });
        let Some((piece, values)) = values.and_then(|p| Some((p, p.values[direction].as_ref()?)))
        else {
            return false;
        };
        let length = piece.to - piece.from;
        let share = if length > 0.0 {
            (t - piece.from) / length
        } else {
            0.0
        };
        self.method.inside(values, share.clamp(0.0, 1.0), tangent);
        true
    }
}

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
    /// How large states and their rates have been.
    sizes: Vec<f64>,
    speeds: Vec<f64>,
    coefficients: Vec<f64>,
}

impl<'r> Forward<'r> {
    pub fn new(run: &'r Run<'r>, directions: &'r Directions) -> Self {
        let n = run.system.n_states();
        Forward {
            functions: Functions::new(run.system.clone(), &directions.parameters),
            tangents: directions.initial.iter().cloned().map(Some).collect(),
            found: Sensitivities {
                events: Vec::new(),
                lost: vec![None; directions.len()],
                pieces: Vec::new(),
                method: Variational::new(n, directions.len()),
            },
            x: vec![0.0; n],
            sides: None,
            sizes: vec![0.0; n],
            speeds: vec![0.0; n],
            coefficients: Vec::new(),
            run,
        }
    }

    /// Goes through a recorded run.
    pub fn follow(mut self, recording: &Recording, approaches: &[Approach]) -> Sensitivities {
        let mut last = None;
        let mut approaches = approaches.iter().peekable();
        for (at, part) in recording.parts.iter().enumerate() {
            if self.tangents.iter().all(Option::is_none) {
                break;
            }
            match part {
                Part::Step(step) => {
                    self.step(step);
                    last = Some(step);
                    while let Some(approach) = approaches.next_if(|a| a.time <= step.until) {
                        self.approach(approach);
                    }
                }
                Part::Event(event) => {
                    let next = recording.parts[at + 1..].iter().find_map(Part::step);
                    self.event(event, [last, next]);
                }
            }
        }
        self.found
    }

    /// Gives up some directions.
    fn lose(&mut self, time: f64, why: Why, switches: &[usize], directions: &[usize]) {
        for &d in directions {
            if self.tangents[d].take().is_some() {
                let switches = switches.to_vec();
                self.found.lost[d] = Some(Loss {
                    time,
                    why,
                    switches,
                });
            }
        }
    }

    fn lose_all(&mut self, time: f64, why: Why, switches: &[usize]) {
        let all: Vec<usize> = (0..self.tangents.len()).collect();
        self.lose(time, why, switches, &all);
    }

    fn see(&mut self, x: &[f64]) {
        for (size, x) in self.sizes.iter_mut().zip(x) {
            *size = size.max(x.abs());
        }
    }

    fn step(&mut self, step: &Step) {
        let n = self.x.len();
        let (mut x, mut slope) = (vec![0.0; n], vec![0.0; n]);
        for tau in [step.length, 0.0] {
            step.state(tau, &mut x, &mut slope);
            self.see(&x);
            for (speed, slope) in self.speeds.iter_mut().zip(&slope) {
                *speed = speed.max(slope.abs());
            }
        }
        self.coefficients = self.run.coefficients(step.start);
        match self.sides.take() {
            None => self.start(step, &x),
            Some(sides) if *sides != *step.sides => {
                let changed: Vec<usize> = (0..sides.len())
                    .filter(|&i| sides[i] != step.sides[i])
                    .collect();
                let idle = |i: &usize| {
                    self.run.system.is_idle(*i, &sides) || self.run.system.is_idle(*i, &step.sides)
                };
                let why = match changed.iter().any(|&i| step.sides[i] == Side::Slide) {
                    true => Why::Accumulation,
                    false => Why::Unknown,
                };
                if !changed.iter().all(idle) {
                    self.lose_all(step.start, why, &changed);
                }
            }
            Some(_) => self.stay(step.start, &x),
        }
        self.sides = Some(step.sides.clone());
        self.keep_algebraic(step, &x);
        let mode = self.functions.mode(&step.sides);
        let way = Way {
            step,
            mode: &mode,
            coefficients: &self.coefficients,
            run: self.run,
            speeds: &self.speeds,
        };
        let pieces = &mut self.found.pieces;
        let method = &mut self.found.method;
        if let Err(why) = method.follow(&mut self.functions, way, &mut self.tangents, pieces) {
            let sliding = mode.sliding.clone();
            self.lose_all(step.start, why, &sliding);
        }
        self.x.clone_from(&step.end);
    }

    /// What a run without an event does between two steps is nothing: states move by what projection takes away.
    fn stay(&mut self, time: f64, x: &[f64]) {
        const MOVED: f64 = 1e-6;
        let moved = |i: usize| {
            let is_far = (x[i] - self.x[i]).abs() > MOVED * self.sizes[i].max(f64::MIN_POSITIVE);
            is_far && !self.run.system.is_algebraic(i)
        };
        if (0..x.len()).any(moved) {
            self.lose_all(time, Why::Unknown, &[]);
        }
    }

    /// At the start what lies on a surface has to stay there.
    fn start(&mut self, step: &Step, x: &[f64]) {
        let mut alpha = vec![0.0; step.sides.len()];
        step.alpha(0.0, &mut alpha);
        self.x.copy_from_slice(x);
        self.keep_algebraic(step, x);
        let coefficients = self.coefficients.clone();
        let point = Point {
            t: step.start,
            x,
            alpha: &alpha,
            coefficients: &coefficients,
            parameters: self.run.parameters,
        };
        let meeting = Meeting {
            point,
            sides: &step.sides,
        };
        for d in 0..self.tangents.len() {
            let Some(tangent) = self.tangents[d].clone() else {
                continue;
            };
            let moved = Moved::still(&tangent);
            let leaves = meeting.leaves(&mut self.functions, &self.sizes, &[], moved, d);
            if let Some(switch) = leaves {
                self.lose(step.start, Why::Start, &[switch], &[d]);
            }
        }
    }

    /// Algebraic states follow from what keeps them.
    fn keep_algebraic(&mut self, step: &Step, x: &[f64]) {
        if self.run.system.algebraics.is_empty() {
            return;
        }
        let coefficients = self.coefficients.clone();
        let alpha = vec![0.5; step.sides.len()];
        let point = Point {
            t: step.start,
            x,
            alpha: &alpha,
            coefficients: &coefficients,
            parameters: self.run.parameters,
        };
        let meeting = Meeting {
            point,
            sides: &step.sides,
        };
        for d in 0..self.tangents.len() {
            let Some(mut tangent) = self.tangents[d].clone() else {
                continue;
            };
            match meeting.keep_algebraic(&mut self.functions, &mut tangent, 0.0, d) {
                Ok(()) => self.tangents[d] = Some(tangent),
                Err(why) => self.lose(step.start, why, &[], &[d]),
            }
        }
    }

    fn event(&mut self, event: &Jump, [last, next]: [Option<&Step>; 2]) {
        let is_start = self.sides.is_none();
        if is_start {
            self.instant(event.time);
            self.coefficients = self.run.coefficients(event.time);
        }
        self.see(&event.before);
        self.see(&event.after);
        let behind = self.run.coefficients(event.time);
        let saltation = Saltation {
            run: self.run,
            event,
            last: last.filter(|step| *step.sides == *event.from && step.until >= event.time),
            next: next.filter(|step| *step.sides == *event.to && step.start <= event.time),
            sizes: &self.sizes,
            speeds: &self.speeds,
            coefficients: [&self.coefficients, &behind],
            is_start,
        };
        let mut by = vec![f64::NAN; self.tangents.len()];
        let mut failed = Vec::new();
        match saltation.prepare(&mut self.functions) {
            Err((why, switches)) => {
                failed.extend((0..self.tangents.len()).map(|d| (d, why, switches.clone())));
            }
            Ok(prepared) => {
                for (d, by) in by.iter_mut().enumerate() {
                    let Some(tangent) = &self.tangents[d] else {
                        continue;
                    };
                    let method = &self.found.method;
                    let sizes = [&tangent[..], method.largest(d), method.terms(d)];
                    match prepared.cross(&mut self.functions, sizes, d) {
                        Ok((time, tangent)) => {
                            *by = time;
                            self.tangents[d] = Some(tangent);
                        }
                        Err((why, switches)) => failed.push((d, why, switches)),
                    }
                }
            }
        }
        for (d, time) in by.iter().enumerate().filter(|(_, time)| !time.is_nan()) {
            self.found.method.passed(d, *time, &self.speeds);
        }
        for (d, why, switches) in failed {
            self.lose(event.time, why, &switches, &[d]);
        }
        self.found.events.push(EventTime {
            time: event.time,
            by,
        });
        self.sides = Some(event.to.clone());
        self.x.clone_from(&event.after);
        if next.is_none() {
            self.instant(event.time);
        }
    }

    /// Keeps the tangents of an instant at the start or the end; those of α are not known.
    fn instant(&mut self, time: f64) {
        let m = self.run.system.n_switches();
        let values = self.tangents.iter().map(|tangent| {
            let whole = [&tangent.as_ref()?[..], &vec![f64::NAN; m]].concat();
            Some(self.found.method.constant(whole))
        });
        let values = values.collect();
        self.found.pieces.push(Piece {
            from: time,
            to: time,
            values,
        });
    }

    /// A surface that was touched, or was not as far as that can be told.
    fn approach(&mut self, approach: &Approach) {
        const NEAR: f64 = 1e-9;
        let gradient = approach.gradient.iter();
        let size: f64 = gradient.map(|&(j, g)| g.abs() * self.sizes[j]).sum();
        if approach.distance.abs() <= approach.rounding.max(NEAR * size) {
            self.lose_all(approach.time, Why::Grazing, &[approach.switch]);
        }
    }
}
