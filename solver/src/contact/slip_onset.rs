//! Slip velocities with two entries that set off from rest.
//!
//! Where a contact breaks loose w = 0, and w/|w| is a direction u of its own. With w = τᵐ ρ(τ) u(τ), |u| = 1, both have
//! series: α = ½ + ½ u is what it is while a contact sticks, but
//!
//! φ = w' = m τᵐ⁻¹ ρ u + τᵐ (ρ u)'   instead of   φ = 0.
//!
//! A force that leaves its cone has m = 1, one that grows until it does has m = 2, or more where it touches the cone
//! first: 1 - |u|² of the contact as if it stuck starts with τᵐ⁻¹. Order k of φ has u_k, of which |u| = 1 leaves what
//! is across u₀, and ρ_{k+1-m}: both follow from one linear system. So a first step is as long as these series allow,
//! where one from a tiny w would follow the direction of the forces in steps as tiny, as it does so within |w| over the
//! force. The series need not converge, but their first terms are those of the solution, which the length of the step
//! and its defect take care of.

use super::friction_disc::{Disc, RIM, STOPS, STRAIGHT};
use crate::event::state::State;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::series;
use crate::expansion::step_size::StepSize;
use crate::expansion::taylor::Expansion;
use crate::hybrid::point::Point;
use crate::hybrid::{Few, Side};
use crate::integrate::step::Step;
use crate::integrate::stepper::Stepper;
use crate::integrate::watch::{Watch, first_event};
use crate::linalg::DenseLu;
use crate::selector::selection::{Choice, Onset};

/// Rounds of Newton's method for the direction of a force that leaves its cone.
const ROUNDS: usize = 5;

/// Steps as short as this share of the time that is left may be rounding.
const LEAST: f64 = 1e-6;

/// Halvings of the first step.
const MAX_HALVINGS: usize = 40;

/// The series of a slip velocity with two entries that sets off.
struct Leaving {
    switches: [usize; 2],
    /// m.
    power: usize,
    u: Vec<[f64; 2]>,
    rho: Vec<f64>,
}

impl Leaving {
    /// Whether order k has a term of ρ.
    fn moves(&self, k: usize) -> bool {
        k + 1 >= self.power
    }

    /// What is known of the order k + 1 of w.
    fn known(&self, k: usize) -> [f64; 2] {
        let last = (k + 1).saturating_sub(self.power);
        let first = usize::from(self.power == 1);
        let mut sum = [0.0; 2];
        if self.moves(k) {
            for j in first..last {
                let u = self.u[last - j];
                (0..2).for_each(|e| sum[e] += self.rho[j] * u[e]);
            }
        }
        sum
    }

    /// u₀ᵀ u_k
    fn along(&self, k: usize) -> f64 {
        let terms = (1..k).map(|j| dot(self.u[j], self.u[k - j]));
        -0.5 * terms.sum::<f64>()
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The series of a mode in which slip velocities set off.
pub(crate) struct SlipOnset<'m> {
    mode: &'m mut Mode,
    leaving: Vec<Leaving>,
}

impl SlipOnset<'_> {
    /// Expands x and α of a mode in which slip velocities stick that set off; false where they do not, or where that is
    /// not known.
    pub(crate) fn expand(
        mode: &mut Mode,
        state: &State,
        (alpha, onsets): (&[f64], &[Onset]),
        tolerance: f64,
        longest: f64,
    ) -> bool {
        let mut alpha = alpha.to_vec();
        for onset in onsets {
            for (&i, d) in onset.switches.iter().zip(onset.direction) {
                alpha[i] = 0.5 + 0.5 * d;
            }
        }
        let leaving = Vec::new();
        let mut expansion = SlipOnset { mode, leaving };
        let starts = |one: &Leaving| one.rho.first().is_some_and(|rho| *rho > 0.0);
        expansion
            .powers(state, (&alpha, onsets), tolerance, longest)
            .and_then(|()| expansion.expand_leaving(&state.point, &mut alpha))
            .is_some_and(|()| expansion.leaving.iter().all(starts))
    }

    fn expansion(&mut self) -> Expansion<'_> {
        Expansion { mode: self.mode }
    }

    /// The powers of time that they set off with, from what would hold them.
    fn powers(
        &mut self,
        state: &State,
        (alpha, onsets): (&[f64], &[Onset]),
        tolerance: f64,
        longest: f64,
    ) -> Option<()> {
        let mut held = alpha.to_vec();
        let (t, x) = (state.point.t, &state.point.x);
        self.expansion().around(t, x, &mut held).ok()?;
        let places = 0..self.mode.sliding.len();
        let is_shared =
            |at: usize| self.mode.equations.tie(at).is_some() || self.mode.equations.is_held(at);
        if places.into_iter().any(is_shared) {
            return None;
        }
        let mode = &*self.mode;
        let h = StepSize { mode, tolerance }.of_states(&state.scales, longest);
        let mut margin = Vec::new();
        for &Onset { switches, .. } in onsets {
            Disc::of(Dense::Taylor(self.mode), switches[0])?.margin(&mut margin);
            let (power, start) = if margin[0] < -RIM {
                (1, alpha)
            } else {
                let leading = series::leading(&margin, h, RIM)?;
                if margin[leading] >= 0.0 {
                    return None;
                }
                (leading + 1, &held[..])
            };
            self.leaving.push(Leaving {
                switches,
                power,
                u: vec![switches.map(|i| 2.0 * start[i] - 1.0)],
                rho: Vec::new(),
            });
        }
        Some(())
    }

    fn expand_leaving(&mut self, point: &Point, alpha: &mut [f64]) -> Option<()> {
        for one in &self.leaving {
            for (&i, u) in one.switches.iter().zip(one.u[0]) {
                alpha[i] = 0.5 + 0.5 * u;
            }
        }
        self.direct(point, alpha)?;
        self.expansion().start_series(point.t, &point.x, alpha);
        for k in 1..=self.mode.memory.order {
            self.expansion().advance_field(k);
            self.expansion().raise_states(k);
            self.expansion().equate(k);
            for one in &self.leaving {
                let known = one.known(k);
                for (&i, known) in one.switches.iter().zip(known) {
                    let at = place_of(self.mode, i)?;
                    self.mode.equations.rhs[at] += (k + 1) as f64 * known;
                }
            }
            let ends: Vec<f64> = self.leaving.iter().map(|one| one.along(k)).collect();
            let steps = self.solve_leaving(k, &ends)?;
            for (one, step) in self.leaving.iter_mut().zip(steps) {
                let u = one.switches.map(|i| place_of(self.mode, i));
                let [Some(first), Some(second)] = u else {
                    return None;
                };
                one.u
                    .push([first, second].map(|at| 2.0 * self.mode.equations.rhs[at]));
                if one.moves(k) {
                    one.rho.push(step);
                }
            }
            self.expansion().take_alpha(k);
        }
        if self.mode.planes.slip(&self.mode.system, &self.mode.sides) {
            self.expansion().cut_overflow();
        }
        Some(())
    }

    /// α where they set off: φ = 0 of what goes on to slide, and φ = ρ u of a force that leaves its cone. The matrix of
    /// the equations is that of this place afterwards.
    fn direct(&mut self, point: &Point, alpha: &mut [f64]) -> Option<()> {
        for one in self.leaving.iter_mut().filter(|one| one.power == 1) {
            one.rho.push(f64::NAN);
        }
        for _ in 0..ROUNDS {
            self.mode.eval(point.t, &point.x, alpha);
            self.mode.linearize_surfaces();
            self.mode.factor().ok()?;
            for at in 0..self.mode.sliding.len() {
                self.mode.equations.rhs[at] = -self.mode.phi(self.mode.equations.switches()[at]);
            }
            let mut ends = Vec::new();
            for one in &mut self.leaving {
                if one.power > 1 {
                    ends.push(0.0);
                    continue;
                }
                let rate = one.switches.map(|i| self.mode.phi(i));
                if one.rho[0].is_nan() {
                    one.rho[0] = dot(rate, one.u[0]);
                }
                for (&i, u) in one.switches.iter().zip(one.u[0]) {
                    let at = place_of(self.mode, i)?;
                    self.mode.equations.rhs[at] += one.rho[0] * u;
                }
                ends.push(0.5 * (1.0 - dot(one.u[0], one.u[0])));
            }
            let steps = self.solve_leaving(0, &ends)?;
            for (i, step) in self.mode.equations.solution() {
                alpha[i] += step;
            }
            for (one, step) in self.leaving.iter_mut().zip(steps) {
                one.u[0] = one.switches.map(|i| 2.0 * alpha[i] - 1.0);
                if one.power == 1 {
                    one.rho[0] += step;
                }
            }
        }
        self.mode.eval(point.t, &point.x, alpha);
        self.mode.linearize_surfaces();
        self.mode.factor().ok()?;
        self.mode.equations.expand_here();
        Some(())
    }

    /// Solves A α_k - (k + 1) (ρ u₀ + ρ₀ u_k) = rhs with u₀ᵀ u_k given, where u_k belongs to the same order of w as ρ
    /// does for m = 1 alone. Leaves α_k in the right-hand sides, and returns ρ.
    fn solve_leaving(&mut self, k: usize, ends: &[f64]) -> Option<Vec<f64>> {
        let n = self.mode.equations.switches().len();
        let size = n + self.leaving.len();
        let mut matrix = vec![0.0; size * size];
        for (row, &i) in self.mode.equations.switches().iter().enumerate() {
            for (column, &j) in self.mode.equations.switches().iter().enumerate() {
                matrix[row * size + column] = self.mode.coupling(i, j);
            }
        }
        let order = (k + 1) as f64;
        let mut z = self.mode.equations.rhs.clone();
        for (at, one) in self.leaving.iter().enumerate() {
            let row = n + at;
            z.push(if one.moves(k) { ends[at] } else { 0.0 });
            if !one.moves(k) {
                matrix[row * size + row] = 1.0;
                continue;
            }
            for (&i, u) in one.switches.iter().zip(one.u[0]) {
                let place = place_of(self.mode, i)?;
                matrix[row * size + place] = 2.0 * u;
                matrix[place * size + row] = -order * u;
                if one.power == 1 {
                    matrix[place * size + place] -= 2.0 * order * one.rho[0];
                }
            }
        }
        let mut lu = DenseLu::new(size);
        lu.factor(&matrix).ok()?;
        lu.solve(&mut z);
        self.mode.equations.rhs.copy_from_slice(&z[..n]);
        Some(z[n..].to_vec())
    }
}

/// Where a sliding switch is among the equations.
fn place_of(mode: &Mode, switch: usize) -> Option<usize> {
    let mut switches = mode.equations.switches().iter();
    switches.position(|&i| i == switch)
}

impl Onset {
    /// The switches of a group that slip from where they may be at rest, with their directions.
    pub(crate) fn all(mode: &Mode, point: &Point, group: &[usize], choice: &Choice) -> Vec<Onset> {
        let mut found = Vec::new();
        let sides = point.sides_with(group, &choice.sides);
        for (at, &i) in group.iter().enumerate() {
            let Some(other) = mode.system.second(i) else {
                continue;
            };
            let Ok(of_other) = group.binary_search(&other) else {
                continue;
            };
            let meets = mode.system.slip_of(i).is_none_or(|of| group.contains(&of));
            if meets && has_friction(mode, i, &sides) && choice.sides[at] != Side::Slide {
                let entry = |at: usize| 2.0 * choice.alpha[at] - 1.0;
                let straight = |u: f64| if u.abs() <= STRAIGHT { 0.0 } else { u };
                found.push(Onset {
                    switches: [i, other],
                    direction: [at, of_other].map(|at| straight(entry(at))),
                });
            }
        }
        found
    }

    /// Takes the functions in which these slip velocities stick.
    pub(crate) fn hold(onsets: &[Onset], mode: &mut Mode, sides: &[Side]) {
        let mut held: Few<Side> = sides.into();
        for i in onsets.iter().flat_map(|one| one.switches) {
            held[i] = Side::Slide;
        }
        mode.enter(&held);
    }
}

/// Whether a slip velocity has friction on these sides: its contact is closed, or, without a contact, rates read its α.
fn has_friction(mode: &Mode, switch: usize, sides: &[Side]) -> bool {
    match mode.system.slip_of(switch) {
        Some(of) => sides[of] == Side::Slide,
        None => !mode.system.switches[switch].is_free(sides),
    }
}

impl Stepper {
    /// The first step after slip onset, by the series w = τᵐ ρ u of the header. None if there is no onset here, or if
    /// the series give no step: then x is changed so that w = ε u, with ε as small as rounding, for an ordinary step.
    pub(crate) fn slip_onset_step(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        goal: f64,
        t1: f64,
    ) -> Option<Step> {
        let mut onsets = std::mem::take(&mut state.selection.onsets);
        mode.move_to(&state.point);
        // An onset has friction, both switches are off their surfaces, and w = 0 up to rounding.
        let (sides, width) = (&state.point.sides, &state.bands.width);
        onsets.retain(|onset| {
            let has_friction = has_friction(mode, onset.switches[0], sides);
            let mut starts =
                |i: usize| sides[i] != Side::Slide && mode.psi(i).abs() <= STOPS * width[i];
            has_friction && onset.switches.into_iter().all(&mut starts)
        });
        if onsets.is_empty() {
            return None;
        }
        // The series are those of the sticking mode, α = ½ + ½ u, with another φ.
        Onset::hold(&onsets, mode, &state.point.sides);
        let step = self.step_from_rest(mode, state, &onsets, goal, t1);
        mode.planes.onsets.clear();
        if step.is_none() {
            let mut x = state.point.x.clone();
            for onset in &onsets {
                onset.nudge(mode, &state.point, &state.scales, &mut x, t1);
            }
            state.point.x = x;
            mode.enter(&state.point.sides);
        }
        step
    }

    fn step_from_rest(
        &mut self,
        mode: &mut Mode,
        state: &mut State,
        onsets: &[Onset],
        goal: f64,
        t1: f64,
    ) -> Option<Step> {
        let (order, tolerance) = (mode.memory.order, self.local_tolerance);
        let remaining = state.point.remaining(goal);
        mode.monitored.unobserved.clear();
        let longest = t1 - state.point.t;
        if !SlipOnset::expand(
            mode,
            state,
            (&state.point.alpha, onsets),
            tolerance,
            longest,
        ) {
            return None;
        }
        state.scales.measure(mode, &mut state.bands);
        state.report.stats.rhs_evaluations += 2 * order;
        mode.planes.onsets = onsets.iter().flat_map(|one| one.switches).collect();
        let allowed = self.allowed_defect(mode);
        let h = StepSize { mode, tolerance }.of_states(&state.scales, remaining);
        // Rounding in the last terms of what does not move at all shows no length: then the defect does, which allows
        // more than those terms.
        let mut is_shown = h > LEAST * remaining;
        let h = if is_shown { h } else { remaining };
        let bands = &mut state.bands;
        let h = Monitor { mode, bands }.watch(tolerance, &state.scales, h);
        let mut h = self.coefficients.expand(mode, tolerance, h);
        for _ in 0..MAX_HALVINGS {
            if h < remaining && state.point.t + h <= state.point.t {
                return None;
            }
            // What happens on the way is left to the steps behind this one.
            let dense = Dense::Taylor(mode);
            let event = first_event(&mut self.roots, dense, state, h, self.tolerance);
            // What leaves its rim at the same instant sets off together with this.
            if let Some((root, watch @ Watch::Disc(_))) = event
                && state.point.t + root.tau <= state.point.t
            {
                state.selection.onsets = onsets.to_vec();
                return Some(Step {
                    departs: true,
                    ..Step::at_once(watch.switch())
                });
            }
            let left = self.coefficients.leave(&mut self.roots, mode, h);
            let defect = self.probes.defect(mode, state, h, tolerance, allowed);
            let is_accurate = defect.rate <= allowed && defect.switches_agree;
            let is_seen = !state.bands.leave_behind(mode);
            let looked = self.coefficients.agree(mode, state, h, allowed);
            let passes = event.is_none() && left.is_none() && is_accurate && is_seen && looked;
            if passes && is_shown {
                if !arrive_slipping(mode, state, h) {
                    return None;
                }
                return Some(Step {
                    length: h,
                    reaches_end: h >= remaining,
                    defect: defect.rate,
                    departs: true,
                    ..Step::default()
                });
            }
            is_shown |= passes;
            state.report.stats.rejected += 1;
            h *= 0.5;
        }
        None
    }
}

/// Moves to the end of a step whose slip velocities set off, which do not stick any more there; false where the end is
/// not finite.
fn arrive_slipping(mode: &Mode, state: &mut State, h: f64) -> bool {
    let dense = Dense::Taylor(mode);
    dense.states_at(h, &mut state.trial.x);
    if !state.trial.x.iter().all(|x| x.is_finite()) {
        return false;
    }
    std::mem::swap(&mut state.point.x, &mut state.trial.x);
    dense.alphas_at(h, &mut state.point.alpha);
    for &i in &mode.planes.onsets {
        state.point.alpha[i] = 1.0;
    }
    state.scales.last_step = h;
    true
}
