//! The JSON form: one object on one line, with the fields of the language reference.
//!
//! Numbers round-trip; those that are not finite are `null`.

use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

use crate::report::{
    Averaged, Bands, Constraint, Ensemble, Event, Method, MethodOption, ModeInterval, Optimum,
    Series, SlidingMode, Stats, Term, Trajectory, Warning,
};

/// The object, without a line break.
pub fn write(trajectory: &Trajectory) -> String {
    // Names and numbers only: nothing that serialization can refuse.
    serde_json::to_string(&Object::from(trajectory)).unwrap_or_default()
}

/// The fields in the order of the reference.
#[derive(serde::Serialize)]
struct Object<'a> {
    experiment: &'a str,
    model: &'a str,
    kind: &'a str,
    status: &'a str,
    method: &'a Method,
    time: &'a [f64],
    states: ByName<'a>,
    outputs: ByName<'a>,
    controls: ByName<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    multipliers: Option<Multipliers<'a>>,
    r#final: Last<'a>,
    objective: Option<f64>,
    events: &'a [Event],
    modes: &'a [ModeInterval],
    error_estimate: Option<f64>,
    stats: &'a Stats,
    certificate: Certificate<'a>,
    #[serde(skip_serializing_if = "Option::is_none")]
    optimum: Option<Found<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ensemble: Option<Many<'a>>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    averaged: &'a [Averaged],
    skipped: &'a [String],
    /// Warnings, and last what ended the run early.
    warnings: Vec<Warning>,
}

/// `{ "time": [..], "values": { "lambda[..]": [..] } }`
#[derive(serde::Serialize)]
struct Multipliers<'a> {
    time: &'a [f64],
    values: ByName<'a>,
}

#[derive(serde::Serialize)]
struct Certificate<'a> {
    stationarity: &'a str,
    max_violation: f64,
}

/// Quantiles of many runs: `"quantiles": { "x": [[..], ..] }`, a list over time for every level.
#[derive(serde::Serialize)]
struct Many<'a> {
    runs: usize,
    first_seed: u64,
    failed_seeds: &'a [u64],
    levels: &'a [f64],
    time: &'a [f64],
    quantiles: Quantiles<'a>,
}

impl<'a> Many<'a> {
    fn of(ensemble: &'a Ensemble) -> Self {
        Many {
            runs: ensemble.runs,
            first_seed: ensemble.first_seed,
            failed_seeds: &ensemble.failed_seeds,
            levels: &ensemble.levels,
            time: &ensemble.time,
            quantiles: Quantiles(&ensemble.bands),
        }
    }
}

/// `{ "x[1]": [[..], ..] }`
struct Quantiles<'a>(&'a [Bands]);

impl Serialize for Quantiles<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|bands| (&bands.name, &bands.values)))
    }
}

/// Numbers by their names, in order.
fn as_map<S: Serializer>(numbers: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().map(|(name, value)| (name, value)))
}

/// How an optimum was found; what is not known is `null`.
#[derive(serde::Serialize)]
struct Found<'a> {
    #[serde(serialize_with = "as_map")]
    free: &'a [(String, f64)],
    objective_terms: &'a [Term],
    constraints: &'a [Constraint],
    starts: usize,
    feasible: usize,
    at_best: usize,
    best: Option<f64>,
    median: Option<f64>,
    worst: Option<f64>,
    median_solve_s: f64,
    branches: usize,
    confirmation: &'static str,
    factor_entries: usize,
    terminal_error: Option<f64>,
    objective_error: Option<f64>,
}

impl<'a> Found<'a> {
    fn of(optimum: &'a Optimum) -> Self {
        let (spread, check) = (optimum.spread.as_ref(), optimum.check.as_ref());
        Found {
            free: &optimum.values.free,
            objective_terms: &optimum.values.terms,
            constraints: &optimum.values.constraints,
            starts: optimum.starts,
            feasible: spread.map_or(0, |spread| spread.n_feasible),
            at_best: spread.map_or(0, |spread| spread.n_best),
            best: spread.map(|spread| spread.best),
            median: spread.map(|spread| spread.median),
            worst: spread.map(|spread| spread.worst),
            median_solve_s: optimum.median_s,
            branches: optimum.branches,
            confirmation: optimum.confirmation.as_str(),
            factor_entries: optimum.factor_entries,
            terminal_error: check.map(|check| check.terminal_error),
            objective_error: check.map(|check| check.objective_error),
        }
    }
}

impl<'a> From<&'a Trajectory> for Object<'a> {
    fn from(trajectory: &'a Trajectory) -> Self {
        Object {
            experiment: &trajectory.experiment,
            model: &trajectory.model,
            kind: trajectory.kind.as_str(),
            status: trajectory.status.as_str(),
            method: &trajectory.method,
            time: &trajectory.time,
            states: ByName(&trajectory.states),
            outputs: ByName(&trajectory.outputs),
            controls: ByName(&trajectory.controls),
            multipliers: trajectory.multipliers.as_ref().map(|kept| Multipliers {
                time: &kept.time,
                values: ByName(&kept.values),
            }),
            r#final: Last {
                series: &trajectory.states,
                n_instants: trajectory.time.len(),
            },
            objective: trajectory.objective,
            events: &trajectory.events,
            modes: &trajectory.modes,
            error_estimate: trajectory.error_estimate,
            stats: &trajectory.stats,
            certificate: Certificate {
                stationarity: trajectory.certificate.stationarity.as_str(),
                max_violation: trajectory.certificate.max_violation,
            },
            optimum: trajectory.optimum.as_ref().map(Found::of),
            ensemble: trajectory.ensemble.as_ref().map(Many::of),
            averaged: &trajectory.averaged,
            skipped: &trajectory.skipped,
            warnings: (trajectory.warnings.iter().cloned())
                .chain(
                    trajectory
                        .failure
                        .as_ref()
                        .map(|failure| Warning::of(failure)),
                )
                .collect(),
        }
    }
}

/// `{ "x": [value, value, ...] }`
struct ByName<'a>(&'a [Series]);

impl Serialize for ByName<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|series| (&series.name, Values(series))))
    }
}

/// `{ "x": value }` at the last instant.
struct Last<'a> {
    series: &'a [Series],
    n_instants: usize,
}

impl Serialize for Last<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if let Some(last) = self.n_instants.checked_sub(1) {
            for series in self.series {
                map.serialize_entry(&series.name, &Shaped::new(series, last))?;
            }
        }
        map.end()
    }
}

/// The values of a series, instant by instant.
struct Values<'a>(&'a Series);

impl Serialize for Values<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let n_instants = match self.0.n_entries() {
            0 => 0,
            n => self.0.values.len() / n,
        };
        serializer.collect_seq((0..n_instants).map(|k| Shaped::new(self.0, k)))
    }
}

/// One value: a number, a list, or a list of rows.
struct Shaped<'a> {
    shape: &'a [usize],
    entries: &'a [f64],
}

impl<'a> Shaped<'a> {
    fn new(series: &'a Series, instant: usize) -> Self {
        Shaped {
            shape: &series.shape,
            entries: series.at(instant),
        }
    }
}

impl Serialize for Shaped<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self.shape {
            [] => self.entries.first().serialize(serializer),
            [_] => self.entries.serialize(serializer),
            [n_rows, ref rest @ ..] => {
                let n_columns: usize = rest.iter().product();
                let mut rows = serializer.serialize_seq(Some(n_rows))?;
                for row in 0..n_rows {
                    rows.serialize_element(&Shaped {
                        shape: rest,
                        entries: &self.entries[row * n_columns..(row + 1) * n_columns],
                    })?;
                }
                rows.end()
            }
        }
    }
}

impl Serialize for Method {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("name", &self.name)?;
        for (name, value) in &self.options {
            match value {
                MethodOption::Number(number) if is_count(*number) => {
                    map.serialize_entry(name, &(*number as i64))?;
                }
                MethodOption::Number(number) => map.serialize_entry(name, number)?,
                MethodOption::Text(text) => map.serialize_entry(name, text)?,
            }
        }
        map.end()
    }
}

/// Whether a number reads better without a point.
fn is_count(number: f64) -> bool {
    number.fract() == 0.0 && number.abs() < 1e9
}

impl Serialize for Event {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let more = usize::from(!self.sliding.is_empty());
        let mut map = serializer.serialize_map(Some(5 + more))?;
        map.serialize_entry("time", &self.time)?;
        map.serialize_entry("kind", self.kind.as_str())?;
        map.serialize_entry("surface", &self.surface)?;
        map.serialize_entry("from", &self.from)?;
        map.serialize_entry("to", &self.to)?;
        if more > 0 {
            map.serialize_entry("sliding", &self.sliding)?;
        }
        map.end()
    }
}

impl Serialize for SlidingMode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(3))?;
        map.serialize_entry("value", &self.value)?;
        map.serialize_entry("stability", &self.stability)?;
        map.serialize_entry("taken", &self.taken)?;
        map.end()
    }
}

impl Serialize for ModeInterval {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(3))?;
        map.serialize_entry("from", &self.from)?;
        map.serialize_entry("to", &self.to)?;
        map.serialize_entry("mode", &self.mode)?;
        map.end()
    }
}

impl Serialize for Warning {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("code", &self.code)?;
        map.serialize_entry("message", &self.message)?;
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::write;
    use crate::report::sample;

    #[test]
    fn every_field_of_the_reference_stands_on_one_line() {
        insta::assert_snapshot!(write(&sample::oscillator()), @r#"{"experiment":"crossing","model":"oscillator","kind":"simulate","status":"solved","method":{"name":"event","order":16,"tolerance":1e-10},"time":[0.0,1.0,1.5],"states":{"x":[[0.36787944117144233,0.0],[1.0,0.0],[-1.6487212707,0.25]]},"outputs":{"c":[-0.8646647167633873,0.0,1.7807818284]},"controls":{},"final":{"x":[-1.6487212707,0.25]},"objective":null,"events":[{"time":1.0,"kind":"crossing","surface":"c","from":"inside","to":"outside"}],"modes":[{"from":0.0,"to":1.0,"mode":"inside"},{"from":1.0,"to":1.5,"mode":"outside"}],"error_estimate":1e-11,"stats":{"compile_s":0.002,"solve_s":0.001,"steps":12,"rhs_evaluations":204,"newton_iterations":0,"factorizations":0,"homotopy_steps":0,"complementarity_residual":0.0,"kkt_residual":0.0},"certificate":{"stationarity":"none","max_violation":0.0},"skipped":[],"warnings":[{"code":"W0501","message":"a bound was left"}]}"#);
    }

    #[test]
    fn what_is_not_finite_is_null() {
        let mut trajectory = sample::oscillator();
        trajectory.states[0].values[1] = f64::NAN;
        trajectory.stats.kkt_residual = f64::INFINITY;
        let value: serde_json::Value = serde_json::from_str(&write(&trajectory)).unwrap();
        assert!(value["states"]["x"][0][1].is_null());
        assert!(value["stats"]["kkt_residual"].is_null());
    }

    #[test]
    fn values_have_the_shape_of_the_state() {
        let value: serde_json::Value = serde_json::from_str(&write(&sample::shapes())).unwrap();
        assert_eq!(value["states"]["q"], serde_json::json!([1.5, 2.5]));
        assert_eq!(
            value["states"]["R"],
            serde_json::json!([[[1.0, 2.0], [3.0, 4.0]], [[5.0, 6.0], [7.0, 8.0]]])
        );
        assert_eq!(
            value["final"]["R"],
            serde_json::json!([[5.0, 6.0], [7.0, 8.0]])
        );
    }

    #[test]
    fn a_run_without_points_has_no_final_value() {
        let value: serde_json::Value = serde_json::from_str(&write(&Default::default())).unwrap();
        assert_eq!(value["final"], serde_json::json!({}));
        assert_eq!(value["status"], "numerical_failure");
        assert!(value["objective"].is_null());
    }
}
