//! What cannot be frozen.

use rustc_hash::FxHashMap;

use super::contact::{Contact, Slip, refused};
use super::{Meeting, Numbers, alpha, slope};
use crate::expr::{Expr, Var, variables_of};
use crate::system::switches::affine::at;
use crate::system::task::{At, Holds, TaskRow};
use crate::system::verify::alphas_of;
use crate::system::{Role, System, SystemError};

/// Entries of a mass below this share of others are rounding.
const ROUNDING: f64 = 1e-12;

/// Refuses what auxiliary dynamics would change.
pub(super) fn check(system: &System<'_>) -> Result<(), SystemError> {
    if let Some(data) = system.exogenous.data.first() {
        let what = format!("`{}`, which is held or fitted data", data.name);
        return Err(refused(system, what, data.span));
    }
    let alphas = alphas_of(&system.switches);
    let closed = system.switches.iter().enumerate();
    let closed: Vec<Var> = (closed.filter(|(_, switch)| switch.unilateral))
        .map(|(k, _)| alpha(system, k))
        .collect();
    for row in system.task.iter().flat_map(|task| task.exprs()) {
        if variables_of(&[row]).iter().any(|var| closed.contains(var)) {
            let span = system.task.as_ref().map(|task| task.cost.span);
            let what = "costs and constraints that contain forces of contacts".to_owned();
            return Err(refused(system, what, span.unwrap_or_default()));
        }
    }
    let mut rows = system.task.iter().flat_map(|task| &task.rows);
    let is_along = |row: &&TaskRow| matches!(row.holds, Holds::Softly(_)) && row.at != At::End;
    if let Some(row) = rows.find(is_along) {
        let what = "soft constraints along the horizon, which would cost while time stands";
        return Err(refused(system, what.to_owned(), row.span));
    }
    let jumping: Vec<Var> = (system.jumps.laws.iter())
        .flat_map(|law| law.resets.iter().map(|reset| reset.0))
        .chain(system.jumps.contacts.iter().flat_map(|contact| {
            let tangents = contact.slips().iter().flat_map(|slip| &slip.tangent);
            contact.normal.iter().chain(tangents).map(|d| d.state)
        }))
        .filter_map(|state| system.states[state].var.as_variable())
        .collect();
    for (k, switch) in system.switches.iter().enumerate() {
        let span = switch.spans.first().copied().unwrap_or_default();
        if system.is_projected(k) {
            let what = format!("the projection onto `{}`", switch.name);
            return Err(refused(system, what, span));
        }
        if switch.role != Role::Step {
            let what = "algebraic states that no equation gives explicitly".to_owned();
            return Err(refused(system, what, span));
        }
        if switch.unilateral
            && variables_of(&[switch.psi])
                .iter()
                .any(|var| alphas.contains(var))
        {
            let what = format!("the gap of `{}`, which holds a switch", switch.name);
            return Err(refused(system, what, span));
        }
        if switch.relay.is_some() {
            let watched = variables_of(&[at(switch.psi, alpha(system, k), 0.0)]);
            let jumps = |var: &Var| alphas.contains(var) || jumping.contains(var);
            if watched.iter().any(jumps) {
                let what = format!("relay `{}`, which watches what may jump", switch.name);
                return Err(refused(system, what, span));
            }
        }
        let others = system.switches.iter().enumerate();
        let mut others = others.filter(|(other, _)| *other != k);
        let is_read = |(_, other): (usize, &crate::system::Switch<'_>)| {
            switch.relay.is_some() && variables_of(&[other.psi]).contains(&alpha(system, k))
        };
        if others.any(is_read) {
            let what = format!(
                "relay `{}`, which other switching functions read",
                switch.name
            );
            return Err(refused(system, what, span));
        }
    }
    Ok(())
}

/// Refuses an inelastic contact whose speed switches something else too, as the slip along a wall at a right angle to it.
pub(super) fn distinct<'e>(
    system: &System<'e>,
    contacts: &[Contact<'e>],
) -> Result<(), SystemError> {
    let form = |e: Expr<'e>| e.split_scale().1;
    let lasting = system.switches.iter().filter(|switch| !switch.unilateral);
    let mut known: FxHashMap<Expr<'e>, &str> = lasting
        .map(|switch| (form(switch.psi), switch.name.as_str()))
        .collect();
    for contact in contacts.iter().filter(|contact| contact.is_inelastic()) {
        let name = &system.switches[contact.switch].name;
        if let Some(other) = known.insert(form(contact.speed), name) {
            let what = format!("contact `{name}`, the speed of which `{other}` also has");
            return Err(refused(system, what, contact.span));
        }
    }
    Ok(())
}

/// Whether friction in two directions may turn a slip velocity while it slows it down: J_tᵀM⁻¹J_t is no multiple of the
/// identity.
fn turns<'e>(system: &System<'e>, contact: &Contact<'e>, numbers: &Numbers<'e>) -> bool {
    let [first, second] = contact.slips() else {
        return false;
    };
    let entry = |row: &Slip<'e>, column: &Slip<'e>| {
        let terms = column.tangent.iter();
        let terms = terms.map(|&(state, push)| slope(system, row.velocity, state) * push);
        let entry = system
            .exprs
            .sum(terms)
            .substitute(&numbers.fixed)
            .as_constant();
        entry.unwrap_or(f64::NAN)
    };
    let (x, y, mixed) = (
        entry(first, first),
        entry(second, second),
        entry(first, second),
    );
    let is_even = (x - y).hypot(mixed) <= ROUNDING * x;
    !is_even
}

/// What a run has to look at: contacts may be closed at once and act on each other, or friction acts on the gap of its
/// contact, or turns its slip. One force after the other is then the law of the impact in some cases, and not in all. In an optimization
/// contacts that act on each other are refused.
pub(super) fn together<'e>(
    system: &System<'e>,
    contacts: &[Contact<'e>],
    numbers: &Numbers<'e>,
) -> Result<Meeting, SystemError> {
    let effect = |on: &Contact<'e>, terms: &[(usize, Expr<'e>)]| {
        let terms = terms.iter().copied();
        let effects = terms.map(|(state, push)| slope(system, on.speed, state) * push);
        system.exprs.sum(effects).substitute(&numbers.fixed)
    };
    let tangents = |by: &Contact<'e>| {
        let tangents = by.slips().iter().map(|slip| slip.tangent.clone());
        tangents.collect::<Vec<_>>()
    };
    let rubs = |by: &Contact<'e>, on: &Contact<'e>| {
        let mut effects = tangents(by).into_iter().map(|tangent| effect(on, &tangent));
        effects.any(|effect| !effect.is_zero())
    };
    let acts =
        |by: &Contact<'e>, on: &Contact<'e>| !effect(on, &by.normal).is_zero() || rubs(by, on);
    let mut meeting = Meeting {
        is_open: (contacts.iter())
            .any(|contact| rubs(contact, contact) || turns(system, contact, numbers)),
        rough: Vec::new(),
    };
    for (j, second) in contacts.iter().enumerate() {
        for (i, first) in contacts[..j].iter().enumerate() {
            let apart = (first.gap + second.gap)
                .substitute(&numbers.fixed)
                .as_constant();
            let never = apart.is_some_and(|sum| sum > 0.0);
            if never || !acts(first, second) && !acts(second, first) {
                continue;
            }
            if system.task.is_some() {
                let name = |contact: &Contact<'e>| &system.switches[contact.switch].name;
                let (one, other) = (name(first), name(second));
                let what = format!(
                    "contacts `{one}` and `{other}`, which may close at once, in `optimize`"
                );
                return Err(refused(system, what, second.span));
            }
            meeting.is_open = true;
            if first.friction.is_some() || second.friction.is_some() {
                meeting.rough.push([i, j]);
            }
        }
    }
    Ok(meeting)
}
