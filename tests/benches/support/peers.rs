//! What other solvers take, measured by a script.

use std::process::Command;

use nsdc::Compiled;
use serde_json::Value;

use crate::support::{print, start};

/// A script in `peers/` for other solvers.
pub struct Script<'a> {
    pub file: &'a str,
    /// The environment variable that names a Python interpreter with them.
    pub python: &'a str,
}

impl<'a> Script<'a> {
    /// For the interpreter that all benchmarks use.
    pub const fn new(file: &'a str) -> Self {
        Self {
            file,
            python: "NSDC_PEER_PYTHON",
        }
    }
}

/// One way to reach an error.
pub struct Row {
    pub solver: String,
    pub error: f64,
    pub seconds: f64,
}

/// What a script measures on a run whose final state is known; nothing, with a message,
/// without an interpreter. `data` is what the script must know besides.
pub fn run(script: &Script<'_>, compiled: &Compiled, exact: &[f64], mut data: Value) -> Vec<Row> {
    let Ok(python) = std::env::var(script.python) else {
        print(&format!(
            "{} skipped: {} names no Python with their packages",
            script.file, script.python
        ));
        return Vec::new();
    };
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers");
    data["start"] = start(compiled).into();
    data["horizon"] = compiled.settings.horizon.into();
    data["exact"] = exact.into();
    let output = Command::new(python)
        .args([script.file, &data.to_string()])
        .current_dir(folder)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .envs([("OMP_NUM_THREADS", "1"), ("OPENBLAS_NUM_THREADS", "1")])
        .output();
    let output = match output {
        Ok(output) => output,
        Err(error) => {
            print(&format!("peers skipped: {error}"));
            return Vec::new();
        }
    };
    print(String::from_utf8_lossy(&output.stderr).trim_end());
    let text = String::from_utf8_lossy(&output.stdout);
    let rows = text.lines().filter_map(|line| {
        let row: Value = serde_json::from_str(line).ok()?;
        let word = |key: &str| row[key].as_str().unwrap_or_default().to_owned();
        Some(Row {
            solver: format!("{} {}", word("solver"), word("method")),
            error: row["error"].as_f64()?,
            seconds: row["seconds"].as_f64()?,
        })
    });
    rows.collect()
}
