//! The projection of positions onto gap ≥ 0, the nearest ones in the metric of M.
//!
//! min ½ wᵀMw subject to gap(q + K w) ≥ 0, by successive linearization: w = D P, 0 ≤ P ⟂ gap + J w ≥ 0, until no gap
//! is negative. A contact that a displacement closes joins in with the next one.

use super::rows::Linear;
use super::scene::Free;
use super::{Stepper, TOUCH, Velocities};
use crate::contact::coulomb::ladder::Options;

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

impl<F: Free> Stepper<F> {
    /// Moves the positions of y so that no gap is negative.
    pub(super) fn project(
        &mut self,
        (t, h): (f64, f64),
        velocities: &Velocities,
        y: &mut [f64],
    ) -> Result<(), usize> {
        let size = self.size(y);
        self.lift.clear();
        self.lift.resize(velocities.before.len(), 0.0);
        let gaps = self.active.contacts.iter().map(|contact| contact.gap);
        let mut depth = -gaps.fold(0.0, f64::min);
        for round in 0..=MOST {
            self.look(t + h, h, y, self.moved);
            let mut least = f64::INFINITY;
            self.projected.clear();
            for family in 0..self.scene.families.len() {
                least = least.min(self.closer_than(family, REACH * depth + TOUCH * size));
                let lanes = &mut self.lanes[family][1];
                let of_family = &self.scene.families[family];
                self.projected
                    .add(of_family, &self.members, &self.memory, &self.bodies, lanes);
            }
            if least >= -DEPTH * size || self.projected.contacts.is_empty() || round == MOST {
                self.counts.penetration = self.counts.penetration.max(-least);
                let deep = || {
                    self.projected
                        .contacts
                        .iter()
                        .min_by(|a, b| a.gap.total_cmp(&b.gap))
                };
                return match deep().filter(|_| least < -100.0 * DEPTH * size) {
                    Some(contact) => Err(contact.contact as usize),
                    None => Ok(()),
                };
            }
            depth = depth.max(-least);
            let shifts = &mut self.shifts;
            let options = Options {
                attempts: ATTEMPTS,
                tolerance: SOLVED,
                rounding: 0.1 * DEPTH * size,
            };
            let contacts = self.projected.contacts.iter_mut();
            contacts.for_each(|contact| contact.rows.slips = 0);
            let Linear { rows, contacts, .. } = &self.projected;
            shifts.begin(rows, self.projected.of_contacts(), options);
            for (c, contact) in contacts.iter().enumerate() {
                shifts.laws.normal_rate[c] = contact.gap;
                if round == 0 && contact.gap < 0.0 {
                    let last = self.contacts.last_shift(contact.contact as usize);
                    shifts.impulses.normal[c] = last * h * h;
                }
            }
            self.lift.fill(0.0);
            let mass = &self.bodies.mass;
            self.islands.begin(mass);
            self.islands.join(rows, self.projected.of_contacts(), mass);
            // Linearized gaps may contradict each other where the gaps do not; the next round sees.
            let _ = shifts.solve(rows, &mut self.islands, mass, &mut self.lift);
            if round == 0 {
                for (c, contact) in self.projected.contacts.iter().enumerate() {
                    let shift = shifts.impulses.normal[c] / (h * h);
                    self.contacts.keep_shift(contact.contact as usize, shift);
                }
            }
            self.bodies.displace(1.0, &self.lift, y);
            self.energy
                .lift((1.0, h), &self.lift, &self.projected, &self.bodies);
        }
        Ok(())
    }
}
