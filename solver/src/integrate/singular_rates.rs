//! Switches whose rates have powers of ψ without a derivative at ψ = 0.
//!
//! With ψ' = φ₀(t, x) + c |ψ|^p near a surface, the root has no part in what happens where φ₀ ≠ 0: the surface is
//! crossed. Where φ₀ = 0, c and the first derivative of φ₀ that is not zero decide. A root *attracts* from a side if it
//! takes ψ back to zero, in finite time where p < 1, and *repels* if it takes ψ away:
//!
//! - φ₀ stays zero and no root repels: ψ stays zero, and no other solution leaves it, since f satisfies a one-sided
//!   Lipschitz condition there. The switch *rests*: its side is `Slide`, without an equation for α. An empty tank.
//! - φ₀ stays zero and a root with p < 1 repels: ψ = 0 is one solution, and another one leaves it at once, or at any
//!   later time, as for x' = √|x|.
//! - φ₀ grows to one side: ψ goes there, against a root that attracts or with one that repels. Where a root on the other
//!   side repels there may be solutions that go there as well.
//!
//! φ₀ is the rate where the switch is on `Slide`, in which there are no roots.

use super::singular::{Line, StraightSteps};
use super::step::{Step, step_failure};
use crate::event::state::State;
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::expansion::monitor::Monitor;
use crate::expansion::scales::{BAND, Bands, Scales};
use crate::expansion::series;
use crate::expansion::step_size::StepSize;
use crate::expansion::taylor::Expansion;
use crate::hybrid::{Settings, Side, Status};

/// How far from the surface a root is looked at, relative to the size of ψ, and how much closer again.
const NEAR: f64 = 1e-6;
const CLOSER: f64 = 1.0 / 16.0;

/// The same where ψ has no size yet.
const NEAR_ZERO: f64 = 1e-12;

/// How many times its band a switch that comes back to its surface must leave it.
const BEYOND: f64 = 4.0;

/// What crosses a surface ever more slowly has at most this share of its speed the time before.
const SHRINKS: f64 = 0.9;

/// Powers above this have a derivative, or nearly so: nothing leaves zero by them, or comes there, soon.
const STEEP: f64 = 0.97;

/// ψ above this many local tolerances is seen in spite of the errors of steps: one of them changes it by a thousandth at
/// most, and a root of it by less. Else steps are as long as this share of what its series shows as its radius of
/// convergence, so that the first term left out of a series of order n is 2⁻ⁿ of ψ.
const VISIBLE: f64 = 1e3;
const WITHIN: f64 = 0.5;

/// How many times as large an implicit step may make a ψ that is not seen: with √ψ, the slope of the root at its end is
/// half of that at its start, with which Newton's method contracts by 1/2.
const OUTGROWN: f64 = 4.0;

/// Moves of a point by roundings until ψ has the sign of its side.
const MAX_MOVES: usize = 4;

/// A smooth rate below this share of the whole has no part in it.
const SMALL: f64 = 0.01;

/// Roundings of the terms of a rate.
const ROUNDINGS: f64 = 64.0 * f64::EPSILON;

/// A switch that comes to rest by infinitely many crossings, at once but for less than the tolerance.
pub(crate) struct Settling {
    pub switch: usize,
    /// What the states move by until then, beside what they do with the switch at rest.
    pub moves: Vec<f64>,
}

/// Switches whose rates have roots of their ψ, in a mode.
pub(crate) struct Roots<'m> {
    pub mode: &'m mut Mode,
}

impl Roots<'_> {
    /// Whether a switch that rests would leave its surface within a step h, because something has changed since.
    pub(crate) fn wakes(&mut self, bands: &mut Bands, h: f64) -> Option<usize> {
        let rests =
            |i: &usize| self.mode.system.switches[*i].rests() && self.mode.sides[*i] == Side::Slide;
        let resting: Vec<usize> = (0..self.mode.sides.len()).filter(rests).collect();
        resting.into_iter().find(|&i| {
            let mode = &mut *self.mode;
            Monitor { mode, bands }.expand(i);
            let c = self.mode.psi_series(i);
            series::leading(c, h, bands.level(i, c, h)).is_some()
        })
    }

    /// The nearest place at which ψ is zero.
    pub(crate) fn onto_surface(&mut self, state: &State, switch: usize) -> Vec<f64> {
        self.mode.move_to(&state.point);
        self.mode
            .surfaces
            .linearize(switch, &self.mode.memory.values);
        let psi = self.mode.psi(switch);
        let across = across_surface(self.mode, switch, &state.scales);
        let moved = state.point.x.iter().zip(across);
        moved.map(|(x, d)| x - psi * d).collect()
    }

    /// Moves a point at which a switch leaves its rest to a side off the other one, where rounding has put it: the root is
    /// odd in ψ to the mode of the side, and what attracts on its own side repels on the other.
    pub(crate) fn leave_rest(&mut self, state: &mut State, switch: usize, side: Side) {
        let mut share = 1.0;
        for _ in 0..MAX_MOVES {
            self.mode.move_to(&state.point);
            let psi = self.mode.psi(switch);
            if psi * side.sign() >= 0.0 {
                break;
            }
            self.mode
                .surfaces
                .linearize(switch, &self.mode.memory.values);
            let across = across_surface(self.mode, switch, &state.scales);
            let moved = state.point.x.iter_mut().zip(across);
            moved.for_each(|(x, d)| *x -= share * psi * d);
            share *= 2.0;
        }
    }

    /// φ at a point.
    fn rate_from(&mut self, switch: usize, t: f64, x: &[f64], alpha: &[f64]) -> f64 {
        let mut alpha = alpha.to_vec();
        if self.mode.solve_alpha(t, x, &mut alpha).is_err() {
            return f64::NAN;
        }
        self.mode
            .surfaces
            .linearize(switch, &self.mode.memory.values);
        self.mode.phi(switch)
    }

    /// What roots add to φ at a displacement of ψ by `by` from where the state is, on the side of that.
    pub(crate) fn root_at(&mut self, state: &State, switch: usize, by: f64) -> f64 {
        let mut sides = state.point.sides_sliding(&[switch]);
        self.mode.enter(&sides);
        self.mode.move_to(&state.point);
        self.mode
            .surfaces
            .linearize(switch, &self.mode.memory.values);
        let across = across_surface(self.mode, switch, &state.scales);
        let moved = state.point.x.iter().zip(&across);
        let moved: Vec<f64> = moved.map(|(x, d)| x + by * d).collect();
        let smooth = self.rate_from(switch, state.point.t, &moved, &state.point.alpha);
        sides[switch] = Side::of(by);
        self.mode.enter(&sides);
        let mut alpha = state.point.alpha.clone();
        alpha[switch] = f64::from(u8::from(by > 0.0));
        self.rate_from(switch, state.point.t, &moved, &alpha) - smooth
    }
}

/// Decides switches whose rates have roots of their ψ, and which may come to rest on their surface.
pub(crate) struct Rest<'a> {
    mode: &'a mut Mode,
    settings: &'a Settings,
}

impl<'a> Rest<'a> {
    /// In a mode, as the settings of a run say.
    pub(crate) fn new(mode: &'a mut Mode, settings: &'a Settings) -> Self {
        Rest { mode, settings }
    }

    /// Whether a switch on its surface rests, or to which side it goes.
    pub(crate) fn decide(
        &mut self,
        state: &mut State,
        switch: usize,
        wanted: Option<Side>,
        t1: f64,
    ) -> Result<Side, Status> {
        let drift = self.drift(state, switch, t1)?;
        let leaves = match drift {
            Some((1, side)) => return Ok(side),
            drift => drift.map(|(_, side)| side),
        };
        let first = leaves.unwrap_or(Side::Slide);
        let mut ways = vec![first];
        for side in [Side::Minus, Side::Plus] {
            if side != first && self.repels(state, switch, side) {
                ways.push(side);
            }
        }
        match wanted.filter(|side| ways.contains(side)) {
            Some(side) => Ok(side),
            None if ways.len() == 1 => Ok(first),
            None => {
                let named = ways.into_iter().map(|side| vec![(switch, side)]);
                Err(Status::NonUnique(named.collect()))
            }
        }
    }

    /// The order and the side of the first term of ψ along the motion without its roots; none where ψ stays zero.
    fn drift(
        &mut self,
        state: &mut State,
        switch: usize,
        t1: f64,
    ) -> Result<Option<(usize, Side)>, Status> {
        let sides = state.point.sides_sliding(&[switch]);
        let tolerance = self.settings.local_tolerance();
        let mode = &mut self.mode;
        mode.enter(&sides);
        let mut alpha = state.point.alpha.clone();
        let expanded = Expansion { mode }.around(state.point.t, &state.point.x, &mut alpha);
        if expanded.is_err() {
            return Err(step_failure(mode));
        }
        let is_smooth = Expansion { mode }.cut_short(usize::MAX);
        state.scales.measure(mode, &mut state.bands);
        mode.monitored.switches.clear();
        let bands = &mut state.bands;
        Monitor { mode, bands }.expand(switch);
        mode.monitored.switches.push(switch);
        let step_size = StepSize { mode, tolerance };
        let h = step_size.of_states(&state.scales, t1 - state.point.t);
        let h = step_size.of_psi(&state.bands, h);
        let c = mode.psi_series(switch);
        if let Some(k) = series::leading(c, h, state.bands.level(switch, c, h)) {
            return Ok(Some((k, Side::of(c[k]))));
        }
        if is_smooth {
            return Ok(None);
        }
        // What drives it has no series either: its rate a moment later tells.
        let left = t1 - state.point.t;
        let found = StraightSteps { mode }.longest(state, tolerance, left);
        let Some(Line { length, rates, .. }) = found.map(|found| found.line) else {
            return Err(step_failure(mode));
        };
        let ahead = state.point.x.iter().zip(&rates);
        let ahead: Vec<f64> = ahead.map(|(x, f)| x + length * f).collect();
        let at = state.point.t + length;
        let rate = Roots { mode }.rate_from(switch, at, &ahead, &alpha);
        let is_seen = rate.abs() > ROUNDINGS * mode.terms_of_phi(switch);
        Ok(is_seen.then_some((2, Side::of(rate))))
    }

    /// Whether a root takes ψ away from zero to this side, in finite time.
    fn repels(&mut self, state: &State, switch: usize, side: Side) -> bool {
        let near = match state.bands.width[switch] {
            0.0 => NEAR_ZERO,
            band => NEAR / BAND * band,
        };
        let mut roots = Roots { mode: self.mode };
        let far = roots.root_at(state, switch, near * side.sign());
        let close = roots.root_at(state, switch, CLOSER * near * side.sign());
        far * side.sign() > 0.0 && is_steep(close / far)
    }

    /// Switches of a group that come to a lasting rest here, but for less than the tolerance, and what they change in
    /// the states until then.
    ///
    /// With ψ' = w + c |ψ|^p sign ψ and w' = a₊ < 0 above and a₋ > 0 below the surface, ψ goes away from it by w²/(2|a|)
    /// and comes back. Where the root attracts, w is less every time, and ψ = w = 0 is reached in finite time: at last
    /// by steps whose errors are as large as ψ. Beside α at rest, which keeps w where it is, that takes
    ///
    /// ∫ δα dt = -w / (∂w'/∂α),   δx = ∂f/∂α ∫ δα dt.
    pub(crate) fn settling(&mut self, state: &mut State, group: &[usize]) -> Vec<Settling> {
        let is_one = |i: &usize| {
            self.mode.system.switches[*i].has_root && self.mode.surfaces.n_derivatives(*i) == 1
        };
        let roots: Vec<usize> = group.iter().copied().filter(is_one).collect();
        let roots = roots.into_iter();
        roots.filter_map(|i| self.settles(state, i)).collect()
    }

    fn settles(&mut self, state: &mut State, switch: usize) -> Option<Settling> {
        let mut sides = state.point.sides_sliding(&[switch]);
        let mode = &mut self.mode;
        mode.enter(&sides);
        let mut alpha = state.point.alpha.clone();
        let [(below, minus), (above, plus)] = [0.0, 1.0].map(|value| {
            alpha[switch] = value;
            mode.eval(state.point.t, &state.point.x, &alpha);
            mode.linearize(&[switch]);
            (mode.phi(switch), mode.field.f.clone())
        });
        let speed = mode.psi(switch);
        let way = usize::from(speed > 0.0);
        state.bands.crossed[switch][way] = speed.abs();
        let before = state.bands.crossed[switch][1 - way];
        if !(above < 0.0 && below > 0.0 && speed.abs() <= SHRINKS * before) {
            return None;
        }
        mode.surfaces.stand_for(switch, 0);
        mode.surfaces.linearize(switch, &mode.memory.values);
        let size = mode.surfaces.weigh(switch, |j| state.scales.size(j));
        let near = (self.settings.settled() * size).max(BEYOND * state.bands.width[switch]);
        if speed * speed > 2.0 * near * below.min(-above) {
            return None;
        }
        let across = across_surface(mode, switch, &state.scales);
        let attracts = [Side::Minus, Side::Plus].into_iter().all(|side| {
            sides[switch] = side;
            alpha[switch] = f64::from(u8::from(side == Side::Plus));
            self.mode.enter(&sides);
            let moved = state.point.x.iter().zip(&across);
            let moved: Vec<f64> = moved.map(|(x, d)| x + side.sign() * near * d).collect();
            let mut roots = Roots { mode: self.mode };
            let rate = roots.rate_from(switch, state.point.t, &moved, &alpha);
            (rate - speed) * side.sign() < 0.0
        });
        let by_alpha = plus.iter().zip(&minus).map(|(plus, minus)| plus - minus);
        let moves = by_alpha.map(|slope| -slope * speed / (above - below));
        attracts.then(|| Settling {
            switch,
            moves: moves.collect(),
        })
    }
}

/// A displacement of the states that moves ψ by one, where it was last linearized.
fn across_surface(mode: &Mode, switch: usize, scales: &Scales) -> Vec<f64> {
    let mut d = vec![0.0; mode.n];
    let size = |j: usize| match scales.size(j) {
        0.0 => 1.0,
        size => size,
    };
    let square = |&(j, g): &(usize, f64)| (g * size(j)).powi(2);
    let sum: f64 = mode.surfaces.gradient(switch).iter().map(square).sum();
    if sum > 0.0 {
        for &(j, g) in mode.surfaces.gradient(switch) {
            d[j] = g * size(j).powi(2) / sum;
        }
    }
    d
}

/// The end of a way to a surface on which a switch will rest, from where it is on it but for rounding: there
/// ψ' = c |ψ|^p takes |ψ| / ((1 - p) |ψ'|), over which the root is 1 - p times what it is now in the mean.
pub(crate) fn arrive(mode: &mut Mode, state: &mut State, remaining: f64) -> Option<Step> {
    for i in 0..state.point.sides.len() {
        let side = state.point.sides[i];
        if !mode.system.switches[i].rests() || side == Side::Slide || state.bands.armed[i] {
            continue;
        }
        let (t, x) = (state.point.t, state.point.x.clone());
        mode.memory.set(t, &x, &state.point.alpha);
        state.bands.width[i] = BandWidths { mode }.of(i, state, remaining);
        let psi = mode.psi(i);
        if psi.abs() > state.bands.width[i] {
            continue;
        }
        let rate = Roots { mode }.rate_from(i, t, &x, &state.point.alpha);
        let f = mode.field.f.clone();
        if rate * side.sign() >= 0.0 {
            continue;
        }
        let sides = state.point.sides_sliding(&[i]);
        mode.enter(&sides);
        let smooth = Roots { mode }.rate_from(i, t, &x, &state.point.alpha);
        let at_rest = mode.field.f.clone();
        mode.enter(&state.point.sides);
        let closer = CLOSER * psi - psi;
        let ratio = (Roots { mode }.root_at(state, i, closer)) / (rate - smooth);
        mode.enter(&state.point.sides);
        if smooth.abs() > SMALL * rate.abs() {
            continue;
        }
        let rest = 1.0 + ratio.ln() / -CLOSER.ln();
        let length = psi.abs() / (rest * rate.abs());
        if !is_steep(ratio) || length > remaining || t + length <= t {
            return Some(Step::at_once(i));
        }
        let mean = f.iter().zip(&at_rest);
        let line = Line {
            length,
            rates: mean
                .map(|(f, smooth)| smooth + rest * (f - smooth))
                .collect(),
            alpha: state.point.alpha.clone(),
        };
        StraightSteps { mode }.lay(&state.point, &line);
        mode.monitored.switches.clear();
        for (x, rate) in state.point.x.iter_mut().zip(&line.rates) {
            *x += length * rate;
        }
        return Some(Step {
            length,
            reaches_end: length >= remaining,
            ..Step::at_once(i)
        });
    }
    None
}

/// How long a step h may be where a switch with roots is so close to its surface that ψ is no more than what errors of a
/// step leave of it: no longer than its series holds, or errors keep ψ where it is.
pub(crate) fn within_root(mode: &Mode, state: &State, tolerance: f64, h: f64) -> f64 {
    let monitored = mode.monitored.switches.iter();
    let rooted = monitored.filter(|&&i| mode.system.switches[i].rests());
    rooted.fold(h, |h, &i| {
        let c = &mode.psi_series(i)[..=mode.memory.order];
        let size = mode.surfaces.weigh(i, |j| state.scales.size(j));
        if c[0] == 0.0 || c[0].abs() > VISIBLE * tolerance * size {
            return h;
        }
        let last = (mode.memory.order - 2..=mode.memory.order).filter(|&k| c[k] != 0.0);
        let radii = last.map(|k| (c[0] / c[k]).abs().powf(1.0 / k as f64));
        h.min(WITHIN * radii.fold(f64::INFINITY, f64::min))
    })
}

/// Switches with roots that are off their surface by less than is seen where the point is, and |ψ|.
pub(crate) fn unseen_roots(
    mode: &mut Mode,
    state: &State,
    tolerance: f64,
    unseen: &mut Vec<(usize, f64)>,
) {
    unseen.clear();
    for i in 0..mode.sides.len() {
        if !mode.system.switches[i].rests() || mode.sides[i] == Side::Slide {
            continue;
        }
        mode.move_to(&state.point);
        mode.surfaces.linearize(i, &mode.memory.values);
        let size = mode.surfaces.weigh(i, |j| state.scales.size(j));
        let psi = mode.psi(i).abs();
        if psi <= VISIBLE * tolerance * size {
            unseen.push((i, psi));
        }
    }
}

/// Whether one of them has grown so much where the mode was evaluated that the slope of its root is another one.
/// Newton's method takes it to be the one at the start of a step, k p ψᵖ⁻¹, and where that is too steep its first
/// correction is below the tolerance however far the solution is.
pub(crate) fn outgrows(mode: &mut Mode, unseen: &[(usize, f64)]) -> bool {
    let mut grown = unseen.iter();
    grown.any(|&(i, psi)| mode.psi(i).abs() > OUTGROWN * psi)
}

/// Whether a root with these values closer to zero and farther from it has a power p < 1.
fn is_steep(ratio: f64) -> bool {
    ratio > CLOSER.powf(STEEP)
}
