//! What is asked of a run.

use std::time::{Duration, Instant};

/// What a caller needs of a run besides the experiment's own settings.
#[derive(Clone, Copy, Debug)]
pub struct Request {
    /// Keep the solution between the reported instants.
    pub dense: bool,
    /// Estimate the global error by a second, more accurate run.
    pub estimate: bool,
    /// Keep the multipliers, where the method has them.
    pub multipliers: bool,
    /// Wall time after which the run stops.
    pub time_limit: Option<Duration>,
}

impl Default for Request {
    fn default() -> Self {
        Request {
            dense: true,
            estimate: true,
            multipliers: false,
            time_limit: None,
        }
    }
}

impl Request {
    /// The same with what is left of the time since an instant, for runs that share it.
    pub fn left(&self, since: Instant) -> Self {
        let limit = self.time_limit;
        Request {
            time_limit: limit.map(|limit| limit.saturating_sub(since.elapsed())),
            ..*self
        }
    }
}
