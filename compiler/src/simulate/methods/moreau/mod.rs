//! `method timestepping` of a model with contacts: Moreau-Jean steps.
//!
//! A second run with twice as many steps gives the estimate of the error.

use crate::limit::Limit;
use crate::lowering::hybrid::Pulses;
mod free;
mod record;
mod scene;

use nsd_solver::event::Observer;
use nsd_solver::hybrid::Status as End;
use nsd_solver::moreau::{Change, Scene, Settings as StepSettings, Solution, Stepper};

use self::free::Free;
use self::record::Told;
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

/// Bodies and their contacts.
pub(crate) struct Contacts {
    scene: Scene,
    free: Free,
    pulses: Pulses,
    /// What the first run has left.
    changes: Vec<(f64, usize, Change)>,
    impulses: usize,
    gaps: usize,
    plastic: usize,
    penetration: f64,
}

impl Contacts {
    /// Compiles a system.
    pub fn new(system: &System, settings: &Settings) -> Self {
        let inputs = Inputs::new(system);
        let pulses = Pulses::of(system, settings.horizon);
        Contacts {
            scene: scene::scene(system, &inputs),
            free: Free::new(system, &inputs, pulses.clone()),
            pulses,
            changes: Vec::new(),
            impulses: 0,
            gaps: 0,
            plastic: 0,
            penetration: 0.0,
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
        let mut told = Told {
            observer,
            changes: Vec::new(),
        };
        let mut stepper = Stepper::new(self.scene.clone(), self.free.clone(), settings);
        let solution = stepper.run(0.0, problem.settings.horizon, &problem.x0, &mut told);
        if !accuracy.is_finer {
            self.changes = told.changes;
            self.impulses = solution.impulses;
            self.gaps = solution.gaps;
            self.plastic = solution.plastic;
            self.penetration = solution.penetration;
        }
        Ended {
            failure: failure(problem.system, &solution),
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

    /// A share of the largest entry of its vector.
    fn least_sizes(&self, system: &System<'e>, sizes: &[f64]) -> Vec<f64> {
        let mut least = vec![0.0; sizes.len()];
        for group in &system.groups {
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
        trajectory.certificate.max_violation = self.penetration;
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

/// What steps through a system to a horizon.
pub fn stepper(
    system: &System,
    horizon: f64,
    steps: usize,
    limit: Limit,
) -> Stepper<impl nsd_solver::moreau::Free> {
    let inputs = Inputs::new(system);
    let free = Free::new(system, &inputs, Pulses::of(system, horizon));
    let scene = scene::scene(system, &inputs);
    Stepper::new(scene, free, StepSettings { steps, limit })
}

/// What a contact has ended a run by.
fn failure(system: &System, solution: &Solution) -> Option<Failure> {
    let contact = &system.impulsive[solution.stuck?];
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
