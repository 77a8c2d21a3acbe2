//! What an `optimize` asks of a system.
//!
//! minimize φ(x(T), T, p)   over u, T, free p and free x(0),   subject to   l <= c(t, x(t), u(t), p) <= h at instants
//!
//! An integral of the cost is a state of the system that starts at 0 and nothing reads: φ contains its value at the
//! end. What the user wrote with switches contains α here, as rates do.

use std::fmt;

use super::System;
use crate::expr::{Expr, Substitution, variables_of};
use crate::source::Span;
use crate::system::values::limits::Allowed;

pub use super::experiment::{At, Cost, Holds, Lengths, Norm, Penalty, Shape, Term};

/// The problem of an `optimize`, in terms of a system.
#[derive(Clone, Debug)]
pub struct Task<'e> {
    /// u.
    pub controls: Vec<Control<'e>>,
    /// What controls are within an interval.
    pub shape: Shape,
    /// How long control intervals are.
    pub lengths: Lengths,
    /// Bounds of T, where it is free.
    pub horizon: Option<(f64, f64)>,
    /// The parameter that T is, where it is a number of every run.
    pub length: Option<Expr<'e>>,
    /// Parameters that are optimized, by their place in the system.
    pub params: Vec<Free>,
    /// States with a free initial value, by their place in the system.
    pub initial: Vec<Free>,
    /// Bounds of states, by their place in the system.
    pub bounds: Vec<Free>,
    /// How many of the last states are integrals.
    pub integrals: usize,
    /// The state that is physical time, where the system is in numerical time.
    pub clock: Option<usize>,
    /// φ, at the end.
    pub cost: Cost<'e>,
    /// Constraints.
    pub rows: Vec<TaskRow<'e>>,
}

/// A scalar control.
#[derive(Clone, Debug)]
pub struct Control<'e> {
    /// Name with index: `u[2]`.
    pub name: String,
    /// Its variable.
    pub var: Expr<'e>,
    /// Where it may be.
    pub allowed: Option<Allowed>,
    /// Its default, or zero.
    pub default: f64,
    /// The declaration.
    pub span: Span,
}

impl Control<'_> {
    /// The finite set of its values, if that is what is allowed.
    pub fn values(&self) -> Option<&[f64]> {
        match &self.allowed {
            Some(Allowed::OneOf(values)) => Some(values),
            _ => None,
        }
    }

    /// What is allowed and near to its default.
    pub fn guess(&self) -> f64 {
        let allowed = self.allowed.as_ref();
        allowed.map_or(self.default, |allowed| allowed.nearest(self.default))
    }
}

/// A quantity with bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Free {
    /// Its place.
    pub place: usize,
    /// Lower bound, or minus infinity.
    pub lower: f64,
    /// Upper bound, or infinity.
    pub upper: f64,
}

/// lower <= value <= upper at some instants.
#[derive(Clone, Debug)]
pub struct TaskRow<'e> {
    /// What it bounds, in the names of the model; none where it only states what follows from something else.
    pub name: Option<String>,
    /// In time, parameters, states, controls and α.
    pub value: Expr<'e>,
    /// A number or minus infinity.
    pub lower: f64,
    /// A number or infinity.
    pub upper: f64,
    /// When.
    pub at: At,
    /// How.
    pub holds: Holds<'e>,
    /// The state whose initial value follows from it, by its place: it says x(0) - x_0(p) = 0.
    pub starts: Option<usize>,
    /// The row.
    pub span: Span,
}

impl<'e> Task<'e> {
    /// Everything that contains variables of the system.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        [self.cost.value].into_iter().chain(self.in_rows())
    }

    /// What constraints contain.
    pub fn in_rows(&self) -> impl Iterator<Item = Expr<'e>> + '_ {
        self.rows.iter().flat_map(TaskRow::exprs)
    }

    /// The same in other variables.
    pub fn map(&self, f: impl Fn(Expr<'e>) -> Expr<'e>) -> Self {
        let mut task = self.clone();
        task.cost = task.cost.map(&f);
        for row in &mut task.rows {
            row.value = f(row.value);
            row.holds = row.holds.map(&f);
        }
        task
    }
}

impl<'e> TaskRow<'e> {
    /// Everything that contains variables of the system.
    pub fn exprs(&self) -> impl Iterator<Item = Expr<'e>> + use<'e> {
        [self.value].into_iter().chain(self.holds.exprs())
    }

    /// Whether it holds at the start, too: where an initial value that is free is in it.
    pub fn is_at_start(&self, mut freed: impl Iterator<Item = Expr<'e>>) -> bool {
        let occurring = variables_of(&self.exprs().collect::<Vec<_>>());
        let is_inside = |state: Expr<'e>| {
            state
                .as_variable()
                .is_some_and(|var| occurring.contains(&var))
        };
        freed.any(is_inside)
    }
}

/// The cost and the constraints, one per line.
impl fmt::Display for Task<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, true)
    }
}

impl Task<'_> {
    /// With the numbers of bounds, or only which bounds there are.
    pub(crate) fn write(&self, f: &mut impl fmt::Write, with_numbers: bool) -> fmt::Result {
        let number = |value: f64, instead: &str| match with_numbers {
            true => value.to_string(),
            false => instead.to_owned(),
        };
        for control in &self.controls {
            write!(f, "control {}", control.name)?;
            match &control.allowed {
                Some(allowed) if with_numbers => writeln!(f, " in {allowed}")?,
                Some(Allowed::Between(..)) => writeln!(f, " in bounds")?,
                Some(Allowed::OneOf(_)) => writeln!(f, " in a finite set")?,
                None => writeln!(f)?,
            }
        }
        writeln!(f, "minimize {} at the end", self.cost.value)?;
        for row in &self.rows {
            let value = row.value;
            let (lower, upper) = (number(row.lower, "lower"), number(row.upper, "upper"));
            match (row.lower.is_finite(), row.upper.is_finite()) {
                _ if let Holds::Against(other) = row.holds => {
                    write!(f, "0 <= {value} perp {other} >= 0")?;
                }
                _ if row.lower == row.upper => {
                    write!(f, "{value} = {}", number(row.lower, "number"))?;
                }
                (true, true) => write!(f, "{lower} <= {value} <= {upper}")?,
                (true, false) => write!(f, "{value} >= {lower}")?,
                _ => write!(f, "{value} <= {upper}")?,
            }
            write!(f, " at {}", row.at.as_str())?;
            match row.holds {
                Holds::Softly(Penalty { norm, weight }) => {
                    writeln!(f, " soft {} weight {weight}", norm.word())?;
                }
                Holds::Strictly | Holds::Against(_) => writeln!(f)?,
            }
        }
        Ok(())
    }
}

impl<'e> System<'e> {
    /// Whether a parameter is optimized.
    pub fn is_free(&self, param: usize) -> bool {
        let mut free = self.task.iter().flat_map(|task| &task.params);
        free.any(|free| free.place == param)
    }

    /// The values of the parameters at these places.
    pub(crate) fn values_of(&self, places: &[usize]) -> Vec<f64> {
        let values = self.exogenous.chosen(places).map(|param| param.value);
        values.collect()
    }

    /// The values of some parameters, by place.
    pub(crate) fn params_as_numbers(&self, holds: impl Fn(usize) -> bool) -> Substitution<'e> {
        let params = self.exogenous.params.iter().enumerate();
        let numbers = params
            .filter(|(place, _)| holds(*place))
            .map(|(_, param)| param);
        numbers
            .filter_map(|param| Some((param.var.as_variable()?, self.exprs.constant(param.value))))
            .collect()
    }
}
