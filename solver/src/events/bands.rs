//! Where ψ counts as zero: the bands around the surfaces of a system.

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{AT_START, BAND, LEFT};
use crate::hybrid::SwitchKind;
use crate::hybrid::point::Point;

/// Roundings of the terms of a switch later than where a run starts: x has more, of the step to it or of a law.
const LATER: f64 = 4.0;

/// A contact knows its states as well as their size where that is no more than so many times how far they have moved:
/// four bits less of the motion than of the states (chosen by trial).
const FAR: f64 = 16.0;

/// A gap below this share of the motion of gaps does not show in a run (chosen by trial).
const SHARE_AT_START: f64 = 1e-6;

/// Measures bands in a mode.
pub(crate) struct BandWidths<'m> {
    pub mode: &'m mut Mode,
}

impl BandWidths<'_> {
    /// Below what |ψ| is the surface, where the point is. The switch stands for ψ afterwards.
    pub(crate) fn of(&mut self, switch: usize, state: &State, horizon: f64) -> f64 {
        let rounding = self.rounding(switch, state);
        self.width(rounding, switch, state, horizon)
    }

    /// The same of a ψ that is linearized: max(k · rounding, BAND (Σ |∂ψ/∂x_j| s_j + |∂ψ/∂t| T)), where k, the sizes
    /// s_j of states and the time T depend on the kind of the switch.
    fn width(&self, rounding: f64, switch: usize, state: &State, horizon: f64) -> f64 {
        let by_time = self.mode.surfaces.time_gradient(switch).abs();
        let given = |size: f64| BAND * (size + by_time * horizon);
        match self.mode.system.switches[switch].kind {
            SwitchKind::Equation | SwitchKind::Member(_) => {
                // What algebraic states balance is known to its rounding, however large it is.
                let size = self.mode.surfaces.weigh(switch, |j| state.scales.reach(j));
                (LATER * rounding).max(given(size))
            }
            SwitchKind::Unilateral if !state.selection.begun => {
                let size = self.mode.surfaces.weigh(switch, |j| state.scales.size(j));
                (AT_START * rounding).max(given(size).min(state.bands.most_at_start))
            }
            SwitchKind::Unilateral | SwitchKind::Slip { of: Some(_), .. } => {
                let size = |j: usize| state.scales.reach(j).min(FAR * state.scales.motion(j));
                let size = self.mode.surfaces.weigh(switch, size);
                (LATER * rounding).max(given(size))
            }
            _ if !state.selection.begun => AT_START * rounding,
            _ => {
                let motion = self.mode.surfaces.weigh(switch, |j| state.scales.motion(j));
                (LATER * rounding).max(BAND * (motion + by_time * state.point.t.abs()))
            }
        }
    }

    /// The largest gap that counts as none where a run starts: a small share of how far the gaps of all contacts move in
    /// the run, by their rates there and where these lead. Where nothing moves, any.
    pub(crate) fn most_at_start(&mut self, point: &Point, contacts: &[usize], horizon: f64) -> f64 {
        self.mode.enter(&point.sides);
        self.mode.eval(point.t, &point.x, &point.alpha);
        let first = self.mode.field.f.clone();
        let end: Vec<f64> = (point.x.iter().zip(&first))
            .map(|(x, f)| x + horizon * f)
            .collect();
        self.mode.eval(point.t + horizon, &end, &point.alpha);
        let rates: Vec<f64> = (first.iter().zip(&self.mode.field.f))
            .map(|(first, last)| first.abs().max(last.abs()))
            .collect();
        self.mode.move_to(point);
        let mut most = 0.0_f64;
        for &i in contacts {
            self.mode.surfaces.linearize(i, &self.mode.memory.values);
            most = most.max(horizon * self.mode.surfaces.weigh(i, |j| rates[j]));
        }
        match most > 0.0 {
            true => SHARE_AT_START * most,
            false => f64::INFINITY,
        }
    }

    /// One rounding of every term of ψ of a switch where the point is, be it one that cancels within ψ. The switch
    /// stands for ψ afterwards, and is linearized.
    fn rounding(&mut self, switch: usize, state: &State) -> f64 {
        self.mode.surfaces.stand_for(switch, 0);
        self.mode
            .surfaces
            .linearize(switch, &self.mode.memory.values);
        let size = self.mode.surfaces.weigh(switch, |j| state.scales.size(j));
        let of_inputs = f64::EPSILON
            * (size + self.mode.surfaces.time_gradient(switch).abs() * state.point.t.abs());
        match self.mode.system.switches[switch].is_plain() {
            true => of_inputs.max(
                self.mode
                    .surfaces
                    .running_error(switch, &self.mode.memory.values),
            ),
            false => of_inputs,
        }
    }

    /// Sets of each switch the `width` of the band |ψ| ≤ width that counts as ψ = 0, and its `rounding`: [`LEFT`]
    /// rounding errors of ψ, below which a surface that has just been left is not found again.
    pub(crate) fn measure(&mut self, state: &mut State, switches: &[usize], horizon: f64) {
        self.mode.move_to(&state.point);
        for &i in switches {
            let rounding = self.rounding(i, state);
            state.bands.width[i] = self.width(rounding, i, state, horizon);
            state.bands.rounding[i] = LEFT * rounding;
        }
    }
}

/// What rounding makes of a ψ that has just left its surface, or waits there, within a step h: its own, and how far
/// what follows from states that are held at zero takes it.
pub(crate) fn rounding_of_motion(mode: &Mode, switch: usize, state: &State, h: f64) -> f64 {
    let held = mode.surfaces.weigh(switch, |j| state.scales.held[j]);
    state.bands.rounding[switch] + LEFT * f64::EPSILON * held * h
}
