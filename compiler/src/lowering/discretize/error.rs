//! What cannot be discretized.

use rustc_hash::FxHashMap;
use thiserror::Error;

use super::layout::ends::{End, Start};
use super::{Grid, Options};
use crate::expr::{Expr, Var};
use crate::lowering::dcs::Dcs;
use crate::source::Span;
use crate::system::experiment::Cross;

/// Why there is no discretization.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum DiscretizeError {
    /// The problem is larger than any solver takes.
    #[error(
        "the discretized system has about {size:.0e} arguments, more than {MOST_ARGUMENTS:.0e}"
    )]
    TooLarge {
        /// Arguments of all kernels at all places, about.
        size: f64,
    },
    /// A cost or constraint at an instant at which what it contains has no value.
    #[error("`{name}` has no value at the instants of a constraint or cost")]
    NoValue {
        /// The variable.
        name: String,
        /// The constraint or cost.
        span: Span,
    },
    /// What happens at instants, where elements end at none of them.
    #[error(
        "`elements plain` has no ends of elements at {what}; give a number of `elements`, {instead}"
    )]
    Plain {
        /// What happens.
        what: &'static str,
        /// Another way out.
        instead: &'static str,
    },
    /// The continuous algebraic variables have no values to start from.
    #[error("`0 = {row}` does not hold at t = {time}")]
    Start {
        /// When.
        time: f64,
        /// The equation.
        row: String,
    },
}

/// Residuals above this, relative to the largest value, are no rounding.
const ROUNDING: f64 = 1e-10;

/// Refuses a start where the guesses of z, which are the values for x at the start, violate equations of what is continuous.
fn check_start(dcs: &Dcs, start: f64) -> Result<(), DiscretizeError> {
    let params = dcs.params.iter().map(|param| (param.var, param.value));
    let states = dcs.states.iter().map(|state| (state.var, state.initial));
    let algebraics = dcs.algebraics.iter().map(|z| (z.var, z.guess));
    let data = dcs
        .data
        .iter()
        .map(|data| (data.var, data.table.value(start)));
    let values: FxHashMap<Var, f64> = (params.chain(states).chain(algebraics).chain(data))
        .chain([(dcs.time, start)])
        .filter_map(|(var, value)| Some((var.as_variable()?, value)))
        .collect();
    let scale = values
        .values()
        .fold(1.0, |scale: f64, value| scale.max(value.abs()));
    let value = |var: Var| values.get(&var).copied().unwrap_or(f64::NAN);
    let holds = |row: &Expr| row.eval(&value).abs() <= ROUNDING * scale;
    let rows = End::new(dcs).equations;
    let mut rows = rows.iter().map(|&row| dcs.rows.equations[row]);
    match rows.find(|row| !holds(row)) {
        Some(row) => Err(DiscretizeError::Start {
            time: start,
            row: row.to_string(),
        }),
        None => Ok(()),
    }
}

/// The same where z are known at the start.
pub fn check_given(dcs: &Dcs, start: f64) -> Result<(), DiscretizeError> {
    match Start::of(dcs).is_free {
        true => Ok(()),
        false => check_start(dcs, start),
    }
}

/// Refuses what needs the detection of switches, where something is optimized without.
pub(crate) fn check_plain(dcs: &Dcs, options: &Options) -> Result<(), DiscretizeError> {
    let refused = match (dcs.impacts.is_empty(), dcs.switches.branches.is_empty()) {
        _ if dcs.task.is_none() || options.elements.detection().is_some() => return Ok(()),
        (false, _) => ["impacts", "or take `lower timefreezing;`"],
        (_, false) => [
            "folds of nonlinear sliding",
            "or read the switch `sliding linear`",
        ],
        _ => return Ok(()),
    };
    let [what, instead] = refused;
    Err(DiscretizeError::Plain { what, instead })
}

/// Arguments of all rows, which is what memory goes to.
const MOST_ARGUMENTS: f64 = 2e7;

/// Refuses what would not fit into memory.
pub(crate) fn check_size(dcs: &Dcs, grid: Grid, options: &Options) -> Result<(), DiscretizeError> {
    let number = |n: usize| n as f64;
    let nodes = number(options.scheme.1);
    let (states, algebraics) = (number(dcs.states.len()), number(dcs.algebraics.len()));
    let elements = number(grid.steps) * number(options.elements.count());
    let collocation = nodes * (states * (nodes + 3.0) + 2.0 * algebraics);
    let pairs = 2.0 * number(dcs.rows.pairs.len());
    let detection = options.elements.detection();
    let pairs = detection.map_or(nodes, |detection| match detection.cross {
        Cross::All => nodes * (nodes + 1.0),
        Cross::SumTheta | Cross::SumLambda => nodes * (nodes + 2.0),
        Cross::SumBoth => 2.0 * nodes + 1.0,
    }) * pairs;
    let size = elements * (collocation + pairs);
    if size > MOST_ARGUMENTS {
        return Err(DiscretizeError::TooLarge { size });
    }
    Ok(())
}
