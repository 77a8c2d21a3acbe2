//! Problems from .nl files: read, solved and reported.
//!
//! The only stage that starts from a program instead of a model. What comes out is a [`Report`] in the terms of the
//! file: its rows, its variables, its sense.

mod ampl;
mod benchmark;
mod error;
mod json;
mod starts;
mod text;

use nsd_solver::optimization::nl::{Code, Named, Problem, Quality};
use nsd_solver::optimization::{mpcc, nl};

pub use ampl::{BadOption, Settings, tolerance};
pub use benchmark::{Known, Peer, Record, Table, read_known};
pub use error::NlError;
pub use json::write as json;
pub use text::{message, write as text};

use crate::diagnostics::Diagnostics;
use crate::limit::Over;
use crate::project::clock::Instant;
use crate::report::{Certificate, Stationarity, Stats, Status};
use crate::source::SourceMap;

/// Larger files are not read.
pub const MAX_BYTES: usize = 256 << 20;

/// What came of solving a problem, in the order of the language reference.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// The name of the file without folder and extension.
    #[serde(skip)]
    pub problem: String,
    /// How it ended.
    pub status: Status,
    /// Whether the point is feasible and complementary, stationary or not.
    #[serde(skip)]
    pub is_feasible: bool,
    /// In the sense of the file.
    pub objective: f64,
    /// Sizes of the file.
    #[serde(flatten)]
    pub sizes: nl::Sizes,
    /// Whether more is better.
    #[serde(skip)]
    pub is_maximized: bool,
    /// What the point is worth.
    #[serde(flatten)]
    pub quality: Quality,
    /// The name of the row or variable where the violation is largest.
    #[serde(skip)]
    pub worst: Option<String>,
    /// What it took.
    pub stats: Stats,
    /// What is known of the point.
    pub certificate: Certificate,
    /// The point.
    #[serde(flatten)]
    pub point: Point,
    /// The solution file of AMPL.
    #[serde(skip)]
    pub solution_file: String,
}

/// A point of a problem.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Point {
    /// Names of the variables, where there is a file with one for each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// The variables of the file.
    pub x: Vec<f64>,
}

/// Names of rows and variables, as far as there are files with them.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Of the rows.
    pub rows: Vec<String>,
    /// Of the variables.
    pub variables: Vec<String>,
}

/// Reads a file; what is wrong with it goes to the diagnostics.
pub fn read(
    name: &str,
    bytes: Vec<u8>,
    sources: &mut SourceMap,
    diags: &mut Diagnostics,
) -> Option<Problem> {
    match nl::read(&bytes) {
        Ok(problem) => Some(problem),
        Err(error) => {
            // Binary files cannot be shown.
            let source = match error.place {
                nl::Place::Line(_) => Some(sources.add_bytes(name, bytes)),
                nl::Place::Byte(_) => None,
            };
            diags.push(NlError::new(error, source.as_deref()));
            None
        }
    }
}

/// Solves a problem; `read_s` are the seconds that reading it took, and the observer sees every iteration.
pub fn solve(
    name: &str,
    problem: &mut Problem,
    names: &Names,
    settings: &Settings,
    read_s: f64,
    observer: &mut dyn mpcc::Observer,
) -> Report {
    let clock = Instant::now();
    let mut options = mpcc::Options {
        limit: settings.time_limit.into(),
        ..mpcc::Options::default()
    };
    if let Some(tolerance) = settings.tolerance {
        options.tolerance = tolerance;
    }
    let solution = starts::solve(&mut problem.program, settings.starts, &options, observer);
    let solve_s = clock.elapsed().as_secs_f64();
    let quality = problem.quality(&solution.w);
    let (status, code) = outcome(solution.status);
    let worst = quality.worst.map(|worst| match worst {
        Named::Row(row) => names.rows.get(row).cloned().unwrap_or(format!("row {row}")),
        Named::Variable(i) => names
            .variables
            .get(i)
            .cloned()
            .unwrap_or(format!("variable {i}")),
    });
    let objective = problem.objective(solution.objective);
    let mut report = Report {
        problem: name.to_owned(),
        status,
        is_feasible: solution.is_feasible(),
        objective,
        sizes: problem.sizes,
        is_maximized: problem.sense == nl::Sense::Maximize,
        quality,
        worst,
        stats: Stats {
            compile_s: read_s,
            solve_s,
            newton_iterations: solution.stats.iterations as u64,
            homotopy_steps: solution.stats.relaxed as u64,
            complementarity_residual: quality.complementarity_min,
            ..Stats::default()
        },
        certificate: Certificate {
            stationarity: Stationarity::of(solution.class, solution.b_stationary),
            max_violation: quality.violation.max(quality.complementarity_min),
        },
        point: Point {
            names: match names.variables.len() == problem.sizes.variables {
                true => names.variables.clone(),
                false => Vec::new(),
            },
            x: solution.w[..problem.sizes.variables].to_vec(),
        },
        solution_file: String::new(),
    };
    let message = message(&report);
    report.solution_file =
        problem.solution_file(&message, &solution.w, &solution.multipliers.rows, code);
    report
}

/// The word of the language, and the number for AMPL.
fn outcome(status: mpcc::Status) -> (Status, Code) {
    match status {
        mpcc::Status::Solved => (Status::Solved, Code::Solved),
        mpcc::Status::Feasible => (Status::Feasible, Code::Uncertain),
        mpcc::Status::LocallyInfeasible => (Status::LocallyInfeasible, Code::Infeasible),
        mpcc::Status::Unbounded => (Status::Unbounded, Code::Unbounded),
        mpcc::Status::IterationLimit => (Status::IterationLimit, Code::IterationLimit),
        mpcc::Status::Over(Over::TimeLimit) => (Status::TimeLimit, Code::TimeLimit),
        mpcc::Status::Over(Over::Canceled) => (Status::Canceled, Code::Interrupted),
        mpcc::Status::Evaluation | mpcc::Status::NumericalFailure => {
            (Status::NumericalFailure, Code::Failure)
        }
    }
}
