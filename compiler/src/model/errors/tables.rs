//! What can be wrong with signals from data: E0122, E0123 and E024.

use miette::Diagnostic;
use thiserror::Error;

use crate::diagnostics::{Fix, Fixable, Help};
use crate::model::hir::reserved::did_you_mean;
use crate::source::Span;
use crate::source::table::{Fault, Fit};

/// A mistake in a `table(..)`, or in the file it names.
#[derive(Clone, Debug, Diagnostic, Error)]
#[allow(
    missing_docs,
    reason = "fields are the words of the message; labels say the rest"
)]
pub enum TableError {
    /// A file of data that cannot be read.
    #[error("cannot read the data in `{path}`")]
    #[diagnostic(
        code(E0122),
        help("a path is relative to the folder of the file it stands in")
    )]
    Missing {
        path: String,
        why: String,
        #[label("{why}")]
        span: Span,
    },

    /// A column that the data has not, or has twice.
    #[error("{what}")]
    #[diagnostic(code(E0123))]
    Column {
        what: String,
        why: String,
        #[label("{why}")]
        span: Span,
        #[help]
        help: Option<Help>,
    },

    /// A file that is no table of numbers.
    #[error("{what}")]
    #[diagnostic(code(E0240))]
    Data {
        what: String,
        why: String,
        #[label("{why}")]
        span: Span,
        #[help]
        help: String,
    },

    /// Times that do not increase.
    #[error("the times in `{path}` do not increase: {time} comes after {before}")]
    #[diagnostic(
        code(E0241),
        help("{}", match fit {
            Some(_) => "sort the rows by time, and keep one row for each instant; `fit = hold` jumps at a row",
            None => "sort the rows by time; several may be of one instant",
        })
    )]
    Order {
        path: String,
        time: f64,
        before: f64,
        line: u64,
        /// What is between the rows; nothing where these are measurements.
        fit: Option<Fit>,
        #[label("in line {line} of the file")]
        span: Span,
    },

    /// Fewer rows than the fit takes.
    #[error("`{path}` has {found} row of data, and `fit = {fit}` takes {needed}")]
    #[diagnostic(code(E0242), help("`fit = hold` takes one row"))]
    Few {
        path: String,
        found: usize,
        needed: usize,
        fit: Fit,
        #[label("too little data")]
        span: Span,
    },

    /// A `table(..)` that is written wrong.
    #[error("{what}")]
    #[diagnostic(code(E0243))]
    Form {
        what: String,
        #[label("{why}")]
        span: Span,
        why: &'static str,
        #[help]
        help: Help,
    },
}

/// How to write it.
pub(crate) const FORM: &str = "write `signal r = table(\"data.csv\", \"column\", fit = linear);`";

/// Where the parts of a `table(..)` stand.
#[derive(Clone, Copy)]
pub(crate) struct Places {
    pub path: Span,
    pub column: Span,
    pub fit: Span,
}

impl TableError {
    /// What is wrong with a file that a signal names, with what it has between rows, or measurements.
    pub(crate) fn of(fault: Fault, path: &str, column: &str, fit: Option<Fit>, at: Places) -> Self {
        let data = |what: String, why: String, help: &str| TableError::Data {
            what,
            why,
            help: help.to_owned(),
            span: at.path,
        };
        match fault {
            Fault::Large { limit } => data(
                format!("`{path}` has more than {limit} rows"),
                "too much data".into(),
                "keep every tenth row, or the part that the run needs",
            ),
            Fault::NotText => data(
                format!("`{path}` is no text"),
                "not UTF-8".into(),
                "save it as comma-separated values (CSV) in UTF-8",
            ),
            Fault::Empty => data(
                format!("`{path}` holds no data"),
                "no rows".into(),
                "the first line names the columns, each line after it is an instant: `time,r`, then `0,1.5`",
            ),
            Fault::Separator { found } => data(
                format!("the columns of `{path}` are separated by {found}"),
                "columns are separated by commas".into(),
                "save it with commas between the columns, and points in the numbers: `0.5,1.25`",
            ),
            Fault::NoHeader => data(
                format!("the first line of `{path}` holds numbers"),
                "columns have no names".into(),
                "put the names of the columns in the first line, as in `time,r`",
            ),
            Fault::Ragged {
                line,
                found,
                expected,
            } => data(
                format!("line {line} of `{path}` has {found} cells instead of {expected}"),
                "as many cells in every line".into(),
                "a number has a point, not a comma; text with commas stands in quotes",
            ),
            Fault::Cell { line, column, text } => data(
                format!(
                    "line {line} of `{path}`, column `{column}`: {}",
                    shown(&text)
                ),
                "a cell that holds no finite number".into(),
                "numbers are written as `1`, `-2.5`, `1e-3`; leave out rows without a value",
            ),
            Fault::Steep => data(
                format!("the function through column `{column}` of `{path}` overflows"),
                "values too large, or rows too close together".into(),
                "give the data in other units",
            ),
            Fault::NoColumn { known } => TableError::no_column(path, column, &known, at.column),
            Fault::TwoColumns { places: [a, b] } => TableError::Column {
                what: format!("`{path}` has two columns `{column}`"),
                why: format!("columns {a} and {b}"),
                span: at.column,
                help: Some("give one of them another name".into()),
            },
            Fault::Order { line, time, before } => TableError::Order {
                path: path.to_owned(),
                time,
                before,
                line,
                fit,
                span: at.path,
            },
            Fault::Few { found, needed } => TableError::Few {
                path: path.to_owned(),
                found,
                needed,
                fit: fit.unwrap_or(Fit::Hold),
                span: at.fit,
            },
        }
    }

    fn no_column(path: &str, column: &str, known: &[String], span: Span) -> Self {
        let close = did_you_mean(column, known.iter().map(String::as_str));
        let close = close.map(|help| help.written(|name| format!("\"{name}\"")));
        TableError::Column {
            what: format!("`{path}` has no column `{column}`"),
            why: "not in its first line".into(),
            span,
            help: close.or_else(|| Some(listed(known).into())),
        }
    }
}

/// A cell in a message.
fn shown(text: &str) -> String {
    const LONGEST: usize = 30;
    if text.is_empty() {
        return "the cell is empty".into();
    }
    let mut short: String = text.chars().take(LONGEST).collect();
    if short.len() < text.len() {
        short.push_str("..");
    }
    format!("`{short}` is no number")
}

fn listed(known: &[String]) -> String {
    const MOST: usize = 12;
    let names = known.iter().take(MOST).map(|name| format!("`{name}`"));
    let more = if known.len() > MOST { ", .." } else { "" };
    format!("it has {}{more}", names.collect::<Vec<_>>().join(", "))
}

impl Fixable for TableError {
    fn fix(&self) -> Option<Fix> {
        match self {
            TableError::Column { help, span, .. } => help.as_ref()?.fix(*span),
            TableError::Form { help, span, .. } => help.fix(*span),
            _ => None,
        }
    }
}
