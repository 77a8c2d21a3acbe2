//! Runs in numerical time: a system is frozen, run event by event or by finite elements, and told in physical time.

mod law;
mod physical_time;
mod stretch;

use std::sync::Arc;

use law::impact;
use nsd_solver::event::{Observer, Simulator};
use nsd_solver::fesd::{self as elements, ComplementaritySystem, Grid, Library};
use nsd_solver::hybrid::{Coefficient, HybridSystem, Outcome};
use physical_time::{End, Law, drive};

use super::blurred;
use super::events::{finer, solver_settings};
use super::fesd::{complementarity, options};
use crate::lowering::dcs::Formulation;
use crate::lowering::{dcs, hybrid};
use crate::report::{Failure, Method, Trajectory};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::Estimator;
use crate::simulate::outcome;
use crate::simulate::record::modes::ModeNames;
use crate::system::System;
use crate::system::experiment::{FesdOptions, MethodKind, Settings};
use crate::system::freezing::{Frozen, freeze};

/// A contact may start this far below its surface, which is rounding.
const ROUNDING: f64 = 1e-9;

/// How a frozen system is run.
enum Road {
    Events(Arc<HybridSystem>),
    Elements(Box<ComplementaritySystem>, Formulation),
}

/// A system in numerical time.
pub(crate) struct InNumericalTime<'e> {
    frozen: Frozen<'e>,
    road: Road,
    /// What runs by elements have made of its functions.
    library: Library,
    /// The system with jumps, which impacts are compared with where forces may make another one of them.
    jumping: Option<Arc<HybridSystem>>,
    /// Order of the method, and the least member of a pair of complementarity, of the first run.
    order: usize,
    least_member: f64,
}

impl<'e> InNumericalTime<'e> {
    /// Freezes and compiles a system.
    pub fn new(system: &System<'e>, settings: &Settings<'e>) -> Self {
        let frozen = freeze(system, settings.pace());
        let frozen = frozen.expect("compilation has checked that the system can be frozen");
        InNumericalTime {
            road: Road::new(&frozen, settings),
            jumping: frozen.meeting.is_open.then(|| hybrid::lower(system)),
            frozen,
            library: Library::default(),
            order: 0,
            least_member: 0.0,
        }
    }
}

impl<'e> Run<'e> for InNumericalTime<'e> {
    /// Integrates the frozen system until its clock has reached the horizon of the experiment.
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let horizon = problem.settings.horizon;
        let law = self.jumping.clone().map(|jumping| -> Box<Law> {
            let mut simulator = Simulator::new(jumping, Default::default());
            Box::new(move |t: f64, x: &[f64]| impact(&mut simulator, horizon, t, x))
        });
        let (outcome, end) = match &self.road {
            Road::Events(hybrid) => {
                let mut simulator = self.by_events(hybrid, problem, accuracy);
                if !accuracy.is_finer {
                    self.order = simulator.order();
                }
                drive(&self.frozen, horizon, observer, law, |end, x, physical| {
                    simulator.run(0.0, end, x, physical)
                })
            }
            Road::Elements(complementarity, _) => {
                let (mut least_member, mut order) = (0.0_f64, 0);
                let mut library = std::mem::take(&mut self.library);
                let found = drive(&self.frozen, horizon, observer, law, |end, x, physical| {
                    let settings = self.elements(problem, accuracy, end / horizon);
                    let simulator = elements::Simulator::new(complementarity, settings);
                    let simulator = simulator.expect("the number of nodes has been checked");
                    let mut simulator = simulator.knowing(std::mem::take(&mut library));
                    let solution = simulator.run(0.0, end, x, physical);
                    library = simulator.library().clone();
                    least_member = least_member.min(solution.least_member);
                    order = simulator.order();
                    solution.outcome
                });
                self.library = library;
                if !accuracy.is_finer {
                    (self.order, self.least_member) = (order, least_member);
                }
                found
            }
        };
        let failure = penetration(problem.system);
        let failure = failure.or_else(|| self.failure(problem.settings, &outcome, end));
        Ended { outcome, failure }
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        self.road.method(problem.settings, self.order)
    }

    fn estimator(&self, settings: &Settings<'e>) -> Estimator {
        Estimator::of_elements(settings)
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, ended: &Ended, trajectory: &mut Trajectory) {
        if let Road::Elements(..) = self.road {
            let blurred = blurred::warning(problem.system, &ended.outcome, trajectory);
            trajectory.warnings.extend(blurred);
            // As of `method fesd`.
            trajectory.quality.certificate.max_violation = -self.least_member;
        }
    }
}

impl InNumericalTime<'_> {
    /// The switches of gaps, which stand still at zero while contacts act on each other: these are closed.
    fn below(&self) -> Vec<usize> {
        let contacts = self.frozen.contacts.iter();
        contacts.map(|contact| contact.switch).collect()
    }

    fn by_events(
        &self,
        hybrid: &Arc<HybridSystem>,
        problem: &Problem,
        accuracy: Accuracy,
    ) -> Simulator {
        let tolerance = accuracy.tolerance;
        let method = &problem.settings.numerics.method;
        let mut chosen = solver_settings(method, tolerance, problem.limit.clone());
        if accuracy.is_finer {
            let order = Simulator::new(hybrid.clone(), chosen.clone()).order();
            chosen = finer(&chosen, order, tolerance);
        }
        chosen.below = self.below();
        Simulator::new(hybrid.clone(), chosen)
    }

    /// The settings of a run by elements over a numerical time, which is so many times the horizon.
    fn elements(&self, problem: &Problem, accuracy: Accuracy, share: f64) -> elements::Settings {
        let options = options(problem.settings);
        elements::Settings {
            below: self.below(),
            limit: problem.limit.clone(),
            grid: grid(options, accuracy, share),
            ..elements::Settings::new(options.scheme.0, options.scheme.1)
        }
    }

    /// Why a run has ended before its horizon.
    fn failure(&self, settings: &Settings, outcome: &Outcome, end: Option<End>) -> Option<Failure> {
        let system = &self.frozen.system;
        let stops = |what: String| Failure::Standstill {
            time: outcome.time,
            what,
            span: settings.span,
        };
        match end {
            Some(End::Limit(limit)) => {
                Some(stops(format!("bounces accumulate towards t = {limit:.6}")))
            }
            Some(End::Closed) => Some(stops("a contact stays closed".to_owned())),
            Some(End::Unlawful) => {
                let what = "forces act at once, which one after the other are another impact";
                Some(stops(what.to_owned()))
            }
            Some(End::Locked(contact)) => Some(Failure::Painleve {
                time: outcome.time,
                name: system.switches[contact].name.clone(),
                surfaces: outcome::labels(system, &[contact]),
            }),
            Some(End::Negative(contact, value)) => {
                let name = system.switches[contact].name.clone();
                let surfaces = outcome::labels(system, &[contact]);
                let of = (Coefficient::Friction, value);
                Some(outcome::outside(of, (outcome.time, name), surfaces))
            }
            None => outcome::failure(system, &ModeNames::new(system), outcome, settings),
        }
    }
}

/// The first contact that starts below its surface.
fn penetration(system: &System) -> Option<Failure> {
    let x: Vec<f64> = system.states.iter().map(|state| state.initial).collect();
    let known = system.valuation(0.0, &x, &[]);
    let contacts = system.switches.iter().enumerate();
    let mut contacts = contacts.filter(|(_, switch)| switch.unilateral);
    let (deep, switch) = contacts.find(|(_, switch)| known.value(switch.psi) < -ROUNDING)?;
    Some(Failure::Penetrates {
        time: 0.0,
        name: switch.name.clone(),
        surfaces: outcome::labels(system, &[deep]),
    })
}

impl Road {
    fn new(frozen: &Frozen, settings: &Settings) -> Self {
        if !settings.numerics.method.kind().needs_dcs() {
            return Road::Events(hybrid::lower(&frozen.system));
        }
        let dcs = dcs::lower(&frozen.system, &settings.numerics.lowerings);
        let dcs = dcs.expect("compilation has checked that the system can be lowered");
        let complementarity = complementarity(&frozen.system, &dcs);
        Road::Elements(Box::new(complementarity), dcs.lowering.formulation)
    }

    fn method(&self, settings: &Settings, order: usize) -> Method {
        match self {
            Road::Events(_) => Method::of(MethodKind::Event)
                .count("order", order)
                .word("lowering", "timefreezing")
                .number("tolerance", settings.numerics.tolerance),
            Road::Elements(_, formulation) => {
                let lowering = format!("timefreezing, {formulation}");
                super::fesd::method(settings, Some(order), &lowering, options(settings).steps)
            }
        }
    }
}

/// The grid of a numerical time, which is so many times the horizon: steps keep their length.
fn grid(options: &FesdOptions, accuracy: Accuracy, share: f64) -> Grid {
    match super::fesd::grid(options, accuracy) {
        Grid::Steps { steps, elements } => Grid::Steps {
            steps: (steps as f64 * share - 1e-9).ceil().max(1.0) as usize,
            elements,
        },
        adaptive => adaptive,
    }
}
