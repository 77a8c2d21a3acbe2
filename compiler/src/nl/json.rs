//! The JSON form of a report: one object on one line, with the fields of the language reference.

use super::Report;
use crate::report::{Certificate, Stats, Status};

/// The fields in the order of the reference; numbers that are not finite are `null`.
#[derive(serde::Serialize)]
struct Object<'a> {
    problem: &'a str,
    kind: &'a str,
    status: Status,
    objective: f64,
    variables: usize,
    constraints: usize,
    complementarities: usize,
    constraint_violation: f64,
    complementarity_min: f64,
    complementarity_product: f64,
    stats: &'a Stats,
    certificate: Certificate,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    names: &'a [String],
    x: &'a [f64],
}

/// The object, without a line break.
pub fn write(report: &Report) -> String {
    let quality = &report.quality;
    let object = Object {
        problem: &report.problem,
        kind: "solve",
        status: report.status,
        objective: report.objective,
        variables: report.sizes.variables,
        constraints: report.sizes.rows,
        complementarities: report.sizes.complementarities,
        constraint_violation: quality.violation,
        complementarity_min: quality.complementarity_min,
        complementarity_product: quality.complementarity_product,
        stats: &report.stats,
        certificate: Certificate {
            stationarity: report.stationarity,
            max_violation: quality.violation.max(quality.complementarity_min),
        },
        names: &report.names,
        x: &report.x,
    };
    // Names and numbers only: nothing that serialization can refuse.
    serde_json::to_string(&object).unwrap_or_default()
}
