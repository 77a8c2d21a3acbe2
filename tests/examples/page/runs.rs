//! What the benches record, as tables and figures.

use std::fs;
use std::path::Path;
use std::process::Command;

use nsdc::report::plot::{Curve, LogLog};
use serde_json::Value;

use super::format::{Row, number, table, word};
use super::{figure, print, repository};

/// Runs benches, and gives the rows that they record in a table.
fn rows_of(benches: &[&str], name: &str) -> Vec<Row> {
    let file = std::env::temp_dir().join(format!("nsdc-{name}.records"));
    let _ = fs::remove_file(&file);
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    for bench in benches {
        print(&format!("bench {bench}"));
        let run = Command::new(&cargo)
            .args(["bench", "-p", "nsd-tests", "--bench", bench])
            .current_dir(repository("."))
            .env("NSDC_BENCH_RECORDS", &file)
            .status();
        if !run.is_ok_and(|status| status.success()) {
            print(&format!("bench {bench} failed"));
        }
    }
    let text = fs::read_to_string(&file).unwrap_or_default();
    let rows = text.lines().filter_map(|line| {
        let record: Value = serde_json::from_str(line).ok()?;
        let pairs = record["row"].as_array()?.iter();
        let of_table = record["table"] == name;
        let row = pairs.filter_map(|pair| Some((pair[0].as_str()?.to_owned(), pair[1].clone())));
        of_table.then(|| row.collect())
    });
    rows.collect()
}

/// Different words of a column, in order.
fn words<'r>(rows: &'r [Row], column: &str) -> Vec<&'r str> {
    let mut found = Vec::new();
    for row in rows {
        if !found.contains(&word(row, column)) {
            found.push(word(row, column));
        }
    }
    found
}

fn first_word(text: &str) -> &str {
    text.split([' ', ',']).next().unwrap_or(text)
}

/// A curve over the rows that are taken.
fn curve(name: &str, place: (usize, usize), points: Vec<(f64, f64)>) -> Curve {
    Curve {
        name: name.to_owned(),
        remark: String::new(),
        place,
        points,
    }
}

/// Time to reach an error, for every problem and solver.
pub fn peers(figures: &Path) -> String {
    let rows = rows_of(
        &["oscillator", "belt", "chain", "stiff", "projected"],
        "peers",
    );
    let mut text = String::from(
        "The cheapest run of each solver that reaches an error in the final state, compilation left out.\n\
         The last column is its time over that of nsdc; solvers that are not installed have no rows.\n",
    );
    for problem in words(&rows, "problem") {
        let own: Vec<Row> = rows
            .iter()
            .filter(|row| word(row, "problem") == problem)
            .cloned()
            .collect();
        let mut solvers: Vec<&str> = own
            .iter()
            .map(|row| first_word(word(row, "solver")))
            .collect();
        solvers.sort_unstable();
        solvers.dedup();
        let points = |solver: &str| {
            let of_solver = own
                .iter()
                .filter(|row| first_word(word(row, "solver")) == solver);
            of_solver
                .filter_map(|row| Some((number(row, "seconds")?, number(row, "error")?)))
                .collect()
        };
        let curves = solvers.iter().enumerate();
        let svg = LogLog {
            x_title: "time in s",
            y_title: "error in the final state",
            curves: curves
                .map(|(k, solver)| curve(solver, (k, 0), points(solver)))
                .collect(),
            floor: 0.0,
        };
        let shown = figure(figures, &format!("peers-{problem}"), problem, &svg.write());
        text.push_str(&format!("\n### {problem}\n\n{shown}\n{}", table(&own)));
    }
    text
}

/// Objectives, certificates and times.
pub fn optimal(figures: &Path) -> String {
    let rows = rows_of(&["optimal"], "optimal");
    let problems = words(&rows, "problem");
    let best = |problem: &str| {
        let own = rows.iter().filter(|row| word(row, "problem") == problem);
        own.filter_map(|row| number(row, "objective"))
            .fold(f64::INFINITY, f64::min)
    };
    let points = |solver: &str| {
        let own = rows.iter().filter(|row| word(row, "solver") == solver);
        own.filter_map(|row| {
            let best = best(word(row, "problem"));
            // What is equal has a place in the figure, too.
            let above = (number(row, "objective")? - best) / best.abs().max(1.0);
            Some((number(row, "seconds")?, above.max(1e-9)))
        })
        .collect()
    };
    let solvers = words(&rows, "solver");
    let curves = solvers.iter().enumerate();
    let svg = LogLog {
        x_title: "time in s",
        y_title: "objective above the best of both, relative",
        curves: curves
            .map(|(k, solver)| curve(solver, (k, 0), points(solver)))
            .collect(),
        floor: 0.0,
    };
    format!(
        "{} problems with the intervals, elements and nodes of published costs; whole runs with certificates, the fastest of three.\n\n{}\n{}",
        problems.len(),
        figure(figures, "optimal", "objective over time", &svg.write()),
        table(&rows)
    )
}

/// Time over size.
pub fn sizes(figures: &Path) -> String {
    let mut text = String::new();
    for (bench, name, title, per) in [
        (
            "scaling_optimal",
            "intervals",
            "The cart-pole with ever more control intervals",
            "seconds an iteration",
        ),
        (
            "piles",
            "discs",
            "Discs in a bin, in 1000 steps of time",
            "seconds a step",
        ),
    ] {
        let rows = rows_of(&[bench], name);
        let points = rows
            .iter()
            .filter_map(|row| Some((number(row, name)?, number(row, per)?)));
        let svg = LogLog {
            x_title: name,
            y_title: per,
            curves: vec![curve("nsdc", (0, 0), points.collect())],
            floor: 0.0,
        };
        let shown = figure(figures, &format!("sizes-{name}"), title, &svg.write());
        text.push_str(&format!("### {title}\n\n{shown}\n{}\n", table(&rows)));
    }
    text
}
