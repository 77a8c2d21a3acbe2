//! The JSON form of a report: one object on one line, with the fields of the language reference.

use super::Report;
use crate::report::Stats;

/// The fields in the order of the reference; numbers that are not finite are `null`.
#[derive(serde::Serialize)]
struct Object<'a> {
    problem: &'a str,
    kind: &'a str,
    status: &'a str,
    objective: f64,
    variables: usize,
    constraints: usize,
    complementarities: usize,
    constraint_violation: f64,
    complementarity_min: f64,
    complementarity_product: f64,
    stats: &'a Stats,
    certificate: Certificate<'a>,
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    names: &'a [String],
    x: &'a [f64],
}

#[derive(serde::Serialize)]
struct Certificate<'a> {
    stationarity: &'a str,
    max_violation: f64,
}

/// The object, without a line break.
pub fn write(report: &Report) -> String {
    let object = Object {
        problem: &report.problem,
        kind: "solve",
        status: report.status.as_str(),
        objective: report.objective,
        variables: report.sizes.variables,
        constraints: report.sizes.rows,
        complementarities: report.sizes.complementarities,
        constraint_violation: report.quality.violation,
        complementarity_min: report.quality.complementarity_min,
        complementarity_product: report.quality.complementarity_product,
        stats: &report.stats,
        certificate: Certificate {
            stationarity: report.stationarity.as_str(),
            max_violation: report
                .quality
                .violation
                .max(report.quality.complementarity_min),
        },
        names: &report.names,
        x: &report.x,
    };
    // Names and numbers only: nothing that serialization can refuse.
    serde_json::to_string(&object).unwrap_or_default()
}
