//! Families of hard cases: each is a function of its hardness, with a reference that does not come from
//! the code under test, what is promised, and what comes out.
//!
//! A run that ends as solved, with a larger error than promised and without a warning, is wrong: there is
//! no case in which that is allowed. What else a family promises is said by [`Promise`].
//! `tests/tests/families.rs` runs a few cases of each, `tests/benches/stress.rs` all, as a table.

mod chatter;
mod complementarities;
mod contacts;
mod controls;
mod events;
pub mod free;
mod large;
mod masses;
mod narrow;
mod offsets;
mod programs;
mod roots;
mod rounding;
mod steps;
mod stiff;
mod surfaces;
mod units;
mod zeno;

use std::fmt;
use std::time::Duration;

use nsdc::limit::Limit;
use nsdc::optimize;
use nsdc::report::{Status, Trajectory, Warning};
use nsdc::simulate::{self, Request};

use crate::{DataFiles, end, with_data};

pub use large::held_switches;
pub use stiff::relay_exactly;

/// What the grid of a program promises, whose simulation warns above this.
const OF_A_PROGRAM: f64 = 1e-3;

/// How much of every family.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Extent {
    /// A few cases that are quick.
    Short,
    /// All of them.
    Long,
}

impl Extent {
    /// One of two values.
    fn of<T>(self, short: T, long: T) -> T {
        match self {
            Extent::Short => short,
            Extent::Long => long,
        }
    }

    /// The values of a sweep.
    fn sweep<T: Clone>(self, short: &[T], long: &[T]) -> Vec<T> {
        self.of(short, long).to_vec()
    }
}

/// Cases that differ in one number.
#[derive(Clone, Debug)]
pub struct Family {
    /// What is hard, in a few words.
    pub name: &'static str,
    /// The model, and where the reference is from.
    pub about: &'static str,
    /// What the hardness is a value of.
    pub hardness: &'static str,
    /// In order of hardness. Several may have one hardness and one method.
    pub cases: Vec<Case>,
}

/// In ascending order of a hardness that is a number.
fn by_hardness(cases: impl Iterator<Item = Case>) -> Vec<Case> {
    let mut cases: Vec<Case> = cases.collect();
    let value = |case: &Case| case.hardness.parse::<f64>().expect("hardness is a number");
    cases.sort_by(|one, other| value(one).total_cmp(&value(other)));
    cases
}

/// What a case promises.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Promise {
    /// The accuracy.
    Accuracy,
    /// The accuracy, or a warning or failure that says that it is not there.
    AccuracyOrReport,
    /// Of a grid of so many steps: ten times the error that the run estimates itself, or one step as a share
    /// of the horizon where that is more; or a report.
    Grid(usize),
    /// A failure with this code.
    Told(&'static str),
}

/// One run.
#[derive(Clone, Debug)]
pub struct Case {
    /// A value, as the table has it.
    pub hardness: String,
    /// `event`, `fesd`, or another with its options.
    pub method: String,
    model: String,
    beside: Beside,
    horizon: f64,
    tolerance: f64,
    /// What the arithmetic of the model loses whatever the method: condition times rounding.
    rounding: f64,
    promise: Promise,
    /// Wall time after which it is a report.
    limit: Duration,
    known: Vec<Known>,
    times: Option<Vec<f64>>,
    switches: Option<usize>,
    optimal: Option<controls::Problem>,
}

/// What a model needs besides its text.
#[derive(Clone, Debug, Default)]
struct Beside {
    /// `set_points.csv`, where it is read.
    table: String,
    /// What stands in `with`.
    given: String,
}

/// Values of a state at the end, and the largest magnitudes that they have had.
#[derive(Clone, Debug)]
struct Known {
    state: String,
    values: Vec<f64>,
    scales: Vec<f64>,
}

impl Case {
    /// The body of a model over a horizon, at a tolerance of 1e-8 and by events.
    fn new(hardness: impl fmt::Display, model: impl Into<String>, horizon: f64) -> Self {
        Case {
            hardness: hardness.to_string(),
            method: "event".to_owned(),
            model: model.into(),
            beside: Beside::default(),
            horizon,
            tolerance: 1e-8,
            rounding: 0.0,
            promise: Promise::Accuracy,
            limit: Duration::from_secs(300),
            known: Vec::new(),
            times: None,
            switches: None,
            optimal: None,
        }
    }

    /// A problem of optimal control, which has an experiment of its own.
    fn optimal(problem: controls::Problem) -> Self {
        let case = Case::new(problem.kind(), "", 0.0).by("optimize");
        Case {
            optimal: Some(problem),
            ..case.promises(Promise::AccuracyOrReport)
        }
    }

    /// With a state that ends at these values, relative to a magnitude.
    fn ends(self, state: &str, values: &[f64], scale: f64) -> Self {
        self.ends_each(state, values, &vec![scale; values.len()])
    }

    /// The same with a magnitude for each entry.
    fn ends_each(mut self, state: &str, values: &[f64], scales: &[f64]) -> Self {
        self.known.push(Known {
            state: state.to_owned(),
            values: values.to_vec(),
            scales: scales.to_vec(),
        });
        self
    }

    /// With these instants at which the mode changes.
    fn switches_at(mut self, times: &[f64]) -> Self {
        self.times = Some(times.to_vec());
        self
    }

    /// With so many changes of the mode.
    fn switches(mut self, count: usize) -> Self {
        self.switches = Some(count);
        self
    }

    /// With an error that no method can avoid. What is larger than a hundredth is no result, and excuses none.
    fn rounds(mut self, error: f64) -> Self {
        self.rounding = error.min(1e-2);
        self
    }

    /// By another method.
    fn by(mut self, method: &str) -> Self {
        self.method = method.to_owned();
        self
    }

    /// With another promise.
    fn promises(mut self, promise: Promise) -> Self {
        self.promise = promise;
        self
    }

    /// With fewer seconds of wall time.
    fn within(mut self, seconds: u64) -> Self {
        self.limit = Duration::from_secs(seconds);
        self
    }

    /// In so many steps of time.
    fn in_steps(self, steps: usize) -> Self {
        let method = format!("timestepping {{ steps = {steps}; }}");
        self.by(&method).promises(Promise::Grid(steps))
    }

    /// The accuracy where this holds, else a report will do.
    fn accurate_if(self, is_promised: bool) -> Self {
        match is_promised {
            true => self,
            false => self.promises(Promise::AccuracyOrReport),
        }
    }

    /// The accuracy where 16 roundings of data are below the tolerance with this condition, else a report will do.
    fn conditioned(self, condition: f64) -> Self {
        let is_promised = 16.0 * f64::EPSILON * condition <= self.tolerance;
        self.accurate_if(is_promised)
    }

    /// By events and by finite elements.
    fn both(self) -> [Self; 2] {
        [self.clone(), self.by("fesd")]
    }

    /// With a table beside it, and inputs that are given.
    fn with(mut self, table: &str, given: &str) -> Self {
        self.beside = Beside {
            table: table.to_owned(),
            given: given.to_owned(),
        };
        self
    }

    /// Whether the end is that of an optimum whose controls have nothing to do.
    fn is_optimized(&self) -> bool {
        self.method.starts_with("optimize")
    }

    /// The model and its experiment, `run`.
    pub fn text(&self) -> String {
        if let Some(problem) = &self.optimal {
            return problem.text();
        }
        let (method, tolerance) = (&self.method, self.tolerance);
        let semicolon = if method.ends_with('}') { "" } else { ";" };
        let (kind, method) = match method.strip_prefix("optimize") {
            Some(options) => ("optimize", format!("minimize integral(U^2);{options}")),
            None => (
                "simulate",
                format!("tolerance {tolerance:e};\n  method {method}"),
            ),
        };
        let given = match &self.beside.given[..] {
            "" => String::new(),
            given => format!("  with {{ {given}}}\n"),
        };
        format!(
            "model m {{\n{}\n}}\n{kind} run of m {{\n{given}  horizon {:?};\n  {method}{semicolon}\n}}\n",
            self.model, self.horizon
        )
    }

    /// Runs it and compares.
    pub fn run(&self) -> Outcome {
        if let Some(problem) = &self.optimal {
            return problem.run();
        }
        let request = Request {
            dense: false,
            limit: Limit::within(self.limit),
            ..Request::default()
        };
        let mut data = DataFiles(vec![("set_points.csv", self.beside.table.clone())]);
        let trajectory = with_data(&self.text(), &mut data, "run", |compiled| {
            let (system, settings) = (&compiled.system, &compiled.settings);
            let Some(task) = &settings.optimize else {
                return Some(simulate::run(system, settings, &request));
            };
            let solved = optimize::run(system, settings, task, &[], &request, &mut ());
            Some(solved.ok()?.trajectory)
        });
        match trajectory {
            Some(trajectory) => self.judge(&trajectory),
            None => Outcome::Refused("not discretized".to_owned()),
        }
    }

    fn judge(&self, trajectory: &Trajectory) -> Outcome {
        if trajectory.status != Status::Solved {
            let failure = trajectory.failure.as_ref().map(|f| Warning::of(f).code);
            return Outcome::Refused(
                failure.unwrap_or_else(|| trajectory.status.as_str().to_owned()),
            );
        }
        let error = self.error(trajectory);
        let estimate = trajectory.quality.error_estimate.unwrap_or(0.0);
        let promised = match self.promise {
            Promise::Grid(steps) => f64::max(10.0 * estimate, 1.0 / steps as f64),
            _ if self.is_optimized() => OF_A_PROGRAM,
            _ => self.tolerance,
        };
        if error <= promised + self.rounding {
            return Outcome::Met { error };
        }
        if trajectory.warnings.is_empty() {
            return Outcome::Wrong { error };
        }
        let mut codes: Vec<String> = Vec::new();
        for warning in &trajectory.warnings {
            if !codes.contains(&warning.code) {
                codes.push(warning.code.clone());
            }
        }
        Outcome::Warned { error, codes }
    }

    /// The largest difference of a state at the end, relative to its magnitude, or of an instant, relative
    /// to the horizon; infinite where the numbers of instants differ.
    fn error(&self, trajectory: &Trajectory) -> f64 {
        let mut error: f64 = 0.0;
        for known in &self.known {
            let found = end(trajectory, &known.state);
            assert_eq!(found.len(), known.values.len(), "entries of a state");
            let pairs = found.iter().zip(&known.values).zip(&known.scales);
            for ((found, exact), scale) in pairs {
                let difference = (found - exact).abs() / scale;
                error = error.max(if difference.is_nan() {
                    f64::INFINITY
                } else {
                    difference
                });
            }
        }
        let times = trajectory.history.switch_times();
        if self.switches.is_some_and(|count| count != times.len()) {
            return f64::INFINITY;
        }
        if let Some(exact) = &self.times {
            if exact.len() != times.len() {
                return f64::INFINITY;
            }
            for (found, exact) in times.iter().zip(exact) {
                error = error.max((found - exact).abs() / self.horizon);
            }
        }
        error
    }

    /// Whether this is what was promised.
    pub fn keeps(&self, outcome: &Outcome) -> bool {
        match (self.promise, outcome) {
            (_, Outcome::Wrong { .. }) => false,
            (Promise::Told(promised), Outcome::Refused(code)) => code == promised,
            (Promise::Told(_), _) => false,
            (_, Outcome::Met { .. }) => true,
            (promise, Outcome::Warned { .. } | Outcome::Refused(_)) => promise != Promise::Accuracy,
        }
    }

    /// What was promised, as the table has it.
    pub fn promised(&self) -> String {
        let rounding = match self.rounding {
            0.0 => String::new(),
            rounding => format!(" + {rounding:.0e}"),
        };
        match self.promise {
            Promise::Accuracy => format!("{:.0e}{rounding}", self.tolerance),
            Promise::AccuracyOrReport => format!("{:.0e}{rounding}, or a report", self.tolerance),
            Promise::Grid(_) => "10 times the estimate or a step, or a report".to_owned(),
            Promise::Told(code) => code.to_owned(),
        }
    }
}

/// What came of a run.
#[derive(Clone, PartialEq, Debug)]
pub enum Outcome {
    /// The promised accuracy.
    Met {
        /// Relative to magnitudes.
        error: f64,
    },
    /// A larger error, of which a warning tells.
    Warned {
        /// Relative to magnitudes.
        error: f64,
        /// Of the warnings.
        codes: Vec<String>,
    },
    /// No result, for a reason with this code.
    Refused(String),
    /// A larger error, and nothing tells of it.
    Wrong {
        /// Relative to magnitudes.
        error: f64,
    },
}

impl Outcome {
    /// Whether it differs in the error at most.
    #[must_use]
    pub fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Outcome::Met { .. }, Outcome::Met { .. })
            | (Outcome::Wrong { .. }, Outcome::Wrong { .. }) => true,
            (Outcome::Warned { codes, .. }, Outcome::Warned { codes: others, .. }) => {
                codes == others
            }
            (Outcome::Refused(code), Outcome::Refused(other)) => code == other,
            _ => false,
        }
    }

    /// The worse one of two.
    #[must_use]
    pub fn worse(self, other: Self) -> Self {
        let rank = |outcome: &Self| match outcome {
            Outcome::Met { error } => (0, *error),
            Outcome::Warned { error, .. } => (1, *error),
            Outcome::Refused(_) => (2, 0.0),
            Outcome::Wrong { error } => (3, *error),
        };
        if rank(&self) >= rank(&other) {
            self
        } else {
            other
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Outcome::Met { error } => write!(f, "{error:.0e}"),
            Outcome::Warned { error, codes } => write!(f, "{error:.0e}, {}", codes.join(" ")),
            Outcome::Refused(code) => f.write_str(code),
            Outcome::Wrong { error } => write!(f, "**{error:.0e}**"),
        }
    }
}

/// All families.
pub fn families(extent: Extent) -> Vec<Family> {
    [
        units::families(extent),
        surfaces::families(extent),
        events::families(extent),
        zeno::families(extent),
        chatter::families(extent),
        stiff::families(extent),
        contacts::families(extent),
        masses::families(extent),
        programs::families(extent),
        complementarities::families(extent),
        offsets::families(extent),
        roots::families(extent),
        rounding::families(extent),
        large::families(extent),
        steps::families(extent),
        controls::families(extent),
        narrow::families(extent),
    ]
    .concat()
}

/// Where `f` changes its sign between `a` and `b`, by bisection to rounding.
///
/// # Panics
///
/// Where `f` has one sign at both.
pub fn root(f: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let sign = f(a).signum();
    assert!(f(b) * sign <= 0.0, "a root between {a} and {b}");
    for _ in 0..200 {
        let middle = 0.5 * (a + b);
        if f(middle) * sign > 0.0 {
            a = middle;
        } else {
            b = middle;
        }
    }
    0.5 * (a + b)
}
