//! The one clock. A target without one stands still: no time passes there, and no limit of it is reached.

use std::time::Duration;

/// Whether the target has a clock: where it has none, `std` panics.
const TICKS: bool = !cfg!(all(target_family = "wasm", target_os = "unknown"));

/// An instant; none where there is no clock.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Instant(Option<std::time::Instant>);

impl Instant {
    /// This one.
    #[expect(clippy::disallowed_methods, reason = "this is the one clock")]
    pub fn now() -> Self {
        Instant(TICKS.then(std::time::Instant::now))
    }

    /// What has passed since then.
    pub fn elapsed(self) -> Duration {
        self.0.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// So long after it, if that can be told.
    pub fn checked_add(self, time: Duration) -> Option<Self> {
        let end = self.0?.checked_add(time)?;
        Some(Instant(Some(end)))
    }

    /// How long it is after another one; nothing where it is before it.
    pub fn saturating_duration_since(self, earlier: Self) -> Duration {
        let both = self.0.zip(earlier.0);
        both.map_or(Duration::ZERO, |(end, start)| {
            end.saturating_duration_since(start)
        })
    }
}
