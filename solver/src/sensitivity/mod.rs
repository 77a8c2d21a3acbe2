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

mod forward;
mod functions;
mod jump;
mod recording;
mod resting;
mod saltation;
mod sizes;
mod stiff;
mod variational;

pub use forward::{EventTime, Sensitivities};
pub use recording::Recording;

use crate::event::Simulator;
use crate::events::Approach;
use crate::runtime::limit::Over;

/// By what a run is differentiated: for each direction, what it does to the start and to the parameters.
#[derive(Clone, Debug, Default)]
pub struct Directions {
    /// dx(0)/dp, as many entries as states, by direction.
    pub initial: Vec<Vec<f64>>,
    /// The derivatives of the parameters of the system, by direction.
    pub parameters: Vec<Vec<f64>>,
}

impl Directions {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.initial.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.initial.is_empty()
    }
}

/// An instant of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// When.
    pub time: f64,
    /// Whether behind what happens there.
    pub is_behind: bool,
}

/// From when on a derivative is not known, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// When.
    pub time: f64,
    /// Why.
    pub why: Why,
    /// The switches of the surfaces that it is about.
    pub switches: Vec<usize>,
}

/// Why a derivative is not known, or does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Why {
    /// The rate of what is met vanishes: the instant has no derivative.
    #[error("a surface is met tangentially")]
    Grazing,
    /// What lies on a surface leaves it to one side or the other as the parameter changes.
    #[error(
        "surfaces meet in one point, and what comes next depends on which of them is met first"
    )]
    Several,
    /// The run starts on a surface, and on one of its sides for other values.
    #[error("the run starts on a surface, which other values leave to one side or the other")]
    Start,
    /// The run stays on a surface without sliding on it, and leaves it to one side or the other.
    #[error("the run rests on a surface, which other values leave to one side or the other")]
    Rests,
    /// Infinitely many events.
    #[error("infinitely many events accumulate")]
    Accumulation,
    /// A nonlinear sliding mode ends in a fold.
    #[error("a sliding mode ends in a fold")]
    Fold,
    /// A law jumps in a way that is not differentiated.
    #[error("the state jumps in a way of which no derivative is known")]
    Jump,
    /// Sliding is not determined by its equations alone.
    #[error("rates do not determine sliding independently")]
    Singular,
    /// What the run did is not what its functions say.
    #[error("the run moves in a way of which no derivative is known")]
    Unknown,
    /// The tangent is not found to its tolerance.
    #[error("the tangent is not smooth enough to be integrated")]
    Rough,
    /// The time of the run is up.
    #[error("the time is up")]
    TimeLimit,
    /// The run is canceled.
    #[error("the run was canceled")]
    Canceled,
}

impl From<Over> for Why {
    fn from(over: Over) -> Self {
        match over {
            Over::TimeLimit => Why::TimeLimit,
            Over::Canceled => Why::Canceled,
        }
    }
}

impl Simulator {
    /// Differentiates a run of this simulator that has been recorded, with the surfaces that it came close to, at instants in
    /// order, within the limit of its runs.
    pub fn differentiate(
        &self,
        recording: &Recording,
        approaches: &[Approach],
        directions: &Directions,
        instants: &[Moment],
    ) -> Sensitivities {
        let memory = &self.mode.memory;
        let run = forward::Run {
            system: self.system.clone(),
            coupling: &self.coupling,
            observers: &self.mode.monitored.observers,
            data: &memory.data,
            parameters: &memory.values[memory.parameters()],
            accuracy: self.settings.tolerance,
            tolerance: (0.01 * self.settings.tolerance).clamp(1e-13, 1e-10),
            limit: &self.settings.limit,
        };
        let forward = forward::Forward::new(&run, directions, instants);
        forward.follow(recording, approaches)
    }
}
