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
pub(crate) mod invariants;
pub(crate) mod jacobian;
pub(crate) mod nodes;
pub(crate) mod projection;
pub(crate) mod scheme;
pub(crate) mod solved;
pub(crate) mod stages;
pub(crate) mod terms;

use std::sync::Arc;

use super::system::Reduced;
use crate::fesd::element::invariants::Keeper;
use crate::fesd::element::jacobian::Jacobian;
use crate::fesd::element::projection::Projection;
use crate::fesd::element::scheme::Scheme;
use crate::fesd::element::stages::{Stages, by_node, by_node_mut};
use crate::fesd::element::terms::Terms;
use crate::fesd::system::hidden::{Hidden, Unsolved};
use crate::hybrid::Stats;
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
    pub reduced: Arc<Reduced>,
    pub stages: Stages,
    pub terms: Terms,
    jacobian: Jacobian,
    projection: Option<Projection>,
    keeper: Option<Keeper>,
    /// The end.
    end: Vec<f64>,
    rhs: Vec<f64>,
    by_x: Vec<f64>,
    by_length: Vec<f64>,
    /// The states that equations determine.
    algebraic: Vec<usize>,
    /// The state whose rate each w is, where that is an algebraic state.
    follows: Vec<Option<usize>>,
}

impl Element {
    /// Memory for elements of an active set.
    pub fn new(scheme: &Scheme, n: usize, n_numbers: usize, reduced: Arc<Reduced>) -> Self {
        let stages = Stages::new(scheme, n, n_numbers, &reduced);
        let size = stages.unknowns.len();
        Element {
            terms: Terms::new(n),
            jacobian: Jacobian::new(scheme, &stages, &reduced),
            projection: Projection::new(scheme, n, &reduced),
            keeper: reduced.kept.as_ref().map(|kept| Keeper::new(n, kept)),
            end: vec![0.0; n],
            rhs: vec![0.0; size],
            by_x: vec![0.0; n],
            by_length: vec![0.0; size],
            algebraic: Vec::new(),
            follows: vec![None; reduced.unknowns.len()],
            stages,
            reduced,
        }
    }

    /// Takes the numbers that hold from here on; what is factored may depend on them.
    pub fn set_numbers(&mut self, numbers: &[f64]) {
        if self.stages.numbers != numbers {
            self.stages.numbers.copy_from_slice(numbers);
            self.jacobian.factored = 0.0;
        }
    }

    /// Says which states are algebraic. The rate of one is a w of its own, and known as far as the state is.
    pub fn follow(&mut self, algebraic: &[usize]) {
        let n = self.stages.n;
        self.algebraic = algebraic.to_vec();
        for &state in algebraic {
            let entries = self.reduced.equations.slopes.entries.iter();
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

    /// Takes slip velocities that have set off, which grow, as the first guess in an element of the length h.
    pub fn set_off(&mut self, scheme: &Scheme, departures: &[Departure], h: f64) {
        let per_node = self.stages.per_node;
        for departure in departures {
            let mut unknowns = self.reduced.unknowns.iter();
            let Some(k) = unknowns.position(|&z| z == departure.slip) else {
                continue;
            };
            for (m, c) in scheme.tableau.nodes.iter().enumerate() {
                let speed = departure.speed + c * h * departure.rate;
                self.stages.unknowns[m * per_node + self.stages.n + k] = speed;
            }
            // What is factored is that of another direction.
            self.jacobian.factored = 0.0;
        }
    }

    /// Takes the polynomials of an element of the same active set as the guess of one that starts
    /// `shift` behind its start and is `ratio` times as long, both in units of its length.
    pub fn extrapolate(&mut self, scheme: &Scheme, shift: f64, ratio: f64) {
        if self.reduced.is_linear && self.jacobian.factored > 0.0 && shift > 0.0 {
            // One iteration solves linear equations from anywhere.
            return;
        }
        if self.stages.unknowns.is_empty() {
            return;
        }
        let per_node = self.stages.per_node;
        let (s, unknowns) = (scheme.s, &self.stages.unknowns);
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
        std::mem::swap(&mut self.stages.unknowns, &mut self.by_length);
    }

    /// Takes the first part of the present element as the guess of a shorter one.
    pub fn shorten(&mut self, scheme: &Scheme, sigma: f64) {
        self.extrapolate(scheme, 0.0, sigma);
        self.stages.h *= sigma;
    }

    /// Solves for an element of the length h.
    pub fn solve(
        &mut self,
        scheme: &Scheme,
        t: f64,
        h: f64,
        x0: &[f64],
        scale: &[f64],
        stats: &mut Stats,
    ) -> Result<(), Unsolved> {
        (self.stages.t, self.stages.h) = (t, h);
        self.stages.x0.copy_from_slice(x0);
        for &i in &self.algebraic {
            self.terms.sizes[i] = scale[i];
        }
        if let (Some(keeper), Some(kept)) = (&mut self.keeper, &self.reduced.kept) {
            keeper.start(kept, t, x0, scale, &self.stages.numbers);
        }
        let mut fresh = self.prepare(scheme, h, stats)?;
        let (mut last, mut chords) = (f64::INFINITY, 0);
        for _ in 0..NEWTON.most {
            stats.rhs_evaluations += scheme.s;
            self.stages.residual(scheme, &self.reduced, &mut self.rhs);
            self.jacobian.solve(&mut self.rhs)?;
            let change = self.advance(scale);
            stats.newton_iterations += 1;
            if !change.is_finite() {
                return Err(Unsolved::Diverged);
            }
            let rate = self.jacobian.contraction;
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
                self.jacobian.contraction = rate;
                chords += 1;
                if rate > SLOW || chords > MAX_CHORDS {
                    if fresh && rate > 2.0 && chords > MAX_CHORDS {
                        return Err(Unsolved::Diverged);
                    }
                    self.factor(scheme, h, stats)?;
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
        stats: &mut Stats,
    ) -> Result<f64, Unsolved> {
        let longest = self.stages.h;
        let (mut last, mut last_step, mut is_slow) = (f64::INFINITY, f64::INFINITY, true);
        for _ in 0..NEWTON.most {
            self.finish(scheme);
            if is_slow || (self.jacobian.factored - self.stages.h).abs() > CLOSE * self.stages.h {
                self.factor(scheme, self.stages.h, stats)?;
            }
            stats.rhs_evaluations += scheme.s;
            self.stages.residual(scheme, &self.reduced, &mut self.rhs);
            (self.jacobian).by_length(scheme, &self.reduced, &self.stages, &mut self.by_length);
            self.jacobian.solve(&mut self.rhs)?;
            self.jacobian.solve(&mut self.by_length)?;
            // G + ∂G/∂y Δy + ∂G/∂h Δh = 0 with Δy = rhs + by_length Δh.
            let Stages { n, per_node, h, .. } = self.stages;
            let (stages, by_x) = (&self.stages, &mut self.by_x);
            let x = stages.x0.iter().zip(&stages.mean);
            let x = x.map(|(x0, mean)| x0 + h * mean);
            hidden.set(stages.t + h, x, stages.w(scheme.s - 1));
            hidden.solve(&self.reduced)?;
            let (value, rate) = hidden.member(&self.reduced, member, by_x)?;
            let watched = self.reduced.watched.get(member);
            let end = watched
                .filter(|watched| watched.stops)
                .map_or(0.0, |_| zero);
            let value = value - end;
            // dx = mean dh + h Σ b_j dV_j at the end.
            let by_mean = by_x.iter().zip(&stages.mean).map(|(g, mean)| g * mean);
            let rate = rate + by_mean.sum::<f64>();
            let along = |direction: &[f64]| {
                let terms = scheme.tableau.weights.iter().enumerate();
                let terms = terms.map(|(j, b)| {
                    let node = &direction[j * per_node..][..n];
                    let by_x = by_x.iter().zip(node).map(|(g, v)| g * v);
                    b * by_x.sum::<f64>()
                });
                h * terms.sum::<f64>()
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
                false => step.clamp(-0.9 * h, 0.5 * longest),
            };
            last_step = step.abs();
            for (y, by_length) in self.rhs.iter_mut().zip(&self.by_length) {
                *y += by_length * step;
            }
            let change = self.advance(scale).max(step.abs() / longest);
            self.stages.h += step;
            stats.newton_iterations += 1;
            if !change.is_finite() {
                return Err(Unsolved::Diverged);
            }
            if NEWTON.has_converged(change, last) || (is_multiple && change <= NEWTON.rounding) {
                self.jacobian.factored = 0.0;
                self.finish(scheme);
                return Ok(self.stages.h);
            }
            is_slow = change > SLOW * last;
            last = change;
        }
        Err(Unsolved::Diverged)
    }

    /// Makes sure that there is a factorization for elements about as long as h. Returns whether it
    /// is new.
    fn prepare(&mut self, scheme: &Scheme, h: f64, stats: &mut Stats) -> Result<bool, Unsolved> {
        let distance = (self.jacobian.factored - h).abs();
        let usable = distance <= REUSE * h;
        if !usable {
            self.factor(scheme, h, stats)?;
        }
        // Of linear equations nothing but h is another. What has been seen of others in an element before says nothing
        // about this one.
        self.jacobian.contraction = match (self.reduced.is_linear, usable) {
            (true, true) => distance / h,
            (true, false) => 0.0,
            (false, _) => 1.0,
        };
        Ok(!usable)
    }

    /// Factors the Jacobian at the present unknowns, for elements of length h.
    fn factor(&mut self, scheme: &Scheme, h: f64, stats: &mut Stats) -> Result<(), Unsolved> {
        let Element {
            reduced,
            stages,
            terms,
            jacobian,
            ..
        } = self;
        jacobian.differentiate(scheme, reduced, stages);
        terms.measure(scheme, reduced, stages, jacobian);
        stats.factorizations += 1;
        jacobian.factor(scheme, reduced, stages, h)
    }

    /// Adds the solution in `rhs` to the unknowns. Returns the change relative to their size.
    fn advance(&mut self, scale: &[f64]) -> f64 {
        let Stages { n, per_node, h, .. } = self.stages;
        let mut largest = 0.0_f64;
        let nodes = by_node_mut(&mut self.stages.unknowns, per_node);
        for (node, changes) in nodes.zip(by_node(&self.rhs, per_node)) {
            for (place, (y, change)) in node.iter_mut().zip(changes).enumerate() {
                *y += change;
                let (change, size) = match place < n {
                    true => {
                        let rate = y.abs().max(self.terms.activity[place]);
                        (h * change.abs(), scale[place].max(h * rate))
                    }
                    false => {
                        let rounded = self.follows[place - n].map_or(0.0, |i| scale[i] / h);
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
        self.stages.place(scheme);
        self.stages.average(scheme);
        if !self.is_projected() {
            return;
        }
        let (reduced, h, t) = (&self.reduced, self.stages.h, self.stages.t + self.stages.h);
        let Stages { x0, mean, .. } = &self.stages;
        for ((end, x0), mean) in self.end.iter_mut().zip(x0).zip(mean) {
            *end = x0 + h * mean;
        }
        if let Some(projection) = &mut self.projection {
            let (w, numbers) = (self.stages.w(scheme.s - 1), &self.stages.numbers);
            projection.project(reduced, t, w, numbers, &mut self.end);
        }
        if let (Some(keeper), Some(kept)) = (&mut self.keeper, &reduced.kept) {
            keeper.shift(kept, t, &mut self.end);
        }
        let Stages { x0, mean, .. } = &mut self.stages;
        for ((end, x0), mean) in self.end.iter().zip(x0).zip(mean) {
            let shift = (end - *x0) - h * *mean;
            *mean += shift / h;
        }
    }
}
