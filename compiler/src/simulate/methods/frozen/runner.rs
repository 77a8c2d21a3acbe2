//! Runs of a frozen system that is plain data: with other parameters, from other starts and to other horizons.

use std::sync::Arc;

use nsd_solver::event::{Observer, Simulator};
use nsd_solver::fesd::{self as elements, ComplementaritySystem, Grid, Library, Recorded};
use nsd_solver::hybrid as solver;
use nsd_solver::hybrid::{Coefficient, HybridSystem, Outcome, Side};
use nsd_solver::sensitivity::{Directions, Moment, Sensitivities};

use super::back_map::BackMap;
use super::law::impact;
use super::physical_time::{End, InitialPoint, Law, Numerical, drive};
use crate::limit::Limit;
use crate::lowering::dcs::Formulation;
use crate::lowering::{dcs, hybrid};
use crate::simulate::driver::Accuracy;
use crate::simulate::methods::events::{finer, renewed, solver_settings};
use crate::simulate::methods::fesd::complementarity_open;
use crate::simulate::methods::fesd::{Keeper, grid, options};
use crate::system::System;
use crate::system::experiment::Settings;
use crate::system::freezing::{Frozen, Measures, Start};

/// A frozen system, and how it is run.
#[derive(Clone, Debug)]
pub(crate) struct FrozenRunner {
    map: BackMap,
    start: Start,
    integrator: Integrator,
    /// The system with jumps, which impacts are compared with where forces may make another one of them.
    jumping: Option<Arc<HybridSystem>>,
    /// The values of all parameters of the original.
    params: Vec<f64>,
    /// Those that stay open, by their numbers.
    open: Vec<usize>,
    /// How many measures of a run are open parameters behind them: all, or none, which are numbers then.
    n_measures: usize,
    /// What states behind those of the original start with.
    behind: Vec<f64>,
    /// Whether elements are recorded.
    pub(super) records: bool,
}

/// By what it is run.
#[derive(Clone, Debug)]
enum Integrator {
    Events {
        hybrid: Arc<HybridSystem>,
        settings: Box<solver::Settings>,
    },
    Elements {
        complementarity: Box<ComplementaritySystem>,
        formulation: Formulation,
        settings: elements::Settings,
        /// What runs have made of its functions.
        library: Library,
    },
}

/// A run in physical time.
pub(crate) struct PhysicalRun {
    pub outcome: Outcome,
    pub(super) end: Option<End>,
    /// Order of the method, and the least member of a pair of complementarity.
    pub order: usize,
    pub least_member: f64,
    /// Where it is differentiated.
    pub(super) recorded: Option<Recorded>,
}

impl FrozenRunner {
    /// Compiles what a system was frozen into, with parameters open as they were then, by their numbers.
    pub(super) fn new(
        system: &System<'_>,
        frozen: &Frozen<'_>,
        settings: &Settings<'_>,
        open: &[usize],
    ) -> Self {
        let measures = system.exogenous.params.len()..frozen.system.exogenous.params.len();
        let inputs: Vec<usize> = open.iter().copied().chain(measures).collect();
        let behind = frozen.system.states[frozen.n_states..].iter();
        let mut runner = FrozenRunner {
            map: BackMap::new(frozen, &inputs),
            start: frozen.start.clone(),
            integrator: Integrator::new(&frozen.system, settings, &inputs),
            jumping: (frozen.meeting.is_open).then(|| hybrid::lower_at(system, open)),
            params: system.exogenous.numbers().map(|(_, p)| p).collect(),
            open: open.to_vec(),
            n_measures: inputs.len() - open.len(),
            behind: behind.map(|state| state.initial).collect(),
            records: false,
        };
        runner.choose(settings, Accuracy::of(settings), Limit::default());
        runner
    }

    /// Whether runs may have other starts and horizons than what was frozen.
    pub fn takes_measures(&self) -> bool {
        self.n_measures > 0
    }

    /// Gives the open parameters other values.
    pub fn set_parameters(&mut self, values: &[f64]) {
        for (&place, &value) in self.open.iter().zip(values) {
            self.params[place] = value;
        }
    }

    /// Takes the accuracy of a run, and when it stops.
    pub(super) fn choose(&mut self, settings: &Settings<'_>, accuracy: Accuracy, limit: Limit) {
        // Gaps stand still at zero while contacts act on each other: these are closed.
        let contacts = self.map.contacts.iter();
        let below: Vec<usize> = contacts.map(|contact| contact.switch).collect();
        match &mut self.integrator {
            Integrator::Events {
                hybrid,
                settings: own,
            } => {
                let tolerance = accuracy.tolerance;
                let mut chosen = solver_settings(&settings.numerics.method, tolerance, limit);
                if accuracy.is_finer {
                    let order = Simulator::new(hybrid.clone(), chosen.clone()).order();
                    chosen = finer(&chosen, order, tolerance);
                }
                **own = solver::Settings { below, ..chosen };
            }
            Integrator::Elements { settings: own, .. } => {
                let options = options(settings);
                *own = elements::Settings {
                    below,
                    limit,
                    grid: grid(options, accuracy),
                    ..elements::Settings::new(options.scheme.0, options.scheme.1)
                };
            }
        }
    }

    /// The state of the frozen system from which the original starts at x0.
    fn from(&self, x0: &[f64], measures: &Measures) -> Vec<f64> {
        let mut x = [x0, &self.behind].concat();
        for (memory, &start) in self.map.relays.iter().zip(&measures.memories) {
            x[memory.state] = start;
        }
        x
    }

    /// A run that ends where it begins, where there is none with these measures.
    fn refused(&self, measures: &Measures, x0: &[f64]) -> Option<PhysicalRun> {
        let switch = |contact: usize| self.map.contacts[contact].switch;
        let below = measures.below.map(|k| End::Below(switch(k)));
        let unlike = || {
            let (k, e) = measures.restitution?;
            Some(End::Outside(switch(k), Coefficient::Restitution, e))
        };
        let end = below.or_else(unlike)?;
        let sides = vec![Side::Plus; self.map.places.len()];
        Some(PhysicalRun {
            outcome: Outcome::at(end.status(&self.map), 0.0, x0.to_vec(), sides),
            end: Some(end),
            order: 0,
            least_member: 0.0,
            recorded: None,
        })
    }

    /// A run until the clock has reached a horizon; `kept` is the last one from event to event.
    pub fn run(
        &mut self,
        horizon: f64,
        x0: &[f64],
        kept: &mut Option<Simulator>,
        observer: &mut dyn Observer,
    ) -> PhysicalRun {
        let measures = self.start.measures(&self.params, x0, horizon);
        if let Some(run) = self.refused(&measures, x0) {
            return run;
        }
        let x = self.from(x0, &measures);
        let open: Vec<f64> = self.open.iter().map(|&place| self.params[place]).collect();
        let law = self.jumping.clone().map(|jumping| -> Box<Law> {
            let mut simulator = Simulator::new(jumping, Default::default());
            simulator.set_parameters(&open);
            Box::new(move |t: f64, x: &[f64]| impact(&mut simulator, horizon, t, x))
        });
        let parameters = [&open[..], &measures.inputs[..self.n_measures]].concat();
        let initial = InitialPoint {
            x: &x,
            parameters: &parameters,
        };
        let (mut order, mut least_member, mut recorded) = (0, 0.0_f64, None);
        let drive = |run: &mut Numerical| drive(&self.map, initial, horizon, observer, law, run);
        let (outcome, end) = match &mut self.integrator {
            Integrator::Events { hybrid, settings } => {
                let simulator = renewed(kept, hybrid, settings.as_ref().clone());
                simulator.set_parameters(&parameters);
                order = simulator.order();
                drive(&mut |end, x, physical| simulator.run(0.0, end, x, physical))
            }
            Integrator::Elements {
                complementarity,
                settings,
                library,
                ..
            } => {
                complementarity.parameters.copy_from_slice(&parameters);
                let records = self.records;
                drive(&mut |end, x, physical| {
                    let settings = elements::Settings {
                        grid: longer(settings.grid, end / horizon),
                        ..settings.clone()
                    };
                    let simulator = elements::Simulator::new(complementarity, settings.clone());
                    let simulator = simulator.expect("the number of nodes has been checked");
                    let mut simulator = simulator.knowing(std::mem::take(library));
                    let mut observer: &mut dyn Observer = physical;
                    let solution = match records {
                        false => simulator.run(0.0, end, x, &mut observer),
                        true => {
                            let mut keeper = Keeper::recording(observer);
                            let solution = simulator.run(0.0, end, x, &mut keeper);
                            recorded = keeper.recording.map(|recording| Recorded {
                                settings,
                                recording,
                                turns: Vec::new(),
                                clock: Some(self.map.clock),
                            });
                            solution
                        }
                    };
                    *library = simulator.library().clone();
                    least_member = least_member.min(solution.least_member);
                    order = simulator.order();
                    solution.outcome
                })
            }
        };
        PhysicalRun {
            outcome,
            end,
            order,
            least_member,
            recorded,
        }
    }

    /// The derivatives of a run, of states and switches of the original. What measures are, and how states behind them
    /// start, moves nothing of these.
    pub fn differentiate(
        &self,
        recorded: &Recorded,
        directions: &Directions,
        instants: &[Moment],
    ) -> Option<Sensitivities> {
        let Integrator::Elements {
            complementarity, ..
        } = &self.integrator
        else {
            return None;
        };
        let mut directions = directions.clone();
        for x in &mut directions.initial {
            x.resize(x.len() + self.behind.len(), 0.0);
        }
        for by in &mut directions.parameters {
            by.resize(complementarity.parameters.len(), 0.0);
        }
        let found = elements::differentiate(complementarity, recorded, &directions, instants);
        Some(self.map.sensed(found.ok()?))
    }

    /// How switches are stated for elements.
    pub(super) fn formulation(&self) -> Option<Formulation> {
        match &self.integrator {
            Integrator::Events { .. } => None,
            Integrator::Elements { formulation, .. } => Some(*formulation),
        }
    }

    /// How a run has ended, of the contacts of the original; other switches are those of the frozen system.
    pub fn told(&self, run: PhysicalRun) -> Outcome {
        match run.end {
            Some(end) => Outcome {
                status: end.status(&self.map),
                ..run.outcome
            },
            None => run.outcome,
        }
    }
}

impl Integrator {
    fn new(frozen: &System<'_>, settings: &Settings<'_>, open: &[usize]) -> Self {
        if !settings.numerics.method.kind().needs_dcs() {
            return Integrator::Events {
                hybrid: hybrid::lower_at(frozen, open),
                settings: Box::default(),
            };
        }
        let dcs = dcs::lower(frozen, &settings.numerics.lowerings);
        let dcs = dcs.expect("compilation has checked that the system can be lowered");
        let (family, nodes) = options(settings).scheme;
        Integrator::Elements {
            complementarity: Box::new(complementarity_open(frozen, &dcs, open)),
            formulation: dcs.lowering.formulation,
            settings: elements::Settings::new(family, nodes),
            library: Library::default(),
        }
    }
}

/// The grid of a numerical time, which is so many times the horizon: steps keep their length.
fn longer(grid: Grid, share: f64) -> Grid {
    match grid {
        Grid::Steps { steps, elements } => Grid::Steps {
            steps: (steps as f64 * share - 1e-9).ceil().max(1.0) as usize,
            elements,
        },
        adaptive => adaptive,
    }
}
