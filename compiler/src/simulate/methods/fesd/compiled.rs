//! A complementarity system as data, with the functions that runs have made of it.

use std::sync::Arc;

use nsd_solver::event;
use nsd_solver::fesd::{
    self, ComplementaritySystem, Library, Simulator, Solution, Stepper, SteppingSettings,
};
use nsd_solver::hybrid::{HybridSystem, Outcome};

use super::complementarity::complementarity_open;
use crate::lowering::hybrid::Pulses;
use crate::lowering::{dcs, hybrid};
use crate::system::System;
use crate::system::experiment::Settings;

/// A complementarity system that is compiled once, and what runs have made of its functions.
#[derive(Clone, Debug)]
pub(crate) struct Compiled {
    pub complementarity: ComplementaritySystem,
    pub library: Library,
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
            complementarity: complementarity_open(system, &dcs, open),
            library: Library::default(),
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
        compiled.complementarity.stops = pulses.stops().to_vec();
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
        self.complementarity.parameters.copy_from_slice(values);
    }

    /// Takes the data of a system, and its values of the open parameters.
    pub fn load(&mut self, system: &System) {
        let params = system.exogenous.chosen(&self.open).map(|param| param.value);
        self.complementarity.parameters = params.collect();
        let data = hybrid::data_of(system);
        self.complementarity.data[..data.len()].clone_from_slice(&data);
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
        let library = std::mem::take(&mut self.library);
        let simulator = Simulator::new(&self.complementarity, settings);
        let simulator = simulator.expect("the number of nodes has been checked");
        let simulator = simulator.knowing(library);
        let mut simulator = match &self.events {
            Some(hybrid) => {
                let settings = nsd_solver::hybrid::Settings::default();
                let mut selector = event::Simulator::new(hybrid.clone(), settings);
                selector.set_parameters(&self.complementarity.parameters);
                selector.set_data(0, &self.complementarity.data);
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
        self.library = library;
        ran
    }

    /// A run in steps of one length, with a number of nodes that has been checked.
    pub fn by_steps(
        &mut self,
        settings: SteppingSettings,
        horizon: f64,
        x0: &[f64],
        observer: &mut dyn event::Observer,
    ) -> Outcome {
        let library = std::mem::take(&mut self.library);
        let stepper = Stepper::new(&self.complementarity, settings);
        let stepper = stepper.expect("the number of nodes has been checked");
        let mut stepper = stepper.knowing(library);
        let outcome = stepper.run(0.0, horizon, x0, observer);
        self.library = stepper.library().clone();
        outcome
    }
}

/// A run, the order of its elements where nothing switches, and the defect that one may have.
pub(crate) struct Ran {
    pub solution: Solution,
    pub order: usize,
    pub allowed: Option<f64>,
}
