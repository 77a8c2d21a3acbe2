//! Bodies and contacts as the solver sees them: one function serves all contacts of one form.

use nsd_solver::hybrid::Input;
use nsd_solver::moreau::{Body, Family, Scene};
use rustc_hash::FxHashMap;

use crate::expr::{Expr, Substitution, Var};
use crate::lowering::hybrid;
use crate::lowering::hybrid::{Copy, ExprForm, tape, variable};
use crate::simulate::methods::adaptive::Inputs;
use crate::system::System;

/// Where everything is that contacts depend on.
struct Places {
    /// What every variable stands for.
    inputs: FxHashMap<Var, Input>,
    /// By state.
    is_velocity: Vec<bool>,
    n_states: usize,
    n_coefficients: usize,
}

impl Places {
    fn is_velocity(&self, var: Var) -> bool {
        matches!(self.inputs.get(&var), Some(Input::State(i)) if self.is_velocity[*i])
    }

    /// Where the numbers begin.
    fn end(&self) -> usize {
        1 + self.n_states + self.n_coefficients
    }
}

/// The bodies and contacts of a system.
pub(crate) fn scene<'e>(system: &System<'e>, inputs: &Inputs<'e>) -> Scene {
    let n = system.states.len();
    let mut is_velocity = vec![false; n];
    for &state in system.jumps.bodies.iter().flat_map(|body| &body.velocities) {
        is_velocity[state] = true;
    }
    let mut stands_for = FxHashMap::default();
    for (at, &var) in inputs.vars.iter().enumerate() {
        let coefficient = 1 + n + system.switches.len();
        let input = match at {
            0 => Input::Time,
            at if at <= n => Input::State(at - 1),
            at if at < coefficient => continue,
            at => Input::Coefficient(at - coefficient),
        };
        stands_for.insert(var, input);
    }
    let places = Places {
        inputs: stands_for,
        is_velocity,
        n_states: n,
        n_coefficients: inputs.vars.len() - 1 - n - system.switches.len(),
    };
    let groups = groups(system, inputs);
    let kind = |var: Var| match places.inputs.get(&var) {
        Some(Input::Time) => 0,
        Some(Input::Coefficient(_)) => 4,
        _ if places.is_velocity(var) => 5,
        _ => 3,
    };
    let (forms, copies) = hybrid::share(system.exprs, &groups, kind);
    let time = variable(system.time);
    let mut families: Vec<Family> = forms
        .iter()
        .map(|form| family(form, &places, time, system.exprs.constant(0.0)))
        .collect();
    let mut numbers = Numbers::default();
    for (contact, copy) in copies.iter().enumerate() {
        let family = &mut families[copy.form];
        family.contacts.push(contact as u32);
        places_of(copy, &places, &mut numbers, &mut family.inputs);
    }
    let body = |body: &crate::system::Body| Body {
        positions: body.positions.clone(),
        velocities: body.velocities.clone(),
    };
    Scene {
        bodies: system.jumps.bodies.iter().map(body).collect(),
        families,
        first_number: places.end(),
        numbers: numbers.values,
        n_contacts: system.jumps.impulsive.len(),
    }
}

/// Gap, restitution, and friction and the entries of the slip velocity of every contact.
fn groups<'e>(system: &System<'e>, inputs: &Inputs<'e>) -> Vec<Vec<Expr<'e>>> {
    let all: Vec<Expr<'e>> = (system.jumps.impulsive.iter())
        .flat_map(|contact| contact.exprs())
        .collect();
    let mut all = inputs.numbers.apply(&all).into_iter();
    let group = |contact: &crate::system::Impulsive<'e>| {
        let slips = contact.friction.as_ref().map(|(_, slips)| slips.len());
        let n = 2 + slips.map_or(0, |slips| 1 + slips);
        all.by_ref().take(n).collect()
    };
    system.jumps.impulsive.iter().map(group).collect()
}

/// Numbers of which equal ones share a place.
#[derive(Default)]
struct Numbers {
    values: Vec<f64>,
    places: FxHashMap<u64, u32>,
}

impl Numbers {
    fn place(&mut self, number: f64) -> u32 {
        let next = self.values.len() as u32;
        let place = *self.places.entry(number.to_bits()).or_insert(next);
        if place == next {
            self.values.push(number);
        }
        place
    }
}

/// Where the inputs of a contact are.
fn places_of(copy: &Copy, places: &Places, numbers: &mut Numbers, found: &mut Vec<u32>) {
    let place = |var: &Var| match places.inputs[var] {
        Input::State(state) => 1 + state,
        Input::Coefficient(coefficient) => 1 + places.n_states + coefficient,
        _ => 0,
    };
    found.extend(copy.vars.iter().map(|var| place(var) as u32));
    let first = places.end() as u32;
    let numbers = copy
        .numbers
        .iter()
        .map(|&number| first + numbers.place(number));
    found.extend(numbers);
}

/// The functions of a form.
fn family<'e>(form: &ExprForm<'e>, places: &Places, time: Var, zero: Expr<'e>) -> Family {
    let inputs: Vec<Var> = form.vars.iter().chain(&form.holes).copied().collect();
    let (gap, restitution) = (form.functions[0], form.functions[1]);
    let friction = form.functions.get(2).copied().unwrap_or(zero);
    let slips = form.functions.get(3..).unwrap_or_default();
    let is_state = |var: Var| matches!(places.inputs.get(&var), Some(Input::State(_)));
    let slopes = |of: Expr<'e>, velocities: bool| -> Vec<(usize, Expr<'e>)> {
        let states = inputs.iter().enumerate();
        let states =
            states.filter(|(_, var)| is_state(**var) && places.is_velocity(**var) == velocities);
        states
            .map(|(at, &var)| (at, of.diff(var)))
            .filter(|(_, slope)| !slope.is_zero())
            .collect()
    };
    let by_position = slopes(gap, false);
    let by_velocity: Vec<_> = slips.iter().map(|&slip| slopes(slip, true)).collect();
    let velocities = inputs.iter().filter(|var| places.is_velocity(**var));
    let at_rest: Substitution<'e> = velocities.map(|&var| (var, zero)).collect();
    let mut outputs = vec![gap, gap.diff(time), restitution, friction];
    outputs.extend(slips.iter().map(|slip| slip.substitute(&at_rest)));
    let by_all = by_position.iter().chain(by_velocity.iter().flatten());
    outputs.extend(by_all.map(|slope| slope.1));
    Family {
        gap: tape(&inputs, &[gap]),
        row: tape(&inputs, &outputs),
        positions: by_position.iter().map(|slope| slope.0).collect(),
        slips: (by_velocity.iter())
            .map(|slopes| slopes.iter().map(|slope| slope.0).collect())
            .collect(),
        inputs: Vec::new(),
        contacts: Vec::new(),
    }
}
