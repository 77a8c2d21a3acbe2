//! Runs of one system, whose steps are programs that are made once.

use std::collections::hash_map::Entry;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::march::{MOST_ADDED, MOST_PARTS, Make, March};
use super::{Grid, Points, Program, Reached, Reference, Shape, StepProgram, Stepper, Work};
use crate::event;
use crate::event::Observer;
use crate::hybrid::{HybridSystem, Settings, Status};
use crate::linalg::analyses::Analyses;
use crate::runtime::limit::Limit;

/// How accurate runs from event to event are.
const TOLERANCE: f64 = 1e-11;

/// A system with contacts as plain data: its functions at a point, its runs from event to event, and the programs of its
/// steps. It can be written and read, the same bit for bit in formats that keep numbers, and is checked when it is read.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct System<P> {
    /// What is known at points.
    pub points: Points,
    /// Elements as polynomials.
    pub shape: Shape,
    /// The same system event by event, whose parameters are those that stay open.
    pub events: Arc<HybridSystem>,
    /// The places of these among all parameters.
    pub open: Vec<usize>,
    /// The values of all parameters.
    pub parameters: Vec<f64>,
    /// The programs that were made so far, by the number of their elements.
    pub programs: FxHashMap<usize, StepProgram<P>>,
}

impl<P: Program> System<P> {
    /// Makes the programs of all numbers of elements that steps of at least so many may need.
    pub fn prepare(&mut self, elements: usize, make: Make<P>) {
        for elements in elements..=elements.max(MOST_PARTS) + MOST_ADDED {
            if let Some(made) = make(elements) {
                self.programs.insert(elements, made);
            }
        }
    }

    /// The program of steps of a grid with so many elements, whatever they start from.
    pub(super) fn program(
        &mut self,
        elements: usize,
        grid: Grid,
        make: Make<P>,
    ) -> Option<&mut StepProgram<P>> {
        let program = match self.programs.entry(elements) {
            Entry::Occupied(made) => made.into_mut(),
            Entry::Vacant(place) => place.insert(make(elements)?),
        };
        program.set_numbers(&self.parameters, grid.horizon / grid.steps as f64);
        Some(program)
    }
}

/// Runs of a system, which keep what they make.
pub struct Simulator<P> {
    system: System<P>,
    events: event::Simulator,
    analyses: Analyses,
}

impl<P: Program> Simulator<P> {
    /// Nothing is made yet but what the system has.
    pub fn new(system: System<P>) -> Self {
        let settings = Settings {
            tolerance: TOLERANCE,
            ..Settings::default()
        };
        Simulator {
            events: event::Simulator::new(system.events.clone(), settings),
            system,
            analyses: Analyses::default(),
        }
    }

    /// The places of the parameters that stay open.
    pub fn open(&self) -> &[usize] {
        &self.system.open
    }

    /// Gives the open parameters other values.
    pub fn set_parameters(&mut self, values: &[f64]) {
        for (&place, &value) in self.system.open.iter().zip(values) {
            self.system.parameters[place] = value;
        }
        self.system.points.set_parameters(&self.system.parameters);
        self.events.set_parameters(values);
    }

    /// A run from event to event.
    pub fn follow(&mut self, horizon: f64, x0: &[f64], limit: &Limit) -> Reference {
        self.events.set_limit(limit.clone());
        let (events, points) = (&mut self.events, &mut self.system.points);
        Reference::follow(
            |mut observer| events.run(0.0, horizon, x0, &mut observer),
            |t, x| points.slips(t, x),
        )
    }

    /// A run over a grid, near one from event to event; `make` makes the programs that are not there.
    pub fn run(
        &mut self,
        grid: Grid,
        x0: &[f64],
        (reference, limit): (&Reference, &Limit),
        make: Make<P>,
        observer: &mut dyn Observer,
    ) -> Reached {
        let (points, n_switches) = (self.system.points.clone(), self.system.events.n_switches());
        let stepper = Stepper::new(points, self.analyses.clone(), grid.horizon, x0);
        let march = March {
            system: &mut self.system,
            make,
            limit,
            reference: Some(reference).filter(|run| run.begins()),
            stepper,
            reached: Reached {
                grid,
                n_switches,
                status: Status::Solved,
                at: grid.horizon,
                time: 0.0,
                x: x0.to_vec(),
                size: 0.0,
                jumps: Vec::new(),
                sides: Vec::new(),
                work: Work::default(),
                added: 0,
            },
        };
        march.run(observer)
    }
}
