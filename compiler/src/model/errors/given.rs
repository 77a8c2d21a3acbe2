//! What can be wrong with domains, and with what is given from outside (E02).

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::Fixable;
use crate::source::Span;
use crate::syntax::{Path, Segment};

/// A mistake in a domain or in a value from outside.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum GivenError {
    /// Bounds the wrong way round.
    #[error("the lower bound of `{name}` is above the upper one")]
    #[diagnostic(code(E0221), help("write `in [lower, upper]`"))]
    EmptyBounds {
        name: String,
        #[label("contains no number")]
        span: Span,
    },

    /// A state that is to jump between values.
    #[error("state `{name}` cannot be in a finite set")]
    #[diagnostic(
        code(E0223),
        help("a state moves continuously: give bounds with `in [lo, hi]`, or make it a control")
    )]
    FiniteState {
        name: String,
        #[label("between its values, it is in none")]
        span: Span,
    },

    /// An entry of a structural constant from outside.
    #[error("`{name}` is a structural constant and given as a whole")]
    #[diagnostic(code(E0224), help("write `{name} = ..;` with all its entries"))]
    ConstantEntry {
        name: String,
        #[label("only a part of it")]
        span: Span,
    },
}

impl Fixable for GivenError {}

impl GivenError {
    /// What is wrong with giving a structural constant by this path, if anything is.
    pub(crate) fn constant_entry(path: &Path) -> Option<Self> {
        let Some(Segment::Index(_)) = path.rest.last() else {
            return None;
        };
        let last = |segment: &Segment| match segment {
            Segment::Field(field) => Some(field.name.clone()),
            Segment::Index(_) => None,
        };
        let name = path.rest.iter().rev().find_map(last);
        Some(GivenError::ConstantEntry {
            name: name.unwrap_or_else(|| path.head.name.clone()),
            span: path.span,
        })
    }
}
