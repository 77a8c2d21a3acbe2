//! Steps off points at which f has no Taylor series.
//!
//! √(t - t₀), |x|^(1/3) and max(q, 0)^1.5 are smooth off the point where they vanish, and there they have values
//! alone. Towards it the series converge for less than what is left, so that steps shrink until the next one reaches
//! over it; behind it they grow again. From the point itself one straight step leads away,
//!
//! x₁ = x₀ + h f(t₀ + h/2, x₀ + h/2 f(t₀, x₀)),
//!
//! so short that f changes in it by less than the tolerance of x over h: the error is a fraction of that, since f - f₀
//! grows like a power of time.

use super::step::{Step, step_failure};
use super::stepper::Stepper;
use super::watch::{first_event, simultaneous};
use crate::event::state::State;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::scales::Bands;
use crate::expansion::scales::SMALLEST;
use crate::expansion::taylor::MODERATE;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, Side, Status};

/// What the error of a straight step is of h times the change of f: 1/(1 + p) - 1/2ᵖ is no larger for 0 < p ≤ 1.
const SHARE: f64 = 0.1;

/// How much shorter the next try is.
const SHORTER: f64 = 0.25;

/// Tries.
const MAX_TRIES: usize = 80;

/// What starts at zero is as large as its rates after this share of the time that is left make it.
const EARLY: f64 = 1e-3;

/// The share of its rate by which what leaves a surface may slow down or speed up in a straight step.
const STEADY: f64 = 0.1;

/// A straight step is no longer than so many of the last ones.
const MAX_GROWTH: f64 = 10.0;

/// A step as short as this share of the time that is left moves nothing that matters.
const SHORTEST: f64 = 1e-13;

/// The straight step.
pub(crate) struct Line {
    pub length: f64,
    /// Rates at the middle of it.
    pub rates: Vec<f64>,
    /// α there.
    pub alpha: Vec<f64>,
}

/// The longest straight step that f hardly changes in.
pub(crate) struct Longest {
    pub line: Line,
    /// What errors of the states are relative to.
    sizes: Vec<f64>,
    /// Whether it is too short to move anything that matters.
    is_shortest: bool,
}

/// Straight steps in a mode.
pub(crate) struct StraightSteps<'m> {
    pub mode: &'m mut Mode,
}

impl StraightSteps<'_> {
    /// The longest straight step up to `longest` that is accurate; none where f is not finite.
    pub(crate) fn longest(
        &mut self,
        state: &State,
        tolerance: f64,
        longest: f64,
    ) -> Option<Longest> {
        let mut alpha = state.point.alpha.clone();
        let (t, x) = (state.point.t, &state.point.x);
        self.mode.solve_alpha(t, x, &mut alpha).ok()?;
        let start = self.mode.field.f.clone();
        if !start.iter().all(|f| f.is_finite()) {
            return None;
        }
        let shortest = f64::max(SHORTEST * longest, 4.0 * f64::EPSILON * t.abs());
        let shortest = longest.min(shortest);
        let left = self.rates_left(&state.bands, &start);
        let ahead = |tau: f64, f: &[f64]| -> Vec<f64> {
            x.iter().zip(f).map(|(x, f)| x + tau * f).collect()
        };
        let mut h = match state.scales.last_step {
            last if last > 0.0 => longest.min(MAX_GROWTH * last),
            _ => longest,
        };
        let soon = ahead(EARLY * longest, &start);
        self.mode
            .solve_alpha(t + EARLY * longest, &soon, &mut alpha)
            .ok()?;
        let early = self.mode.field.f.clone();
        // What starts at zero is as large as its rate makes it.
        let sizes = |f: &[f64]| -> Vec<f64> {
            let size = |(i, early): (usize, &f64)| match state.scales.largest[i].max(x[i].abs()) {
                0.0 => (early.abs().max(f[i].abs()) * longest).max(SMALLEST),
                size => size.max(SMALLEST),
            };
            early.iter().enumerate().map(size).collect()
        };
        for _ in 0..MAX_TRIES {
            let middle = ahead(0.5 * h, &start);
            self.mode
                .solve_alpha(t + 0.5 * h, &middle, &mut alpha)
                .ok()?;
            let rates = self.mode.field.f.clone();
            let of_middle = alpha.clone();
            let end = ahead(h, &rates);
            self.mode.solve_alpha(t + h, &end, &mut alpha).ok()?;
            let sizes = sizes(&self.mode.field.f);
            let is_accurate = (0..self.mode.n).all(|i| {
                let change = (self.mode.field.f[i] - start[i])
                    .abs()
                    .max((rates[i] - start[i]).abs());
                SHARE * h * change <= tolerance * sizes[i]
            });
            let keeps = |(i, before): &(usize, f64)| {
                let change = self.mode.surfaces.rate(*i, &rates) - before;
                *before == 0.0 || change.abs() <= STEADY * before.abs()
            };
            if is_accurate && left.iter().all(keeps) || h <= shortest {
                return Some(Longest {
                    line: Line {
                        length: h,
                        rates,
                        alpha: of_middle,
                    },
                    sizes,
                    is_shortest: h <= shortest,
                });
            }
            h = f64::max(SHORTER * h, shortest);
        }
        None
    }

    /// The rates with which ψ of switches with roots leave their surfaces.
    fn rates_left(&mut self, bands: &Bands, f: &[f64]) -> Vec<(usize, f64)> {
        let mut left = Vec::new();
        for i in 0..self.mode.sides.len() {
            if self.mode.system.switches[i].has_root
                && bands.armed[i]
                && self.mode.sides[i] != Side::Slide
            {
                self.mode.surfaces.linearize(i, &self.mode.memory.values);
                left.push((i, self.mode.surfaces.rate(i, f)));
            }
        }
        left
    }

    /// φ of some switches in the middle of the straight step; not numbers where there is none.
    pub(crate) fn rates_ahead(
        &mut self,
        state: &State,
        switches: &[usize],
        tolerance: f64,
        longest: f64,
    ) -> Vec<f64> {
        let Some(Longest { line, .. }) = self.longest(state, tolerance, longest) else {
            return vec![f64::NAN; switches.len()];
        };
        let middle = state.point.x.iter().zip(&line.rates);
        let middle: Vec<f64> = middle.map(|(x, f)| x + 0.5 * line.length * f).collect();
        let mut alpha = line.alpha;
        let at = state.point.t + 0.5 * line.length;
        if self.mode.solve_alpha(at, &middle, &mut alpha).is_err() {
            return vec![f64::NAN; switches.len()];
        }
        let rate = |&i: &usize| {
            self.mode.surfaces.linearize(i, &self.mode.memory.values);
            self.mode.phi(i)
        };
        switches.iter().map(rate).collect()
    }

    /// Takes a straight line as the series of the step.
    pub(crate) fn lay(&mut self, point: &Point, line: &Line) {
        let stride = self.mode.memory.stride;
        let mut set = |start: usize, value: f64, rate: f64| {
            let row = &mut self.mode.memory.rows[start..start + stride];
            row.fill(0.0);
            (row[0], row[1]) = (value, rate);
        };
        set(0, point.t, 1.0);
        for (i, (&x, &rate)) in point.x.iter().zip(&line.rates).enumerate() {
            set((1 + i) * stride, x, rate);
        }
        for &i in &self.mode.sliding {
            set((1 + self.mode.n + i) * stride, line.alpha[i], 0.0);
        }
        for (&row, &rate) in self.mode.field.rows.iter().zip(&line.rates) {
            self.mode.memory.rows[row..row + stride].fill(0.0);
            self.mode.memory.rows[row] = rate;
        }
        self.mode.memory.set(point.t, &point.x, &line.alpha);
    }
}

impl Stepper {
    /// The step off a point at which f has no series.
    pub(crate) fn step_off(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        remaining: f64,
    ) -> Result<Step, Status> {
        let line = self.lay_line(mode, state, remaining)?;
        let (dense, closeness) = (Dense::Taylor(mode), self.tolerance);
        let event = first_event(&mut self.roots, dense, state, line.length, closeness);
        let (length, triggers) = match event {
            Some((root, watch)) => {
                let together =
                    simultaneous(dense, &state.bands, root.tau, line.length, watch.switch());
                (root.tau, together)
            }
            None => (line.length, Few::new()),
        };
        dense.states_at(length, &mut state.trial.x);
        if !state.trial.x.iter().all(|x| x.is_finite()) {
            return Err(Status::NotFinite);
        }
        dense.alphas_at(length, &mut state.point.alpha);
        std::mem::swap(&mut state.point.x, &mut state.trial.x);
        state.scales.last_step = line.length;
        Ok(Step {
            length,
            reaches_end: length >= remaining,
            triggers,
            ..Step::default()
        })
    }

    /// Takes the longest straight line that passes over nothing as the series of the step.
    fn lay_line(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        remaining: f64,
    ) -> Result<Line, Status> {
        let (tolerance, allowed) = (self.local_tolerance, self.allowed_defect(mode));
        let mut longest = remaining;
        for _ in 0..MAX_TRIES {
            let Some(found) = (StraightSteps { mode }).longest(state, tolerance, longest) else {
                break;
            };
            let line = found.line;
            StraightSteps { mode }.lay(&state.point, &line);
            let bands = &mut state.bands;
            Monitor { mode, bands }.watch(tolerance, &state.scales, line.length);
            self.unseen.suspect_all(mode);
            let length = line.length;
            if found.is_shortest
                || (self.unseen).vouches(mode, state, length, allowed, &found.sizes)
            {
                return Ok(line);
            }
            longest = SHORTER * line.length;
        }
        Err(step_failure(mode))
    }
}

/// Whether a series of a state ends at a root: a term is no number, and those below it are moderate, or there are
/// switches with roots, close to which terms grow, too. Close to a pole those below it are not moderate.
pub(crate) fn ends_at_root(mode: &Mode) -> bool {
    let has_roots = mode.system.has_roots();
    let ends = |series: &[f64]| {
        let grows = |c: &&f64| has_roots && c.is_finite();
        let moderate = |c: &&f64| c.abs() < MODERATE || grows(c);
        let first = series.iter().take_while(moderate).count();
        series.get(first).is_some_and(|c| !c.is_finite())
    };
    (0..mode.n).any(|i| ends(mode.x_series(i)))
}

/// Whether the state is on a surface at which rates have roots, but for rounding: then series are numbers that say
/// nothing.
pub(crate) fn is_on_root(mode: &Mode, bands: &Bands) -> bool {
    let mut switches = mode.system.switches.iter().zip(&bands.armed);
    switches.any(|(switch, armed)| switch.has_root && *armed)
}
