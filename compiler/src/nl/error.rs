//! What is wrong with a .nl file, as a diagnostic.

use std::fmt;

use miette::{Diagnostic, LabeledSpan};
use nsd_solver::optimization::nl;
use nsd_solver::optimization::nl::{Fault, Place};

use crate::diagnostics::Fixable;
use crate::source::{SourceFile, Span};

/// A fault of a .nl file.
#[derive(Clone, Debug, PartialEq)]
pub struct NlError {
    fault: Fault,
    /// The byte, where the file is not text.
    byte: Option<usize>,
    /// The line, where it is.
    line: Option<Span>,
}

impl Fixable for NlError {}

impl NlError {
    /// In a text that diagnostics can show, or in a binary file.
    pub fn new(error: nl::Error, source: Option<&SourceFile>) -> Self {
        let (byte, line) = match error.place {
            Place::Byte(byte) => (Some(byte), None),
            Place::Line(number) => (None, source.map(|source| line(source, number))),
        };
        NlError {
            fault: error.fault,
            byte,
            line,
        }
    }

    /// E0801 to E0808.
    pub fn code(&self) -> &'static str {
        match self.fault {
            Fault::NotNl | Fault::ByteOrder => "E0801",
            Fault::End(_)
            | Fault::Unexpected { .. }
            | Fault::Range { .. }
            | Fault::Size { .. }
            | Fault::Twice(_)
            | Fault::Missing(_)
            | Fault::Undefined(_)
            | Fault::NaN(_) => "E0802",
            Fault::Empty { .. } => "E0803",
            Fault::Nonsmooth { .. } | Fault::Operator(_) => "E0804",
            Fault::Integer(_) | Fault::Binary(_) => "E0805",
            Fault::Logical(_) | Fault::Functions(_) | Fault::OrderedSets(_) => "E0806",
            Fault::Unbounded { .. } => "E0807",
            Fault::Large { .. } => "E0808",
        }
    }
}

/// The line with this number, from 1; the last one of the file beyond it.
fn line(source: &SourceFile, number: usize) -> Span {
    let mut start = source.start;
    let mut span = source.start..source.start;
    for line in source.text.split_inclusive('\n').take(number.max(1)) {
        let text = line.trim_end_matches(['\r', '\n']);
        span = start..start + text.len();
        start += line.len();
    }
    Span::new(span)
}

impl fmt::Display for NlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.byte {
            Some(byte) => write!(f, "{} (byte {byte})", self.fault),
            None => write!(f, "{}", self.fault),
        }
    }
}

impl std::error::Error for NlError {}

impl Diagnostic for NlError {
    fn code<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(NlError::code(self)))
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let way_out = self.fault.way_out()?;
        Some(Box::new(way_out))
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = LabeledSpan::new_with_span(Some("here".to_owned()), self.line?);
        Some(Box::new(std::iter::once(label)))
    }
}
