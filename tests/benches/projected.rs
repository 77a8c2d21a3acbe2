//! Projected dynamics and a rectifier beside Siconos and nosnoc, at equal error.
//!
//! Every run of every solver is a point (error, time). The time for an error is that on the front of
//! a solver's points, interpolated in logarithms, so that nobody is charged for a coarse choice of
//! steps.

#[path = "support/peers.rs"]
mod peers;
#[path = "support/records.rs"]
mod records;
mod support;

use std::f64::consts::PI;
use std::hint::black_box;

use criterion::Criterion;
use nalgebra::{DMatrix, DVector};
use nsd_solver::hybrid::Status;
use nsd_tests::with_experiment;
use nsdc::Compiled;
use nsdc::lowering::hybrid;
use peers::{Row, Script};
use records::record;
use serde_json::{Value, json};
use support::{Silent, median, print, simulator, start};

const DISC: &str = include_str!("../../examples/projected.nsd");
const BRIDGE: &str = include_str!("../../examples/rectifier.nsd");

/// Turns clockwise with radius 2 down to x₂ = -1, along it to (0, -1), and on with radius 1.
const TURN: &str = "model turn {
  state x[2] = [sqrt(2), sqrt(2)];
  x' = [x[2], -x[1]];
  project x onto { x[2] + 1 >= 0; }
}";

/// Those that are compared, with where they are.
const SCRIPTS: [Script<'_>; 2] = [
    Script {
        file: "projected_siconos.py",
        python: "NSDC_SICONOS_PYTHON",
    },
    Script::new("projected.py"),
];

/// Errors in the final state, in the 2-norm.
const ERRORS: [f64; 3] = [1e-4, 1e-6, 1e-8];

/// Less than this is to be seen at the second error.
const BAR: f64 = 10.0;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let turn = 11.0 * PI / 12.0 + 3.0_f64.sqrt();
    for (name, model, text, horizon, exact) in [
        ("disc", "disc", DISC, 4.0, disc(4.0)),
        ("turn", "turn", TURN, turn, [-1.0, 0.0]),
        ("bridge", "bridge", BRIDGE, 5e-3, bridge(5e-3)),
    ] {
        let text = format!("{text}\nsimulate bench of {model} {{ horizon {horizon:?}; }}");
        with_experiment(&text, "bench", |compiled| {
            compare(name, compiled, &exact, &mut criterion);
        });
    }
    criterion.final_summary();
}

/// Prints the time of each solver for each error.
fn compare(name: &str, compiled: &Compiled<'_>, exact: &[f64], criterion: &mut Criterion) {
    let ours = ours(name, compiled, exact, criterion);
    let data = json!({ "problem": name, "R": 1e3, "L": 1e-2, "C": 1e-6 });
    let of_script = |script: &Script<'_>| peers::run(script, compiled, exact, Value::clone(&data));
    let others: Vec<Row> = SCRIPTS.iter().flat_map(of_script).collect();
    let mut solvers: Vec<&str> = others.iter().map(solver).collect();
    solvers.dedup();
    print(&format!(
        "\n{name}\n{:>8} {:>12} {:>8}  solver",
        "error", "time (us)", "ratio"
    ));
    for error in ERRORS {
        let own = time_for(error, ours.iter());
        let mut least = f64::INFINITY;
        for solver_name in ["nsdc"].iter().chain(&solvers) {
            let rows = ours.iter().chain(&others);
            let time = time_for(error, rows.filter(|row| solver(row) == *solver_name));
            let note = |seconds: Value, ratio: Value| {
                record(
                    "peers",
                    &[
                        ("problem", json!(name)),
                        ("error", json!(error)),
                        ("solver", json!(solver_name)),
                        ("seconds", seconds),
                        ("to nsdc", ratio),
                    ],
                );
            };
            let (Some(own), Some(time)) = (own, time) else {
                let (time, ratio) = ("never", "");
                print(&format!(
                    "{error:>8.0e} {time:>12} {ratio:>8}  {solver_name}"
                ));
                note(json!(time), json!("-"));
                continue;
            };
            let ratio = time / own;
            if *solver_name != "nsdc" {
                least = least.min(ratio);
            }
            print(&format!(
                "{error:>8.0e} {:>12.2} {ratio:>8.1}  {solver_name}",
                1e6 * time
            ));
            note(json!(time), json!(ratio));
        }
        if error == ERRORS[1] && least.is_finite() {
            print(&format!(
                "the better of the others takes {least:.0} times as long, bar {BAR}"
            ));
        }
    }
}

/// Runs from event to event at the tolerances 10^-k.
fn ours(name: &str, compiled: &Compiled<'_>, exact: &[f64], criterion: &mut Criterion) -> Vec<Row> {
    let hybrid = hybrid::lower(&compiled.system);
    let (horizon, x0) = (compiled.settings.horizon, start(compiled));
    let mut rows = Vec::new();
    for k in 2..=13 {
        let mut simulator = simulator(&hybrid, 10.0_f64.powi(-k));
        let outcome = simulator.run(0.0, horizon, &x0, &mut Silent);
        if outcome.status != Status::Solved {
            continue;
        }
        let error = exact.iter().zip(&outcome.x).map(|(a, b)| (a - b).powi(2));
        let mut call = || {
            black_box(simulator.run(0.0, horizon, &x0, &mut Silent));
        };
        rows.push(Row {
            solver: "nsdc".into(),
            error: error.sum::<f64>().sqrt(),
            seconds: median(&mut call),
        });
        if k == 6 {
            criterion.bench_function(&format!("{name}, tolerance 1e-6"), |bencher| {
                bencher.iter(&mut call);
            });
        }
    }
    rows
}

fn solver(row: &Row) -> &str {
    row.solver.split(' ').next().unwrap_or_default()
}

/// Seconds for an error: between the quickest run that reaches it and the most accurate of the
/// quicker ones, on a line in logarithms. Nothing where no run reaches it.
fn time_for<'r>(error: f64, rows: impl Iterator<Item = &'r Row> + Clone) -> Option<f64> {
    let reaching = rows.clone().filter(|row| row.error <= error);
    let above = reaching.min_by(|a, b| a.seconds.total_cmp(&b.seconds))?;
    let quicker = rows.filter(|row| row.seconds < above.seconds);
    let Some(below) = quicker.min_by(|a, b| a.error.total_cmp(&b.error)) else {
        return Some(above.seconds);
    };
    let share =
        (below.error / error).ln() / (below.error / above.error.max(f64::MIN_POSITIVE)).ln();
    Some(below.seconds * (above.seconds / below.seconds).powf(share))
}

/// The final state on the disc: an affine system up to the boundary, then the angle with
/// φ' = -1 - sin φ - sin(2φ)/10, by the classical Runge-Kutta method in steps whose errors are below
/// rounding.
fn disc(horizon: f64) -> [f64; 2] {
    // x' = x₂ + 1, -x₁ - x₂/5, and a row for the 1
    let field = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 1.0, -1.0, -0.2, 0.0, 0.0, 0.0, 0.0]);
    let z0 = DVector::from_row_slice(&[0.0, 0.5, 1.0]);
    let inside = |t: f64| (&field * t).exp() * &z0;
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        let z = inside(middle);
        if z[0].hypot(z[1]) < 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    let z = inside(low);
    let rate = |angle: f64| -1.0 - angle.sin() - 0.1 * (2.0 * angle).sin();
    const STEPS: u32 = 20_000;
    let h = (horizon - low) / f64::from(STEPS);
    let angle = (0..STEPS).fold(z[1].atan2(z[0]), |angle, _| {
        let k1 = rate(angle);
        let k2 = rate(angle + 0.5 * h * k1);
        let k3 = rate(angle + 0.5 * h * k2);
        let k4 = rate(angle + h * k3);
        angle + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    });
    [angle.cos(), angle.sin()]
}

/// The final state of the circuit, damped by its resistor: v'' + v'/(RC) + v/(LC) = 0 from 10 V.
fn bridge(t: f64) -> [f64; 2] {
    let decay = 500.0;
    let omega = (1e8_f64 - decay * decay).sqrt();
    let size = 10.0 * (-decay * t).exp();
    let (sin, cos) = (omega * t).sin_cos();
    [
        size * (cos - decay / omega * sin),
        size * sin / (omega * 1e-2),
    ]
}
