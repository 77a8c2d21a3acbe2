//! S' = f_x S + f_p along a step, whose polynomials are known: a linear equation with known coefficients.
//!
//! A part of the step is halved until the Taylor series of a tangent has ended, by its last terms and by the defect S' - J S - b
//! in its middle and at its end. Where stiffness would take it far, Radau IIA goes on, whose linear systems are of the size of
//! the state and serve all directions.
//!
//! What the run does not move by, it does not see: a pulse times a parameter or a state that is zero. A part is therefore
//! halved until the derivatives of f are tame over it (`tape/enclosures/tame.rs`), so that no pulse of theirs is between the
//! points that are looked at.

use std::cell::OnceCell;

use wide::f64x4;

use super::functions::{Functions, Linearized, ModeFunctions, Moved, Point};
use super::run::Run;
use super::sizes::Sizes;
use super::stiff::Stiff;
use super::taylor::{LANES, Slopes, Tangent, in_lanes, number, of_lane};
use super::why::Why;
use crate::event::recording::Step;
use crate::expansion::series;
use crate::hybrid::Input;
use crate::tape::{Ball, Lane, NOTHING};

/// Halvings of a step, and after how many that do not converge it is stiff.
const MOST_HALVINGS: usize = 20;
const STIFF: usize = 4;
/// Steps that are stiff without another look.
const PATIENCE: usize = 32;
/// Parts of a step that are enclosed at most.
const MOST_ENCLOSED: usize = 4000;
/// A defect is rounding up to this part of its terms, and as far as functions move with so much of what they read.
const ROUNDING: f64 = 1e-14;
const NOISE: f64 = 16.0 * f64::EPSILON;
/// Of a series that has begun to converge, the last terms are no larger than this part of the largest.
const DECAYED: f64 = 1e-3;
/// A part is stiff where S may change by itself this many times over it.
const FAST: f64 = 4.0;

/// A part of a step.
pub(super) struct Part {
    /// Its ends, from the start of the step.
    pub ends: [f64; 2],
    /// The slopes along it; none where it was solved by Radau IIA.
    pub slopes: Option<Slopes>,
    /// The functions in its middle.
    pub middle: Linearized,
    /// S by direction that is known, and where it ends.
    pub tangents: Vec<Option<(Tangent, Vec<f64>)>>,
}

/// A step in its mode.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    pub step: &'a Step,
    pub mode: &'a ModeFunctions,
    pub coefficients: &'a [f64],
    pub run: &'a Run<'a>,
    pub sizes: &'a Sizes,
}

/// Why a part of a step is too long for a direction.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum TooLong {
    Inexact,
    Divergent,
}

/// S of a direction along a part, and where it ends.
pub(super) type Found = Result<(Tangent, Vec<f64>), TooLong>;

/// The method.
pub(super) struct Variational {
    stiff: Stiff,
    /// Steps that are taken for stiff.
    patience: usize,
}

impl Variational {
    pub fn new(tolerance: f64) -> Self {
        Variational {
            stiff: Stiff::new(tolerance),
            patience: 0,
        }
    }

    /// Forgets how the steps before were.
    pub fn restart(&mut self) {
        self.patience = 0;
    }

    /// Takes tangents of the directions that are known along a step, and hands on its parts. Where one cannot go on it is
    /// taken away and told with how far it went.
    pub fn follow(
        &mut self,
        functions: &mut Functions,
        way: Way,
        tangents: &mut [Option<Vec<f64>>],
        mut see: impl FnMut(&mut Functions, &mut Part) -> Vec<(usize, Why, Vec<usize>)>,
    ) -> Vec<(usize, Why, Vec<usize>, f64)> {
        let length = way.step.length;
        let mut lost = Vec::new();
        let mut enclosed = 0..MOST_ENCLOSED;
        let mut left = vec![([0.0, length], 0)];
        self.stiff.begin(way);
        while let Some((ends, halvings)) = left.pop() {
            if tangents.iter().all(Option::is_none) {
                break;
            }
            let is_stiff = self.patience > 0;
            let is_tame = way.is_tame(functions, ends);
            if !is_tame && halvings < MOST_HALVINGS && enclosed.next().is_some() {
                left.extend(halves(ends, halvings));
                continue;
            }
            let found = match way.run.limit.over() {
                Some(over) => Err(Why::from(over)),
                None if !is_tame => Err(Why::Rough),
                None if is_stiff => self.stiff.part(functions, way, tangents, ends),
                None => expanded(functions, way, tangents, (ends, halvings < STIFF)),
            };
            let (middle, slopes, found) = match found {
                Ok(found) => found,
                Err(why) => {
                    let all = (0..tangents.len()).filter(|&d| tangents[d].take().is_some());
                    lost.extend(all.map(|d| (d, why, way.mode.sliding.clone(), ends[0])));
                    break;
                }
            };
            let too_long = || {
                found
                    .iter()
                    .filter_map(|found| found.as_ref()?.as_ref().err())
            };
            if halvings < MOST_HALVINGS && too_long().next().is_some() {
                let is_divergent = too_long().any(|&why| why == TooLong::Divergent);
                if !is_stiff && halvings >= STIFF && is_divergent {
                    self.patience = PATIENCE;
                    left = vec![([ends[0], length], 0)];
                    continue;
                }
                left.extend(halves(ends, halvings));
                continue;
            }
            let mut part = Part {
                ends,
                slopes,
                middle,
                tangents: Vec::new(),
            };
            for (d, found) in found.into_iter().enumerate() {
                if let Some(Err(_)) = found {
                    lost.push((d, Why::Rough, way.mode.sliding.clone(), ends[0]));
                }
                let found = found.and_then(Result::ok);
                tangents[d] = found.as_ref().map(|(_, end)| end.clone());
                part.tangents.push(found);
            }
            for (d, why, switches) in see(functions, &mut part) {
                tangents[d] = None;
                lost.push((d, why, switches, ends[0]));
            }
        }
        self.patience = self.patience.saturating_sub(1);
        lost
    }
}

/// What is known of a part: the functions in its middle, slopes along it where there are any, and S by direction.
pub(super) type Known = (Linearized, Option<Slopes>, Vec<Option<Found>>);

/// Tangents along a part by Taylor series; where one of them will halve it, no more than that.
fn expanded(
    functions: &mut Functions,
    way: Way,
    tangents: &[Option<Vec<f64>>],
    ([a, b], is_halved): ([f64; 2], bool),
) -> Result<Known, Why> {
    let half = 0.5 * (a + b);
    let slopes = Slopes::new(functions, way, a).map_err(|_| Why::Singular)?;
    let middle = way.linearize(functions, half)?;
    let mut expansion = Expansion {
        end: way.linearize(functions, b)?,
        shaken: None,
        fastest: OnceCell::new(),
        middle: &middle,
        slopes,
        ends: [a, b],
        tolerance: way.run.tolerance,
    };
    let known = tangents.iter().enumerate();
    let known: Vec<(usize, &[f64])> = known
        .filter_map(|(d, tangent)| Some((d, tangent.as_deref()?)))
        .collect();
    let mut found: Vec<Option<Found>> = tangents.iter().map(|_| None).collect();
    for lanes in known.chunks(LANES) {
        let all = (lanes, is_halved);
        let is_known = match lanes {
            [_] => expansion.solve::<f64>(functions, way, all, &mut found)?,
            _ => expansion.solve::<f64x4>(functions, way, all, &mut found)?,
        };
        if !is_known {
            break;
        }
    }
    let Expansion { slopes, .. } = expansion;
    Ok((middle, Some(slopes), found))
}

/// The halves of a part, the first one last.
fn halves([a, b]: [f64; 2], halvings: usize) -> [([f64; 2], usize); 2] {
    let middle = 0.5 * (a + b);
    [([middle, b], halvings + 1), ([a, middle], halvings + 1)]
}

/// |v - w|.
pub(super) fn difference(v: &[f64], w: &[f64]) -> Vec<f64> {
    v.iter().zip(w).map(|(v, w)| (v - w).abs()).collect()
}

/// What is seen of tangents along a part, in lanes of directions.
struct Looked<L> {
    tangents: Tangent<L>,
    /// The largest terms of each entry at the end, and those of the last orders.
    terms: Vec<[L; 2]>,
    /// S at the end, and the sizes of the terms of its rates.
    end: Vec<L>,
    rates: Vec<L>,
    /// The defects S' - J S - b in the middle and at the end.
    inside: Vec<L>,
    missed: Vec<L>,
}

/// The series of tangents along a part of a step.
struct Expansion<'a> {
    slopes: Slopes,
    /// How fast S may change by itself, where that is asked for.
    fastest: OnceCell<f64>,
    middle: &'a Linearized,
    end: Linearized,
    /// In the middle, beside the run by rounding, where that matters.
    shaken: Option<Linearized>,
    /// From the start of the step.
    ends: [f64; 2],
    tolerance: f64,
}

impl Expansion<'_> {
    fn h(&self) -> f64 {
        self.ends[1] - self.ends[0]
    }

    /// S of directions from their starts; false behind one that will halve the part.
    fn solve<L: Lane>(
        &mut self,
        functions: &mut Functions,
        way: Way,
        (lanes, is_halved): (&[(usize, &[f64])], bool),
        found: &mut [Option<Found>],
    ) -> Result<bool, Why> {
        let looked = self.look::<L>(functions, lanes);
        for (lane, &one) in lanes.iter().enumerate() {
            let (d, start) = one;
            let (largest, share) = (way.sizes.tangents(d), way.least(functions, start, d));
            let least = |k: usize| share * way.sizes.largest[k];
            let mut solved = self.checked(functions, one, (&largest, least), (&looked, lane));
            if solved.is_err() {
                // Rounding of the functions may be why.
                if self.shaken.is_none() {
                    let [a, b] = self.ends;
                    self.shaken = Some(way.shaken(functions, 0.5 * (a + b), NOISE)?);
                }
                let again = self.look::<f64>(functions, &[one]);
                solved = self.checked(functions, one, (&largest, least), (&again, 0));
            }
            let is_last = is_halved && solved.is_err();
            found[d] = Some(solved);
            if is_last {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// S of directions from their starts.
    fn look<L: Lane>(&self, functions: &Functions, lanes: &[(usize, &[f64])]) -> Looked<L> {
        let (h, slots) = (self.h(), functions.slots);
        // What begins at a high order is seen at a second look.
        let ends = self.shaken.is_none().then_some(h);
        let starts: Vec<&[f64]> = lanes.iter().map(|&(_, start)| start).collect();
        let by: Vec<L> = functions.lanes(lanes.iter().map(|&(d, _)| d));
        let tangents = self.slopes.tangents([&in_lanes(&starts), &by], ends);
        let missed = |linear: &Linearized, [s, mut slope]: [Vec<L>; 2]| {
            let term = |slot, slope| functions.term_lanes(slot, slope, [&s, &by]);
            let rates = linear.along_lanes(slots, term);
            for (slope, rate) in slope.iter_mut().zip(rates) {
                *slope = (*slope - rate).map(f64::abs);
            }
            (s, slope)
        };
        let (_, inside) = missed(self.middle, tangents.at_with_slope(0.5 * h));
        let (end, missed) = missed(&self.end, tangents.at_with_slope(h));
        let term = |slot, slope| functions.term_lanes(slot, slope, [&end, &by]);
        Looked {
            rates: self.end.terms_lanes(slots, term),
            inside,
            missed,
            terms: tangents.terms(h),
            end,
            tangents,
        }
    }

    /// S of a direction where it is one, by how large its entries have been, and below which size they are nothing.
    fn checked<L: Lane>(
        &self,
        functions: &Functions,
        (d, start): (usize, &[f64]),
        (largest, least): (impl Fn(usize) -> f64, impl Fn(usize) -> f64),
        (looked, lane): (&Looked<L>, usize),
    ) -> Found {
        let h = self.h();
        let first_terms = self.slopes.terms(start, functions.direction(d));
        let of = |numbers: &L| number(numbers, lane);
        let known = |k: usize| largest(k).max(start[k].abs()).max(h * first_terms[k]);
        let forced = OnceCell::new();
        for (k, terms) in looked.terms.iter().enumerate() {
            let [whole, last] = terms.each_ref().map(of);
            let known = if known(k) > 0.0 { known(k) } else { whole };
            let is_sum = |known: f64| {
                let allowed = self.tolerance * known.max(least(k));
                // Its sum is what terms leave of each other, or no sum.
                let is_sum = f64::EPSILON * whole <= allowed;
                is_sum && (last <= DECAYED * whole || last <= allowed)
            };
            // What moves it may be zero at the start, to rounding.
            let forced = || forced.get_or_init(|| self.forced(functions, start.len(), d));
            if !is_sum(known) && !is_sum(known.max(h * forced()[k])) {
                let fastest = || self.slopes.fastest(start.len());
                return Err(if h * *self.fastest.get_or_init(fastest) > FAST {
                    TooLong::Divergent
                } else {
                    TooLong::Inexact
                });
            }
        }
        let noise = match &self.shaken {
            Some(shaken) => self.noise(functions, shaken, (start, d)),
            None => vec![0.0; start.len()],
        };
        let (tangent, end) = (looked.tangents.lane(lane), of_lane(&looked.end, lane));
        let order = tangent.order() as f64;
        for (k, [_, last]) in looked.terms.iter().enumerate() {
            // Where an entry has been small so far, its size is that of what it is made of.
            let known = known(k).max(end[k].abs()).max(least(k));
            let terms = of(&looked.rates[k]);
            let size = known / h + terms + NOTHING;
            let allowed = self.tolerance * size + ROUNDING * terms + noise[k];
            // The defect at the end is that of the first term that is missing.
            let (inside, missed) = (of(&looked.inside[k]), of(&looked.missed[k]));
            let defects = [of(last) / h, inside, missed / (order + 1.0)];
            if !defects.into_iter().all(|rate| rate <= allowed) {
                return Err(TooLong::Inexact);
            }
        }
        Ok((tangent, end))
    }

    /// How large the terms of the rates of a tangent are where it is zero, in the middle or at the end.
    fn forced(&self, functions: &Functions, n: usize, d: usize) -> Vec<f64> {
        let zero = vec![0.0; n];
        let terms =
            [self.middle, &self.end].map(|linear| linear.terms(functions, Moved::still(&zero), d));
        let [middle, end] = &terms;
        middle.iter().zip(end).map(|(a, b)| a.max(*b)).collect()
    }

    /// What rounding makes of the rates of a tangent.
    fn noise(
        &self,
        functions: &Functions,
        shaken: &Linearized,
        (tangent, d): (&[f64], usize),
    ) -> Vec<f64> {
        let rates = |linear: &Linearized| along(functions, linear, tangent, d);
        difference(&rates(self.middle), &rates(shaken))
    }
}

/// S' of a direction.
fn along(functions: &Functions, linear: &Linearized, s: &[f64], d: usize) -> Vec<f64> {
    let [f, _] = linear.along(functions, Moved::still(s), d);
    f
}

impl Way<'_> {
    /// The functions `tau` after the start of the step, where the run moves as they say.
    pub fn linearize(&self, functions: &mut Functions, tau: f64) -> Result<Linearized, Why> {
        const UNLIKE: f64 = 1e-3;
        const ROUNDING: f64 = 1e-9;
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let (mut x, mut slope, mut alpha) = (vec![0.0; n], vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut slope);
        self.step.alpha(tau, &mut alpha);
        let point = self.point(tau, &x, &alpha);
        let linear = functions
            .linearize(self.mode, &point)
            .map_err(|_| Why::Singular)?;
        let is_alike = |i: usize, more: f64| {
            let (f, slope) = (linear.f[i], slope[i]);
            let size = f.abs() + slope.abs() + x[i].abs() / self.step.length;
            let allowed = UNLIKE * size + ROUNDING * self.sizes.fastest[i] + more + NOTHING;
            (f - slope).abs() <= allowed
        };
        if !(0..n).all(|i| is_alike(i, 0.0)) {
            // Terms that cancel are known to the tolerance, and to what rounding leaves of them.
            let (accuracy, largest) = (10.0 * self.run.accuracy.0, &self.sizes.largest);
            let terms = linear.rates(
                functions.slots,
                |slot, slope| match slot {
                    slot if (1..=n).contains(&slot) => (slope * largest[slot - 1]).abs(),
                    _ => 0.0,
                },
                |_, slope| slope.abs(),
            );
            let rounded = functions.rounded(self.mode, &point);
            if !(0..n).all(|i| is_alike(i, accuracy * terms[i] + 16.0 * rounded[i])) {
                return Err(Why::Unknown);
            }
        }
        Ok(linear)
    }

    /// The functions beside the run by a share of how large states are, and by rounding of the time: tangents are no better
    /// known than what that makes of their rates.
    pub fn shaken(&self, functions: &mut Functions, tau: f64, by: f64) -> Result<Linearized, Why> {
        let (n, m) = (functions.slots.n_states, functions.slots.n_switches);
        let (mut x, mut alpha) = (vec![0.0; n], vec![0.0; m]);
        self.step.state(tau, &mut x, &mut vec![0.0; n]);
        self.step.alpha(tau, &mut alpha);
        let mut share = 0.0_f64;
        for (x, size) in x.iter_mut().zip(&self.sizes.largest) {
            // Signs in proportions that do not cancel.
            share = (share + 0.618_033_988_749_895).fract();
            *x += by * size * (2.0 * share - 1.0).signum();
        }
        let mut point = self.point(tau, &x, &alpha);
        point.t *= 1.0 + 4.0 * f64::EPSILON;
        let shaken = functions.linearize(self.mode, &point);
        shaken.map_err(|_| Why::Singular)
    }

    /// The part of how large states are that a tangent has to have to be anything at all: where states and parameters are
    /// one, rounding of what rounding leaves of its largest entry, as what comes to it through many others at first.
    fn least(&self, functions: &Functions, tangent: &[f64], d: usize) -> f64 {
        let share = |(by, size): (&f64, &f64)| match *size == 0.0 {
            true => 0.0,
            false => (by / size).abs(),
        };
        let own = tangent.iter().zip(&self.sizes.largest).map(share);
        let by = functions.direction(d).iter().zip(self.run.parameters);
        let largest = own.chain(by.map(share)).fold(0.0, f64::max);
        f64::EPSILON * (f64::EPSILON * largest).min(1.0)
    }

    /// Whether no derivative of the functions hides anything in a part of the step.
    fn is_tame(&self, functions: &mut Functions, [a, b]: [f64; 2]) -> bool {
        let (middle, radius) = (0.5 * (a + b), 0.5 * (b - a));
        let moving = |at: usize| {
            let row = self.step.row(at);
            let motion = series::motion(row, middle, radius);
            Ball::new(series::value(row, middle), motion)
        };
        let n = functions.slots.n_states;
        let states: Vec<Ball> = (0..n).map(moving).collect();
        let mut alpha = vec![0.0; functions.slots.n_switches];
        self.step.alpha(middle, &mut alpha);
        let point = self.point(middle, &[], &alpha);
        let sliding = &self.mode.sliding;
        functions.are_tame(self.mode, |input| match input {
            Input::Time => Ball::new(point.t, radius),
            Input::State(i) => states[i],
            Input::Alpha(switch) if sliding.contains(&switch) => moving(n + switch),
            _ => Ball::new(point.value(input), 0.0),
        })
    }

    /// A point of the step.
    pub fn point<'p>(&'p self, tau: f64, x: &'p [f64], alpha: &'p [f64]) -> Point<'p> {
        Point {
            t: self.step.start + tau,
            x,
            alpha,
            coefficients: self.coefficients,
            parameters: self.run.parameters,
        }
    }
}
