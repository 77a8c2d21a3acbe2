//! Options in the way of AMPL: `tolerance=1e-9 time_limit=60`.

use std::num::NonZeroUsize;
use std::time::Duration;

/// What a run is asked for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// What the optimality error has to reach; the solver's own without it.
    pub tolerance: Option<f64>,
    /// The longest time.
    pub time_limit: Option<Duration>,
    /// From how many starts a problem with pairs is solved; as many as it has time for without it.
    pub starts: Option<NonZeroUsize>,
    /// Whether the report is left out.
    pub is_quiet: bool,
}

/// An option that is not understood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadOption {
    /// There is no such option.
    #[error("there is no option `{0}`; there are `tolerance`, `time_limit`, `starts` and `outlev`")]
    Unknown(String),
    /// Its value is none.
    #[error("`{value}` is no value of the option `{name}`, which is {expected}")]
    Value {
        /// The option.
        name: String,
        /// What was given.
        value: String,
        /// What it takes.
        expected: &'static str,
    },
}

impl Settings {
    /// Adds options, as words `name=value` or `name value`.
    pub fn add(&mut self, text: &str) -> Result<(), BadOption> {
        let text = text.replace('=', " ");
        let mut words = text.split_whitespace();
        while let Some(name) = words.next() {
            let value = words.next().unwrap_or_default();
            let bad = |expected| BadOption::Value {
                name: name.to_owned(),
                value: value.to_owned(),
                expected,
            };
            match name {
                "tolerance" | "tol" => {
                    let tolerance = tolerance(value).ok_or(bad("a number in (0, 1)"))?;
                    self.tolerance = Some(tolerance);
                }
                "time_limit" | "max_cpu_time" | "timelimit" => {
                    let seconds = value.parse().ok().filter(|seconds| *seconds > 0.0);
                    let limit = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
                    self.time_limit = Some(limit.ok_or(bad("a positive number of seconds"))?);
                }
                "starts" => {
                    let starts = value.parse().map_err(|_| bad("a whole number from 1 on"))?;
                    self.starts = Some(starts);
                }
                "outlev" => {
                    let level: u32 = value.parse().map_err(|_| bad("0 for silence, else 1"))?;
                    self.is_quiet = level == 0;
                }
                // Set by AMPL itself: whether a solution file is wanted.
                "wantsol" => {}
                _ => return Err(BadOption::Unknown(name.to_owned())),
            }
        }
        Ok(())
    }
}

/// A tolerance.
pub fn tolerance(text: &str) -> Option<f64> {
    let value: f64 = text.parse().ok()?;
    (value > 0.0 && value < 1.0).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_words() {
        let mut settings = Settings::default();
        settings
            .add("tolerance=1e-9 time_limit 2.5\tstarts=3 outlev = 0")
            .unwrap();
        assert_eq!(
            settings,
            Settings {
                tolerance: Some(1e-9),
                time_limit: Some(Duration::from_millis(2500)),
                starts: NonZeroUsize::new(3),
                is_quiet: true,
            }
        );
        settings.add("").unwrap();
    }

    #[test]
    fn what_is_no_option_is_refused() {
        for text in [
            "tolerance=2",
            "tolerance",
            "time_limit=-1",
            "starts=0",
            "outlev=loud",
            "speed=9",
        ] {
            let error = Settings::default().add(text).unwrap_err().to_string();
            assert!(error.contains(text.split('=').next().unwrap()), "{error}");
        }
    }
}
