//! What there is to say about a project, together with the texts that it is about.

use std::fmt;
use std::ops::Range;

use crate::diagnostics::{self, AnyDiagnostic, Diagnostics, Fixable, is_error};
use crate::source::{SourceMap, Span};

/// Errors and warnings, by their positions; as text, as a terminal without colours shows them.
#[derive(Clone, Debug, Default)]
pub struct Messages {
    diagnostics: Diagnostics,
    sources: SourceMap,
}

/// An error or a warning.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// The code that [`crate::explain`] has a page for, such as `E0203`.
    pub code: Option<String>,
    /// Whether it is an error; a warning else.
    pub is_error: bool,
    /// What is wrong.
    pub text: String,
    /// What to do about it.
    pub help: Option<String>,
    /// Where, and what is there.
    pub labels: Vec<Label>,
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The file.
    pub file: String,
    /// The bytes of its text.
    pub bytes: Range<usize>,
    /// The line and the column where they start, both from 1; columns count characters.
    pub start: (usize, usize),
    /// What is there.
    pub text: Option<String>,
    /// Whether the message is about this place before others.
    pub is_primary: bool,
}

impl Messages {
    /// Diagnostics of what is in these files.
    pub(crate) fn new(diagnostics: Diagnostics, sources: SourceMap) -> Self {
        Messages {
            diagnostics,
            sources,
        }
    }

    /// One that stands for itself.
    pub(crate) fn of(diagnostic: impl Fixable) -> Self {
        let mut diagnostics = Diagnostics::new();
        diagnostics.push(diagnostic);
        Messages::new(diagnostics, SourceMap::new())
    }

    /// Whether there is an error.
    pub fn has_errors(&self) -> bool {
        self.diagnostics.has_errors()
    }

    /// Whether there is nothing to say.
    pub fn is_empty(&self) -> bool {
        self.diagnostics.is_empty()
    }

    /// All of them, as data.
    pub fn list(&self) -> Vec<Message> {
        let message = |diagnostic: &AnyDiagnostic| Message {
            code: diagnostic.code().map(|code| code.to_string()),
            is_error: is_error(diagnostic.as_ref()),
            text: diagnostic.to_string(),
            help: diagnostic.help().map(|help| help.to_string()),
            labels: self.labels(diagnostic),
        };
        self.diagnostics.iter().map(message).collect()
    }

    fn labels(&self, diagnostic: &AnyDiagnostic) -> Vec<Label> {
        let labels = diagnostic.labels().into_iter().flatten();
        let labels = labels.filter_map(|label| {
            let span = Span::new(label.offset()..label.offset() + label.len());
            let file = self.sources.file(span)?;
            let (text, first) = file.written();
            let local = |position: u32| (position as usize).saturating_sub(first).min(text.len());
            Some(Label {
                file: file.name.clone(),
                bytes: local(span.start)..local(span.end),
                start: file.line_column(span.start),
                text: label.label().map(str::to_owned),
                is_primary: label.primary(),
            })
        });
        labels.collect()
    }

    /// As a terminal with so many columns shows them.
    pub fn render(&self, colour: bool, width: usize) -> String {
        diagnostics::render(&self.diagnostics, &self.sources, colour, width)
    }
}

impl fmt::Display for Messages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false, 80))
    }
}

impl std::error::Error for Messages {}
