//! Event-driven simulation of switched systems
//!
//! x' = f(t, x, α),   α_i ∈ step(ψ_i(t, x)),   f multi-affine in α, but for those of nonlinear switches.
//!
//! A mode fixes every switch to one side of its surface or to sliding on it.
//! Inside a mode the system is smooth and is expanded in a Taylor series, which
//! is at once the step, its dense output of the same order, and the series of
//! every switching function; where it is stiff, collocation polynomials take the
//! place of the series. Each turn of the loop is one such step, cut at the first
//! event inside it; the next mode follows from the rates on all surfaces that meet
//! there.

pub(crate) mod jump;
pub(crate) mod numerical_time;
pub(crate) mod observer;
pub(crate) mod perturbation;
pub(crate) mod recording;
mod run;
mod sliding_modes;
mod standing;
pub(crate) mod state;
#[cfg(test)]
pub(crate) mod tests;
mod transition;

use std::sync::{Arc, Mutex};

use crate::hybrid::{HybridSystem, Piecewise, Settings, Side, Status};
use crate::runtime::limit::Limit;
use crate::selector::algebraic::Initialization;
use crate::selector::coupling::Coupling;
use crate::sensitivity::{Derivatives, locked};

pub use crate::event::numerical_time::{Clock, Clocked};
pub use crate::event::perturbation::{KickSize, Kicks};
use crate::event::state::State;
use crate::expansion::mode::Mode;
use crate::hybrid::breakpoints::Pieces;
use crate::integrate::drift::Projection;
use crate::integrate::stepper::Stepper;
pub use observer::{Cause, Event, Observer, Segment};
pub use recording::Recording;
pub use run::{Decide, run_decided};

/// Runs a system, keeping the functions it has met from one run to the next.
pub struct Simulator {
    pub(crate) system: Arc<HybridSystem>,
    pub(crate) settings: Settings,
    pub(crate) mode: Mode,
    pub(crate) coupling: Coupling,
    pub(crate) pieces: Pieces,
    pub(crate) stepper: Stepper,
    pub(crate) projection: Projection,
    /// The switches that laws look at.
    looked_at: Vec<usize>,
    /// Memory that one run leaves to the next.
    pub(crate) state: State,
    /// What passes over runs leave to the next.
    pub(crate) derivatives: Mutex<Derivatives>,
}

impl Simulator {
    /// A simulator without any mode yet.
    pub fn new(system: Arc<HybridSystem>, settings: Settings) -> Self {
        let order = settings.series_order();
        Simulator {
            stepper: Stepper::new(&system, &settings, order),
            settings,
            mode: Mode::new(&system, order),
            coupling: Coupling::new(system.clone()),
            pieces: Pieces::new(&system),
            projection: Projection::default(),
            looked_at: standing::looked_at(&system),
            state: State::default(),
            derivatives: Mutex::new(Derivatives::new(system.clone())),
            system,
        }
    }

    /// One with other settings, which knows what this one has met.
    pub fn with(&self, settings: Settings) -> Self {
        let mut other = Simulator::new(self.system.clone(), settings);
        other.mode.library.clone_from(&self.mode.library);
        locked(&other.derivatives).clone_from(&locked(&self.derivatives));
        other.mode.memory.data.clone_from(&self.mode.memory.data);
        other.set_parameters(&self.mode.memory.values[self.mode.memory.parameters()]);
        other
    }

    /// Gives data from number `first` on other values, by as many coefficients a piece.
    pub fn set_data(&mut self, first: usize, data: &[Arc<Piecewise>]) {
        let known = &mut self.mode.memory.data[first..first + data.len()];
        for (known, data) in known.iter_mut().zip(data) {
            assert_eq!(
                known.n_coefficients(),
                data.n_coefficients(),
                "the same fit"
            );
            known.clone_from(data);
        }
    }

    /// Gives all parameters other values.
    pub fn set_parameters(&mut self, parameters: &[f64]) {
        assert_eq!(
            parameters.len(),
            self.system.parameters.len(),
            "one value each"
        );
        let mode = &mut self.mode;
        mode.memory.set_parameters(parameters);
        mode.surfaces.take_parameters(&mode.memory);
    }

    /// Ends all runs that follow where the limit does.
    pub fn set_limit(&mut self, limit: Limit) {
        self.settings.limit = limit;
    }

    /// The number of functions that were made so far, of all sides that runs have met: blocks and surfaces of one form
    /// share them. Those whose derivatives passes over runs have met, block by block, are counted with them.
    pub fn n_functions(&self) -> usize {
        self.mode.library.len() + locked(&self.derivatives).len()
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Order of the Taylor series.
    pub fn order(&self) -> usize {
        self.stepper.order.full()
    }

    /// Order of the implicit method that takes over where a mode is stiff.
    pub fn implicit_order(&self) -> usize {
        self.stepper.stiffness.order()
    }

    /// Calls `entry(row, column, value)` for every ∂f_row/∂x_column that is not structurally zero, at
    /// a point of a mode; α of switches that do not slide is that of their side.
    pub fn jacobian(
        &mut self,
        t: f64,
        x: &[f64],
        sides: &[Side],
        alpha: &[f64],
        entry: impl FnMut(usize, usize, f64),
    ) {
        self.mode.enter(sides);
        self.mode.memory.set(t, x, alpha);
        let mode = &mut self.mode;
        mode.field
            .jacobian(&mut mode.library, &mode.memory.values, entry);
    }

    /// The state with consistent algebraic states, from those in `x` as guesses.
    ///
    /// # Errors
    ///
    /// The status of a run that starts there and finds none.
    pub fn consistent(&mut self, t: f64, x: &[f64], horizon: f64) -> Result<Vec<f64>, Status> {
        let mut state = std::mem::take(&mut self.state);
        state.begin(t, x, self.system.n_switches());
        self.load(&mut state);
        let settled = Initialization::settle(&mut self.mode, &mut state, horizon);
        let x = state.point.x.clone();
        self.state = state;
        settled.map(|()| x)
    }
}
