//! Contacts that close at once, since they open by less than their ψ is known.
//!
//! A contact that opens by less than ψ is known closes at once: ψ'²/(2|ψ''|) ≤ ε, where ψ'' < 0 at α = 1.
//! What is left of ψ' is taken away in the direction d in which the surface pushes, without friction. This is how infinitely
//! many jumps end: with e = -ψ'⁺/ψ'⁻ the next one takes 2ψ'/|ψ''|, each one after it e times as long as the
//! one before, and all together 2ψ'/(|ψ''| (1 - e)).

use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::expansion::scales::{BAND, Scales};
use crate::hybrid::Side;
use crate::hybrid::point::Point;

/// ψ' and ψ'' of a contact.
pub(crate) struct Bent {
    pub speed: f64,
    pub bend: f64,
}

impl Bent {
    /// Whether a contact opens by less than its ψ is known until it is bent back.
    pub(crate) fn closes(&self, state: &State, switch: usize) -> bool {
        let Bent { speed, bend } = *self;
        let rounding = ROUNDING * bend.abs() * state.scales.last_step.powi(2);
        let least = 2.0 * state.bands.width[switch].max(rounding);
        speed > 0.0 && bend < 0.0 && speed * speed <= 2.0 * bend.abs() * least
    }
}

/// What a series does below this fraction of its terms is rounding.
pub(crate) const ROUNDING: f64 = 1e-13;

/// A share of the largest speed of a contact, and the roundings that it is then told from.
const FAST: f64 = 0.1;
const ROUNDINGS: f64 = 64.0;

/// Contacts that close for what rounding leaves of their speeds, in a mode.
pub(crate) struct Closing<'a> {
    pub mode: &'a mut Mode,
}

impl Closing<'_> {
    /// How fast a contact without a gap closes where the point is, if that is more than rounding. Its switch stands for
    /// this speed afterwards.
    pub(crate) fn speed(&mut self, scales: &Scales, switch: usize) -> Option<f64> {
        self.mode.surfaces.stand_for(switch, 1);
        self.mode
            .surfaces
            .linearize(switch, &self.mode.memory.values);
        let speed = -self.mode.psi(switch);
        // What is as fast as its bodies have ever been is an impact, even where forces that may act on a light one
        // within a step make others seem small.
        let share = match speed > FAST * self.mode.surfaces.weigh(switch, |j| scales.largest[j]) {
            true => ROUNDINGS * f64::EPSILON,
            false => BAND,
        };
        (speed > share * self.mode.surfaces.weigh(switch, |j| scales.size(j))).then_some(speed)
    }

    /// How a contact moves on without a force of its own.
    pub(crate) fn bent(&mut self, point: &mut Point, switch: usize) -> Bent {
        let sides = point.sides_sliding(&[switch]);
        self.mode.enter(&sides);
        let mode = &mut self.mode;
        mode.surfaces.stand_for(switch, 1);
        let alpha = std::mem::replace(&mut point.alpha[switch], 1.0);
        mode.eval(point.t, &point.x, &point.alpha);
        point.alpha[switch] = alpha;
        mode.linearize(&[switch]);
        Bent {
            speed: mode.psi(switch),
            bend: mode.phi(switch),
        }
    }

    /// Closes a contact that opens by less than its ψ is known until it is bent back: takes its speed away, in the
    /// direction in which its force acts. True where it did.
    pub(crate) fn shut(&mut self, state: &mut State, switch: usize, bent: Bent) -> bool {
        if !bent.closes(state, switch) {
            return false;
        }
        let Bent { speed, bend } = bent;
        let mode = &mut self.mode;
        let known = state.jumps.struck.iter().find(|struck| struck.0 == switch);
        let ratio = known.map_or(1.0, |(_, before)| speed / before);
        let size = mode.surfaces.weigh(switch, |j| state.scales.size(j));
        // Where nothing bounces, what is left of a speed is rounding.
        let bounces = ratio < 1.0 && speed > BAND * size;
        if bounces {
            let end = state.point.t + 2.0 * speed / (bend.abs() * (1.0 - ratio));
            state.jumps.end = Some(state.jumps.end.map_or(end, |other| other.max(end)));
        }
        let gradient = self.mode.surfaces.gradient(switch).to_vec();
        let along = |slopes: &[f64]| -> f64 { gradient.iter().map(|&(i, g)| g * slopes[i]).sum() };
        let slopes = self.slopes_of_push(&state.point, switch, false);
        let push = along(&slopes);
        let has_friction =
            (0..state.point.sides.len()).any(|i| self.mode.system.slip_of(i) == Some(switch));
        if bounces && has_friction {
            let rough = self.slopes_of_push(&state.point, switch, true);
            let rough_push = along(&rough);
            state.jumps.owed.0.resize(state.point.x.len(), 0.0);
            state.jumps.owed.1.push(switch);
            for (at, owed) in state.jumps.owed.0.iter_mut().enumerate() {
                *owed += speed * (slopes[at] / push - rough[at] / rough_push);
            }
        }
        state.jumps.closed.resize(state.point.x.len(), 0.0);
        for ((x, closed), slope) in
            (state.point.x.iter_mut().zip(&mut state.jumps.closed)).zip(slopes)
        {
            let change = slope * speed / push;
            *x -= change;
            *closed += change;
        }
        true
    }

    /// ∂f/∂α of a contact that slides in the present mode, without its friction or with it: without, where α_t is ½.
    /// What is taken away with friction in it would be pushed along its slip velocity, and gain energy.
    fn slopes_of_push(&mut self, point: &Point, switch: usize, is_rough: bool) -> Vec<f64> {
        let mode = &mut self.mode;
        let is_left_out = |i: &usize| !is_rough && mode.system.slip_of(*i) == Some(switch);
        let slips = (0..mode.sides.len()).filter(is_left_out);
        let slips: Vec<usize> = slips.collect();
        let mut sides = mode.sides.clone();
        let mut alphas = Vec::new();
        for slip in slips {
            sides[slip] = Side::Slide;
            let place = 1 + mode.n + slip;
            let alpha = std::mem::replace(&mut mode.memory.values[place], 0.5);
            alphas.push((place, alpha));
        }
        let blocks = mode.field.of_switch(switch).to_vec();
        for &block in &blocks {
            let Mode {
                field,
                memory,
                library,
                ..
            } = &mut **mode;
            field.enter(library, memory, block, &sides);
            field.linearize_block(block, &memory.values);
        }
        let slope = |i: usize| {
            let slopes = mode.field.slopes(i).filter(|(j, _)| *j == switch);
            slopes.map(|(_, slope)| slope).sum()
        };
        let slopes = (0..point.x.len()).map(slope).collect();
        for (place, alpha) in alphas {
            mode.memory.values[place] = alpha;
        }
        for block in blocks {
            let Mode {
                field,
                memory,
                library,
                sides,
                ..
            } = &mut **mode;
            field.enter(library, memory, block, sides);
        }
        slopes
    }
}
