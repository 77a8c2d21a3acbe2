//! Derivatives beside the run that they are of: those by a few parameters forward, and the gradient of one number by a hundred
//! backward.
//!
//! A run has 1; what is recorded of it and the pass over that are in the other numbers. The error is that of the gradient, of
//! its largest entry, against a closed form, or else against the derivatives that go forward.

#[allow(dead_code, reason = "other benchmarks use all of it")]
mod support;

use std::fmt::Write as _;
use std::hint::black_box;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use nsd_solver::event::{Recording, Simulator};
use nsd_solver::sensitivity::{Directions, Moment, Sensitivities, adjoint, differentiate};
use nsd_tests::with_experiment;
use nsdc::lowering::hybrid;
use support::{Silent, median, print, simulator, start};

const TOLERANCE: f64 = 1e-9;
/// Blocks, and states of the linear system.
const BLOCKS: usize = 20;
const LINEAR: usize = 10;

fn main() {
    print(
        "| model | states | events | parameters | run, us | recorded | forward | backward | error of the gradient | beside |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    );
    row("bouncing ball", BALL, &[], Some(&ball()));
    let few = ["mu", "c", "speed", "k", "d"];
    row("block on a belt", BELT, &few, None);
    let chain = chain();
    let five = ["mu[1]", "c[2]", "d[3]", "f[4]", "w"];
    row("chain of blocks", &chain, &five, None);
    row("chain of blocks", &chain, &[], None);
    let (linear, exact) = linear();
    row("linear", &linear, &[], Some(&exact));
}

/// A row of the table: by some parameters, or by all.
fn row(name: &str, text: &str, by: &[&str], exact: Option<&[f64]>) {
    with_experiment(text, "bench", |compiled| {
        let (x0, horizon) = (start(compiled), compiled.settings.horizon);
        let system = &compiled.system;
        let open: Vec<usize> = hybrid::may_be_open(system).into_iter().collect();
        let open = open.into_iter().filter(|&place| {
            let name = &system.exogenous.params[place].name;
            by.is_empty() || by.contains(&name.as_str())
        });
        let open: Vec<usize> = open.collect();
        assert!(by.is_empty() || open.len() == by.len(), "all are open");
        let lowered = hybrid::lower_open(system, horizon, &open);
        let mut run = simulator(&lowered, TOLERANCE);
        let found = Found::new(&mut run, &x0, horizon);
        let plain = median(|| {
            black_box(run.run(0.0, horizon, &x0, &mut Silent));
        });
        let mut recorded = || {
            let mut recording = Recording::default();
            let outcome = run.run(0.0, horizon, &x0, &mut recording);
            (recording, outcome.approaches)
        };
        let recording = median(|| {
            black_box(recorded());
        });
        let (known, approaches) = recorded();
        let directions = along(&x0, open.len());
        let last = [Moment {
            time: horizon,
            is_behind: true,
        }];
        let run = simulator(&lowered, TOLERANCE);
        let forward = || differentiate(&run, &known, &approaches, &directions, &last);
        let backward = || {
            let weigh = |_: &Sensitivities| Some(vec![weights(x0.len(), lowered.switches.len())]);
            let of = (&known, &approaches[..]);
            adjoint(&run, of, &directions, &last, weigh).expect("it goes back")
        };
        let [ahead, back] = [
            median(|| {
                black_box(forward());
            }),
            median(|| {
                black_box(backward());
            }),
        ];
        let sum = |by: &[f64]| -> f64 {
            let weights = weights(x0.len(), lowered.switches.len());
            by.iter().zip(weights).map(|(a, b)| a * b).sum()
        };
        let tangents = forward();
        let tangents: Vec<f64> = (0..open.len())
            .map(|d| match tangents.at(0, d) {
                Some(by) => sum(by),
                None => panic!("{:?}", tangents.lost[d]),
            })
            .collect();
        let gradient = backward();
        let reference = exact.unwrap_or(&tangents);
        let size = reference
            .iter()
            .fold(0.0_f64, |size, one| size.max(one.abs()));
        let pairs = gradient.iter().zip(reference);
        let error = pairs.fold(0.0_f64, |error, (a, b)| error.max((a - b).abs()));
        print(&format!(
            "| {name} | {} | {} | {} | {:.0} | {:.2} | {:.2} | {:.2} | {:.1e} | {} |",
            x0.len(),
            found.events,
            open.len(),
            1e6 * plain,
            recording / plain,
            (recording + ahead) / plain,
            (recording + back) / plain,
            error / size,
            exact.map_or("forward", |_| "closed form"),
        ));
    });
}

/// What a run comes to.
struct Found {
    events: usize,
}

impl Found {
    fn new(run: &mut Simulator, x0: &[f64], horizon: f64) -> Self {
        let mut seen = Events(0);
        let outcome = run.run(0.0, horizon, x0, &mut seen);
        assert_eq!(outcome.status, nsd_solver::hybrid::Status::Solved);
        Found { events: seen.0 }
    }
}

struct Events(usize);

impl nsd_solver::event::Observer for Events {
    fn segment(&mut self, _: &nsd_solver::event::Segment) -> std::ops::ControlFlow<()> {
        std::ops::ControlFlow::Continue(())
    }

    fn event(&mut self, _: &nsd_solver::event::Event) {
        self.0 += 1;
    }
}

/// By each of so many parameters, on which no start depends.
fn along(x0: &[f64], count: usize) -> Directions {
    let unit = |at: usize| {
        let mut unit = vec![0.0; count];
        unit[at] = 1.0;
        unit
    };
    Directions {
        initial: vec![vec![0.0; x0.len()]; count],
        parameters: (0..count).map(unit).collect(),
    }
}

/// Of states at the end, and of nothing else.
fn weights(n_states: usize, n_switches: usize) -> Vec<f64> {
    let mut weights: Vec<f64> = (0..n_states).map(weight).collect();
    weights.resize(n_states + n_switches, 0.0);
    weights
}

fn weight(i: usize) -> f64 {
    ((i + 1) as f64).sin()
}

const BALL: &str =
    "model ball { param g = 9.81; param e = 0.5; state q = 1; state v = 0; q' = v; v' = -g;
       jump floor when q <= 0 and v < 0 { v := -e*v; } }
     simulate bench of ball { horizon 0.8; }";

/// With one bounce at t* = √(2/g), q = s e √(2g) - g s²/2 and v = e √(2g) - g s, where s = 0.8 - t*.
fn ball() -> [f64; 2] {
    let (g, e) = (9.81_f64, 0.5);
    let (s, up) = (0.8 - (2.0 / g).sqrt(), (2.0 * g).sqrt());
    let (s_g, up_g) = (0.5 * (2.0 / g).sqrt() / g, 1.0 / up);
    let of_q = [
        s_g * e * up + s * e * up_g - 0.5 * s * s - g * s * s_g,
        s * up,
    ];
    let of_v = [e * up_g - s - g * s_g, up];
    [0, 1].map(|i| weight(0) * of_q[i] + weight(1) * of_v[i])
}

const BELT: &str = "model belt { param mu = 0.6; param c = 0.3; param speed = 0.3; param k = 1.1; param d = 0.1;
       state q = 0; state v = 1; q' = v; v' = -k*q - d*v - mu*sign(v - speed)*(1 + c*exp(-abs(v - speed))); }
     simulate bench of belt { horizon 20; }";

/// Blocks that are driven, each with its own mass, friction, damping and force, and springs between them.
fn chain() -> String {
    let mut text = format!(
        "model chain {{ const n = {BLOCKS}; param w = 1.3;
           param m[n] = [0.4 + 0.01*i for i in 1..n]; param mu[n] = [0.2 + 0.005*i for i in 1..n];
           param d[n] = [0.05 + 0.002*i for i in 1..n]; param f[n] = [2 + 0.1*i for i in 1..n];
           param c[n - 1] = [20 + i for i in 1..n-1];
           state q[n] = zeros(n); state v[n] = [sin(i) for i in 1..n];
           q' = v;\n"
    );
    for i in 1..=BLOCKS {
        let ahead = match i < BLOCKS {
            true => format!("c[{i}]*(q[{}] - q[{i}])", i + 1),
            false => "0".to_owned(),
        };
        let behind = match i > 1 {
            true => format!("c[{}]*(q[{i}] - q[{}])", i - 1, i - 1),
            false => "0".to_owned(),
        };
        let _ = writeln!(
            text,
            "v[{i}]' = ({ahead} - {behind} - d[{i}]*v[{i}] + f[{i}]*sin(w*time + {i}))/m[{i}] - 9.81*mu[{i}]*sign(v[{i}]);"
        );
    }
    text + "}\nsimulate bench of chain { horizon 5; }"
}

/// x' = A x with a symmetric matrix, and the derivatives of weights·x(T) by its entries: with A = Σ d v vᵀ they are
/// Σ_kl (w·v_k) v_k φ(d_k, d_l) v_lᵀ (v_l·x(0)), φ being the slope of e^{dT} between d_k and d_l.
fn linear() -> (String, Vec<f64>) {
    const HORIZON: f64 = 3.0;
    let entry = |i: usize, j: usize| {
        let own = if i == j { -0.3 - 0.1 * i as f64 } else { 0.0 };
        own + 0.2 * ((i + 1) as f64 * (j + 1) as f64).cos()
    };
    let matrix = DMatrix::from_fn(LINEAR, LINEAR, entry);
    let x0 = DVector::from_fn(LINEAR, |i, _| 1.0 + 0.1 * i as f64);
    let rows = (0..LINEAR).map(|i| {
        let row: Vec<String> = (0..LINEAR).map(|j| format!("{:?}", entry(i, j))).collect();
        row.join(", ")
    });
    let rows: Vec<String> = rows.collect();
    let text = format!(
        "model linear {{ param A[{LINEAR},{LINEAR}] = [{}]; state x[{LINEAR}] = {:?}; x' = A*x; }}
         simulate bench of linear {{ horizon {HORIZON}; }}",
        rows.join("; "),
        x0.as_slice(),
    );
    let SymmetricEigen {
        eigenvectors: v,
        eigenvalues: d,
    } = SymmetricEigen::new(matrix);
    let w = DVector::from_fn(LINEAR, |i, _| weight(i));
    let (of_w, of_x) = (v.transpose() * w, v.transpose() * x0);
    let phi = |k: usize, l: usize| match (d[k] - d[l]).abs() < 1e-9 {
        true => HORIZON * (d[k] * HORIZON).exp(),
        false => ((d[k] * HORIZON).exp() - (d[l] * HORIZON).exp()) / (d[k] - d[l]),
    };
    let middle = DMatrix::from_fn(LINEAR, LINEAR, |k, l| of_w[k] * phi(k, l) * of_x[l]);
    let exact = &v * middle * v.transpose();
    let entries = (0..LINEAR).flat_map(|i| (0..LINEAR).map(move |j| (i, j)));
    (text, entries.map(|at| exact[at]).collect())
}
