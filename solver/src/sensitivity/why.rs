//! Why derivatives are not known.

use crate::runtime::limit::Over;

/// From when on a derivative is not known, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// When.
    pub time: f64,
    /// Why.
    pub why: Why,
    /// The switches of the surfaces that it is about.
    pub switches: Vec<usize>,
}

/// Why a derivative is not known, or does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Why {
    /// The rate of what is met vanishes: the instant has no derivative.
    #[error("a surface is met tangentially")]
    Grazing,
    /// What lies on a surface leaves it to one side or the other as the parameter changes.
    #[error(
        "surfaces meet in one point, and what comes next depends on which of them is met first"
    )]
    Several,
    /// The run starts on a surface, and on one of its sides for other values.
    #[error("the run starts on a surface, which other values leave to one side or the other")]
    Start,
    /// The run stays on a surface without sliding on it, and leaves it to one side or the other.
    #[error("the run rests on a surface, which other values leave to one side or the other")]
    Rests,
    /// Infinitely many events.
    #[error("infinitely many events accumulate")]
    Accumulation,
    /// A nonlinear sliding mode ends in a fold.
    #[error("a sliding mode ends in a fold")]
    Fold,
    /// A law jumps in a way that is not differentiated.
    #[error("the state jumps in a way of which no derivative is known")]
    Jump,
    /// Sliding is not determined by its equations alone.
    #[error("rates do not determine sliding independently")]
    Singular,
    /// What the run did is not what its functions say.
    #[error("the run moves in a way of which no derivative is known")]
    Unknown,
    /// The tangent is not found to its tolerance.
    #[error("the tangent is not smooth enough to be integrated")]
    Rough,
    /// A run with finer elements has another tangent.
    #[error(
        "a run with finer elements has another derivative: a smaller tolerance, or more steps, may find it"
    )]
    Coarse,
    /// The time of the run is up.
    #[error("the time is up")]
    TimeLimit,
    /// The run is canceled.
    #[error("the run was canceled")]
    Canceled,
}

impl From<Over> for Why {
    fn from(over: Over) -> Self {
        match over {
            Over::TimeLimit => Why::TimeLimit,
            Over::Canceled => Why::Canceled,
        }
    }
}
