//! How a run ended, what it cost, and what is known about its result.

use nsd_solver::optimization::mpcc::Class;

/// How a run ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Status {
    /// To the end of the horizon, or to a solution.
    Solved,
    /// To a point that satisfies all constraints, and is not known to be an optimum.
    Feasible,
    /// A stationary point of the violation of the constraints.
    LocallyInfeasible,
    /// The cost has no lower bound.
    Unbounded,
    /// Out of steps, events or iterations.
    IterationLimit,
    /// Out of time.
    TimeLimit,
    /// Canceled from outside.
    Canceled,
    /// Anything else: no or no unique solution, numbers that are not finite.
    #[default]
    NumericalFailure,
}

impl Status {
    /// All of them.
    pub const ALL: [Status; 8] = [
        Status::Solved,
        Status::Feasible,
        Status::LocallyInfeasible,
        Status::Unbounded,
        Status::IterationLimit,
        Status::TimeLimit,
        Status::Canceled,
        Status::NumericalFailure,
    ];

    /// Whether it was ended from outside before it was done.
    pub fn is_over(self) -> bool {
        matches!(self, Status::TimeLimit | Status::Canceled)
    }

    /// The word of the language.
    pub fn as_str(self) -> &'static str {
        match self {
            Status::Solved => "solved",
            Status::Feasible => "feasible",
            Status::LocallyInfeasible => "locally_infeasible",
            Status::Unbounded => "unbounded",
            Status::IterationLimit => "iteration_limit",
            Status::TimeLimit => "time_limit",
            Status::Canceled => "canceled",
            Status::NumericalFailure => "numerical_failure",
        }
    }
}

/// What a run cost. Counts that a method has no use for are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Stats {
    /// Seconds from the source text to something that can be solved.
    pub compile_s: f64,
    /// Seconds of solving.
    pub solve_s: f64,
    /// Steps or elements.
    pub steps: u64,
    /// Evaluations of the right-hand side.
    pub rhs_evaluations: u64,
    /// Newton or interior point iterations.
    pub newton_iterations: u64,
    /// Factorizations of a matrix.
    pub factorizations: u64,
    /// Values of the homotopy parameter.
    pub homotopy_steps: u64,
    /// Largest violation of complementarity.
    pub complementarity_residual: f64,
    /// Residual of the first-order conditions.
    pub kkt_residual: f64,
}

/// What is known about a result.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Certificate {
    /// Kind of stationarity of an optimum.
    pub stationarity: Stationarity,
    /// Largest violation of any equation or inequality.
    pub max_violation: f64,
}

/// Kinds of stationarity of an MPCC, from strong to weak.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stationarity {
    /// Strong.
    S,
    /// Mordukhovich.
    M,
    /// Clarke.
    C,
    /// Alternative.
    A,
    /// Weak.
    W,
    /// Bouligand.
    B,
    /// Not an optimization, or not known.
    #[default]
    None,
}

impl Stationarity {
    /// The strongest statement: S implies B, B implies nothing that the multipliers would show.
    pub(crate) fn of(class: Class, b_stationary: Option<bool>) -> Self {
        match (class, b_stationary) {
            (Class::S, _) => Stationarity::S,
            (_, Some(true)) => Stationarity::B,
            (Class::M, _) => Stationarity::M,
            (Class::C, _) => Stationarity::C,
            (Class::A, _) => Stationarity::A,
            (Class::W, _) => Stationarity::W,
            (Class::None, _) => Stationarity::None,
        }
    }

    /// The word of the JSON form.
    pub fn as_str(self) -> &'static str {
        match self {
            Stationarity::S => "S",
            Stationarity::M => "M",
            Stationarity::C => "C",
            Stationarity::A => "A",
            Stationarity::W => "W",
            Stationarity::B => "B",
            Stationarity::None => "none",
        }
    }
}
