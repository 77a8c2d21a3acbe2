//! Time to reach an error: the oscillator of the FESD literature, in process, after compilation.
//!
//! The same run by a peer stands beside it when `NSDC_PEER_PYTHON` names a Python with its packages
//! and the peers' script is found; otherwise that part is skipped with a message.

use std::f64::consts::PI;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use criterion::Criterion;
use nsd_solver::simulate::{Event, Observer, Segment, Settings, Simulator, Status};
use nsd_tests::with_experiment;
use nsdc::simulate::Switched;

const OSCILLATOR: &str = include_str!("../../examples/oscillator.nsd");

/// The peers' script, beside a checkout that has the shared benchmarks.
const PEER_SCRIPT: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../shared/benchmarks/peers/a_oscillator_ode.py"
);

/// Errors asked for, with the loosest tolerance that reaches them.
const ERRORS: [f64; 3] = [1e-6, 1e-9, 1e-12];

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let rows = with_experiment(OSCILLATOR, "crossing", |compiled| {
        let switched = Switched::new(&compiled.system);
        let x0: Vec<f64> = compiled
            .system
            .states
            .iter()
            .map(|state| state.initial)
            .collect();
        ERRORS.map(|error| {
            let tolerance = loosest(&switched, &x0, error);
            let mut simulator = Simulator::new(&switched, settings(tolerance));
            criterion.bench_function(&format!("oscillator, error {error:.0e}"), |bencher| {
                bencher.iter(|| black_box(simulator.run(0.0, PI / 2.0, &x0, &mut Silent)));
            });
            let reached = distance(&simulator.run(0.0, PI / 2.0, &x0, &mut Silent).x);
            (
                error,
                reached,
                median(|| {
                    black_box(simulator.run(0.0, PI / 2.0, &x0, &mut Silent));
                }),
            )
        })
    });
    compare(&rows);
    criterion.final_summary();
}

fn settings(tolerance: f64) -> Settings {
    Settings {
        tolerance,
        ..Settings::default()
    }
}

/// The loosest tolerance 10^-k whose run, and that of every tighter one, stays within the error.
fn loosest(system: &Switched, x0: &[f64], error: f64) -> f64 {
    let within = |tolerance: f64| {
        let outcome =
            Simulator::new(system, settings(tolerance)).run(0.0, PI / 2.0, x0, &mut Silent);
        outcome.status == Status::Solved && distance(&outcome.x) <= error
    };
    let mut tightest_first = (2..=14).rev().map(|k| 10.0_f64.powi(-k));
    let failing = tightest_first.find(|&tolerance| !within(tolerance));
    failing.map_or(1e-2, |tolerance| 0.1 * tolerance)
}

/// Distance from the exact final state, in the 2-norm.
fn distance(x: &[f64]) -> f64 {
    let (radius, angle) = ((PI / 2.0 - 1.0).exp(), 2.0 * PI * (PI / 2.0 - 1.0));
    (x[0] - radius * angle.cos()).hypot(x[1] - radius * angle.sin())
}

/// Median seconds of a call, over batches.
fn median(mut call: impl FnMut()) -> f64 {
    const BATCH: usize = 200;
    let mut times: Vec<f64> = (0..31)
        .map(|_| {
            let started = Instant::now();
            (0..BATCH).for_each(|_| call());
            started.elapsed().as_secs_f64() / BATCH as f64
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// Prints our times beside the cheapest run of each peer that reaches the error.
#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn compare(rows: &[(f64, f64, f64)]) {
    println!(
        "\n{:>8} {:>11} {:>11}  solver",
        "error", "reached", "time (us)"
    );
    for (error, reached, seconds) in rows {
        println!(
            "{error:>8.0e} {reached:>11.1e} {:>11.2}  nsdc",
            seconds * 1e6
        );
    }
    let Ok(python) = std::env::var("NSDC_PEER_PYTHON") else {
        println!("peers skipped: NSDC_PEER_PYTHON names no Python with their packages");
        return;
    };
    if !Path::new(PEER_SCRIPT).is_file() {
        println!("peers skipped: their script is not beside this checkout");
        return;
    }
    let results = std::env::temp_dir().join(format!("nsdc-peers-{}", std::process::id()));
    let status = Command::new(python)
        .arg(PEER_SCRIPT)
        .arg(&results)
        .current_dir(Path::new(PEER_SCRIPT).parent().unwrap_or(Path::new(".")))
        .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
        .output();
    match status {
        Ok(output) if output.status.success() => print_peers(&results.join("a_ode.json")),
        Ok(output) => println!("peers failed: {}", String::from_utf8_lossy(&output.stderr)),
        Err(error) => println!("peers failed: {error}"),
    }
    let _ = std::fs::remove_dir_all(results);
}

#[allow(clippy::print_stdout, reason = "a benchmark prints its table")]
fn print_peers(path: &Path) {
    let rows = std::fs::read_to_string(path)
        .ok()
        .and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok());
    let rows = rows.as_ref().and_then(|json| json["rows"].as_array());
    let Some(rows) = rows else {
        println!("peers failed: no results in {}", path.display());
        return;
    };
    for error in ERRORS {
        for solver in ["pydiffsol", "sksundae-CVODE", "scipy"] {
            let of_solver = |row: &&serde_json::Value| {
                row["solver"] == solver
                    && row["mode"] == "events"
                    && row["err"].as_f64().is_some_and(|e| e <= error)
            };
            let seconds = |row: &serde_json::Value| row["t"].as_f64().unwrap_or(f64::INFINITY);
            let cheapest = rows
                .iter()
                .filter(of_solver)
                .min_by(|a, b| seconds(a).total_cmp(&seconds(b)));
            match cheapest {
                Some(row) => println!(
                    "{error:>8.0e} {:>11.1e} {:>11.2}  {solver} {}",
                    row["err"].as_f64().unwrap_or(f64::NAN),
                    seconds(row) * 1e6,
                    row["method"].as_str().unwrap_or("")
                ),
                None => println!("{error:>8.0e} {:>11} {:>11}  {solver}", "-", "never"),
            }
        }
    }
}

/// Keeps nothing.
struct Silent;

impl Observer for Silent {
    fn segment(&mut self, _: &Segment) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn event(&mut self, _: &Event) {}
}
