//! An elastic contact -> a spring that is compressed while the clock stands still.
//!
//! With ψ = gap + p and n = M⁻¹J_n/(J_nᵀM⁻¹J_n),
//!
//! - ψ > 0:  x' = f,  p' = 0
//! - ψ < 0:  q' = 0,  p' = gap',  v' = n (-k p - c gap')
//!
//! so that p'' = -k p - c p': it returns after half a period, with -e times the speed at which it came for
//!
//! c = 2 |ln e| √(k/(π² + ln² e)).
//!
//! With k = (π² + ln² e)/T² that takes the numerical time T, whatever the speed, and c = 2 |ln e|/T. Only q stands
//! still, so that J_n does, and it holds for any geometry. Nurkanović, Sartor, Albrecht & Diehl 2021 for contacts
//! whose spring is the gap itself.

use super::{alpha, numbers};
use crate::expr::Expr;
use crate::source::Span;
use crate::system::affine::at;
use crate::system::{Continuity, State, Switch, System, SystemError};

/// Numerical time of a bounce, as a share of the horizon.
const SHARE: f64 = 0.25;

/// An elastic contact of a system.
pub(super) struct Contact<'e> {
    /// Its law: jumps first, then contacts.
    pub law: usize,
    pub switch: usize,
    pub gap: Expr<'e>,
    /// gap' in free motion.
    pub speed: Expr<'e>,
    /// n, by state.
    pub normal: Vec<(usize, Expr<'e>)>,
    /// e
    pub restitution: f64,
    pub span: Span,
}

/// What takes the place of a contact.
pub(super) struct Spring<'e> {
    pub switch: Switch<'e>,
    pub state: State<'e>,
}

/// All contacts, each of which must be elastic.
pub(super) fn contacts<'e>(system: &System<'e>) -> Result<Vec<Contact<'e>>, SystemError> {
    let mut found = Vec::new();
    for (law, jump) in system.laws.iter().enumerate() {
        let Some(switch) = jump.strikes else {
            return Err(refused(
                format!("jump `{}`, which is no contact", jump.name),
                jump.span,
            ));
        };
        let states: Vec<usize> = jump.resets.iter().map(|reset| reset.0).collect();
        found.push(contact(system, law, switch, &states, jump.span)?);
    }
    for (c, contact_of) in system.contacts.iter().enumerate() {
        if contact_of.friction.is_some() {
            return Err(refused(
                format!("contact `{}`, which has friction", contact_of.name),
                contact_of.span,
            ));
        }
        let states: Vec<usize> = contact_of.normal.iter().map(|d| d.state).collect();
        let (law, switch) = (system.laws.len() + c, contact_of.switch);
        let mut found_here = contact(system, law, switch, &states, contact_of.span)?;
        found_here.restitution = restitution(
            system,
            contact_of.restitution,
            &contact_of.name,
            contact_of.span,
        )?;
        found.push(found_here);
    }
    Ok(found)
}

pub(super) fn refused(what: String, span: Span) -> SystemError {
    SystemError::Unfrozen { what, span }
}

fn contact<'e>(
    system: &System<'e>,
    law: usize,
    switch: usize,
    states: &[usize],
    span: Span,
) -> Result<Contact<'e>, SystemError> {
    let exprs = system.exprs;
    let numbers = numbers(system);
    let closed = alpha(system, switch);
    let gap = system.switches[switch].psi;
    let slope = |e: Expr<'e>, state: usize| {
        let var = system.states[state].var.as_variable();
        e.diff(var.expect("a state is a variable"))
    };
    let along = system.states.iter().enumerate();
    let along = along.map(|(state, s)| slope(gap, state) * at(s.rate, closed, 1.0));
    let by_time = system.time.as_variable().map(|time| gap.diff(time));
    let speed = exprs.sum(along.chain(by_time));
    // The push of a closed contact, -∂x'/∂α, gives its direction.
    let push = |state: usize| {
        let rate = system.states[state].rate;
        (at(rate, closed, 0.0) - at(rate, closed, 1.0)).substitute(&numbers)
    };
    let pushes: Vec<(usize, Expr<'e>)> = states.iter().map(|&state| (state, push(state))).collect();
    let gain = pushes.iter().map(|&(state, push)| slope(speed, state) * push);
    let gain = exprs.sum(gain).substitute(&numbers);
    let name = &system.switches[switch].name;
    let restitution = match law.checked_sub(system.laws.len()) {
        // A jump by -ċ d has e = ∇ċ·d - 1.
        None => restitution(system, gain - 1.0, name, span)?,
        Some(_) => 1.0,
    };
    Ok(Contact {
        law,
        switch,
        gap,
        speed,
        normal: (pushes.into_iter())
            .map(|(state, push)| (state, push / gain))
            .collect(),
        restitution,
        span,
    })
}

/// e as a number above zero.
fn restitution<'e>(
    system: &System<'e>,
    e: Expr<'e>,
    name: &str,
    span: Span,
) -> Result<f64, SystemError> {
    match e.substitute(&numbers(system)).as_constant() {
        None => Err(refused(
            format!("contact `{name}`, whose restitution is no number"),
            span,
        )),
        Some(e) if e <= 1e-9 => Err(refused(
            format!("contact `{name}`, which does not bounce"),
            span,
        )),
        Some(e) => Ok(e),
    }
}

/// The spring of a contact; the rates stand still, and those of velocities get its force.
pub(super) fn spring<'e>(
    system: &System<'e>,
    contact: &Contact<'e>,
    horizon: f64,
    rates: &mut [Expr<'e>],
) -> Spring<'e> {
    let old = &system.switches[contact.switch];
    let name = format!("spring[{}]", old.name);
    let p = system.exprs.variable(&name);
    let duration = SHARE * horizon;
    let log = contact.restitution.ln();
    let stiffness = (std::f64::consts::PI.powi(2) + log * log) / (duration * duration);
    let damping = -2.0 * log / duration;
    let apart = old.alpha;
    for rate in rates.iter_mut() {
        *rate = apart * *rate;
    }
    let force = -stiffness * p - damping * contact.speed;
    for &(state, n) in &contact.normal {
        rates[state] = rates[state] + (1.0 - apart) * n * force;
    }
    Spring {
        switch: Switch {
            psi: contact.gap + p,
            unilateral: false,
            continuity: Continuity::Discontinuous,
            ..old.clone()
        },
        state: State {
            name,
            var: p,
            initial: 0.0,
            rate: (1.0 - apart) * contact.speed,
            span: contact.span,
        },
    }
}
