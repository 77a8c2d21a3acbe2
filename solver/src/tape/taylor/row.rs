//! Rows of Taylor coefficients, as recurrences read them.

/// The degree in time of a row about which nothing is known.
pub(crate) const UNBOUNDED: u32 = u32::MAX;

/// Where the coefficients of an input are, and what is known of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub start: usize,
    /// Degree as a polynomial in time.
    pub degree: u32,
    /// What the coefficients depend on.
    pub depends: Depends,
}

/// The most that a series depends on: time and numbers, states, or α that have still to be solved for.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Depends {
    Time,
    State,
    Alpha,
}
