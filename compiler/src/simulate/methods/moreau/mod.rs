//! `method timestepping` of a model with contacts: Moreau-Jean steps.
//!
//! A second run with twice as many steps gives the estimate of the error: of velocities, but where a contact was struck
//! in one run and not yet in the other.

use crate::limit::Limit;
use crate::lowering::hybrid::Pulses;
mod free;
mod record;
mod scene;
mod strikes;

use nsd_solver::event::Observer;
use nsd_solver::hybrid::Status as End;
use nsd_solver::moreau::{Change, Scene, Settings as StepSettings, Solution, Stepper};

pub(crate) use self::free::Free;
pub(crate) use self::record::Told;
use self::strikes::Strikes;
use super::adaptive::Inputs;
use super::fesd::stepping::{options, steps};
use crate::report::{Failure, Method, Trajectory, Warning};
use crate::simulate::driver::{Accuracy, Ended, Problem, Run};
use crate::simulate::estimate::Estimator;
use crate::simulate::outcome::outside;
use crate::system::System;
use crate::system::experiment::{MethodKind, Settings};

/// An entry of a vector has this share of the largest one as its size at least: that of a place on a floor which
/// nothing leaves is rounding.
const SMALL: f64 = 1e-9;

/// The bodies of a system and their contacts, as plain data.
#[derive(Clone, Debug)]
pub(crate) struct Bodies {
    scene: Scene,
    free: Free,
}

impl Bodies {
    /// Compiles a system, with some parameters open, by their numbers; `pulses` are those of its runs.
    pub fn new(system: &System, open: &[usize], pulses: Pulses) -> Self {
        let inputs = Inputs::new(system, open);
        Bodies {
            scene: scene::scene(system, &inputs),
            free: Free::new(system, &inputs, pulses),
        }
    }

    /// What steps through them.
    pub fn stepper(&self, settings: StepSettings) -> Stepper<Free> {
        Stepper::new(self.scene.clone(), self.free.clone(), settings)
    }
}

/// Bodies and contacts that are stepped.
pub(crate) struct Contacts {
    bodies: Bodies,
    /// The parameters that stay open, by their numbers.
    open: Vec<usize>,
    pulses: Pulses,
    /// What the first run has left.
    changes: Vec<(f64, usize, Change)>,
    strikes: Strikes,
    /// Between impacts of this run and those of the finer one.
    apart: Vec<(f64, f64)>,
    impulses: usize,
    gaps: usize,
    plastic: usize,
}

impl Contacts {
    /// Compiles a system, with some parameters open, by their numbers.
    pub fn new(system: &System, settings: &Settings, open: &[usize]) -> Self {
        let pulses = Pulses::of(system, settings.horizon);
        Contacts {
            bodies: Bodies::new(system, open, pulses.clone()),
            open: open.to_vec(),
            pulses,
            changes: Vec::new(),
            strikes: Strikes::default(),
            apart: Vec::new(),
            impulses: 0,
            gaps: 0,
            plastic: 0,
        }
    }
}

impl<'e> Run<'e> for Contacts {
    fn march(
        &mut self,
        problem: &Problem<'_, 'e>,
        accuracy: Accuracy,
        observer: &mut dyn Observer,
    ) -> Ended {
        let settings = StepSettings {
            steps: steps(problem.settings, accuracy),
            limit: problem.limit.clone(),
        };
        let mut told = Told::to(observer);
        let system = problem.system;
        let mut stepper = self.bodies.stepper(settings);
        let free = stepper.free();
        free.set_parameters(&system.values_of(&self.open));
        free.set_data(system);
        let solution = stepper.run(0.0, problem.settings.horizon, &problem.x0, &mut told);
        if accuracy.is_finer {
            self.apart = self.strikes.between(&told.strikes);
        } else {
            self.changes = told.changes;
            self.strikes = told.strikes;
            self.impulses = solution.impulses;
            self.gaps = solution.gaps;
            self.plastic = solution.plastic;
        }
        Ended {
            failure: failure(system, &solution),
            outcome: solution.outcome,
        }
    }

    fn describe(&self, problem: &Problem<'_, 'e>, _: &Ended) -> Method {
        Method::of(MethodKind::Timestepping)
            .word("scheme", "moreau_jean")
            .count("steps", options(problem.settings).steps)
            .count("impulses", self.impulses)
            .count("gaps", self.gaps)
    }

    fn estimator(&self, _: &Settings<'e>) -> Estimator {
        Estimator::Steps
    }

    fn compares(&self, ended: &Ended) -> bool {
        ended.is_solved()
    }

    fn takes_numbers(&self) -> bool {
        true
    }

    /// Velocities.
    fn jumping(&self, system: &System<'e>) -> Vec<usize> {
        let bodies = system.jumps.bodies.iter();
        bodies.flat_map(|body| body.velocities.clone()).collect()
    }

    fn apart(&self) -> Vec<(f64, f64)> {
        self.apart.clone()
    }

    /// A share of the largest entry of its vector.
    fn least_sizes(&self, system: &System<'e>, sizes: &[f64]) -> Vec<f64> {
        let mut least = vec![0.0; sizes.len()];
        for group in &system.recorded.groups {
            let entries = group.entries.iter().map(|&i| sizes[i]);
            let largest = entries.fold(0.0, f64::max);
            for &i in &group.entries {
                least[i] = SMALL * largest;
            }
        }
        least
    }

    fn tell(&mut self, problem: &Problem<'_, 'e>, ended: &Ended, trajectory: &mut Trajectory) {
        let Problem {
            system, settings, ..
        } = problem;
        record::write(system, &self.changes, ended.outcome.time, trajectory);
        let plastic = (self.plastic > 0).then(|| Warning {
            code: "W0713".into(),
            message: format!(
                "in {} steps impacts were taken without rebound: their restitutions contradict each other",
                self.plastic
            ),
            span: Some(settings.span),
        });
        let length = settings.horizon / options(settings).steps as f64;
        let unseen = self.pulses.warning(length, settings);
        trajectory
            .warnings
            .extend(plastic.into_iter().chain(unseen));
    }
}

/// The steps of the first run of an experiment.
pub(crate) fn first_steps(settings: &Settings) -> StepSettings {
    StepSettings {
        steps: steps(settings, Accuracy::of(settings)),
        limit: Limit::default(),
    }
}

/// What steps through a system to a horizon.
pub fn stepper(
    system: &System,
    horizon: f64,
    steps: usize,
    limit: Limit,
) -> Stepper<impl nsd_solver::moreau::Free> {
    let bodies = Bodies::new(system, &[], Pulses::of(system, horizon));
    bodies.stepper(StepSettings { steps, limit })
}

/// What a contact has ended a run by.
fn failure(system: &System, solution: &Solution) -> Option<Failure> {
    let contact = &system.jumps.impulsive[solution.stuck?];
    let time = solution.outcome.time;
    let name = contact.name.clone();
    let label = miette::LabeledSpan::new_with_span(Some(format!("contact `{name}`")), contact.span);
    Some(match &solution.outcome.status {
        End::Penetrates { .. } => Failure::Penetrates {
            time,
            name,
            surfaces: vec![label],
        },
        &End::Coefficient {
            coefficient, value, ..
        } => outside((coefficient, value), (time, name), vec![label]),
        _ => Failure::Impulses {
            time,
            name,
            surfaces: vec![label],
        },
    })
}
