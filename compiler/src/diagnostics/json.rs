//! The JSON form of diagnostics: one object on one line each, with the fields of the language reference.

use miette::LabeledSpan;
use serde::Serialize;

use super::{AnyDiagnostic, Diagnostics, Fix, is_error};
use crate::source::{SourceMap, Span};

/// All of them, by position, a line for each; `checked` is the file that was asked about.
pub fn write(diagnostics: &Diagnostics, sources: &SourceMap, checked: &str) -> String {
    let line = |diagnostic: &AnyDiagnostic| {
        let object = Object::of(diagnostic, sources, checked);
        // Words and numbers only: nothing that serialization can refuse.
        serde_json::to_string(&object).unwrap_or_default() + "\n"
    };
    diagnostics.iter().map(line).collect()
}

/// The fields in the order of the reference.
#[derive(Serialize)]
struct Object<'a> {
    checked: &'a str,
    code: Option<String>,
    severity: &'static str,
    message: String,
    labels: Vec<Label<'a>>,
    help: Option<String>,
    fix: Option<Mending<'a>>,
}

/// `{ "text": "..", "is_primary": true, "file": .. }`
#[derive(Serialize)]
struct Label<'a> {
    text: Option<String>,
    is_primary: bool,
    #[serde(flatten)]
    place: Place<'a>,
}

/// `{ "title": "..", "applicability": "safe", "edits": [..] }`
#[derive(Serialize)]
struct Mending<'a> {
    title: String,
    applicability: &'static str,
    edits: Vec<Change<'a>>,
}

#[derive(Serialize)]
struct Change<'a> {
    #[serde(flatten)]
    place: Place<'a>,
    replacement: String,
}

/// Bytes from the start of a file, from 0, and lines and columns in characters, from 1.
#[derive(Serialize)]
struct Place<'a> {
    file: &'a str,
    start: usize,
    end: usize,
    line: usize,
    column: usize,
    end_line: usize,
    end_column: usize,
}

impl<'a> Object<'a> {
    fn of(diagnostic: &AnyDiagnostic, sources: &'a SourceMap, checked: &'a str) -> Self {
        let all: Vec<LabeledSpan> = diagnostic.labels().into_iter().flatten().collect();
        let primary = all.iter().position(LabeledSpan::primary).unwrap_or(0);
        let labels = all.iter().enumerate().filter_map(|(k, label)| {
            let place = Place::of(Span::new(range(label)), sources)?;
            Some(Label {
                text: label.label().map(str::to_owned),
                is_primary: k == primary,
                place,
            })
        });
        Object {
            checked,
            code: diagnostic.code().map(|code| code.to_string()),
            severity: match is_error(diagnostic.as_ref()) {
                true => "error",
                false => "warning",
            },
            message: diagnostic.to_string(),
            labels: labels.collect(),
            help: diagnostic.help().map(|help| help.to_string()),
            fix: diagnostic.fix().and_then(|fix| Mending::of(fix, sources)),
        }
    }
}

impl<'a> Mending<'a> {
    fn of(fix: Fix, sources: &'a SourceMap) -> Option<Self> {
        let edits = fix.edits.into_iter().map(|edit| {
            Some(Change {
                place: Place::of(edit.span, sources)?,
                replacement: edit.replacement,
            })
        });
        Some(Mending {
            title: fix.title,
            applicability: fix.applicability.as_str(),
            edits: edits.collect::<Option<_>>()?,
        })
    }
}

impl<'a> Place<'a> {
    fn of(span: Span, sources: &'a SourceMap) -> Option<Self> {
        let file = sources.file(span)?;
        let (line, column) = file.line_column(span.start);
        let (end_line, end_column) = file.line_column(span.end);
        Some(Place {
            file: &file.name,
            start: span.start as usize - file.start,
            end: span.end as usize - file.start,
            line,
            column,
            end_line,
            end_column,
        })
    }
}

fn range(label: &LabeledSpan) -> std::ops::Range<usize> {
    label.offset()..label.offset() + label.len()
}
