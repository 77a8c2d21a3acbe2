//! Whether a run gets on.

use crate::hybrid::Stats;

/// Steps in a row without an event after which it is asked whether a run can come to its end.
const PACED: usize = 4096;

/// Where steps without an event began.
#[derive(Clone, Copy, Default)]
pub struct Pace {
    time: f64,
    steps: usize,
    events: usize,
}

impl Pace {
    /// Whether the limit of steps comes before the end at t₁ at the pace of the last ones: where rates turn over within
    /// what a tolerance tells apart, a run creeps from one side to the other.
    pub fn falls_short(&mut self, time: f64, stats: &Stats, max_steps: usize, t1: f64) -> bool {
        let now = Pace {
            time,
            steps: stats.steps,
            events: stats.events,
        };
        let taken = now.steps - self.steps;
        let is_uneventful = now.events == self.events;
        if is_uneventful && taken < PACED {
            return false;
        }
        let before = std::mem::replace(self, now);
        let left = (t1 - now.time) / (now.time - before.time) * taken as f64;
        is_uneventful && left > max_steps as f64
    }
}
