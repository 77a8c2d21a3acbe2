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

use self::contact::Contact;
pub use self::start::{Measures, Start};
use super::regions::subsystems_of;
use super::{Param, Partition, Readings, Recorded, State, Switch, System, SystemError, Task};
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::source::Span;
use crate::system::switches::affine::at;
use crate::system::verify::alphas_of;

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
    /// How runs start.
    pub start: Start,
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
    let as_numbers = |_: String, value: f64| (system.exprs.constant(value), None);
    frozen(system, pace, &Numbers::of(system, &[]), as_numbers)
}

/// The same for runs with other values of some parameters, by their numbers, from any start and with any pace: the
/// [`Measures`] of a run are parameters behind those of the system.
pub fn freeze_open<'e>(
    system: &System<'e>,
    pace: f64,
    open: &[usize],
) -> Result<Frozen<'e>, SystemError> {
    let as_params = |name: String, value: f64| {
        let var = system.exprs.variable(&name);
        (var, Some(Param { name, var, value }))
    };
    frozen(system, pace, &Numbers::of(system, open), as_params)
}

/// The first of some parameters, by their numbers, with another value of which a system may be frozen into another one.
pub fn first_deciding(system: &System<'_>, pace: f64, open: &[usize]) -> Option<usize> {
    let is_other = |n: &usize| freeze_open(system, pace, &open[..*n]).is_err();
    (1..=open.len()).find(is_other).map(|n| open[n - 1])
}

/// What numbers are known, and what stays open.
struct Numbers<'e> {
    /// Parameters that are neither optimized nor open.
    fixed: Substitution<'e>,
    open: Vec<Var>,
}

impl<'e> Numbers<'e> {
    fn of(system: &System<'e>, open: &[usize]) -> Self {
        let is_fixed = |place: usize| !system.is_free(place) && !open.contains(&place);
        let vars = open.iter().map(|&place| system.exogenous.params[place].var);
        Numbers {
            fixed: system.params_as_numbers(is_fixed),
            open: vars.filter_map(|var| var.as_variable()).collect(),
        }
    }
}

/// The frozen system with measures as `measure` has them, by name and value.
fn frozen<'e>(
    system: &System<'e>,
    pace: f64,
    numbers: &Numbers<'e>,
    measure: impl Fn(String, f64) -> (Expr<'e>, Option<Param<'e>>),
) -> Result<Frozen<'e>, SystemError> {
    check::check(system)?;
    let contacts = contact::contacts(system, numbers)?;
    check::distinct(system, &contacts)?;
    let meeting = check::together(system, &contacts, numbers)?;
    let relays = (0..system.switches.len()).filter(|&k| system.switches[k].relay.is_some());
    let relays: Vec<usize> = relays.collect();
    let start = Start::of(system, &contacts, &relays);
    let params: Vec<f64> = system.exogenous.numbers().map(|(_, p)| p).collect();
    let x0: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let names = contacts.iter().flat_map(|contact| {
        let name = &system.switches[contact.switch].name;
        let own = ["strength", "rounding"].map(|of| format!("{of}[{name}]"));
        own.into_iter().take(contact.n_measures())
    });
    let names = [String::from("speed[memory]")].into_iter().chain(names);
    let values = start.measures(&params, &x0, pace).inputs;
    let measures = names.zip(values).map(|(name, value)| measure(name, value));
    let (measures, params): (Vec<Expr<'e>>, Vec<Option<Param<'e>>>) = measures.unzip();
    // Integrals of a cost stay behind all other states.
    let n_states = system.n_model_states();
    let (places, switches) = lasting_switches(system);
    let mut motion = Motion {
        system,
        speed: measures[0],
        params: params.into_iter().flatten().collect(),
        n_states,
        rates: free_rates(system, &contacts),
        partitions: lasting_partitions(system, &places),
        switches,
        added: Vec::new(),
    };
    let relays: Vec<Memory> = relays.into_iter().map(|k| motion.relay(k)).collect();
    let contacts = motion.contacts(&contacts, &measures[1..]);
    Ok(Frozen {
        system: motion.finished(&relays),
        n_states,
        clock: n_states,
        places,
        relays,
        contacts,
        meeting,
        start,
    })
}

/// Motion without contact, then the rate of the clock.
fn free_rates<'e>(system: &System<'e>, contacts: &[Contact<'e>]) -> Vec<Expr<'e>> {
    let open = |rate: Expr<'e>| {
        let apart = contacts.iter().map(|contact| alpha(system, contact.switch));
        apart.fold(rate, |rate, alpha| at(rate, alpha, 1.0))
    };
    let mut rates: Vec<Expr<'e>> = system.states.iter().map(|s| open(s.rate)).collect();
    rates.push(system.exprs.constant(1.0));
    rates
}

/// The switches that are neither relays nor contacts, and where they are.
fn lasting_switches<'e>(system: &System<'e>) -> (Vec<Option<usize>>, Vec<Switch<'e>>) {
    let mut places = vec![None; system.switches.len()];
    let mut switches: Vec<Switch<'e>> = Vec::new();
    for (k, switch) in system.switches.iter().enumerate() {
        if switch.relay.is_none() && !switch.unilateral {
            places[k] = Some(switches.len());
            switches.push(Switch {
                slip_of: None,
                ..switch.clone()
            });
        }
    }
    for switch in &mut switches {
        switch.across = switch.across.and_then(|other| places[other]);
    }
    (places, switches)
}

/// The partitions that no relay decides.
fn lasting_partitions<'e>(system: &System<'e>, places: &[Option<usize>]) -> Vec<Partition<'e>> {
    let mut partitions = system.coupling.partitions.clone();
    partitions.retain(|partition| {
        let weights: Vec<Expr<'e>> = partition.regions.iter().map(|r| r.weight).collect();
        let inside = variables_of(&weights);
        let mut switches = system.switches.iter().enumerate();
        !switches.any(|(k, s)| s.relay.is_some() && inside.contains(&alpha(system, k)))
    });
    for partition in &mut partitions {
        let switches = partition.switches.iter();
        partition.switches = switches.filter_map(|&k| places[k]).collect();
        for region in &mut partition.regions {
            for literal in region.literals.iter_mut().flatten() {
                literal.0 =
                    places[literal.0].expect("relays and contacts are in no guard that is kept");
            }
        }
    }
    partitions
}

/// Motion in numerical time, to which relays and contacts are added.
struct Motion<'s, 'e> {
    /// The original.
    system: &'s System<'e>,
    /// How fast memories move.
    speed: Expr<'e>,
    /// Measures that are parameters.
    params: Vec<Param<'e>>,
    n_states: usize,
    /// Of the states of the original, and of the clock.
    rates: Vec<Expr<'e>>,
    switches: Vec<Switch<'e>>,
    partitions: Vec<Partition<'e>>,
    /// What moves while the clock stands still.
    added: Vec<State<'e>>,
}

impl<'e> Motion<'_, 'e> {
    /// A relay becomes a memory.
    fn relay(&mut self, k: usize) -> Memory {
        let cells = relay::cells(self.system, k, self.speed, self.switches.len());
        let read = alpha(self.system, k);
        for rate in &mut self.rates {
            *rate = at(*rate, read, 0.0) * cells.off + at(*rate, read, 1.0) * cells.on;
        }
        let state = self.n_states + 1 + self.added.len();
        self.switches.extend(cells.switches);
        self.added.push(cells.memory);
        self.partitions.push(cells.partition);
        Memory { relay: k, state }
    }

    /// Contacts become forces.
    fn contacts(&mut self, contacts: &[Contact<'e>], measures: &[Expr<'e>]) -> Vec<Impact<'e>> {
        let mut forces = vec![self.system.exprs.constant(0.0); self.rates.len()];
        let mut left = measures;
        let impacts = contacts.iter().map(|contact| {
            let (own, others) = left.split_at(contact.n_measures());
            left = others;
            self.contact(contact, own, &mut forces)
        });
        let impacts = impacts.collect();
        for (rate, force) in self.rates.iter_mut().zip(forces) {
            *rate = *rate + force;
        }
        impacts
    }

    /// Adds the force of a contact with its measures.
    fn contact(
        &mut self,
        contact: &Contact<'e>,
        measures: &[Expr<'e>],
        forces: &mut [Expr<'e>],
    ) -> Impact<'e> {
        let (system, switch) = (self.system, self.switches.len());
        let motion = (&mut self.rates[..], forces);
        let (strength, rest) = if contact.is_inelastic() {
            let rest = rest::rest(system, contact, measures[0], motion);
            self.switches.extend(rest.switches);
            let (speed, cone) = (switch + 1, rest.cone);
            (measures[0], Some(Rest { speed, cone }))
        } else {
            let bounce = bounce::bounce(system, contact, [measures[0], measures[1]], motion);
            self.switches.push(bounce.switch);
            self.added.push(bounce.state);
            (bounce.strength, None)
        };
        let friction = contact.friction.as_ref();
        Impact {
            contact: contact.switch,
            law: contact.law,
            switch,
            strength,
            friction: friction.map(|friction| friction.coefficient),
            rest,
        }
    }

    /// The system of this motion, with the clock behind the states of the original.
    fn finished(mut self, relays: &[Memory]) -> System<'e> {
        let (mut whole, clock) = (self.system.clone(), self.n_states);
        let rate = self.rates[whole.states.len()];
        for (state, rate) in whole.states.iter_mut().zip(self.rates) {
            state.rate = rate;
        }
        // While time passes a relay is what it remembers.
        let memories = relays.iter().zip(&self.added);
        let memories = memories.map(|(known, state)| (alpha(self.system, known.relay), state.var));
        let memories: Substitution = memories.collect();
        whole.task = whole.task.map(|task| Task {
            clock: Some(clock),
            ..task.map(|e| e.substitute(&memories))
        });
        let last = whole.states.split_off(clock);
        whole.states.push(State {
            name: "time".to_owned(),
            var: whole.time,
            initial: 0.0,
            rate,
            span: Span::default(),
        });
        whole.states.extend(self.added);
        whole.exogenous.params.extend(self.params);
        whole.states.extend(last);
        for partition in self.partitions.iter_mut().filter(|p| p.states.is_empty()) {
            partition.states = (0..whole.states.len()).collect();
        }
        whole.time = whole.exprs.variable("tau");
        whole.clock = Some(clock);
        (whole.switches, whole.coupling.partitions) = (self.switches, self.partitions);
        let rates: Vec<Expr<'e>> = whole.states.iter().map(|state| state.rate).collect();
        whole.coupling.subsystems = subsystems_of(
            &rates,
            &alphas_of(&whole.switches),
            &whole.coupling.partitions,
        );
        // What is recorded, watched and read is that of the original.
        whole.recorded = Recorded::default();
        whole.provenance.skipped = Vec::new();
        whole.jumps = super::Jumps::default();
        whole.provenance.readings = Readings::default();
        debug_assert_eq!(
            whole.verify(),
            Ok(()),
            "freezing keeps the invariants of `System`"
        );
        whole
    }
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
