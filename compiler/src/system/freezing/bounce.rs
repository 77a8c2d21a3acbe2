//! An elastic contact -> one that is pushed back with a constant force while the clock stands still.
//!
//! With ψ = gap + p and n = M⁻¹J_n/(J_nᵀM⁻¹J_n),
//!
//! - ψ > 0:  x' = f,  p' = 0
//! - ψ < 0:  q' = 0,  v' = n a,  p' = ((1 + e)² gap' + (1 - e) r)/(2 e (1 + e)),
//!
//! r² = (1 + e)² gap'² - 4 e (1 + e) a p. So gap' = w + a τ after it was w < 0 where gap and p were zero, and
//!
//! (1 + e) a p = (gap' - w) (gap' + e w)
//!
//! is a solution: r = -2 e w - (1 - e) gap', because that is so at p = 0 and r is not negative. The contact opens with
//! gap' = -e w, after the time -(1 + e) w/a. Gap' and p are polynomials of degree 1 and 2, so that every collocation
//! method with two nodes or more has the law of the impact without error, in elements however many. (A spring with a
//! damper has exponentials.) Only q stands still, so that J_n does, and it holds for any geometry.
//!
//! Friction adds v' = -μ a M⁻¹J_t/(J_nᵀM⁻¹J_n) sign(J_tᵀv) as long as ψ < 0, which slides on J_tᵀv = 0 once that is
//! reached: Coulomb's law for the impulses, where J_nᵀM⁻¹J_t = 0. In two directions it has w/|w|, w = J_tᵀv, and is so
//! where J_tᵀM⁻¹J_t is a multiple of the identity, or w has an axis of it: else w turns while the contact acts.
//!
//! r has a kink where gap' and p are zero; (r⁴ + δ⁴)^¼ takes its place, with δ below all speeds that matter.
//!
//! Nurkanović, Sartor, Albrecht & Diehl 2021 for the idea, with a spring that is the gap itself.

use super::contact::Contact;
use super::start::AtStart;
use crate::expr::Expr;
use crate::system::{Continuity, State, Switch, System};

/// Numerical time of a bounce at the expected speed, as a share of the pace.
const SHARE: f64 = 0.25;
/// δ in expected speeds.
const ROUNDED: f64 = 1e-6;

/// What takes the place of a contact.
pub(super) struct Bounce<'e> {
    /// Of gap + p.
    pub switch: Switch<'e>,
    /// p
    pub state: State<'e>,
    /// a/(J_nᵀM⁻¹J_n): the force of a contact that lasts is so many times 1/t' - 1.
    pub strength: Expr<'e>,
}

/// Adds the force of a contact to the forces, and lets the rates stand still while it acts; its measures are a and δ.
pub(super) fn bounce<'e>(
    system: &System<'e>,
    contact: &Contact<'e>,
    [a, delta]: [Expr<'e>; 2],
    (rates, forces): (&mut [Expr<'e>], &mut [Expr<'e>]),
) -> Bounce<'e> {
    let old = &system.switches[contact.switch];
    let name = format!("depth[{}]", old.name);
    let p = system.exprs.variable(&name);
    let e = contact.restitution;
    let apart = old.alpha;
    for rate in rates.iter_mut() {
        *rate = apart * *rate;
    }
    for &(state, push) in &contact.normal {
        forces[state] = forces[state] + (1.0 - apart) * (push / contact.gain) * a;
    }
    if let Some(friction) = &contact.friction {
        let strength = friction.coefficient * a / contact.gain;
        for slip in &friction.slips {
            let sign = 2.0 * system.switches[slip.switch].alpha - 1.0;
            for &(state, push) in &slip.tangent {
                forces[state] = forces[state] - (1.0 - apart) * strength * push * sign;
            }
        }
    }
    let square = (1.0 + e).powi(2) * contact.speed.powi(2) - (4.0 * e * (1.0 + e) * a) * p;
    let r = (square.powi(2) + delta.powi(4)).sqrt().sqrt();
    let slope = ((1.0 + e).powi(2) * contact.speed + (1.0 - e) * r) / (2.0 * e * (1.0 + e));
    Bounce {
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
            rate: (1.0 - apart) * slope,
            span: contact.span,
        },
        strength: a / contact.gain,
    }
}

/// a and δ of a contact with a restitution that is expected to close with a speed.
pub(super) fn measures(e: f64, expected: f64, pace: f64) -> [f64; 2] {
    let a = (1.0 + e) * expected / (SHARE * pace);
    [a, ROUNDED * expected]
}

/// The speeds with which contacts are expected to close: that of a free fall from the start, if nothing is faster, and
/// that of the fastest of all others where nothing moves a contact by itself.
pub(super) fn speeds(contacts: &[AtStart], pace: f64) -> Vec<f64> {
    let own = |contact: &AtStart| {
        let fall = (2.0 * contact.acceleration.abs() * contact.gap.abs()).sqrt();
        let known = [contact.speed.abs(), fall];
        let known = known.into_iter().filter(|speed| speed.is_finite());
        known.fold(0.0, f64::max)
    };
    let own: Vec<f64> = contacts.iter().map(own).collect();
    let fastest = own.iter().copied().fold(0.0, f64::max);
    let expected = |(contact, &own): (&AtStart, &f64)| match contact.gap.abs() / pace {
        _ if own > 0.0 => own,
        _ if fastest > 0.0 => fastest,
        crossing if crossing > 0.0 && crossing.is_finite() => crossing,
        _ => 1.0 / pace,
    };
    contacts.iter().zip(&own).map(expected).collect()
}
