//! Models as text, and what is wrong with wrong ones.

mod meaning;
mod mistakes;
mod parts;
mod values;

use super::resolve;
use crate::diagnostics::Diagnostics;
use crate::expr::Exprs;
use crate::source::SourceMap;
use crate::syntax::{Item, parse};

/// The last model of a file, or the errors: code, words and what they point at.
fn model(text: &str) -> String {
    let (mut sources, mut diags) = (SourceMap::new(), Diagnostics::new());
    let file = parse(&sources.add("test.nsd", text), &mut diags);
    let name = file.items.iter().rev().find_map(|item| match item {
        Item::Model(model) => Some(model.name.name.clone()),
        _ => None,
    });
    let exprs = Exprs::new();
    let model = resolve(&exprs, &file, &name.unwrap_or_default(), &[], &mut diags);
    let mut text = errors(&diags, &sources);
    if let Some(model) = model {
        text += &model.to_string();
    }
    text
}

pub(in crate::model) fn errors(diags: &Diagnostics, sources: &SourceMap) -> String {
    let mut text = String::new();
    for error in diags.iter() {
        let code = error
            .code()
            .map(|code| code.to_string())
            .unwrap_or_default();
        text += &format!("{code}: {error}");
        for label in error.labels().into_iter().flatten() {
            let (start, len) = (label.offset(), label.len());
            let span = crate::source::Span::new(start..start + len);
            let at = sources.text(span).lines().next().unwrap_or_default();
            text += &format!(" | {at}: {}", label.label().unwrap_or_default());
        }
        if let Some(help) = error.help() {
            text += &format!(" | {help}");
        }
        text += "\n";
    }
    text
}

/// A value from structural constants, or the errors.
fn value(expr: &str) -> String {
    let shown = model(&format!("model m {{ output y = {expr}; }}"));
    match shown.split_once("output y = ") {
        Some((_, value)) => value.trim_end().to_owned(),
        None => shown,
    }
}
