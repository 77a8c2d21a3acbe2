//! Jumps of the state at an event: x⁺ = r(t, x⁻).
//!
//! A law jumps where its guard, a function of the sides of switches, becomes true; or where the state
//! strikes a closed surface: ψ = 0 and ψ' < 0 for a *unilateral* switch, which may be above its surface
//! or be kept on it by x' = f(x) + d (1 - α), α ≤ 1, and is never below.
//!
//! 1. What strikes jumps first: only then do rates decide what is open and what closed.
//! 2. The rates on all surfaces that meet decide the sides.
//! 3. Laws whose guards hold on these sides jump together, all from the values before.
//!
//! A contact that opens by less than ψ is known closes at once: ψ'²/(2|ψ''|) ≤ ε, where ψ'' < 0 at α = 1.
//! What is left of ψ' is taken away in the direction d in which the surface pushes, without friction. This is how infinitely
//! many jumps end: with e = -ψ'⁺/ψ'⁻ the next one takes 2ψ'/|ψ''|, each one after it e times as long as the
//! one before, and all together 2ψ'/(|ψ''| (1 - e)).
//!
//! A contact that is approached, but turns back by itself before ψ is known to be negative, ψ'²/(4ψ'') ≤ ε/8, is
//! grazed and not struck.
//!
//! After a jump all ψ are evaluated again, as at the start of a run, and the three steps are repeated
//! until nothing jumps.

use crate::expansion::scales::Scales;
use std::sync::Arc;

use crate::event::state::State;
use crate::events::sensitivity::Window;
use crate::expansion::mode::Mode;
use crate::hybrid::point::Point;
use crate::hybrid::{Effect, Guard, HybridSystem, Law, Side, Status};
use crate::selector::select::BAND;

/// What has happened at the present instant, and memory for it.
#[derive(Default)]
pub(crate) struct Jumps {
    /// Laws that have jumped, in order.
    pub fired: Vec<usize>,
    /// The state before the first jump.
    pub before: Vec<f64>,
    pub registers: Vec<f64>,
    /// New values of states, with the law they come from.
    values: Vec<(usize, f64, usize)>,
    /// What small openings were taken away from the states, together.
    pub closed: Vec<f64>,
    /// Where the jumps of contacts that close here accumulate.
    end: Option<f64>,
    /// What friction takes too much of the states up to there, and of which contacts.
    owed: (Vec<f64>, Vec<usize>),
    /// Laws of contacts without a gap, and their switches.
    pub near: Vec<(usize, usize)>,
    /// Those of them that are closed.
    pub kept: Vec<usize>,
    /// Contacts that were struck here, and how fast.
    struck: Vec<(usize, f64)>,
    /// Contacts without a gap that are passed by closer than their ψ is known.
    pub grazed: Vec<usize>,
}

impl Jumps {
    /// Forgets the instant before.
    pub(crate) fn begin(&mut self) {
        self.fired.clear();
        self.closed.clear();
        self.struck.clear();
        self.end = None;
        self.owed.0.clear();
        self.owed.1.clear();
    }

    /// The state before the jumps of this instant, `after` where there were none.
    pub(crate) fn before<'x>(&'x self, after: &'x [f64]) -> &'x [f64] {
        match self.fired.is_empty() {
            true => after,
            false => &self.before,
        }
    }

    /// Where the jumps accumulate that end here. Where nothing says so, but that a contact opens no farther
    /// than rounding, what was taken away from the states is an error.
    pub(crate) fn limit(&self, window: &mut Window) -> Option<f64> {
        if self.end.is_none() {
            for (moved, closed) in window.moved.iter_mut().zip(&self.closed) {
                *moved += closed * closed;
            }
        }
        self.end
    }

    /// Gives back what friction has taken too much where bounces accumulate.
    ///
    /// A contact that closes with a speed v left pushes with 2v/(1 - e) until bounces would have ended, and these with
    /// (1 + e) v/(1 - e), all for a mass of one: v is what its friction has had no right to. It is given back at the
    /// end, when friction has taken more than that of the energy.
    pub(crate) fn repay(&self, system: &HybridSystem, point: &mut Point) {
        let (owed, contacts) = &self.owed;
        let slips = |contact: &usize| {
            let of_contact = |i: &usize| system.slip_of(*i) == Some(*contact);
            let mut slips = (0..point.sides.len()).filter(of_contact);
            point.sides[*contact] == Side::Slide && slips.all(|i| point.sides[i] != Side::Slide)
        };
        if !contacts.iter().all(slips) {
            return;
        }
        for (x, owed) in point.x.iter_mut().zip(owed) {
            *x += owed;
        }
    }
}

/// ψ' and ψ'' of a contact.
pub(crate) struct Bent {
    pub speed: f64,
    pub bend: f64,
}

/// The share of its band within which a contact that is not met itself has no gap: less than what a contact is grazed
/// by, so that bodies that graze two others at once are not taken for jammed between them.
pub(crate) const TOUCH: f64 = 1.0 / 64.0;

/// What a series does below this fraction of its terms is rounding.
pub(crate) const ROUNDING: f64 = 1e-13;

/// A share of the largest speed of a contact, and the roundings that it is then told from.
const FAST: f64 = 0.1;
const ROUNDINGS: f64 = 64.0;

/// What a new mode is found for.
pub(crate) enum Met {
    /// Switches on their surface, or at the end of their sliding.
    Surfaces(Vec<usize>),
    /// New pieces of data, together with such switches.
    Breakpoint(Vec<usize>),
}

impl Mode {
    /// How fast a contact without a gap closes where the point is, if that is more than rounding. Its switch stands for
    /// this speed afterwards.
    pub(crate) fn closing_speed(&mut self, scales: &Scales, switch: usize) -> Option<f64> {
        self.surfaces.stand_for(switch, 1);
        self.surfaces.linearize(switch, &self.memory.values);
        let speed = -self.psi(switch);
        // What is as fast as its bodies have ever been is an impact, even where forces that may act on a light one
        // within a step make others seem small.
        let share = match speed > FAST * self.weigh(switch, |j| scales.largest[j]) {
            true => ROUNDINGS * f64::EPSILON,
            false => BAND,
        };
        (speed > share * self.weigh(switch, |j| scales.size(j))).then_some(speed)
    }
}

/// The laws by which states jump.
pub(crate) struct JumpLaws<'a> {
    mode: &'a mut Mode,
    system: Arc<HybridSystem>,
}

impl<'a> JumpLaws<'a> {
    /// Those of the system of a mode.
    pub(crate) fn new(mode: &'a mut Mode) -> Self {
        JumpLaws {
            system: mode.system.clone(),
            mode,
        }
    }

    /// Finds the contacts without a gap, those that are met among them: no impact changes that.
    pub(crate) fn find_near(&mut self, state: &mut State, met: &[usize], t1: f64) {
        let mut near = std::mem::take(&mut state.jumps.near);
        near.clear();
        near.extend(self.system.laws.iter().enumerate().filter_map(|(l, law)| {
            let Guard::Strikes(switch) = law.guard else {
                return None;
            };
            Some((l, switch))
        }));
        let mut kept = std::mem::take(&mut state.jumps.kept);
        kept.clear();
        let mode = &mut self.mode;
        mode.move_to(&state.point);
        near.retain(|&(_, switch)| {
            let closed = state.point.sides[switch] == Side::Slide;
            kept.extend(closed.then_some(switch));
            state.bands.width[switch] = mode.band(switch, state, t1 - state.point.t);
            // What is met has no gap, even where projection has moved the state since.
            let is_near = closed
                || met.contains(&switch)
                || mode.psi(switch) <= TOUCH * state.bands.width[switch];
            mode.surfaces.stand_for(switch, usize::from(closed));
            is_near
        });
        (state.jumps.near, state.jumps.kept) = (near, kept);
    }

    /// The laws of surfaces that the state strikes from above.
    pub(crate) fn struck(&mut self, state: &mut State) -> Vec<usize> {
        let mut struck = Vec::new();
        let mut speeds = Vec::new();
        let mode = &mut self.mode;
        mode.move_to(&state.point);
        for &(l, switch) in &state.jumps.near {
            let closed = state.point.sides[switch] == Side::Slide;
            if let Some(speed) = mode.closing_speed(&state.scales, switch) {
                struck.push(l);
                speeds.push((switch, speed));
            }
            let order = if closed { 1 } else { 0 };
            mode.surfaces.stand_for(switch, order);
        }
        state.jumps.grazed.clear();
        struck.retain(|&law| {
            let Some(switch) = self.system.laws[law].closes() else {
                return true;
            };
            let grazes = state.point.sides[switch] != Side::Slide && self.grazes(state, switch);
            if grazes {
                state.jumps.grazed.push(switch);
            }
            !grazes
        });
        if !struck.is_empty() {
            state.jumps.struck = speeds;
        }
        struck
    }

    /// Whether a contact that is approached turns back before its ψ is known to be negative.
    fn grazes(&mut self, state: &mut State, switch: usize) -> bool {
        let Bent { speed, bend, .. } = Closing {
            mode: &mut self.mode,
        }
        .bent(&mut state.point, switch);
        self.mode.enter(&state.point.sides);
        bend > 0.0 && speed * speed <= 0.25 * bend * state.bands.width[switch]
    }

    /// Takes away the speeds at which contacts open by less than their ψ is known; false where there are none.
    pub(crate) fn close(&mut self, state: &mut State) -> bool {
        let mut any = false;
        for at in 0..state.jumps.near.len() {
            let (_, switch) = state.jumps.near[at];
            state.point.alpha[switch] = 1.0;
            let bent = Closing {
                mode: &mut self.mode,
            }
            .bent(&mut state.point, switch);
            any |= Closing {
                mode: &mut self.mode,
            }
            .shut(state, switch, bent);
        }
        any
    }

    /// The laws whose guards hold on the present sides.
    pub(crate) fn holding(&self, state: &mut State) -> Vec<usize> {
        let mut holding = Vec::new();
        for (l, law) in self.system.laws.iter().enumerate() {
            let Guard::Sides { switches, holds } = &law.guard else {
                continue;
            };
            let registers = &mut state.jumps.registers;
            registers.resize(holds.n_registers().max(switches.len()), 0.0);
            for (register, &switch) in registers.iter_mut().zip(switches) {
                *register = 0.5 + 0.5 * state.point.sides[switch].sign();
            }
            holds.run(registers);
            if holds.results(registers).next().is_some_and(|v| v > 0.75) {
                holding.push(l);
            }
        }
        holding
    }

    /// Lets laws jump together.
    pub(crate) fn apply(&mut self, state: &mut State, laws: &[usize]) -> Result<(), Status> {
        if state.jumps.fired.is_empty() {
            state.jumps.before.clone_from(&state.point.x);
        }
        self.mode.move_to(&state.point);
        let Jumps {
            registers, values, ..
        } = &mut state.jumps;
        values.clear();
        for &l in laws {
            let Effect::Reset(reset) = &self.system.laws[l].effect else {
                continue;
            };
            let (inputs, states, tape) = (&reset.inputs, &reset.states, &reset.values);
            registers.resize(tape.n_registers().max(inputs.len()), 0.0);
            for (register, &input) in registers.iter_mut().zip(inputs) {
                *register = self.mode.memory.value(input);
            }
            tape.run(registers);
            for (&state, value) in states.iter().zip(tape.results(registers)) {
                match values.iter().find(|(other, ..)| *other == state) {
                    Some(&(_, known, other)) if known != value => {
                        let laws = [other, l];
                        return Err(Status::ConflictingJumps { laws, state });
                    }
                    Some(_) => {}
                    None => values.push((state, value, l)),
                }
            }
        }
        for &(i, value, _) in &*values {
            if !value.is_finite() {
                return Err(Status::NotFinite);
            }
            state.point.x[i] = value;
            state.scales.largest[i] = state.scales.largest[i].max(value.abs());
        }
        state.jumps.fired.extend_from_slice(laws);
        Ok(())
    }
}

/// Contacts that close for what rounding leaves of their speeds, in a mode.
pub(crate) struct Closing<'a> {
    pub mode: &'a mut Mode,
}

impl Closing<'_> {
    /// How a contact moves on without a force of its own.
    fn bent(&mut self, point: &mut Point, switch: usize) -> Bent {
        let mut sides = point.sides.clone();
        sides[switch] = Side::Slide;
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
        let Bent { speed, bend } = bent;
        let rounding = ROUNDING * bend.abs() * state.scales.last_step.powi(2);
        let least = 2.0 * state.bands.width[switch].max(rounding);
        let opens = speed > 0.0 && bend < 0.0;
        if !opens || speed * speed > 2.0 * bend.abs() * least {
            return false;
        }
        let mode = &mut self.mode;
        let known = state.jumps.struck.iter().find(|struck| struck.0 == switch);
        let ratio = known.map_or(1.0, |(_, before)| speed / before);
        let size = mode.weigh(switch, |j| state.scales.size(j));
        // Where nothing bounces, what is left of a speed is rounding.
        let bounces = ratio < 1.0 && speed > BAND * size;
        if bounces {
            let end = state.point.t + 2.0 * speed / (bend.abs() * (1.0 - ratio));
            state.jumps.end = Some(state.jumps.end.map_or(end, |other| other.max(end)));
        }
        let gradient = self.mode.gradient(switch).to_vec();
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

impl Law {
    /// The switch that closes where jumps of this law end.
    pub fn closes(&self) -> Option<usize> {
        match self.guard {
            Guard::Strikes(switch) => Some(switch),
            Guard::Sides { .. } => None,
        }
    }
}
