//! A block on a belt with Coulomb friction: it slips twice, sticks, and is released.

#[path = "support/problem.rs"]
mod problem;
mod support;

use criterion::Criterion;
use nalgebra::{DMatrix, DVector};
use nsd_tests::affine::{Affine, Form, Kind, Surface, exact};
use nsd_tests::with_experiment;
use problem::Problem;
use serde_json::json;

const BELT: &str = include_str!("../../examples/stiction.nsd");

/// Bearing of the belt, as in the model.
const C: f64 = 0.3;

const HORIZON: f64 = 20.0;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    // x' = u - 1, u' = -s - x - c (u - 1), s in sign(u)
    let system = Affine {
        n: 2,
        field: DMatrix::from_row_slice(2, 4, &[0.0, 1.0, -1.0, 0.0, -1.0, -C, C, 0.0]),
        surfaces: vec![Surface {
            normal: DVector::from_row_slice(&[0.0, 1.0, 0.0, 0.0]),
            jump: DMatrix::from_row_slice(2, 4, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0]),
            kind: Kind::Jump,
        }],
        start: DVector::from_row_slice(&[2.4, 1.0]),
        horizon: HORIZON,
        form: Form::Terms,
    };
    let exact = exact::solve(&system).state(HORIZON);
    let text = format!("{BELT}\nsimulate bench of belt {{ horizon {HORIZON}; }}");
    with_experiment(&text, "bench", |compiled| {
        let problem = Problem {
            name: "belt",
            compiled,
            exact: exact.as_slice().to_vec(),
            errors: &[1e-6, 1e-10],
            script: "belt.py",
            data: json!({ "c": C }),
        };
        problem.compare(&mut criterion);
    });
    criterion.final_summary();
}
