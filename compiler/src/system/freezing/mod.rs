//! Time-freezing: a system with relays and elastic contacts -> one whose states do not jump.
//!
//! x' = s f(x),   t' = s,   s ∈ {0, 1} off all surfaces
//!
//! The run is in a numerical time τ, and physical time t is a state, the *clock*. Where the system has a jump, the
//! clock stands still, and auxiliary dynamics take the state from one side of it to the other: a relay moves a
//! memory (`relay`), an elastic contact compresses a spring (`bounce`), an inelastic one pushes (`rest`); while that
//! lasts, the clock is slower. What is left over the clock is the trajectory of the original system, which the way
//! back in [`Frozen`] is for.
//!
//! Nurkanović, Sartor, Albrecht & Diehl 2021 for the idea.

mod bounce;
mod check;
mod contact;
mod relay;
mod rest;
mod start;

use super::regions::subsystems_of;
use super::{Readings, State, Switch, System, SystemError, Task};
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::source::Span;
use crate::system::switches::affine::at;

/// A system in numerical time, and the way back to the one it comes from.
#[derive(Clone, Debug)]
pub struct Frozen<'e> {
    /// The states of the original, the clock, and what moves while that stands still.
    pub system: System<'e>,
    /// Number of states of the original, which come first.
    pub n_states: usize,
    /// The state that is physical time.
    pub clock: usize,
    /// Where each switch of the original is; none for relays and contacts.
    pub places: Vec<Option<usize>>,
    /// The relays.
    pub relays: Vec<Memory>,
    /// The contacts.
    pub contacts: Vec<Impact<'e>>,
    /// What contacts do to each other.
    pub meeting: Meeting,
}

/// Whether what forces do to velocities while the clock stands still is the law of the impact.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Meeting {
    /// Nothing says so beforehand.
    pub is_open: bool,
    /// Pairs of contacts that act on each other, one of them with friction: no motion is known for both at once.
    pub rough: Vec<[usize; 2]>,
}

/// A relay that has become a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// The relay in the original.
    pub relay: usize,
    /// The state that is 0 or 1 while time passes.
    pub state: usize,
}

/// A contact that has become motion of its own.
#[derive(Clone, Debug)]
pub struct Impact<'e> {
    /// The unilateral switch in the original.
    pub contact: usize,
    /// The law, jumps first and then contacts.
    pub law: usize,
    /// The switch that is below its surface while the contact acts.
    pub switch: usize,
    /// a: the force of a contact that lasts is a (1/t' - 1).
    pub strength: Expr<'e>,
    /// μ; none where it is smooth.
    pub friction: Option<Expr<'e>>,
    /// Where it is inelastic.
    pub rest: Option<Rest<'e>>,
}

/// How an inelastic contact lasts.
#[derive(Clone, Debug)]
pub struct Rest<'e> {
    /// The switch of the gap's rate, which slides.
    pub speed: usize,
    /// What must be positive.
    pub cone: Vec<Expr<'e>>,
}

/// The frozen system; what moves while the clock stands still takes a share of `pace`, a time.
pub fn freeze<'e>(system: &System<'e>, pace: f64) -> Result<Frozen<'e>, SystemError> {
    check::check(system)?;
    let exprs = system.exprs;
    let contacts = contact::contacts(system)?;
    let meeting = check::together(system, &contacts)?;
    let relays = (0..system.switches.len()).filter(|&k| system.switches[k].relay.is_some());
    let relays: Vec<usize> = relays.collect();

    // Motion without contact, then the rate of the clock.
    let open = |rate: Expr<'e>| {
        let apart = contacts.iter().map(|contact| alpha(system, contact.switch));
        apart.fold(rate, |rate, alpha| at(rate, alpha, 1.0))
    };
    let mut rates: Vec<Expr<'e>> = system.states.iter().map(|s| open(s.rate)).collect();
    rates.push(exprs.constant(1.0));

    // Integrals of a cost stay behind all other states.
    let integrals = system.task.as_ref().map_or(0, |task| task.integrals);
    let n_states = system.states.len() - integrals;
    let mut frozen = Frozen {
        system: system.clone(),
        n_states,
        clock: n_states,
        places: vec![None; system.switches.len()],
        relays: Vec::new(),
        contacts: Vec::new(),
        meeting,
    };
    let mut switches: Vec<Switch<'e>> = Vec::new();
    for (k, switch) in system.switches.iter().enumerate() {
        let is_kept = switch.relay.is_none() && !switch.unilateral;
        if is_kept {
            frozen.places[k] = Some(switches.len());
            switches.push(Switch {
                slip_of: None,
                ..switch.clone()
            });
        }
    }
    for switch in &mut switches {
        let other = switch.across.and_then(|other| frozen.places[other]);
        switch.across = other;
    }
    let mut added: Vec<State<'e>> = Vec::new();
    let mut partitions = system.partitions.clone();
    partitions.retain(|partition| {
        let weights: Vec<Expr<'e>> = partition.regions.iter().map(|r| r.weight).collect();
        let inside = variables_of(&weights);
        !relays.iter().any(|&k| inside.contains(&alpha(system, k)))
    });
    for partition in &mut partitions {
        let place = |k: usize| frozen.places[k];
        partition.switches = partition
            .switches
            .iter()
            .filter_map(|&k| place(k))
            .collect();
        for region in &mut partition.regions {
            for literal in region.literals.iter_mut().flatten() {
                literal.0 =
                    place(literal.0).expect("relays and contacts are in no guard that is kept");
            }
        }
    }
    for &k in &relays {
        let first = switches.len();
        let cells = relay::cells(system, k, pace, first);
        let read = alpha(system, k);
        for rate in &mut rates {
            *rate = at(*rate, read, 0.0) * cells.off + at(*rate, read, 1.0) * cells.on;
        }
        frozen.relays.push(Memory {
            relay: k,
            state: n_states + 1 + added.len(),
        });
        switches.extend(cells.switches);
        added.push(cells.memory);
        partitions.push(cells.partition);
    }
    let speeds = bounce::speeds(system, &contacts, pace);
    let mut forces = vec![exprs.constant(0.0); rates.len()];
    for (contact, expected) in contacts.iter().zip(speeds) {
        let switch = switches.len();
        let strength;
        let rest = if contact.is_inelastic() {
            let rest = rest::rest(system, contact, pace, (&mut rates, &mut forces));
            switches.extend(rest.switches);
            strength = exprs.constant(rest.strength);
            Some(Rest {
                speed: switch + 1,
                cone: rest.cone,
            })
        } else {
            let bounce =
                bounce::bounce(system, contact, (expected, pace), (&mut rates, &mut forces));
            switches.push(bounce.switch);
            added.push(bounce.state);
            strength = bounce.strength;
            None
        };
        frozen.contacts.push(Impact {
            contact: contact.switch,
            law: contact.law,
            switch,
            strength,
            friction: contact
                .friction
                .as_ref()
                .map(|friction| friction.coefficient),
            rest,
        });
    }

    for (rate, force) in rates.iter_mut().zip(forces) {
        *rate = *rate + force;
    }

    let clock = State {
        name: "time".to_owned(),
        var: system.time,
        initial: 0.0,
        rate: rates[system.states.len()],
        span: Span::default(),
    };
    let task = system.task.as_ref();
    // While time passes a relay is what it remembers.
    let memories = relays.iter().zip(&added);
    let memories = memories.map(|(&k, memory)| (alpha(system, k), memory.var));
    let memories: Substitution = memories.collect();
    let task = task.map(|task| Task {
        clock: Some(n_states),
        ..task.map(|e| e.substitute(&memories))
    });
    let whole = &mut frozen.system;
    for (state, rate) in whole.states.iter_mut().zip(&rates) {
        state.rate = *rate;
    }
    let last = whole.states.split_off(n_states);
    whole.states.push(clock);
    whole.states.extend(added);
    whole.states.extend(last);
    whole.task = task;
    let set: Vec<usize> = (0..whole.states.len()).collect();
    for partition in partitions.iter_mut().filter(|p| p.states.is_empty()) {
        partition.states.clone_from(&set);
    }
    whole.time = exprs.variable("tau");
    whole.clock = Some(n_states);
    let rates: Vec<Expr<'e>> = whole.states.iter().map(|state| state.rate).collect();
    let alphas: Vec<Var> = switches
        .iter()
        .filter_map(|s| s.alpha.as_variable())
        .collect();
    whole.subsystems = subsystems_of(&rates, &alphas, &partitions);
    (whole.switches, whole.partitions) = (switches, partitions);
    // What is recorded, watched and read is that of the original.
    (whole.outputs, whole.controls, whole.limits) = (Vec::new(), Vec::new(), Vec::new());
    (whole.groups, whole.skipped) = (Vec::new(), Vec::new());
    (whole.laws, whole.contacts, whole.bodies) = (Vec::new(), Vec::new(), Vec::new());
    whole.readings = Readings::default();
    debug_assert_eq!(
        whole.verify(),
        Ok(()),
        "freezing keeps the invariants of `System`"
    );
    Ok(frozen)
}

/// α of a switch.
fn alpha(system: &System<'_>, switch: usize) -> Var {
    let alpha = system.switches[switch].alpha.as_variable();
    alpha.expect("α of a switch is a variable")
}

/// ∂e/∂x of a state.
fn slope<'e>(system: &System<'e>, e: Expr<'e>, state: usize) -> Expr<'e> {
    let var = system.states[state].var.as_variable();
    e.diff(var.expect("a state is a variable"))
}

/// de/dt where states have these rates.
fn along<'e>(system: &System<'e>, e: Expr<'e>, rate: impl Fn(usize) -> Expr<'e>) -> Expr<'e> {
    let states = (0..system.states.len()).map(|state| (state, slope(system, e, state)));
    let states = states.filter(|(_, slope)| !slope.is_zero());
    let by_state = states.map(|(state, slope)| slope * rate(state));
    let by_time = system.time.as_variable().map(|time| e.diff(time));
    system.exprs.sum(by_state.chain(by_time))
}

/// Parameters as numbers, free ones at their guesses.
fn numbers<'e>(system: &System<'e>) -> Substitution<'e> {
    system.params_as_numbers(|_| true)
}

/// Parameters that are not free as numbers.
fn fixed<'e>(system: &System<'e>) -> Substitution<'e> {
    system.params_as_numbers(|place| !system.is_free(place))
}
