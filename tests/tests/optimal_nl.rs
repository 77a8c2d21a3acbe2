//! Optimal control problems of the examples as AMPL files: read back by the solver's reader, they are the same programs.

use nsd_solver::optimization::mpcc;
use nsd_solver::optimization::mpcc::Options;
use nsd_solver::optimization::nl;
use nsd_solver::optimization::nl::Problem;
use nsd_solver::optimization::problem::{Mpcc as _, Nlp, Side};
use nsd_tests::with_experiment;
use nsdc::lowering::mpcc::{Ampl, Evaluator, Kind, Mpcc};
use nsdc::optimize;

macro_rules! examples {
    ($($file:literal: $($experiment:literal)+;)+) => {
        [$($(($experiment, include_str!(concat!("../../examples/", $file))),)+)+]
    };
}

/// Optimizations of the examples that are no contacts, each at one grid.
const EXAMPLES: [(&str, &str); 8] = examples! {
    "cart_pole.nsd": "swing";
    "choices_ocp.nsd": "empty" "hold" "line";
    "motor.nsd": "shift";
    "tanks.nsd": "level";
    "turbo_car.nsd": "hurry";
    "tutorial_ocp.nsd": "tutorial";
};

/// What is asked of a row.
#[derive(Clone, Copy, Debug)]
enum Asked {
    Between(f64, f64),
    /// It is a pair with this row.
    Pair(usize),
}

/// A program, its file, and what the reader makes of it.
struct Trip<'e> {
    mpcc: Mpcc<'e>,
    ampl: Ampl,
    read: Problem,
}

impl<'e> Trip<'e> {
    fn new(mpcc: Mpcc<'e>) -> Self {
        let ampl = mpcc.nl();
        let read = nl::read(ampl.text.as_bytes()).expect("the file is one");
        assert_eq!(read.sizes.variables, ampl.columns.len());
        assert_eq!(read.sizes.rows, ampl.rows.len());
        assert_eq!(read.sizes.complementarities, mpcc.sizes().pairs);
        Trip { mpcc, ampl, read }
    }

    /// The variables of the file at w: slacks are what their definitions say.
    fn columns(&mut self, w: &[f64]) -> Vec<f64> {
        let columns = self.ampl.columns.iter();
        let mut x: Vec<f64> = columns.map(|&i| w.get(i).copied().unwrap_or(0.0)).collect();
        let rows = self.distances(&x);
        let n_rows = self.numbers().len();
        for (row, &id) in self.ampl.rows.iter().enumerate() {
            if let Some(slack) = id.checked_sub(n_rows) {
                let is_slack = |&column: &usize| column == w.len() + slack;
                let column = self.ampl.columns.iter().position(is_slack);
                x[column.expect("a slack is a column")] = rows[row].0;
            }
        }
        x
    }

    /// Distances of the rows of the file from their bounds.
    fn distances(&mut self, x: &[f64]) -> Vec<(f64, f64)> {
        let program = &mut self.read.program;
        let mut values = vec![0.0; program.n_rows()];
        program.rows(x, &mut values);
        let bounds = program.row_bounds();
        let rows = self.read.rows.iter().map(|row| row.row as usize);
        rows.map(|row| {
            (
                values[row] - bounds.lower[row],
                bounds.upper[row] - values[row],
            )
        })
        .collect()
    }

    /// The rows that are in the file, in the order of the program.
    fn numbers(&self) -> Vec<(usize, Asked)> {
        let mut numbers = Vec::new();
        for (block, rows) in self.mpcc.rows() {
            let (n, half) = (block.n_places(), block.n_rows() / 2);
            for (place, source) in
                (0..n).flat_map(|p| (0..block.sources.len()).map(move |s| (p, s)))
            {
                let row = rows.start + source * n + place;
                let asked = match block.kind {
                    Kind::Equation => Asked::Between(0.0, 0.0),
                    Kind::Inequality => {
                        Asked::Between(block.bounds[source].0, block.bounds[source].1)
                    }
                    Kind::Pair => Asked::Pair(row + half),
                    Kind::Objective | Kind::Steering | Kind::Conditional => continue,
                };
                numbers.push((row, asked));
            }
        }
        numbers
    }

    /// Values of all rows of the program, by our own evaluation.
    fn values(&self, w: &[f64]) -> Vec<f64> {
        let mut values = vec![0.0; self.mpcc.n_rows()];
        let mut evaluator = Evaluator::new(&self.mpcc).expect("kernels are smooth");
        evaluator.values(w, &mut values);
        values
    }

    /// The terms of the objective that count, and those that steer.
    fn objective(&self, values: &[f64]) -> (f64, f64) {
        let sum = |kind: Kind| -> f64 {
            let blocks = self.mpcc.rows().filter(|(block, _)| block.kind == kind);
            blocks.flat_map(|(_, rows)| &values[rows]).sum()
        };
        (sum(Kind::Objective), sum(Kind::Steering))
    }
}

/// Numbers between 0.1 and 0.9 that look random and are always the same.
fn scatter(n: usize) -> Vec<f64> {
    let number = |i: usize| {
        (43_758.545 * (12.9898 * (i as f64 + 1.0)).sin())
            .fract()
            .abs()
    };
    (0..n).map(|i| 0.1 + 0.8 * number(i)).collect()
}

fn for_each(mut check: impl FnMut(&str, Trip)) {
    for (experiment, text) in EXAMPLES {
        with_experiment(text, experiment, |compiled| {
            let (system, settings) = (&compiled.system, &compiled.settings);
            let task = settings.optimize.as_ref().expect("an optimization");
            let mpcc = optimize::program(system, settings, task, &[]).expect("it fits into memory");
            check(experiment, Trip::new(mpcc));
        });
    }
}

#[track_caller]
fn close(name: &str, found: f64, expected: f64) {
    // Roots of negative numbers are none on both roads.
    let is_same = found == expected || found.is_nan() && expected.is_nan();
    let is_close = (found - expected).abs() <= 1e-11 * (1.0 + expected.abs());
    assert!(is_same || is_close, "{name}: {found}, not {expected}");
}

#[test]
fn values_are_found_again() {
    for_each(|name, mut trip| {
        let guess: Vec<f64> = trip
            .mpcc
            .bounds()
            .iter()
            .map(|bounds| bounds.guess)
            .collect();
        for w in [scatter(guess.len()), guess] {
            let x = trip.columns(&w);
            let (found, values) = (trip.distances(&x), trip.values(&w));
            let (cost, steering) = trip.objective(&values);
            close(name, trip.read.program.objective(&x), cost + steering);
            let numbers = trip.numbers();
            let mut pairs = trip.read.program.pairs().iter();
            for (row, &id) in trip.ampl.rows.iter().enumerate() {
                let (lower, upper) = found[row];
                // Definitions of slacks.
                let Some(&(own, asked)) = numbers.get(id) else {
                    close(name, lower, 0.0);
                    continue;
                };
                match asked {
                    Asked::Between(least, most) => {
                        close(name, lower, values[own] - least);
                        close(name, upper, most - values[own]);
                    }
                    Asked::Pair(other) => {
                        let pair = pairs.next().expect("one pair of the reader for each");
                        let Side::Variable(complement) = pair.b else {
                            panic!("{name}: a row complements a variable");
                        };
                        let (a, b) = (lower, x[complement as usize]);
                        let expected = (values[own], values[other]);
                        close(name, a.min(b), expected.0.min(expected.1));
                        close(name, a.max(b), expected.0.max(expected.1));
                    }
                }
            }
            assert!(
                pairs.next().is_none(),
                "{name}: pairs that nobody asked for"
            );
        }
    });
}

/// Where elements have given lengths, nothing steers and no row is left out: the file has the solution of the model.
#[test]
fn solutions_are_found_again() {
    for_each(|name, mut trip| {
        let expected = match name {
            "empty" => 0.5,
            "hold" => 1.0 / 3.0,
            "line" => 4.0 / 3.0,
            _ => return,
        };
        let solution = mpcc::solve(&mut trip.read.program, &Options::default());
        assert_eq!(solution.status, mpcc::Status::Solved, "{name}");
        assert!(
            (solution.objective - expected).abs() <= 1e-8,
            "{name}: {}",
            solution.objective
        );
        // Back to the variables of the model.
        let mut w = vec![0.0; trip.mpcc.n_variables()];
        for (&variable, &value) in trip.ampl.columns.iter().zip(&solution.w) {
            if let Some(place) = w.get_mut(variable) {
                *place = value;
            }
        }
        let (cost, steering) = trip.objective(&trip.values(&w));
        close(name, cost + steering, solution.objective);
    });
}
