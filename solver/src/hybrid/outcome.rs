//! How a run has ended, and where.

use super::side::Side;
use super::status::{Note, Stats, Status};
use crate::events::Approach;

/// The end of a run.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Why it ended.
    pub status: Status,
    /// When.
    pub time: f64,
    /// Where.
    pub x: Vec<f64>,
    /// The last mode.
    pub sides: Vec<Side>,
    /// α of the last mode.
    pub alpha: Vec<f64>,
    /// Mean size of the terms of each rate: times ε and the length of the run, what rounding may
    /// have done to a state that cancellation holds in place.
    pub activity: Vec<f64>,
    /// What rounding may have moved each state by, through the times of events.
    pub moved: Vec<f64>,
    /// By how much the run misses its equations at most: |ψ| on a sliding surface, relative to the size of its terms, and
    /// ‖x' - f‖ h at the end of a step, relative to the tolerance's scale.
    pub violation: f64,
    /// Largest residual of the complementarity problems of contacts, relative to the size of their rates.
    pub complementarity: f64,
    /// What it went on from although it could not be sure.
    pub notes: Vec<Note>,
    /// Surfaces with another field behind them that came close, in order of time.
    pub approaches: Vec<Approach>,
    /// Counts.
    pub stats: Stats,
}

impl Outcome {
    /// A run that has ended at an instant and a state with switches on these sides, and has nothing else to tell: α of those
    /// that slide is 1/2.
    pub fn at(status: Status, time: f64, x: Vec<f64>, sides: Vec<Side>) -> Self {
        let n = x.len();
        Outcome {
            status,
            time,
            x,
            alpha: sides.iter().map(|side| 0.5 + 0.5 * side.sign()).collect(),
            sides,
            activity: vec![0.0; n],
            moved: vec![0.0; n],
            violation: 0.0,
            complementarity: 0.0,
            notes: Vec::new(),
            approaches: Vec::new(),
            stats: Stats::default(),
        }
    }
}
