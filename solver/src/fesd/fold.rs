//! Elements along a branch of sliding modes that comes to its end.
//!
//! At a sliding fold two sliding modes meet and are gone. As a function of time α ends there like a square root, which
//! no polynomial follows; as functions of α, x and t are smooth, and dt/dα vanishes at the fold. So close to it α is
//! the independent variable: with σ = ±α, which rises, and T = dt/dσ,
//!
//! dx/dσ = T f(t, x, α),   dt/dσ = T,   0 = φ(t, x, α)
//!
//! keeps the order of the method, and the element ends at the simple root T = 0, at the end of the step, or where
//! another member vanishes. An observer gets polynomials in time, on parts that become shorter towards the fold.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::adaptive::{Control, ROUNDING};
use super::emit::Observer;
use super::modes::{Mode, Modes};
use super::run::{NEAR, Run};
use super::watch::{BAND, Start, Values, Verdict};
use crate::event::Segment;
use crate::expansion::dense::ElementSeries;
use crate::expansion::series;
use crate::fesd::element::Element;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::system::hidden::{Hidden, Unsolved};
use crate::hybrid::{Side, Stats, Status};
use crate::integrate::tableau::monomials;

/// α is the independent variable where a fold is no farther than this, as ∂φ/∂α shows it.
const ZONE: f64 = 0.25;

/// A change of α over which ∂φ/∂α is compared.
const ASIDE: f64 = 1e-6;

/// Elements that are tried, each shorter than the one before.
const MAX_TRIALS: usize = 40;

/// Degree of the polynomials in time, and how close to a fold the last of them begins, by dt/dσ.
const DEGREE: usize = 8;
const LAST: f64 = 1e-4;

/// A fold that is near.
#[derive(Clone, Copy)]
pub(crate) struct Ahead {
    /// The place of α among the unknowns.
    unknown: usize,
    rises: bool,
    /// dt/dσ here.
    speed: f64,
    /// How far α has to go.
    distance: f64,
}

/// How long elements are.
#[derive(Clone, Copy)]
pub(crate) struct Length {
    /// In time, where nothing else is known.
    pub h: f64,
    /// Where the step ends.
    pub end: f64,
    /// By the defect, where that has a bound.
    pub control: Option<Control>,
}

/// Where a run has come to along a branch.
pub(crate) enum Reached {
    /// Nowhere: α cannot be the independent variable.
    Nothing,
    /// The end of the step, which was within rounding.
    EndAtOnce,
    /// The end of an element within the step, or of the step.
    Inside,
    /// The end of an element on the boundary of the active set.
    Boundary,
}

/// Sizes of members, of states, and of rates of members.
struct Sizes<'s> {
    members: &'s [f64],
    states: &'s [f64],
    rates: f64,
}

/// An element that has been solved, and what has ended it.
struct Solved {
    event: Option<usize>,
    /// Coefficients in (σ - σ₀)/h of x, t and the time left.
    states: Vec<Vec<f64>>,
}

/// Branches of sliding modes, and the memory to follow them.
pub(crate) struct Folds {
    /// By the mode, the unknown that takes the place of time, and whether it rises.
    branches: FxHashMap<(usize, usize, bool), Mode>,
    w: Vec<f64>,
    rates: Vec<f64>,
    by_time: Vec<f64>,
    values: Values,
    series: ElementSeries,
}

impl Folds {
    /// No branch yet.
    pub fn new(scheme: &Scheme) -> Self {
        Folds {
            branches: FxHashMap::default(),
            w: Vec::new(),
            rates: Vec::new(),
            by_time: Vec::new(),
            values: Values::new(scheme),
            series: ElementSeries::default(),
        }
    }

    /// Branches that have functions.
    pub fn n_branches(&self) -> usize {
        self.branches.len()
    }

    /// The fold that the sliding modes are near.
    pub fn ahead(&mut self, modes: &mut Modes, run: &Run) -> Option<Ahead> {
        let Mode { element, hidden } = &mut modes.all[run.place.mode];
        let reduced = &*element.reduced;
        if !reduced.has_branches {
            return None;
        }
        let Folds {
            w, rates, by_time, ..
        } = self;
        let place = &run.place;
        w.clear();
        w.extend(reduced.unknowns.iter().map(|&i| place.z[i]));
        hidden.set(place.t, place.x.iter().copied(), w);
        let here = hidden.determinant(reduced);
        rates.clear();
        rates.extend(hidden.eval(&reduced.equations.tape).take(place.x.len()));
        hidden.rate_of_w(reduced, rates, by_time).ok()?;
        let size = |k: &usize| by_time[*k].abs();
        let unknown = (0..w.len()).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let rate = by_time[unknown];
        let step = ASIDE / rate.abs();
        if !step.is_finite() {
            return None;
        }
        let x = place.x.iter().zip(&*rates).map(|(x, rate)| x + step * rate);
        for (w, rate) in w.iter_mut().zip(&*by_time) {
            *w += step * rate;
        }
        hidden.set(place.t + step, x, w);
        let there = hidden.determinant(reduced);
        let distance = ASIDE * here / (here - there);
        if !(distance > 0.0 && distance <= ZONE) {
            return None;
        }
        rates.clear();
        rates.extend(hidden.eval(&reduced.equations.tape).take(place.x.len()));
        hidden.rate_of_w(reduced, rates, by_time).ok()?;
        // α that slows down may turn before the fold: towards it, it becomes faster.
        (by_time[unknown] / rate >= 1.0).then_some(Ahead {
            unknown,
            rises: rate > 0.0,
            speed: 1.0 / rate.abs(),
            distance,
        })
    }

    /// Solves for an element towards a fold, and moves the run to its end.
    pub fn approach(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        ahead: Ahead,
        length: Length,
        observer: &mut dyn Observer,
    ) -> Result<Reached, Status> {
        if length.end - run.place.t <= NEAR * length.end.abs() {
            run.place.go_to(length.end);
            return Ok(Reached::EndAtOnce);
        }
        let of = modes.all[run.place.mode].element.reduced.unknowns[ahead.unknown];
        let key = (run.place.mode, ahead.unknown, ahead.rises);
        let branch = self.branches.remove(&key);
        let Some(mut branch) = branch.or_else(|| branch_mode(modes, run, of, ahead.rises)) else {
            return Ok(Reached::Nothing);
        };
        branch.set_numbers(&modes.numbers);
        let solved = self.solve(modes, run, &mut branch, ahead, length);
        let told = solved.and_then(|solved| {
            self.tell_parts(run, &modes.scheme, &mut branch, &solved, observer)?;
            self.follow(modes, run, &branch, ahead, &solved)?;
            Ok(solved.event)
        });
        let last = branch.element.reduced.watched.len() - 1;
        self.branches.insert(key, branch);
        let member = match told? {
            None => return Ok(Reached::Inside),
            Some(member) if member == last => {
                run.place.go_to(length.end);
                return Ok(Reached::Inside);
            }
            Some(member) => member,
        };
        if member + 1 == last {
            let system = modes.system;
            let pairs = system.pairs.iter();
            let own = pairs.map(|pair| [pair.left.variable, pair.right.variable].contains(&of));
            let pair = own.enumerate().find_map(|(at, own)| own.then_some(at));
            run.fold = pair.and_then(|pair| system.switches_of[pair].first().copied());
        }
        Ok(Reached::Boundary)
    }

    /// Moves the run to the end of an element.
    fn follow(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        branch: &Mode,
        ahead: Ahead,
        solved: &Solved,
    ) -> Result<(), Status> {
        let Mode { element, hidden } = &mut modes.all[run.place.mode];
        let reduced = &*element.reduced;
        let (start, place) = (run.place.t, &mut run.place);
        let n = place.x.len();
        for (x, c) in place.x.iter_mut().zip(&solved.states) {
            *x = series::value(c, 1.0);
        }
        place.low.fill(0.0);
        place.go_to(series::value(&solved.states[n], 1.0));
        let after = self.values.w_at_end(&branch.element.reduced);
        let others = (0..reduced.unknowns.len()).filter(|k| *k != ahead.unknown);
        for (k, value) in others.zip(&after[1..]) {
            place.z[reduced.unknowns[k]] = *value;
        }
        let sign = if ahead.rises { 1.0 } else { -1.0 };
        let reached = branch.element.stages.t + branch.element.stages.h;
        place.z[reduced.unknowns[ahead.unknown]] = sign * reached;
        if !place.x.iter().all(|x| x.is_finite()) {
            return Err(Status::NotFinite);
        }
        for (scale, x) in run.scale.iter_mut().zip(&place.x) {
            *scale = scale.max(x.abs());
        }
        let w = place.z_of(&reduced.unknowns);
        hidden.set(place.t, place.x.iter().copied(), &w);
        let rates = hidden.eval(&reduced.equations.tape).take(n);
        for (known, rate) in run.entry.rates.iter_mut().zip(rates) {
            *known = rate;
        }
        run.entry.starts.fill(Start::Inside);
        run.lengths.last = place.t - start;
        run.record.stats.steps += 1;
        Ok(())
    }

    /// The member that vanishes first in an element, which then ends there.
    fn first_member(
        &mut self,
        scheme: &Scheme,
        mode: &mut Mode,
        starts: &[Start],
        sizes: Sizes,
        stats: &mut Stats,
    ) -> Result<Option<usize>, Unsolved> {
        (self.values).evaluate(scheme, &mode.element, &mut mode.hidden)?;
        let scales = (sizes.members, sizes.rates);
        match self.values.judge(scheme, starts, scales) {
            Verdict::Stays => Ok(None),
            Verdict::Wrong { .. } => Err(Unsolved::Diverged),
            Verdict::Leaves { sigma, member } => {
                let zero = (member, BAND * sizes.members[member]);
                mode.cut(scheme, sigma, zero, sizes.states, stats)?;
                (self.values).evaluate(scheme, &mode.element, &mut mode.hidden)?;
                Ok(Some(member))
            }
        }
    }

    /// Solves for an element from where the run is.
    fn solve(
        &mut self,
        modes: &mut Modes,
        run: &mut Run,
        mode: &mut Mode,
        ahead: Ahead,
        length: Length,
    ) -> Result<Solved, Status> {
        let reduced = mode.element.reduced.clone();
        let n = run.place.x.len();
        let left = length.end - run.place.t;
        let in_time = &mut modes.all[run.place.mode];
        let w = run.place.z_of(&in_time.element.reduced.unknowns);
        let sigma = if ahead.rises {
            w[ahead.unknown]
        } else {
            -w[ahead.unknown]
        };
        let mut x0 = run.place.x.clone();
        x0.extend([run.place.t, left]);
        let mut scale = run.scale.clone();
        scale.extend([run.t1.abs().max(left); 2]);
        let mut unknowns = vec![ahead.speed];
        unknowns.extend((0..w.len()).filter(|k| *k != ahead.unknown).map(|k| w[k]));
        in_time
            .hidden
            .set(run.place.t, run.place.x.iter().copied(), &w);
        let rates = in_time.hidden.eval(&in_time.element.reduced.equations.tape);
        let rates = rates.take(n).map(|rate| ahead.speed * rate);
        let mut rates: Vec<f64> = rates.collect();
        rates.extend([ahead.speed, -ahead.speed]);
        let n_pairs = reduced.watched.len() - 2;
        let mut starts = run.entry.starts.clone();
        starts.resize(n_pairs + 2, Start::Inside);
        let mut sizes = run.entry.sizes[..n_pairs].to_vec();
        sizes.extend([ahead.speed, left]);

        // As long as elements in time are where α becomes the independent variable.
        let mut h = match run.lengths.next_branch {
            next if next > 0.0 && length.control.is_some() => next,
            _ => length.h * ahead.distance / (ahead.speed * ZONE),
        };
        for _ in 0..MAX_TRIALS {
            mode.element.stages.guess(&rates, &unknowns);
            let (scheme, stats) = (&modes.scheme, &mut run.record.stats);
            let solved = mode.element.solve(scheme, sigma, h, &x0, &scale, stats);
            let sizes = Sizes {
                members: &sizes,
                states: &scale,
                rates: run.entry.rate_scale * h * ahead.speed,
            };
            let event =
                solved.and_then(|()| self.first_member(scheme, mode, &starts, sizes, stats));
            let Ok(event) = event else {
                h *= 0.5;
                continue;
            };
            let states = states_of(scheme, &mode.element);
            if let Some(control) = length.control {
                let error = defect(scheme, mode, &states, &scale, control.target);
                let next = control.next(mode.element.stages.h, error);
                if error > control.target {
                    run.record.stats.rejected += 1;
                    h = next.min(0.9 * mode.element.stages.h);
                    continue;
                }
                run.lengths.next_branch = if event.is_some() { next.max(h) } else { next };
                run.record.defect = run.record.defect.max(error);
            }
            return Ok(Solved { event, states });
        }
        Err(Status::Unsolved)
    }

    /// Tells an observer of the element in polynomials of time.
    fn tell_parts(
        &mut self,
        run: &Run,
        scheme: &Scheme,
        mode: &mut Mode,
        solved: &Solved,
        observer: &mut dyn Observer,
    ) -> Result<(), Status> {
        let n = run.place.x.len();
        let sides = mode.element.reduced.sides.clone();
        let n_points = scheme.points.at.len();
        let mut alphas = Vec::new();
        self.values
            .alphas(scheme, &mode.element, &mut mode.hidden, &mut alphas);
        let mut curves: Vec<(usize, Vec<f64>)> =
            (solved.states[..n].iter().cloned().enumerate()).collect();
        let sliding = (0..sides.len()).filter(|i| sides[*i] == Side::Slide);
        for (place, switch) in sliding.enumerate() {
            let mut c = vec![0.0; n_points];
            scheme
                .points
                .all
                .series(&alphas[place * n_points..(place + 1) * n_points], &mut c);
            curves.push((n + switch, c));
        }
        let time = &solved.states[n];
        let points: Vec<f64> = (0..=DEGREE)
            .map(|j| 0.5 - 0.5 * (std::f64::consts::PI * j as f64 / DEGREE as f64).cos())
            .collect();
        let matrix = monomials(&points);
        let mut x = run.place.x.clone();
        for [low, high] in parts(time) {
            let [start, stop] = [low, high].map(|sigma| series::value(time, sigma));
            let length = stop - start;
            if length <= 0.0 {
                continue;
            }
            let at: Vec<f64> = (points.iter())
                .map(|p| instant(time, start + p * length, [low, high]))
                .collect();
            self.series.shape(n, sides.len(), DEGREE);
            for (row, curve) in &curves {
                let values: Vec<f64> = at
                    .iter()
                    .map(|&sigma| series::value(curve, sigma))
                    .collect();
                let mut power = 1.0;
                let rows = matrix.chunks_exact(DEGREE + 1);
                for (c, weights) in self.series.row_mut(*row).iter_mut().zip(rows) {
                    let sum: f64 = weights.iter().zip(&values).map(|(a, b)| a * b).sum();
                    *c = sum * power;
                    power /= length;
                }
            }
            for (x, c) in x.iter_mut().zip(&solved.states) {
                *x = series::value(c, high);
            }
            let segment = Segment {
                start,
                length,
                until: start + length,
                sides: &sides,
                end: &x,
                dense: &self.series,
            };
            if observer.segment(&segment).is_break() {
                return Err(Status::Stopped);
            }
        }
        Ok(())
    }
}

/// The equations of the header for the present active set, with σ = α if α rises, else -α, and an element for them;
/// `alpha` is the place of α in z. None if φ contains other unknowns than α.
fn branch_mode(modes: &Modes, run: &Run, alpha: usize, rises: bool) -> Option<Mode> {
    let reduced = Arc::new(modes.system.branch(&run.place.zeros, alpha, rises)?);
    // States are x, t and the time left.
    let (n, n_numbers) = (run.place.x.len() + 2, modes.numbers.len());
    Some(Mode {
        hidden: Hidden::new(n, n_numbers, &reduced),
        element: Element::new(&modes.scheme, n, n_numbers, reduced),
    })
}

/// Coefficients in (σ - σ₀)/h of every state of an element.
fn states_of(scheme: &Scheme, element: &Element) -> Vec<Vec<f64>> {
    let (s, per_node) = (scheme.s, element.stages.per_node);
    let state = |i: usize| {
        let mut c = vec![0.0; s + 1];
        c[0] = element.stages.x0[i];
        for (j, powers) in scheme.integrals.chunks_exact(s).enumerate() {
            let rate = element.stages.h * element.stages.unknowns[j * per_node + i];
            for (c, power) in c[1..].iter_mut().zip(powers) {
                *c += rate * power;
            }
        }
        // What a projection has moved the end by, evenly over the element.
        c[1] += element.stages.h * element.stages.mean[i] - c[1..].iter().sum::<f64>();
        c
    };
    (0..element.stages.n).map(state).collect()
}

/// ‖x' - f‖ h between the nodes, by σ, relative to the size of each state.
fn defect(
    scheme: &Scheme,
    mode: &mut Mode,
    states: &[Vec<f64>],
    scale: &[f64],
    target: f64,
) -> f64 {
    let element = &mode.element;
    let mut worst = 0.0_f64;
    for sigma in scheme.points.probes() {
        let x = states.iter().map(|c| series::value(c, sigma));
        let w = element.stages.w(scheme.s / 2);
        mode.hidden
            .set(element.stages.t + sigma * element.stages.h, x, w);
        if mode.hidden.solve(&element.reduced).is_err() {
            return f64::INFINITY;
        }
        let rates = mode.hidden.eval(&element.reduced.equations.tape);
        for (i, ((c, scale), f)) in states.iter().zip(scale).zip(rates).enumerate() {
            let moves = series::slope(c, sigma);
            let rounding = ROUNDING * element.stages.h * element.terms.activity[i] / target;
            let size = scale.max(moves.abs()).max(rounding);
            let size = size.max(f64::MIN_POSITIVE);
            worst = worst.max((moves - element.stages.h * f).abs() / size);
        }
    }
    if worst.is_nan() { f64::INFINITY } else { worst }
}

/// Parts of an element over which dt/dσ falls by no more than √½, so that a fold is as far as each is long.
fn parts(time: &[f64]) -> Vec<[f64; 2]> {
    let [first, last] = [0.0, 1.0].map(|sigma| series::slope(time, sigma).max(0.0));
    let mut parts = Vec::new();
    let (mut low, mut level) = (0.0, first);
    while low < 1.0 {
        level *= 0.5_f64.sqrt();
        let high = match level > last && level > LAST * first {
            true => ((first - level) / (first - last)).min(1.0),
            false => 1.0,
        };
        parts.push([low, high]);
        low = high;
    }
    parts
}

/// Where within an interval, in which time rises, it has a value.
fn instant(time: &[f64], value: f64, [mut low, mut high]: [f64; 2]) -> f64 {
    let mut sigma = 0.5 * (low + high);
    for _ in 0..60 {
        let miss = series::value(time, sigma) - value;
        if miss > 0.0 {
            high = sigma;
        } else {
            low = sigma;
        }
        let newton = sigma - miss / series::slope(time, sigma);
        let next = match low < newton && newton < high {
            true => newton,
            false => 0.5 * (low + high),
        };
        if next == sigma || miss == 0.0 {
            break;
        }
        sigma = next;
    }
    sigma
}
