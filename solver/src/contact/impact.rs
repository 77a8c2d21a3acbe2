//! Impacts: velocities jump where contacts are struck.
//!
//! v⁺ = v⁻ + D Λ - T β,   0 ≤ Λ ⟂ J_nᵀ(v⁺ + e v⁻) ≥ 0,   β ∈ Λ ∂|J_tᵀ v⁺|,
//!
//! over all closed contacts that hang together, those at rest too: Newton's law with Coulomb's friction for
//! impulses (Moreau 1988), the problem of `meeting` with a₀ = (1 + e) J_nᵀv⁻ and b₀ = J_tᵀv⁻.
//!
//! Poisson's law is that problem twice (Glocker & Pfeiffer 1995). Compression is the impact with e = 0,
//!
//! v° = v⁻ + D Λ° - T β°,   0 ≤ Λ° ⟂ J_nᵀv° ≥ 0,   β° ∈ Λ° ∂|J_tᵀ v°|,
//!
//! and expansion gives back a share of each of its impulses,
//!
//! v⁺ = v° + D Λ - T β,   0 ≤ Λ - e Λ° ⟂ J_nᵀv⁺ ≥ 0,   β ∈ Λ ∂|J_tᵀ v⁺|.
//!
//! With one e for all contacts no impact adds energy: compression takes E = ½ |v° - v⁻|² at least, in the norm of M, and
//! expansion gives back e² E at most.

use std::sync::Arc;

use crate::contact::problem::{Forces, Meeting, NoForces, Touch};
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::{
    Coefficient, Effect, Guard, HybridSystem, Impact, ImpactLaw, Note, Settings, Side, Status,
};
use crate::selector::coupling::Coupling;

/// Energy that is gained by less than this fraction of what is exchanged is rounding.
const GAIN: f64 = 1e-9;

/// Impacts of contacts that are struck at one instant.
pub(crate) struct Impacts<'a> {
    pub system: Arc<HybridSystem>,
    pub mode: &'a mut Mode,
    pub settings: &'a Settings,
    pub coupling: &'a Coupling,
}

impl Impacts<'_> {
    /// Lets velocities jump by the impulses of the contacts that `laws` strike, and all that they act on.
    pub(crate) fn strike_all(&mut self, state: &mut State, laws: &[usize]) -> Result<(), Status> {
        let struck = laws.iter();
        let struck = struck.filter_map(|&law| impact_of(&self.system, law));
        let struck: Vec<usize> = struck.map(|(normal, _)| normal).collect();
        if struck.is_empty() {
            return Ok(());
        }
        let near = state.jumps.near.iter().map(|(_, normal)| *normal);
        let near: Vec<usize> = near
            .filter(|normal| !state.jumps.grazed.contains(normal))
            .collect();
        self.note_order(state, &struck, &near);
        self.strike_together(state, &struck, &near)?;
        for (scale, x) in state.scales.largest.iter_mut().zip(&state.point.x) {
            *scale = scale.max(x.abs());
        }
        Ok(())
    }

    /// One impact of each of the contacts `struck`, with all that hang together with it among those that are `near`.
    pub(crate) fn strike_together(
        &mut self,
        state: &mut State,
        struck: &[usize],
        near: &[usize],
    ) -> Result<(), Status> {
        let system = self.system.clone();
        let laws = 0..system.laws.len();
        let impacts = laws.filter_map(|law| impact_of(&system, law));
        let impacts: Vec<_> = impacts
            .filter(|(normal, _)| near.contains(normal))
            .collect();
        let entries =
            |&(normal, impact): &(usize, &Impact)| [&[normal], &impact.slips[..]].concat();
        let mut touching: Vec<usize> = impacts.iter().flat_map(entries).collect();
        touching.sort_unstable();
        let mut done: Vec<usize> = Vec::new();
        for &normal in struck {
            if done.contains(&normal) {
                continue;
            }
            let group = self.coupling.interacting(normal, &touching);
            let of_group = |(normal, _): &&(usize, &Impact)| group.contains(normal);
            let impacts: Vec<_> = impacts.iter().filter(of_group).copied().collect();
            self.strike(state, &impacts)?;
            done.extend(impacts.iter().map(|(normal, _)| normal));
        }
        Ok(())
    }

    /// One impact of contacts that hang together.
    fn strike(&mut self, state: &mut State, impacts: &[(usize, &Impact)]) -> Result<(), Status> {
        let touch = |&(normal, impact): &(usize, &Impact)| Touch {
            normal,
            slips: impact.slips.clone(),
        };
        let contacts: Vec<Touch> = impacts.iter().map(touch).collect();
        let switches = || impacts.iter().map(|&(normal, _)| normal).collect();
        let mut sides = state.point.sides.clone();
        for touch in &contacts {
            sides[touch.normal] = Side::Slide;
            state.point.alpha[touch.normal] = 0.0;
            for &slip in &touch.slips {
                sides[slip] = Side::Slide;
                state.point.alpha[slip] = 0.5;
            }
        }
        self.mode.enter(&sides);
        self.mode
            .eval(state.point.t, &state.point.x, &state.point.alpha);
        let numbers: Vec<[f64; 2]> = (impacts.iter())
            .map(|(_, i)| self.numbers(&mut state.jumps.registers, i))
            .collect();
        for (&[e, mu], &(switch, _)) in numbers.iter().zip(impacts) {
            if let Some((coefficient, value)) = Coefficient::outside(e, mu) {
                return Err(Status::Coefficient {
                    switch,
                    coefficient,
                    value,
                });
            }
        }
        let mode = &mut *self.mode;
        let mut all: Vec<usize> = contacts.iter().flat_map(Touch::switches).collect();
        all.sort_unstable();
        mode.linearize_impulses(&all);
        let speeds: Vec<f64> = contacts.iter().map(|c| mode.psi(c.normal)).collect();
        let slips = contacts.iter().flat_map(|c| &c.slips);
        let slips: Vec<f64> = slips.map(|&t| mode.psi(t)).collect();
        let mut meeting = Meeting::of(mode, contacts);
        let e: Vec<f64> = numbers.iter().map(|[e, _]| *e).collect();
        let is_poisson = impacts.iter().any(|(_, i)| i.law == ImpactLaw::Poisson);
        let impulses = match is_poisson {
            true => by_poisson(&mut meeting, &speeds, &slips, &e),
            false => by_newton(&meeting, &speeds, &slips, &e),
        };
        let impulses = impulses.map_err(|why| match why {
            NoForces::Paradox(at) => Status::Painleve {
                switch: impacts[at].0,
            },
            NoForces::NotFound => Status::NoSolution {
                switches: switches(),
            },
        })?;
        state.report.complementarity = state.report.complementarity.max(impulses.residual);
        push(&mut state.point.x, mode, &meeting, &impulses);
        if !state.point.x.iter().all(|x| x.is_finite()) {
            return Err(Status::NotFinite);
        }
        // ½ (v⁺ + v⁻)ᵀ M (v⁺ - v⁻), impulse by impulse.
        mode.move_to(&state.point);
        let (mut gain, mut exchanged) = (0.0, 0.0);
        for (i, touch) in meeting.contacts.iter().enumerate() {
            let speed = mode.psi(touch.normal) + speeds[i];
            gain += 0.5 * impulses.normal[i] * speed;
            exchanged += impulses.normal[i] * speeds[i].abs();
            for (&slip, t) in touch.slips.iter().zip(meeting.entries(i)) {
                let drag = numbers[i][1] * impulses.friction[t];
                gain -= 0.5 * drag * (mode.psi(slip) + slips[t]);
                exchanged += (drag * slips[t]).abs();
            }
        }
        if gain > GAIN * exchanged {
            state.report.note(Note::EnergyGained {
                time: state.point.t,
                switches: switches(),
            });
        }
        Ok(())
    }

    /// Restitution and friction where the state is.
    fn numbers(&mut self, registers: &mut Vec<f64>, impact: &Impact) -> [f64; 2] {
        registers.resize(impact.numbers.n_registers().max(impact.inputs.len()), 0.0);
        for (register, &input) in registers.iter_mut().zip(&impact.inputs) {
            *register = self.mode.memory.value(input);
        }
        impact.numbers.run(registers);
        let mut numbers = impact.numbers.results(registers);
        [numbers.next().unwrap_or(0.0), numbers.next().unwrap_or(0.0)]
    }
}

/// x⁺ = x⁻ + D Λ - T β
fn push(x: &mut [f64], mode: &Mode, meeting: &Meeting, impulses: &Forces) {
    for (j, x) in x.iter_mut().enumerate() {
        for (switch, slope) in mode.field.slopes(j) {
            for (i, touch) in meeting.contacts.iter().enumerate() {
                if switch == touch.normal {
                    *x -= slope * impulses.normal[i];
                } else if let Some(k) = touch.slips.iter().position(|&slip| slip == switch) {
                    *x += 0.5 * slope * impulses.friction[meeting.entries(i).start + k];
                }
            }
        }
    }
}

/// Impulses of Newton's law with e, for these speeds of gaps and slips before.
fn by_newton(
    meeting: &Meeting,
    speeds: &[f64],
    slips: &[f64],
    e: &[f64],
) -> Result<Forces, NoForces> {
    let rebound = speeds.iter().zip(e).map(|(speed, e)| (1.0 + e) * speed);
    let rebound: Vec<f64> = rebound.collect();
    meeting.solve(&rebound, slips, slips)
}

/// The same of Poisson's law: those of compression and expansion together.
fn by_poisson(
    meeting: &mut Meeting,
    speeds: &[f64],
    slips: &[f64],
    e: &[f64],
) -> Result<Forces, NoForces> {
    let compression = meeting.solve(speeds, slips, slips)?;
    let given_back = compression.normal.iter().zip(e);
    meeting.least = given_back.map(|(impulse, e)| e * impulse).collect();
    let (rates, slips) = (&compression.rates, &compression.slips);
    let mut both = meeting.solve(rates, slips, slips)?;
    for (sum, impulse) in both.normal.iter_mut().zip(&compression.normal) {
        *sum += impulse;
    }
    for (sum, impulse) in both.friction.iter_mut().zip(&compression.friction) {
        *sum += impulse;
    }
    both.residual = both.residual.max(compression.residual);
    Ok(both)
}

/// The switch and the impact of a law that is one.
pub(crate) fn impact_of(system: &HybridSystem, law: usize) -> Option<(usize, &Impact)> {
    match &system.laws[law] {
        crate::hybrid::system::Law {
            guard: Guard::Strikes(normal),
            effect: Effect::Impact(impact),
        } => Some((*normal, impact)),
        _ => None,
    }
}
