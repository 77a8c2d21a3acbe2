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

use super::adaptive::{GROWTH, ROUNDING, SAFETY};
use super::element::Unsolved;
use super::emit::Observer;
use super::system::Reduced;
use super::watch::{BAND, Start, Verdict};
use super::{Element, Mode, Run, Simulator};
use crate::event::Segment;
use crate::expansion::series;
use crate::fesd::system::hidden::Hidden;
use crate::hybrid::{Side, Status};
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
pub(super) struct Ahead {
    /// The place of α among the unknowns.
    unknown: usize,
    rises: bool,
    /// dt/dσ here.
    speed: f64,
    /// How far α has to go.
    distance: f64,
}

/// What a look at a fold needs memory for.
#[derive(Default)]
pub(super) struct Near {
    w: Vec<f64>,
    rates: Vec<f64>,
    by_time: Vec<f64>,
}

/// How long elements are.
#[derive(Clone, Copy)]
pub(super) struct Length {
    /// In time, where nothing else is known.
    pub h: f64,
    /// What the defect may be, and the power by which it depends on the length.
    pub target: Option<(f64, f64)>,
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

impl Simulator<'_> {
    /// The fold that the sliding modes are near.
    pub(super) fn fold_ahead(&mut self, run: &Run) -> Option<Ahead> {
        let Mode { element, hidden } = &mut self.modes[run.mode];
        let reduced = &*element.reduced;
        if !reduced.has_branches {
            return None;
        }
        let Near { w, rates, by_time } = &mut self.near;
        w.clear();
        w.extend(reduced.unknowns.iter().map(|&i| run.z[i]));
        hidden.set(run.t, run.x.iter().copied(), w);
        let here = hidden.determinant(reduced);
        rates.clear();
        rates.extend(hidden.eval(&reduced.equations).take(run.x.len()));
        hidden.rate_of_w(reduced, rates, by_time).ok()?;
        let size = |k: &usize| by_time[*k].abs();
        let unknown = (0..w.len()).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        let step = ASIDE / size(&unknown);
        if !step.is_finite() {
            return None;
        }
        let x = run.x.iter().zip(&*rates).map(|(x, rate)| x + step * rate);
        for (w, rate) in w.iter_mut().zip(&*by_time) {
            *w += step * rate;
        }
        hidden.set(run.t + step, x, w);
        let there = hidden.determinant(reduced);
        let distance = ASIDE * here / (here - there);
        (distance > 0.0 && distance <= ZONE).then_some(Ahead {
            unknown,
            rises: by_time[unknown] > 0.0,
            speed: 1.0 / size(&unknown),
            distance,
        })
    }

    /// Solves for an element towards a fold, up to a time, and goes on from its end; false, with nothing done, where
    /// α cannot be the independent variable.
    pub(super) fn approach(
        &mut self,
        run: &mut Run,
        ahead: Ahead,
        end: f64,
        length: Length,
        observer: &mut impl Observer,
    ) -> Result<bool, Status> {
        if end - run.t <= 16.0 * f64::EPSILON * end.abs() {
            run.go_to(end);
            return Ok(true);
        }
        let time_form = self.modes[run.mode].element.reduced.clone();
        let of = time_form.unknowns[ahead.unknown];
        let key = (run.mode, ahead.unknown, ahead.rises);
        let mut mode = match self.branches.remove(&key) {
            Some(mode) => mode,
            None => {
                let Some(reduced) = self.system.branch(&run.zeros, of, ahead.rises) else {
                    return Ok(false);
                };
                let reduced = Arc::new(reduced);
                let (n, n_numbers) = (run.x.len() + 2, self.numbers.len());
                Mode {
                    hidden: Hidden::new(n, n_numbers, &reduced),
                    element: Element::new(&self.scheme, n, n_numbers, reduced),
                }
            }
        };
        mode.element.set_numbers(&self.numbers);
        mode.hidden.set_numbers(&self.numbers);
        let event = self.element_to_fold(run, &mut mode, &time_form, ahead, end, length, observer);
        let last = mode.element.reduced.watched.len() - 1;
        self.branches.insert(key, mode);
        let event = event?;
        if event == Some(last) {
            run.go_to(end);
        } else if let Some(member) = event {
            let is_fold = member + 1 == last;
            if is_fold {
                let pairs = self.system.pairs.iter();
                let own = pairs.map(|pair| [pair.left.variable, pair.right.variable].contains(&of));
                let pair = own.enumerate().find_map(|(at, own)| own.then_some(at));
                run.fold = pair.and_then(|pair| self.system.switches_of[pair].first().copied());
            }
            self.change(run, length.h, observer)?;
        }
        run.last = 0.0;
        Ok(true)
    }

    /// Solves for the element, tells it, and moves the run to its end. Returns the member that vanishes there.
    #[expect(clippy::too_many_arguments, reason = "one step of `approach`")]
    fn element_to_fold(
        &mut self,
        run: &mut Run,
        mode: &mut Mode,
        time_form: &Reduced,
        ahead: Ahead,
        end: f64,
        length: Length,
        observer: &mut impl Observer,
    ) -> Result<Option<usize>, Status> {
        let sign = if ahead.rises { 1.0 } else { -1.0 };
        let w = run.z_of(&time_form.unknowns);
        let start = run.t;
        let solved = self.solve_to_fold(run, mode, &w, ahead, end, length)?;
        self.tell_parts(run, mode, &solved, observer)?;
        let n = run.x.len();
        for (i, x) in run.x.iter_mut().enumerate() {
            *x = series::value(&solved.states[i], 1.0);
        }
        run.low.fill(0.0);
        run.go_to(series::value(&solved.states[n], 1.0));
        let mut after = Vec::new();
        self.values.w_at_end(&mode.element.reduced, &mut after);
        let others = (0..w.len()).filter(|k| *k != ahead.unknown);
        for (k, value) in others.zip(&after[1..]) {
            run.z[time_form.unknowns[k]] = *value;
        }
        let reached = mode.element.t + mode.element.h;
        run.z[time_form.unknowns[ahead.unknown]] = sign * reached;
        if !run.x.iter().all(|x| x.is_finite()) {
            return Err(Status::NotFinite);
        }
        for (scale, x) in run.scale.iter_mut().zip(&run.x) {
            *scale = scale.max(x.abs());
        }
        let w = run.z_of(&time_form.unknowns);
        let hidden = &mut self.modes[run.mode].hidden;
        hidden.set(run.t, run.x.iter().copied(), &w);
        let rates = hidden.eval(&time_form.equations).take(n);
        for (known, rate) in run.rates.iter_mut().zip(rates) {
            *known = rate;
        }
        run.starts.fill(Start::Inside);
        run.last = run.t - start;
        run.stats.steps += 1;
        Ok(solved.event)
    }

    /// The member that vanishes first in an element of length h, which then ends there.
    fn first_member(
        &mut self,
        mode: &mut Mode,
        h: f64,
        starts: &[Start],
        sizes: Sizes,
    ) -> Result<Option<usize>, Unsolved> {
        let (scheme, element, hidden) = (&self.scheme, &mut mode.element, &mut mode.hidden);
        self.values.evaluate(scheme, element, hidden)?;
        let scales = (sizes.members, sizes.rates);
        match (self.values).judge(scheme, starts, scales, &mut self.roots) {
            Verdict::Stays => Ok(None),
            Verdict::Wrong { .. } => Err(Unsolved::Diverged),
            Verdict::Leaves { sigma, member } => {
                element.shorten(scheme, sigma);
                let zero = (member, BAND * sizes.members[member]);
                let taken = element.solve_to(scheme, hidden, zero, sizes.states)?;
                if !(taken > 0.0 && taken <= h * (1.0 + 1e-9)) {
                    return Err(Unsolved::Diverged);
                }
                self.values.evaluate(scheme, element, hidden)?;
                Ok(Some(member))
            }
        }
    }

    fn solve_to_fold(
        &mut self,
        run: &mut Run,
        mode: &mut Mode,
        w: &[f64],
        ahead: Ahead,
        end: f64,
        length: Length,
    ) -> Result<Solved, Status> {
        let reduced = mode.element.reduced.clone();
        let n = run.x.len();
        let left = end - run.t;
        let sigma = if ahead.rises {
            w[ahead.unknown]
        } else {
            -w[ahead.unknown]
        };
        let mut x0 = run.x.clone();
        x0.extend([run.t, left]);
        let mut scale = run.scale.clone();
        scale.extend([run.t1.abs().max(left); 2]);
        let mut unknowns = vec![ahead.speed];
        unknowns.extend((0..w.len()).filter(|k| *k != ahead.unknown).map(|k| w[k]));
        let in_time = &mut self.modes[run.mode];
        in_time.hidden.set(run.t, run.x.iter().copied(), w);
        let rates = in_time.hidden.eval(&in_time.element.reduced.equations);
        let rates = rates.take(n).map(|rate| ahead.speed * rate);
        let mut rates: Vec<f64> = rates.collect();
        rates.extend([ahead.speed, -ahead.speed]);
        let n_pairs = reduced.watched.len() - 2;
        let mut starts = run.starts.clone();
        starts.resize(n_pairs + 2, Start::Inside);
        let mut sizes = run.sizes[..n_pairs].to_vec();
        sizes.extend([ahead.speed, left]);

        // As long as elements in time are where α becomes the independent variable.
        let mut h = match run.next_branch {
            next if next > 0.0 && length.target.is_some() => next,
            _ => length.h * ahead.distance / (ahead.speed * ZONE),
        };
        for _ in 0..MAX_TRIALS {
            mode.element.guess(&rates, &unknowns);
            let scheme = &self.scheme;
            let solved = mode.element.solve(scheme, sigma, h, &x0, &scale);
            let sizes = Sizes {
                members: &sizes,
                states: &scale,
                rates: run.rate_scale * h * ahead.speed,
            };
            let event = solved.and_then(|()| self.first_member(mode, h, &starts, sizes));
            let Ok(event) = event else {
                h *= 0.5;
                continue;
            };
            let states = self.states_of(&mode.element);
            if let Some((target, exponent)) = length.target {
                let error = self.defect_along(mode, &states, &scale, target);
                let best = SAFETY * (target / error.max(f64::MIN_POSITIVE)).powf(1.0 / exponent);
                let next = mode.element.h * best.clamp(GROWTH[0], GROWTH[1]);
                if error > target {
                    run.stats.rejected += 1;
                    h = next.min(0.9 * mode.element.h);
                    continue;
                }
                run.next_branch = if event.is_some() { next.max(h) } else { next };
                run.defect = run.defect.max(error);
            }
            return Ok(Solved { event, states });
        }
        Err(Status::Unsolved)
    }

    /// Coefficients in (σ - σ₀)/h of every state of an element.
    fn states_of(&self, element: &Element) -> Vec<Vec<f64>> {
        let (scheme, per_node) = (&self.scheme, element.per_node());
        let s = scheme.s;
        let state = |i: usize| {
            let mut c = vec![0.0; s + 1];
            c[0] = element.x0[i];
            for (j, powers) in scheme.integrals.chunks_exact(s).enumerate() {
                let rate = element.h * element.unknowns[j * per_node + i];
                for (c, power) in c[1..].iter_mut().zip(powers) {
                    *c += rate * power;
                }
            }
            // What a projection has moved the end by, evenly over the element.
            c[1] += element.h * element.mean[i] - c[1..].iter().sum::<f64>();
            c
        };
        (0..element.n_states()).map(state).collect()
    }

    /// ‖x' - f‖ h between the nodes, by σ, relative to the size of each state.
    fn defect_along(
        &self,
        mode: &mut Mode,
        states: &[Vec<f64>],
        scale: &[f64],
        target: f64,
    ) -> f64 {
        let (element, scheme) = (&mode.element, &self.scheme);
        let mut worst = 0.0_f64;
        for sigma in scheme.probes() {
            let x = states.iter().map(|c| series::value(c, sigma));
            let w = element.w(scheme.s / 2);
            mode.hidden.set(element.t + sigma * element.h, x, w);
            if mode.hidden.solve(&element.reduced).is_err() {
                return f64::INFINITY;
            }
            let rates = mode.hidden.eval(&element.reduced.equations);
            for (i, ((c, scale), f)) in states.iter().zip(scale).zip(rates).enumerate() {
                let moves = series::slope(c, sigma);
                let rounding = ROUNDING * element.h * element.activity[i] / target;
                let size = scale.max(moves.abs()).max(rounding);
                let size = size.max(f64::MIN_POSITIVE);
                worst = worst.max((moves - element.h * f).abs() / size);
            }
        }
        if worst.is_nan() { f64::INFINITY } else { worst }
    }

    /// Tells an observer of the element in polynomials of time.
    fn tell_parts(
        &mut self,
        run: &Run,
        mode: &mut Mode,
        solved: &Solved,
        observer: &mut impl Observer,
    ) -> Result<(), Status> {
        let (n, scheme) = (run.x.len(), &self.scheme);
        let sides = mode.element.reduced.sides.clone();
        let n_points = scheme.points.len();
        let mut alphas = Vec::new();
        self.values
            .alphas(scheme, &mode.element, &mut mode.hidden, &mut alphas);
        let mut curves: Vec<(usize, Vec<f64>)> =
            (solved.states[..n].iter().cloned().enumerate()).collect();
        let sliding = (0..sides.len()).filter(|i| sides[*i] == Side::Slide);
        for (place, switch) in sliding.enumerate() {
            let mut c = vec![0.0; n_points];
            scheme.point_series(&alphas[place * n_points..(place + 1) * n_points], &mut c);
            curves.push((n + switch, c));
        }
        let time = &solved.states[n];
        let points: Vec<f64> = (0..=DEGREE)
            .map(|j| 0.5 - 0.5 * (std::f64::consts::PI * j as f64 / DEGREE as f64).cos())
            .collect();
        let matrix = monomials(&points);
        let mut x = run.x.clone();
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
