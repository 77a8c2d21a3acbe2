//! What there is to say about a project, together with the texts that it is about.

use std::fmt;

use miette::LabeledSpan;
use serde::Serialize;

use crate::diagnostics::{self, AnyDiagnostic, Applicability, Diagnostics, Fix, Fixable, is_error};
use crate::source::{SourceMap, Span};

/// Errors and warnings, by their positions; as text, as a terminal without colours shows them.
#[derive(Clone, Debug, Default)]
pub struct Messages {
    diagnostics: Diagnostics,
    sources: SourceMap,
}

/// An error or a warning; serialized, a line of `nsdc check --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Message {
    /// The code that [`crate::diagnostics::explain`] has a page for, such as `E0203`.
    pub code: Option<String>,
    /// Whether it keeps experiments from being run.
    pub severity: Severity,
    /// What is wrong.
    #[serde(rename = "message")]
    pub text: String,
    /// Where, and what is there.
    pub labels: Vec<Label>,
    /// What to do about it.
    pub help: Option<String>,
    /// The edits that do so, where these are known.
    pub fix: Option<Mending>,
}

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Nothing is run.
    Error,
    /// To be looked at.
    Warning,
}

/// What is at a place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Label {
    /// In words.
    pub text: Option<String>,
    /// Whether the message is about this place before others.
    pub is_primary: bool,
    /// Where.
    #[serde(flatten)]
    pub place: Place,
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Place {
    /// The file.
    pub file: String,
    /// The first byte of its text, from 0.
    pub start: usize,
    /// The byte behind the last one.
    pub end: usize,
    /// The line of the first byte, from 1.
    pub line: usize,
    /// Its column, in characters, from 1.
    pub column: usize,
    /// The line of the end.
    pub end_line: usize,
    /// Its column.
    pub end_column: usize,
}

/// Edits that mend what a message is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Mending {
    /// What they do, as an action in lower case.
    pub title: String,
    /// Whether they may be made without being looked at.
    pub applicability: Applicability,
    /// All of them, by position; they do not overlap.
    pub edits: Vec<Replacement>,
}

/// A piece of text in the place of another.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Replacement {
    /// What is replaced; empty where text is inserted.
    #[serde(flatten)]
    pub place: Place,
    /// What stands there then; empty where text is removed.
    pub replacement: String,
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
        self.diagnostics
            .iter()
            .map(|diagnostic| Message::of(diagnostic, &self.sources))
            .collect()
    }

    /// As a terminal with so many columns shows them.
    pub fn render(&self, colour: bool, width: usize) -> String {
        diagnostics::render(&self.diagnostics, &self.sources, colour, width)
    }
}

impl Message {
    /// A diagnostic of what is in these files.
    pub(crate) fn of(diagnostic: &AnyDiagnostic, sources: &SourceMap) -> Self {
        let all: Vec<LabeledSpan> = diagnostic.labels().into_iter().flatten().collect();
        let primary = all.iter().position(LabeledSpan::primary).unwrap_or(0);
        let labels = all.iter().enumerate().filter_map(|(k, label)| {
            let span = Span::new(label.offset()..label.offset() + label.len());
            Some(Label {
                text: label.label().map(str::to_owned),
                is_primary: k == primary,
                place: Place::of(span, sources)?,
            })
        });
        Message {
            code: diagnostic.code().map(|code| code.to_string()),
            severity: match is_error(diagnostic.as_ref()) {
                true => Severity::Error,
                false => Severity::Warning,
            },
            text: diagnostic.to_string(),
            labels: labels.collect(),
            help: diagnostic.help().map(|help| help.to_string()),
            fix: diagnostic.fix().and_then(|fix| Mending::of(fix, sources)),
        }
    }

    /// Whether nothing is run because of it.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

impl Mending {
    fn of(fix: Fix, sources: &SourceMap) -> Option<Self> {
        let edits = fix.edits.into_iter().map(|edit| {
            Some(Replacement {
                place: Place::of(edit.span, sources)?,
                replacement: edit.replacement,
            })
        });
        Some(Mending {
            title: fix.title,
            applicability: fix.applicability,
            edits: edits.collect::<Option<_>>()?,
        })
    }
}

impl Place {
    fn of(span: Span, sources: &SourceMap) -> Option<Self> {
        let file = sources.file(span)?;
        let (text, first) = file.written();
        let local = |position: u32| (position as usize).saturating_sub(first).min(text.len());
        let (line, column) = file.line_column(span.start);
        let (end_line, end_column) = file.line_column(span.end);
        Some(Place {
            file: file.name.clone(),
            start: local(span.start),
            end: local(span.end),
            line,
            column,
            end_line,
            end_column,
        })
    }
}

impl fmt::Display for Messages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false, 80))
    }
}

impl std::error::Error for Messages {}
