//! Impacts: velocities jump where contacts are struck.
//!
//! v⁺ = v⁻ + D Λ - T β,   0 ≤ Λ ⟂ J_nᵀ(v⁺ + e v⁻) ≥ 0,   β ∈ Λ ∂|J_tᵀ v⁺|,
//!
//! over all closed contacts that hang together, those at rest too: Newton's law with Coulomb's friction for
//! impulses (Moreau 1988), the problem of `coulomb` with a₀ = (1 + e) J_nᵀv⁻ and b₀ = J_tᵀv⁻.
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

use super::coulomb::problem::{NoSolution, Problem, Work};
use super::rows;
use super::rows::{ContactSwitches, Rows};
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
    /// Lets velocities jump by the impulses of the contacts that `laws` strike, and all that they act on. The
    /// `steps` that are met with them come behind.
    pub(crate) fn strike_all(
        &mut self,
        state: &mut State,
        laws: &[usize],
        steps: &[usize],
    ) -> Result<(), Status> {
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
        if !steps.is_empty() {
            self.note_steps(state, &struck, &near, steps);
        }
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
        let of_impact = |&(normal, impact): &(usize, &Impact)| ContactSwitches {
            normal,
            slips: impact.slips.clone(),
        };
        let contacts: Vec<ContactSwitches> = impacts.iter().map(of_impact).collect();
        let switches = || impacts.iter().map(|&(normal, _)| normal).collect();
        self.enter_closed(state, &contacts);
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
        let mut all: Vec<usize> = contacts.iter().flat_map(ContactSwitches::all).collect();
        all.sort_unstable();
        let rows = rows::in_order(&contacts);
        let before: Vec<f64> = rows.iter().map(|&i| self.mode.psi(i)).collect();
        let of_contacts = Rows::linearize(self.mode, &all);
        let w = of_contacts.delassus(&contacts);
        // Friction has μ in its rows.
        let mut problem = Problem::new(w, vec![1.0; contacts.len()], before.clone());
        let e: Vec<f64> = numbers.iter().map(|[e, _]| *e).collect();
        let is_poisson = impacts.iter().any(|(_, i)| i.law == ImpactLaw::Poisson);
        let law = if is_poisson {
            ImpactLaw::Poisson
        } else {
            ImpactLaw::Newton
        };
        let impulses = law.impulses(&mut problem, &e);
        let impulses = impulses.map_err(|why| match why {
            NoSolution::Paradox(at) => Status::Painleve {
                switch: impacts[at].0,
            },
            NoSolution::NotFound => Status::NoSolution {
                switches: switches(),
            },
        })?;
        state.report.complementarity = state.report.complementarity.max(impulses.residual);
        let forces: Vec<f64> = (impulses.normal.iter().copied())
            .chain(impulses.tangential.iter().map(|beta| -0.5 * beta))
            .collect();
        of_contacts.take(&mut state.point.x, |switch| {
            rows.iter()
                .position(|&row| row == switch)
                .map(|row| forces[row])
        });
        if !state.point.x.iter().all(|x| x.is_finite()) {
            return Err(Status::NotFinite);
        }
        self.mode.move_to(&state.point);
        let mut work = Work::default();
        for (i, contact) in contacts.iter().enumerate() {
            let after = self.mode.psi(contact.normal);
            work.add(impulses.normal[i], before[i], after);
            for (&slip, t) in contact.slips.iter().zip(problem.w.slips(i)) {
                let friction = -numbers[i][1] * impulses.tangential[t];
                let after = self.mode.psi(slip);
                work.add(friction, before[contacts.len() + t], after);
            }
        }
        if work.gain > GAIN * work.exchanged {
            state.report.note(Note::EnergyGained {
                time: state.point.t,
                switches: switches(),
            });
        }
        Ok(())
    }

    /// Evaluates rates in the mode in which these contacts are closed and stick, without forces in them.
    fn enter_closed(&mut self, state: &mut State, contacts: &[ContactSwitches]) {
        let mut sides = state.point.sides.clone();
        for contact in contacts {
            sides[contact.normal] = Side::Slide;
            state.point.alpha[contact.normal] = 0.0;
            for &slip in &contact.slips {
                sides[slip] = Side::Slide;
                state.point.alpha[slip] = 0.5;
            }
        }
        self.mode.enter(&sides);
        self.mode
            .eval(state.point.t, &state.point.x, &state.point.alpha);
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
