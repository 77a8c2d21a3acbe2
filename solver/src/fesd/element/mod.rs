//! One finite element in one active set.
//!
//! With X_m = x₀ + h Σ_j a_mj V_j, Newton's method solves at all nodes
//!
//! V_m = f(t_m, X_m, w_m),   0 = r(t_m, X_m, w_m)
//!
//! for V and w, and where the element ends on a boundary of the active set, for h too, with the
//! member that vanishes there as one more equation.

pub(crate) mod banded;
pub(crate) mod blocks;
pub(crate) mod collocation;
pub(crate) mod invariants;
pub(crate) mod nodes;
pub(crate) mod projection;
pub(crate) mod rounding;
pub(crate) mod scheme;
pub(crate) mod solved;

use std::iter::Sum;
use std::ops::{Add, Sub};
use std::sync::Arc;

use wide::f64x4;

use super::system::Reduced;
use crate::fesd::element::invariants::Keeper;
use crate::fesd::element::projection::Projection;
use crate::fesd::element::rounding::Rounding;
use crate::fesd::element::scheme::{Scheme, WIDTH};
use crate::fesd::system::hidden::{Hidden, Unsolved};
use crate::linalg::DenseLu;
use crate::linalg::newton::Newton;

/// A slip velocity that sets off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Departure {
    /// The place of s.
    pub slip: usize,
    /// s, and its rate.
    pub speed: f64,
    pub rate: f64,
}

/// What elements have taken.
#[derive(Clone, Copy, Default)]
pub(crate) struct Work {
    pub iterations: usize,
    pub factorizations: usize,
    pub evaluations: usize,
}

impl Add for Work {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Work {
            iterations: self.iterations + other.iterations,
            factorizations: self.factorizations + other.factorizations,
            evaluations: self.evaluations + other.evaluations,
        }
    }
}

impl Sub for Work {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Work {
            iterations: self.iterations - other.iterations,
            factorizations: self.factorizations - other.factorizations,
            evaluations: self.evaluations - other.evaluations,
        }
    }
}

impl Sum for Work {
    fn sum<I: Iterator<Item = Self>>(works: I) -> Self {
        works.fold(Work::default(), Add::add)
    }
}

/// Newton's method for an element, and its iterations before a fresh Jacobian.
const NEWTON: Newton = Newton {
    most: 25,
    converged: 4.0 * f64::EPSILON,
    rounding: 1e-11,
};
const MAX_CHORDS: usize = 6;

/// Relative change of h up to which a factorization is tried again, and up to which it serves while h
/// is sought.
const REUSE: f64 = 0.2;
const CLOSE: f64 = 0.01;

/// Contraction above which a factorization is given up.
const SLOW: f64 = 0.1;

/// An element and the memory to solve it.
pub(crate) struct Element {
    pub(crate) n: usize,
    pub reduced: Arc<Reduced>,
    /// Start and length.
    pub t: f64,
    pub h: f64,
    /// x₀.
    pub x0: Vec<f64>,
    /// V and w of every node, one after the other.
    pub unknowns: Vec<f64>,
    /// Σ b_j V_j, and what the projection of the end adds to it.
    pub mean: Vec<f64>,
    projection: Option<Projection>,
    keeper: Option<Keeper>,
    /// The end.
    end: Vec<f64>,
    /// What changes at breakpoints.
    pub(crate) numbers: Vec<f64>,
    /// Size of the terms of each rate where it was last differentiated: times ε, its rounding error.
    pub activity: Vec<f64>,
    /// The same by the states alone that do not rest, while it is measured.
    pub(crate) resting: Vec<f64>,
    pub(crate) rounding: Rounding,
    /// X at the nodes, in lanes: state i at `i * groups`.
    pub(crate) x: Vec<f64x4>,
    pub(crate) registers: Vec<f64x4>,
    pub(crate) slopes: Vec<f64x4>,
    pub(crate) matrix: Vec<f64>,
    pub(crate) lu: Option<DenseLu>,
    /// The places of unknowns and equations in the matrix; none where they stand in their order.
    pub(crate) places: Option<Vec<usize>>,
    permuted: Vec<f64>,
    /// The h that is factored, zero where nothing is.
    pub(crate) factored: f64,
    /// Contraction of the last iterations with this factorization.
    contraction: f64,
    pub(crate) rhs: Vec<f64>,
    by_x: Vec<f64>,
    pub(crate) by_length: Vec<f64>,
    /// The states that equations determine, and what all states are at least in the terms of rates: the sizes of these.
    algebraic: Vec<usize>,
    pub(crate) sizes: Vec<f64>,
    /// The state whose rate each w is, where that is an algebraic state.
    follows: Vec<Option<usize>>,
    pub work: Work,
}

impl Element {
    /// Memory for elements of an active set.
    pub fn new(scheme: &Scheme, n: usize, n_numbers: usize, reduced: Arc<Reduced>) -> Self {
        let per_node = n + reduced.unknowns.len();
        let size = scheme.s * per_node;
        let zero = f64x4::splat(0.0);
        let entries = reduced.slopes.entries.iter();
        let entries = entries.filter(|(_, input)| *input > 0);
        let entries = entries.map(|&(row, input)| (row, input - 1));
        let places = banded::places(scheme.s, per_node, entries);
        let registers = [&reduced.equations, &reduced.slopes.tape, &reduced.members];
        let registers = registers.map(|tape| tape.n_registers().max(tape.n_inputs()));
        Element {
            n,
            t: 0.0,
            h: 0.0,
            x0: vec![0.0; n],
            unknowns: vec![0.0; size],
            mean: vec![0.0; n],
            projection: Projection::new(scheme, n, &reduced),
            keeper: reduced.kept.as_ref().map(|kept| Keeper::new(n, kept)),
            end: vec![0.0; n],
            numbers: vec![0.0; n_numbers],
            activity: vec![0.0; n],
            resting: vec![0.0; n],
            rounding: Rounding::new(n),
            x: vec![zero; n * scheme.groups],
            registers: vec![zero; registers.into_iter().max().unwrap_or(0)],
            slopes: vec![zero; reduced.slopes.entries.len() * scheme.groups],
            matrix: vec![0.0; size * size],
            lu: None,
            permuted: vec![0.0; if places.is_some() { size } else { 0 }],
            places,
            factored: 0.0,
            contraction: 1.0,
            rhs: vec![0.0; size],
            by_x: vec![0.0; n],
            by_length: vec![0.0; size],
            algebraic: Vec::new(),
            sizes: vec![0.0; n],
            follows: vec![None; reduced.unknowns.len()],
            work: Work::default(),
            reduced,
        }
    }

    /// Takes the numbers that hold from here on; what is factored may depend on them.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        if self.numbers != numbers {
            self.numbers.copy_from_slice(numbers);
            self.factored = 0.0;
        }
    }

    /// Says which states are algebraic. The rate of one is a w of its own, and known as far as the state is.
    pub fn follow(&mut self, algebraic: &[usize]) {
        let n = self.n;
        self.algebraic = algebraic.to_vec();
        for &state in algebraic {
            let entries = self.reduced.slopes.entries.iter();
            let mut inputs = entries
                .filter(|(row, _)| *row == state)
                .map(|entry| entry.1);
            if let (Some(input), None) = (inputs.next(), inputs.next())
                && input > n
            {
                self.follows[input - 1 - n] = Some(state);
            }
        }
    }

    /// Unknowns per node: V, then w.
    pub fn per_node(&self) -> usize {
        self.n + self.reduced.unknowns.len()
    }

    /// Length of x.
    pub fn n_states(&self) -> usize {
        self.n
    }

    /// State i at a point of the scheme.
    pub fn state_at(&self, scheme: &Scheme, point: usize, i: usize) -> f64 {
        match scheme.nodes_at[point] {
            Some(node) => self.x[i * scheme.groups + node / WIDTH].as_array()[node % WIDTH],
            None if point == 0 => self.x0[i],
            None => self.x0[i] + self.h * self.mean[i],
        }
    }

    /// w of a node.
    pub fn w(&self, node: usize) -> &[f64] {
        let per_node = self.per_node();
        &self.unknowns[node * per_node + self.n..(node + 1) * per_node]
    }

    /// Takes constant rates as the first guess.
    pub fn guess(&mut self, rates: &[f64], w: &[f64]) {
        let per_node = self.per_node();
        for node in self.unknowns.chunks_exact_mut(per_node) {
            node[..self.n].copy_from_slice(rates);
            node[self.n..].copy_from_slice(w);
        }
    }

    /// The same for slip velocities that have set off, which grow, in an element of the length h.
    pub fn set_off(&mut self, scheme: &Scheme, departures: &[Departure], h: f64) {
        let per_node = self.per_node();
        for departure in departures {
            let mut unknowns = self.reduced.unknowns.iter();
            let Some(k) = unknowns.position(|&z| z == departure.slip) else {
                continue;
            };
            for (m, c) in scheme.tableau.nodes.iter().enumerate() {
                let speed = departure.speed + c * h * departure.rate;
                self.unknowns[m * per_node + self.n + k] = speed;
            }
            // What is factored is that of another direction.
            self.factored = 0.0;
        }
    }

    /// Takes the polynomials of an element of the same active set as the guess of one that starts
    /// `shift` behind its start and is `ratio` times as long, both in units of its length.
    pub fn extrapolate(&mut self, scheme: &Scheme, shift: f64, ratio: f64) {
        if self.reduced.is_linear && self.factored > 0.0 && shift > 0.0 {
            // One iteration solves linear equations from anywhere.
            return;
        }
        let per_node = self.per_node();
        let (s, unknowns) = (scheme.s, &self.unknowns);
        let coefficients = &mut self.rhs[..s];
        let values = &mut self.by_length;
        for i in 0..per_node {
            scheme.series(|j| unknowns[j * per_node + i], coefficients);
            for (m, c) in scheme.tableau.nodes.iter().enumerate() {
                let sigma = shift + ratio * c;
                let value = coefficients.iter().rev().fold(0.0, |v, c| v * sigma + c);
                values[m * per_node + i] = value;
            }
        }
        std::mem::swap(&mut self.unknowns, &mut self.by_length);
    }

    /// Takes the first part of the present element as the guess of a shorter one.
    pub fn shorten(&mut self, scheme: &Scheme, sigma: f64) {
        self.extrapolate(scheme, 0.0, sigma);
        self.h *= sigma;
    }

    /// Takes the unknowns of an element of the same active set as a guess.
    pub fn restore(&mut self, unknowns: &[f64]) {
        self.unknowns.copy_from_slice(unknowns);
    }

    /// Solves for an element of the length h.
    pub fn solve(
        &mut self,
        scheme: &Scheme,
        t: f64,
        h: f64,
        x0: &[f64],
        scale: &[f64],
    ) -> Result<(), Unsolved> {
        (self.t, self.h) = (t, h);
        self.x0.copy_from_slice(x0);
        for &i in &self.algebraic {
            self.sizes[i] = scale[i];
        }
        if let (Some(keeper), Some(kept)) = (&mut self.keeper, &self.reduced.kept) {
            keeper.start(kept, t, x0, scale, &self.numbers);
        }
        let mut fresh = self.prepare(scheme, h)?;
        let (mut last, mut chords) = (f64::INFINITY, 0);
        for _ in 0..NEWTON.most {
            self.residual(scheme);
            self.substitute(|element| &mut element.rhs)?;
            let change = self.advance(scale);
            self.work.iterations += 1;
            if !change.is_finite() {
                return Err(Unsolved::Diverged);
            }
            let rate = self.contraction;
            if change <= NEWTON.converged
                || (rate < SLOW && rate / (1.0 - rate) * change <= NEWTON.converged)
            {
                self.finish(scheme);
                return Ok(());
            }
            if last.is_finite() {
                let rate = change / last;
                if rate >= 0.5 && change <= NEWTON.rounding {
                    self.finish(scheme);
                    return Ok(());
                }
                self.contraction = rate;
                chords += 1;
                if rate > SLOW || chords > MAX_CHORDS {
                    if fresh && rate > 2.0 && chords > MAX_CHORDS {
                        return Err(Unsolved::Diverged);
                    }
                    self.factor(scheme, h)?;
                    (fresh, chords) = (true, 0);
                }
            }
            last = change;
        }
        Err(Unsolved::Diverged)
    }

    /// Solves for an element that ends where a watched member vanishes, from the present one as a
    /// guess. Values of the member below `zero` are zero where it does not cross. Returns the length.
    pub fn solve_to(
        &mut self,
        scheme: &Scheme,
        hidden: &mut Hidden,
        (member, zero): (usize, f64),
        scale: &[f64],
    ) -> Result<f64, Unsolved> {
        let longest = self.h;
        let (mut last, mut last_step, mut is_slow) = (f64::INFINITY, f64::INFINITY, true);
        for _ in 0..NEWTON.most {
            self.finish(scheme);
            if is_slow || (self.factored - self.h).abs() > CLOSE * self.h {
                self.factor(scheme, self.h)?;
            }
            self.residual(scheme);
            self.slope_by_length(scheme);
            self.substitute(|element| &mut element.rhs)?;
            self.substitute(|element| &mut element.by_length)?;
            // G + ∂G/∂y Δy + ∂G/∂h Δh = 0 with Δy = rhs + by_length Δh.
            let w = (scheme.s - 1) * self.per_node() + self.n;
            let x = self.x0.iter().zip(&self.mean);
            let x = x.map(|(x0, mean)| x0 + self.h * mean);
            hidden.set(self.t + self.h, x, &self.unknowns[w..]);
            hidden.solve(&self.reduced)?;
            let (value, rate) = hidden.member(&self.reduced, member, &mut self.by_x)?;
            let watched = self.reduced.watched.get(member);
            let end = watched
                .filter(|watched| watched.stops)
                .map_or(0.0, |_| zero);
            let value = value - end;
            // dx = mean dh + h Σ b_j dV_j at the end.
            let by_mean = self.by_x.iter().zip(&self.mean).map(|(g, mean)| g * mean);
            let rate = rate + by_mean.sum::<f64>();
            let along = |direction: &[f64]| {
                let per_node = self.per_node();
                let terms = scheme.tableau.weights.iter().enumerate();
                let terms = terms.map(|(j, b)| {
                    let node = &direction[j * per_node..][..self.n];
                    let by_x = self.by_x.iter().zip(node).map(|(g, v)| g * v);
                    b * by_x.sum::<f64>()
                });
                self.h * terms.sum::<f64>()
            };
            let by_h = rate + along(&self.by_length);
            let value = value + along(&self.rhs);
            let step = -value / by_h;
            // Towards a root of higher order Newton's method slows down, and rounding ends it anywhere.
            let converges = step.abs() < 0.4 * last_step;
            let is_multiple = value.abs() <= zero && !converges;
            if !step.is_finite() && !is_multiple {
                return Err(Unsolved::Singular);
            }
            let step = match is_multiple {
                true => 0.0,
                false => step.clamp(-0.9 * self.h, 0.5 * longest),
            };
            last_step = step.abs();
            for (y, by_length) in self.rhs.iter_mut().zip(&self.by_length) {
                *y += by_length * step;
            }
            let change = self.advance(scale).max(step.abs() / longest);
            self.h += step;
            self.work.iterations += 1;
            if !change.is_finite() {
                return Err(Unsolved::Diverged);
            }
            if NEWTON.has_converged(change, last) || (is_multiple && change <= NEWTON.rounding) {
                self.factored = 0.0;
                self.finish(scheme);
                return Ok(self.h);
            }
            is_slow = change > SLOW * last;
            last = change;
        }
        Err(Unsolved::Diverged)
    }

    /// Makes sure that there is a factorization for elements about as long as h. Returns whether it
    /// is new.
    fn prepare(&mut self, scheme: &Scheme, h: f64) -> Result<bool, Unsolved> {
        let distance = (self.factored - h).abs();
        let usable = distance <= REUSE * h;
        if !usable {
            self.factor(scheme, h)?;
        }
        // Of linear equations nothing but h is another. What has been seen of others in an element before says nothing
        // about this one.
        self.contraction = match (self.reduced.is_linear, usable) {
            (true, true) => distance / h,
            (true, false) => 0.0,
            (false, _) => 1.0,
        };
        Ok(!usable)
    }

    /// Overwrites a right-hand side with the solution of the factored equations.
    fn substitute(&mut self, rhs: impl Fn(&mut Self) -> &mut Vec<f64>) -> Result<(), Unsolved> {
        let mut solution = std::mem::take(rhs(self));
        let lu = self.lu.as_ref().ok_or(Unsolved::Singular)?;
        match &self.places {
            None => lu.solve(&mut solution),
            Some(places) => {
                for (value, &place) in solution.iter().zip(places) {
                    self.permuted[place] = *value;
                }
                lu.solve(&mut self.permuted);
                for (value, &place) in solution.iter_mut().zip(places) {
                    *value = self.permuted[place];
                }
            }
        }
        *rhs(self) = solution;
        Ok(())
    }

    /// Adds the solution in `rhs` to the unknowns. Returns the change relative to their size.
    fn advance(&mut self, scale: &[f64]) -> f64 {
        let (n, per_node) = (self.n, self.per_node());
        let mut largest = 0.0_f64;
        let nodes = self.unknowns.chunks_exact_mut(per_node);
        for (node, changes) in nodes.zip(self.rhs.chunks_exact(per_node)) {
            for (place, (y, change)) in node.iter_mut().zip(changes).enumerate() {
                *y += change;
                let (change, size) = match place < n {
                    true => {
                        let rate = y.abs().max(self.activity[place]);
                        (self.h * change.abs(), scale[place].max(self.h * rate))
                    }
                    false => {
                        let rounded = self.follows[place - n].map_or(0.0, |i| scale[i] / self.h);
                        (change.abs(), (1.0 + y.abs()).max(rounded))
                    }
                };
                // A state that rests counts for nothing, and NaN is not passed over.
                if change > largest * size || change.is_nan() {
                    largest = change / size.max(f64::MIN_POSITIVE);
                }
            }
        }
        largest
    }

    /// Whether the end is moved onto the surfaces, away from the polynomial.
    pub fn is_projected(&self) -> bool {
        self.projection.is_some() || self.keeper.is_some()
    }

    /// X at the nodes, and Σ b_j V_j with the projection of the end.
    fn finish(&mut self, scheme: &Scheme) {
        self.place(scheme);
        let per_node = self.per_node();
        for (i, mean) in self.mean.iter_mut().enumerate() {
            let terms = scheme.tableau.weights.iter().enumerate();
            *mean = terms
                .map(|(j, b)| b * self.unknowns[j * per_node + i])
                .sum();
        }
        if self.projection.is_none() && self.keeper.is_none() {
            return;
        }
        let ends = self.end.iter_mut().zip(&self.x0).zip(&self.mean);
        for ((end, x0), mean) in ends {
            *end = x0 + self.h * mean;
        }
        let (reduced, t) = (&self.reduced, self.t + self.h);
        if let Some(projection) = &mut self.projection {
            let w = &self.unknowns[(scheme.s - 1) * per_node + self.n..];
            projection.project(reduced, t, w, &self.numbers, &mut self.end);
        }
        if let (Some(keeper), Some(kept)) = (&mut self.keeper, &reduced.kept) {
            keeper.shift(kept, t, &mut self.end);
        }
        let shifts = self.end.iter().zip(&self.x0).zip(&mut self.mean);
        for ((end, x0), mean) in shifts {
            let shift = (end - x0) - self.h * *mean;
            *mean += shift / self.h;
        }
    }
}
