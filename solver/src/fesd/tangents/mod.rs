//! Derivatives of a run by finite elements: what its equations say as parameters and initial values move.
//!
//! A run solves F(y, h; x₀, p) = 0, the stages y and lengths h of all elements with their active sets. Where it is not
//! degenerate dy and dh follow from dx₀ and dp by the theorem of implicit functions, element by element. A switch is the
//! end of an element, whose length is an unknown: so its instant moves with the length, and the state at this end with the
//! element, and nothing has to be said of what a switch does to tangents. In the limit of short elements they are those of
//! the solution, with the order of the method (Nurkanović, Sperl, Albrecht & Diehl 2024).
//!
//! Ends that are no switches are instants which stay, those of a grid and those that the tolerance has chosen: elements up
//! to one of these, or to a switch, have the same length. A direction in which something that is zero does not stay so
//! where it has to is lost from there on, as along a run from event to event.

mod active;
mod element;
mod pass;
mod recording;
mod rows;
mod zero;

pub use recording::Recording;

use super::{ComplementaritySystem, Grid, MATTERS, Settings};
use crate::fesd::element::scheme::Scheme;
use crate::integrate::tableau::{Tableau, TableauError};
use crate::runtime::limit::Limit;
use crate::sensitivity::{Accuracy, Directions, Moment, Sensitivities};

/// A surface that a run came close to and left again.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Its switch.
    pub switch: usize,
    /// When it was closest.
    pub time: f64,
    /// ψ there, positive on the side of the run.
    pub distance: f64,
    /// How large the terms of ψ are.
    pub size: f64,
}

/// What a run has left for its derivatives.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// How it was made.
    pub settings: Settings,
    /// Its elements.
    pub recording: Recording,
    /// Surfaces that it came close to, in order.
    pub turns: Vec<Turn>,
    /// The state that is the time of what is asked and found, where that of the run is another one.
    pub clock: Option<usize>,
}

/// What has been run, and how well that is known.
#[derive(Clone, Copy)]
struct Of<'r> {
    system: &'r ComplementaritySystem,
    scheme: &'r Scheme,
    accuracy: Accuracy,
    limit: &'r Limit,
    /// The state that is the time of what is asked and told, where that of the run is another one.
    clock: Option<usize>,
    /// Surfaces that the run came close to, in order.
    turns: &'r [Turn],
}

impl Of<'_> {
    /// The time of what is told.
    fn time(&self, t: f64, x: &[f64]) -> f64 {
        self.clock.map_or(t, |clock| x[clock])
    }
}

/// Differentiates a run of a system that has been recorded, at instants in order.
///
/// # Errors
///
/// Where there are no elements with so many nodes.
pub fn differentiate(
    system: &ComplementaritySystem,
    recorded: &Recorded,
    directions: &Directions,
    instants: &[Moment],
) -> Result<Sensitivities, TableauError> {
    let settings = &recorded.settings;
    let scheme = Scheme::new(Tableau::new(settings.family, settings.nodes)?);
    let accuracy = Accuracy(match settings.grid {
        Grid::Adaptive { tolerance } => tolerance,
        Grid::Steps { .. } => MATTERS,
    });
    let of = Of {
        system,
        scheme: &scheme,
        accuracy,
        limit: &settings.limit,
        clock: recorded.clock,
        turns: &recorded.turns,
    };
    Ok(pass::Pass::new(of, directions, instants).follow(&recorded.recording))
}
