//! What can be wrong with an expectation.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::explain::PAGES;
use crate::diagnostics::{Fix, Fixable, Help};
use crate::model::hir::reserved::closest;
use crate::source::Span;
use crate::syntax::Ident;

/// What can be wrong with an expectation.
#[derive(Clone, Debug, Error, Diagnostic)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum ExpectError {
    /// Numbers that a run computes agree up to a tolerance only.
    #[error("`~` without a tolerance")]
    #[diagnostic(code(E0601), help("add an absolute tolerance, as in `within 1e-9`"))]
    NoTolerance {
        #[label("how close is close?")]
        span: Span,
    },
    /// Anything is within an infinite tolerance, and nothing within a negative one.
    #[error("a tolerance is a finite number that is not negative")]
    #[diagnostic(code(E0601), help("write an absolute tolerance, as in `within 1e-9`"))]
    NotATolerance {
        #[label("no tolerance")]
        span: Span,
    },
    /// `=` is exact and inequalities have their slack in their bound.
    #[error("`within` belongs to `~`")]
    #[diagnostic(code(E0602), help("write `~`, or leave the tolerance out"))]
    UnusedTolerance {
        #[label("this relation is exact")]
        span: Span,
    },
    /// Both sides of a relation have one shape, or one of them is a scalar.
    #[error("the sides have different shapes")]
    #[diagnostic(code(E0603))]
    Shapes {
        left_shape: String,
        right_shape: String,
        #[label("{left_shape}")]
        left: Span,
        #[label("{right_shape}")]
        right: Span,
    },
    /// A state has a value at an instant, not in a run.
    #[error("`{name}` changes over time, and no instant is given")]
    #[diagnostic(code(E0604), help("say when: `at end`, `at 0.5` or `always`"))]
    NoInstant {
        name: String,
        #[label("depends on `{name}`")]
        span: Span,
    },
    /// There are no values before the start and after the end.
    #[error("the instant {instant} is not in the run")]
    #[diagnostic(code(E0605), help("the run goes from 0 to {horizon}"))]
    OutsideRun {
        instant: String,
        horizon: String,
        #[label("this is {instant}")]
        span: Span,
    },
    /// An instant is a number that is known before the run.
    #[error("an instant or a tolerance is a number that is known before the run")]
    #[diagnostic(code(E0606), help("use numbers, constants and params"))]
    NotAnInstant {
        #[label("not a number, or not known before")]
        span: Span,
    },
    /// The kinds of events have fixed names.
    #[error("there are no events of kind `{name}`")]
    #[diagnostic(code(E0607))]
    UnknownEvent {
        name: String,
        #[label("not a kind of event")]
        span: Span,
        #[help]
        help: Option<Help>,
    },
    /// Events and modes are asked for by a surface of the model.
    #[error("`{name}` is not a switching surface of this experiment")]
    #[diagnostic(code(E0608))]
    UnknownSurface {
        name: String,
        #[label("no switch has this switching function")]
        span: Span,
        #[help]
        help: String,
    },
    /// A mode is described by regions and by what switches do.
    #[error("`{text}` does not describe a mode")]
    #[diagnostic(code(E0609))]
    NotAMode {
        text: String,
        #[label("not a mode")]
        span: Span,
        #[help]
        help: String,
    },
    /// Relays are on or off, and other switches are not.
    #[error("`{name}` cannot be `{word}`")]
    #[diagnostic(code(E0609))]
    WrongWord {
        word: String,
        name: String,
        #[label("never `{word}`")]
        span: Span,
        #[help]
        help: String,
    },
    /// The ways a run can end have fixed names.
    #[error("there is no status `{name}`")]
    #[diagnostic(code(E0610))]
    UnknownStatus {
        name: String,
        #[label("not a status")]
        span: Span,
        #[help]
        help: Option<Help>,
    },
    /// `events` takes the kind of the events and, where there are several, their surface.
    #[error("`events` takes a kind and a surface")]
    #[diagnostic(code(E0611), help("write `events(crossing)` or `events(crossing, x)`"))]
    EventArguments {
        #[label("wrong arguments")]
        span: Span,
    },
    /// The order of convergence is that of errors against step sizes.
    #[error("`order` needs a method with a number of steps")]
    #[diagnostic(
        code(E0612),
        help("give one: `method fesd {{ steps = 8; }}` or `method timestepping {{ .. }}`")
    )]
    NoOrder {
        #[label("this method chooses its steps itself")]
        span: Span,
    },
    /// The objective is the cost of an optimization.
    #[error("a simulation has no `objective`")]
    #[diagnostic(
        code(E0613),
        help("declare an `output` and write `at end`, or optimize")
    )]
    NoObjective {
        #[label("nothing is minimized here")]
        span: Span,
    },
    /// Whatever can be expected has a page.
    #[error("there is no {severity} `{name}`")]
    #[diagnostic(code(E0614))]
    UnknownCode {
        severity: String,
        name: String,
        #[label("not the code of {article} {severity}")]
        span: Span,
        article: &'static str,
        #[help]
        help: Help,
    },
}

impl ExpectError {
    /// What is wrong with `expect warning CODE` and `expect error CODE` where nothing of this severity has the code.
    pub(crate) fn unknown_code(severity: &str, code: &Ident) -> Option<Self> {
        let (letter, article) = match severity {
            "error" => ('E', "an"),
            _ => ('W', "a"),
        };
        let codes = PAGES.iter().map(|(code, _)| *code);
        let mut codes = codes.filter(|code| code.starts_with(letter));
        if codes.clone().any(|known| known == code.name) {
            return None;
        }
        let close = closest(&code.name, codes.clone()).map(|close| Help::did_you_mean(&close));
        let example = codes.next().unwrap_or_default();
        let told = || format!("each code has a page, as `nsdc explain {example}`").into();
        Some(ExpectError::UnknownCode {
            severity: severity.to_owned(),
            name: code.name.clone(),
            span: code.span,
            article,
            help: close.unwrap_or_else(told),
        })
    }
}

impl Fixable for ExpectError {
    fn fix(&self) -> Option<Fix> {
        match self {
            ExpectError::UnknownStatus { help, span, .. }
            | ExpectError::UnknownEvent { help, span, .. } => help.as_ref()?.fix(*span),
            ExpectError::UnknownCode { help, span, .. } => help.fix(*span),
            _ => None,
        }
    }
}
