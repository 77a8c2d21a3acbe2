//! What a selection of the next mode knows of the ones before, and leaves to the step behind it.

use crate::expansion::scales::refill;
use crate::hybrid::{Few, Side};

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

/// Where a branch ends.
#[derive(Clone, Debug)]
pub(crate) struct Fold {
    /// The switch whose α is fastest.
    pub switch: usize,
    /// How long after the start of the step.
    pub after: f64,
    /// The switches that interact, that one among them.
    pub turns: Vec<Turn>,
}

/// A switch in a fold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    pub switch: usize,
    pub alpha: f64,
    /// Where the dummy system goes from there, relative to the one that goes farthest.
    pub direction: f64,
}

impl Fold {
    /// What becomes of a switch in it.
    pub(crate) fn turn(&self, switch: usize) -> Option<&Turn> {
        self.turns.iter().find(|turn| turn.switch == switch)
    }
}

/// An α that keeps the state on the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlidingMode {
    /// α ∈ [0, 1].
    pub alpha: f64,
    /// S = ∂φ/∂α: attracting where it is negative, repelling where it is positive.
    pub stability: f64,
}

/// What decided about nonlinear switches at an event.
#[derive(Clone, Debug, PartialEq)]
pub struct Decision {
    /// The switch.
    pub switch: usize,
    /// All sliding modes at the event, other switches being as they are afterwards; α ascending.
    pub modes: Vec<SlidingMode>,
    /// α with which it slides on; none where it leaves its surface, or crosses it.
    pub taken: Option<f64>,
    /// A sliding mode has ended in a fold here.
    pub folds: bool,
}

/// A slip velocity with two entries that starts from rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Onset {
    /// Both switches.
    pub switches: [usize; 2],
    /// Of unit length.
    pub direction: [f64; 2],
}

/// A choice on one group of interacting surfaces.
#[derive(Clone)]
pub(crate) struct Choice {
    pub sides: Few<Side>,
    pub alpha: Few<f64>,
    /// f of the states that ψ of the group depend on.
    pub f: Few<f64>,
}

/// The largest |f| of some choices, by the place of a state among those that ψ of the group depend on.
pub(crate) fn fastest(choices: &[Choice]) -> impl Fn(usize) -> f64 {
    |at| {
        let rates = choices.iter().map(|choice| choice.f[at].abs());
        rates.fold(0.0, f64::max)
    }
}

/// What is known of the choices on a group.
pub(crate) struct Choices {
    pub found: Vec<Choice>,
    /// Some choice of sides leaves its α undetermined.
    pub singular: bool,
    /// No bound of a search was met, so that there are no others.
    pub all: bool,
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
    pub onsets: Vec<Onset>,
    /// Of each surface that a force keeps, the largest force so far that has kept it from what is behind it.
    pub pushed: Vec<f64>,
    /// The switch that has come to an end of its sliding at this instant, and nothing else with it, and dα/dt there.
    pub leaving: Option<(usize, f64)>,
}

/// By how much α passes its bound within a step, at least, where there is no doubt that it does.
const PASSES: f64 = 1e-4;

impl Selection {
    /// Knows nothing of n switches.
    pub(crate) fn begin(&mut self, n: usize) {
        (self.fold, self.begun) = (None, false);
        refill(&mut self.entry, n, Entry::Present);
        refill(&mut self.pushed, n, 0.0);
        self.decisions.clear();
        self.onsets.clear();
        self.leaving = None;
    }

    /// Where a switch goes that has stopped to slide, if α passes its bound: so much of a step behind it, it is far beyond.
    pub(crate) fn leaving_to(&self, switch: usize, step: f64) -> Option<Side> {
        let (_, slope) = self.leaving.filter(|(leaving, _)| *leaving == switch)?;
        (slope.abs() * step > PASSES).then_some(Side::of(slope))
    }
}
