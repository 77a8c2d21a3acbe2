//! Reads the settings of an `mpc` experiment one by one.

use super::super::error::ExperimentError;
use super::super::reader::Reader;
use crate::source::Span;
use crate::syntax::{self, Ident, SettingKind};

/// More samples than this are a mistake.
const MOST_SAMPLES: f64 = 1e5;
/// A deadline is no longer than this, in seconds.
const LONGEST: f64 = 1e9;

/// What an `mpc` asks for besides what a simulation does.
#[derive(Clone, Debug, PartialEq)]
pub struct ClosedLoop {
    /// The experiment that is solved at each sample.
    pub controller: Ident,
    /// How long controls are from one plan.
    pub sample: f64,
    /// How long a solve may take, in seconds.
    pub deadline: Option<f64>,
}

/// What has been read of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Draft {
    controller: Option<Ident>,
    sample: Option<f64>,
    deadline: Option<f64>,
}

impl Draft {
    /// Reads a setting that simulations do not have; `horizon` is known by now.
    pub fn setting(
        &mut self,
        reader: &mut Reader<'_, '_>,
        (kind, span): (&SettingKind, Span),
        horizon: Option<f64>,
    ) {
        match kind {
            SettingKind::Controller(path) => {
                reader.once("`controller`", span);
                self.controller = Some(Ident {
                    name: path.to_string(),
                    span: path.span,
                });
            }
            SettingKind::Value { name, value } if name.name == "sample" => {
                reader.once("`sample`", span);
                let fits = |x: f64| x > 0.0 && horizon.is_none_or(|end| end / x <= MOST_SAMPLES);
                let expected = match horizon {
                    Some(end) => format!(
                        "positive, and at least {:?}: a horizon of {end:?} has at most {MOST_SAMPLES} samples",
                        end / MOST_SAMPLES
                    ),
                    None => "positive".to_owned(),
                };
                self.sample = reader.within("the sample", value, &expected, fits);
            }
            SettingKind::Value { name, value } if name.name == "deadline" => {
                reader.once("`deadline`", span);
                let expected = "positive, and at most 1e9 seconds";
                let fits = |s: f64| s > 0.0 && s <= LONGEST;
                self.deadline = reader.within("the deadline", value, expected, fits);
            }
            other => not_for_mpc(reader, other.word(), span),
        }
    }

    /// Everything, once all settings have been read; `None` after an error.
    pub fn finish(
        self,
        reader: &mut Reader<'_, '_>,
        experiment: &syntax::Experiment,
    ) -> Option<ClosedLoop> {
        let has = |word: &str| experiment.settings.iter().any(|s| s.kind.word() == word);
        let missing = ["controller", "sample"].into_iter().find(|word| !has(word));
        if let Some(what) = missing {
            reader.error(ExperimentError::OpenLoop {
                name: experiment.name.name.clone(),
                what,
                span: experiment.name.span,
            });
        }
        Some(ClosedLoop {
            controller: self.controller?,
            sample: self.sample?,
            deadline: self.deadline,
        })
    }
}

pub(crate) fn not_for_mpc(reader: &mut Reader<'_, '_>, setting: &str, span: Span) {
    reader.error(ExperimentError::NotForMpc {
        setting: format!("`{setting}`"),
        span,
    });
}
