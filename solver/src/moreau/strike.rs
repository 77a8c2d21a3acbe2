//! Impulses of the contacts of a step, and how far they move bodies.

use super::bodies::{Motion, Step};
use super::detect::{Detector, is_up_to};
use super::energy::Energy;
use super::events::Contacts;
use super::resolution::TOUCH;
use super::rows::{Contact, Linear};
use crate::contact::coulomb::islands::Islands;
use crate::contact::coulomb::ladder::{Ladder, Options};
use crate::hybrid::{Coefficient, Status};

/// Residual of the impulses of an island, relative to its speeds.
pub(super) const SOLVED: f64 = 1e-11;
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

/// Active contacts and their impulses.
#[derive(Default)]
pub(super) struct Impacts {
    pub active: Linear,
    pub ladder: Ladder,
    islands: Islands,
    shift: Vec<f64>,
    pub counts: Counts,
}

/// Counts of a run.
#[derive(Clone, Copy, Default)]
pub(super) struct Counts {
    /// Impulses of contacts, counted in every step.
    pub impulses: usize,
    /// Steps in which impacts were taken without rebound.
    pub plastic: usize,
    /// The largest residual.
    pub residual: f64,
}

/// Why a step could not be made.
pub(super) struct Failed {
    pub status: Status,
    pub contact: Option<usize>,
}

impl Failed {
    pub fn unsolved(contact: Option<usize>) -> Self {
        Failed {
            status: Status::Unsolved,
            contact,
        }
    }
}

impl Impacts {
    /// Finds the contacts that the free motion to y has closed, or that have not opened, with their rows.
    pub fn find(
        &mut self,
        Step { t, h, .. }: Step,
        y: &[f64],
        motion: &Motion,
        contacts: &Contacts,
        detector: &mut Detector,
    ) {
        detector.look(t + h, h, y, motion.moved);
        detector.find(
            &motion.bodies,
            &mut self.active,
            |contact, gap, resolution| {
                is_up_to(gap, resolution.share(TOUCH)) || contacts.pushed(contact as usize)
            },
        );
        let rows = &self.active.rows;
        self.active.contacts.retain(|contact| {
            let start =
                contact.gap - h * (rows.rate(contact.rows.normal, &motion.free) + contact.offset);
            !(contact.is_open() && start > h * motion.gain(rows, contact.rows.normal))
        });
    }

    /// An active contact with a coefficient that no contact has.
    pub fn outside(&self) -> Option<Failed> {
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

    /// Lets the active contacts give impulses, those that the free motion has closed if all of them are too many.
    pub fn strike(&mut self, last: &Contacts, motion: &mut Motion) -> Result<(), Failed> {
        let mut solved = self.strike_all(last, motion);
        let contacts = &mut self.active.contacts;
        if solved.is_err() && contacts.iter().any(Contact::is_open) {
            contacts.retain(|contact| !contact.is_open());
            solved = self.strike_all(last, motion);
        }
        self.counts.plastic += usize::from(solved == Ok(Impact::Plastic));
        self.counts.impulses += self.active.contacts.len();
        self.counts.residual = self.counts.residual.max(self.ladder.residual);
        match solved {
            Ok(_) => Ok(()),
            Err(c) => Err(Failed::unsolved(Some(
                self.active.contacts[c].contact as usize,
            ))),
        }
    }

    /// Lets the active contacts give impulses.
    fn strike_all(&mut self, last: &Contacts, motion: &mut Motion) -> Result<Impact, usize> {
        let mass = &motion.bodies.mass;
        self.islands.begin(mass);
        self.islands
            .join(&self.active.rows, self.active.of_contacts(), mass);
        let mut solved = Ok(Impact::AsStated);
        // Restitutions of contacts that depend on each other may contradict each other.
        for impact in [Impact::AsStated, Impact::Plastic] {
            let bounced = self.set_impulses(impact, last, motion);
            motion.after.clone_from(&motion.free);
            let found = self.ladder.solve(
                &self.active.rows,
                &mut self.islands,
                &motion.bodies.mass,
                &mut motion.after,
            );
            solved = found.map(|()| impact);
            if solved.is_ok() || !bounced {
                break;
            }
        }
        solved
    }

    /// States the laws of the active contacts, and starts from the impulses of the step before. Whether any rebounds.
    fn set_impulses(&mut self, impact: Impact, last: &Contacts, motion: &Motion) -> bool {
        let active = &self.active;
        let speeds = motion.free.iter();
        let options = Options {
            attempts: ATTEMPTS,
            tolerance: SOLVED,
            rounding: ROUNDING * speeds.fold(0.0_f64, |most, v| most.max(v.abs())),
        };
        self.ladder
            .begin(&active.rows, active.of_contacts(), options);
        let Ladder { laws, impulses, .. } = &mut self.ladder;
        let mut any = false;
        for (c, contact) in active.contacts.iter().enumerate() {
            let normal = contact.rows.normal;
            let before = active.rows.rate(normal, &motion.before) + contact.offset;
            let rebound = contact.restitution * before;
            laws.normal_rate[c] = contact.offset;
            // A rebound that cannot outlast a step is none, whatever presses: what moves the bodies may reach the
            // contact through others.
            let change = motion.gain(&active.rows, normal);
            if impact == Impact::AsStated && rebound.abs() > 0.5 * change {
                laws.normal_rate[c] += rebound;
                any = true;
            }
            laws.friction[c] = contact.friction;
            laws.slip_rate[c] = contact.slip;
            (impulses.normal[c], impulses.tangential[c]) = last.last(contact.contact as usize);
        }
        any
    }

    /// q̂ + h/2 M⁻¹(J_nΛ - J_tβ), of Λ those of rough contacts that stay.
    pub fn displace(&mut self, h: f64, motion: &Motion, energy: &mut Energy, y: &mut [f64]) {
        let (rows, impulses) = (&self.active.rows, &self.ladder.impulses);
        self.shift.clear();
        self.shift.resize(motion.before.len(), 0.0);
        for (c, contact) in self.active.contacts.iter().enumerate() {
            let rate = |v: &[f64]| rows.rate(contact.rows.normal, v) + contact.offset;
            let before = rate(&motion.before);
            let change = (rate(&motion.free) - before).abs();
            if contact.rows.is_rough() && before.abs() <= STAYS * change {
                rows.add_impulse(contact.rows.normal, impulses.normal[c], &mut self.shift);
            }
            rows.add_friction(&contact.rows, impulses.tangential[c], &mut self.shift);
        }
        motion.bodies.displace(0.5 * h, &self.shift, y);
        energy.lift(0.5, &self.shift, &self.active, motion);
    }
}
