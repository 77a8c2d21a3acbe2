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

mod energy;
mod events;
mod free;
mod pairs;
mod project;
mod rest;
mod rows;
mod scene;
mod search;
mod strike;

use std::ops::ControlFlow;

pub use events::{Change, Observer};
pub use scene::{Body, Family, Free, Scene};

use crate::contact::coulomb::islands::Islands;
use crate::contact::coulomb::ladder::Ladder;
use crate::event::Segment;
use crate::expansion::dense::ElementSeries;
use crate::hybrid::{Outcome, Side, Stats, Status};
use crate::runtime::limit::Limit;
use crate::tape::LaneScratch;
use energy::Energy;
use events::Contacts;
use free::FreeStep;
use rows::{Bodies, Linear};
use search::Search;

/// A gap below this share of the size of positions is closed.
const TOUCH: f64 = 1e-10;
/// Residual of the impulses of an island, relative to its speeds.
const SOLVED: f64 = 1e-11;

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
    /// Largest depth of a contact at the end of a step.
    pub penetration: f64,
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
    scene: Scene,
    free: F,
    settings: Settings,
    bodies: Bodies,
    step: FreeStep,
    search: Search,
    contacts: Contacts,
    active: Linear,
    impulses: Ladder,
    projected: Linear,
    shifts: Ladder,
    islands: Islands,
    energy: Energy,
    /// t, x, coefficients, numbers.
    memory: Vec<f64>,
    lanes: Vec<[LaneScratch; 2]>,
    gaps: Vec<f64>,
    inputs: Vec<f64>,
    members: Vec<u32>,
    counts: Counts,
    /// How far positions move in the present step.
    moved: f64,
    shift: Vec<f64>,
    /// By the first body of an island: whether it moves.
    moves: Vec<bool>,
    /// Displacements of a projection.
    lift: Vec<f64>,
}

/// Counts of a run.
#[derive(Clone, Copy, Default)]
struct Counts {
    gaps: usize,
    impulses: usize,
    penetration: f64,
    residual: f64,
    plastic: usize,
}

/// Velocities of bodies: before a step, without contacts, and after it.
#[derive(Default)]
struct Velocities {
    before: Vec<f64>,
    free: Vec<f64>,
    after: Vec<f64>,
}

/// Why a step could not be made.
struct Failed {
    status: Status,
    contact: Option<usize>,
}

impl<F: Free> Stepper<F> {
    /// Memory for the bodies and their contacts.
    pub fn new(scene: Scene, free: F, settings: Settings) -> Self {
        let n = free.n_states();
        let mut memory = vec![0.0; 1 + n + free.coefficients().len()];
        memory.extend_from_slice(&scene.numbers);
        Stepper {
            bodies: Bodies::new(&scene, &free),
            step: FreeStep::new(&free),
            search: Search::new(&scene, n),
            contacts: Contacts::new(scene.n_contacts),
            active: Linear::default(),
            impulses: Ladder::default(),
            projected: Linear::default(),
            shifts: Ladder::default(),
            islands: Islands::default(),
            energy: Energy::default(),
            memory,
            lanes: (scene.families.iter())
                .map(|family| [family.gap.lane_scratch(), family.row.lane_scratch()])
                .collect(),
            gaps: Vec::new(),
            inputs: Vec::new(),
            members: Vec::new(),
            counts: Counts::default(),
            moved: 0.0,
            shift: Vec::new(),
            moves: Vec::new(),
            lift: Vec::new(),
            scene,
            free,
            settings,
        }
    }

    /// Integrates from `x0` at `t0` to `t1`.
    pub fn run(&mut self, t0: f64, t1: f64, x0: &[f64], observer: &mut impl Observer) -> Solution {
        let steps = self.settings.steps;
        let (mut x, mut y) = (x0.to_vec(), x0.to_vec());
        let mut sides = vec![Side::Plus; self.free.n_switches()];
        let mut series = ElementSeries::default();
        let mut velocities = Velocities::default();
        let (mut stats, mut t, mut ends) = (Stats::default(), t0, 0);
        let mut until = self.free.load(t0);
        self.counts = Counts::default();
        self.contacts.begin();
        self.search.reset();
        let mut stuck = self.penetrates(t0, &x);
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
            if let Err(failed) = self.advance((t, h), &x, &mut y, &mut velocities) {
                stuck = failed.contact;
                break failed.status;
            }
            stats.steps += 1;
            if !y.iter().all(|y| y.is_finite()) {
                break Status::NotFinite;
            }
            self.tell((t, h), &x, &velocities, observer);
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
                until = self.free.load(next.max(until));
            }
            t = next;
            std::mem::swap(&mut x, &mut y);
            if flow == ControlFlow::Break(()) {
                break Status::Stopped;
            }
        };
        stats.events = self.contacts.n_changes();
        stats.newton_iterations = self.impulses.solvers.sweeps + self.shifts.solvers.sweeps;
        stats.factorizations =
            self.impulses.solvers.factorizations + self.shifts.solvers.factorizations;
        Solution {
            outcome: Outcome {
                complementarity: self.counts.residual,
                stats,
                ..Outcome::at(status, t, x, sides)
            },
            penetration: self.counts.penetration,
            stuck,
            impulses: self.counts.impulses,
            plastic: self.counts.plastic,
            gaps: self.counts.gaps + self.search.enclosures,
        }
    }

    /// One step from x to y.
    fn advance(
        &mut self,
        (t, h): (f64, f64),
        x: &[f64],
        y: &mut [f64],
        velocities: &mut Velocities,
    ) -> Result<(), Failed> {
        let unsolved = |contact| Failed {
            status: Status::Unsolved,
            contact,
        };
        if !self.step.solve(&mut self.free, (t, h), x, y) {
            return Err(unsolved(None));
        }
        let FreeStep {
            jacobian,
            rates,
            middle,
            ..
        } = &self.step;
        let at = (t + 0.5 * h, &middle[..]);
        if !self.bodies.load(&mut self.free, at, jacobian, rates) {
            return Err(Failed {
                status: Status::NotFinite,
                contact: None,
            });
        }
        let of_bodies = |x: &[f64], v: &mut Vec<f64>, bodies: &Bodies| {
            v.clear();
            v.extend(bodies.velocities.iter().map(|&state| x[state]));
        };
        of_bodies(x, &mut velocities.before, &self.bodies);
        of_bodies(y, &mut velocities.free, &self.bodies);
        velocities.after.clone_from(&velocities.free);

        self.energy.observe(velocities);
        self.find_active((t, h), x, y, velocities);
        self.energy.begin(&self.bodies, &self.active);
        if let Some(failed) = self.outside() {
            return Err(failed);
        }
        if !self.active.contacts.is_empty() {
            self.strike(y, velocities).map_err(|c| unsolved(Some(c)))?;
            self.let_impulses_move(h, velocities, y);
        }
        self.rest((t, h), x, y, velocities);
        loop {
            self.project((t, h), velocities, y)
                .map_err(|c| unsolved(Some(c)))?;
            if !self.leave(x, y, velocities) {
                break;
            }
        }
        self.pay(velocities);
        for (&state, v) in self.bodies.velocities.iter().zip(&velocities.after) {
            y[state] = *v;
        }
        Ok(())
    }

    /// Sets what functions of contacts depend on, and finds the contacts that may be active there.
    fn look(&mut self, t: f64, h: f64, x: &[f64], moved: f64) {
        self.set_memory(t, x);
        let size = self.size(x);
        self.search
            .update(&self.scene, &self.memory, h, moved, size);
    }

    /// Sets what functions of contacts depend on.
    fn set_memory(&mut self, t: f64, x: &[f64]) {
        let n = x.len();
        self.memory[0] = t;
        self.memory[1..=n].copy_from_slice(x);
        let coefficients = self.free.coefficients();
        self.memory[1 + n..][..coefficients.len()].copy_from_slice(coefficients);
    }

    /// The members of a family with gaps up to `most`, in `members`; the least gap.
    fn closer_than(&mut self, family: usize, most: f64) -> f64 {
        let of_family = &self.scene.families[family];
        let near = self.search.near(family);
        self.members.clear();
        if near.is_empty() {
            return f64::INFINITY;
        }
        rows::gather(of_family, near, &self.memory, &mut self.inputs);
        self.gaps.clear();
        self.gaps.resize(near.len(), 0.0);
        let lanes = &mut self.lanes[family][0];
        of_family
            .gap
            .eval_many(&self.inputs, &mut self.gaps, near.len(), lanes);
        self.counts.gaps += near.len();
        let close = near.iter().zip(&self.gaps);
        // A gap that is no number is none that is known to be open.
        let close = close.filter(|(_, gap)| gap.is_nan() || **gap <= most);
        self.members.extend(close.map(|(&member, _)| member));
        self.gaps.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The size of positions, of which a gap is a share.
    fn size(&self, x: &[f64]) -> f64 {
        let positions = self.scene.bodies.iter().flat_map(|body| &body.positions);
        positions.fold(f64::MIN_POSITIVE, |size, &q| size.max(x[q].abs()))
    }

    /// Finds the contacts that the free motion from x to y has closed, or that have not opened, with their rows.
    fn find_active(&mut self, (t, h): (f64, f64), x: &[f64], y: &[f64], velocities: &Velocities) {
        let touch = TOUCH * self.size(y);
        let positions = self.scene.bodies.iter().flat_map(|body| &body.positions);
        self.moved = positions.fold(0.0, |most, &q| most.max((y[q] - x[q]).abs()));
        self.look(t + h, h, y, self.moved);
        self.active.clear();
        for family in 0..self.scene.families.len() {
            self.closer_than(family, touch);
            let of_family = &self.scene.families[family];
            let near = self.search.near(family).iter().zip(&self.gaps);
            let pushed = near.filter(|&(&member, &gap)| {
                let contact = of_family.contacts[member as usize];
                gap > touch && self.contacts.pushed(contact as usize)
            });
            self.members.extend(pushed.map(|(&member, _)| member));
            self.members.sort_unstable();
            let lanes = &mut self.lanes[family][1];
            self.active
                .add(of_family, &self.members, &self.memory, &self.bodies, lanes);
        }
        let (rows, energy, bodies) = (&self.active.rows, &self.energy, &self.bodies);
        self.active.contacts.retain(|contact| {
            let start = contact.gap
                - h * (rows.rate(contact.rows.normal, &velocities.free) + contact.offset);
            !(contact.gap > touch && start > h * energy.gain(bodies, rows, contact.rows.normal))
        });
    }

    /// A contact that is closed by more than rounding at the start.
    fn penetrates(&mut self, t: f64, x: &[f64]) -> Option<usize> {
        let least = -1e-9 * self.size(x);
        self.look(t, 0.0, x, 0.0);
        for family in 0..self.scene.families.len() {
            self.closer_than(family, least);
            if let Some(&member) = self.members.first() {
                let contact = self.scene.families[family].contacts[member as usize];
                return Some(contact as usize);
            }
        }
        None
    }
}
