//! Sliding folds: where the branch of sliding modes that nonlinear switches follow turns back.
//!
//! A = ∂φ_K/∂α_K of switches K that interact is singular there, which for one switch is S = ∂φ/∂α = 0, and
//! α_K(t) = α_f - v √(t_f - t) + .. has an infinite slope along the null vector v of A. Steps of the Taylor method become
//! shorter in proportion to what is left, and the last one goes to the fold itself: with a₁ and a₂ the first coefficients
//! of α,
//!
//! t_f - t ≈ a₁ / (4 a₂),   α_f - α ≈ 2 a₁ (t_f - t).
//!
//! Along the branch by its length s, A dα/ds + φ_t dt/ds = 0. So Newton's method solves φ_K(t_f, x_f, α_f) = 0 and
//! dt/ds = 0, with c along α_f - α and
//!
//! | A  φ_t | | y  v    |   | -φ_K  0 |
//! | cᵀ  0  | | τ  dt/ds | = |  0    1 |
//!
//! which is regular in the fold (Govaerts 2000, chapter 3). The state moves there by (t_f - t) f at the mean of α, which
//! is α + (α_f - α)/3; what this neglects is of order (α_f - α)⁴.

use super::selection::{Fold, Turn};
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::Bands;
use crate::hybrid::point::Point;
use crate::hybrid::{Side, Status};
use crate::linalg::{DenseLu, norm};

/// Steps end at the fold once α is this close to it.
const CLOSE: f64 = 3e-5;

/// Newton iterations.
const MAX_ITERATIONS: usize = 30;

/// Roundings of its terms that φ may be wrong by.
const ROUNDINGS: f64 = 4.0;

/// A change of α over which dt/ds is compared.
const APART: f64 = 1e-5;

impl Fold {
    /// A fold in which the state is.
    pub(crate) fn at(mode: &mut Mode, point: &Point, switch: usize) -> Result<Fold, Status> {
        mode.move_to(point);
        let alpha = point.alpha[switch];
        let mut branch = Branch {
            mode,
            switches: vec![switch],
        };
        let direction = branch.direction_at(alpha);
        if direction == 0.0 || !direction.is_finite() {
            return Err(Status::Undetermined {
                switches: vec![switch],
            });
        }
        let turn = Turn {
            switch,
            alpha,
            direction,
        };
        Ok(Fold {
            switch,
            after: 0.0,
            turns: vec![turn],
        })
    }

    /// The fold that nonlinear switches are about to reach, with the state there in `state.trial.x`.
    pub(crate) fn ahead(mode: &mut Mode, state: &mut State, remaining: f64) -> Option<Fold> {
        for at in 0..mode.sliding.len() {
            let i = mode.sliding[at];
            if !mode.system.switches[i].is_nonlinear {
                continue;
            }
            let a = mode.alpha_series(i);
            let left = a[1] / (4.0 * a[2]);
            let moves = 2.0 * a[1] * left;
            let is_close = moves.abs() <= CLOSE && left > 0.0 && left < remaining;
            if !is_close || !(0.0..=1.0).contains(&(a[0] + moves)) {
                continue;
            }
            let fold = Branch::of(mode, i).and_then(|mut branch| branch.fold(state, i, left));
            if fold.is_some() {
                return fold;
            }
        }
        None
    }
}

/// φ_K where the point is, and A, row by row.
struct Rates {
    phi: Vec<f64>,
    slopes: Vec<f64>,
}

/// The matrix of Newton's method, factored.
struct Bordered(DenseLu);

impl Bordered {
    fn new(slopes: &[f64], by_time: &[f64], along: &[f64]) -> Option<Self> {
        let n = along.len();
        let mut matrix = Vec::with_capacity((n + 1) * (n + 1));
        for (row, by_time) in slopes.chunks_exact(n).zip(by_time) {
            matrix.extend_from_slice(row);
            matrix.push(*by_time);
        }
        matrix.extend_from_slice(along);
        matrix.push(0.0);
        let mut lu = DenseLu::new(n + 1);
        lu.factor(&matrix).ok()?;
        Some(Bordered(lu))
    }

    /// The solution for these right-hand sides and a last one.
    fn solve(&self, rhs: impl Iterator<Item = f64>, last: f64) -> Vec<f64> {
        let mut rhs: Vec<f64> = rhs.chain([last]).collect();
        self.0.solve(&mut rhs);
        rhs
    }

    /// dα/ds and dt/ds along the branch.
    fn tangent(&self, n: usize) -> Vec<f64> {
        self.solve(std::iter::repeat_n(0.0, n), 1.0)
    }
}

/// The branch of sliding modes that the interacting switches K follow.
struct Branch<'a> {
    mode: &'a mut Mode,
    switches: Vec<usize>,
}

impl<'a> Branch<'a> {
    /// That of the switches that interact with switch i.
    fn of(mode: &'a mut Mode, i: usize) -> Option<Self> {
        let own = |switches: &&[usize]| switches.contains(&i);
        let switches = mode.equations.components().find(own)?.to_vec();
        Some(Branch { mode, switches })
    }

    /// The fold (t_f, x_f, α_f) that switch i is about to reach, by Newton's method from the prediction of
    /// the Taylor series, with `left` ≈ t_f - t; the state x_f is in `state.trial.x`. None where the iteration leaves
    /// the neighbourhood of the prediction or does not converge, or where another surface is left before the fold.
    fn fold(&mut self, state: &mut State, i: usize, left: f64) -> Option<Fold> {
        let n = self.switches.len();
        let start: Vec<f64> = self
            .switches
            .iter()
            .map(|&k| state.point.alpha[k])
            .collect();
        // The prediction α_f - α = 2 a₁ (t_f - t), and c, its direction.
        let predicted = |&k: &usize| 2.0 * self.mode.alpha_series(k)[1] * left;
        let predicted: Vec<f64> = self.switches.iter().map(predicted).collect();
        let size = norm(&predicted);
        let along: Vec<f64> = predicted.iter().map(|m| m / size).collect();
        // The iterates: α_f, and t_f - t, which is `after`.
        let mut alpha = sum(&start, 1.0, &predicted);
        let (mut after, mut rate) = (left, vec![0.0; self.mode.n]);
        for _ in 0..MAX_ITERATIONS {
            // f at the mean of α, which takes x to x_f = x + (t_f - t) f.
            self.mode.move_to(&state.point);
            let moved = sum(&alpha, -1.0, &start);
            self.rates_at(&sum(&start, 1.0 / 3.0, &moved));
            rate.copy_from_slice(&self.mode.field.f);
            // φ_t along x' = f by a forward difference in t; φ_K and A in the iterate.
            self.shift(state, after + left, &rate);
            let ahead = self.rates_at(&alpha);
            self.shift(state, after, &rate);
            let here = self.rates_at(&alpha);
            let rises = ahead.phi.iter().zip(&here.phi);
            let by_time: Vec<f64> = rises.map(|(ahead, here)| (ahead - here) / left).collect();
            // (y, τ) leads to φ_K = 0 with cᵀy = 0, (v, dt/ds) along the branch.
            let newton = Bordered::new(&here.slopes, &by_time, &along)?;
            let onto = newton.solve(here.phi.iter().map(|phi| -phi), 0.0);
            let tangent = newton.tangent(n);
            // Newton's method for dt/ds = 0: s = -(dt/ds)/(d²t/ds²), with d²t/ds² by a difference along v.
            let aside = self.rates_at(&sum(&alpha, APART, &tangent[..n]));
            let beside = Bordered::new(&aside.slopes, &by_time, &along)?.tangent(n);
            let s = -tangent[n] * APART / (beside[n] - tangent[n]);
            // t_f is known as far as rounding in t and in φ lets it be: δt = δφ/‖φ_t‖.
            let terms = self.switches.iter().map(|&k| self.mode.terms_of_phi(k));
            let terms = terms.fold(0.0, f64::max) / norm(&by_time);
            let rounding = ROUNDINGS * f64::EPSILON * (state.point.t.abs() + terms);
            // α_f += y + s v, t_f += τ + s dt/ds.
            alpha = sum(&sum(&alpha, 1.0, &onto[..n]), s, &tangent[..n]);
            after += onto[n] + s * tangent[n];
            // Another fold than the predicted one is none of this step.
            let is_near = norm(&sum(&sum(&alpha, -1.0, &start), -1.0, &predicted)) <= 0.5 * size
                && (after - left).abs() <= 0.5 * left;
            if !is_near {
                return None;
            }
            let is_there = s.abs() <= 1e-12 && onto[n].abs() <= (1e-10 * left).max(rounding);
            if is_there && norm(&onto[..n]) <= 1e-12 {
                self.shift(state, after, &rate);
                let leaves = self.leaves_before(&state.bands, i);
                let turns = self.turns(&alpha, &by_time, &along)?;
                // The switch of the largest |v_k| stands for all of them.
                let speed = |turn: &&Turn| turn.direction.abs();
                let fastest = turns.iter().max_by(|a, b| speed(a).total_cmp(&speed(b)));
                let switch = fastest.map_or(i, |turn| turn.switch);
                return (!leaves).then_some(Fold {
                    switch,
                    after,
                    turns,
                });
            }
        }
        None
    }

    /// Where the dummy system goes from a fold in which the point is: along v, in the direction of wᵀφ for the left null
    /// vector w of A.
    fn turns(&mut self, alpha: &[f64], by_time: &[f64], along: &[f64]) -> Option<Vec<Turn>> {
        let n = self.switches.len();
        let here = self.rates_at(alpha);
        let newton = Bordered::new(&here.slopes, by_time, along)?;
        let tangent = &newton.tangent(n)[..n];
        let aside = self.rates_at(&sum(alpha, APART, tangent));
        let mut left: Vec<f64> = vec![0.0; n + 1];
        left[n] = 1.0;
        newton.0.solve_transposed(&mut left);
        let bends = (here
            .slopes
            .chunks_exact(n)
            .zip(aside.slopes.chunks_exact(n)))
        .map(|(here, aside)| {
            let change = here.iter().zip(aside).zip(tangent);
            change
                .map(|((here, aside), v)| (aside - here) * v)
                .sum::<f64>()
        });
        let curvature: f64 = left.iter().zip(bends).map(|(w, bend)| w * bend).sum();
        let pull: f64 = left.iter().zip(tangent).map(|(w, v)| w * v).sum();
        let largest = tangent.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let sense = (curvature * pull).signum() / largest;
        let turns = self.switches.iter().zip(alpha).zip(tangent);
        let turns = turns.map(|((&switch, &alpha), v)| Turn {
            switch,
            alpha,
            direction: sense * v,
        });
        let turns: Vec<Turn> = turns.collect();
        let is_known = |turn: &Turn| turn.direction.is_finite();
        (curvature * pull != 0.0 && turns.iter().all(is_known)).then_some(turns)
    }

    /// Where the dummy system of one switch goes from a fold in which the point is; zero where nothing tells.
    fn direction_at(&mut self, alpha: f64) -> f64 {
        let aside = if alpha < 0.5 { APART } else { -APART };
        let [before, beside] = [0.0, aside].map(|by| self.rates_at(&[alpha + by]).slopes[0]);
        match (beside - before) / aside {
            0.0 => 0.0,
            curvature => curvature.signum(),
        }
    }

    /// Takes a state at a rate, some time after the start of the step, into `next`, and moves there.
    fn shift(&mut self, state: &mut State, tau: f64, rate: &[f64]) {
        for (next, (x, rate)) in state.trial.x.iter_mut().zip(state.point.x.iter().zip(rate)) {
            *next = x + tau * rate;
        }
        self.mode.memory.set(
            state.point.t + (tau + state.point.t_low),
            &state.trial.x,
            &state.point.alpha,
        );
    }

    /// Rates of K and their derivatives at these α, where the point is.
    fn rates_at(&mut self, alpha: &[f64]) -> Rates {
        for (&i, &alpha) in self.switches.iter().zip(alpha) {
            self.mode.memory.values[1 + self.mode.n + i] = alpha;
        }
        self.mode.field.eval(&self.mode.memory.values);
        self.mode.linearize(&self.switches);
        let (mode, switches) = (&*self.mode, &self.switches);
        let pairs = switches
            .iter()
            .flat_map(|&i| switches.iter().map(move |&j| (i, j)));
        Rates {
            phi: switches.iter().map(|&i| mode.phi(i)).collect(),
            slopes: pairs.map(|(i, j)| mode.coupling(i, j)).collect(),
        }
    }

    /// True when another surface is left behind at the state in `next`.
    fn leaves_before(&mut self, bands: &Bands, fold: usize) -> bool {
        (0..self.mode.sides.len()).any(|i| {
            let watched = i != fold && self.mode.sides[i] != Side::Slide && !bands.armed[i];
            watched && self.mode.psi(i) * self.mode.sides[i].sign() < -bands.width[i]
        })
    }
}

/// a + c b
fn sum(a: &[f64], c: f64, b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + c * b).collect()
}
