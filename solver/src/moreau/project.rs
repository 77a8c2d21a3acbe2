//! The projection of positions onto gap ≥ 0, the nearest ones in the metric of M.
//!
//! min ½ wᵀMw subject to gap(q + K w) ≥ 0, by successive linearization: w = D P, 0 ≤ P ⟂ gap + J w ≥ 0, until no gap
//! is negative. A contact that a displacement closes joins in with the next one.

use super::bodies::{Motion, Step};
use super::detect::{Detector, is_up_to};
use super::energy::Energy;
use super::events::Contacts;
use super::resolution::TOUCH;
use super::rows::{Contact, Linear};
use crate::contact::coulomb::islands::Islands;
use crate::contact::coulomb::ladder::{Ladder, Options};

/// A gap is not negative where it is above minus this share of the size of positions.
const DEPTH: f64 = 1e-12;
/// Contacts take part whose gaps are no larger than so many times the largest depth: those that others may close.
const REACH: f64 = 8.0;
/// Linearizations.
const MOST: usize = 40;
/// Residual of one of them, relative to the depths of an island, and attempts at it: the next one goes on. What is left
/// lifts jammed bodies by many times as much.
const SOLVED: f64 = 1e-9;
const ATTEMPTS: usize = 6;

/// Contacts that take part in a projection, and how far it moves bodies.
#[derive(Default)]
pub(super) struct Projection {
    near: Linear,
    /// The largest depth of a contact that this step has met.
    depth: f64,
    pub ladder: Ladder,
    islands: Islands,
    /// w
    lift: Vec<f64>,
    /// Largest depth of a contact after a projection.
    pub penetration: f64,
}

impl Projection {
    /// Begins the projection of a step, of which these are the active contacts.
    pub fn begin(&mut self, active: &[Contact]) {
        let gaps = active.iter().map(|contact| contact.gap);
        self.depth = -gaps.fold(0.0, f64::min);
    }

    /// Moves the positions of y so that no gap is negative. The contact at which this fails.
    pub fn project(
        &mut self,
        Step { t, h, .. }: Step,
        y: &mut [f64],
        motion: &Motion,
        contacts: &mut Contacts,
        detector: &mut Detector,
        energy: &mut Energy,
    ) -> Result<(), usize> {
        for round in 0..=MOST {
            detector.look(t + h, h, y, motion.moved);
            let reach = REACH * self.depth;
            detector.find(&motion.bodies, &mut self.near, |_, gap, resolution| {
                is_up_to(gap, reach + resolution.share(TOUCH))
            });
            let near = (self.near.contacts.iter()).filter(|contact| !contact.gap.is_nan());
            let Some(deepest) = near.min_by(|a, b| a.gap.total_cmp(&b.gap)) else {
                return Ok(());
            };
            let zero = deepest.resolution.share(DEPTH);
            if deepest.gap >= -zero || round == MOST {
                self.penetration = self.penetration.max(-deepest.gap);
                let is_deep = deepest.gap < -100.0 * zero;
                return match is_deep {
                    true => Err(deepest.contact as usize),
                    false => Ok(()),
                };
            }
            self.depth = self.depth.max(-deepest.gap);
            self.shift(round == 0, 0.1 * zero, h, motion, contacts);
            motion.bodies.displace(1.0, &self.lift, y);
            energy.lift(1.0 / h, &self.lift, &self.near, motion);
        }
        Ok(())
    }

    /// w = D P, 0 ≤ P ⟂ gap + J w ≥ 0. The first one of a step begins with P / h² of the step before.
    fn shift(
        &mut self,
        is_first: bool,
        rounding: f64,
        h: f64,
        motion: &Motion,
        contacts: &mut Contacts,
    ) {
        let options = Options {
            attempts: ATTEMPTS,
            tolerance: SOLVED,
            rounding,
        };
        let near = self.near.contacts.iter_mut();
        near.for_each(|contact| contact.rows.slips = 0);
        let (ladder, near) = (&mut self.ladder, &self.near);
        ladder.begin(&near.rows, near.of_contacts(), options);
        for (c, contact) in near.contacts.iter().enumerate() {
            ladder.laws.normal_rate[c] = contact.gap;
            if is_first && contact.gap < 0.0 {
                let last = contacts.last_shift(contact.contact as usize);
                ladder.impulses.normal[c] = last * h * h;
            }
        }
        self.lift.clear();
        self.lift.resize(motion.before.len(), 0.0);
        let mass = &motion.bodies.mass;
        self.islands.begin(mass);
        self.islands.join(&near.rows, near.of_contacts(), mass);
        // Linearized gaps may contradict each other where the gaps do not; the next round sees.
        let _ = ladder.solve(&near.rows, &mut self.islands, mass, &mut self.lift);
        if is_first {
            for (c, contact) in near.contacts.iter().enumerate() {
                let shift = ladder.impulses.normal[c] / (h * h);
                contacts.keep_shift(contact.contact as usize, shift);
            }
        }
    }
}
