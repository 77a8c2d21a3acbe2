//! What changes from step to step.

use super::jump::Jumps;
use crate::events::approach::Approaches;
use crate::events::sensitivity::Window;
use crate::expansion::scales::{Bands, Scales, refill};
use crate::hybrid::point::Point;
use crate::hybrid::status::{Note, Stats};
use crate::selector::selection::Selection;

/// What a run says of itself besides its solution.
#[derive(Default)]
pub(crate) struct Report {
    pub stats: Stats,
    /// What the caller should know, up to a number of them.
    pub notes: Vec<Note>,
    /// Largest residual of complementarity problems so far.
    pub complementarity: f64,
}

impl Report {
    fn begin(&mut self) {
        self.stats = Stats::default();
        self.notes.clear();
        self.complementarity = 0.0;
    }

    /// Takes note of something the caller should know, once for the same switches.
    pub(crate) fn note(&mut self, note: Note) {
        const MAX_NOTES: usize = 8;
        if self.notes.len() < MAX_NOTES && self.notes.iter().all(|known| !known.is_like(&note)) {
            self.notes.push(note);
        }
    }
}

/// Where a step ends, or a point within it, before the step is accepted.
#[derive(Default)]
pub(crate) struct Trial {
    pub x: Vec<f64>,
    pub alpha: Vec<f64>,
}

/// The point of a run, with the sizes that tell motion from rounding, and what steps and events leave to those behind
/// them.
#[derive(Default)]
pub(crate) struct State {
    pub point: Point,
    pub scales: Scales,
    pub bands: Bands,
    pub trial: Trial,
    pub approaches: Approaches,
    pub window: Window,
    pub selection: Selection,
    pub jumps: Jumps,
    pub report: Report,
}

impl State {
    /// Starts a run, in the memory of the one before.
    pub(crate) fn begin(&mut self, t: f64, x: &[f64], n_switches: usize) {
        self.point.begin(t, x, n_switches);
        self.scales.begin(x);
        self.bands.begin(n_switches);
        self.trial.x.clone_from(&self.point.x);
        refill(&mut self.trial.alpha, n_switches, 0.0);
        self.approaches.begin();
        self.window.begin(x.len());
        self.selection.begin(n_switches);
        self.report.begin();
    }
}
