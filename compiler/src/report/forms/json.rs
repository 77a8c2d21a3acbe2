//! The JSON form: one object on one line, with the fields of the language reference.
//!
//! Numbers round-trip; those that are not finite are `null`.

use serde::ser::{Serialize, SerializeSeq, Serializer};

use nsd_solver::optimization::mpcc::Spread;

use crate::report::{
    Averaged, Bands, Check, ClosedLoop, Confirmation, Ensemble, EventKind, Fit, History, Kind,
    Method, MethodOption, Multipliers, Optimum, Quality, Samples, Series, Stationarity, Status,
    Trajectory, Warning,
};

/// The object, without a line break.
pub fn write(trajectory: &Trajectory) -> String {
    let object = Object {
        run: trajectory.into(),
        values: trajectory.into(),
        account: trajectory.into(),
    };
    // Names and numbers only: nothing that serialization can refuse.
    serde_json::to_string(&object).unwrap_or_default()
}

/// The same without what has a value at each instant.
pub fn summary(trajectory: &Trajectory) -> String {
    let summary = Summary {
        run: trajectory.into(),
        objective: trajectory.objective,
        account: trajectory.into(),
    };
    serde_json::to_string(&summary).unwrap_or_default()
}

#[derive(serde::Serialize)]
struct Summary<'a> {
    #[serde(flatten)]
    run: Run<'a>,
    objective: Option<f64>,
    #[serde(flatten)]
    account: Account<'a>,
}

/// The fields in the order of the reference.
#[derive(serde::Serialize)]
struct Object<'a> {
    #[serde(flatten)]
    run: Run<'a>,
    #[serde(flatten)]
    values: Values<'a>,
    #[serde(flatten)]
    account: Account<'a>,
}

/// What was run.
#[derive(serde::Serialize)]
struct Run<'a> {
    experiment: &'a str,
    model: &'a str,
    kind: Kind,
    status: Status,
    method: &'a Method,
    #[serde(serialize_with = "as_map")]
    parameters: Vec<(&'a str, Shaped<'a>)>,
}

/// What it gave.
#[derive(serde::Serialize)]
struct Values<'a> {
    #[serde(flatten)]
    samples: &'a Samples,
    #[serde(skip_serializing_if = "Option::is_none")]
    multipliers: Option<&'a Multipliers>,
    /// States at the last instant.
    #[serde(serialize_with = "as_map")]
    r#final: Vec<(&'a str, Shaped<'a>)>,
    objective: Option<f64>,
}

/// What happened, and how far it can be trusted.
#[derive(serde::Serialize)]
struct Account<'a> {
    #[serde(flatten)]
    history: &'a History,
    #[serde(flatten)]
    quality: &'a Quality,
    #[serde(skip_serializing_if = "Option::is_none")]
    optimum: Option<&'a Optimum>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ensemble: Option<&'a Ensemble>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fit: Option<&'a Fit>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mpc: Option<&'a ClosedLoop>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    averaged: &'a [Averaged],
    skipped: &'a [String],
    /// Warnings, and last what ended the run early.
    warnings: Vec<Warning>,
}

impl<'a> From<&'a Trajectory> for Run<'a> {
    fn from(trajectory: &'a Trajectory) -> Self {
        let setup = &trajectory.setup;
        Run {
            experiment: &setup.experiment,
            model: &setup.model,
            kind: setup.kind,
            status: trajectory.status,
            method: &setup.method,
            parameters: at(&setup.parameters, 0),
        }
    }
}

impl<'a> From<&'a Trajectory> for Values<'a> {
    fn from(trajectory: &'a Trajectory) -> Self {
        let samples: &Samples = &trajectory.samples;
        let last = samples.time.len().checked_sub(1);
        let at_end = last.map(|last| at(&samples.states, last));
        Values {
            samples,
            multipliers: trajectory.multipliers.as_ref(),
            r#final: at_end.unwrap_or_default(),
            objective: trajectory.objective,
        }
    }
}

impl<'a> From<&'a Trajectory> for Account<'a> {
    fn from(trajectory: &'a Trajectory) -> Self {
        let failure = trajectory.failure.iter();
        let failure = failure.map(|failure| Warning::of(failure));
        Account {
            history: &trajectory.history,
            quality: &trajectory.quality,
            optimum: trajectory.optimum.as_ref(),
            ensemble: trajectory.several.ensemble.as_ref(),
            fit: trajectory.several.fit.as_ref(),
            mpc: trajectory.several.closed_loop.as_ref(),
            averaged: &trajectory.history.averaged,
            skipped: &trajectory.setup.skipped,
            warnings: (trajectory.warnings.iter().cloned())
                .chain(failure)
                .collect(),
        }
    }
}

/// The values of series at an instant, by their names.
fn at(series: &[Series], instant: usize) -> Vec<(&str, Shaped<'_>)> {
    let values = series.iter();
    let values = values.map(|series| (series.name.as_str(), Shaped::new(series, instant)));
    values.collect()
}

/// `{ "name": value, .. }`, in order.
pub(crate) fn as_map<S: Serializer, K: Serialize, V: Serialize>(
    entries: &[(K, V)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(entries.iter().map(|(name, value)| (name, value)))
}

/// How objectives spread; what is not known is `null`.
pub(crate) fn spread<S: Serializer>(
    spread: &Option<Spread>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let unknown = Spread {
        n_feasible: 0,
        n_best: 0,
        best: f64::NAN,
        median: f64::NAN,
        worst: f64::NAN,
    };
    spread.unwrap_or(unknown).serialize(serializer)
}

/// What a simulation says of an optimum; what is not known is `null`.
pub(crate) fn check<S: Serializer>(
    check: &Option<Check>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let unknown = Check {
        terminal_error: f64::NAN,
        objective_error: f64::NAN,
    };
    check.unwrap_or(unknown).serialize(serializer)
}

/// `{ "x": [value, value, ...] }`
pub(crate) fn by_name<S: Serializer>(series: &[Series], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(series.iter().map(|series| (&series.name, series)))
}

/// `{ "x[1]": [[..], ..] }`, a list over time for every level.
pub(crate) fn quantiles<S: Serializer>(bands: &[Bands], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(bands.iter().map(|bands| (&bands.name, &bands.values)))
}

/// The values, instant by instant.
impl Serialize for Series {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let n_instants = self.values.len().checked_div(self.n_entries());
        let instants = 0..n_instants.unwrap_or(0);
        serializer.collect_seq(instants.map(|k| Shaped::new(self, k)))
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

/// A number without a point where it reads better so.
impl Serialize for MethodOption {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            MethodOption::Number(number) if number.fract() == 0.0 && number.abs() < 1e9 => {
                serializer.serialize_i64(number as i64)
            }
            MethodOption::Number(number) => serializer.serialize_f64(number),
            MethodOption::Text(ref text) => serializer.serialize_str(text),
        }
    }
}

/// Kinds stand as their words.
macro_rules! words {
    ($($kind:ty),*) => {$(
        impl Serialize for $kind {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.as_str())
            }
        }
    )*};
}

words!(Confirmation, EventKind, Kind, Stationarity, Status);

#[cfg(test)]
mod tests {
    use super::write;
    use crate::report::sample;

    #[test]
    fn every_field_of_the_reference_stands_on_one_line() {
        insta::assert_snapshot!(write(&sample::oscillator()), @r#"{"experiment":"crossing","model":"oscillator","kind":"simulate","status":"solved","method":{"name":"event","order":16,"tolerance":1e-10},"parameters":{"omega":6.25},"time":[0.0,1.0,1.5],"states":{"x":[[0.36787944117144233,0.0],[1.0,0.0],[-1.6487212707,0.25]]},"outputs":{"c":[-0.8646647167633873,0.0,1.7807818284]},"controls":{},"final":{"x":[-1.6487212707,0.25]},"objective":null,"events":[{"time":1.0,"kind":"crossing","surface":"c","from":"inside","to":"outside"}],"modes":[{"from":0.0,"to":1.0,"mode":"inside"},{"from":1.0,"to":1.5,"mode":"outside"}],"error_estimate":1e-11,"stats":{"compile_s":0.002,"solve_s":0.001,"steps":12,"rhs_evaluations":204,"newton_iterations":0,"factorizations":0,"homotopy_steps":0,"complementarity_residual":0.0,"kkt_residual":0.0},"certificate":{"stationarity":"none","max_violation":0.0},"skipped":[],"warnings":[{"code":"W0501","message":"a bound was left"}]}"#);
    }

    #[test]
    fn what_is_not_finite_is_null() {
        let mut trajectory = sample::oscillator();
        trajectory.samples.states[0].values[1] = f64::NAN;
        trajectory.quality.stats.kkt_residual = f64::INFINITY;
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
