//! A complementarity system as data, with the functions that runs have made of it.

use std::sync::Arc;

use nsd_solver::event;
use nsd_solver::fesd::{
    self, Balanced, ComplementaritySystem, Grid, Simulator, Solution, Stepper, SteppingSettings,
    Version,
};
use nsd_solver::hybrid::{HybridSystem, Outcome};

use super::complementarity::complementarity_open;
use crate::lowering::hybrid::Pulses;
use crate::lowering::{dcs, hybrid};
use crate::system::System;
use crate::system::experiment::Settings;

/// How accurate a run is that shows the sizes of states, and how long.
const ROUGH: f64 = 1e-3;
const ROUGH_STEPS: usize = 256;
const ROUGH_ELEMENTS: usize = 10_000;

/// A complementarity system that is compiled once, and what runs have made of its functions.
#[derive(Clone, Debug)]
pub(crate) struct Compiled {
    balanced: Balanced,
    /// Where switches are nonlinear: the same system event by event.
    events: Option<Arc<HybridSystem>>,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    /// How it is stated.
    pub lowering: &'static str,
}

impl Compiled {
    /// A system as an experiment states it, with some parameters open, and the names of its algebraic variables.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> (Self, Vec<String>) {
        let dcs = dcs::lower(system, &settings.numerics.lowerings);
        let dcs = dcs.expect("compilation has checked that the system can be lowered");
        let compiled = Compiled {
            balanced: Balanced::new(complementarity_open(system, &dcs, open)),
            events: None,
            open: open.to_vec(),
            lowering: dcs.lowering.formulation.word(),
        };
        let names = dcs.algebraics.iter().map(|z| z.var.to_string());
        (compiled, names.collect())
    }

    /// The same for elements that end where functions of time are narrow.
    pub fn for_elements(
        system: &System,
        settings: &Settings,
        open: &[usize],
        pulses: &Pulses,
    ) -> (Self, Vec<String>) {
        let (mut compiled, names) = Compiled::new(system, settings, open);
        compiled.balanced.stated().stops = pulses.stops().to_vec();
        compiled.events = (system.first_nonlinear()).map(|_| hybrid::lower_at(system, open));
        (compiled, names)
    }

    /// The same for runs without a record.
    pub fn prepared(system: &System, settings: &Settings, open: &[usize]) -> Self {
        let pulses = Pulses::of(system, settings.horizon);
        Compiled::for_elements(system, settings, open, &pulses).0
    }

    /// Gives the open parameters other values.
    pub fn set_parameters(&mut self, values: &[f64]) {
        self.balanced.stated().parameters.copy_from_slice(values);
    }

    /// Takes the data of a system, and its values of the open parameters.
    pub fn load(&mut self, system: &System) {
        let params = system.exogenous.chosen(&self.open).map(|param| param.value);
        self.balanced.stated().parameters = params.collect();
        let data = hybrid::data_of(system);
        self.balanced.stated().data[..data.len()].clone_from_slice(&data);
    }

    /// The system, in the units of its last run.
    pub fn system(&self) -> &ComplementaritySystem {
        &self.balanced.present().system
    }

    /// A run by elements, with a number of nodes that has been checked. Where switches are nonlinear, complementarity
    /// does not say which of several sliding modes is taken: the selection of events does.
    pub fn by_elements(
        &mut self,
        settings: fesd::Settings,
        horizon: f64,
        x0: &[f64],
        observer: &mut dyn fesd::Observer,
    ) -> Ran {
        let events = self.events.as_ref();
        let version = self.balanced.over(horizon, x0, |version, mut sizes| {
            let over = (horizon, x0);
            elements(version, events, rough(&settings), over, &mut sizes);
        });
        elements(version, events, settings, (horizon, x0), observer)
    }

    /// A run in steps of one length, with a number of nodes that has been checked.
    pub fn by_steps(
        &mut self,
        settings: SteppingSettings,
        horizon: f64,
        x0: &[f64],
        observer: &mut dyn event::Observer,
    ) -> Outcome {
        let run = |version: &mut Version, settings, observer: &mut dyn event::Observer| {
            let library = std::mem::take(&mut version.library);
            let stepper = Stepper::new(&version.system, settings);
            let stepper = stepper.expect("the number of nodes has been checked");
            let mut stepper = stepper.knowing(library);
            let outcome = stepper.run(0.0, horizon, x0, observer);
            version.library = stepper.library().clone();
            outcome
        };
        let version = self.balanced.over(horizon, x0, |version, sizes| {
            let steps = settings.steps.min(ROUGH_STEPS);
            let rough = SteppingSettings {
                steps,
                ..settings.clone()
            };
            run(version, rough, sizes);
        });
        run(version, settings, observer)
    }
}

/// A run by elements from x₀ to a horizon, of a system that may have nonlinear switches.
fn elements(
    version: &mut Version,
    events: Option<&Arc<HybridSystem>>,
    settings: fesd::Settings,
    (horizon, x0): (f64, &[f64]),
    observer: &mut dyn fesd::Observer,
) -> Ran {
    let library = std::mem::take(&mut version.library);
    let system = &version.system;
    let simulator = Simulator::new(system, settings);
    let simulator = simulator.expect("the number of nodes has been checked");
    let simulator = simulator.knowing(library);
    let mut simulator = match events {
        Some(hybrid) => {
            let settings = nsd_solver::hybrid::Settings::default();
            let mut selector = event::Simulator::new(hybrid.clone(), settings);
            selector.set_parameters(&system.parameters);
            selector.set_data(0, &system.data);
            simulator.with_mode_selector(selector)
        }
        None => simulator,
    };
    let ran = Ran {
        solution: simulator.run(0.0, horizon, x0, observer),
        order: simulator.order(),
        allowed: simulator.allowed_defect(),
    };
    let library = simulator.library().clone();
    drop(simulator);
    version.library = library;
    ran
}

/// Settings with which the sizes of states show.
fn rough(settings: &fesd::Settings) -> fesd::Settings {
    let grid = match settings.grid {
        Grid::Steps { steps, elements } => Grid::Steps {
            steps: steps.min(ROUGH_STEPS),
            elements,
        },
        Grid::Adaptive { tolerance } => Grid::Adaptive {
            tolerance: tolerance.max(ROUGH),
        },
    };
    fesd::Settings {
        grid,
        max_elements: settings.max_elements.min(ROUGH_ELEMENTS),
        ..settings.clone()
    }
}

/// A run, the order of its elements where nothing switches, and the defect that one may have.
pub(crate) struct Ran {
    pub solution: Solution,
    pub order: usize,
    pub allowed: Option<f64>,
}
