//! Checks the invariants of a [`System`].

use rustc_hash::FxHashSet;

use super::regions::are_weights;
use super::{Body, Contact, Impulsive, Output, System, Task};
use crate::expr::{Expr, Node, Var, rewrite, variables_of};
use crate::system::switches::affine::is_affine;
use crate::system::switches::interaction::{positions, subsystems};

impl<'e> System<'e> {
    /// Names the first invariant that does not hold.
    pub fn verify(&self) -> Result<(), String> {
        let alphas = self.alphas();
        let recorded = self
            .outputs
            .iter()
            .chain(&self.controls)
            .flat_map(|output: &Output<'e>| &output.exprs);
        let rates = self
            .states
            .iter()
            .map(|state| (state.name.as_str(), state.rate));
        let weights = self
            .partitions
            .iter()
            .flat_map(|p| &p.regions)
            .map(|r| (r.name.as_str(), r.weight));
        let multi_affine: Vec<(&str, Expr<'e>)> = rates.chain(weights).collect();
        let psi = self.switches.iter().map(|switch| switch.psi);
        let indicators = self.partitions.iter().flat_map(|p| &p.indicators);
        let all: Vec<Expr<'e>> = multi_affine
            .iter()
            .map(|named| named.1)
            .chain(recorded.copied())
            .chain(self.limits.iter().map(|limit| limit.value))
            .chain(psi)
            .chain(indicators.copied())
            .chain(self.task.iter().flat_map(Task::exprs))
            .chain(
                self.laws
                    .iter()
                    .flat_map(|law| law.resets.iter().map(|r| r.1)),
            )
            .chain(self.laws.iter().map(|law| law.guard))
            .chain(self.contacts.iter().flat_map(Contact::exprs))
            .chain(self.impulsive.iter().flat_map(Impulsive::exprs))
            .chain(self.bodies.iter().flat_map(Body::exprs))
            .collect();

        if all.iter().any(|&e| has_nonsmooth_node(e)) {
            return Err("a nonsmooth term is left".into());
        }
        let known: FxHashSet<Var> = (self.params.iter().map(|param| param.var))
            .chain(self.states.iter().map(|state| state.var))
            .chain(self.data.iter().map(|data| data.var))
            .chain(
                self.task
                    .iter()
                    .flat_map(|task| &task.controls)
                    .map(|u| u.var),
            )
            .chain([self.time])
            .filter_map(Expr::as_variable)
            .chain(alphas.iter().copied())
            .collect();
        if let Some(var) = variables_of(&all)
            .into_iter()
            .find(|var| !known.contains(var))
        {
            return Err(format!(
                "`{}` is no time, parameter, data, state, control or α",
                self.exprs.name(var)
            ));
        }
        for (name, e) in multi_affine {
            for k in positions(e, &alphas) {
                if !self.switches[k].is_nonlinear && !is_affine(e, alphas[k]) {
                    return Err(format!(
                        "`{name}` is not affine in {}",
                        self.switches[k].alpha
                    ));
                }
            }
        }
        for (i, switch) in self.switches.iter().enumerate() {
            for j in positions(switch.psi, &alphas) {
                if j >= i && switch.relay.is_none() {
                    return Err(format!(
                        "ψ of `{}` holds the α of a later switch",
                        switch.name
                    ));
                }
            }
            if switch.psi.as_constant().is_some() {
                return Err(format!("ψ of `{}` is constant", switch.name));
            }
        }
        let is_shared = |s: &&super::Switch| s.slip_of.is_none() && s.role == super::Role::Step;
        let shared = || self.switches.iter().filter(is_shared);
        let surfaces: FxHashSet<Expr<'e>> = shared().map(|s| s.psi.split_scale().1).collect();
        if surfaces.len() < shared().count() {
            return Err("two switches share a surface".into());
        }
        if self.partitions.iter().any(|p| !are_weights(p, &alphas)) {
            return Err("the weights of a partition choose no region".into());
        }
        let rates: Vec<Expr<'e>> = self.states.iter().map(|state| state.rate).collect();
        let interacting = subsystems(&rates, &alphas);
        let is_inside = |group: &[usize]| {
            let holds = |s: &super::Subsystem| group.iter().all(|k| s.switches.contains(k));
            self.subsystems.iter().any(holds)
        };
        if interacting.iter().any(|group| !is_inside(&group.switches)) {
            return Err("α of different subsystems multiply each other".into());
        }
        let mut members: Vec<usize> = self
            .subsystems
            .iter()
            .flat_map(|s| s.switches.iter().copied())
            .collect();
        members.sort_unstable();
        if members != (0..self.switches.len()).collect::<Vec<_>>() {
            return Err("the subsystems are no partition of the switches".into());
        }
        Ok(())
    }

    /// The variables α_i.
    pub fn alphas(&self) -> Vec<Var> {
        self.switches
            .iter()
            .filter_map(|switch| switch.alpha.as_variable())
            .collect()
    }
}

fn has_nonsmooth_node(e: Expr<'_>) -> bool {
    let mut found = false;
    rewrite(e, &mut |node| {
        found |= match node.node() {
            Node::Unary(function, _) => function.is_nonsmooth(),
            Node::Binary(function, ..) => function.is_nonsmooth(),
            _ => false,
        };
        node
    });
    found
}
