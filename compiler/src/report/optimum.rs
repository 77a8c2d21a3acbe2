//! How an optimum was found, and what a simulation says about it.

use nsd_solver::mpcc::Spread;

/// What is known about an optimum besides its certificate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Optimum {
    /// Seconds from the system to a compiled program.
    pub built_s: f64,
    /// Entries of the largest triangular factor: what memory and the time of an iteration grow with.
    pub factor_entries: usize,
    /// From how many points it was looked for.
    pub starts: usize,
    /// How the objectives of all starts spread, where some start led to a feasible point.
    pub spread: Option<Spread>,
    /// Seconds of the solver per start, the median.
    pub median_s: f64,
    /// Seconds of certificates of all starts.
    pub certificate_s: f64,
    /// Seconds of the simulation with the controls that were found.
    pub check_s: f64,
    /// In how many other branches the same trajectory has a description; near none of them is a better one.
    pub branches: usize,
    /// What simulations with other free quantities say about the certificate.
    pub confirmation: Confirmation,
    /// What a simulation with the controls that were found says, where it reached the end.
    pub check: Option<Check>,
}

/// A simulation against the program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
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
    /// The objective falls at this rate, per size of a free quantity, and the program does not follow.
    Descent(f64),
    /// They would take too long.
    TooLong,
    /// Nothing: there is none, or some of them do not reach the end.
    #[default]
    Nothing,
}
