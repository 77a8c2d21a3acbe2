//! Twenty blocks on a rough floor, coupled by springs: forty states, twenty switches.

#[path = "support/problem.rs"]
mod problem;
mod support;

use criterion::Criterion;
use nalgebra::{DMatrix, DVector};
use nsd_tests::affine::{Affine, Form, Kind, Surface, exact};
use nsd_tests::with_experiment;
use problem::Problem;
use serde_json::json;

const CHAIN: &str = include_str!("../../examples/friction_chain.nsd");

/// Number of blocks.
const N: usize = 20;

/// As in the model.
const M: f64 = 0.5;
const K: f64 = 30.0;
const MU: f64 = 0.2;
const G: f64 = 9.81;

const HORIZON: f64 = 10.0;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let text = format!(
        "{CHAIN}\nsimulate bench of chain {{ \
         with {{ n = {N}; v = [sin(i) for i in 1..n]; }} horizon {HORIZON}; }}"
    );
    let exact = exact::solve(&chain());
    assert_eq!(exact.end, exact::End::Horizon, "the chain has one solution");
    with_experiment(&text, "bench", |compiled| {
        let problem = Problem {
            name: "chain of 20 blocks",
            compiled,
            exact: exact.state(HORIZON).as_slice().to_vec(),
            errors: &[1e-6, 1e-9],
            script: "chain.py",
            data: json!({ "blocks": N, "m": M, "k": K, "mu": MU, "g": G }),
        };
        problem.compare(&mut criterion);
    });
    criterion.final_summary();
}

/// q' = v, m v' = -k L q - μ m g s with the Laplacian L of the springs, s ∈ sign(v)
fn chain() -> Affine {
    let mut field = DMatrix::zeros(2 * N, 2 * N + 2);
    for i in 0..N {
        field[(i, N + i)] = 1.0;
    }
    for i in 1..N {
        for (of, other) in [(i - 1, i), (i, i - 1)] {
            field[(N + of, of)] -= K / M;
            field[(N + of, other)] += K / M;
        }
    }
    let rubs = |i: usize| {
        let (mut normal, mut jump) = (DVector::zeros(2 * N + 2), DMatrix::zeros(2 * N, 2 * N + 2));
        normal[N + i] = 1.0;
        jump[(N + i, 2 * N)] = -MU * G;
        Surface {
            normal,
            jump,
            kind: Kind::Jump,
        }
    };
    Affine {
        n: 2 * N,
        field,
        surfaces: (0..N).map(rubs).collect(),
        start: DVector::from_fn(2 * N, |i, _| match i.checked_sub(N) {
            Some(block) => ((block + 1) as f64).sin(),
            None => 0.0,
        }),
        horizon: HORIZON,
        form: Form::Terms,
    }
}
