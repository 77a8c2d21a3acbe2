//! How far a long run is, where somebody looks.

use std::sync::Arc;
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

/// Where it is shown how far long runs are.
#[derive(Clone, Default)]
pub enum Meter {
    /// Nowhere.
    #[default]
    None,
    /// In a line of standard error, where that is a terminal.
    Line,
    /// To a listener: the share that is done, where it is known, and what is being done.
    Told(Arc<dyn Fn(Option<f64>, String) + Send + Sync>),
}

impl Meter {
    /// A line where there is a terminal.
    pub fn line(is_terminal: bool) -> Self {
        Meter::Line.only_if(is_terminal)
    }

    /// The same, or none.
    pub(super) fn only_if(&self, is_shown: bool) -> Self {
        match is_shown {
            true => self.clone(),
            false => Meter::None,
        }
    }
}

/// What shows one experiment; a line is gone when dropped.
pub struct Bar {
    name: String,
    meter: Meter,
    /// When it was drawn last, and what is to pass until it is again.
    last: Instant,
    pause: Duration,
    line: Option<ProgressBar>,
}

impl Bar {
    /// One that is shown after a while, if at all.
    pub fn new(name: &str, meter: Meter) -> Self {
        Bar {
            name: name.to_owned(),
            meter,
            last: Instant::now(),
            pause: PATIENCE,
            line: None,
        }
    }

    /// Shows the share that is done, and what it is, now and then.
    pub fn show(&mut self, done: f64, message: impl FnOnce() -> String) {
        self.tell(Some(done.clamp(0.0, 1.0)), message);
    }

    /// Shows what is being done, now and then, where its share of the whole is not known.
    pub fn note(&mut self, message: impl FnOnce() -> String) {
        self.tell(None, message);
    }

    fn tell(&mut self, done: Option<f64>, message: impl FnOnce() -> String) {
        if matches!(self.meter, Meter::None) || self.last.elapsed() < self.pause {
            return;
        }
        (self.last, self.pause) = (Instant::now(), INTERVAL);
        if let Meter::Told(told) = &self.meter {
            return told(done, format!("{}: {}", self.name, message()));
        }
        let (name, style) = (&self.name, done.map_or(OPEN_STYLE, |_| STYLE));
        let line = self.line.get_or_insert_with(|| new_line(name, style));
        if let Some(done) = done {
            line.set_position((done * LENGTH as f64) as u64);
        }
        line.set_message(message());
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
