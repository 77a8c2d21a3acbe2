//! Derivatives against differences, and rows one by one against rows in lanes.

use super::*;
use crate::expr::{Exprs, Var};
use crate::lowering::dcs::fixtures;
use crate::lowering::dcs::fixtures::Fixture;
use crate::lowering::mpcc::{Evaluator, Value};

/// Nonlinear rates, products of α, nested kinks.
const FIXTURES: [fn(&Exprs) -> Fixture<'_>; 3] = [
    fixtures::open_sign,
    fixtures::product_of_signs,
    fixtures::many,
];

/// Calls `check` with problems of all kinds of rows.
fn for_each(mut check: impl FnMut(&Mpcc)) {
    let weight = 0.5;
    let equilibrations = [
        Equilibration::Exact,
        Equilibration::Mean { weight },
        Equilibration::Tanh { weight, scale: 0.1 },
        Equilibration::None,
    ];
    let schemes = [
        (Family::RadauIia, 2),
        (Family::GaussLegendre, 2),
        (Family::LobattoIiic, 2),
        (Family::GaussLegendre, 1),
    ];
    for make in FIXTURES {
        let exprs = Exprs::new();
        let system = make(&exprs).system;
        for formulation in FORMULATIONS {
            if lower_as(&system, formulation).is_err() {
                continue;
            }
            let all = CROSS.into_iter().zip(equilibrations);
            for ((cross, equilibration), scheme) in all.zip(schemes) {
                let detection = Detection {
                    cross,
                    equilibration,
                    ..Detection::default()
                };
                let grid = Grid::new(1.0, 1);
                let options = options(scheme, detection);
                check(&discretized(&system, formulation, grid, &options).0);
            }
        }
    }
}

/// Numbers between 0 and 1 that look random and are always the same.
fn scatter(n: usize) -> Vec<f64> {
    let number = |i: usize| {
        (43_758.545 * (12.9898 * (i as f64 + 1.0)).sin())
            .fract()
            .abs()
    };
    (0..n).map(number).collect()
}

#[test]
fn the_jacobian_agrees_with_differences() {
    for_each(|mpcc| {
        let w = scatter(mpcc.n_variables());
        let mut evaluator = Evaluator::new(mpcc).unwrap();
        let pattern = evaluator.pattern().clone();
        let mut entries = vec![0.0; pattern.columns.len()];
        evaluator.jacobian(&w, &mut entries);
        let mut matrix = vec![vec![0.0; w.len()]; mpcc.n_rows()];
        for (row, matrix) in matrix.iter_mut().enumerate() {
            let places = pattern.starts[row]..pattern.starts[row + 1];
            for (&column, &entry) in pattern.row(row).iter().zip(&entries[places]) {
                matrix[column as usize] = entry;
            }
        }
        let step = 1e-5;
        for column in 0..w.len() {
            let [behind, ahead] = [-step, step].map(|step| {
                let (mut w, mut values) = (w.clone(), vec![0.0; mpcc.n_rows()]);
                w[column] += step;
                evaluator.values(&w, &mut values);
                values
            });
            for (row, entries) in matrix.iter().enumerate() {
                let difference = (ahead[row] - behind[row]) / (2.0 * step);
                let close = (entries[column] - difference).abs() <= 1e-7 * (1.0 + difference.abs());
                assert!(
                    close,
                    "row {row}, column {column}: {} {difference}",
                    entries[column]
                );
            }
        }
    });
}

#[test]
fn flat_rows_have_the_same_values() {
    for_each(|mpcc| {
        let w = scatter(mpcc.n_variables());
        let mut values = vec![0.0; mpcc.n_rows()];
        Evaluator::new(mpcc).unwrap().values(&w, &mut values);
        let flat = mpcc.flat();
        let vars: Vec<Var> = flat
            .variables
            .iter()
            .filter_map(|var| var.as_variable())
            .collect();
        let value = |var: Var| vars.binary_search(&var).map_or(f64::NAN, |i| w[i]);
        let mut rows = flat.rows.iter();
        for (block, numbers) in mpcc.rows() {
            let (n, half) = (block.n_places(), block.n_rows() / 2);
            for (place, source) in
                (0..n).flat_map(|p| (0..block.sources.len()).map(move |s| (p, s)))
            {
                let row = numbers.start + source * n + place;
                let found = match rows.next().expect("there are as many rows").value {
                    Value::Equation(e)
                    | Value::Inequality(_, e, _)
                    | Value::Conditional(e)
                    | Value::Objective(e) => vec![(e, row)],
                    Value::Pair(a, b) => vec![(a, row), (b, row + half)],
                };
                for (expr, row) in found {
                    let (flat, lanes) = (expr.eval(&value), values[row]);
                    let close = (flat - lanes).abs() <= 1e-13 * (1.0 + lanes.abs());
                    assert!(close, "{}: {flat} {lanes}", block.name);
                }
            }
        }
        assert!(rows.next().is_none());
    });
}
