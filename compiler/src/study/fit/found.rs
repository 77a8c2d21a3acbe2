//! What the data say of parameters, as it is reported.

use nsd_solver::optimization::least_squares::{Fitted, Residuals};

use super::Searched;
use super::runs::Runs;
use super::statistics::{self, Directions, PART, Singular};
use crate::report::{Bound, Direction, Estimate, Fit, Measurements, Search, Warning};
use crate::system::experiment;

/// What is known at the end of a search.
pub(super) fn told(
    runs: &Runs<'_, '_>,
    fit: &experiment::Fit<'_>,
    best: &Fitted,
    searched: &Searched,
) -> Fit {
    let bounds = reached(runs, best);
    let n = bounds.len();
    let open: Vec<usize> = (0..n).filter(|&j| bounds[j].is_none()).collect();
    let sizes = runs.sizes(&best.point);
    // Relative changes are those of the values themselves.
    let relative = |&j: &usize| match best.point[j].abs() {
        0.0 => sizes[j],
        size => size,
    };
    let open_sizes: Vec<f64> = open.iter().map(relative).collect();
    let directions = Directions::new(&best.at, &open);
    let variance = statistics::variance(&best.at, fit.loss, directions.rank());
    let degrees_of_freedom = (best.at.residuals.len()).saturating_sub(directions.rank());
    let of_open = variance.map(|s| directions.covariance(s));
    let mut covariance = vec![vec![None; n]; n];
    for (a, row) in of_open.iter().flatten().enumerate() {
        for (b, &entry) in row.iter().enumerate() {
            covariance[open[a]][open[b]] = entry;
        }
    }
    let error = |j: usize| covariance[j][j].map(f64::sqrt);
    let correlation = |j: usize, k: usize| {
        let unit = error(j)? * error(k)?;
        (unit > 0.0).then_some(covariance[j][k]? / unit)
    };
    let t = statistics::student(degrees_of_freedom.max(1));
    let name = |j: usize| fit.sensed[j].name.clone();
    let estimate = |j: usize| {
        let (value, standard_error) = (best.point[j], error(j));
        let place = open.iter().position(|&open| open == j);
        Estimate {
            name: name(j),
            value,
            standard_error,
            interval: standard_error.map(|error| [value - t * error, value + t * error]),
            at_bound: bounds[j],
            is_determined: place.map(|at| directions.is_determined(at)),
        }
    };
    let direction = |one: &Singular| Direction {
        singular_value: one.value,
        combination: (open.iter().zip(directions.relative(one, &open_sizes)))
            .filter(|(_, part)| part.abs() >= PART)
            .map(|(&j, part)| (name(j), part))
            .collect(),
        is_determined: one.is_determined,
    };
    Fit {
        free: (0..n).map(|j| (name(j), best.point[j])).collect(),
        estimates: (0..n).map(estimate).collect(),
        correlation: (0..n)
            .map(|j| (0..n).map(|k| correlation(j, k)).collect())
            .collect(),
        covariance,
        directions: directions.all.iter().map(direction).collect(),
        residual_norm: best.at.residuals.norm(),
        deviation: variance.map(f64::sqrt),
        degrees_of_freedom,
        search: Search {
            iterations: best.iterations,
            failed_steps: best.failures,
            runs: runs.count(),
            offset: best.offset,
            starts: searched.starts,
            failed_starts: searched.failed,
            best_starts: searched.n_best,
        },
        data: measurements(runs, best.at.residuals.as_slice()),
    }
}

/// The bounds at which numbers are.
fn reached(runs: &Runs<'_, '_>, best: &Fitted) -> Vec<Option<Bound>> {
    let pairs = best.point.iter().zip(runs.bounds());
    let bound = |(&p, [low, high]): (&f64, [f64; 2])| match p {
        p if p <= low => Some(Bound::Lower),
        p if p >= high => Some(Bound::Upper),
        _ => None,
    };
    pairs.map(bound).collect()
}

fn measurements(runs: &Runs<'_, '_>, residuals: &[f64]) -> Vec<Measurements> {
    let mut left = residuals.iter();
    let columns = runs.columns().map(|(column, with)| Measurements {
        with: with.cloned(),
        quantity: column.kept.name.clone(),
        column: column.name.clone(),
        file: column.file.clone(),
        weight: column.weight,
        time: column.points.iter().map(|[t, _]| *t).collect(),
        measured: column.points.iter().map(|[_, y]| *y).collect(),
        residuals: (left.by_ref().take(column.points.len()))
            .map(|r| r / column.weight)
            .collect(),
        missing: column.missing,
        outside: column.outside,
    });
    columns.collect()
}

/// What the data do not determine, and what a bound holds.
pub(super) fn warnings(found: &Fit, fit: &experiment::Fit<'_>) -> Vec<Warning> {
    let span = |name: &str| {
        let mut sensed = fit.sensed.iter();
        sensed.find(|sensed| sensed.name == name).map(|s| s.span)
    };
    let open = found.directions.iter().filter(|one| !one.is_determined);
    let open = open.filter_map(|one| {
        let (first, _) = one.combination.first()?;
        Some(Warning {
            code: "W0741".into(),
            message: one.not_determined(),
            span: span(first),
        })
    });
    let held = found.estimates.iter().filter_map(|estimate| {
            let bound = match estimate.at_bound? {
                Bound::Lower => "lower",
                Bound::Upper => "upper",
            };
            let Estimate { name, value, .. } = estimate;
            Some(Warning {
                code: "W0742".into(),
                message: format!(
                    "`{name}` is at its {bound} bound {value}: it has no interval, and those of the others hold with it there"
                ),
                span: span(name),
            })
        });
    open.chain(held).collect()
}
