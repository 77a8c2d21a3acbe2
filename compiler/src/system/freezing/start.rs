//! What is known of a run before it starts: how strong motion is while the clock stands still, and what relays remember.
//!
//! All of it follows from parameters and the initial state, with all contacts open, in the middle between the sides of
//! switches; controls that are decided count as zero.

use nsd_solver::tape::Tape;
use rustc_hash::FxHashMap;

use super::contact::Contact;
use super::{along, alpha, bounce, relay, rest};
use crate::expr::{self, Expr, Var, variables_of};
use crate::system::System;
use crate::system::switches::affine::at;
use crate::system::verify::alphas_of;

/// A contact may start this far below its surface, which is rounding.
const ROUNDING: f64 = 1e-9;

/// What a variable is at the start.
#[derive(Clone, Copy, Debug)]
enum Given {
    State(usize),
    Param(usize),
    Number(f64),
}

/// What is known of the start of any run, as plain data.
#[derive(Clone, Debug)]
pub struct Start {
    /// The inputs of the tape.
    given: Vec<Given>,
    /// To [`AtStart`] of all contacts, and ψ of relays on both sides.
    tape: Tape,
    /// Whether contacts are inelastic.
    inelastic: Vec<bool>,
    /// Whether relays are on at the start of the experiment.
    on: Vec<bool>,
}

/// A contact at the start.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtStart {
    pub gap: f64,
    pub speed: f64,
    pub acceleration: f64,
    /// G = J_nᵀM⁻¹J_n
    pub gain: f64,
    /// e
    pub restitution: f64,
    pub is_inelastic: bool,
}

/// Numbers of a run.
#[derive(Clone, Debug)]
pub struct Measures {
    /// How fast memories move, and of every contact as many numbers as it has: how strong it is, and of one that bounces the
    /// speed below which it is rounded.
    pub inputs: Vec<f64>,
    /// What relays remember at the start, 0 or 1.
    pub memories: Vec<f64>,
    /// The first contact that starts below its surface.
    pub below: Option<usize>,
    /// The first contact with a restitution that no contact which bounces has.
    pub restitution: Option<(usize, f64)>,
}

impl Start {
    /// Of contacts and of relays, by their switches.
    pub(super) fn of<'e>(system: &System<'e>, contacts: &[Contact<'e>], relays: &[usize]) -> Self {
        let acceleration =
            |speed: Expr<'e>| along(system, speed, |state| system.states[state].rate);
        let of_contacts = contacts.iter().flat_map(|contact| {
            let (speed, e) = (contact.speed, contact.restitution);
            [contact.gap, speed, acceleration(speed), contact.gain, e]
        });
        let of_relays = relays.iter().flat_map(|&k| {
            let side = |value: f64| at(system.switches[k].psi, alpha(system, k), value);
            [side(0.0), side(1.0)]
        });
        let outputs: Vec<Expr<'e>> = of_contacts.chain(of_relays).collect();
        let known = known(system);
        let inputs = variables_of(&outputs);
        let given = |var: &Var| known.get(var).copied().unwrap_or(Given::Number(0.0));
        let tape = expr::compile(&inputs, &outputs);
        let start = |&k: &usize| system.switches[k].relay.expect("it is a relay").start;
        Start {
            given: inputs.iter().map(given).collect(),
            tape: tape.expect("a verified system holds smooth functions only"),
            inelastic: contacts.iter().map(Contact::is_inelastic).collect(),
            on: relays.iter().map(start).collect(),
        }
    }

    /// Those of a run with all parameters and an initial state; motion takes a share of `pace`, a time.
    pub fn measures(&self, params: &[f64], x0: &[f64], pace: f64) -> Measures {
        let input = |given: &Given| match *given {
            Given::State(i) => x0[i],
            Given::Param(place) => params[place],
            Given::Number(value) => value,
        };
        let inputs: Vec<f64> = self.given.iter().map(input).collect();
        let mut found = vec![0.0; self.tape.n_outputs()];
        (self.tape).eval(&inputs, &mut found, &mut self.tape.scratch());
        let (of_contacts, of_relays) = found.split_at(5 * self.inelastic.len());
        let contacts = of_contacts.as_chunks().0.iter().zip(&self.inelastic);
        let contacts = contacts.map(|(found, &is_inelastic)| {
            let &[gap, speed, acceleration, gain, restitution] = found;
            AtStart {
                gap,
                speed,
                acceleration,
                gain,
                restitution,
                is_inelastic,
            }
        });
        let contacts: Vec<AtStart> = contacts.collect();
        let speeds = bounce::speeds(&contacts, pace).into_iter().zip(&contacts);
        let measured = speeds.flat_map(|(speed, contact)| match contact.is_inelastic {
            true => vec![rest::strength(contact, pace)],
            false => bounce::measures(contact.restitution, speed, pace).to_vec(),
        });
        let relays = of_relays.as_chunks().0.iter().zip(&self.on);
        let memories = relays.map(|(&[off, on], &start)| match start {
            _ if off > 0.0 => 1.0,
            _ if on < 0.0 => 0.0,
            start => f64::from(start),
        });
        let bounces = |contact: &AtStart| contact.restitution > 0.0 && contact.restitution <= 1.0;
        let mut all = contacts.iter().enumerate();
        let unlike = all.find(|(_, contact)| !contact.is_inelastic && !bounces(contact));
        Measures {
            inputs: [relay::speed(pace)].into_iter().chain(measured).collect(),
            memories: memories.collect(),
            below: contacts.iter().position(|contact| contact.gap < -ROUNDING),
            restitution: unlike.map(|(k, contact)| (k, contact.restitution)),
        }
    }
}

/// What variables are at the start; time and what else there is, zero.
fn known(system: &System<'_>) -> FxHashMap<Var, Given> {
    let mut known = FxHashMap::default();
    known
        .extend((alphas_of(&system.switches).into_iter()).map(|alpha| (alpha, Given::Number(0.5))));
    let contacts = system.switches.iter().enumerate();
    let contacts = contacts.filter(|(_, switch)| switch.unilateral);
    known.extend(contacts.map(|(k, _)| (alpha(system, k), Given::Number(1.0))));
    let params = system.exogenous.params.iter().enumerate();
    let params = params.map(|(place, param)| (param.var, Given::Param(place)));
    let states = system.states.iter().enumerate();
    let states = states.map(|(i, state)| (state.var, Given::State(i)));
    let all = params.chain(states);
    known.extend(all.filter_map(|(e, given)| Some((e.as_variable()?, given))));
    known
}
