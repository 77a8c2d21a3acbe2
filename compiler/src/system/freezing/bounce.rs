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

use super::contact::Contact;
use crate::expr::Expr;
use crate::system::{Continuity, State, Switch, System};

/// Numerical time of a bounce, as a share of the horizon.
const SHARE: f64 = 0.25;

/// The spring of a contact: its switch and its state. The rates stand still, and those of velocities get its force.
pub(super) fn spring<'e>(
    system: &System<'e>,
    contact: &Contact<'e>,
    horizon: f64,
    rates: &mut [Expr<'e>],
) -> (Switch<'e>, State<'e>) {
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
    for &(state, push) in &contact.normal {
        rates[state] = rates[state] + (1.0 - apart) * (push / contact.gain) * force;
    }
    let switch = Switch {
        psi: contact.gap + p,
        unilateral: false,
        continuity: Continuity::Discontinuous,
        ..old.clone()
    };
    let state = State {
        name,
        var: p,
        initial: 0.0,
        rate: (1.0 - apart) * contact.speed,
        span: contact.span,
    };
    (switch, state)
}
