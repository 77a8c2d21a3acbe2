//! Sliding folds: where the branch of sliding modes that a nonlinear switch follows turns back.
//!
//! S = ∂φ/∂α vanishes there, and α(t) = α_f - c √(t_f - t) + .. has an infinite slope. Steps of the Taylor method
//! become shorter in proportion to what is left, and the last one goes to the fold itself: with a₁ and a₂ the first
//! coefficients of α,
//!
//! t_f - t ≈ a₁ / (4 a₂),   α_f - α ≈ 2 a₁ (t_f - t),
//!
//! from which Newton's method solves φ(t_f, x_f, α_f) = S(t_f, x_f, α_f) = 0. The state moves there by
//! (t_f - t) f at the mean of α, which is α + (α_f - α)/3; what this neglects is of order (α_f - α)⁴.

use super::mode::Mode;
use super::state::State;

/// Steps end at the fold once α is this close to it.
const CLOSE: f64 = 3e-5;

/// Newton iterations.
const MAX_ITERATIONS: usize = 30;

/// Roundings of its terms that φ may be wrong by.
const ROUNDINGS: f64 = 4.0;

/// A change of α over which S is compared.
const APART: f64 = 1e-5;

/// Where a branch ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fold {
    pub switch: usize,
    /// How long after the start of the step.
    pub after: f64,
    pub alpha: f64,
    /// Where the dummy system goes from there: the sign of ∂²φ/∂α².
    pub direction: f64,
}

impl Mode {
    /// The fold that a nonlinear switch is about to reach, with the state there in `state.next`.
    pub(super) fn fold_ahead(&mut self, state: &mut State, remaining: f64) -> Option<Fold> {
        for at in 0..self.sliding.len() {
            let i = self.sliding[at];
            if !self.nonlinear[i] {
                continue;
            }
            let a = self.alpha_series(i);
            let left = a[1] / (4.0 * a[2]);
            let moves = 2.0 * a[1] * left;
            let is_close = moves.abs() <= CLOSE && left > 0.0 && left < remaining;
            if !is_close || !(0.0..=1.0).contains(&(a[0] + moves)) {
                continue;
            }
            let fold = self.fold_of(state, i, left, moves);
            if fold.is_some() {
                return fold;
            }
        }
        None
    }

    fn fold_of(&mut self, state: &mut State, i: usize, left: f64, moves: f64) -> Option<Fold> {
        let start = state.alpha[i];
        // ∂²φ/∂α², where the step starts.
        self.set(state.t, &state.x, &state.alpha);
        let curvature = self.curvature(i, start, APART.copysign(moves));
        let mut rate = vec![0.0; self.n];
        let (mut tau, mut alpha) = (left, start + moves);
        for _ in 0..MAX_ITERATIONS {
            self.set(state.t, &state.x, &state.alpha);
            self.phi_and_slope(i, start + (alpha - start) / 3.0);
            rate.copy_from_slice(self.f());
            self.shift(state, tau + left, &rate);
            let [ahead, _] = self.phi_and_slope(i, alpha);
            self.shift(state, tau, &rate);
            let [phi, slope] = self.phi_and_slope(i, alpha);
            let by_time = (ahead - phi) / left;
            let (by, later) = (-slope / curvature, -phi / by_time);
            // An instant is known as far as rounding in t and in φ lets it be.
            let terms = self.terms_of_phi(i) / by_time.abs();
            let rounding = ROUNDINGS * f64::EPSILON * (state.t.abs() + terms);
            (alpha, tau) = (alpha + by, tau + later);
            let is_near = (alpha - start - moves).abs() <= 0.5 * moves.abs()
                && (tau - left).abs() <= 0.5 * left;
            if !is_near {
                return None;
            }
            if by.abs() <= 1e-12 && later.abs() <= (1e-10 * left).max(rounding) {
                self.shift(state, tau, &rate);
                let fold = Fold {
                    switch: i,
                    after: tau,
                    alpha,
                    direction: curvature,
                };
                return (!self.leaves_before(state, i)).then_some(fold);
            }
        }
        None
    }

    /// ∂²φ/∂α² of a switch at an α, where the point is.
    fn curvature(&mut self, i: usize, alpha: f64, aside: f64) -> f64 {
        let [_, before] = self.phi_and_slope(i, alpha);
        let [_, beside] = self.phi_and_slope(i, alpha + aside);
        (beside - before) / aside
    }

    /// Where the dummy system goes from a fold in which the point is; zero where nothing tells.
    pub(super) fn direction_at(&mut self, i: usize, alpha: f64) -> f64 {
        self.curvature(i, alpha, if alpha < 0.5 { APART } else { -APART })
    }

    /// Takes a state at a rate, some time after the start of the step, into `next`, and moves there.
    fn shift(&mut self, state: &mut State, tau: f64, rate: &[f64]) {
        for (next, (x, rate)) in state.next.iter_mut().zip(state.x.iter().zip(rate)) {
            *next = x + tau * rate;
        }
        self.set(state.t + (tau + state.t_low), &state.next, &state.alpha);
    }

    /// φ and S of a switch at an α, where the point is.
    fn phi_and_slope(&mut self, i: usize, alpha: f64) -> [f64; 2] {
        self.memory.values[1 + self.n + i] = alpha;
        self.field.eval(&self.memory.values);
        self.linearize(&[i]);
        [self.phi(i), self.coupling(i, i)]
    }

    /// True when another surface is left behind at the state in `next`.
    fn leaves_before(&mut self, state: &State, fold: usize) -> bool {
        (0..self.sides.len()).any(|i| {
            let watched = i != fold && self.sides[i] != super::Side::Slide && !state.armed[i];
            watched && self.psi(i) * self.sides[i].sign() < -state.band[i]
        })
    }
}
