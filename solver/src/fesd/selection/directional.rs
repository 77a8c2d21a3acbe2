//! Which active sets go on from a point.
//!
//! Where several members vanish at once, the right derivatives decide (Stewart 1990): with u_i = z_i
//! of what jumps and u_i = z_i' of what is continuous,
//!
//! 0 = g or g' at (t, x, u),   and for each pair with members J, which jumps, and C = 0:   0 ≤ J ⟂ C' ≥ 0
//!
//! For Stewart's form this is his linear complementarity problem for θ, with λ' and μ' as slacks.
//! All choices of the pairs that meet are tried, which finds every solution; of more than a few pairs
//! those of each independent group (`independent.rs`).

use std::f64::consts::TAU;

use super::independent::{MAX_OPEN, comparable, rate_scale};
use crate::fesd::element::blocks::Blocks;
use crate::fesd::system::evaluator::Evaluator;
use crate::fesd::system::{ComplementaritySystem, Full, Member, Zero};
use crate::fesd::watch::Start;
use crate::linalg::newton::Newton;

/// Directions from which one to set off in is looked for: there are at most four.
const DIRECTIONS: usize = 8;

/// Newton iterations for one active set, and a change of u that has converged.
const MAX_NEWTON: usize = 40;
const CONVERGED: f64 = 1e-13;

/// Values and rates below this, relative to their size, are zero: what comes next decides.
pub(crate) const TIE: f64 = 1e-9;

/// An active set that the first derivatives allow.
#[derive(Clone, Debug)]
pub(crate) struct Choice {
    pub zeros: Vec<Zero>,
    pub u: Vec<f64>,
    pub rates: Vec<f64>,
    /// How the member of every pair that is not zero starts.
    pub starts: Vec<Start>,
    /// Whether no member that could vanish is zero with its rate.
    pub strict: bool,
    /// What rates are zero next to.
    pub rate_scale: f64,
}

/// An active set, and u.
pub(crate) type Solved = (Vec<Zero>, Vec<f64>);

/// What was found.
pub(crate) struct Found {
    pub choices: Vec<Choice>,
    /// Whether all choices of the pairs that meet were tried.
    pub complete: bool,
    /// The pairs that meet.
    pub open: Vec<usize>,
    /// The largest rate of each state by any set that was tried, where there are several.
    pub sizes: Vec<f64>,
}

/// Solves the directional problem.
pub(crate) struct Directional {
    /// t, x, z, u and the numbers.
    at: Evaluator,
    /// Rows of g, then of the pairs.
    pub(crate) matrix: Blocks,
    pub(crate) rhs: Vec<f64>,
    residual: Vec<f64>,
    /// Which rows of g are about rates, once that was asked.
    pub(crate) of_rates: Vec<bool>,
    /// What the member of each pair is that is zero by its set, while it is not.
    pub(crate) held: Vec<f64>,
    n: usize,
}

impl Directional {
    pub fn new(system: &ComplementaritySystem) -> Self {
        let (n, n_z, full) = (system.n_states(), system.n_algebraics(), &system.full);
        let tapes = [
            &full.directional,
            &full.directional_slopes.tape,
            &full.rates,
        ];
        let n_equations = full.directional.n_outputs();
        let entries = full.directional_slopes.entries.iter();
        let entries = entries.map(|&(row, input)| (row, input - (1 + n + n_z)));
        let members = system.pairs.iter().enumerate().flat_map(|(k, pair)| {
            [pair.left, pair.right].map(|member| (n_equations + k, member.variable))
        });
        Directional {
            of_rates: Vec::new(),
            at: Evaluator::new(1 + n + 2 * n_z + system.n_numbers(), tapes),
            matrix: Blocks::new(n_z, entries.chain(members)),
            rhs: vec![0.0; n_z],
            residual: vec![0.0; n_equations],
            held: vec![0.0; system.pairs.len()],
            n,
        }
    }

    /// Takes the numbers that hold from here on.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        self.at.set_numbers(numbers);
    }

    /// The active sets that go on from the present point, where the system is at z with the set `zeros`.
    /// `bands` are the values of each pair's continuous member below which it is zero; rates are zero
    /// next to `least` in any case.
    pub fn choices(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        z: &[f64],
        bands: &[f64],
        least: f64,
    ) -> Found {
        let open = open_pairs(system, z, bands);
        let each = |directional: &mut Self| directional.each(system, zeros, z, &open, bands);
        let (found, scale, complete) = if open.len() <= MAX_OPEN {
            (self.all(system, zeros, z, &open), 0.0, true)
        } else if let Some((found, scale)) = each(self) {
            (found, scale, true)
        } else {
            let (found, scale) = self.one(system, zeros, z, &open);
            (found, scale, false)
        };
        let has_several = found.len() > 1;
        let mut sizes = vec![0.0_f64; if has_several { self.n } else { 0 }];
        for (_, u) in comparable(system, &found).filter(|_| has_several) {
            for (size, rate) in sizes.iter_mut().zip(self.rates(system, u)) {
                *size = size.max(rate.abs());
            }
        }
        let mut choices = self.choices_of(system, found, z, bands, scale.max(least));
        if choices.is_empty() && !complete {
            let next = self.pivot(system, zeros, z, &open);
            choices = self.choices_of(system, next, z, bands, scale.max(least));
        }
        Found {
            choices,
            complete,
            open,
            sizes,
        }
    }

    /// Those of some active sets that the first derivatives do not contradict; rates are zero next to `least` in any case.
    fn choices_of(
        &mut self,
        system: &ComplementaritySystem,
        found: Vec<Solved>,
        z: &[f64],
        bands: &[f64],
        least: f64,
    ) -> Vec<Choice> {
        let rate_scale = rate_scale(system, &found).max(least);
        let choices = found.into_iter();
        let choices =
            choices.filter_map(|solved| self.choice_of(system, solved, z, bands, rate_scale));
        choices.collect()
    }

    /// The set next to the present one: weights that have come to zero stay there, as in a step of a simplex method.
    /// Where a face of solutions ends, its middle is this corner, in which smoothed pairs do not tell what is zero.
    fn pivot(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        z: &[f64],
        open: &[usize],
    ) -> Vec<Solved> {
        let mut next = zeros.to_vec();
        for &pair in open {
            let (_, member) = system.pairs[pair].split(zeros[pair]);
            if !system.is_continuous(member.variable) && member.value(z) <= TIE {
                next[pair] = zeros[pair].other();
            }
        }
        let first = start(system, z, &[], [0.5, 0.5]);
        let u = self.solve(system, &next, first);
        u.into_iter().map(|u| (next.clone(), u)).collect()
    }

    /// Moves to a point.
    pub fn set(&mut self, t: f64, x: &[f64], z: &[f64]) {
        self.at.set(t, x.iter().chain(z).copied());
    }

    /// The choice of one active set at the point of the last [`Directional::choices`], with u from a
    /// guess; none where the first derivatives contradict it. Rates are zero next to `rate_scale`.
    pub fn choice(
        &mut self,
        system: &ComplementaritySystem,
        (zeros, u): Solved,
        z: &[f64],
        bands: &[f64],
        rate_scale: f64,
    ) -> Option<Choice> {
        let u = self.solve(system, &zeros, u)?;
        self.choice_of(system, (zeros, u), z, bands, rate_scale)
    }

    fn choice_of(
        &mut self,
        system: &ComplementaritySystem,
        (zeros, u): Solved,
        z: &[f64],
        bands: &[f64],
        rate_scale: f64,
    ) -> Option<Choice> {
        let starts = (0..zeros.len())
            .map(|pair| starts(system, (&zeros, &u), z, bands, rate_scale, pair))
            .collect::<Option<Vec<Start>>>()?;
        let strict = !starts.contains(&Start::Tangent);
        let rates = self.rates(system, &u);
        Some(Choice {
            zeros,
            u,
            rates,
            starts,
            strict,
            rate_scale,
        })
    }

    /// The solutions for all choices of the open pairs.
    pub(crate) fn all(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        z: &[f64],
        open: &[usize],
    ) -> Vec<Solved> {
        let is_affine = system.full.is_affine;
        let mut found: Vec<Solved> = Vec::new();
        let mut tried = zeros.to_vec();
        for mask in 0..1_usize << open.len() {
            for (bit, &pair) in open.iter().enumerate() {
                tried[pair] = if mask >> bit & 1 == 1 {
                    Zero::Left
                } else {
                    Zero::Right
                };
            }
            if !is_affine && contradicts(system, &tried, open) {
                continue;
            }
            let guesses = guesses(&system.full);
            let starts = guesses.map(|guess| start(system, z, open, guess));
            for mut u in from_directions(system, &tried, open, starts.collect()) {
                let solved = match is_affine && mask > 0 {
                    // Only the rows of the pairs differ from those of the first choice.
                    true => self.choose(system, &tried, &mut u).map(|_| u),
                    false => self.solve(system, &tried, u),
                };
                let Some(u) = solved else { continue };
                let known = |(zeros, other): &Solved| *zeros == tried && is_near(other, &u);
                if !found.iter().any(known) {
                    found.push((tried.clone(), u));
                }
            }
        }
        found
    }

    /// One solution, where there are too many choices to try them all; where it is a face, corners of that, and the size
    /// of the terms that cancel in all of its rates.
    pub(crate) fn one(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        z: &[f64],
        open: &[usize],
    ) -> (Vec<Solved>, f64) {
        let first = start(system, z, open, [0.5, 0.5]);
        let Some(u) = self.smooth(system, zeros, open, first) else {
            return (Vec::new(), 0.0);
        };
        let before = zeros;
        let mut zeros = zeros.to_vec();
        for &pair in open {
            let (a, b) = members(system, pair, &u);
            zeros[pair] = if a <= b { Zero::Left } else { Zero::Right };
        }
        if let Some(u) = self.solve(system, &zeros, u.clone()) {
            return (vec![(zeros, u)], 0.0);
        }
        let found = self.corners(system, (zeros, u), open, before);
        let terms = found.iter().map(|(_, u)| self.terms(system, u));
        let scale = terms.fold(0.0, f64::max);
        (found, scale)
    }

    /// The largest sum of terms that what jumps adds to the rate of what is continuous: next to these a rate is zero
    /// where they cancel.
    fn terms(&mut self, system: &ComplementaritySystem, u: &[f64]) -> f64 {
        self.linearize(system, u);
        let first = 1 + self.n + u.len();
        let n_rows = self.residual.len();
        let (mut terms, mut slopes) = (vec![0.0; n_rows], vec![0.0_f64; n_rows]);
        for &(row, input) in &system.full.directional_slopes.entries {
            let i = input - first;
            let slope = self.matrix.entry(row, i).abs();
            match system.is_continuous(i) {
                true => slopes[row] = slopes[row].max(slope),
                false => terms[row] += slope * u[i].abs(),
            }
        }
        let rows = terms.iter().zip(&slopes).filter(|(_, slope)| **slope > 0.0);
        rows.fold(0.0, |most, (terms, slope)| most.max(terms / slope))
    }

    /// f where the problem was solved.
    fn rates(&mut self, system: &ComplementaritySystem, u: &[f64]) -> Vec<f64> {
        let n_z = u.len();
        self.at.inputs[1 + self.n + n_z..][..n_z].copy_from_slice(u);
        self.at.eval(&system.full.rates).collect()
    }

    /// u with these members zero, from a guess; none where the equations contradict that or do not
    /// determine u.
    pub(crate) fn solve(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        mut u: Vec<f64>,
    ) -> Option<Vec<f64>> {
        let newton = Newton {
            most: MAX_NEWTON,
            converged: match system.full.is_affine {
                true => f64::INFINITY,
                false => CONVERGED,
            },
            rounding: 0.0,
        };
        let found = newton.iterate(|| {
            self.linearize(system, &u);
            self.choose(system, zeros, &mut u).ok_or(())
        });
        (found == Ok(true)).then_some(u)
    }

    /// Newton's step from u, where the problem was linearized, with these members zero. Returns its
    /// size.
    fn choose(
        &mut self,
        system: &ComplementaritySystem,
        zeros: &[Zero],
        u: &mut [f64],
    ) -> Option<f64> {
        let n_equations = self.residual.len();
        self.rhs[..n_equations].copy_from_slice(&self.residual);
        for (row, &zero) in zeros.iter().enumerate() {
            let (member, _) = system.pairs[row].split(zero);
            let (left, right) = members(system, row, u);
            let at = n_equations + row;
            self.rhs[at] = self.held[row] - if zero == Zero::Left { left } else { right };
            self.matrix.clear_row(at);
            *self.matrix.entry(at, member.variable) = member.slope();
        }
        self.step(u, 1.0)
    }

    /// The rows of g, negated, where it was linearized last, those of rates in units of `size`.
    pub(crate) fn residuals(&self, size: f64) -> impl Iterator<Item = f64> {
        let rows = self.rhs.iter().zip(&self.of_rates);
        rows.map(move |(row, of_rates)| if *of_rates { row / size } else { *row })
    }

    /// The largest of the rows of g about rates, where it was linearized last.
    pub(crate) fn largest_rate(&self) -> f64 {
        let rates = self.rhs.iter().zip(&self.of_rates);
        let rates = rates.filter(|(_, of_rates)| **of_rates);
        rates.fold(0.0, |most: f64, (row, _)| most.max(row.abs()))
    }

    /// The directional form of g at u into `residual` and the first rows of `rhs`, with its negative
    /// sign, and of `matrix`; the rows of the pairs stay empty.
    pub(crate) fn linearize(&mut self, system: &ComplementaritySystem, u: &[f64]) {
        let (full, n_z) = (&system.full, u.len());
        let first = 1 + self.n + n_z;
        self.at.inputs[first..][..n_z].copy_from_slice(u);
        let values = self.at.eval(&full.directional);
        for (residual, value) in self.residual.iter_mut().zip(values) {
            *residual = -value;
        }
        self.rhs[..self.residual.len()].copy_from_slice(&self.residual);
        self.matrix.clear();
        let slopes = self.at.eval(&full.directional_slopes.tape);
        for (&(row, input), slope) in full.directional_slopes.entries.iter().zip(slopes) {
            *self.matrix.entry(row, input - first) = slope;
        }
    }

    /// Solves the linear equations and moves u by that share of the step. Returns its size.
    pub(crate) fn step(&mut self, u: &mut [f64], share: f64) -> Option<f64> {
        self.matrix.solve(&mut self.rhs).ok()?;
        let mut largest = 0.0_f64;
        for (u, step) in u.iter_mut().zip(&self.rhs) {
            *u += share * step;
            largest = largest.max(step.abs() / (1.0 + u.abs()));
        }
        u.iter().all(|u| u.is_finite()).then_some(largest)
    }
}

/// Where Newton's method starts: what is open stands at `guess`, every other pair at the second.
pub(crate) fn start(
    system: &ComplementaritySystem,
    z: &[f64],
    open: &[usize],
    guess: [f64; 2],
) -> Vec<f64> {
    let mut u: Vec<f64> = (0..z.len())
        .map(|i| if system.is_continuous(i) { 0.0 } else { z[i] })
        .collect();
    for (at, &pair) in open.iter().enumerate() {
        let pair = &system.pairs[pair];
        for member in [pair.left, pair.right] {
            if !system.is_continuous(member.variable) {
                u[member.variable] = guess[at % 2];
            }
        }
    }
    u
}

/// The members of a pair in the directional form: a value, or the rate of what is continuous.
pub(crate) fn members(system: &ComplementaritySystem, pair: usize, u: &[f64]) -> (f64, f64) {
    let value = |member: Member| match system.is_continuous(member.variable) {
        true => member.slope() * u[member.variable],
        false => member.value(u),
    };
    let pair = &system.pairs[pair];
    (value(pair.left), value(pair.right))
}

/// How the member of a pair that is not zero starts; none where it is negative or becomes so.
pub(crate) fn starts(
    system: &ComplementaritySystem,
    (zeros, u): (&[Zero], &[f64]),
    z: &[f64],
    bands: &[f64],
    rate_scale: f64,
    pair: usize,
) -> Option<Start> {
    let (_, member) = system.pairs[pair].split(zeros[pair]);
    if system.is_continuous(member.variable) {
        match member.slope() * u[member.variable] / rate_scale {
            _ if member.value(z) > bands[pair] => Some(Start::Inside),
            rate if rate > TIE => Some(Start::Rising),
            rate if rate >= -TIE => Some(Start::Tangent),
            _ => None,
        }
    } else {
        match member.value(u) {
            value if value > TIE => Some(Start::Inside),
            value if value >= -TIE => Some(Start::Tangent),
            _ => None,
        }
    }
}

/// Where Newton's method starts, for every other pair: a system that is not affine may have several
/// solutions.
fn guesses(full: &Full) -> impl Iterator<Item = [f64; 2]> {
    const GUESSES: [[f64; 2]; 3] = [[0.5, 0.5], [0.2, 0.8], [0.8, 0.2]];
    let wanted = if full.is_affine { 1 } else { GUESSES.len() };
    GUESSES.into_iter().take(wanted)
}

/// Whether a variable would have two values.
fn contradicts(system: &ComplementaritySystem, zeros: &[Zero], open: &[usize]) -> bool {
    let zero = |pair: &usize| system.pairs[*pair].split(zeros[*pair]).0;
    let mut members = open.iter().map(zero).enumerate();
    members.any(|(at, member)| {
        let mut before = open[..at].iter().map(zero);
        before.any(|other| other.variable == member.variable && other != member)
    })
}

/// The same starts in directions all around for each slip velocity with two entries that sets off, and in the middle of
/// its disc where it rests.
fn from_directions(
    system: &ComplementaritySystem,
    zeros: &[Zero],
    open: &[usize],
    starts: Vec<Vec<f64>>,
) -> Vec<Vec<f64>> {
    let discs = system.discs.iter();
    let discs = discs.filter(|disc| open.contains(&disc.pair));
    discs.enumerate().fold(starts, |starts, (k, disc)| {
        let turned = |at: usize| TAU * at as f64 / DIRECTIONS as f64;
        let points: Vec<[f64; 2]> = match zeros[disc.pair] {
            Zero::Left => vec![[0.5, 0.5]],
            // All combinations of two, and one direction for all others.
            Zero::Right if k >= 2 => vec![[1.0, 0.5]],
            Zero::Right => (0..DIRECTIONS)
                .map(|at| [turned(at).cos(), turned(at).sin()].map(|u| 0.5 + 0.5 * u))
                .collect(),
        };
        let moved = |start: &Vec<f64>| {
            let start = start.clone();
            let point = move |point: &[f64; 2]| {
                let mut start = start.clone();
                for (&alpha, value) in disc.alphas.iter().zip(point) {
                    start[alpha] = *value;
                }
                start
            };
            points.iter().map(point).collect::<Vec<_>>()
        };
        starts.iter().flat_map(moved).collect()
    })
}

/// The switches that some pairs are about, in order.
pub(crate) fn switches_of(system: &ComplementaritySystem, pairs: &[usize]) -> Vec<usize> {
    let switches = pairs.iter().flat_map(|&pair| &system.switches_of[pair]);
    let mut switches: Vec<usize> = switches.copied().collect();
    switches.sort_unstable();
    switches.dedup();
    switches
}

pub(crate) fn is_near(a: &[f64], b: &[f64]) -> bool {
    let difference = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-8 * (1.0 + a.abs());
    a.iter().zip(b).all(difference)
}

/// True when two choices have the same rates: they are one solution, as far as first derivatives say.
/// Rates below those that are zero next to `least`, or to the size that rates of their state have, are the same.
pub(crate) fn agree(a: &Choice, b: &Choice, least: f64, sizes: &[f64]) -> bool {
    let rates = a.rates.iter().chain(&b.rates);
    let largest = rates.fold(least, |s, r| s.max(r.abs()));
    let rates = a.rates.iter().zip(&b.rates).zip(sizes);
    let is_near = |((a, b), size): ((&f64, &f64), &f64)| (a - b).abs() <= TIE * size.max(largest);
    rates.into_iter().all(is_near)
}

/// Pairs whose continuous member is zero, of the groups in which such a pair could be on another
/// branch: its other member is not at the end of its range.
fn open_pairs(system: &ComplementaritySystem, z: &[f64], bands: &[f64]) -> Vec<usize> {
    let pairs = &system.pairs;
    let vanishes = |&at: &usize| {
        let members = [pairs[at].left, pairs[at].right].into_iter();
        // Where both are continuous, the pair meets where both are zero.
        let continuous = members.filter(|member| system.is_continuous(member.variable));
        let mut values = continuous.map(|member| member.value(z)).peekable();
        values.peek().is_some() && values.all(|value| value <= bands[at])
    };
    let undecided = |at: &usize| {
        let members = [pairs[*at].left, pairs[*at].right].into_iter();
        let mut jumping = members.filter(|member| !system.is_continuous(member.variable));
        // In the middle of its disc u may still leave it at once.
        let of_disc = system.discs.iter().any(|disc| disc.pair == *at);
        !pairs[*at].is_bounded || of_disc || jumping.any(|member| member.value(z) < 1.0 - TIE)
    };
    let vanishing: Vec<usize> = (0..pairs.len()).filter(vanishes).collect();
    let mut groups: Vec<usize> = (vanishing.iter().copied())
        .filter(undecided)
        .map(|at| pairs[at].group)
        .collect();
    groups.sort_unstable();
    groups.dedup();
    let is_open = |at: &usize| groups.binary_search(&pairs[*at].group).is_ok();
    vanishing.into_iter().filter(is_open).collect()
}
