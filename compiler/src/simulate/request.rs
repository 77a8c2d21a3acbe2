//! What is asked of a run.

use crate::limit::Limit;

/// What a caller needs of a run besides the experiment's own settings.
#[derive(Clone, Debug)]
pub struct Request {
    /// Keep the solution between the reported instants.
    pub dense: bool,
    /// Estimate the global error by a second, more accurate run.
    pub estimate: bool,
    /// Keep the multipliers, where the method has them.
    pub multipliers: bool,
    /// When the run stops, and all that it makes runs of.
    pub limit: Limit,
}

impl Default for Request {
    fn default() -> Self {
        Request {
            dense: true,
            estimate: true,
            multipliers: false,
            limit: Limit::default(),
        }
    }
}
