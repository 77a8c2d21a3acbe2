//! The next mode, where surfaces meet.
//!
//! On the surfaces I that meet in a point, find α_I ∈ [0, 1]^I with
//! φ_i > 0 ⇒ α_i = 1 and φ_i < 0 ⇒ α_i = 0. Up to six surfaces that interact, all
//! 3^|I| choices of sides are tried, which finds every solution; beyond, Lemke's
//! method finds one. Where a rate is zero, or an α is at its bound, the series
//! of the candidate's own mode decide by their first non-negligible term, so that
//! tangencies of any order are the same rule.

use super::{Side, Simulator, State, Status, SwitchedSystem, series};
use crate::lcp;
use crate::linalg::DenseLu;

/// One way to go on: the sides of the switches that meet.
pub type Candidate = Vec<(usize, Side)>;

/// Beyond this many interacting surfaces, Lemke's method replaces enumeration.
const MAX_ENUMERATED: usize = 6;

/// Rates and distances to a bound below this fraction of their scale are ties.
pub(super) const TIE: f64 = 1e-9;

/// |ψ| below this fraction of the size of its terms is the surface.
const BAND: f64 = 1e-12;

/// A consistent choice on one group of interacting surfaces.
struct Choice {
    sides: Vec<Side>,
    alpha: Vec<f64>,
    f: Vec<f64>,
}

enum Check {
    Consistent,
    Inconsistent,
    /// Decided by the candidate's own series.
    Tie,
}

impl<S: SwitchedSystem> Simulator<'_, S> {
    /// Finds the mode at the start, taking every surface that holds the state as meeting there.
    pub(super) fn start(&mut self, state: &mut State, horizon: f64) -> Result<(), Status> {
        // ψ of a nested max depends on the sides of the inner one: settle from the inside out.
        for _ in 0..=state.sides.len() {
            let mode = self.mode(&state.sides);
            self.modes[mode].eval(state.t, &state.x, &state.alpha);
            let sides: Box<[Side]> = self.modes[mode]
                .psi()
                .iter()
                .map(|&psi| Side::of(psi))
                .collect();
            if sides == state.sides {
                break;
            }
            state.set_sides(sides);
        }
        let all: Vec<usize> = (0..state.sides.len()).collect();
        self.measure_bands(state, &all, horizon);
        let mode = self.mode(&state.sides);
        self.modes[mode].eval(state.t, &state.x, &state.alpha);
        let psi = self.modes[mode].psi();
        let on: Vec<usize> = all
            .into_iter()
            .filter(|&i| psi[i].abs() <= state.band[i])
            .collect();
        if on.is_empty() {
            Ok(())
        } else {
            self.select(state, &on, state.t + horizon)
        }
    }

    /// |ψ| ≤ `BAND` (|∇ψ| scale(x) + |∂ψ/∂t| horizon) is the surface.
    fn measure_bands(&mut self, state: &mut State, switches: &[usize], horizon: f64) {
        let mut sides = state.sides.clone();
        for &i in switches {
            sides[i] = Side::Slide;
        }
        let mode = self.mode(&sides);
        let mode = &mut self.modes[mode];
        mode.eval(state.t, &state.x, &state.alpha);
        mode.linearize();
        for (j, &i) in mode.sliding.iter().enumerate() {
            let terms = (mode.gradient(j).iter().enumerate()).map(|(k, g)| g.abs() * state.size(k));
            state.band[i] = BAND * (terms.sum::<f64>() + mode.time_gradient(j).abs() * horizon);
        }
    }

    /// Chooses the sides of all switches that meet here and interact with `triggers`.
    pub(super) fn select(
        &mut self,
        state: &mut State,
        triggers: &[usize],
        t1: f64,
    ) -> Result<(), Status> {
        let meeting: Vec<usize> = (0..state.sides.len())
            .filter(|i| state.sides[*i] == Side::Slide || state.armed[*i] || triggers.contains(i))
            .collect();
        self.measure_bands(state, &meeting, t1 - state.t);
        let mut decided: Vec<usize> = Vec::new();
        for &trigger in triggers {
            if !decided.contains(&trigger) {
                let group = self.interacting(trigger, &meeting);
                self.choose(state, &group, t1)?;
                decided.extend(group);
            }
        }
        for i in meeting {
            state.armed[i] = true;
        }
        Ok(())
    }

    /// The surfaces among `meeting` that `switch` interacts with, in order.
    fn interacting(&self, switch: usize, meeting: &[usize]) -> Vec<usize> {
        let mut group = vec![switch];
        let mut next = 0;
        while next < group.len() {
            let i = group[next];
            let linked = |&&j: &&usize| self.system.couples(i, j) || self.system.couples(j, i);
            let new: Vec<usize> = meeting
                .iter()
                .filter(linked)
                .copied()
                .filter(|j| !group.contains(j))
                .collect();
            group.extend(new);
            next += 1;
        }
        group.sort_unstable();
        group
    }

    /// Decides one group of interacting surfaces and sets its sides.
    fn choose(&mut self, state: &mut State, group: &[usize], t1: f64) -> Result<(), Status> {
        let mut sides = state.sides.clone();
        for &i in group {
            sides[i] = Side::Slide;
        }
        let free = self.mode(&sides);
        let mut singular = false;
        let mut choices = Vec::new();
        for candidate in self.candidates(free, state, group) {
            match self.solve(free, state, group, &candidate) {
                Some(choice) => choices.push(choice),
                None => singular = true,
            }
        }
        let rate_scale = self.rate_scales(free, state, group, &choices);
        let mut valid: Vec<Choice> = Vec::new();
        for choice in choices {
            let consistent = match self.check(free, state, group, &choice, &rate_scale) {
                Check::Consistent => true,
                Check::Inconsistent => false,
                Check::Tie => self.series_agree(state, group, &choice, t1),
            };
            if consistent && !valid.iter().any(|other| same_field(&other.f, &choice.f)) {
                valid.push(choice);
            }
        }
        if valid.len() > 1 {
            let wanted = &self.settings.branch;
            let matches = |choice: &Choice| {
                !wanted.is_empty() && choice.sides.iter().zip(wanted).all(|(a, b)| a == b)
            };
            if valid.iter().filter(|choice| matches(choice)).count() != 1 {
                let name = |choice: &Choice| {
                    group
                        .iter()
                        .copied()
                        .zip(choice.sides.iter().copied())
                        .collect()
                };
                return Err(Status::NonUnique(valid.iter().map(name).collect()));
            }
            valid.retain(matches);
        }
        let Some(choice) = valid.pop() else {
            let switches = group.to_vec();
            return Err(if singular {
                Status::HigherDegree { switches }
            } else {
                Status::NoSolution { switches }
            });
        };
        let mut sides = state.sides.clone();
        for (&i, &side) in group.iter().zip(&choice.sides) {
            sides[i] = side;
        }
        state.set_sides(sides);
        for (&i, &alpha) in group.iter().zip(&choice.alpha) {
            state.alpha[i] = alpha;
        }
        Ok(())
    }

    /// The choices worth trying, the present sides first.
    fn candidates(&mut self, free: usize, state: &State, group: &[usize]) -> Vec<Vec<Side>> {
        let options: Vec<Vec<Side>> = group
            .iter()
            .map(|&i| {
                let mut options = vec![Side::Minus, Side::Plus];
                if !self.system.is_continuous(i) {
                    options.push(Side::Slide);
                }
                if let Some(present) = options.iter().position(|side| *side == state.sides[i]) {
                    options.swap(0, present);
                }
                options
            })
            .collect();
        if group.len() > MAX_ENUMERATED {
            return self.pivot(free, state, group).into_iter().collect();
        }
        options.iter().fold(vec![Vec::new()], |prefixes, options| {
            let extend = |prefix: Vec<Side>| {
                options
                    .iter()
                    .map(move |&side| [prefix.as_slice(), &[side]].concat())
            };
            prefixes.into_iter().flat_map(extend).collect()
        })
    }

    /// One choice by Lemke's method on φ = b + Aα, relinearized until the sides repeat.
    ///
    /// w = Mz + q with z = (α, p), w = (n, 1 - α), M = (-A I; -I 0), q = (-b, e).
    fn pivot(&mut self, free: usize, state: &State, group: &[usize]) -> Option<Vec<Side>> {
        let n = group.len();
        let mode = &mut self.modes[free];
        let at: Vec<usize> = group
            .iter()
            .map(|i| mode.sliding.binary_search(i))
            .collect::<Result<_, _>>()
            .ok()?;
        let mut alpha = state.alpha.clone();
        let mut sides = Vec::new();
        for _ in 0..20 {
            mode.eval(state.t, &state.x, &alpha);
            mode.linearize();
            let size = 2 * n;
            let (mut m, mut q, mut cover) =
                (vec![0.0; size * size], vec![1.0; size], vec![1.0; size]);
            let scale = |row: usize| {
                (0..n).fold(1e-300_f64, |s, col| {
                    s.max(mode.coupling(at[row], at[col]).abs())
                })
            };
            for row in 0..n {
                let mut b = mode.phi()[at[row]];
                let size_of_row = scale(row);
                for col in 0..n {
                    let a = mode.coupling(at[row], at[col]);
                    b -= a * alpha[group[col]];
                    m[row * size + col] = -a / size_of_row;
                    cover[row] += a.abs() / size_of_row;
                }
                m[row * size + n + row] = 1.0;
                m[(n + row) * size + row] = -1.0;
                q[row] = -b / size_of_row;
            }
            let z = lcp::lemke(&m, &q, &cover).ok()?;
            let side = |a: f64| {
                if a <= TIE {
                    Side::Minus
                } else if a >= 1.0 - TIE {
                    Side::Plus
                } else {
                    Side::Slide
                }
            };
            let found: Vec<Side> = z[..n].iter().map(|&a| side(a)).collect();
            for (&i, &a) in group.iter().zip(&z) {
                alpha[i] = a;
            }
            if found == sides {
                break;
            }
            sides = found;
        }
        Some(sides)
    }

    /// Solves φ_S = 0 for the sliding switches S of a candidate; none where that is singular.
    fn solve(
        &mut self,
        free: usize,
        state: &State,
        group: &[usize],
        sides: &[Side],
    ) -> Option<Choice> {
        let mode = &mut self.modes[free];
        let mut alpha = state.alpha.clone();
        let mut unknowns = Vec::new();
        for (&i, &side) in group.iter().zip(sides) {
            alpha[i] = match side {
                Side::Minus => 0.0,
                Side::Plus => 1.0,
                Side::Slide => {
                    unknowns.push((i, mode.sliding.binary_search(&i).ok()?));
                    if state.sides[i] == Side::Slide {
                        alpha[i]
                    } else {
                        0.5
                    }
                }
            };
        }
        let k = unknowns.len();
        let (mut lu, mut matrix, mut rhs) = (DenseLu::new(k), vec![0.0; k * k], vec![0.0; k]);
        mode.eval(state.t, &state.x, &alpha);
        for _ in 0..if k == 0 { 0 } else { 30 } {
            mode.linearize();
            for (row, &(_, at_row)) in unknowns.iter().enumerate() {
                rhs[row] = mode.phi()[at_row];
                for (col, &(_, at_col)) in unknowns.iter().enumerate() {
                    matrix[row * k + col] = mode.coupling(at_row, at_col);
                }
            }
            lu.factor(&matrix).ok()?;
            lu.solve(&mut rhs);
            let mut change = 0.0_f64;
            for (&(i, _), delta) in unknowns.iter().zip(&rhs) {
                alpha[i] -= delta;
                change = change.max(delta.abs() / (1.0 + alpha[i].abs()));
            }
            mode.eval(state.t, &state.x, &alpha);
            if change <= 1e-13 {
                break;
            }
        }
        Some(Choice {
            sides: sides.to_vec(),
            alpha: group.iter().map(|&i| alpha[i]).collect(),
            f: mode.f().to_vec(),
        })
    }

    /// Size of each rate of the group: |∇ψ|·|f| + |∂ψ/∂t| over all candidates, and what would move
    /// ψ by its own size within a step.
    fn rate_scales(
        &mut self,
        free: usize,
        state: &State,
        group: &[usize],
        choices: &[Choice],
    ) -> Vec<f64> {
        let mode = &mut self.modes[free];
        mode.eval(state.t, &state.x, &state.alpha);
        mode.linearize();
        let largest = |component: usize| {
            choices
                .iter()
                .fold(0.0_f64, |m, choice| m.max(choice.f[component].abs()))
        };
        let rate = |i: &usize| {
            let Ok(j) = mode.sliding.binary_search(i) else {
                return 0.0;
            };
            let terms = mode
                .gradient(j)
                .iter()
                .enumerate()
                .map(|(component, g)| g.abs() * largest(component));
            let within_a_step = if state.last_step > 0.0 {
                state.band[*i] / BAND / state.last_step
            } else {
                0.0
            };
            terms.sum::<f64>() + mode.time_gradient(j).abs() + within_a_step
        };
        group.iter().map(rate).collect()
    }

    fn check(
        &mut self,
        free: usize,
        state: &State,
        group: &[usize],
        choice: &Choice,
        rate_scale: &[f64],
    ) -> Check {
        let mode = &mut self.modes[free];
        let mut alpha = state.alpha.clone();
        for (&i, &a) in group.iter().zip(&choice.alpha) {
            alpha[i] = a;
        }
        mode.eval(state.t, &state.x, &alpha);
        let mut tie = false;
        for (at, &i) in group.iter().enumerate() {
            let Ok(j) = mode.sliding.binary_search(&i) else {
                return Check::Inconsistent;
            };
            // Positive inside, negative outside, relative to the natural size.
            let margin = match choice.sides[at] {
                Side::Slide => choice.alpha[at].min(1.0 - choice.alpha[at]),
                side if rate_scale[at] > 0.0 => side.sign() * mode.phi()[j] / rate_scale[at],
                _ => 0.0,
            };
            if margin.is_nan() || margin < -TIE {
                return Check::Inconsistent;
            }
            tie |= margin <= TIE;
        }
        if tie { Check::Tie } else { Check::Consistent }
    }

    /// True when the series in the candidate's own mode stay on its side of every surface.
    fn series_agree(
        &mut self,
        state: &mut State,
        group: &[usize],
        choice: &Choice,
        t1: f64,
    ) -> bool {
        let (mut sides, mut alpha) = (state.sides.clone(), state.alpha.clone());
        for (at, &i) in group.iter().enumerate() {
            sides[i] = choice.sides[at];
            alpha[i] = choice.alpha[at];
        }
        let index = self.mode(&sides);
        let order = self.order;
        let mode = &mut self.modes[index];
        if mode.expand(state.t, &state.x, &mut alpha, order).is_err() {
            return false;
        }
        mode.measure_activity(state, &alpha);
        let h = mode.step_size(self.settings.local_tolerance(), state, t1 - state.t);
        group
            .iter()
            .zip(&choice.sides)
            .all(|(&i, side)| match side {
                Side::Slide => {
                    let Ok(j) = mode.sliding.binary_search(&i) else {
                        return false;
                    };
                    let series = mode.alpha_series(j);
                    let inward = if series[0] <= TIE {
                        1.0
                    } else if series[0] >= 1.0 - TIE {
                        -1.0
                    } else {
                        return true;
                    };
                    series::leading(series, h, TIE).is_none_or(|k| series[k] * inward > 0.0)
                }
                side => {
                    let series = mode.psi_series(i);
                    series::leading(series, h, state.band[i])
                        .is_none_or(|k| series[k] * side.sign() > 0.0)
                }
            })
    }
}

impl State {
    fn set_sides(&mut self, sides: Box<[Side]>) {
        for (alpha, side) in self.alpha.iter_mut().zip(&sides) {
            match side {
                Side::Minus => *alpha = 0.0,
                Side::Plus => *alpha = 1.0,
                Side::Slide => {}
            }
        }
        self.sides = sides;
    }
}

fn same_field(a: &[f64], b: &[f64]) -> bool {
    let scale = a.iter().chain(b).fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-10 * scale)
}
