//! Derivatives of a run by parameters and initial values: forward sensitivities across events.
//!
//! Between events the tangent S = dx/dp of a run x' = f(t, x, p) satisfies S' = f_x S + f_p, with the field of the mode:
//! what slides has α_K(t, x, p) from φ_K = 0, and derivatives of f go through it by the theorem of implicit functions.
//! An event takes place where e(t, x, p) = 0, which is ψ of the surface that is met, or α at the bound where sliding ends:
//!
//! dt/dp = -(e_x S⁻ + e_p)/(e_t + e_x f⁻),   S⁺ = g_x X + g_t dt/dp + g_p - f⁺ dt/dp,   X = S⁻ + f⁻ dt/dp,
//!
//! for x⁺ = g(t, x⁻, p), the identity where nothing jumps (Galán, Feehery & Barton 1999; for impacts, Saccon, van de Wouw &
//! Nijmeijer 2014). An instant that is known before has dt/dp = 0.
//!
//! It is a pass over a run that has been recorded, so that the run itself does nothing for it. What holds to first order is
//! asked of every event: what lies on a surface stays on it as parameters change, jumps are those of the recorded laws, and
//! rates are those of the recorded polynomials. A direction for which something does not hold is lost from there on, and
//! said to be.

mod adjoint;
mod asked;
mod forward;
mod functions;
mod implied;
mod jump;
mod meeting;
mod resting;
mod run;
mod saltation;
mod sizes;
mod stiff;
mod taylor;
mod variational;
mod why;

pub use asked::{Directions, EventTime, Moment, Sensitivities};
pub(crate) use functions::Moved;
pub(crate) use functions::{Derivatives, locked};
pub(crate) use meeting::is_off;
pub(crate) use run::Accuracy;
pub(crate) use saltation::{Slope, least_rate};
pub(crate) use sizes::Sizes;
pub use why::{Loss, Why};

use crate::event::{Recording, Simulator};
use crate::events::Approach;

/// Differentiates a run of a simulator that has been recorded, with the surfaces that it came close to, at instants in order,
/// within the limit of its runs.
pub fn differentiate(
    simulator: &Simulator,
    recording: &Recording,
    approaches: &[Approach],
    directions: &Directions,
    instants: &[Moment],
) -> Sensitivities {
    let run = run_of(simulator);
    let forward = forward::Forward::new(&run, directions, instants);
    forward.follow(recording, approaches)
}

/// Finds the gradient of Σ_k w_k (x, α)(t_k) over instants in order, of a run as in [`differentiate`], in one pass from the end
/// to the start for all directions; none where that does not serve all of them, whose derivatives are known one by one if at
/// all.
///
/// `weigh` gives the weights of states, and behind them of all α, at each instant, from where the run is there.
pub fn adjoint(
    simulator: &Simulator,
    (recording, approaches): (&Recording, &[Approach]),
    directions: &Directions,
    instants: &[Moment],
    weigh: impl FnOnce(&Sensitivities) -> Option<Vec<Vec<f64>>>,
) -> Option<Vec<f64>> {
    let run = run_of(simulator);
    adjoint::gradient(&run, (recording, approaches), directions, instants, weigh)
}

fn run_of(simulator: &Simulator) -> run::Run<'_> {
    let Simulator { mode, settings, .. } = simulator;
    let memory = &mode.memory;
    run::Run {
        system: simulator.system.clone(),
        coupling: &simulator.coupling,
        observers: &mode.monitored.observers,
        data: &memory.data,
        parameters: &memory.values[memory.parameters()],
        accuracy: Accuracy(settings.tolerance),
        tolerance: (0.01 * settings.tolerance).clamp(1e-13, 1e-10),
        limit: &settings.limit,
        derivatives: &simulator.derivatives,
    }
}
