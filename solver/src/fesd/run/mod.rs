//! What changes in the course of a run by finite elements.

pub(crate) mod place;

use super::system::{ComplementaritySystem, measure};
use crate::events::chattering::Chatter;
use crate::events::zeno::Events;
use crate::fesd::selection::slip::Slips;
use crate::fesd::watch::Start;
use crate::hybrid::{Note, Stats, Status};
use crate::runtime::pace::Pace;
use crate::selector::Decision;
use place::Place;

/// Breakpoints and ends of steps this close, relative to time, are one instant.
pub(crate) const NEAR: f64 = 16.0 * f64::EPSILON;

/// How the active set after a switch was found; each is tried where those before it fail.
#[derive(Clone, Copy, Default, Debug, PartialEq, Eq)]
pub struct Rungs {
    /// By the first derivatives of the members.
    pub predicted: usize,
    /// By trial elements, where a rate vanishes.
    pub tried: usize,
    /// By a smoothed complementarity problem, where too many pairs meet to try all sets.
    pub smoothed: usize,
    /// By the complementarity problem of a whole element, where all of these find none.
    pub whole: usize,
}

/// How a mode is entered.
#[derive(Default)]
pub(crate) struct Entry {
    /// How its watched members start in the next element.
    pub starts: Vec<Start>,
    /// Values of the watched members that count as zero, over [`super::watch::BAND`].
    pub sizes: Vec<f64>,
    /// What rates of members are zero next to.
    pub rate_scale: f64,
    /// x'.
    pub rates: Vec<f64>,
}

/// Lengths of elements; zero where there is none.
#[derive(Default)]
pub(crate) struct Lengths {
    /// Of the last element in this mode.
    pub last: f64,
    /// Of the next element by the tolerance.
    pub next: f64,
    /// The same where α is the independent variable.
    pub next_branch: f64,
}

/// What is told of a run at its end.
#[derive(Default)]
pub(crate) struct Record {
    pub stats: Stats,
    /// Elements added to steps with more switches than elements.
    pub added: usize,
    pub rungs: Rungs,
    pub least_member: f64,
    pub defect: f64,
    /// ∫ of the sizes of the terms of each rate.
    pub work: Vec<f64>,
    pub notes: Vec<Note>,
}

/// How one event came after the other.
#[derive(Default)]
pub(crate) struct History {
    /// Events in a row that took no time.
    pub stalled: usize,
    pub events: Events,
    pub chatter: Chatter,
    pub pace: Pace,
    /// f before the last event, and squares of what uncertain events may have moved the states by.
    pub before: Vec<f64>,
    pub moved: Vec<f64>,
}

/// A run on its way.
pub(crate) struct Run {
    /// When it ends.
    pub t1: f64,
    /// The next breakpoint; infinity where there is none.
    pub until: f64,
    pub place: Place,
    pub entry: Entry,
    pub lengths: Lengths,
    pub record: Record,
    /// Largest magnitude of each state so far, see [`measure`].
    pub scale: Vec<f64>,
    pub history: History,
    pub slips: Slips,
    /// What has decided about nonlinear switches where the run is.
    pub decisions: Vec<Decision>,
    /// The switch whose sliding mode has ended in a fold where the run is.
    pub fold: Option<usize>,
}

impl Run {
    /// A run from x₀ at t₀ to t₁.
    pub fn new(system: &ComplementaritySystem, t0: f64, t1: f64, x0: &[f64]) -> Self {
        let n = x0.len();
        let mut scale = vec![0.0; n];
        measure(&mut scale, x0, system);
        Run {
            t1,
            until: f64::INFINITY,
            place: Place {
                t: t0,
                t_low: 0.0,
                x: x0.to_vec(),
                low: vec![0.0; n],
                z: vec![0.0; system.n_algebraics()],
                zeros: Vec::new(),
                mode: 0,
            },
            entry: Entry {
                rates: vec![0.0; n],
                ..Entry::default()
            },
            lengths: Lengths::default(),
            record: Record {
                work: vec![0.0; n],
                ..Record::default()
            },
            scale,
            history: History {
                before: vec![0.0; n],
                moved: vec![0.0; n],
                ..History::default()
            },
            slips: Slips::default(),
            decisions: Vec::new(),
            fold: None,
        }
    }

    /// Whether data goes on with other pieces at the present time.
    pub fn is_at_breakpoint(&self) -> bool {
        self.until <= self.place.t + NEAR * self.place.t.abs()
    }

    /// Adds what the rates behind an event that is uncertain for a time have to do with those before.
    pub fn note_uncertain(&mut self, length: f64) {
        let History { before, moved, .. } = &mut self.history;
        for (moved, (after, before)) in moved.iter_mut().zip(self.entry.rates.iter().zip(before)) {
            *moved += (length * (after - *before)).powi(2);
        }
    }

    /// Counts an element of this length, at whose end the run is.
    pub fn count_step(
        &mut self,
        system: &ComplementaritySystem,
        activity: &[f64],
        length: f64,
    ) -> Result<(), Status> {
        measure(&mut self.scale, &self.place.x, system);
        for (work, activity) in self.record.work.iter_mut().zip(activity) {
            *work += activity * length;
        }
        self.record.stats.steps += 1;
        let is_finite = self.place.x.iter().all(|x| x.is_finite());
        is_finite.then_some(()).ok_or(Status::NotFinite)
    }
}
