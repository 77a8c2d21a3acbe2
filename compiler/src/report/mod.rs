//! What a run leaves behind: the [`Trajectory`], and the forms it is shown in.
//!
//! All roads, event by event or through a nonlinear program, end here with the
//! user's names and physical time; nothing after this knows which one was taken.
//!
//! Invariants, checked by [`Trajectory::verify`]:
//! - `time` does not decrease; an instant stands twice where something jumps;
//! - every series has one value of its shape per instant;
//! - mode intervals follow each other without gap and hold one side per switch;
//! - pieces follow each other in time and have one number of rows, switches among them.

mod dense;
mod event;
pub mod expect;
mod failure;
pub mod forms;
mod modes;
pub mod numbers;
mod optimum;
#[cfg(feature = "plots")]
pub mod plot;
pub mod roads;
mod rows;
#[cfg(test)]
mod sample;
mod several;
pub mod sliding;
mod status;

pub use crate::report::sliding::branches::{Boundary, Change, Map, Sample};
pub use crate::report::sliding::plane::{Plane, PlaneCurve, words_of};
pub use dense::{Dense, Piece};
pub use event::{Event, EventKind, SlidingMode};
pub use failure::Failure;
pub use modes::ModeTexts;
pub use optimum::{
    Check, Confirmation, Constraint, FoundBy, GridTried, Optimum, Seconds, Term, Values, Way,
};
pub(crate) use rows::{Course, curve};
pub use rows::{Rows, curve::refine};
pub use several::{
    Bands, Bound, ClosedLoop, Decision, Direction, Ensemble, Estimate, Fit, Measurements, Planned,
    Sampled, Search, Several, Times,
};
pub use status::{Certificate, Stationarity, Stats, Status};

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::diagnostics::Diagnostics;
use crate::source::Span;

/// The result of one experiment.
#[derive(Clone, Debug, Default)]
pub struct Trajectory {
    /// What was run.
    pub setup: Setup,
    /// How the run ended.
    pub status: Status,
    /// Why it did not end as `solved`.
    pub failure: Option<Failure>,
    /// Warnings of the run.
    pub warnings: Vec<Warning>,
    /// The values at the reported instants.
    pub samples: Rows,
    /// Multipliers of the complementarity system, where they were asked for and the method has them.
    pub multipliers: Option<Multipliers>,
    /// The solution between the reported instants.
    pub dense: Dense,
    /// Events and modes.
    pub history: History,
    /// How far it can be trusted, and what it cost.
    pub quality: Quality,
    /// Value of the cost of an `optimize`.
    pub objective: Option<f64>,
    /// How an optimum was found, and what a simulation says about it; none in a simulation.
    pub optimum: Option<Optimum>,
    /// What several runs say together, where the experiment asks for them.
    pub several: Several,
}

/// An experiment as it was run.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Name of the experiment.
    pub experiment: String,
    /// Name of the model.
    pub model: String,
    /// Simulation, optimal control or parameter estimation.
    pub kind: Kind,
    /// The method and the options it ran with.
    pub method: Method,
    /// Parameters of the model with the values it ran with, each of them at one instant; none in solutions of prepared
    /// problems, which take them as arguments.
    pub parameters: Vec<Series>,
    /// What the experiment did not need.
    pub skipped: Vec<String>,
}

/// Values at the instants t_k that are reported: a row of each series per instant.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Samples {
    /// t_k, which does not decrease; an instant stands twice where something jumps.
    pub time: Vec<f64>,
    /// States, in order of declaration.
    #[serde(serialize_with = "forms::json::by_name")]
    pub states: Vec<Series>,
    /// Outputs, in order of declaration.
    #[serde(serialize_with = "forms::json::by_name")]
    pub outputs: Vec<Series>,
    /// Controls, in order of declaration.
    #[serde(serialize_with = "forms::json::by_name")]
    pub controls: Vec<Series>,
    /// Derivatives of all of them, where they were asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensitivities: Vec<Sensitivity>,
    /// The gradient of a weighted sum of what is reported, in the order of what it is differentiated by, where that was
    /// asked for; not a number where it is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gradient: Option<Vec<f64>>,
}

/// The derivatives of a run by a parameter or an initial value.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Sensitivity {
    /// By what: `mu`, `x[1] at 0`.
    pub to: String,
    /// From when on they are not known, as a warning says; none where they are known to the end.
    pub until: Option<f64>,
    /// Of states, at the instants of the run: not a number where they are not known. Where the mode changes at such an
    /// instant it is what holds behind it.
    #[serde(serialize_with = "forms::json::by_name")]
    pub states: Vec<Series>,
    /// Of outputs and controls.
    #[serde(serialize_with = "forms::json::by_name")]
    pub outputs: Vec<Series>,
    /// Of the instants at which modes change and states jump.
    pub events: Vec<Moves>,
}

/// An instant with its derivative.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Moves {
    /// When.
    pub time: f64,
    /// Its derivative; not a number where that is not known.
    pub derivative: f64,
}

/// The discrete part of a run: what happens at instants, and the modes between them.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct History {
    /// What happened, in order of time.
    pub events: Vec<Event>,
    /// The modes that follow each other.
    pub modes: Vec<ModeInterval>,
    /// Surface names of the switches, in the order of [`ModeInterval::sides`].
    #[serde(skip)]
    pub switches: Vec<String>,
    /// Texts of switching functions that figures and tables show, by the names of surfaces.
    #[serde(skip)]
    pub aliases: Arc<FxHashMap<String, String>>,
    /// Chattering that went on as sliding.
    #[serde(skip)]
    pub averaged: Vec<Averaged>,
}

/// How far a result can be trusted, and what it cost.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct Quality {
    /// Estimate of the global error, relative to the magnitude of each state.
    pub error_estimate: Option<f64>,
    /// What it cost.
    pub stats: Stats,
    /// What is known about the result.
    pub certificate: Certificate,
}

/// Chattering that went on as sliding.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Averaged {
    /// When.
    pub time: f64,
    /// The surfaces that it was around.
    pub surfaces: Vec<String>,
    /// The largest values of their switching functions in the last cycle, which are neglected from there on.
    pub heights: Vec<f64>,
}

/// Algebraic variables at instants of their own.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Multipliers {
    /// Instants, ascending; twice where two elements meet, as what jumps has two values there.
    pub time: Vec<f64>,
    /// One scalar series per variable.
    #[serde(serialize_with = "forms::json::by_name")]
    pub values: Vec<Series>,
}

/// Simulation, optimal control, parameter estimation or a closed loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// `simulate`
    #[default]
    Simulate,
    /// `optimize`
    Optimize,
    /// `fit`
    Fit,
    /// `mpc`
    Mpc,
}

impl Kind {
    /// The word of the language.
    pub fn as_str(self) -> &'static str {
        match self {
            Kind::Simulate => "simulate",
            Kind::Optimize => "optimize",
            Kind::Fit => "fit",
            Kind::Mpc => "mpc",
        }
    }
}

/// A method with the options it ran with.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Method {
    /// `event`, `fesd`, ...
    pub name: String,
    /// Options by name.
    #[serde(flatten, serialize_with = "forms::json::as_map")]
    pub options: Vec<(String, MethodOption)>,
}

impl Method {
    /// The words of the lowering; none where there is no choice.
    pub fn lowering(&self) -> Option<&str> {
        self.options.iter().find_map(|(name, value)| match value {
            MethodOption::Text(text) if name == "lowering" => Some(text.as_str()),
            _ => None,
        })
    }
}

/// Value of an option of a [`Method`].
#[derive(Clone, Debug, PartialEq)]
pub enum MethodOption {
    /// A number.
    Number(f64),
    /// A word.
    Text(String),
}

/// A quantity of some shape over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the model.
    pub name: String,
    /// Sizes: none for a scalar, one for a vector, two for a matrix.
    pub shape: Vec<usize>,
    /// Values, instant by instant, a matrix row by row.
    pub values: Vec<f64>,
}

impl Series {
    /// Number of scalar entries.
    pub fn n_entries(&self) -> usize {
        self.shape.iter().product()
    }

    /// The entries at instant `k`.
    pub fn at(&self, k: usize) -> &[f64] {
        let n = self.n_entries();
        &self.values[k * n..(k + 1) * n]
    }

    /// The entries by their names, with their values at all instants.
    pub(crate) fn columns(&self) -> impl Iterator<Item = (String, Vec<f64>)> {
        let n = self.n_entries();
        let column = move |k| self.values.iter().skip(k).step_by(n).copied().collect();
        self.entry_names().into_iter().zip((0..n).map(column))
    }

    /// `x` and `[2, 1]` of `x[2..3,1..2]`: what it is a part of, and its first indices.
    fn part(&self) -> Option<(&str, Vec<usize>)> {
        let (base, indices) = self.name.strip_suffix(']')?.rsplit_once('[')?;
        if !indices.contains("..") {
            return None;
        }
        let first = |range: &str| range.split("..").next()?.trim().parse().ok();
        let first: Option<Vec<usize>> = indices.split(',').map(first).collect();
        Some((base, first?))
    }

    /// `x`, or `x[1]`, `x[2]`, ..., or `A[1,1]`, ... in the order of the values.
    pub fn entry_names(&self) -> Vec<String> {
        let (base, first) = self
            .part()
            .unwrap_or((&self.name, vec![1; self.shape.len()]));
        let columns = match (&self.shape[..], &first[..]) {
            ([], _) => return vec![self.name.clone()],
            (&[n], &[first]) => {
                return (first..first + n).map(|i| format!("{base}[{i}]")).collect();
            }
            // A column of a matrix.
            (&[_], _) => 1,
            (&[_, n], _) => n,
            (_, _) => 1,
        };
        let (row, column) = match first[..] {
            [row, column] => (row, column),
            _ => (1, 1),
        };
        let entries = (0..self.n_entries()).map(|k| (row + k / columns, column + k % columns));
        entries.map(|(i, j)| format!("{base}[{i},{j}]")).collect()
    }
}

/// An interval of time without a change of mode.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ModeInterval {
    /// First instant.
    pub from: f64,
    /// Last instant.
    pub to: f64,
    /// Regions and sliding surfaces, as printed: `inside, sliding on x[1]`.
    pub mode: String,
    /// Names of the regions the state is in; none while it slides between them.
    #[serde(skip)]
    pub regions: Vec<String>,
    /// Regions with indicators that the state slides between, by partition.
    #[serde(skip)]
    pub between: Vec<Vec<String>>,
    /// The side of every switch, in the order of [`History::switches`].
    #[serde(skip)]
    pub sides: Vec<Side>,
    /// Contacts of steps of time that are not open, by their index in the system, ascending.
    #[serde(skip)]
    pub contacts: Vec<(usize, Side)>,
}

/// Where the state is with respect to a surface ψ = 0, or what a relay remembers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// ψ < 0
    Below,
    /// On ψ = 0, staying there.
    Sliding,
    /// ψ > 0
    Above,
    /// A relay that is 0.
    Off,
    /// A relay that is 1.
    On,
    /// A contact with a gap.
    Open,
    /// A contact without one, staying so.
    Closed,
    /// A closed contact that does not slip.
    Stick,
    /// A closed contact that slips.
    Slip,
    /// A constraint of a projection that holds with room.
    Inactive,
    /// A constraint of a projection that is kept.
    Active,
}

/// A warning of a run.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Warning {
    /// Its code, `W0701`.
    pub code: String,
    /// The fact.
    pub message: String,
    /// Where it comes from.
    #[serde(skip)]
    pub span: Option<Span>,
}

impl std::fmt::Display for Warning {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Warning {}

impl miette::Diagnostic for Warning {
    fn code(&self) -> Option<Box<dyn std::fmt::Display + '_>> {
        Some(Box::new(&self.code))
    }

    fn severity(&self) -> Option<miette::Severity> {
        Some(miette::Severity::Warning)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = miette::LabeledSpan> + '_>> {
        let label = miette::LabeledSpan::new_with_span(Some("about this".to_owned()), self.span?);
        Some(Box::new(std::iter::once(label)))
    }
}

impl crate::diagnostics::Fixable for Warning {}

impl Warning {
    /// A diagnostic as it stands in a report.
    pub fn of(diagnostic: &dyn miette::Diagnostic) -> Self {
        Warning {
            code: diagnostic
                .code()
                .map(|code| code.to_string())
                .unwrap_or_default(),
            message: diagnostic.to_string(),
            span: None,
        }
    }

    /// The warnings of a compilation as they stand in reports.
    pub(crate) fn all(diags: &Diagnostics) -> Vec<Self> {
        let found = diags.warnings();
        found.map(|warning| Warning::of(warning.as_ref())).collect()
    }
}

impl Samples {
    /// All that is reported over time: states, outputs, controls.
    pub fn series(&self) -> impl Iterator<Item = &Series> {
        (self.states.iter().chain(&self.outputs)).chain(&self.controls)
    }

    fn series_mut(&mut self) -> impl Iterator<Item = &mut Series> {
        (self.states.iter_mut().chain(&mut self.outputs)).chain(&mut self.controls)
    }

    /// States, then outputs.
    pub fn states_and_outputs(&self) -> impl Iterator<Item = &Series> + Clone {
        self.states.iter().chain(&self.outputs)
    }

    /// Number of scalar states that are reported.
    pub fn n_states(&self) -> usize {
        self.states.iter().map(Series::n_entries).sum()
    }

    /// Every entry of a state at `time`, between instants on a straight line; `None` before the first and after the last.
    fn states_at(&self, time: f64) -> Option<Vec<f64>> {
        let (first, last) = (*self.time.first()?, *self.time.last()?);
        if !(first..=last).contains(&time) {
            return None;
        }
        let after = self.time.partition_point(|&t| t <= time);
        let after = after.min(self.time.len() - 1);
        let before = after.saturating_sub(1);
        let length = self.time[after] - self.time[before];
        let share = if length > 0.0 {
            (time - self.time[before]) / length
        } else {
            1.0
        };
        let between = |series: &Series| {
            let pairs = series.at(before).iter().zip(series.at(after));
            pairs.map(|(a, b)| a + share * (b - a)).collect::<Vec<_>>()
        };
        Some(self.states.iter().flat_map(between).collect())
    }

    /// The last row alone; none where there is none.
    pub(crate) fn last(&self) -> Samples {
        let last = self.time.len().saturating_sub(1);
        let of = |series: &Series| Series {
            name: series.name.clone(),
            shape: series.shape.clone(),
            values: series.values[last * series.n_entries()..].to_vec(),
        };
        let all = |series: &[Series]| series.iter().map(of).collect();
        Samples {
            time: self.time[last..].to_vec(),
            states: all(&self.states),
            outputs: all(&self.outputs),
            controls: all(&self.controls),
            sensitivities: (self.sensitivities.iter())
                .map(|by| Sensitivity {
                    states: all(&by.states),
                    outputs: all(&by.outputs),
                    ..by.clone()
                })
                .collect(),
            gradient: self.gradient.clone(),
        }
    }

    fn verify(&self) -> Result<(), String> {
        if self.time.windows(2).any(|pair| pair[1] < pair[0]) {
            return Err("time decreases".into());
        }
        let is_ragged = |one: &&Series| one.values.len() != self.time.len() * one.n_entries();
        match self.series().find(is_ragged) {
            Some(Series { name, .. }) => {
                Err(format!("`{name}` does not have one value per instant"))
            }
            None => Ok(()),
        }
    }
}

impl History {
    /// What has ended the run before its horizon.
    pub fn stop(&self) -> Option<&Event> {
        self.events
            .last()
            .filter(|event| event.kind == EventKind::Stop)
    }

    /// Instants at which the mode changes, the start excluded.
    pub fn switch_times(&self) -> Vec<f64> {
        self.modes.iter().skip(1).map(|mode| mode.from).collect()
    }

    /// The mode at `time`; at a change of mode, the one that begins there.
    pub fn mode_at(&self, time: f64) -> Option<&ModeInterval> {
        let after = self.modes.partition_point(|mode| mode.from <= time);
        self.modes.get(after.saturating_sub(1))
    }

    fn verify(&self) -> Result<(), String> {
        let mut pairs = self.modes.windows(2);
        if let Some([before, after]) = pairs.find(|pair| pair[0].to != pair[1].from) {
            return Err(format!("no mode between {} and {}", before.to, after.from));
        }
        let n_switches = self.switches.len();
        match self.modes.iter().all(|mode| mode.sides.len() == n_switches) {
            true => Ok(()),
            false => Err("a mode does not have one side per switch".into()),
        }
    }
}

impl Trajectory {
    /// Lets it end so.
    pub(crate) fn fails(&mut self, failure: Failure) {
        self.status = failure.status();
        self.failure = Some(failure);
    }

    /// What a run warns of, and why it has ended.
    pub(crate) fn diagnostics(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        for warning in &self.warnings {
            found.push(warning.clone());
        }
        if let Some(failure) = &self.failure {
            found.push(failure.clone());
        }
        found
    }

    /// Every state entry of the system, then every α, at `time`; `None` where the run has no values.
    ///
    /// Between points of a method without pieces it is interpolated, without α.
    pub fn row_at(&self, time: f64) -> Option<Vec<f64>> {
        match self.dense.pieces.last() {
            Some(last) => (time <= last.to).then(|| self.dense.at(time)).flatten(),
            None => self.samples.states_at(time),
        }
    }

    /// Checks the invariants of the module and names the first that is broken.
    pub fn verify(&self) -> Result<(), String> {
        self.samples.verify()?;
        self.history.verify()?;
        self.dense.verify(self.history.switches.len())
    }
}

#[cfg(test)]
mod tests {
    use super::{Series, Trajectory};

    /// It goes from one thread to another, and outlives the model.
    #[test]
    fn a_trajectory_is_plain_data() {
        fn is_plain<T: Send + Sync + 'static>(_: T) {}
        is_plain(Trajectory::default());
    }

    #[test]
    fn entries_are_named_as_in_the_model() {
        let names = |name: &str, shape: &[usize]| {
            let series = Series {
                name: name.into(),
                shape: shape.to_vec(),
                values: Vec::new(),
            };
            series.entry_names().join(" ")
        };
        assert_eq!(names("x", &[]), "x");
        assert_eq!(names("x", &[2]), "x[1] x[2]");
        assert_eq!(names("x[3..4]", &[2]), "x[3] x[4]");
        assert_eq!(names("A", &[2, 1]), "A[1,1] A[2,1]");
        assert_eq!(names("A[2,1..2]", &[1, 2]), "A[2,1] A[2,2]");
        assert_eq!(names("A[2..3,2]", &[2]), "A[2,2] A[3,2]");
        assert_eq!(
            names("A[2..3,1..2]", &[2, 2]),
            "A[2,1] A[2,2] A[3,1] A[3,2]"
        );
    }
}
