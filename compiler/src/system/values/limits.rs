//! Where states, controls and inputs are meant to stay: `in [lo, hi]`, `in {0, 1}`.

use std::fmt;

use crate::expr::Expr;
use crate::model::{Domain, Quantity};
use crate::source::Span;

/// A scalar that is watched during a run.
#[derive(Clone, Debug)]
pub struct Limit<'e> {
    /// `state`, `control` or `input`.
    pub kind: &'static str,
    /// Name with index: `u[2]`.
    pub name: String,
    /// Its value in time, parameters, states and α.
    pub value: Expr<'e>,
    /// Where it is meant to be.
    pub allowed: Allowed,
    /// Whether a floor of it is a sum of steps, no more than this allows.
    pub is_counted: bool,
    /// The declaration.
    pub span: Span,
}

/// Numbers that a scalar may have.
#[derive(Clone, Debug, PartialEq)]
pub enum Allowed {
    /// From a lower to an upper bound; bounds may be infinite.
    Between(f64, f64),
    /// One of these.
    OneOf(Vec<f64>),
}

impl Allowed {
    /// The domain of an entry of a quantity, where it has one.
    pub(crate) fn of<'e>(
        quantity: &Quantity<'e>,
        entry: usize,
        number: &impl Fn(Expr<'e>) -> f64,
    ) -> Option<Self> {
        Some(match quantity.domain.as_ref()? {
            Domain::Box(lo, hi) => Allowed::Between(number(lo.data[entry]), number(hi.data[entry])),
            Domain::Set(values) => Allowed::OneOf(values.iter().map(|&e| number(e)).collect()),
        })
    }

    /// The allowed number that is nearest to a value.
    pub fn nearest(&self, value: f64) -> f64 {
        match self {
            Allowed::Between(lo, hi) => value.max(*lo).min(*hi),
            Allowed::OneOf(values) => {
                let distance = |x: &f64| (x - value).abs();
                let nearest = values.iter().copied();
                let nearest = nearest.min_by(|a, b| distance(a).total_cmp(&distance(b)));
                nearest.unwrap_or(value)
            }
        }
    }

    /// Whether a value is allowed, or misses by `slack` at most.
    pub fn holds(&self, value: f64, slack: f64) -> bool {
        match self {
            Allowed::Between(lo, hi) => lo - slack <= value && value <= hi + slack,
            Allowed::OneOf(values) => values.iter().any(|other| (value - other).abs() <= slack),
        }
    }
}

/// `[0, 1]` or `{0, 1}`
impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Allowed::Between(lo, hi) => write!(f, "[{lo}, {hi}]"),
            Allowed::OneOf(values) => {
                let values: Vec<String> = values.iter().map(f64::to_string).collect();
                write!(f, "{{{}}}", values.join(", "))
            }
        }
    }
}
