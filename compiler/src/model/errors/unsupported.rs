//! What the language has and this version does not lower yet: one error per construct.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::Fixable;
use crate::source::Span;

/// A construct of the language that cannot be lowered yet (E09).
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum Unsupported {
    /// Large symbolic inverses.
    #[error("the inverse of a {size} by {size} matrix is not supported yet")]
    #[diagnostic(code(E0912), help("symbolic matrices can be inverted up to 4 by 4"))]
    LargeInverse {
        size: usize,
        #[label("{size} by {size}")]
        span: Span,
    },
}

impl Fixable for Unsupported {}
