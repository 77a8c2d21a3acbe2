//! Checks the invariants of a [`System`].

use rustc_hash::FxHashSet;

use super::regions::are_weights;
use super::{Body, Contact, Impulsive, Law, Output, Role, Subsystem, Switch, System, Task};
use crate::expr::{Expr, Var, has_kinks, variables_of};
use crate::system::switches::affine::is_affine;
use crate::system::switches::interaction::{positions, subsystems};

impl System<'_> {
    /// Names the first invariant that does not hold.
    pub fn verify(&self) -> Result<(), String> {
        let alphas = alphas_of(&self.switches);
        verify_terms(self, &alphas)?;
        verify_affine(self, &alphas)?;
        verify_surfaces(self, &alphas)?;
        let mut partitions = self.coupling.partitions.iter();
        if partitions.any(|p| !are_weights(p, &alphas)) {
            return Err("the weights of a partition choose no region".into());
        }
        verify_subsystems(self, &alphas)
    }
}

/// The variables α_i.
pub(super) fn alphas_of(switches: &[Switch<'_>]) -> Vec<Var> {
    let alphas = switches.iter();
    alphas
        .filter_map(|switch| switch.alpha.as_variable())
        .collect()
}

/// Rates and weights of regions, by name.
fn multi_affine<'s, 'e>(system: &'s System<'e>) -> impl Iterator<Item = (&'s str, Expr<'e>)> {
    let rates = system.states.iter();
    let rates = rates.map(|state| (state.name.as_str(), state.rate));
    let regions = system.coupling.partitions.iter().flat_map(|p| &p.regions);
    rates.chain(regions.map(|r| (r.name.as_str(), r.weight)))
}

/// Every expression is smooth, in variables of the system.
fn verify_terms(system: &System<'_>, alphas: &[Var]) -> Result<(), String> {
    let recorded = system.recorded.signals();
    let recorded = recorded.flat_map(|output: &Output<'_>| &output.exprs);
    let partitions = system.coupling.partitions.iter();
    let indicators = partitions.flat_map(|p| &p.indicators);
    let all: Vec<Expr<'_>> = (multi_affine(system).map(|named| named.1))
        .chain(recorded.chain(indicators).copied())
        .chain(system.recorded.limits.iter().map(|limit| limit.value))
        .chain(system.switches.iter().map(|switch| switch.psi))
        .chain(system.task.iter().flat_map(Task::exprs))
        .chain(system.jumps.laws.iter().flat_map(Law::exprs))
        .chain(system.jumps.contacts.iter().flat_map(Contact::exprs))
        .chain(system.jumps.impulsive.iter().flat_map(Impulsive::exprs))
        .chain(system.jumps.bodies.iter().flat_map(Body::exprs))
        .collect();
    // Instants are numbers, whatever function of parameters they are.
    let laws = system.jumps.laws.iter();
    let instants = laws.filter(|law| law.when.guard().is_none());
    let instants: Vec<Expr<'_>> = instants.flat_map(|law| law.when.exprs()).collect();
    if all.iter().any(|&e| has_kinks(e) && !instants.contains(&e)) {
        return Err("a nonsmooth term is left".into());
    }
    let controls = system.task.iter().flat_map(|task| &task.controls);
    let known: FxHashSet<Var> = (system.exogenous.params.iter().map(|param| param.var))
        .chain(system.states.iter().map(|state| state.var))
        .chain(system.exogenous.data.iter().map(|data| data.var))
        .chain(controls.map(|u| u.var))
        .chain([system.time])
        .filter_map(Expr::as_variable)
        .chain(alphas.iter().copied())
        .chain(system.jumps.comparisons.iter().map(|known| known.var))
        .collect();
    let mut unknown = variables_of(&all).into_iter();
    match unknown.find(|var| !known.contains(var)) {
        Some(var) => Err(format!(
            "`{}` is no time, parameter, data, state, control or α",
            system.exprs.name(var)
        )),
        None => Ok(()),
    }
}

/// Rates and weights are affine in every α that is not nonlinear.
fn verify_affine(system: &System<'_>, alphas: &[Var]) -> Result<(), String> {
    for (name, e) in multi_affine(system) {
        for k in positions(e, alphas) {
            let switch = &system.switches[k];
            if !switch.is_nonlinear && !is_affine(e, alphas[k]) {
                return Err(format!("`{name}` is not affine in {}", switch.alpha));
            }
        }
    }
    Ok(())
}

/// ψ holds α of earlier switches, is not constant, and no multiple of another one, but for slip velocities, in numerical time
/// too: friction has an α of its own.
fn verify_surfaces(system: &System<'_>, alphas: &[Var]) -> Result<(), String> {
    for (i, switch) in system.switches.iter().enumerate() {
        let inside = positions(switch.psi, alphas);
        if inside.into_iter().any(|j| j >= i) && switch.relay.is_none() {
            let name = &switch.name;
            return Err(format!("ψ of `{name}` holds the α of a later switch"));
        }
        if switch.psi.as_constant().is_some() {
            return Err(format!("ψ of `{}` is constant", switch.name));
        }
    }
    let is_shared = |s: &&Switch<'_>| s.slip_of.is_none() && s.role == Role::Step;
    if system.clock.is_some() {
        return Ok(());
    }
    let shared = || system.switches.iter().filter(is_shared);
    let surfaces: FxHashSet<Expr<'_>> = shared().map(|s| s.psi.split_scale().1).collect();
    match surfaces.len() < shared().count() {
        true => Err("two switches share a surface".into()),
        false => Ok(()),
    }
}

/// Subsystems are a partition of the switches, and hold those that multiply each other.
fn verify_subsystems(system: &System<'_>, alphas: &[Var]) -> Result<(), String> {
    let rates: Vec<Expr<'_>> = system.states.iter().map(|state| state.rate).collect();
    let interacting = subsystems(&rates, alphas);
    let is_inside = |group: &[usize]| {
        let holds = |s: &Subsystem| group.iter().all(|k| s.switches.contains(k));
        system.coupling.subsystems.iter().any(holds)
    };
    if interacting.iter().any(|group| !is_inside(&group.switches)) {
        return Err("α of different subsystems multiply each other".into());
    }
    let members = system.coupling.subsystems.iter().flat_map(|s| &s.switches);
    let mut members: Vec<usize> = members.copied().collect();
    members.sort_unstable();
    match members.into_iter().eq(0..system.switches.len()) {
        true => Ok(()),
        false => Err("the subsystems are no partition of the switches".into()),
    }
}
