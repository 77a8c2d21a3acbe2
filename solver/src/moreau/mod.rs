//! Moreau-Jean time stepping: bodies with contacts, in steps of one length without event detection.
//!
//! A step of length h goes from (q, v) to (q⁺, v⁺):
//!
//! 1. The motion without contacts, by the midpoint rule (`free.rs`), leads to (q̂, v̂).
//! 2. Contacts with gap(q̂) ≤ 0 are *active*, and so are those that pushed in the last step and have not opened in it
//!    by more than the free motion could close: a body between two others rests on both, not on one after the other.
//!    Their impulses act at the end of the step (Moreau 1988; Jean 1999),
//!    v⁺ = v̂ + M⁻¹(J_nΛ - J_tβ),   0 ≤ Λ ⟂ J_nᵀv⁺ + e min(J_nᵀv, 0) ≥ 0,   β ∈ μΛ ∂|J_tᵀv⁺|   (`contact/coulomb`).
//!    The rebound is that of the speed at which the step began: what v̂ has gained since then was gained below the
//!    surface.
//! 3. q̂ + h/2 M⁻¹(J_nΛ - J_tβ), the positions of the θ-method, are projected onto gap ≥ 0 in the metric of M
//!    (`project.rs`). Of Λ there are those of rough contacts that stay, which rest where friction holds them. All
//!    others are put on their surfaces by the projection alone.
//!    Islands without velocity before and after the step begin the projection where they are, at q + h/2 (v + v⁺)
//!    (`rest.rs`).
//! 4. Where the projection has lifted an island by more energy than its impacts have taken, its velocities pay for the
//!    difference; where they cannot, it stays where the step began (`energy.rs`). Energy is never gained by contacts
//!    that nothing drives.
//!
//! The order is one; bounces that accumulate end in a contact that stays closed.

mod bodies;
mod detect;
mod energy;
mod events;
mod free;
mod pairs;
mod project;
mod resolution;
mod rest;
mod rows;
mod scene;
mod search;
mod strike;

use std::ops::ControlFlow;

pub use events::{Change, Observer};
pub use scene::{Body, Family, Free, Scene};

use crate::event::Segment;
use crate::expansion::dense::ElementSeries;
use crate::hybrid::{Outcome, Side, Stats, Status};
use crate::runtime::limit::Limit;
use bodies::{Bodies, Motion, Step};
use detect::Detector;
use energy::Energy;
use events::Contacts;
use free::FreeStep;
use project::Projection;
use rest::Rest;
use strike::{Counts, Failed, Impacts};

/// What the user may choose.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Steps of equal length.
    pub steps: usize,
    /// When the run stops.
    pub limit: Limit,
}

/// What a run leaves besides its end.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The end; `complementarity` is the largest residual of the impulses, relative to the speeds of their island.
    pub outcome: Outcome,
    /// The contact at which a run has failed.
    pub stuck: Option<usize>,
    /// Impulses of contacts, counted in every step.
    pub impulses: usize,
    /// Steps in which impacts were taken without rebound, since restitutions contradict each other.
    pub plastic: usize,
    /// Gaps that were evaluated, and enclosures of gaps.
    pub gaps: usize,
}

/// Steps through a scene.
pub struct Stepper<F> {
    free: F,
    settings: Settings,
    step: FreeStep,
    motion: Motion,
    detector: Detector,
    contacts: Contacts,
    impacts: Impacts,
    rest: Rest,
    projection: Projection,
    energy: Energy,
}

impl<F: Free> Stepper<F> {
    /// Memory for the bodies and their contacts.
    pub fn new(scene: Scene, free: F, settings: Settings) -> Self {
        Stepper {
            step: FreeStep::new(&free),
            motion: Motion::new(Bodies::new(&scene, &free)),
            contacts: Contacts::new(scene.n_contacts),
            detector: Detector::new(scene, free.n_states(), free.coefficients()),
            impacts: Impacts::default(),
            rest: Rest::default(),
            projection: Projection::default(),
            energy: Energy::default(),
            free,
            settings,
        }
    }

    /// The motion without contacts, of which a run may have other numbers.
    pub fn free(&mut self) -> &mut F {
        &mut self.free
    }

    /// Begins a run at t; the end of its first stretch without a breakpoint.
    fn begin(&mut self, t: f64) -> f64 {
        self.impacts.counts = Counts::default();
        self.impacts.ladder.solvers.begin();
        self.projection.ladder.solvers.begin();
        self.motion.bodies.begin();
        self.projection.penetration = 0.0;
        self.contacts.begin();
        self.detector.begin();
        self.load(t)
    }

    /// Takes the coefficients from t on; until when they hold.
    fn load(&mut self, t: f64) -> f64 {
        let until = self.free.load(t);
        self.detector.load(self.free.coefficients());
        until
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut dyn Observer) -> Solution {
        let steps = self.settings.steps;
        let (mut x, mut y) = (x0.to_vec(), x0.to_vec());
        let mut sides = vec![Side::Plus; self.free.n_switches()];
        let mut series = ElementSeries::default();
        let (mut stats, mut t, mut ends) = (Stats::default(), t0, 0);
        let mut until = self.begin(t0);
        self.free.rates(t0, x0, &mut self.step.rates);
        let moved = (self.motion.bodies).moves_in(t1 - t0, &self.step.rates);
        let mut stuck = self.detector.penetrating(t0, x0, moved);
        let status = loop {
            if let Some(contact) = stuck {
                break Status::Penetrates { switch: contact };
            }
            if ends == steps {
                break Status::Solved;
            }
            if let Some(over) = self.settings.limit.over() {
                break Status::Over(over);
            }
            // A breakpoint in a step is the end of a part of it.
            let end = t0 + (t1 - t0) * ((ends + 1) as f64 / steps as f64);
            let near = f64::EPSILON * 4.0 * end.abs();
            let next = if until < end - near { until } else { end };
            let h = next - t;
            let step = Step { t, h, x: &x };
            if let Err(failed) = self.advance(step, &mut y) {
                stuck = failed.contact;
                break failed.status;
            }
            stats.steps += 1;
            if !y.iter().all(|y| y.is_finite()) {
                break Status::NotFinite;
            }
            self.contacts.tell(
                step,
                &self.motion,
                &self.impacts,
                &mut self.detector,
                observer,
            );
            self.free.sides(next, &y, &mut sides);
            series.shape(x.len(), sides.len(), 1);
            for (i, (x, y)) in x.iter().zip(&y).enumerate() {
                let row = series.row_mut(i);
                (row[0], row[1]) = (*x, (y - x) / h);
            }
            let segment = Segment::new(t, h, next, &sides, &y, &series);
            let flow = observer.segment(&segment);
            if next == end {
                ends += 1;
            }
            if until <= next + near {
                until = self.load(next.max(until));
            }
            t = next;
            std::mem::swap(&mut x, &mut y);
            if flow == ControlFlow::Break(()) {
                break Status::Stopped;
            }
        };
        self.solution(
            Outcome {
                stats,
                ..Outcome::at(status, t, x, sides)
            },
            stuck,
        )
    }

    /// What a run leaves that has ended so.
    fn solution(&self, mut outcome: Outcome, stuck: Option<usize>) -> Solution {
        let (counts, impacts) = (self.impacts.counts, &self.impacts.ladder.solvers);
        let shifts = &self.projection.ladder.solvers;
        outcome.complementarity = counts.residual;
        outcome.violation = self.projection.penetration;
        outcome.stats.events = self.contacts.n_changes();
        outcome.stats.newton_iterations = impacts.sweeps + shifts.sweeps;
        outcome.stats.factorizations = impacts.factorizations + shifts.factorizations;
        Solution {
            outcome,
            stuck,
            impulses: counts.impulses,
            plastic: counts.plastic,
            gaps: self.detector.n_evaluated(),
        }
    }

    /// One step to y.
    fn advance(&mut self, step: Step, y: &mut [f64]) -> Result<(), Failed> {
        let Step { t, h, x } = step;
        let Stepper {
            motion,
            detector,
            contacts,
            impacts,
            projection,
            energy,
            ..
        } = self;
        if !self.step.solve(&mut self.free, (t, h), x, y) {
            return Err(Failed::unsolved(None));
        }
        let FreeStep {
            jacobian,
            rates,
            middle,
            ..
        } = &self.step;
        let at = (t + 0.5 * h, &middle[..]);
        if !(motion.bodies).load(&mut self.free, at, jacobian, rates) {
            return Err(Failed {
                status: Status::NotFinite,
                contact: None,
            });
        }
        motion.load(x, y);
        impacts.find(step, y, motion, contacts, detector);
        energy.begin(&impacts.active, motion);
        if let Some(failed) = impacts.outside() {
            return Err(failed);
        }
        if !impacts.active.contacts.is_empty() {
            impacts.strike(contacts, motion)?;
            impacts.displace(h, motion, energy, y);
        }
        self.rest.leave(step, y, motion, impacts, detector, energy);
        loop {
            projection.begin(&impacts.active.contacts);
            let projected = projection.project(step, y, motion, contacts, detector, energy);
            projected.map_err(|contact| Failed::unsolved(Some(contact)))?;
            if !energy.leave(x, y, motion) {
                break;
            }
        }
        energy.pay(motion);
        motion.store(y);
        Ok(())
    }
}
