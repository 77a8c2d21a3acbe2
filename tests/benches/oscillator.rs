//! The oscillator of the FESD literature: one crossing of the unit circle.

#[path = "support/problem.rs"]
mod problem;
mod support;

use std::f64::consts::PI;

use criterion::Criterion;
use nsd_tests::with_experiment;
use problem::Problem;
use serde_json::json;

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let (radius, angle) = ((PI / 2.0 - 1.0).exp(), 2.0 * PI * (PI / 2.0 - 1.0));
    with_experiment(OSCILLATOR, "crossing", |compiled| {
        let problem = Problem {
            name: "oscillator",
            compiled,
            exact: vec![radius * angle.cos(), radius * angle.sin()],
            errors: &[1e-6, 1e-9, 1e-12],
            script: "oscillator.py",
            data: json!({}),
        };
        problem.compare(&mut criterion);
    });
    criterion.final_summary();
}
