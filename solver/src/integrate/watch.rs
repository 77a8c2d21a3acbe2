//! Events within a step: the least root of what is monitored, and the switches that it is of.

use super::step::step_failure;
use crate::contact::friction_disc;
use crate::contact::friction_disc::Disc;
use crate::event::state::State;
use crate::events::bands::rounding_of_motion;
use crate::events::grazing::Grazing;
use crate::events::roots::{Root, RootFinder};
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{BAND, Bands, TIE};
use crate::expansion::series;
use crate::hybrid::{Few, Status};

/// What is monitored for a root: ψ off the surface, α and 1 - α on it.
#[derive(Clone, Copy)]
pub(crate) enum Watch {
    Surface(usize),
    /// Switch and the bound 0 or 1.
    Bound(usize, f64),
    /// The first of two entries of a slip velocity that stick: 1 - |2α - 1|².
    Disc(usize),
}

impl Watch {
    pub(crate) fn switch(self) -> usize {
        match self {
            Watch::Surface(i) | Watch::Bound(i, ..) | Watch::Disc(i) => i,
        }
    }

    /// Whether a slip velocity with two entries stops: it has no sign behind that.
    pub(crate) fn stops(self, mode: &Mode) -> bool {
        matches!(self, Watch::Surface(i) if mode.system.switches[i].is_in_disc())
    }

    /// Whether a contact opens that sticks to the end: a force that is zero has no friction to be determined.
    pub(crate) fn lets_go(self, mode: &Mode) -> bool {
        let Watch::Bound(normal, _) = self else {
            return false;
        };
        let mut sliding = mode.sliding.iter();
        sliding.any(|&i| mode.system.slip_of(i) == Some(normal))
    }

    /// Moves a root of the series to the root of the function itself, by Newton's method on
    /// the length of the step.
    pub(crate) fn polish(
        self,
        mode: &mut Mode,
        state: &mut State,
        mut tau: f64,
        h: f64,
    ) -> Result<f64, Status> {
        for _ in 0..4 {
            Dense::Taylor(mode).states_at(tau, &mut state.trial.x);
            Dense::Taylor(mode).alphas_at(tau, &mut state.trial.alpha);
            let (value, slope) = match self {
                Watch::Surface(i) => {
                    mode.memory
                        .set(state.point.t + tau, &state.trial.x, &state.trial.alpha);
                    (mode.psi(i), series::slope(mode.psi_series(i), tau))
                }
                Watch::Bound(..) | Watch::Disc(_) => {
                    let singular = mode
                        .solve_alpha(state.point.t + tau, &state.trial.x, &mut state.trial.alpha)
                        .is_err();
                    if singular && self.lets_go(mode) {
                        break;
                    }
                    if singular {
                        return Err(step_failure(mode));
                    }
                    match self {
                        Watch::Bound(i, limit) => (
                            state.trial.alpha[i] - limit,
                            series::slope(mode.alpha_series(i), tau),
                        ),
                        _ => {
                            let disc = Disc::of(Dense::Taylor(mode), self.switch());
                            let disc = disc.expect("it has two entries");
                            disc.margin_at(tau, &state.trial.alpha)
                        }
                    }
                }
            };
            let next = tau - value / slope;
            // A root that the function and its series do not share is a tangency: keep the series'.
            if !next.is_finite() || next < 0.0 || (next - tau).abs() > 1e-3 * h {
                break;
            }
            // Where the surface has just been left, a value that is rounding says nothing of the root.
            if let Watch::Surface(i) = self
                && state.bands.armed[i]
                && value.abs() <= 8.0 * f64::EPSILON * state.bands.terms[i]
            {
                break;
            }
            let moved = (next - tau).abs();
            tau = next.min(h);
            if moved <= f64::EPSILON * (state.point.t.abs() + tau) {
                break;
            }
        }
        Ok(tau)
    }
}

/// The surface that an event meets, and how.
pub(crate) fn met(event: Option<(Root, Watch)>) -> Option<(usize, Root)> {
    match event {
        Some((root, Watch::Surface(switch))) => Some((switch, root)),
        _ => None,
    }
}

/// The least root of everything monitored in (0, h]. Takes note of each ψ that turns back before as close
/// to zero as a run of this tolerance may be on either side.
pub(crate) fn first_event(
    roots: &mut RootFinder,
    dense: Dense,
    state: &mut State,
    h: f64,
    tolerance: f64,
) -> Option<(Root, Watch)> {
    let mut first: Option<(Root, Watch)> = None;
    let mode = dense.mode();
    let grazing = Grazing::new(dense, tolerance);
    state.approaches.close.clear();
    for &i in &mode.sliding {
        if mode.planes.onsets.contains(&i) {
            continue;
        }
        let alpha = dense.alpha(i);
        let reach = first.map_or(h, |(root, _)| root.tau);
        let mut margin = std::mem::take(&mut roots.margin);
        let disc = Disc::of(dense, i);
        if let Some(root) = disc.and_then(|disc| disc.leaves(roots, &mut margin, reach)) {
            first = Some((root, Watch::Disc(i)));
        }
        roots.margin = margin;
        for &limit in mode.system.switches[i].limits() {
            let reach = first.map_or(h, |(root, _)| root.tau);
            let inside = if limit == 0.0 { 1.0 } else { -1.0 };
            let start = alpha[0] - limit;
            let band = (start.abs() <= TIE).then_some(TIE);
            if let Some(root) = roots.first_from(start, alpha, reach, inside, band, 0.0) {
                first = Some((root, Watch::Bound(i, limit)));
            }
        }
    }
    for &i in &mode.monitored.switches {
        let reach = first.map_or(h, |(root, _)| root.tau);
        let c = dense.psi(i);
        // Contacts close where they open by less than their band.
        let band = state.bands.armed[i].then(|| match mode.system.switches[i].is_plain() {
            true => rounding_of_motion(mode, i, state, h),
            false if mode.system.switches[i].is_contact() => state.bands.level(i, c, h),
            false => SEEN * state.bands.level(i, c, h),
        });
        let level = match mode.system.switches[i].is_in_disc() {
            true => 0.0,
            false => grazing.closeness(i, &state.scales, &state.bands, h),
        };
        let root = roots.first_from(c[0], c, reach, mode.sides[i].sign(), band, level);
        state
            .approaches
            .close
            .extend(roots.close.iter().map(|&tau| (i, tau)));
        if let Some(root) = root {
            first = Some((root, Watch::Surface(i)));
        }
    }
    first
}

/// The fraction of its band that ψ must leave between two events to have been there: sixteen roundings of
/// its terms.
const SEEN: f64 = 16.0 * f64::EPSILON / BAND;

/// A root at the very start is rounding, or a switch that was missed.
pub(crate) fn verify_start(
    dense: Dense,
    bands: &Bands,
    tau: f64,
    watch: Watch,
    h: f64,
) -> Result<(), Status> {
    if let (Watch::Surface(switch), 0.0) = (watch, tau) {
        let c = dense.psi(switch);
        let rounding = bands.width[switch].max(64.0 * f64::EPSILON * bands.terms[switch]);
        if c[0].abs() > rounding.max(1e-9 * series::magnitude(c, h, 0)) {
            return Err(Status::MissedSwitch { switch });
        }
    }
    Ok(())
}

/// `trigger` and every other switch whose own event is not told apart from it.
pub(crate) fn simultaneous(
    dense: Dense,
    bands: &Bands,
    tau: f64,
    h: f64,
    trigger: usize,
) -> Few<usize> {
    let mode = dense.mode();
    let together = |&i: &usize| {
        let alpha = series::value(dense.alpha(i), tau);
        Disc::of(dense, i).is_some_and(|disc| disc.is_at_rim(tau))
            || (mode.system.switches[i].limits().iter())
                .any(|limit| (alpha - limit).abs() <= TOGETHER)
    };
    let mut triggers: Few<usize> = mode.sliding.iter().copied().filter(together).collect();
    let reached = |&i: &usize| {
        let c = dense.psi(i);
        let size = match mode.system.switches[i].is_in_disc() {
            true => friction_disc::STOPS * bands.width[i],
            false => TOGETHER * series::magnitude(c, h, 0),
        };
        !bands.armed[i] && series::value(c, tau).abs() <= size
    };
    triggers.extend(mode.monitored.switches.iter().copied().filter(reached));
    triggers.push(trigger);
    triggers.sort_unstable();
    triggers.dedup();
    triggers
}

/// Events closer than this, relative to the size of ψ in the step, are one.
pub(crate) const TOGETHER: f64 = 1e-12;

/// An event that is closer to the end of a step, as a fraction of the step, may be there.
const NEAR: f64 = 1e-6;

/// True when an event at `tau` is not told apart from the end of its step `h`.
pub(crate) fn is_at_end(dense: Dense, tau: f64, h: f64, watch: Watch) -> bool {
    let at_end = match watch {
        Watch::Surface(i) => {
            let c = dense.psi(i);
            series::value(c, h).abs() <= TOGETHER * series::magnitude(c, h, 0)
        }
        Watch::Bound(i, limit) => (series::value(dense.alpha(i), h) - limit).abs() <= TOGETHER,
        Watch::Disc(_) => false,
    };
    at_end && h - tau <= NEAR * h
}
