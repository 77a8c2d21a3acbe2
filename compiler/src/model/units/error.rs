//! What can be wrong with units (E023).

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::{Fix, Fixable, Help};
use crate::source::Span;

/// A mistake in a unit, or between units.
///
/// Units stand with the word before them: "in m/s", "a pure number".
/// Of what is wrong inside a function or a part, `call` is what leads there.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum UnitError {
    /// A name that is no coherent unit.
    #[error("`{name}` is not a coherent SI unit")]
    #[diagnostic(code(E0230), help("{help}"))]
    UnknownUnit {
        name: String,
        help: Help,
        #[label("not a unit")]
        span: Span,
    },

    /// An exponent that is no fraction of small numbers.
    #[error("the exponent of a unit must be a small whole number or a fraction")]
    #[diagnostic(code(E0230), help("write `m^2`, `s^-1` or `m^(1/2)`"))]
    UnitPower {
        #[label("no such power")]
        span: Span,
    },

    /// Terms, sides or branches with different units.
    #[error("{what} do not have one unit: the first is {first}, another {second}")]
    #[diagnostic(code(E0231), help("{help}"))]
    Different {
        what: &'static str,
        first: String,
        second: String,
        help: String,
        #[label("this is {first}")]
        first_span: Span,
        #[label("this is {second}")]
        second_span: Span,
        #[label(primary, "from here")]
        call: Option<Span>,
    },

    /// A value whose unit is not the declared one.
    #[error("{what} is {expected}, but what it gets is {found}")]
    #[diagnostic(code(E0232), help("{help}"))]
    WrongUnit {
        what: String,
        expected: String,
        found: String,
        help: String,
        #[label(primary, "this is {found}")]
        span: Span,
        #[label("declared to be {expected}")]
        declared: Option<Span>,
    },

    /// A right side of dynamics that is not a rate of its state.
    #[error("the rate of `{state}` is {rate}, but the right side is {found}")]
    #[diagnostic(code(E0233), help("{help}"))]
    WrongRate {
        state: String,
        unit: String,
        rate: String,
        found: String,
        help: String,
        #[label(primary, "this is {found}")]
        span: Span,
        #[label("`{state}` is {unit}, and its rate that per second: {rate}")]
        target: Span,
    },

    /// A quantity with a unit where only a pure number makes sense.
    #[error("{what} must be a pure number, and is {found}")]
    #[diagnostic(code(E0234), help("divide it by a quantity that is {found}"))]
    NotPure {
        what: String,
        found: String,
        #[label("this is {found}")]
        span: Span,
        #[label(primary, "from here")]
        call: Option<Span>,
    },

    /// A power of a quantity with a unit whose exponent may vary.
    #[error("the unit of this power depends on the value of its exponent")]
    #[diagnostic(
        code(E0235),
        help("write the exponent as a number, or divide the base by a quantity that is {base}")
    )]
    VariablePower {
        base: String,
        #[label("this is {base}")]
        base_span: Span,
        #[label("not a fixed number")]
        exponent: Span,
        #[label(primary, "from here")]
        call: Option<Span>,
    },
}

impl Fixable for UnitError {
    fn fix(&self) -> Option<Fix> {
        match self {
            UnitError::UnknownUnit { help, span, .. } => help.fix(*span),
            _ => None,
        }
    }
}
