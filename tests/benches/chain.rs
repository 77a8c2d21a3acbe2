//! Twenty blocks on a rough floor, coupled by springs: forty states, twenty switches.

#[path = "support/problem.rs"]
mod problem;
mod support;

use criterion::Criterion;
use nsd_tests::with_experiment;
use nsdc::simulate::Switched;
use problem::Problem;
use serde_json::json;
use support::{Silent, simulator, start};

const CHAIN: &str = include_str!("../../examples/friction_chain.nsd");

/// Far below the errors asked for; other solvers come closer to its result the smaller their own
/// tolerances are.
const REFERENCE: f64 = 1e-14;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let text = format!(
        "{CHAIN}\nsimulate bench of chain {{ \
         with {{ n = 20; v = [sin(i) for i in 1..n]; }} horizon 10; }}"
    );
    with_experiment(&text, "bench", |compiled| {
        let switched = Switched::new(&compiled.system);
        let mut accurate = simulator(&switched, REFERENCE);
        let horizon = compiled.settings.horizon;
        let problem = Problem {
            name: "chain of 20 blocks",
            compiled,
            exact: accurate.run(0.0, horizon, &start(compiled), &mut Silent).x,
            errors: &[1e-6, 1e-9],
            script: "chain.py",
            data: json!({ "blocks": 20, "m": 0.5, "k": 30.0, "mu": 0.2, "g": 9.81 }),
        };
        problem.compare(&mut criterion);
    });
    criterion.final_summary();
}
