//! Inputs and controls of parts, replaced by what they are connected to.
//!
//! ```text
//! y = g(x, w),   w = h(x, y', ..)   becomes   y = g(x, h(..))
//! ```
//!
//! Parts are lowered with variables for their inputs, so that they may read each other in any order.
//! Here each input gets its expression, those it reads first; a circle of inputs, outputs and switches
//! that need each other at one instant has no such order and is an error. Afterwards what was given is
//! a `let` of the whole.

use std::collections::BTreeMap;
use std::rc::Rc;

use rustc_hash::FxHashMap;

use super::bind::Bound;
use super::order::{chain, topological};
use super::scope::{Meaning, Scope};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{DynamicsError, Model, ModelError, Named, Quantity, TargetKind, Tensor};

/// Puts in what is given to inputs and controls; false after an error.
pub(crate) fn connect<'e>(
    model: &mut Model<'e>,
    bound: Bound<'e>,
    diags: &mut Diagnostics,
) -> bool {
    if bound.connections.is_empty() {
        return true;
    }
    let Some((values, switch_order)) = solve(model, &bound, diags) else {
        return false;
    };
    let mut connected = Connected {
        values,
        kinds: FxHashMap::default(),
    };
    connected.reorder_switches(model, &switch_order);
    let inputs = std::mem::take(&mut model.inputs);
    model.inputs = connected.split(inputs, TargetKind::Input, model);
    let controls = std::mem::take(&mut model.controls);
    model.controls = connected.split(controls, TargetKind::Control, model);

    for named in model.lets.iter_mut().chain(&mut model.outputs) {
        connected.replace(&mut named.value.data);
    }
    for switch in &mut model.switches {
        connected.replace(&mut switch.psi);
    }
    let in_regions = model
        .regions
        .iter_mut()
        .flat_map(|region| &mut region.rates);
    let hidden = model.hidden.iter_mut().flat_map(|hidden| &mut hidden.rates);
    for rate in model.dynamics.iter_mut().chain(in_regions).chain(hidden) {
        rate.value = rate.value.substitute(&connected.values);
    }
    for hidden in &mut model.hidden {
        hidden.switch = switch_order
            .iter()
            .position(|&old| old == hidden.switch)
            .unwrap_or(hidden.switch);
    }
    let mut fine = true;
    for region in &mut model.regions {
        region.guard = region.guard.substitute(&connected.values);
        if let Some(value) = region.guard.as_constant().filter(|_| !region.is_else) {
            fine = false;
            diags.push(DynamicsError::ConstantComparison {
                value: value > 0.5,
                span: region.guard_span,
            });
        }
    }
    for body in &mut model.bodies {
        connected.replace(&mut body.mass);
        connected.replace(&mut body.inverse);
        connected.replace(&mut body.force);
    }
    for contact in &mut model.contacts {
        let friction = contact.friction.as_mut().map(|friction| &mut friction.0);
        let exprs = [&mut contact.gap, &mut contact.restitution.coefficient].into_iter();
        for e in exprs.chain(friction).chain(&mut contact.slip.0) {
            *e = e.substitute(&connected.values);
        }
    }
    for projection in &mut model.projections {
        let constraints = projection.constraints.iter_mut().map(|row| &mut row.c);
        for e in constraints.chain(projection.metric.iter_mut().flatten()) {
            *e = e.substitute(&connected.values);
        }
    }
    for jump in &mut model.jumps {
        jump.guard = jump.guard.substitute(&connected.values);
        if let Some(value) = jump.guard.as_constant() {
            fine = false;
            diags.push(DynamicsError::ConstantComparison {
                value: value > 0.5,
                span: jump.guard_span,
            });
        }
        for reset in &mut jump.resets {
            reset.value = reset.value.substitute(&connected.values);
        }
    }
    for rounded in &mut model.rounded {
        rounded.argument = rounded.argument.substitute(&connected.values);
        rounded.period = (rounded.period).map(|period| period.substitute(&connected.values));
    }
    for surface in &mut model.surfaces {
        surface.psi = surface.psi.substitute(&connected.values);
    }
    model
        .surfaces
        .retain(|surface| surface.psi.is_zero() || surface.psi.as_constant().is_none());
    model.scope = connected.scope(&model.scope);
    fine
}

/// Every connection without the others, and an order in which switches come after those they read.
fn solve<'e>(
    model: &Model<'e>,
    bound: &Bound<'e>,
    diags: &mut Diagnostics,
) -> Option<(Substitution<'e>, Vec<usize>)> {
    let n_switches = model.switches.len();
    let mut owner: FxHashMap<Var, usize> = FxHashMap::default();
    for (index, switch) in model.switches.iter().enumerate() {
        let vars = switch.vars.iter().filter_map(|var| var.as_variable());
        owner.extend(vars.map(|var| (var, index)));
    }
    for (index, connection) in bound.connections.iter().enumerate() {
        owner.insert(connection.var, n_switches + index);
    }
    let read = |exprs: &[Expr<'e>]| -> Vec<usize> {
        let vars = variables_of(exprs).into_iter();
        let mut nodes: Vec<usize> = vars.filter_map(|var| owner.get(&var).copied()).collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    };
    let switches = model.switches.iter().map(|switch| read(&switch.psi));
    let inputs = bound.connections.iter();
    let inputs = inputs.map(|connection| read(&[connection.value]));
    let needs: Vec<Vec<usize>> = switches.chain(inputs).collect();
    let (order, cycles) = topological(&needs);

    let names = model.switches.iter().map(|switch| switch.name.clone());
    let inputs = bound.connections.iter();
    let inputs = inputs.map(|connection| model.exprs.name(connection.var));
    let names: Vec<String> = names.chain(inputs).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut told = vec![false; needs.len()];
    for cycle in &cycles {
        // There is an input in every circle: declarations of one model have an order.
        let input = cycle.iter().position(|&node| node >= n_switches);
        let Some(input) = input.filter(|_| !cycle.iter().any(|&node| told[node])) else {
            continue;
        };
        let mut cycle = cycle.clone();
        cycle.rotate_left(input);
        cycle.iter().for_each(|&node| told[node] = true);
        diags.push(ModelError::Loop {
            name: names[cycle[0]].to_owned(),
            chain: chain(&cycle, &names),
            span: bound.connections[cycle[0] - n_switches].span,
        });
    }
    if !cycles.is_empty() {
        return None;
    }
    let mut values = Substitution::new();
    for &node in order.iter().filter(|&&node| node >= n_switches) {
        let connection = &bound.connections[node - n_switches];
        let value = connection.value.substitute(&values);
        values.insert(connection.var, value);
    }
    let switches = order.into_iter().filter(|&node| node < n_switches);
    Some((values, switches.collect()))
}

/// What inputs have become.
struct Connected<'e> {
    values: Substitution<'e>,
    /// Where things stand that have moved.
    kinds: FxHashMap<TargetKind, TargetKind>,
}

impl<'e> Connected<'e> {
    fn replace(&self, entries: &mut [Expr<'e>]) {
        let values = self.values.apply(entries);
        entries.copy_from_slice(&values);
    }

    fn reorder_switches(&mut self, model: &mut Model<'e>, order: &[usize]) {
        let mut old: Vec<Option<_>> = std::mem::take(&mut model.switches)
            .into_iter()
            .map(Some)
            .collect();
        for (new, &from) in order.iter().enumerate() {
            model.switches.extend(old[from].take());
            let kind = TargetKind::Switch(from);
            self.kinds.insert(kind, TargetKind::Switch(new));
        }
    }

    /// The quantities that are not connected; the others become `let`s.
    fn split(
        &mut self,
        quantities: Vec<Quantity<'e>>,
        kind: fn(usize) -> TargetKind,
        model: &mut Model<'e>,
    ) -> Vec<Quantity<'e>> {
        let mut kept = vec![];
        for (index, quantity) in quantities.into_iter().enumerate() {
            let data = self.values.apply(&quantity.vars);
            let now = if data == quantity.vars {
                kept.push(quantity);
                kind(kept.len() - 1)
            } else {
                let shape = quantity.shape;
                if quantity.domain.is_some() {
                    model.connected.push(Quantity {
                        vars: data.clone(),
                        ..quantity.clone()
                    });
                }
                model.lets.push(Named {
                    name: quantity.name,
                    value: Tensor { shape, data },
                    span: quantity.span,
                });
                TargetKind::Let(model.lets.len() - 1)
            };
            self.kinds.insert(kind(index), now);
        }
        kept
    }

    /// The names of an instance with what they mean now; parts are not nested deeply.
    fn scope(&self, scope: &Scope<'e>) -> Scope<'e> {
        let names = scope.names.iter();
        let names = names.map(|(name, meaning)| (name.clone(), self.meaning(meaning)));
        Scope {
            names: names.collect(),
            ..scope.clone()
        }
    }

    fn meaning(&self, meaning: &Meaning<'e>) -> Meaning<'e> {
        let mut meaning = meaning.clone();
        let member = |value: &mut Tensor<'e>, kind: &mut TargetKind| {
            self.replace(&mut value.data);
            *kind = self.kinds.get(kind).copied().unwrap_or(*kind);
        };
        match &mut meaning {
            Meaning::Value(value, kind) => member(&mut value.tensor, kind),
            Meaning::Family { members, .. } => members
                .values_mut()
                .for_each(|(value, kind)| member(&mut value.tensor, kind)),
            Meaning::Part(scope) => *scope = Rc::new(self.scope(scope)),
            Meaning::Parts(members) => {
                let scopes = members.iter();
                let scopes = scopes.map(|(&index, scope)| (index, Rc::new(self.scope(scope))));
                *members = scopes.collect::<BTreeMap<_, _>>();
            }
            Meaning::Word(_) | Meaning::Module(_) | Meaning::Unusable => {}
        }
        meaning
    }
}
