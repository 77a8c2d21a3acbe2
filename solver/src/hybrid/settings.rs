//! What a run is told.

use super::Side;
use crate::event::Kicks;
use crate::runtime::limit::Limit;

/// What the user may choose.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Aim for the global error, relative to the largest magnitude of each state; in (0, 1).
    pub tolerance: f64,
    /// Order of the Taylor series, from 4 to 40; chosen from the tolerance when absent.
    pub order: Option<usize>,
    /// Largest number of steps.
    pub max_steps: usize,
    /// Largest number of events.
    pub max_events: usize,
    /// When the run stops.
    pub limit: Limit,
    /// Sides to take at a non-unique point: one for all switches that are decided there, or one for
    /// each, in order.
    pub branch: Vec<Side>,
    /// Switches that are below their surface at such a point, where no branch says more: what acts there keeps them on
    /// it, and the states of other solutions only look as if it did not.
    pub below: Vec<usize>,
    /// The tolerance within which a spiral into a point of lasting rest has come to its end; that of the run when absent.
    pub settled: Option<f64>,
    /// Whether chattering that fades and never ends goes on as sliding.
    pub averages: bool,
    /// Unmodelled errors.
    pub kicks: Option<Kicks>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            tolerance: 1e-8,
            order: None,
            max_steps: 10_000_000,
            max_events: 1_000_000,
            limit: Limit::default(),
            branch: Vec::new(),
            below: Vec::new(),
            settled: None,
            averages: false,
            kicks: None,
        }
    }
}

impl Settings {
    /// Local tolerance of a step: a hundredth of the global aim, which the growth of
    /// errors along well-conditioned runs does not use up.
    pub(crate) fn local_tolerance(&self) -> f64 {
        (0.01 * self.tolerance).max(1e-18)
    }

    /// The share of its size within which ψ that only ever comes closer to zero has settled there.
    pub(crate) fn settled(&self) -> f64 {
        0.01 * self.settled.unwrap_or(self.tolerance)
    }

    /// Order that costs least for a tolerance: -½ ln ε + 1 (Jorba & Zou 2005, section 3.2),
    /// and seven more because a step has costs of its own (chosen by trial).
    pub fn series_order(&self) -> usize {
        let optimal = (-0.5 * self.local_tolerance().ln()).ceil() as usize + 8;
        self.order.unwrap_or(optimal).clamp(4, 40)
    }

    /// The next instant after the present one at which the state is kicked.
    pub(crate) fn next_kick(&self, t: f64) -> f64 {
        let kicks = self.kicks.as_ref();
        kicks.map_or(f64::INFINITY, |kicks| kicks.next(t))
    }
}
