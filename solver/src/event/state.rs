//! What changes from step to step.

use crate::events::approach::Approaches;
use crate::events::sensitivity::Window;
use crate::expansion::scales::{Bands, Scales, refill};
use crate::hybrid::point::Point;
use crate::hybrid::status::{Note, Stats};
use crate::hybrid::{HybridSystem, Side};
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

/// What is known of an instant besides the state.
#[derive(Default)]
pub(crate) struct Known {
    /// Laws that are to jump at it, whatever the state is.
    pub due: Vec<usize>,
    /// The law that ends the run.
    pub stopped: Option<usize>,
    /// Switches of laws whose ψ is zero, and those of them where it stays so.
    pub zero: Vec<usize>,
    pub held: Vec<usize>,
    /// Of the laws that have jumped, by their places, switches on whose surface they have found the state.
    pub read: Vec<(usize, usize)>,
}

/// What has happened at the present instant, and memory for it.
#[derive(Default)]
pub(crate) struct Jumps {
    /// Laws that have jumped, in order.
    pub fired: Vec<usize>,
    pub known: Known,
    /// The state before the first jump.
    pub before: Vec<f64>,
    pub registers: Vec<f64>,
    /// New values of states, with the law they come from.
    pub values: Vec<(usize, f64, usize)>,
    /// What small openings were taken away from the states, together.
    pub closed: Vec<f64>,
    /// Where the jumps of contacts that close here accumulate.
    pub end: Option<f64>,
    /// What friction takes too much of the states up to there, and of which contacts.
    pub owed: (Vec<f64>, Vec<usize>),
    /// Laws of contacts without a gap, and their switches.
    pub near: Vec<(usize, usize)>,
    /// Those of them that are closed.
    pub kept: Vec<usize>,
    /// Contacts that were struck here, and how fast.
    pub struck: Vec<(usize, f64)>,
    /// Contacts without a gap that are passed by closer than their ψ is known.
    pub grazed: Vec<usize>,
}

impl Jumps {
    /// Forgets the instant before.
    pub(crate) fn begin(&mut self) {
        self.fired.clear();
        self.known.stopped = None;
        self.closed.clear();
        self.struck.clear();
        self.end = None;
        self.owed.0.clear();
        self.owed.1.clear();
        self.known.read.clear();
    }

    /// The state before the jumps of this instant, `after` where there were none.
    pub(crate) fn before<'x>(&'x self, after: &'x [f64]) -> &'x [f64] {
        match self.fired.is_empty() {
            true => after,
            false => &self.before,
        }
    }

    /// Where the jumps accumulate that end here. Where nothing says so, but that a contact opens no farther
    /// than rounding, what was taken away from the states is an error.
    pub(crate) fn limit(&self, window: &mut Window) -> Option<f64> {
        if self.end.is_none() {
            for (moved, closed) in window.moved.iter_mut().zip(&self.closed) {
                *moved += closed * closed;
            }
        }
        self.end
    }

    /// Gives back what friction has taken too much where bounces accumulate.
    ///
    /// A contact that closes with a speed v left pushes with 2v/(1 - e) until bounces would have ended, and these with
    /// (1 + e) v/(1 - e), all for a mass of one: v is what its friction has had no right to. It is given back at the
    /// end, when friction has taken more than that of the energy.
    pub(crate) fn repay(&self, system: &HybridSystem, point: &mut Point) {
        let (owed, contacts) = &self.owed;
        let slips = |contact: &usize| {
            let of_contact = |i: &usize| system.slip_of(*i) == Some(*contact);
            let mut slips = (0..point.sides.len()).filter(of_contact);
            point.sides[*contact] == Side::Slide && slips.all(|i| point.sides[i] != Side::Slide)
        };
        if !contacts.iter().all(slips) {
            return;
        }
        for (x, owed) in point.x.iter_mut().zip(owed) {
            *x += owed;
        }
    }
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
