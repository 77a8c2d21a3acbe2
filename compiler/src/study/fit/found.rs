//! What the data say of parameters, as it is reported.

use nsd_solver::optimization::least_squares::Fitted;

use super::Searched;
use super::runs::{Runs, Way};
use super::statistics::{self, PART, Singular};
use crate::report::Warning;
use crate::report::forms::json::as_map;
use crate::system::experiment;

/// A fit.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Fit {
    /// Free parameters and initial values, by their names with index.
    #[serde(serialize_with = "as_map")]
    pub free: Vec<(String, f64)>,
    /// What is known of each.
    pub estimates: Vec<Estimate>,
    /// The covariance of them; none of what the data do not determine, or a bound holds.
    pub covariance: Vec<Vec<Option<f64>>>,
    /// The same with standard deviations of one.
    pub correlation: Vec<Vec<Option<f64>>>,
    /// What changes together, in the order in which the data determine it.
    pub directions: Vec<Direction>,
    /// √Σ r².
    pub residual_norm: f64,
    /// The standard deviation of weighted measurements; none where there are no more of them than parameters.
    pub deviation: Option<f64>,
    /// Measurements less parameters that they determine.
    pub degrees_of_freedom: usize,
    /// How it was looked for.
    #[serde(flatten)]
    pub search: Search,
    /// Measurements.
    pub data: Vec<Measurements>,
}

/// A free parameter or initial value.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// `mu`, `x[1] at 0`
    pub name: String,
    /// What was found.
    pub value: f64,
    /// None where the data do not determine it, or a bound holds it.
    pub standard_error: Option<f64>,
    /// In which it is with a probability of 95 %, as far as the model is linear there.
    pub interval: Option<[f64; 2]>,
    /// Where it is at a bound.
    pub at_bound: Option<Bound>,
    /// Whether the data determine it.
    pub is_determined: bool,
}

/// A bound of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Bound {
    /// The lower one.
    Lower,
    /// The upper one.
    Upper,
}

/// A direction in the space of parameters that no bound holds.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Direction {
    /// How much residuals change with relative changes of the parameters along it.
    pub singular_value: f64,
    /// These relative changes, a vector of length one: exponents of a product of powers that changes alone.
    #[serde(serialize_with = "as_map")]
    pub combination: Vec<(String, f64)>,
    /// Whether the data determine it.
    pub is_determined: bool,
}

/// How a fit was looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Search {
    /// Steps of the best start.
    pub iterations: usize,
    /// Steps of it that were rejected because their runs failed.
    pub failed_steps: usize,
    /// Runs of all starts.
    pub runs: usize,
    /// The largest cosine of the angle between residuals and what a parameter changes.
    pub gradient: f64,
    /// From how many points it was looked for.
    pub starts: usize,
    /// From how many of them there was no run.
    pub failed_starts: usize,
    /// How many led to the least sum of squares.
    pub best_starts: usize,
}

/// A column of measurements against the run.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Measurements {
    /// What is measured.
    pub quantity: String,
    /// The name of the column.
    pub column: String,
    /// The file.
    pub file: String,
    /// What differences are multiplied by.
    pub weight: f64,
    /// Instants.
    pub time: Vec<f64>,
    /// What was measured.
    pub measured: Vec<f64>,
    /// The run less the measurement, without the weight.
    pub residuals: Vec<f64>,
    /// Rows without a value.
    pub missing: usize,
    /// Rows before the start or behind the horizon.
    pub outside: usize,
}

/// What is known at the end of a search.
pub(super) fn told(
    runs: &Runs<'_, '_>,
    fit: &experiment::Fit<'_>,
    (best, way): (&Fitted, &Way),
    searched: &Searched,
) -> Fit {
    let bounds: Vec<Option<Bound>> = (best.point.iter().zip(runs.bounds()))
        .map(|(&p, [low, high])| match p {
            p if p <= low => Some(Bound::Lower),
            p if p >= high => Some(Bound::Upper),
            _ => None,
        })
        .collect();
    let n = bounds.len();
    let open: Vec<usize> = (0..n).filter(|&j| bounds[j].is_none()).collect();
    let sizes = runs.sizes(&best.point);
    let directions = statistics::directions(&best.at, &sizes, &open, way.has_differences());
    let n_determined = directions.iter().filter(|one| one.is_determined).count();
    let variance = statistics::variance(&best.at, fit.loss, n_determined);
    let degrees_of_freedom = best.at.residuals.len().saturating_sub(n_determined);
    let open_sizes: Vec<f64> = open.iter().map(|&j| sizes[j]).collect();
    let of_open = variance.map(|s| statistics::covariance(&directions, &open_sizes, s));
    let mut covariance = vec![vec![None; n]; n];
    for (a, row) in of_open.iter().flatten().enumerate() {
        for (b, &entry) in row.iter().enumerate() {
            covariance[open[a]][open[b]] = entry;
        }
    }
    let error = |j: usize| covariance[j][j].map(f64::sqrt);
    let correlation = |j: usize, k: usize| Some(covariance[j][k]? / (error(j)? * error(k)?));
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
            is_determined: place.is_some_and(|at| statistics::is_determined(&directions, at)),
        }
    };
    let direction = |one: &Singular| Direction {
        singular_value: one.value,
        combination: (open.iter().zip(&one.vector))
            .filter(|(_, part)| part.abs() >= PART)
            .map(|(&j, &part)| (name(j), part))
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
        directions: directions.iter().map(direction).collect(),
        residual_norm: best.at.residuals.norm(),
        deviation: variance.map(f64::sqrt),
        degrees_of_freedom,
        search: Search {
            iterations: best.iterations,
            failed_steps: best.failures,
            runs: runs.count(),
            gradient: best.gradient,
            starts: searched.starts,
            failed_starts: searched.failed,
            best_starts: searched.n_best,
        },
        data: measurements(fit, best.at.residuals.as_slice()),
    }
}

fn measurements(fit: &experiment::Fit<'_>, residuals: &[f64]) -> Vec<Measurements> {
    let mut left = residuals.iter();
    let columns = fit.columns.iter().map(|column| Measurements {
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

impl Fit {
    /// What the data do not determine, and what a bound holds.
    pub(super) fn warnings(&self, fit: &experiment::Fit<'_>) -> Vec<Warning> {
        let span = |name: &str| {
            let mut sensed = fit.sensed.iter();
            sensed.find(|sensed| sensed.name == name).map(|s| s.span)
        };
        let open = self.directions.iter().filter(|one| !one.is_determined);
        let open = open.filter_map(|one| {
            let (first, _) = one.combination.first()?;
            Some(Warning {
                code: "W0741".into(),
                message: one.not_determined(),
                span: span(first),
            })
        });
        let held = self.estimates.iter().filter_map(|estimate| {
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
}

impl Direction {
    /// That the data do not determine it.
    fn not_determined(&self) -> String {
        let names: Vec<String> = (self.combination.iter())
            .map(|(name, _)| format!("`{name}`"))
            .collect();
        match &names[..] {
            [only] => format!("the data do not determine {only}: no measurement changes with it"),
            _ => format!(
                "the data do not determine {}: no measurement changes where they change together as {}",
                names.join(", "),
                self.powers()
            ),
        }
    }

    /// `m^0.58 k^0.58`
    pub fn powers(&self) -> String {
        let powers = self.combination.iter();
        let powers = powers.map(|(name, part)| format!("{name}^{part:.2}"));
        powers.collect::<Vec<_>>().join(" ")
    }
}
