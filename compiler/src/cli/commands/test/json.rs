//! Results of tests as JSON, one object per line.

use super::case::{Case, Missed, Outcome};
use crate::report::Warning;

/// The fields, in their order.
#[derive(serde::Serialize)]
struct Object<'c> {
    file: &'c str,
    test: Option<&'c str>,
    outcome: &'static str,
    exit: u8,
    code: Option<&'c str>,
    seconds: f64,
    failures: &'c [Missed],
    notes: &'c [String],
    /// As `nsdc run` tells them.
    warnings: &'c [Warning],
}

/// One line per test.
pub fn write(cases: &[Case]) -> String {
    let line = |case: &Case| {
        let object = Object::from(case);
        // Texts and numbers only: nothing that serialization can refuse.
        serde_json::to_string(&object).unwrap_or_default() + "\n"
    };
    cases.iter().map(line).collect()
}

impl<'c> From<&'c Case> for Object<'c> {
    fn from(case: &'c Case) -> Self {
        let mut object = Object {
            file: &case.file,
            test: case.test.as_deref(),
            outcome: "passed",
            exit: case.outcome.exit() as u8,
            code: None,
            seconds: case.seconds,
            failures: &[],
            notes: &[],
            warnings: &case.warnings,
        };
        match &case.outcome {
            Outcome::Passed(notes) => object.notes = notes,
            Outcome::Failed { missed, .. } => {
                (object.outcome, object.failures) = ("failed", missed);
            }
            Outcome::Unsupported(code) => {
                (object.outcome, object.code) = ("unsupported", Some(code.as_str()));
            }
        }
        object
    }
}
