//! What a selection of the next mode knows of the ones before, and leaves to the step behind it.

use super::fold::Fold;
use super::nonlinear::Decision;
use crate::contact::slip_onset::Departure;
use crate::expansion::scales::refill;

/// From which α a nonlinear switch goes on where it is on its surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) enum Entry {
    /// The one it has.
    #[default]
    Present,
    /// One that it had before all sides were looked at again.
    From(f64),
    /// None: the run starts on the surface.
    Unknown,
}

/// How the present mode was chosen.
#[derive(Default)]
pub(crate) struct Selection {
    /// The mode at the start is known.
    pub begun: bool,
    /// Where nonlinear switches come from.
    pub entry: Vec<Entry>,
    /// The fold that the last step has ended in.
    pub fold: Option<Fold>,
    /// What decided about nonlinear switches at the last event.
    pub decisions: Vec<Decision>,
    /// Slip velocities with two entries that start from rest at the last event.
    pub departures: Vec<Departure>,
}

impl Selection {
    /// Knows nothing of n switches.
    pub(crate) fn begin(&mut self, n: usize) {
        (self.fold, self.begun) = (None, false);
        refill(&mut self.entry, n, Entry::Present);
        self.decisions.clear();
        self.departures.clear();
    }
}
