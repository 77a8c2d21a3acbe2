//! An inelastic contact, with or without friction -> forces that stop the body while the clock stands still.
//!
//! With α_g ∈ step(gap), α_n ∈ step(J_nᵀv), α_t ∈ step(J_tᵀv) and the weight of free flight ϑ = α_g + α_n - α_g α_n,
//!
//! x' = ϑ f + (1 - ϑ) a M⁻¹(J_n - μ (2α_t - 1) J_t),   t' = ϑ,
//!
//! where the second term acts on velocities alone; of several contacts there are all their second terms, and f has the
//! product of their weights. At an impact ϑ = 0 until J_nᵀv = 0, and the impulse keeps to
//! Coulomb's law. A contact that lasts is the sliding mode on J_nᵀv = 0, with the force λ_n = a (1 - ϑ)/ϑ in
//! physical time; there the clock is slower than numerical time, t' = a G/(a G - φ) for a free acceleration φ < 0.
//! It needs J_nᵀM⁻¹(J_n ∓ μ J_t) > 0 (Painlevé).
//!
//! A slip velocity with two entries has an α_t and a J_t for each, whose 2α_t - 1 are a point of the unit disc: the
//! impulse is in Coulomb's cone, and J_nᵀM⁻¹J_n > μ |J_nᵀM⁻¹J_t| is needed.
//!
//! Nurkanović, Albrecht, Brogliato & Diehl 2023.

use super::contact::{Contact, Friction, Slip};
use super::slope;
use super::start::AtStart;
use crate::expr::Expr;
use crate::system::{Continuity, Switch, System};

/// The auxiliary acceleration in free accelerations at the start: the clock of a contact that lasts has 1/(1 + 1/9).
const STRENGTH: f64 = 9.0;

/// What takes the place of a contact.
pub(super) struct Rest<'e> {
    /// Of the gap, and of its rate.
    pub switches: [Switch<'e>; 2],
    /// J_nᵀM⁻¹(J_n ∓ μ J_t), or of two directions J_nᵀM⁻¹J_n - μ |J_nᵀM⁻¹J_t|.
    pub cone: Vec<Expr<'e>>,
}

/// Adds the auxiliary forces of a contact, with their strength a, to the forces, and slows down the rates.
pub(super) fn rest<'e>(
    system: &System<'e>,
    contact: &Contact<'e>,
    strength: Expr<'e>,
    (rates, forces): (&mut [Expr<'e>], &mut [Expr<'e>]),
) -> Rest<'e> {
    let exprs = system.exprs;
    let old = &system.switches[contact.switch];
    let name = format!("speed[{}]", old.name);
    let (apart, leaves) = (old.alpha, exprs.variable(&format!("alpha[{name}]")));
    let free = apart + leaves - apart * leaves;
    for rate in rates.iter_mut() {
        *rate = free * *rate;
    }
    for &(state, push) in &contact.normal {
        forces[state] = forces[state] + (1.0 - free) * (strength * push);
    }
    let mut cone = vec![contact.gain];
    if let Some(friction) = &contact.friction {
        for slip in &friction.slips {
            let sign = 2.0 * system.switches[slip.switch].alpha - 1.0;
            for &(state, push) in &slip.tangent {
                let drag = strength * friction.coefficient * push * sign;
                forces[state] = forces[state] - (1.0 - free) * drag;
            }
        }
        cone = edge(system, contact, friction);
    }
    let switch = |name: String, alpha: Expr<'e>, psi: Expr<'e>| Switch {
        name,
        alpha,
        psi,
        unilateral: false,
        continuity: Continuity::Discontinuous,
        ..old.clone()
    };
    Rest {
        switches: [
            switch(old.name.clone(), apart, contact.gap),
            switch(name, leaves, contact.speed),
        ],
        cone,
    }
}

/// J_nᵀM⁻¹(J_n - μ J_t u) where it is least: of one direction for both signs, of two for the u against which it falls.
fn edge<'e>(system: &System<'e>, contact: &Contact<'e>, friction: &Friction<'e>) -> Vec<Expr<'e>> {
    let along = |slip: &Slip<'e>| {
        let terms = slip.tangent.iter();
        let terms = terms.map(|&(state, push)| slope(system, contact.speed, state) * push);
        system.exprs.sum(terms)
    };
    let mu = friction.coefficient;
    match &friction.slips[..] {
        [slip] => {
            let across = mu * along(slip);
            vec![contact.gain - across, contact.gain + across]
        }
        slips => {
            let squares = slips.iter().map(|slip| along(slip).powi(2));
            vec![contact.gain - mu * system.exprs.sum(squares).sqrt()]
        }
    }
}

/// a, so that a G is well above accelerations at the start.
pub(super) fn strength(contact: &AtStart, pace: f64) -> f64 {
    let known = [
        STRENGTH * contact.acceleration.abs(),
        contact.speed.abs() / pace,
        1.0 / (pace * pace),
    ];
    let known = known.into_iter().filter(|number| number.is_finite());
    let gain = contact.gain;
    known.fold(0.0, f64::max) / if gain > 0.0 { gain } else { 1.0 }
}
