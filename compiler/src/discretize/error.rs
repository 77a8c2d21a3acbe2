//! What cannot be discretized.

use miette::Diagnostic;
use nsd_solver::tableau::{Family, TableauError};
use thiserror::Error;

use super::{Cross, Grid, Options};
use crate::dcs::Dcs;
use crate::source::Span;

/// Why there is no discretization.
#[derive(Clone, Debug, Error, Diagnostic)]
pub enum DiscretizeError {
    /// The family has no method with this number of nodes.
    #[error("{source}")]
    #[diagnostic(code(E0511), help("choose a number of nodes that the family has"))]
    Scheme {
        /// What is wrong with it.
        source: TableauError,
        /// The method.
        #[label("the scheme of this method")]
        span: Span,
    },

    /// Only a collocation method without a node at the left end has an integral form.
    #[error("`{}` has no integral form", .family.word())]
    #[diagnostic(
        code(E0512),
        help("write `form = differential`, or choose `radau_iia` or `gauss`")
    )]
    NoIntegralForm {
        /// The family.
        family: Family,
        /// The method.
        #[label("the nodes do not determine a polynomial that satisfies the equation")]
        span: Span,
    },

    /// The problem is larger than any solver takes.
    #[error(
        "the discretized problem has about {size:.0e} arguments, more than {MOST_ARGUMENTS:.0e}"
    )]
    #[diagnostic(
        code(E0513),
        help("take fewer steps or elements, or add up pairs with `cross = sum_both`")
    )]
    TooLarge {
        /// Arguments of all kernels at all places, about.
        size: f64,
        /// The experiment.
        #[label("discretized as a whole")]
        span: Span,
    },
}

/// Arguments of all rows, which is what memory goes to.
const MOST_ARGUMENTS: f64 = 2e7;

/// Refuses what would not fit into memory.
pub(super) fn check_size(
    dcs: &Dcs,
    grid: Grid,
    options: &Options,
    span: Span,
) -> Result<(), DiscretizeError> {
    let number = |n: usize| n as f64;
    let nodes = number(options.scheme.1);
    let (states, algebraics) = (number(dcs.states.len()), number(dcs.algebraics.len()));
    let elements = number(grid.steps) * options.detection.map_or(1.0, |d| number(d.elements));
    let collocation = nodes * (states * (nodes + 3.0) + 2.0 * algebraics);
    let pairs = 2.0 * number(dcs.pairs.len());
    let pairs = options
        .detection
        .map_or(nodes, |detection| match detection.cross {
            Cross::All => nodes * (nodes + 1.0),
            Cross::SumJumps | Cross::SumContinuous => nodes * (nodes + 2.0),
            Cross::SumBoth => 2.0 * nodes + 1.0,
        })
        * pairs;
    let size = elements * (collocation + pairs);
    if size > MOST_ARGUMENTS {
        return Err(DiscretizeError::TooLarge { size, span });
    }
    Ok(())
}
