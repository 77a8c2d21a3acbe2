//! Mistakes that only a lowering can see.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::Fixable;
use crate::source::Span;

/// Why a system cannot be stated in the formulation that was asked for.
#[derive(Clone, Debug, Error, Diagnostic)]
pub enum DcsError {
    /// A relay with memory has no complementarity form.
    #[error("relay `{name}` cannot be lowered to complementarity yet")]
    #[diagnostic(
        code(E0908),
        help("`lower timefreezing;` makes motion of it, and `method event` runs it as it is")
    )]
    Relay {
        /// Its name.
        name: String,
        /// Its statement.
        #[label("a switch with memory")]
        span: Span,
    },

    /// Stewart's reformulation weighs the rates of regions, which says nothing of hidden terms between them.
    #[error("`{name}` is read nonlinearly, and cannot be lowered to Stewart's form")]
    #[diagnostic(
        code(E0920),
        help("write `lower step;`, which keeps the rates as they are between both sides")
    )]
    Nonlinear {
        /// Its name.
        name: String,
        /// Its statement.
        #[label("`sliding nonlinear`")]
        span: Span,
    },

    /// A contact is struck, which pairs within elements do not say.
    #[error("the contact `{name}` gives impulses, which complementarity alone does not have")]
    #[diagnostic(code(E0904), help("{help}"))]
    Contact {
        /// Its name.
        name: String,
        /// What takes it.
        help: &'static str,
        /// Its statement.
        #[label("velocities jump where it is struck")]
        span: Span,
    },

    /// A jump has no complementarity form.
    #[error("{title} cannot be lowered to complementarity yet")]
    #[diagnostic(code(E0904), help("{help}"))]
    Jump {
        /// What it is called.
        title: String,
        /// What takes it.
        help: &'static str,
        /// Its statement.
        #[label("a jump")]
        span: Span,
    },

    /// Algebraic states, which have no regions.
    #[error("algebraic states cannot be lowered to Stewart's form")]
    #[diagnostic(
        code(E0906),
        help("write `lower step;`, which states equations and complementarities as they are")
    )]
    Algebraic {
        /// Their equation.
        #[label("not solved for one state")]
        span: Span,
    },

    /// Stewart's reformulation weighs regions.
    #[error("the projection onto `{name}` cannot be lowered to Stewart's form")]
    #[diagnostic(
        code(E0905),
        help("write `lower step;`, which states a projection by its force")
    )]
    Projection {
        /// Its constraint.
        name: String,
        /// Its row.
        #[label("kept by a force without a bound")]
        span: Span,
    },

    /// Stewart's reformulation weighs regions, and directions in a plane are a circle.
    #[error("friction in two directions of `{name}` cannot be lowered to Stewart's form")]
    #[diagnostic(
        code(E0905),
        help("write `lower step;`, which states friction by the direction of its slip")
    )]
    Disc {
        /// Its contact.
        name: String,
        /// Its statement.
        #[label("a slip velocity with two entries")]
        span: Span,
    },

    /// Stewart's reformulation needs one multiplier per region, and switches that multiply each other have 2^n of
    /// them. The step reformulation needs three variables per switch and one per product.
    #[error("{count} switches multiply each other, too many for `stewart`")]
    #[diagnostic(
        code(E0421),
        help("write `lower step;`, which has one variable per product")
    )]
    TooManyRegions {
        /// The number of switches that multiply each other.
        count: usize,
        /// The first of them.
        #[label("one of the {count} switches")]
        span: Span,
    },
}

impl Fixable for DcsError {}
