//! Every .nl file of a folder of benchmarks: it can be read, and derivatives agree with differences.
//!
//! The folder is named by the environment variable `NSD_BENCHMARKS`; the files are data of others.

use std::path::PathBuf;

use nsd_solver::optimization::nl;
use nsd_solver::optimization::nl::Problem;
use nsd_solver::optimization::problem::{Nlp, Pattern};

/// The files, or none with a message.
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn files() -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os("NSD_BENCHMARKS") else {
        eprintln!("skipped: NSD_BENCHMARKS names no folder");
        return Vec::new();
    };
    let mut folders = vec![PathBuf::from(folder)];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the folder can be read") {
            let path = entry.expect("the folder can be read").path();
            match path.extension() {
                _ if path.is_dir() => folders.push(path),
                Some(extension) if extension == "nl" => files.push(path),
                _ => {}
            }
        }
    }
    files.sort();
    files
}

/// A point near the start where things are not special.
fn point(problem: &Problem) -> Vec<f64> {
    let start = problem.program.start().iter().enumerate();
    start
        .map(|(i, x)| x + 0.3 + 0.1 * (i as f64).sin())
        .collect()
}

/// f and c, and the directional derivatives of f, c and of the gradient of f + yᵀc along d, all at w.
struct Along {
    values: Vec<f64>,
    lagrangian: Vec<f64>,
    slopes: Vec<f64>,
    curvature: Vec<f64>,
}

fn along(problem: &mut Problem, w: &[f64], d: &[f64], y: &[f64]) -> Along {
    let program = &mut problem.program;
    let (n, m) = (program.n_variables(), program.n_rows());
    let jacobian = program.jacobian_pattern().clone();
    let hessian = program.hessian_pattern().clone();
    let mut values = vec![0.0; m];
    program.rows(w, &mut values);
    values.push(program.objective(w));
    let mut lagrangian = vec![0.0; n];
    program.gradient(w, &mut lagrangian);
    let mut entries = vec![0.0; jacobian.n_entries()];
    program.jacobian(w, &mut entries);
    let mut slopes = vec![0.0; m];
    slopes.push(lagrangian.iter().zip(d).map(|(g, d)| g * d).sum());
    for (row, column, entry) in triplets(&jacobian, &entries) {
        slopes[row] += entry * d[column];
        lagrangian[column] += entry * y[row];
    }
    let mut entries = vec![0.0; hessian.n_entries()];
    program.hessian(w, 1.0, y, &mut entries);
    let mut curvature = vec![0.0; n];
    for (row, column, entry) in triplets(&hessian, &entries) {
        curvature[row] += entry * d[column];
        if column != row {
            curvature[column] += entry * d[row];
        }
    }
    Along {
        values,
        lagrangian,
        slopes,
        curvature,
    }
}

/// Rows, columns and values.
fn triplets(pattern: &Pattern, entries: &[f64]) -> Vec<(usize, usize, f64)> {
    let rows = (0..pattern.n_rows()).flat_map(|row| vec![row; pattern.row(row).len()]);
    let columns = pattern.columns.iter().map(|&column| column as usize);
    let triplets = rows.zip(columns).zip(entries);
    triplets
        .map(|((row, column), &entry)| (row, column, entry))
        .collect()
}

/// Finite values agree with central differences; the others are counted.
fn agree(what: &str, exact: &[f64], [below, above]: [&[f64]; 2], h: f64) -> usize {
    let mut n_infinite = 0;
    for (i, exact) in exact.iter().enumerate() {
        let difference = (above[i] - below[i]) / (2.0 * h);
        if !(exact.is_finite() && difference.is_finite()) {
            n_infinite += 1;
            continue;
        }
        // Rounding of the values, and a generous bound for their third derivatives.
        let rounding = 1e-15 * (above[i].abs() + below[i].abs()) / h;
        let error = (exact - difference).abs();
        assert!(
            error <= 1e-5 * (1.0 + exact.abs()) + 10.0 * rounding,
            "{what} {i}: {exact} is not {difference}"
        );
    }
    n_infinite
}

#[test]
fn derivatives_of_all_files_agree_with_differences() {
    for file in files() {
        let name = file.display().to_string();
        let bytes = std::fs::read(&file).expect("the file can be read");
        let mut problem = nl::read(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        let w = point(&problem);
        let direction = |i: usize| ((i * 7919) as f64).sin();
        let d: Vec<f64> = (0..w.len()).map(direction).collect();
        let y: Vec<f64> = (0..problem.program.n_rows())
            .map(|i| direction(i + 3))
            .collect();
        let h = 1e-5;
        let moved =
            |sign: f64| -> Vec<f64> { w.iter().zip(&d).map(|(w, d)| w + sign * h * d).collect() };
        let at = along(&mut problem, &w, &d, &y);
        let [below, above] = [-1.0, 1.0].map(|sign| along(&mut problem, &moved(sign), &d, &y));
        let values = [&below.values[..], &above.values];
        let gradients = [&below.lagrangian[..], &above.lagrangian];
        let mut infinite = agree(&format!("{name}: slope"), &at.slopes, values, h);
        infinite += agree(&format!("{name}: curvature"), &at.curvature, gradients, h);
        assert!(
            infinite * 2 < at.slopes.len() + at.curvature.len(),
            "{name}"
        );
    }
}
