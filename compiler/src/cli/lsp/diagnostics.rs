//! What is wrong in a text, as a client shows it, and the edits that mend it.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use lsp_types::{
    CodeAction, CodeActionKind, CodeActionOrCommand, CodeActionParams, CodeActionResponse,
    CodeDescription, Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, NumberOrString,
    Range, TextEdit, WorkspaceEdit,
};
use miette::LabeledSpan;

use super::Answer;
use super::text::{number, uri_of};
use super::world::{Analysis, World};
use crate::cli::texts::Texts;
use crate::diagnostics::{
    AnyDiagnostic, Applicability, Diagnostics, Edit, Fix, apply, explain, is_error,
};
use crate::source::{SourceFile, Span};
use crate::syntax::{File, Item, Link};

/// Something that is wrong.
pub struct Found {
    /// As it is shown.
    pub shown: Diagnostic,
    /// What mends it, each by itself, in this text.
    fixes: Vec<Fix>,
}

/// What is wrong in a text and in what it uses.
pub fn of(analysis: &Analysis, links: bool) -> Vec<Found> {
    let found = analysis.checked().iter();
    found
        .map(|diagnostic| one(analysis, diagnostic, links))
        .collect()
}

fn one(analysis: &Analysis, diagnostic: &AnyDiagnostic, links: bool) -> Found {
    let labels: Vec<LabeledSpan> = diagnostic.labels().into_iter().flatten().collect();
    let primary = labels.iter().position(LabeledSpan::primary).unwrap_or(0);
    let span = |label: &LabeledSpan| Span::new(label.offset()..label.offset() + label.len());
    let place = labels.get(primary).map(span);
    let range = place.map_or(Range::default(), |place| range(analysis, place));
    let is_elsewhere = place.is_some_and(|place| !analysis.is_here(place));
    let others = labels
        .iter()
        .enumerate()
        .filter(|(k, _)| *k != primary || is_elsewhere);
    let related = others.filter_map(|(_, label)| {
        Some(DiagnosticRelatedInformation {
            location: analysis.location(span(label))?,
            message: label.label().unwrap_or("here").to_owned(),
        })
    });
    let related: Vec<_> = related.collect();
    let label = labels.get(primary).and_then(LabeledSpan::label);
    let help = diagnostic.help().map(|help| help.to_string());
    let lines = [Some(diagnostic.to_string()), label.map(str::to_owned), help];
    let code = diagnostic.code().map(|code| code.to_string());
    let page = code.as_deref().filter(|_| links).and_then(|code| {
        let path = super::pages::write("explain", &format!("{code}.md"), explain::page(code)?)?;
        Some(CodeDescription {
            href: uri_of(&path)?,
        })
    });
    let shown = Diagnostic {
        range,
        severity: Some(match is_error(diagnostic.as_ref()) {
            true => DiagnosticSeverity::ERROR,
            false => DiagnosticSeverity::WARNING,
        }),
        code: code.map(NumberOrString::String),
        code_description: page,
        source: Some("nsdc".to_owned()),
        message: lines.into_iter().flatten().collect::<Vec<_>>().join("\n"),
        related_information: (!related.is_empty()).then_some(related),
        ..Diagnostic::default()
    };
    let is_here = |fix: &Fix| fix.edits.iter().all(|edit| analysis.is_here(edit.span));
    let mut fixes: Vec<Fix> = (diagnostic.fix().into_iter())
        .chain(diagnostic.choices())
        .collect();
    fixes.retain(is_here);
    for edit in fixes.iter_mut().flat_map(|fix| &mut fix.edits) {
        leave_comment(analysis.source(), edit);
    }
    Found { shown, fixes }
}

/// Whole lines that are inserted do not part a line from the comment at its end.
fn leave_comment(source: &SourceFile, edit: &mut Edit) {
    let behind = &source.text[source.bytes(edit.span).end..];
    let line = behind.lines().next().unwrap_or_default();
    if edit.replacement.starts_with('\n') && line.trim_start().starts_with("//") {
        let place = edit.span.end + number(line.len());
        edit.span = Span {
            start: place,
            end: place,
        };
    }
}

/// Where it is shown: of what is in another file, at the `use` that leads there.
fn range(analysis: &Analysis, place: Span) -> Range {
    if analysis.is_here(place) {
        return analysis.range(place);
    }
    let mut items = analysis.project.file.items.iter();
    let leading = items.find_map(|item| match item {
        Item::Use(item) => match &item.link {
            Link::File(file) if leads(file, place) => Some(item.span),
            _ => None,
        },
        _ => None,
    });
    leading.map_or(Range::default(), |span| analysis.range(span))
}

fn leads(file: &File, place: Span) -> bool {
    let here = file.span.start <= place.start && place.end <= file.span.end;
    here || file.items.iter().any(|item| match item {
        Item::Use(item) => matches!(&item.link, Link::File(file) if leads(file, place)),
        _ => false,
    })
}

/// The edits that mend what is wrong in a range.
pub fn actions(world: &mut World, params: &CodeActionParams) -> Answer<Option<CodeActionResponse>> {
    let uri = &params.text_document.uri;
    let Some(analysis) = world.analysis(uri) else {
        return Ok(None);
    };
    let touches = |range: Range| range.start <= params.range.end && params.range.start <= range.end;
    let action = |shown: &Diagnostic, fix: Fix| {
        let edits = fix.edits.iter().map(|edit| TextEdit {
            range: analysis.range(edit.span),
            new_text: edit.replacement.clone(),
        });
        let changes = HashMap::from([(uri.clone(), edits.collect())]);
        CodeActionOrCommand::CodeAction(CodeAction {
            title: fix.title,
            kind: Some(CodeActionKind::QUICKFIX),
            is_preferred: (fix.applicability == Applicability::Safe).then_some(true),
            diagnostics: Some(vec![shown.clone()]),
            edit: Some(WorkspaceEdit {
                changes: Some(changes),
                ..WorkspaceEdit::default()
            }),
            ..CodeAction::default()
        })
    };
    let key = World::key(uri);
    let mut actions = Vec::new();
    for Found { shown, mut fixes } in of(&analysis, false) {
        if touches(shown.range) {
            fixes.retain(|fix| mends(&analysis, &shown, fix, world.texts(), &key));
            actions.extend(fixes.into_iter().map(|fix| action(&shown, fix)));
        }
    }
    Ok(Some(actions))
}

/// How often each thing is said.
fn counted(diagnostics: &Diagnostics) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for diagnostic in diagnostics.iter() {
        let code = diagnostic.code().map(|code| code.to_string());
        *counts
            .entry(said(code.as_deref(), &diagnostic.to_string()))
            .or_insert(0) += 1;
    }
    counts
}

fn said(code: Option<&str>, message: &str) -> String {
    format!("{} {message}", code.unwrap_or_default())
}

/// Whether a fix takes away what it is for, and brings nothing else: of a text that cannot be read, nothing that keeps it
/// from being read, for what is wrong behind is hidden by that.
fn mends(before: &Analysis, shown: &Diagnostic, fix: &Fix, texts: &Texts, key: &str) -> bool {
    let source = before.source();
    let (text, _) = apply(source, vec![fix.clone()]);
    let texts = texts.with([(key.to_owned(), text)]);
    let Some(after) = Analysis::of(Path::new(&source.name), texts) else {
        return false;
    };
    let code = match &shown.code {
        Some(NumberOrString::String(code)) => Some(code.as_str()),
        _ => None,
    };
    let message = shown.message.lines().next().unwrap_or_default();
    let its = said(code, message);
    let [mut old, mut new] = [before, &after].map(|one| counted(one.checked()));
    if new.get(&its) >= old.get(&its) {
        return false;
    }
    if before.project.diags.has_errors() {
        [old, new] = [before, &after].map(|one| counted(&one.project.diags));
    }
    let mut new = new.iter();
    new.all(|(said, count)| old.get(said).is_some_and(|known| count <= known))
}
