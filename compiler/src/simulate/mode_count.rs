//! How many modes a run goes through.

/// Changes of the mode that are closer than this share of the horizon happen at once: only rounding has told them apart.
const AT_ONCE: f64 = 1e-12;

/// How many modes a run goes through.
pub(super) struct ModeCount {
    /// So far.
    pub count: usize,
    last: f64,
    shortest: f64,
}

impl ModeCount {
    /// Of a run over a horizon, before it begins.
    pub fn new(horizon: f64) -> Self {
        ModeCount {
            count: 1,
            last: f64::NEG_INFINITY,
            shortest: AT_ONCE * horizon,
        }
    }

    /// The mode changes.
    pub fn change(&mut self, time: f64) {
        if time - self.last > self.shortest {
            self.count += 1;
            self.last = time;
        }
    }
}
