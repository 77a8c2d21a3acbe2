//! The contacts of a system: those between bodies, and the jumps that are some.

use super::{Numbers, alpha, slope};
use crate::expr::{Expr, Var};
use crate::source::Span;
use crate::system::switches::affine::at;
use crate::system::{self, System, SystemError};

/// A restitution below this is none.
const ROUNDING: f64 = 1e-9;

/// A contact of a system.
pub(super) struct Contact<'e> {
    /// Its law: jumps first, then contacts.
    pub law: usize,
    /// Its unilateral switch.
    pub switch: usize,
    pub gap: Expr<'e>,
    /// gap' in free motion.
    pub speed: Expr<'e>,
    /// M⁻¹J_n, by state; of a jump -∂Δ/∂(gap').
    pub normal: Vec<(usize, Expr<'e>)>,
    /// G = J_nᵀM⁻¹J_n
    pub gain: Expr<'e>,
    /// e, a number or a parameter that stays open.
    pub restitution: Expr<'e>,
    pub friction: Option<Friction<'e>>,
    pub span: Span,
}

/// Friction of a contact.
pub(super) struct Friction<'e> {
    /// μ
    pub coefficient: Expr<'e>,
    /// The entries of the slip velocity.
    pub slips: Vec<Slip<'e>>,
}

/// One entry of a slip velocity.
pub(super) struct Slip<'e> {
    pub velocity: Expr<'e>,
    /// M⁻¹J_t, by state.
    pub tangent: Vec<(usize, Expr<'e>)>,
    /// Its switch.
    pub switch: usize,
}

impl<'e> Contact<'e> {
    /// Whether bodies stay where they meet.
    pub fn is_inelastic(&self) -> bool {
        self.restitution
            .as_constant()
            .is_some_and(|e| e <= ROUNDING)
    }

    /// How many numbers of a run it has.
    pub fn n_measures(&self) -> usize {
        if self.is_inelastic() { 1 } else { 2 }
    }

    /// The entries of its slip velocity, none where it is smooth.
    pub fn slips(&self) -> &[Slip<'e>] {
        self.friction
            .as_ref()
            .map_or(&[], |friction| &friction.slips)
    }
}

/// All contacts; jumps must be contacts.
pub(super) fn contacts<'e>(
    system: &System<'e>,
    numbers: &Numbers<'e>,
) -> Result<Vec<Contact<'e>>, SystemError> {
    let mut found = Vec::new();
    for (law, jump) in system.jumps.laws.iter().enumerate() {
        let Some(switch) = jump.strikes else {
            let what = format!("{}, which is no contact", jump.title());
            return Err(refused(system, what, jump.span));
        };
        let states = jump.resets.iter().map(|reset| reset.0);
        let mut contact = contact(system, law, switch, states, jump.span);
        // A jump by -ċ d has e = ∇ċ·d - 1.
        contact.restitution = restitution(system, &contact, contact.gain - 1.0, numbers)?;
        found.push(contact);
    }
    let jumps = &system.jumps;
    for (c, given) in jumps.contacts.iter().enumerate() {
        let (law, states) = (jumps.laws.len() + c, given.normal.iter().map(|d| d.state));
        let mut contact = contact(system, law, given.switch, states, given.span);
        let newton = (given.restitution.newton()).expect("lowerings take Newton's law alone");
        contact.restitution = restitution(system, &contact, newton, numbers)?;
        contact.friction = given.friction.as_ref().map(|friction| Friction {
            coefficient: friction.coefficient,
            slips: friction.slips.iter().map(slip).collect(),
        });
        if !contact.is_inelastic() && friction_pushes(system, &contact, numbers) {
            let name = &given.name;
            let what =
                format!("contact `{name}`, which bounces, and whose friction acts on its gap");
            return Err(refused(system, what, given.span));
        }
        found.push(contact);
    }
    Ok(found)
}

fn slip<'e>(slip: &system::Slip<'e>) -> Slip<'e> {
    Slip {
        velocity: slip.velocity,
        tangent: slip.tangent.iter().map(|d| (d.state, d.push)).collect(),
        switch: slip.switch,
    }
}

/// Whether J_nᵀM⁻¹J_t is not zero: then how fast a gap opens depends on friction, all of which the law of the impact
/// takes at the end of it.
fn friction_pushes<'e>(system: &System<'e>, contact: &Contact<'e>, numbers: &Numbers<'e>) -> bool {
    contact.slips().iter().any(|slip| {
        let effects = slip.tangent.iter();
        let effects = effects.map(|&(state, push)| slope(system, contact.speed, state) * push);
        let effect = system.exprs.sum(effects).substitute(&numbers.fixed);
        !effect.is_zero()
    })
}

pub(super) fn refused(system: &System<'_>, what: String, span: Span) -> SystemError {
    let help = way(system);
    SystemError::Unfrozen { what, help, span }
}

/// What takes a system that cannot be frozen.
fn way(system: &System<'_>) -> &'static str {
    let has_relays = system.switches.iter().any(|switch| switch.relay.is_some());
    let has_more = has_relays || !system.jumps.laws.is_empty();
    match &system.task {
        None => "`method event` without `lower` runs it",
        Some(_) if has_more => {
            "`optimize` does not take it: run it in a `simulate` experiment without `lower`"
        }
        Some(_) if system.jumps.contacts.is_empty() => {
            "leave out `lower timefreezing`: no contact and no relay needs it here"
        }
        Some(_) => "write `lower impact;` instead, which takes contacts in `optimize` as well",
    }
}

/// A contact without restitution and friction, by what its switch does to these states.
fn contact<'e>(
    system: &System<'e>,
    law: usize,
    switch: usize,
    states: impl Iterator<Item = usize>,
    span: Span,
) -> Contact<'e> {
    let closed = alpha(system, switch);
    let gap = system.switches[switch].psi;
    let free = |state: usize| at(system.states[state].rate, closed, 1.0);
    let speed = super::along(system, gap, free);
    // The force of a closed contact is -∂x'/∂α; that of friction has mean zero.
    let slips = (system.jumps.contacts.iter())
        .flat_map(|contact| contact.slips())
        .map(|slip| alpha(system, slip.switch));
    let slips: Vec<_> = slips.collect();
    let normal = states.map(|state| {
        let rate = system.states[state].rate;
        let push = at(rate, closed, 0.0) - at(rate, closed, 1.0);
        let push = slips.iter().fold(push, |push, &slip| at(push, slip, 0.5));
        (state, push)
    });
    let normal: Vec<(usize, Expr<'e>)> = normal.collect();
    let gain = normal
        .iter()
        .map(|&(state, push)| slope(system, speed, state) * push);
    Contact {
        law,
        switch,
        gap,
        speed,
        gain: system.exprs.sum(gain),
        normal,
        restitution: system.exprs.constant(0.0),
        friction: None,
        span,
    }
}

/// e as a number, or a parameter that stays open.
fn restitution<'e>(
    system: &System<'e>,
    contact: &Contact<'e>,
    e: Expr<'e>,
    numbers: &Numbers<'e>,
) -> Result<Expr<'e>, SystemError> {
    let e = e.substitute(&numbers.fixed);
    let is_open = |var: Var| numbers.open.contains(&var);
    if e.as_constant().is_some() || e.as_variable().is_some_and(is_open) {
        return Ok(e);
    }
    let name = &system.switches[contact.switch].name;
    let what = format!("contact `{name}`, whose restitution is no number");
    Err(refused(system, what, contact.span))
}
