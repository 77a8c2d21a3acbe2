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
use super::scope::{Meaning, Scope};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::hir::order::{chain, topological};
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
    let inputs = std::mem::take(&mut model.quantities.inputs);
    model.quantities.inputs = connected.split(inputs, TargetKind::Input, model);
    let controls = std::mem::take(&mut model.quantities.controls);
    model.quantities.controls = connected.split(controls, TargetKind::Control, model);

    connected.put_into(model);
    for hidden in &mut model.statements.hidden {
        let mut places = switch_order.iter();
        let place = places.position(|&old| old == hidden.switch);
        hidden.switch = place.unwrap_or(hidden.switch);
    }
    model
        .surfaces
        .retain(|surface| surface.psi.is_zero() || surface.psi.as_constant().is_none());
    model.scope = connected.scope(&model.scope);
    check_guards(model, diags)
}

/// Reports the guards that are true or false at all times; false where there are any.
fn check_guards(model: &Model<'_>, diags: &mut Diagnostics) -> bool {
    let regions = model
        .statements
        .regions
        .iter()
        .filter(|region| !region.is_else);
    let regions = regions.map(|region| (region.guard, region.guard_span));
    let jumps = model.statements.jumps.iter();
    let jumps = jumps.filter_map(|jump| Some((jump.when.guard()?, jump.when_span)));
    let guards = regions.chain(jumps);
    let mut fine = true;
    for (guard, span) in guards {
        if let Some(value) = guard.as_constant() {
            fine = false;
            let value = value > 0.5;
            diags.push(DynamicsError::ConstantComparison { value, span });
        }
    }
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

    fn replace_each<'a>(&self, exprs: impl Iterator<Item = &'a mut Expr<'e>>)
    where
        'e: 'a,
    {
        exprs.for_each(|e| *e = e.substitute(&self.values));
    }

    /// Puts the values into everything that a model says.
    fn put_into(&self, model: &mut Model<'e>) {
        for named in model
            .definitions
            .lets
            .iter_mut()
            .chain(&mut model.definitions.outputs)
        {
            self.replace(&mut named.value.data);
        }
        for switch in &mut model.switches {
            self.replace(&mut switch.psi);
        }
        let in_regions = model.statements.regions.iter_mut();
        let in_regions = in_regions.flat_map(|region| &mut region.rates);
        let hidden = model
            .statements
            .hidden
            .iter_mut()
            .flat_map(|hidden| &mut hidden.rates);
        let rates = model
            .statements
            .dynamics
            .iter_mut()
            .chain(in_regions)
            .chain(hidden);
        self.replace_each(rates.map(|rate| &mut rate.value));
        self.replace_each(
            model
                .statements
                .regions
                .iter_mut()
                .map(|region| &mut region.guard),
        );
        for body in &mut model.statements.bodies {
            self.replace(&mut body.mass);
            self.replace(&mut body.inverse);
            self.replace(&mut body.force);
        }
        for contact in &mut model.statements.contacts {
            let friction = contact.friction.as_mut().map(|friction| &mut friction.0);
            let exprs = [&mut contact.gap, &mut contact.restitution.coefficient].into_iter();
            self.replace_each(exprs.chain(friction).chain(&mut contact.slip.0));
        }
        for projection in &mut model.statements.projections {
            let constraints = projection.constraints.iter_mut().map(|row| &mut row.c);
            self.replace_each(constraints.chain(projection.metric.iter_mut().flatten()));
        }
        for jump in &mut model.statements.jumps {
            let values = jump.resets.iter_mut().map(|reset| &mut reset.value);
            self.replace_each(jump.when.exprs_mut().chain(values));
        }
        for rounded in &mut model.rounded {
            let argument = [&mut rounded.argument].into_iter();
            let given = rounded.period.iter_mut().chain(&mut rounded.duty);
            self.replace_each(argument.chain(given));
        }
        self.replace_each(model.surfaces.iter_mut().map(|surface| &mut surface.psi));
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
                    model.quantities.connected.push(Quantity {
                        is_discrete: false,
                        vars: data.clone(),
                        ..quantity.clone()
                    });
                }
                model.definitions.lets.push(Named {
                    name: quantity.name,
                    unit: quantity.unit,
                    value: Tensor { shape, data },
                    span: quantity.span,
                });
                TargetKind::Let(model.definitions.lets.len() - 1)
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
                let scopes =
                    scopes.map(|(index, scope)| (index.clone(), Rc::new(self.scope(scope))));
                *members = scopes.collect::<BTreeMap<_, _>>();
            }
            Meaning::Word(_) | Meaning::Module(_) | Meaning::Unusable => {}
        }
        meaning
    }
}
