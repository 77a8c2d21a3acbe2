//! Jumps of the state at an event: x⁺ = r(t, x⁻).
//!
//! A law jumps where its guard, a function of the sides of switches, becomes true; at instants t_0 + k T; or where the state
//! strikes a closed surface: ψ = 0 and ψ' < 0 for a *unilateral* switch, which may be above its surface
//! or be kept on it by x' = f(x) + d (1 - α), α ≤ 1, and is never below.
//!
//! 1. What strikes jumps first: only then do rates decide what is open and what closed.
//! 2. The rates on all surfaces that meet decide the sides.
//! 3. Laws whose guards hold on these sides, and those whose instant it is, jump together, all from the values before.
//!
//! A law that ends the run does so before anything jumps that the same round would let jump.
//!
//! A contact that is approached, but turns back by itself before ψ is known to be negative, ψ'²/(4ψ'') ≤ ε/8, is
//! grazed and not struck.
//!
//! After a jump all ψ are evaluated again, as at the start of a run, and the three steps are repeated
//! until nothing jumps.

use crate::event::state::{Jumps, State};
use crate::events::bands::BandWidths;
use crate::expansion::mode::Mode;
use crate::hybrid::system::on_surface;
use crate::hybrid::{Effect, Few, Guard, HybridSystem, Law, Side, Status};
use crate::selector::closing::{Bent, Closing};
use crate::selector::select::TOUCH;

/// The laws by which states jump.
pub(crate) struct JumpLaws<'a> {
    system: &'a HybridSystem,
    mode: &'a mut Mode,
}

impl<'a> JumpLaws<'a> {
    /// Those of a system, in one of its modes.
    pub(crate) fn new(system: &'a HybridSystem, mode: &'a mut Mode) -> Self {
        JumpLaws { system, mode }
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
            BandWidths { mode }.measure(state, &[switch], t1 - state.point.t);
            // What is met has no gap, even where projection has moved the state since.
            let is_near = closed
                || met.contains(&switch)
                || mode.psi(switch) <= state.bands.within(switch, TOUCH);
            mode.surfaces.stand_for(switch, usize::from(closed));
            is_near
        });
        (state.jumps.near, state.jumps.kept) = (near, kept);
    }

    /// The laws of surfaces that the state strikes from above.
    pub(crate) fn struck(&mut self, state: &mut State) -> Few<usize> {
        let mut struck = Few::new();
        let mut speeds: Few<(usize, f64)> = Few::new();
        let mode = &mut self.mode;
        mode.move_to(&state.point);
        for &(l, switch) in &state.jumps.near {
            let closed = state.point.sides[switch] == Side::Slide;
            if let Some(speed) = (Closing { mode }).speed(&state.scales, switch) {
                struck.push(l);
                speeds.push((switch, speed));
            }
            let order = if closed { 1 } else { 0 };
            mode.surfaces.stand_for(switch, order);
        }
        state.jumps.grazed.clear();
        struck.retain(|law| {
            let Some(switch) = self.system.laws[*law].closes() else {
                return true;
            };
            let grazes = state.point.sides[switch] != Side::Slide && self.grazes(state, switch);
            if grazes {
                state.jumps.grazed.push(switch);
            }
            !grazes
        });
        if !struck.is_empty() {
            state.jumps.struck.clear();
            state.jumps.struck.extend(speeds);
        }
        struck
    }

    /// Whether a contact that is approached turns back before its ψ is known to be negative.
    fn grazes(&mut self, state: &mut State, switch: usize) -> bool {
        let Bent { speed, bend, .. } = Closing { mode: self.mode }.bent(&mut state.point, switch);
        self.mode.enter(&state.point.sides);
        bend > 0.0 && speed * speed <= 0.25 * bend * state.bands.width[switch]
    }

    /// Takes away the speeds at which contacts open by less than their ψ is known; false where there are none.
    pub(crate) fn close(&mut self, state: &mut State) -> bool {
        let mut any = false;
        for at in 0..state.jumps.near.len() {
            let (_, switch) = state.jumps.near[at];
            state.point.alpha[switch] = 1.0;
            let bent = Closing { mode: self.mode }.bent(&mut state.point, switch);
            any |= Closing { mode: self.mode }.shut(state, switch, bent);
        }
        any
    }

    /// The laws whose guards hold on the present sides, but those that end the run.
    pub(crate) fn holding(&self, state: &mut State) -> Few<usize> {
        let laws = self.system.laws.iter().enumerate();
        let jumps = laws.filter(|(_, law)| !matches!(law.effect, Effect::Stop));
        let holds = |(l, law): (usize, &Law)| law.holds(state, &[]).then_some(l);
        jumps.filter_map(holds).collect()
    }

    /// Whether a law ends the run, where the surfaces of these switches are reached besides those that hold the state.
    pub(crate) fn stops(&self, state: &mut State, reached: &[usize]) -> bool {
        for (l, law) in self.system.laws.iter().enumerate() {
            if matches!(law.effect, Effect::Stop) && law.holds(state, reached) {
                state.jumps.known.stopped = Some(l);
                return true;
            }
        }
        false
    }

    /// Takes note of the laws whose instant it is.
    pub(crate) fn let_due(&self, state: &mut State) {
        let t = state.point.t;
        let due = self.system.periodic();
        let due = due.filter(|(_, instants)| instants.holds(t));
        state.jumps.known.due.clear();
        state.jumps.known.due.extend(due.map(|(law, _)| law));
    }

    /// Lets laws jump together.
    pub(crate) fn apply(&mut self, state: &mut State, laws: &[usize]) -> Result<(), Status> {
        if state.jumps.fired.is_empty() {
            state.jumps.before.clone_from(&state.point.x);
        }
        self.mode.move_to(&state.point);
        let Jumps {
            registers,
            values,
            known,
            fired,
            ..
        } = &mut state.jumps;
        values.clear();
        let n_fired = fired.len();
        for (at, &l) in laws.iter().enumerate() {
            let Effect::Reset(reset) = &self.system.laws[l].effect else {
                continue;
            };
            let states = &reset.states;
            // At a known instant numbers are compared, wherever the state comes from and goes.
            let on = match self.system.laws[l].guard {
                Guard::Every(_) => &known.zero,
                _ => &known.held,
            };
            let place = n_fired + at;
            known.read.extend(on.iter().map(|&switch| (place, switch)));
            let inputs = reset.inputs_on(on, &state.point.sides);
            registers.clear();
            registers.extend(inputs.map(|input| self.mode.memory.value(input)));
            let tape = self
                .mode
                .library
                .reset(l, reset)
                .on(|input| registers[input]);
            registers.resize(tape.n_registers(), 0.0);
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

impl Law {
    /// Whether a guard holds on the present sides, and on the surfaces that hold the state or are `reached`.
    fn holds(&self, state: &mut State, reached: &[usize]) -> bool {
        let Guard::Sides { compared, .. } = &self.guard else {
            return false;
        };
        let Jumps {
            registers, known, ..
        } = &mut state.jumps;
        let sides = &state.point.sides;
        self.guard.holds(registers, |place, switch| {
            let is_on = known.held.contains(&switch) || reached.contains(&switch);
            let on_surface = on_surface(compared, place).filter(|_| is_on);
            on_surface.unwrap_or(0.5 + 0.5 * sides[switch].sign())
        })
    }

    /// The switch that closes where jumps of this law end.
    pub fn closes(&self) -> Option<usize> {
        match self.guard {
            Guard::Strikes(switch) => Some(switch),
            Guard::Sides { .. } | Guard::Every(_) => None,
        }
    }
}
