//! A line that shows how far a long run is, on a terminal only.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Runs that are over before it show nothing.
const PATIENCE: Duration = Duration::from_millis(500);
/// Between two drawings.
const INTERVAL: Duration = Duration::from_millis(100);
/// Parts of the bar.
const LENGTH: u64 = 1000;
const STYLE: &str = "{prefix} [{bar:24}] {wide_msg}";
/// Where nobody knows how much is left.
const OPEN_STYLE: &str = "{prefix} {wide_msg}";

/// The line for one experiment; gone when dropped.
pub struct Bar {
    name: String,
    is_shown: bool,
    /// When it was drawn last, and what is to pass until it is again.
    last: Instant,
    pause: Duration,
    line: Option<ProgressBar>,
}

impl Bar {
    /// A line that is shown after a while, if at all.
    pub fn new(name: &str, is_shown: bool) -> Self {
        Bar {
            name: name.to_owned(),
            is_shown,
            last: Instant::now(),
            pause: PATIENCE,
            line: None,
        }
    }

    /// Shows the share that is done, and what it is, now and then.
    pub fn show(&mut self, done: f64, message: impl FnOnce() -> String) {
        if let Some(line) = self.due(STYLE) {
            line.set_position((done.clamp(0.0, 1.0) * LENGTH as f64) as u64);
            line.set_message(message());
        }
    }

    /// Shows what is being done, now and then, where its share of the whole is not known.
    pub fn note(&mut self, message: impl FnOnce() -> String) {
        if let Some(line) = self.due(OPEN_STYLE) {
            line.set_message(message());
        }
    }

    /// The line, where it is to be drawn again.
    fn due(&mut self, style: &str) -> Option<&ProgressBar> {
        if !self.is_shown || self.last.elapsed() < self.pause {
            return None;
        }
        (self.last, self.pause) = (Instant::now(), INTERVAL);
        let name = &self.name;
        Some(self.line.get_or_insert_with(|| new_line(name, style)))
    }
}

fn new_line(name: &str, style: &str) -> ProgressBar {
    let line = ProgressBar::with_draw_target(Some(LENGTH), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template(style) {
        line.set_style(style.progress_chars("=> "));
    }
    line.set_prefix(name.to_owned());
    line
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(line) = &self.line {
            line.finish_and_clear();
        }
    }
}
