//! Surfaces that are approached and left again.
//!
//! Where ψ turns back at a distance from zero that is smaller than the error of a run, it cannot be told
//! whether its surface is crossed. With ψ = d at the turn and ψ⁽ᵏ⁾/k! = c_k there, ψ is within d of its
//! least value for 2 min_k (d/|c_k|)^(1/k), and if the uncertainty is larger than d the other field may
//! act for as long as that; or to the end, where it does not lead back. The run says what it knows of
//! such a turn, and its error is known to the caller only.

use super::approach::{Approach, Approaches, DERIVATIVES, Pending};
use super::roots::Root;
use crate::event::state::State;
use crate::expansion::dense::Dense;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{Bands, Scales};
use crate::expansion::series;
use crate::expansion::taylor::Expansion;
use crate::hybrid::point::Point;
use crate::hybrid::{Effect, Guard, Side};

/// Roundings of a term that a value has seen.
const ROUNDINGS: f64 = 8.0;

/// The share of its band by which a contact may be below its surface and is grazed.
const GRAZED: f64 = 0.125;

/// Approaches closer than this many tolerances are looked at.
const CLOSE: f64 = 10.0;

/// What comes close to its surface within a step, by the polynomials of the step.
pub(crate) struct Grazing<'a> {
    dense: Dense<'a>,
    mode: &'a Mode,
    tolerance: f64,
}

impl<'a> Grazing<'a> {
    /// In a run within a tolerance.
    pub(crate) fn new(dense: Dense<'a>, tolerance: f64) -> Self {
        Grazing {
            dense,
            mode: dense.mode(),
            tolerance,
        }
    }

    /// |ψ| that a run within its tolerance may have on either side of the surface in a step of length `h`; zero
    /// where it does not matter on which.
    pub(crate) fn closeness(&self, switch: usize, scales: &Scales, bands: &Bands, h: f64) -> f64 {
        if self.mode.system.sides_agree(switch) {
            return 0.0;
        }
        // Before the first step, a state that starts at zero has no size but that of its motion.
        let is_first = scales.last_step <= 0.0;
        let size = |j: usize| match is_first {
            true => scales.largest[j].max(series::magnitude(self.dense.x(j), h, 0)),
            false => scales.largest[j],
        };
        let past = self.mode.surfaces.weigh(switch, size);
        let terms = bands.terms[switch];
        // The series of what is no affine function has an error of its own.
        let cut = if self.mode.surfaces.is_affine(switch) {
            0.0
        } else {
            self.tolerance * terms
        };
        // What has no states in it has the size of its series.
        let own = match past > 0.0 {
            true => 0.0,
            false => series::magnitude(self.dense.psi(switch), h, 0),
        };
        CLOSE * self.tolerance * past + cut + ROUNDINGS * f64::EPSILON * terms.max(past).max(own)
    }

    /// Takes note of the surfaces that came close within a step of `length`, and of the one that
    /// ended it, if that was met at a small angle. `state` is still that at the start.
    pub(crate) fn note(&self, state: &mut State, length: f64, event: Option<(usize, Root)>) {
        let mut close = std::mem::take(&mut state.approaches.close);
        for (switch, tau) in close.drain(..).filter(|(_, tau)| *tau <= length) {
            self.note_approach(state, switch, tau, None);
        }
        state.approaches.close = close;
        let Some((switch, root)) = event else {
            return;
        };
        if self.mode.system.sides_agree(switch) || state.bands.armed[switch] {
            return;
        }
        let c = self.dense.psi(switch);
        let (slope, bend) = (series::slope(c, length), series::curvature(c, length));
        let turns = bend * self.mode.sides[switch].sign() > 0.0
            && 0.5 * slope * slope
                <= bend.abs() * self.closeness(switch, &state.scales, &state.bands, length);
        if !root.crosses || turns {
            self.note_approach(state, switch, length, Some(root.crosses));
        }
    }

    fn note_approach(&self, state: &mut State, switch: usize, tau: f64, event: Option<bool>) {
        let time = state.point.t + tau;
        let again = |last: &Pending| {
            let apart = (last.approach.time - time).abs();
            last.approach.switch == switch && apart <= 1e-6 * tau.max(state.scales.last_step)
        };
        if state.approaches.pending.last().is_some_and(again) {
            return;
        }
        let (c, side) = (self.dense.psi(switch), self.mode.sides[switch].sign());
        let [_, along @ ..]: [f64; 1 + DERIVATIVES] = series::around(c, tau);
        let along: [f64; DERIVATIVES] = along.map(|term| side * term);
        let crosses = event == Some(true);
        let distance = if crosses {
            -0.25 * along[0] * along[0] / along[1]
        } else {
            side * series::value(c, tau)
        };
        let sizes = c.iter().rev().fold(0.0, |sum, c| sum * tau + c.abs());
        let past = self
            .mode
            .surfaces
            .weigh(switch, |j| state.scales.largest[j]);
        let (mut x, mut alpha) = (vec![0.0; self.mode.n], vec![0.0; self.mode.sides.len()]);
        self.dense.states_at(tau, &mut x);
        self.dense.alphas_at(tau, &mut alpha);
        state.approaches.pending.push(Pending {
            approach: Approach {
                switch,
                time,
                x,
                distance,
                rounding: ROUNDINGS * f64::EPSILON * state.bands.terms[switch].max(sizes).max(past),
                gradient: Vec::new(),
                jump: (0..self.mode.n)
                    .map(|i| -series::slope(self.dense.x(i), tau))
                    .collect(),
                crosses,
                latches: false,
                strikes: false,
                along,
                behind: [f64::NAN; DERIVATIVES],
            },
            sides: self.mode.sides.clone(),
            alpha,
            is_event: event.is_some(),
        });
    }
}

impl Approaches {
    /// Looks behind the surfaces that came close in the last step.
    pub(crate) fn look_behind(&mut self, mode: &mut Mode, point: &Point, bands: &Bands) {
        let mut pending = std::mem::take(&mut self.pending);
        for Pending {
            mut approach,
            mut sides,
            mut alpha,
            is_event,
        } in pending.drain(..)
        {
            let (switch, side) = (approach.switch, sides[approach.switch]);
            let other = Side::of(-side.sign());
            let strikes = mode.system.is_struck(switch);
            let is_there = match approach.crosses {
                // A contact is struck or grazed, and above its surface afterwards in any case.
                _ if strikes => true,
                true => point.sides[switch] == other,
                false => !is_event || point.sides[switch] == side,
            };
            if !is_there {
                continue;
            }
            let jumps = self.jumping(mode, &sides, switch);
            sides[switch] = other;
            alpha[switch] = if other == Side::Plus { 1.0 } else { 0.0 };
            mode.enter(&sides);
            let expanded = Expansion { mode }.around(approach.time, &approach.x, &mut alpha);
            let exists = expanded.is_ok();
            mode.surfaces.linearize(switch, &mode.memory.values);
            approach
                .gradient
                .extend_from_slice(mode.surfaces.gradient(switch));
            approach.latches = mode.system.relay(switch).is_some() || !jumps.is_empty();
            approach.strikes = strikes;
            let order = mode.memory.order + 1;
            mode.surfaces.expand(switch, &mut mode.memory, order);
            let c = mode.psi_series(switch);
            if !approach.crosses {
                approach.distance = side.sign() * c[0];
            }
            let behind = &c[1..=DERIVATIVES];
            for (c, behind) in approach.behind.iter_mut().zip(behind) {
                *c = side.sign() * behind;
            }
            for (i, jump) in approach.jump.iter_mut().enumerate() {
                *jump += if exists {
                    mode.x_series(i)[1]
                } else {
                    f64::NAN
                };
            }
            for (jump, _) in approach
                .jump
                .iter_mut()
                .zip(&jumps)
                .filter(|(_, jumps)| **jumps)
            {
                *jump = f64::NAN;
            }
            if strikes {
                // What is closer than this is taken for a graze (`jump.rs`).
                approach.rounding = approach.rounding.max(GRAZED * bands.width[switch]);
                // α = 0 is a force of one.
                let push = 2.0 * (approach.behind[1] - approach.along[1]);
                approach.jump.iter_mut().for_each(|jump| *jump /= push);
            }
            self.keep(approach);
        }
        self.pending = pending;
    }

    /// Of each state, whether it jumps by a law whose guard holds on one side of a surface alone, and all of them where
    /// the run ends there; empty where there is no such law.
    fn jumping(&mut self, mode: &Mode, sides: &[Side], switch: usize) -> Vec<bool> {
        let registers = &mut self.registers;
        let mut holds = |guard: &Guard, turned: f64| {
            guard.holds(registers, |_, i| {
                let side = if i == switch { turned } else { 1.0 };
                0.5 + 0.5 * side * sides[i].sign()
            })
        };
        let laws = mode.system.laws.iter();
        let laws = laws.filter(|law| {
            law.guard.looks_at(switch) && holds(&law.guard, 1.0) != holds(&law.guard, -1.0)
        });
        let mut jumping = Vec::new();
        for law in laws {
            jumping.resize(mode.n, false);
            match &law.effect {
                Effect::Reset(reset) => reset.states.iter().for_each(|&i| jumping[i] = true),
                Effect::Stop => jumping.fill(true),
                Effect::Impact(_) => {}
            }
        }
        jumping
    }
}
