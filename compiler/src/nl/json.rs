//! The JSON form of a report: one object on one line, with the fields of the language reference.

use super::Report;

/// The fields in the order of the reference; numbers that are not finite are `null`.
#[derive(serde::Serialize)]
struct Object<'a> {
    problem: &'a str,
    kind: &'a str,
    #[serde(flatten)]
    report: &'a Report,
}

/// The object, without a line break.
pub fn write(report: &Report) -> String {
    let object = Object {
        problem: &report.problem,
        kind: "solve",
        report,
    };
    // Names and numbers only: nothing that serialization can refuse.
    serde_json::to_string(&object).unwrap_or_default()
}
