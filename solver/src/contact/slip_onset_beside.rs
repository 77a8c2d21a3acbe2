//! Slip velocities with two entries that are at rest where switches of other kinds meet them, as in frozen time.
//!
//! Each either stays at rest, with u = 2α - 1 so that its rate φ(u) vanishes, or sets off: u is the point of the rim
//! that φ goes along,
//!
//! |u|² = 1,   u₁ φ₂ - u₂ φ₁ = 0,   u·φ > 0,
//!
//! which is -φ in the normal cone of the disc at -u. Newton's method solves for it together with the α of what slides,
//! from directions all around: φ is affine in u, and there are at most four on a circle.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::{Role, Side, Status};
use crate::linalg::DenseLu;
use crate::selector::candidates::{Enumeration, FAR, MAX_ENUMERATED, Search, alternatives};
use crate::selector::selection::{Choice, Choices};

/// Directions from which one to set off in is looked for.
const DIRECTIONS: usize = 8;

/// Slip velocities that set off at once for which all combinations of directions are tried.
const MAX_COMBINED: usize = 2;

/// Newton iterations, the change that is none, and one that rounding may leave.
const MAX_NEWTON: usize = 40;
const SOLVED: f64 = 1e-14;
const ROUNDED: f64 = 1e-10;

/// Solutions closer than this are one.
const SAME: f64 = 1e-8;

/// A rate against its own direction by less than this, relative to friction, is none.
const NEAR: f64 = 1e-7;

impl Enumeration<'_> {
    /// True for steps that meet with a slip velocity with two entries.
    pub(crate) fn holds_disc(&self, group: &[usize]) -> bool {
        let is_step = |&i: &usize| self.mode.system.role(i) == Role::Step;
        group.iter().all(is_step)
            && group
                .iter()
                .any(|&i| self.mode.system.switches[i].is_in_disc())
    }

    /// All choices of sides with their α, where slip velocities with two entries rest or set off.
    pub(crate) fn disc_choices(
        &mut self,
        state: &State,
        group: &[usize],
    ) -> Result<Choices, Status> {
        let items = group
            .iter()
            .copied()
            .filter(|&i| !self.mode.system.is_second(i));
        let items: Vec<usize> = items.collect();
        let options = items
            .iter()
            .map(|&i| match self.mode.system.switches[i].is_in_disc() {
                true => vec![Side::Slide, Side::Plus],
                false => self.options(&state.point, group, i),
            });
        let options: Vec<Vec<Side>> = options.collect();
        let open = options.iter().filter(|sides| sides.len() > 1).count();
        let mut choices = Choices {
            found: Vec::new(),
            singular: false,
            all: open <= MAX_ENUMERATED,
        };
        for candidate in alternatives(&options) {
            self.settings.limit.check()?;
            let mut all = state.point.sides.clone();
            for (&i, &side) in items.iter().zip(&candidate) {
                all[i] = side;
                if let Some(other) = self.mode.system.second(i) {
                    all[other] = side;
                }
            }
            let discs = items
                .iter()
                .copied()
                .filter(|&i| self.mode.system.switches[i].is_in_disc());
            let (free, bound): (Vec<usize>, Vec<usize>) =
                discs.partition(|&i| self.mode.system.is_idle(i, &all));
            // What matters to no rate has no α to rest with.
            if free.iter().any(|&i| all[i] == Side::Slide) {
                continue;
            }
            let leaving = bound.into_iter().filter(|&i| all[i] != Side::Slide);
            let leaving: Vec<usize> = leaving.collect();
            let sides: Vec<Side> = group.iter().map(|&i| all[i]).collect();
            self.mode.enter_choice(&state.point, group, &sides);
            let outcome = match leaving.is_empty() {
                true => self.solve(state, group, &sides, &mut choices.found),
                false => self.add_onsets(state, group, &sides, &leaving, &mut choices),
            };
            choices.singular |= outcome == Search::Singular;
            choices.all &= outcome != Search::Bounded;
        }
        Ok(choices)
    }

    /// Adds the solutions in which `leaving` set off, the first switch of each.
    fn add_onsets(
        &mut self,
        state: &State,
        group: &[usize],
        sides: &[Side],
        leaving: &[usize],
        choices: &mut Choices,
    ) -> Search {
        let mut alpha = state.point.alpha.clone();
        let mut sliding = Vec::new();
        for (&i, &side) in group.iter().zip(sides) {
            alpha[i] = match side {
                Side::Minus => 0.0,
                Side::Plus => 1.0,
                Side::Slide => {
                    sliding.push(i);
                    0.5
                }
            };
        }
        let mode = &mut self.mode;
        let pairs = leaving
            .iter()
            .map(|&i| [i, mode.system.second(i).unwrap_or(i)]);
        let pairs: Vec<[usize; 2]> = pairs.collect();
        let mut start = OnsetEquations {
            mode,
            alpha,
            sliding,
            leaving: pairs.clone(),
        };
        let mut known: Vec<Vec<f64>> = Vec::new();
        let mut outcome = Search::Complete;
        for at in 0..DIRECTIONS.pow(start.leaving.len().min(MAX_COMBINED) as u32) {
            start.point(at);
            match start.newton() {
                None => outcome = Search::Singular,
                Some(None) => {}
                Some(Some(alpha)) => {
                    let is_near = |other: &Vec<f64>| {
                        let mut pairs = alpha.iter().zip(other);
                        pairs.all(|(a, b)| (a - b).abs() <= SAME)
                    };
                    if !known.iter().any(is_near) {
                        known.push(alpha);
                    }
                }
            }
        }
        if !known.is_empty() {
            outcome = Search::Complete;
        }
        for alpha in known {
            if !start_along(self.mode, &pairs, &alpha) {
                continue;
            }
            let mode = &mut self.mode;
            mode.vary(&alpha);
            let states = mode.focus.states.iter();
            choices.found.push(Choice {
                sides: sides.into(),
                alpha: group.iter().map(|&i| alpha[i]).collect(),
                f: states.map(|&state| mode.field.f[state]).collect(),
            });
        }
        outcome
    }
}

/// Whether all that set off do so along their u, or as fast as next to nothing.
fn start_along(mode: &mut Mode, pairs: &[[usize; 2]], alpha: &[f64]) -> bool {
    mode.vary(alpha);
    pairs.iter().all(|pair| {
        mode.linearize(pair);
        let along = |i: &usize| (2.0 * alpha[*i] - 1.0) * mode.phi(*i);
        let speed: f64 = pair.iter().map(along).sum();
        // ∂φ/∂u is what friction takes at most.
        let size: f64 = pair
            .iter()
            .map(|&i| mode.phi(i).abs() + 0.5 * mode.coupling(i, i).abs())
            .sum();
        speed >= -NEAR * size
    })
}

/// The equations of what sets off, and of what slides with it.
struct OnsetEquations<'m> {
    mode: &'m mut Mode,
    /// Where Newton's method starts.
    alpha: Vec<f64>,
    /// Switches whose rates vanish.
    sliding: Vec<usize>,
    /// Both switches of each that sets off.
    leaving: Vec<[usize; 2]>,
}

impl OnsetEquations<'_> {
    /// Starts in the direction with this number.
    fn point(&mut self, mut number: usize) {
        for (k, pair) in self.leaving.iter().enumerate() {
            let angle = std::f64::consts::TAU * (number % DIRECTIONS) as f64 / DIRECTIONS as f64;
            if k + 1 < MAX_COMBINED {
                number /= DIRECTIONS;
            }
            let (sin, cos) = angle.sin_cos();
            self.alpha[pair[0]] = 0.5 + 0.5 * cos;
            self.alpha[pair[1]] = 0.5 + 0.5 * sin;
        }
        for &i in &self.sliding {
            self.alpha[i] = 0.5;
        }
    }

    /// All α; none where the search goes astray, nothing at all where the matrix is singular.
    fn newton(&mut self) -> Option<Option<Vec<f64>>> {
        let unknowns = (self.sliding.iter().copied()).chain(self.leaving.iter().flatten().copied());
        let unknowns: Vec<usize> = unknowns.collect();
        let mut alpha = self.alpha.clone();
        let mut lu = DenseLu::new(unknowns.len());
        let mut last = f64::INFINITY;
        for _ in 0..MAX_NEWTON {
            let (matrix, mut rhs) = self.linearize(&unknowns, &alpha);
            lu.factor(&matrix).ok()?;
            lu.solve(&mut rhs);
            let mut change = 0.0_f64;
            for (&i, step) in unknowns.iter().zip(&rhs) {
                alpha[i] -= step;
                change = change.max(step.abs() / (1.0 + alpha[i].abs()));
            }
            if change.is_nan() || unknowns.iter().any(|&i| alpha[i].abs() > FAR) {
                return Some(None);
            }
            if change <= SOLVED || change <= ROUNDED && change > 0.5 * last {
                return Some(Some(alpha));
            }
            last = change;
        }
        Some(None)
    }

    /// The derivatives of all equations, and their values.
    fn linearize(&mut self, unknowns: &[usize], alpha: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mode = &mut *self.mode;
        mode.vary(alpha);
        mode.linearize(unknowns);
        let (mut matrix, mut values) = (Vec::new(), Vec::new());
        for &i in &self.sliding {
            values.push(mode.phi(i));
            matrix.extend(unknowns.iter().map(|&j| mode.coupling(i, j)));
        }
        for &[first, second] in &self.leaving {
            let u = [first, second].map(|i| 2.0 * alpha[i] - 1.0);
            let phi = [first, second].map(|i| mode.phi(i));
            let own = |j: usize, of: [f64; 2]| match j {
                _ if j == first => 2.0 * of[0],
                _ if j == second => 2.0 * of[1],
                _ => 0.0,
            };
            values.push(u[0] * u[0] + u[1] * u[1] - 1.0);
            matrix.extend(unknowns.iter().map(|&j| own(j, [2.0 * u[0], 2.0 * u[1]])));
            values.push(u[0] * phi[1] - u[1] * phi[0]);
            matrix.extend(unknowns.iter().map(|&j| {
                let [by_first, by_second] = [first, second].map(|i| mode.coupling(i, j));
                u[0] * by_second - u[1] * by_first + own(j, [phi[1], -phi[0]])
            }));
        }
        (matrix, values)
    }
}
