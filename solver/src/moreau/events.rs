//! What contacts do from step to step: they strike, close, open, stick and slip.

use super::bodies::{Motion, Step};
use super::detect::Detector;
use super::rows::Contact;
use super::strike::Impacts;
use crate::contact::coulomb::law;
use crate::contact::coulomb::law::Pair;
use crate::event;

/// What a contact does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// It gives an impulse after it was open, at a speed above that which one step gains.
    Strike,
    /// It stays closed.
    Close,
    /// It is open again.
    Open,
    /// It is closed and does not slip.
    Stick,
    /// It is closed and slips.
    Slip,
}

/// Sees a run while it happens.
pub trait Observer: event::Observer {
    /// A contact changes; instants are those at which a straight line between the ends of the step meets the surface.
    fn change(&mut self, time: f64, contact: usize, change: Change);
}

/// What is known of a contact since the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Mode {
    #[default]
    Open,
    /// It has given an impulse and bounced.
    Struck,
    Closed,
    Stick,
    Slip,
}

impl Mode {
    fn is_closed(self) -> bool {
        matches!(self, Mode::Closed | Mode::Stick | Mode::Slip)
    }
}

/// The contacts that gave impulses in the last step.
pub(super) struct Contacts {
    modes: Vec<Mode>,
    /// Λ and β of the last step in which there were any, and P / h².
    impulses: Vec<(f64, Pair)>,
    shifts: Vec<f64>,
    /// Contacts that are not open, and those of the step before.
    present: Vec<u32>,
    before: Vec<u32>,
    changes: Vec<(f64, u32, Change)>,
    count: usize,
}

impl Contacts {
    pub fn new(n: usize) -> Self {
        Contacts {
            modes: vec![Mode::Open; n],
            impulses: vec![Default::default(); n],
            shifts: vec![0.0; n],
            present: Vec::new(),
            before: Vec::new(),
            changes: Vec::new(),
            count: 0,
        }
    }

    pub fn begin(&mut self) {
        self.modes.fill(Mode::Open);
        self.impulses.fill(Default::default());
        self.shifts.fill(0.0);
        self.present.clear();
        self.count = 0;
    }

    pub fn n_changes(&self) -> usize {
        self.count
    }

    /// Whether it gave an impulse in the last step.
    pub fn pushed(&self, contact: usize) -> bool {
        self.modes[contact] != Mode::Open
    }

    /// Λ and β of the step before; zero for a contact that was open.
    pub fn last(&self, contact: usize) -> (f64, Pair) {
        match self.modes[contact].is_closed() {
            true => self.impulses[contact],
            false => Default::default(),
        }
    }

    /// P / h² of the step before.
    pub fn last_shift(&self, contact: usize) -> f64 {
        match self.modes[contact].is_closed() {
            true => self.shifts[contact],
            false => 0.0,
        }
    }

    pub fn keep_shift(&mut self, contact: usize, shift: f64) {
        self.shifts[contact] = shift;
    }
}

const NONE: u32 = u32::MAX;

/// Friction that is nearer to its bound than this share of it slips.
const SLIPS: f64 = 1e-9;
/// A closed contact that gives no impulse opens where its rate is above this share of what a step changes.
const STAYS: f64 = 1e-6;

impl Contacts {
    /// Compares the contacts of a step with those of the step before.
    pub fn tell(
        &mut self,
        step: Step,
        motion: &Motion,
        impacts: &Impacts,
        detector: &mut Detector,
        observer: &mut dyn Observer,
    ) {
        let rows = &impacts.active.rows;
        std::mem::swap(&mut self.present, &mut self.before);
        self.present.clear();
        self.changes.clear();
        for (c, contact) in impacts.active.contacts.iter().enumerate() {
            let impulses = &impacts.ladder.impulses;
            let (normal, tangential) = (impulses.normal[c], impulses.tangential[c]);
            let at = contact.contact as usize;
            let rate = |v: &[f64]| rows.rate(contact.rows.normal, v) + contact.offset;
            let approach = -rate(&motion.before);
            // What the free motion changes the rate by in a step.
            let change = (rate(&motion.free) + approach).abs();
            let stays = || rate(&motion.after) <= STAYS * (change + approach.abs());
            if normal <= 0.0 && !(self.modes[at].is_closed() && stays()) {
                continue;
            }
            self.present.push(contact.contact);
            self.impulses[at] = (normal, tangential);
            let bounces = impacts.ladder.laws.normal_rate[c] < contact.offset;
            let rubs = || law::length(tangential);
            let mode = match (bounces, contact.rows.is_rough()) {
                (true, _) => Mode::Struck,
                (false, false) => Mode::Closed,
                (false, true) if rubs() < (1.0 - SLIPS) * contact.friction * normal => Mode::Stick,
                (false, true) => Mode::Slip,
            };
            let before = std::mem::replace(&mut self.modes[at], mode);
            let mut tell = |change| self.changes.push((f64::NAN, contact.contact, change));
            if before == Mode::Open && approach > change {
                tell(Change::Strike);
            }
            match (before.is_closed(), mode.is_closed()) {
                (false, true) => tell(Change::Close),
                (true, false) => tell(Change::Open),
                _ => {}
            }
            match mode {
                Mode::Stick if before != Mode::Stick => tell(Change::Stick),
                Mode::Slip if before != Mode::Slip => tell(Change::Slip),
                _ => {}
            }
        }
        self.present.sort_unstable();
        for &contact in &self.before {
            if self.present.binary_search(&contact).is_ok() {
                continue;
            }
            let before = std::mem::take(&mut self.modes[contact as usize]);
            if before.is_closed() {
                self.changes.push((step.t, contact, Change::Open));
            }
        }
        if self.changes.is_empty() {
            return;
        }
        self.date(step, &impacts.active.contacts, detector);
        self.changes
            .sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.count += self.changes.len();
        for &(time, contact, change) in &self.changes {
            observer.change(time, contact as usize, change);
        }
    }

    /// Says when in the step contacts were struck: where a straight line between the gaps at its ends is zero.
    fn date(&mut self, Step { t, h, x }: Step, active: &[Contact], detector: &mut Detector) {
        detector.go_to(t, x);
        let mut struck = (NONE, t);
        for (time, contact, change) in &mut self.changes {
            if !time.is_nan() {
                continue;
            }
            // It sticks or slips from where it has closed.
            if struck.0 == *contact && matches!(change, Change::Stick | Change::Slip) {
                *time = struck.1;
                continue;
            }
            let mut active = active.iter();
            let end = active.find(|other| other.contact == *contact);
            let end = end.map_or(0.0, |contact| contact.gap);
            let is_new = matches!(change, Change::Strike | Change::Close);
            let start = match is_new {
                true => detector.gap_of(*contact),
                false => 0.0,
            };
            let share = match start > 0.0 && end < start {
                true => (start / (start - end)).min(1.0),
                false => 0.0,
            };
            *time = t + share * h;
            if is_new {
                struck = (*contact, *time);
            }
        }
    }
}
