//! One test, and how it ended.

use super::goldens::Change;
use crate::cli::Exit;
use crate::report::Warning;
use crate::report::expect::{Check, Verdict};

/// A test: an experiment, an `expect error` of a file, or a file that only has to compile.
pub struct Case {
    /// The file, as its path was given.
    pub file: String,
    /// The experiment, or `expect error E0203`; nothing for a file as a whole.
    pub test: Option<String>,
    /// How it ended.
    pub outcome: Outcome,
    /// How long it took.
    pub seconds: f64,
    /// Those of its compilation and its run that nothing expects.
    pub warnings: Vec<Warning>,
    /// Golden files that are to be written.
    pub changes: Vec<Change>,
}

/// How a test ended.
pub enum Outcome {
    /// With what a user may want to know.
    Passed(Vec<String>),
    /// With what is wrong.
    Failed { missed: Vec<Missed>, exit: Exit },
    /// With the code of what is still to come.
    Unsupported(String),
}

/// Something that is not as it should be.
#[derive(Debug, Default, PartialEq, serde::Serialize)]
pub struct Missed {
    /// The expectation as it is written, or what is wrong in words.
    pub what: String,
    /// What should be.
    pub expected: Option<String>,
    /// What is.
    pub got: Option<String>,
    /// How a golden file differs.
    pub lines: Vec<String>,
}

impl Missed {
    /// What a sentence says.
    pub fn plain(what: String) -> Self {
        Missed {
            what,
            ..Missed::default()
        }
    }

    /// As it is told.
    fn lines(&self) -> Vec<String> {
        let mut lines = vec![self.what.clone()];
        lines.extend(
            self.expected
                .iter()
                .map(|text| format!("  expected {text}")),
        );
        lines.extend(self.got.iter().map(|text| format!("  got      {text}")));
        lines.extend(self.lines.iter().map(|line| format!("  {line}")));
        lines
    }
}

impl Case {
    /// `oscillator.nsd: crossing`
    pub fn name(&self) -> String {
        match &self.test {
            Some(test) => name(&self.file, test),
            None => self.file.clone(),
        }
    }

    /// `1 warning: W0702`, `3 warnings: W0703, W0712`
    pub fn warned(&self) -> Option<String> {
        let mut codes: Vec<&str> = self.warnings.iter().map(|w| w.code.as_str()).collect();
        codes.sort_unstable();
        codes.dedup();
        let count = match self.warnings.len() {
            0 => return None,
            1 => "1 warning".to_owned(),
            n => format!("{n} warnings"),
        };
        Some(format!("{count}: {}", codes.join(", ")))
    }

    /// The line of the report.
    pub fn line(&self) -> String {
        let name = self.name();
        let warned = self
            .warned()
            .map_or(String::new(), |text| format!(", {text}"));
        match &self.outcome {
            Outcome::Passed(_) => format!("ok      {name}{warned}"),
            Outcome::Failed { .. } => format!("FAILED  {name}{warned}"),
            Outcome::Unsupported(code) => format!("--      {name}: not yet supported ({code})"),
        }
    }
}

/// The name of a test of a file.
pub fn name(file: &str, test: &str) -> String {
    format!("{file}: {test}")
}

impl Outcome {
    /// With one thing that is wrong.
    pub fn failed(missed: Missed, exit: Exit) -> Self {
        Outcome::Failed {
            missed: vec![missed],
            exit,
        }
    }

    /// What the checks say together; `notes` are told where all pass.
    pub fn of(checks: &[Check], notes: Vec<String>) -> Self {
        let mut missed = Vec::new();
        let mut unsupported = None;
        for check in checks {
            let what = format!("expect {}", check.text);
            match &check.verdict {
                Verdict::Passed => {}
                Verdict::Failed { expected, got } => missed.push(Missed {
                    what,
                    expected: Some(expected.clone()),
                    got: Some(got.clone()),
                    lines: Vec::new(),
                }),
                Verdict::Differs(files) => {
                    let mut lines = Vec::new();
                    for file in files {
                        let how = match file.is_missing {
                            true => "is missing",
                            false => "differs",
                        };
                        lines.push(format!("{} {how}", file.name));
                        lines.extend(file.lines.iter().map(|line| format!("  {line}")));
                    }
                    lines.push("`nsdc test --accept` writes it as it is now".to_owned());
                    missed.push(Missed {
                        what,
                        lines,
                        ..Missed::default()
                    });
                }
                Verdict::Unsupported { code } => unsupported = unsupported.or(Some(code.clone())),
            }
        }
        match (missed.is_empty(), unsupported) {
            (false, _) => Outcome::Failed {
                missed,
                exit: Exit::Failed,
            },
            (true, Some(code)) => Outcome::Unsupported(code),
            (true, None) => Outcome::Passed(notes),
        }
    }

    /// What stands below the line of the report.
    pub fn lines(&self) -> Vec<String> {
        match self {
            Outcome::Passed(notes) => notes.clone(),
            Outcome::Failed { missed, .. } => missed.iter().flat_map(Missed::lines).collect(),
            Outcome::Unsupported(_) => Vec::new(),
        }
    }

    /// What it makes of the exit status.
    pub fn exit(&self) -> Exit {
        match self {
            Outcome::Failed { exit, .. } => *exit,
            _ => Exit::Success,
        }
    }
}
