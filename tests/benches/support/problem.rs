//! Time to reach an error, ours beside that of other solvers.

#[path = "peers.rs"]
mod peers;
#[path = "records.rs"]
mod records;

use std::hint::black_box;
use std::sync::Arc;

use criterion::Criterion;
use nsd_solver::hybrid::{HybridSystem, Status};
use nsdc::Compiled;
use nsdc::lowering::hybrid;
use serde_json::{Value, json};

use peers::{Row, Script};
use records::record;

use crate::support::{Silent, median, print, simulator, start};

/// A run whose final state is known.
pub struct Problem<'a> {
    pub name: &'a str,
    pub compiled: &'a Compiled<'a>,
    pub exact: Vec<f64>,
    /// Errors asked for, in the 2-norm of the final state.
    pub errors: &'a [f64],
    /// A script in `peers/`, and what it must know besides start, horizon and final state.
    pub script: &'a str,
    pub data: Value,
}

impl Problem<'_> {
    /// Measures, and prints the cheapest run of each solver for each error.
    pub fn compare(&self, criterion: &mut Criterion) {
        let hybrid = hybrid::lower(&self.compiled.system);
        let ours = self.ours(&hybrid, criterion);
        let peers = peers::run(
            &Script::new(self.script),
            self.compiled,
            &self.exact,
            self.data.clone(),
        );
        print(&format!(
            "\n{}\n{:>8} {:>11} {:>12} {:>8}  solver",
            self.name, "error", "reached", "time (us)", "ratio"
        ));
        for (&error, own) in self.errors.iter().zip(&ours) {
            let Some(own) = own else {
                self.never(error, "nsdc");
                continue;
            };
            self.line(error, own, 1.0);
            let mut solvers: Vec<&str> = peers.iter().map(|row| first_word(&row.solver)).collect();
            solvers.dedup();
            for solver in solvers {
                let of_solver =
                    |row: &&Row| first_word(&row.solver) == solver && row.error <= error;
                let cheapest = peers.iter().filter(of_solver);
                match cheapest.min_by(|a, b| a.seconds.total_cmp(&b.seconds)) {
                    Some(row) => self.line(error, row, row.seconds / own.seconds),
                    None => self.never(error, solver),
                }
            }
        }
    }

    fn line(&self, error: f64, row: &Row, ratio: f64) {
        print(&format!(
            "{error:>8.0e} {:>11.1e} {:>12.2} {ratio:>8.1}  {}",
            row.error,
            row.seconds * 1e6,
            row.solver
        ));
        let measured = [json!(row.error), json!(row.seconds), json!(ratio)];
        self.record(error, &row.solver, measured);
    }

    /// A solver that reaches an error at no tolerance.
    fn never(&self, error: f64, solver: &str) {
        print(&format!(
            "{error:>8.0e} {:>11} {:>12} {:>8}  {solver}",
            "-", "never", ""
        ));
        self.record(error, solver, [json!("-"), json!("never"), json!("-")]);
    }

    fn record(&self, error: f64, solver: &str, [reached, seconds, ratio]: [Value; 3]) {
        record(
            "peers",
            &[
                ("problem", json!(self.name)),
                ("error", json!(error)),
                ("solver", json!(solver)),
                ("reached", reached),
                ("seconds", seconds),
                ("to nsdc", ratio),
            ],
        );
    }

    /// Our cheapest run for each error, over the tolerances 10^-k.
    fn ours(&self, hybrid: &Arc<HybridSystem>, criterion: &mut Criterion) -> Vec<Option<Row>> {
        let (horizon, x0) = (self.compiled.settings.horizon, start(self.compiled));
        let mut runs: Vec<(Row, f64)> = Vec::new();
        for k in 2..=14 {
            let tolerance = 10.0_f64.powi(-k);
            let mut simulator = simulator(hybrid, tolerance);
            let outcome = simulator.run(0.0, horizon, &x0, &mut Silent);
            let row = Row {
                solver: "nsdc".into(),
                error: distance(&outcome.x, &self.exact),
                seconds: median(|| {
                    black_box(simulator.run(0.0, horizon, &x0, &mut Silent));
                }),
            };
            if outcome.status == Status::Solved {
                runs.push((row, tolerance));
            }
        }
        let cheapest = |&error: &f64| {
            let reaching = runs.iter().filter(|(row, _)| row.error <= error);
            let (row, tolerance) =
                reaching.min_by(|(a, _), (b, _)| a.seconds.total_cmp(&b.seconds))?;
            let mut simulator = simulator(hybrid, *tolerance);
            let label = format!("{}, error {error:.0e}", self.name);
            criterion.bench_function(&label, |bencher| {
                bencher.iter(|| black_box(simulator.run(0.0, horizon, &x0, &mut Silent)));
            });
            Some(Row {
                solver: format!("nsdc, tolerance {tolerance:.0e}"),
                error: row.error,
                seconds: row.seconds,
            })
        };
        self.errors.iter().map(cheapest).collect()
    }
}

fn first_word(text: &str) -> &str {
    text.split([' ', ',']).next().unwrap_or(text)
}

/// Distance in the 2-norm.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}
