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

mod algebraic;
mod approach;
mod blind;
mod candidates;
mod chatter;
mod check;
mod clock;
mod coefficients;
mod cones;
mod control;
mod data;
pub(crate) mod dense;
mod depart;
mod disc;
mod drift;
mod dummy;
mod expansion;
mod field;
mod fold;
mod form;
mod guide;
mod halt;
mod hidden;
mod impact;
mod implicit;
mod judge;
mod jump;
mod kick;
mod layout;
mod lead;
#[cfg(test)]
mod lead_tests;
mod meeting;
mod mend;
mod merge;
mod mode;
mod observer;
mod order;
mod overlooked;
mod persist;
mod pieces;
mod pivot;
mod psi;
mod radau;
mod rank;
mod rest;
pub(crate) mod roots;
mod rounding;
mod run;
mod select;
pub(crate) mod series;
mod set_out;
mod settings;
mod several;
mod share;
mod sight;
mod singular;
mod sliding;
mod state;
mod status;
mod step;
mod stiffness;
mod surfaces;
mod system;
#[cfg(test)]
mod tests;
mod turn;
mod unseen;
mod window;
pub(crate) mod zeno;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::limit::Limit;

pub use approach::{Approach, Visit};
pub use clock::{Clock, Clocked};
use coefficients::Coefficients;
pub use data::{Piece, Piecewise, write_pieces};
pub use dense::Polynomials;
pub use form::{Argument, Form, Instance, Partials};
pub use guide::{Guide, Next, Standing};
pub use hidden::{Decision, SlidingMode};
pub use impact::ImpactLaw;
use jump::Jumps;
pub use kick::{KickSize, Kicks};
use mode::Mode;
pub use observer::{Event, Observer, Segment};
pub use overlooked::Overlooked;
use pieces::Pieces;
use roots::RootFinder;
pub use select::{Candidate, MAX_NAMED};
pub use settings::Settings;
use state::State;
pub use status::{Coefficient, Function, Note, Stats, Status};
use stiffness::Stiffness;
pub use system::{
    Block, Effect, Guard, HybridSystem, Impact, Input, Law, Reset, Role, Switch, SwitchKind,
};
use unseen::Unseen;

/// Where a switch stands relative to its surface ψ = 0.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum Side {
    /// ψ < 0, α = 0.
    Minus,
    /// ψ = 0 and stays so; α is what keeps it there.
    Slide,
    /// ψ > 0, α = 1.
    Plus,
}

impl Side {
    /// -1, 0 or 1.
    pub fn sign(self) -> f64 {
        match self {
            Side::Minus => -1.0,
            Side::Slide => 0.0,
            Side::Plus => 1.0,
        }
    }

    /// The side of a value of ψ; zero belongs to `Plus`.
    pub fn of(value: f64) -> Side {
        if value < 0.0 { Side::Minus } else { Side::Plus }
    }
}

/// The end of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Why it ended.
    pub status: Status,
    /// When.
    pub time: f64,
    /// Where.
    pub x: Vec<f64>,
    /// The last mode.
    pub sides: Vec<Side>,
    /// α of the last mode.
    pub alpha: Vec<f64>,
    /// Mean size of the terms of each rate: times ε and the length of the run, what rounding may
    /// have done to a state that cancellation holds in place.
    pub activity: Vec<f64>,
    /// What rounding may have moved each state by, through the times of events.
    pub moved: Vec<f64>,
    /// Largest |ψ| seen on a sliding surface, relative to the size of its terms.
    pub drift: f64,
    /// Largest ‖x' - f‖ h at the end of a step, relative to the tolerance's scale.
    pub defect: f64,
    /// Largest residual of the complementarity problems of contacts, relative to the size of their rates.
    pub complementarity: f64,
    /// What it went on from although it could not be sure.
    pub notes: Vec<Note>,
    /// Surfaces with another field behind them that came close, in order of time.
    pub approaches: Vec<Approach>,
    /// Counts.
    pub stats: Stats,
}

impl Outcome {
    /// A run that has ended at an instant and a state with switches on these sides, and has nothing else to tell: α of those
    /// that slide is 1/2.
    pub fn at(status: Status, time: f64, x: Vec<f64>, sides: Vec<Side>) -> Self {
        let n = x.len();
        Outcome {
            status,
            time,
            x,
            alpha: sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect(),
            sides,
            activity: vec![0.0; n],
            moved: vec![0.0; n],
            drift: 0.0,
            defect: 0.0,
            complementarity: 0.0,
            notes: Vec::new(),
            approaches: Vec::new(),
            stats: Stats::default(),
        }
    }
}

/// Runs a system, keeping the functions it has met from one run to the next.
pub struct Simulator {
    system: Arc<HybridSystem>,
    settings: Settings,
    order: usize,
    mode: Mode,
    /// Switches whose rates the α of a switch may occur in.
    coupled_by: Vec<Vec<usize>>,
    pieces: Pieces,
    roots: RootFinder,
    stiffness: Stiffness,
    jumps: Jumps,
    coefficients: Coefficients,
    unseen: Unseen,
    /// Memory that one run leaves to the next.
    state: State,
}

impl Simulator {
    /// A simulator without any mode yet.
    pub fn new(system: Arc<HybridSystem>, settings: Settings) -> Self {
        let order = settings.series_order();
        let mut coupled_by = vec![Vec::new(); system.n_switches()];
        for rate in 0..system.n_switches() {
            for &alpha in &system.switches[rate].couplings {
                coupled_by[alpha].push(rate);
            }
        }
        Simulator {
            order,
            stiffness: Stiffness::new(settings.local_tolerance()),
            settings,
            mode: Mode::new(&system, order),
            coupled_by,
            pieces: Pieces::new(&system),
            roots: RootFinder::new(order.max(stiffness::MOST_NODES)),
            jumps: Jumps::default(),
            coefficients: Coefficients::of(&system),
            unseen: Unseen::default(),
            state: State::default(),
            system,
        }
    }

    /// One with other settings, which knows what this one has met.
    pub fn with(&self, settings: Settings) -> Self {
        let mut other = Simulator::new(self.system.clone(), settings);
        other.mode.library.clone_from(&self.mode.library);
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
        mode.probed.load(&mode.memory);
    }

    /// Ends all runs that follow where the limit does.
    pub fn set_limit(&mut self, limit: Limit) {
        self.settings.limit = limit;
    }

    /// The number of functions that were made so far, of all sides that runs have met: blocks and surfaces of one form
    /// share them.
    pub fn n_functions(&self) -> usize {
        self.mode.library.len()
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Order of the Taylor series.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Order of the implicit method that takes over where a mode is stiff.
    pub fn implicit_order(&self) -> usize {
        self.stiffness.order()
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
        self.mode.enter(&self.system, sides);
        self.mode.set(t, x, alpha);
        self.mode.jacobian(&self.system, entry);
    }
}
