//! How an optimum was found, and what a simulation says about it.

use nsd_solver::optimization::mpcc::Spread;

/// What is known about an optimum besides its certificate.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Optimum {
    /// What it consists of.
    #[serde(flatten)]
    pub values: Values,
    /// From how many points it was looked for.
    pub starts: usize,
    /// How the objectives of all starts spread, where some start led to a feasible point.
    #[serde(flatten, serialize_with = "super::forms::json::spread")]
    pub spread: Option<Spread>,
    /// Seconds of the solver per start, the median.
    #[serde(rename = "median_solve_s")]
    pub median_s: f64,
    /// In how many other branches the same trajectory has a description; near none of them is a better one.
    pub branches: usize,
    /// What simulations with other free quantities say about the certificate.
    pub confirmation: Confirmation,
    /// The grids that it was solved on, from coarse to fine, where it looked for one that is fine enough.
    pub grids: Vec<GridTried>,
    /// What it was found by: the relaxation of a start first, then each way that led to a better point.
    pub ways: Vec<FoundBy>,
    /// Entries of the largest triangular factor: what memory and the time of an iteration grow with.
    pub factor_entries: usize,
    /// What a simulation with the controls that were found says, where it reached the end.
    #[serde(flatten, serialize_with = "super::forms::json::check")]
    pub check: Option<Check>,
    /// How many symbolic factorizations were made: patterns of matrices that had not been met before.
    #[serde(skip)]
    pub analyses: usize,
    /// Where its time went.
    #[serde(skip)]
    pub seconds: Seconds,
}

/// Seconds of parts of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seconds {
    /// From the system to a compiled program.
    pub build: f64,
    /// Certificates of all starts.
    pub certificates: f64,
    /// The simulation with the controls that were found.
    pub check: f64,
}

/// A grid on which a task was solved.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct GridTried {
    /// Elements per interval.
    pub elements: usize,
    /// Nodes per element.
    pub nodes: usize,
    /// The cost on it.
    pub objective: f64,
    /// By how much a simulation with its controls differs at the end, or in the objective where that is more; not finite
    /// where it does not reach the end.
    pub error: f64,
}

/// A point on the way to an optimum.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct FoundBy {
    /// What led to it.
    pub way: Way,
    /// Its objective.
    pub objective: f64,
}

/// What leads to points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Way {
    /// A relaxation of the program that falls, from a start.
    Relaxation,
    /// Descent in simulations with controls nearby.
    Descent,
    /// Other values of finite sets.
    Values,
    /// Simulations with controls all over their ranges.
    Elsewhere,
    /// Another sequence of events.
    Sequence,
    /// A finer grid.
    Grid,
    /// A simulation with the controls that a start without a solution has ended with.
    Simulation,
}

impl Way {
    /// The words of the report.
    pub fn words(self) -> &'static str {
        match self {
            Way::Relaxation => "a relaxation",
            Way::Descent => "descent in simulations",
            Way::Values => "other values of finite sets",
            Way::Elsewhere => "simulations far away",
            Way::Sequence => "another sequence of events",
            Way::Grid => "a finer grid",
            Way::Simulation => "a simulation",
        }
    }
}

/// What an optimum consists of.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Values {
    /// Free parameters, by their names with index.
    #[serde(serialize_with = "super::forms::json::as_map")]
    pub free: Vec<(String, f64)>,
    /// The terms of the objective, as they are written; none where they do not come apart.
    #[serde(rename = "objective_terms")]
    pub terms: Vec<Term>,
    /// Bounds with their multipliers; none where these are not known to be derivatives.
    pub constraints: Vec<Constraint>,
}

/// A term of the objective.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Term {
    /// As it is written.
    pub text: String,
    /// What it adds.
    pub value: f64,
}

/// A bound of a value, at some instants or at all of them.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Constraint {
    /// The value, in the names of the model.
    pub value: String,
    /// `<=`, `>=` or `=`.
    pub relation: &'static str,
    /// The bound.
    pub bound: f64,
    /// When it holds: `start`, `end`, `intervals`, `elements` or `nodes`; always without it.
    pub at: Option<&'static str>,
    /// The derivative of the least objective by the bound, which moves at all of its instants alike; none where there
    /// is no such derivative, as bounds hold the same value.
    pub multiplier: Option<f64>,
}

/// A simulation against the program.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Check {
    /// The largest difference of a state at the end.
    pub terminal_error: f64,
    /// The objective of the simulation less that of the program.
    pub objective_error: f64,
}

/// What simulations from event to event, with free quantities that differ by a little, say about a certificate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Confirmation {
    /// None of them has a smaller objective.
    Confirmed,
    /// The objective falls at this rate, per half of the range of a free quantity, and the program does not follow.
    Descent(f64),
    /// Nothing: they would take too long.
    TooLong,
    /// Nothing: some of them do not reach the end.
    Unfinished,
    /// Nothing: the one with the free quantities as they are misses the objective by more than a thousandth, or by more than descent gains.
    Differs,
    /// Nothing: there are none.
    #[default]
    None,
}

impl Confirmation {
    /// The word of the JSON form.
    pub fn as_str(self) -> &'static str {
        match self {
            Confirmation::Confirmed => "confirmed",
            Confirmation::Descent(_) => "descent",
            Confirmation::TooLong => "too_long",
            Confirmation::Unfinished => "unfinished",
            Confirmation::Differs => "differs",
            Confirmation::None => "none",
        }
    }

    /// Why a certificate is that of a program alone.
    pub fn reason(self) -> Option<&'static str> {
        match self {
            Confirmation::Confirmed | Confirmation::None => None,
            Confirmation::Descent(_) => {
                Some("simulations with other free quantities have smaller objectives")
            }
            Confirmation::TooLong => {
                Some("simulations with other free quantities would take too long")
            }
            Confirmation::Unfinished => {
                Some("not all simulations with other free quantities reach the end")
            }
            Confirmation::Differs => Some("the simulation differs too much to tell"),
        }
    }
}
