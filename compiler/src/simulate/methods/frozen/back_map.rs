//! The way back from a frozen system to the one it comes from, as plain data.

use std::ops::Range;

use nsd_solver::hybrid::Side;
use nsd_solver::sensitivity::Sensitivities;
use nsd_solver::tape::Tape;

use super::physical_time::CLOSED;
use crate::expr::{Expr, Var};
use crate::lowering::hybrid::{numbers, tape, variable};
use crate::system::freezing::{Frozen, Impact, Meeting, Memory};

/// Where states, switches, relays and contacts of the original are in the frozen system.
#[derive(Clone, Debug)]
pub(super) struct BackMap {
    /// Number of states of the original, which come first, and of all.
    pub n_states: usize,
    n_frozen: usize,
    /// The state that is physical time.
    pub clock: usize,
    /// Where each switch of the original is; none for relays and contacts.
    pub places: Vec<Option<usize>>,
    pub relays: Vec<Memory>,
    pub contacts: Vec<Struck>,
    pub meeting: Meeting,
    /// From the states of the frozen system and its open parameters to what is looked at where contacts strike: of every
    /// contact its gap, its strength, its friction if it has any, and what must be positive.
    looks: Tape,
}

/// A contact that has become motion of its own.
#[derive(Clone, Debug)]
pub(super) struct Struck {
    /// The unilateral switch in the original.
    pub contact: usize,
    /// The law, jumps first and then contacts.
    pub law: usize,
    /// The switch that is below its surface while the contact acts.
    pub switch: usize,
    /// The switch of the rate of an inelastic contact's gap.
    pub speed: Option<usize>,
    /// Its values among those that are looked at.
    looks: Range<usize>,
    has_friction: bool,
}

/// What is seen of contacts at a state.
pub(super) struct Seen(Vec<f64>);

impl BackMap {
    /// With some parameters open, by their numbers in the frozen system.
    pub fn new<'e>(frozen: &Frozen<'e>, open: &[usize]) -> Self {
        let system = &frozen.system;
        let mut outputs: Vec<Expr<'e>> = Vec::new();
        let struck = |impact: &Impact<'e>| {
            let first = outputs.len();
            outputs.extend([system.switches[impact.switch].psi, impact.strength]);
            outputs.extend(impact.friction);
            outputs.extend(impact.rest.iter().flat_map(|rest| &rest.cone));
            Struck {
                contact: impact.contact,
                law: impact.law,
                switch: impact.switch,
                speed: impact.rest.as_ref().map(|rest| rest.speed),
                looks: first..outputs.len(),
                has_friction: impact.friction.is_some(),
            }
        };
        let contacts = frozen.contacts.iter().map(struck).collect();
        let states = system.states.iter().map(|state| state.var);
        let params = open.iter().map(|&place| system.exogenous.params[place].var);
        let inputs: Vec<Var> = states.chain(params).map(variable).collect();
        BackMap {
            n_states: frozen.n_states,
            n_frozen: system.states.len(),
            clock: frozen.clock,
            places: frozen.places.clone(),
            relays: frozen.relays.clone(),
            contacts,
            meeting: frozen.meeting.clone(),
            looks: tape(&inputs, &numbers(system, open).apply(&outputs)),
        }
    }

    /// Derivatives of a run of the frozen system, in physical time, as those of the original, whose contacts are open.
    pub fn sensed(&self, found: Sensitivities) -> Sensitivities {
        let (n, behind) = (self.n_states, self.n_frozen);
        let of_switches = |of: &[f64], other: f64| -> Vec<f64> {
            let places = self.places.iter();
            let all = places.map(|place| place.map_or(other, |place| of[behind + place]));
            of[..n].iter().copied().chain(all).collect()
        };
        let point = |frozen: &[f64]| {
            let mut point = of_switches(frozen, 1.0);
            for memory in &self.relays {
                point[n + memory.relay] = 0.5 + 0.5 * Side::of(frozen[memory.state] - 0.5).sign();
            }
            point
        };
        let switch = |frozen: usize| {
            let mut places = self.places.iter();
            let own = places.position(|place| *place == Some(frozen));
            let contact = self
                .contacts
                .iter()
                .find(|contact| contact.switch == frozen);
            own.or(contact.map(|contact| contact.contact))
        };
        let size = n + self.places.len();
        found.seen(size, point, |tangent| of_switches(tangent, 0.0), switch)
    }

    /// What is seen at a state of the frozen system with these values of its open parameters.
    pub fn look(&self, x: &[f64], parameters: &[f64]) -> Seen {
        let mut seen = vec![0.0; self.looks.n_outputs()];
        let inputs = [x, parameters].concat();
        (self.looks).eval(&inputs, &mut seen, &mut self.looks.scratch());
        Seen(seen)
    }
}

impl Seen {
    fn of(&self, contact: &Struck) -> &[f64] {
        &self.0[contact.looks.clone()]
    }

    /// Its gap.
    pub fn gap(&self, contact: &Struck) -> f64 {
        self.of(contact)[0]
    }

    pub fn is_closed(&self, contact: &Struck) -> bool {
        self.gap(contact) <= CLOSED
    }

    /// a
    pub fn strength(&self, contact: &Struck) -> f64 {
        self.of(contact)[1]
    }

    /// μ, where it is not smooth.
    pub fn friction(&self, contact: &Struck) -> Option<f64> {
        contact.has_friction.then(|| self.of(contact)[2])
    }

    /// Whether an inelastic contact pushes itself open, whatever its friction.
    pub fn opens(&self, contact: &Struck) -> bool {
        let cone = &self.of(contact)[2 + usize::from(contact.has_friction)..];
        cone.iter().all(|&push| push > 0.0)
    }
}
