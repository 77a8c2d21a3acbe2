//! What the language has and this version does not lower yet: one error per construct.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::Diagnostics;
use crate::source::Span;
use crate::syntax::Stmt;

/// A construct of the language that cannot be lowered yet (E09).
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum Unsupported {
    /// Friction along a surface in space.
    #[error("friction with several slip velocities is not supported yet")]
    #[diagnostic(
        code(E0903),
        help("`slip` is one velocity: in the plane a surface has one direction")
    )]
    FrictionInSpace {
        #[label("several velocities")]
        span: Span,
    },

    /// Convex programs and variational inequalities.
    #[error("convex programs and variational inequalities are not supported yet")]
    #[diagnostic(
        code(E0907),
        help("projections onto boxes can be written with `min` and `max`")
    )]
    Programs {
        #[label("a program")]
        span: Span,
    },

    /// Large symbolic inverses.
    #[error("the inverse of a {size} by {size} matrix is not supported yet")]
    #[diagnostic(code(E0912), help("symbolic matrices can be inverted up to 4 by 4"))]
    LargeInverse {
        size: usize,
        #[label("{size} by {size}")]
        span: Span,
    },
}

/// Reports a statement that cannot be lowered.
pub(super) fn check(stmt: &Stmt, diags: &mut Diagnostics) {
    if let Some(error) = refusal(stmt) {
        diags.push(error);
    }
}

/// True for a declaration whose name cannot be used either.
pub(super) fn is_refused(stmt: &Stmt) -> bool {
    refusal(stmt).is_some()
}

fn refusal(stmt: &Stmt) -> Option<Unsupported> {
    match stmt {
        Stmt::Program(program) => Some(Unsupported::Programs { span: program.span }),
        _ => None,
    }
}
