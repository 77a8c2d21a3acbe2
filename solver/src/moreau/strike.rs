//! Impulses of the contacts of a step, and how far they move bodies.

use super::scene::Free;
use super::{Failed, SOLVED, Stepper, TOUCH, Velocities};
use crate::contact::coulomb::ladder::{Ladder, Options};
use crate::hybrid::{Coefficient, Status};

/// A speed below this share of the largest is rounding.
const ROUNDING: f64 = 1e-15;
/// A contact stays where its rate before a step is below this share of what the free motion changes it by.
const STAYS: f64 = 1e-3;
/// Attempts to solve for the impulses of an island.
const ATTEMPTS: usize = 12;

/// How contacts strike.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Impact {
    /// With their restitutions.
    AsStated,
    /// Without rebound.
    Plastic,
}

impl<F: Free> Stepper<F> {
    /// An active contact with a coefficient that no contact has.
    pub(super) fn outside(&self) -> Option<Failed> {
        self.active.contacts.iter().find_map(|contact| {
            let found = Coefficient::outside(contact.restitution, contact.friction);
            let switch = contact.contact as usize;
            found.map(|(coefficient, value)| Failed {
                status: Status::Coefficient {
                    switch,
                    coefficient,
                    value,
                },
                contact: Some(switch),
            })
        })
    }

    /// Lets the active contacts give impulses, those that the free motion to y has closed if all of them are too many.
    pub(super) fn strike(&mut self, y: &[f64], velocities: &mut Velocities) -> Result<(), usize> {
        let mut solved = self.strike_all(velocities);
        let touch = TOUCH * self.size(y);
        if solved.is_err() && self.active.contacts.iter().any(|c| c.gap > touch) {
            self.active.contacts.retain(|contact| contact.gap <= touch);
            solved = self.strike_all(velocities);
        }
        self.counts.plastic += usize::from(solved == Ok(Impact::Plastic));
        self.counts.impulses += self.active.contacts.len();
        self.counts.residual = self.counts.residual.max(self.impulses.residual);
        match solved {
            Ok(_) => Ok(()),
            Err(c) => Err(self.active.contacts[c].contact as usize),
        }
    }

    /// Lets the active contacts give impulses.
    fn strike_all(&mut self, velocities: &mut Velocities) -> Result<Impact, usize> {
        let (active, mass) = (&self.active, &self.bodies.mass);
        self.islands.begin(mass);
        self.islands.join(&active.rows, active.of_contacts(), mass);
        let mut solved = Ok(Impact::AsStated);
        // Restitutions of contacts that depend on each other may contradict each other.
        for impact in [Impact::AsStated, Impact::Plastic] {
            let bounced = self.set_impulses(velocities, impact == Impact::AsStated);
            velocities.after.clone_from(&velocities.free);
            let found = self.impulses.solve(
                &self.active.rows,
                &mut self.islands,
                &self.bodies.mass,
                &mut velocities.after,
            );
            solved = found.map(|()| impact);
            if solved.is_ok() || !bounced {
                break;
            }
        }
        solved
    }

    /// States the laws of the active contacts, and starts from the impulses of the step before. Whether any rebounds.
    fn set_impulses(&mut self, velocities: &Velocities, rebounds: bool) -> bool {
        let (active, impulses) = (&self.active, &mut self.impulses);
        let speeds = velocities.free.iter();
        let options = Options {
            attempts: ATTEMPTS,
            tolerance: SOLVED,
            rounding: ROUNDING * speeds.fold(0.0_f64, |most, v| most.max(v.abs())),
        };
        impulses.begin(&active.rows, active.of_contacts(), options);
        let Ladder { laws, impulses, .. } = impulses;
        let mut any = false;
        for (c, contact) in active.contacts.iter().enumerate() {
            let before = active.rows.rate(contact.rows.normal, &velocities.before) + contact.offset;
            let rebound = contact.restitution * before;
            laws.normal_rate[c] = contact.offset;
            // A rebound that cannot outlast a step is none, whatever presses: what moves the bodies may reach the
            // contact through others.
            let change = self
                .energy
                .gain(&self.bodies, &active.rows, contact.rows.normal);
            if rebounds && rebound.abs() > 0.5 * change {
                laws.normal_rate[c] += rebound;
                any = true;
            }
            laws.friction[c] = contact.friction;
            laws.slip_rate[c] = contact.slip;
            let known = self.contacts.last(contact.contact as usize);
            (impulses.normal[c], impulses.tangential[c]) = known;
        }
        any
    }

    /// q̂ + h/2 M⁻¹(J_nΛ - J_tβ), of Λ those of rough contacts that stay.
    pub(super) fn let_impulses_move(&mut self, h: f64, velocities: &Velocities, y: &mut [f64]) {
        let (rows, impulses) = (&self.active.rows, &self.impulses.impulses);
        self.shift.clear();
        self.shift.resize(velocities.before.len(), 0.0);
        for (c, contact) in self.active.contacts.iter().enumerate() {
            let rate = |v: &[f64]| rows.rate(contact.rows.normal, v) + contact.offset;
            let before = rate(&velocities.before);
            let change = (rate(&velocities.free) - before).abs();
            if contact.rows.is_rough() && before.abs() <= STAYS * change {
                rows.add_impulse(contact.rows.normal, impulses.normal[c], &mut self.shift);
            }
            rows.add_friction(&contact.rows, impulses.tangential[c], &mut self.shift);
        }
        self.bodies.displace(0.5 * h, &self.shift, y);
        self.energy
            .lift((0.5 * h, h), &self.shift, &self.active, &self.bodies);
    }
}
