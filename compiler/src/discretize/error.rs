//! What is too large to be discretized.

use thiserror::Error;

use super::{Cross, Grid, Options};
use crate::dcs::Dcs;

/// Why there is no discretization.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum DiscretizeError {
    /// The problem is larger than any solver takes.
    #[error(
        "the discretized system has about {size:.0e} arguments, more than {MOST_ARGUMENTS:.0e}"
    )]
    TooLarge {
        /// Arguments of all kernels at all places, about.
        size: f64,
    },
}

/// Arguments of all rows, which is what memory goes to.
const MOST_ARGUMENTS: f64 = 2e7;

/// Refuses what would not fit into memory.
pub(super) fn check_size(dcs: &Dcs, grid: Grid, options: &Options) -> Result<(), DiscretizeError> {
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
            Cross::SumTheta | Cross::SumLambda => nodes * (nodes + 2.0),
            Cross::SumBoth => 2.0 * nodes + 1.0,
        })
        * pairs;
    let size = elements * (collocation + pairs);
    if size > MOST_ARGUMENTS {
        return Err(DiscretizeError::TooLarge { size });
    }
    Ok(())
}
