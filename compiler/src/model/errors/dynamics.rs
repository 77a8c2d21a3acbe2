//! What can be wrong with dynamics, regions and switches (E03).

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::{Applicability, Fix, Fixable, Help};
use crate::source::Span;
use crate::syntax::Path;

/// A mistake in who sets what, and where.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum DynamicsError {
    /// A state without dynamics.
    #[error("state `{name}` has no dynamics")]
    #[diagnostic(
        code(E0301),
        help("add `{entry}' = ..;`, or declare `discrete` what only jumps set")
    )]
    NoDynamics {
        name: String,
        entry: String,
        #[label("`{entry}` is never set")]
        span: Span,
    },

    /// A state set twice.
    #[error("the dynamics of `{entry}` are set twice")]
    #[diagnostic(code(E0302), help("use `+=` to add a term"))]
    SetTwice {
        entry: String,
        #[label("set here")]
        first: Span,
        #[label(primary, "and again here")]
        second: Span,
    },

    /// Dynamics of something that is not a state.
    #[error("`{name}` is a {kind}, not a state")]
    #[diagnostic(code(E0303))]
    NotAState {
        name: String,
        kind: &'static str,
        #[label("has no dynamics")]
        span: Span,
        #[help]
        help: Option<String>,
    },

    /// Dynamics of a discrete state.
    #[error("`{name}` is discrete: only jumps set it")]
    #[diagnostic(code(E0303), help("declare `state {name} = ..;`"))]
    Discrete {
        name: String,
        #[label("has no dynamics")]
        span: Span,
    },

    /// A region of a partition that leaves out a state the others set.
    #[error("region `{region}` does not set `{entry}`")]
    #[diagnostic(code(E0304), help("add `{entry}' = ..;` to region `{region}`"))]
    RegionMisses {
        region: String,
        entry: String,
        #[label("set here, in region `{other}`")]
        first: Span,
        #[label(primary, "not set here")]
        second: Span,
        other: String,
    },

    /// An `else` without other regions.
    #[error("region `{region}` is the rest of nothing")]
    #[diagnostic(
        code(E0305),
        help("an `else` region sets the states that other regions set")
    )]
    ElseAlone {
        region: String,
        #[label("no other region sets these states")]
        span: Span,
    },

    /// Two `else` regions of one partition.
    #[error("two `else` regions set `{entry}`")]
    #[diagnostic(code(E0306), help("give one of them a guard"))]
    TwoElse {
        entry: String,
        #[label("the rest")]
        first: Span,
        #[label(primary, "the rest again")]
        second: Span,
    },

    /// A region with one partner only in name: nothing covers the rest.
    #[error("nothing sets `{entry}` outside region `{region}`")]
    #[diagnostic(code(E0307), help("add the other regions, or one with `else`"))]
    LoneRegion {
        region: String,
        entry: String,
        #[label("set here only")]
        span: Span,
        /// The region, and all that it sets.
        statement: Span,
        entries: Vec<String>,
    },

    /// An indicator without others: it is compared with nothing.
    #[error("the indicator of region `{region}` has nothing to compare with")]
    #[diagnostic(
        code(E0307),
        help("set the same states in other regions, each with its indicator")
    )]
    LoneIndicator {
        region: String,
        #[label("the only region of its partition")]
        span: Span,
    },

    /// A comparison that never changes.
    #[error("this comparison is always {value}")]
    #[diagnostic(code(E0308), help("a guard must depend on the state or on time"))]
    ConstantComparison {
        value: bool,
        #[label("constant")]
        span: Span,
    },

    /// A guard that holds nowhere, or on a surface only.
    #[error("this guard holds on a thin set at most")]
    #[diagnostic(
        code(E0309),
        help("`<` and `<=` are the same; a surface belongs to no region")
    )]
    ThinGuard {
        #[label("needs both sides of one surface at once")]
        span: Span,
    },

    /// `hidden` that sets.
    #[error("hidden terms add to the dynamics")]
    #[diagnostic(code(E0310), help("write `+=`"))]
    HiddenSets {
        #[label("sets")]
        span: Span,
        operator: Span,
    },

    /// A hidden term that is not hidden.
    #[error("this hidden term does not vanish at {at}")]
    #[diagnostic(code(E0311), help("multiply it by `{factor}`"))]
    HiddenVisible {
        at: String,
        factor: String,
        witness: String,
        #[label("is {witness} there")]
        span: Span,
    },

    /// A hidden term of which it is not known whether it is one.
    #[error("this hidden term is not proven to vanish at {at}")]
    #[diagnostic(
        code(E0311),
        help(
            "write it as a multiple of `{factor}`, or give the states and parameters in it a range, as in `state x in [-1, 1] = 0;`"
        )
    )]
    HiddenOpen {
        at: String,
        factor: String,
        #[label("may be something else than zero there")]
        span: Span,
    },

    /// A hidden term with too many combinations of sides.
    #[error("this hidden term holds {count} entries of `{name}`")]
    #[diagnostic(
        code(E0311),
        help("split it into terms that hold at most {most} entries each")
    )]
    HiddenEntries {
        name: String,
        count: usize,
        most: usize,
        #[label("has more combinations of sides than are looked at")]
        span: Span,
    },

    /// `hidden on` something else.
    #[error("`{name}` is not a named `sign` or `step`")]
    #[diagnostic(code(E0312), help("declare `switch s = sign(..);`"))]
    NotASwitch {
        name: String,
        #[label("needs a switch")]
        span: Span,
    },

    /// A `switch` that is none.
    #[error("a switch is `sign(..)`, `step(..)` or `hysteresis(..)`")]
    #[diagnostic(code(E0313), help("use `let` for other expressions"))]
    SwitchForm {
        #[label("something else")]
        span: Span,
    },

    /// A relay with memory that is not described completely.
    #[error("this is no relay: {what}")]
    #[diagnostic(
        code(E0315),
        help(
            "write `hysteresis(y, on = 18, off = 20)`, with thresholds over params, and `start = 1` where y starts between them"
        )
    )]
    RelayForm {
        what: String,
        #[label("here")]
        span: Span,
    },

    /// Guards and indicators in one partition.
    #[error("region `{first}` has an indicator and region `{second}` has none")]
    #[diagnostic(
        code(E0316),
        help("give every region of the partition an indicator, or every one a guard")
    )]
    MixedGuards {
        first: String,
        second: String,
        #[label("where this is the smallest")]
        first_span: Span,
        #[label(primary, "sets the same states{note}")]
        second_span: Span,
        note: &'static str,
    },

    /// Indicators that are never equal, or always.
    #[error("the indicators of `{first}` and `{second}` {relation}")]
    #[diagnostic(
        code(E0317),
        help("their difference must change its sign across the surface between the regions")
    )]
    NoBoundary {
        first: String,
        second: String,
        relation: String,
        #[label("one indicator")]
        first_span: Span,
        #[label(primary, "the other")]
        second_span: Span,
    },

    /// A state that a jump sets twice.
    #[error("the jump sets `{name}` twice")]
    #[diagnostic(
        code(E0318),
        help("right-hand sides are values before the jump: write one reset for each state")
    )]
    ResetTwice {
        name: String,
        #[label("set here")]
        first: Span,
        #[label(primary, "and here")]
        span: Span,
    },

    /// A law of restitution that there is not.
    #[error("{what}")]
    #[diagnostic(code(E0319))]
    NoLaw {
        what: String,
        #[help]
        help: Help,
        #[label("here")]
        span: Span,
    },

    /// A block of mechanics, or a contact, that is not described as it must be.
    #[error("{what}")]
    #[diagnostic(code(E0319), help("{help}"))]
    MechanicsForm {
        what: String,
        help: String,
        #[label("here")]
        span: Span,
    },

    /// A projection whose set or metric is none.
    #[error("{what}")]
    #[diagnostic(
        code(E0323),
        help(
            "write `project x onto {{ c >= 0; lo <= x <= hi; }}`, and after the braces `metric E` where E is no identity: a number, or a symmetric matrix"
        )
    )]
    ProjectionForm {
        what: String,
        #[label("here")]
        span: Span,
    },

    /// Members of a complementarity that do not go together.
    #[error("the members of a complementarity are {expected} and {found}")]
    #[diagnostic(
        code(E0324),
        help("write two members of one shape; a scalar goes with every entry")
    )]
    UnequalMembers {
        expected: String,
        found: String,
        #[label("{found}")]
        span: Span,
    },

    /// Algebraic states without an equation each.
    #[error("{unknowns} algebraic states, but {rows} equations and complementarities")]
    #[diagnostic(
        code(E0325),
        help(
            "write one `0 = ..;` or `0 <= .. perp .. >= 0;` for each entry of what is `algebraic`"
        )
    )]
    UnequalCount {
        unknowns: usize,
        rows: usize,
        #[label("the last one")]
        span: Span,
    },

    /// A program that has no optimality conditions.
    #[error("{what}")]
    #[diagnostic(
        code(E0326),
        help(
            "write `z in argmin F subject to {{ H >= 0; G = 0; }}` or `z in variational {{ H >= 0; }} solves F` with smooth F, H and G of z"
        )
    )]
    ProgramForm {
        what: String,
        #[label("here")]
        span: Span,
    },

    /// Dynamics of a part, written outside of it.
    #[error("only `{part}` itself sets the dynamics of its states")]
    #[diagnostic(
        code(E0314),
        help("give the model of the part an `input` that enters its dynamics")
    )]
    OfAPart {
        part: String,
        #[label("a state of the part")]
        span: Span,
    },
}

impl Fixable for DynamicsError {
    fn fix(&self) -> Option<Fix> {
        match self {
            DynamicsError::NoLaw { help, span, .. } => help.fix(*span),
            DynamicsError::HiddenSets { operator, .. } => {
                Some(Fix::one(*operator, "+=", Applicability::Safe))
            }
            _ => None,
        }
    }

    fn choices(&self) -> Vec<Fix> {
        match self {
            DynamicsError::LoneRegion {
                statement, entries, ..
            } => vec![Fix::rest(*statement, entries.iter().map(String::as_str))],
            _ => Vec::new(),
        }
    }
}

impl DynamicsError {
    /// Something that is no state where one must be set.
    pub(crate) fn not_a_state(path: &Path, kind: &'static str) -> Self {
        let name = path.head.name.clone();
        let help = match kind {
            "param" | "let" | "constant" => Some(format!("declare `state {name} = ..;`")),
            _ => None,
        };
        DynamicsError::NotAState {
            name,
            kind,
            span: path.span,
            help,
        }
    }
}
