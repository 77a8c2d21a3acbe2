//! What stands at a position, in words.

use std::rc::Rc;

use lsp_types::{Hover, HoverContents, HoverParams, MarkupContent, MarkupKind, Position, Range};

use super::shown::{Facts, numbers};
use super::world::{Analysis, World};
use super::{Answer, reference};
use crate::diagnostics::explain;
use crate::expr::Exprs;
use crate::model::hir::reserved::is_function;
use crate::model::index::{Definition, Kind};
use crate::project::describe;
use crate::syntax::ExperimentKind;

/// Lines of a declaration that are shown.
const MOST_LINES: usize = 8;

/// What is known of what stands at a position.
pub fn hover(world: &mut World, params: &HoverParams) -> Answer<Option<Hover>> {
    let at = &params.text_document_position_params;
    let uri = &at.text_document.uri;
    let Some([now, good]) = world.states(uri) else {
        return Ok(None);
    };
    let sound = world.sound(uri).unwrap_or_else(|| Rc::clone(&good));
    let Some(token) = now.word(at.position) else {
        return Ok(None);
    };
    let range = now.lines().range(token.start..token.end());
    if let Some((_, definition)) = now.named(at.position) {
        let text = of_definition([&now, &good, &sound], definition, at.position);
        return Ok(Some(shown(text, range)));
    }
    // While a line is broken, what was there before it was.
    if let Some((position, definition)) = good.named_then(&now, at.position) {
        let text = of_definition([&good, &good, &sound], definition, position);
        return Ok(Some(shown(text, range)));
    }
    Ok(of_word(&now, token.text, at.position).map(|text| shown(text, range)))
}

fn shown(value: String, range: Range) -> Hover {
    let kind = MarkupKind::Markdown;
    Hover {
        contents: HoverContents::Markup(MarkupContent { kind, value }),
        range: Some(range),
    }
}

/// A declaration with its comment, its value in an experiment, and its equations: those of what could be read last, or else
/// of what was sound last.
fn of_definition([now, good, sound]: [&Analysis; 3], known: &Definition, at: Position) -> String {
    let meant = now.index.meant(known);
    let mut text = format!("```nsd\n{}\n```", declaration(now, meant));
    if let Some(doc) = describe::doc(meant.whole, &now.project.sources) {
        text.push_str(&format!("\n\n{doc}"));
    }
    text.push_str(&format!("\n\n{}", meant.kind.word()));
    let Some(model) = now.index.model_of(meant) else {
        return text;
    };
    text.push_str(&format!(" of `{}`", model.name));
    let experiment = now.index.experiment_at(now.at(at));
    let name = experiment.map(|known| known.name.as_str());
    let exprs = Exprs::new();
    let facts = |then: &Analysis| {
        let mut twins = then.index.definitions().iter();
        let twin = twins.find(|twin| twin.kind == Kind::Model && twin.name == model.name)?;
        Facts::of(&exprs, then, twin.place, name)
    };
    let told = match facts(good) {
        Some(told) if told.is_told => Some(told),
        other => facts(sound).filter(|told| told.is_told).or(other),
    };
    let Some(facts) = told else {
        return text;
    };
    if let Some(shown) = facts.shown(&meant.name) {
        if let Some(unit) = &shown.unit {
            text.push_str(&format!(", in {unit}"));
        }
        match shown.shape[..] {
            [] => {}
            [n] => text.push_str(&format!(", a vector of {n}")),
            [rows, columns] => text.push_str(&format!(", a matrix of {rows} x {columns}")),
            _ => {}
        }
        if !shown.value.is_empty() {
            let value = numbers(&shown.shape, &shown.value);
            let place = match &facts.experiment {
                Some(name) => format!(" in `{name}`"),
                None => String::new(),
            };
            let when = match meant.kind {
                Kind::Param | Kind::Constant => "",
                _ => " at the start",
            };
            text.push_str(&format!("\n\n{} = {value}{when}{place}", meant.name));
        }
    }
    if let Some(equations) = facts.equations(&meant.name) {
        text.push_str(&format!("\n\n```text\n{equations}\n```"));
    }
    text
}

/// The text of a declaration, without what is in its braces.
pub fn declaration(analysis: &Analysis, known: &Definition) -> String {
    let text = analysis.project.sources.text(known.whole.to(known.place));
    if matches!(known.kind, Kind::File | Kind::Module) || text.is_empty() {
        return known.name.clone();
    }
    let has_body = !matches!(known.kind, Kind::Alias | Kind::Part);
    let text = match text.split_once('{') {
        Some((head, _)) if has_body && !head.contains(" in ") => format!("{}{{ .. }}", head),
        _ => text.to_owned(),
    };
    let lines: Vec<&str> = text.lines().take(MOST_LINES).collect();
    lines.join("\n")
}

/// What the language says of a word.
fn of_word(analysis: &Analysis, word: &str, position: Position) -> Option<String> {
    if let Some(page) = explain::page(word) {
        return Some(format!("**{word}**: {}", explain::title(page)));
    }
    let at = analysis.at(position);
    let experiments = analysis.project.experiments();
    let mut experiments =
        experiments.filter(|known| known.span.start <= at && at <= known.span.end);
    let Some(experiment) = experiments.next() else {
        let of_model = || reference::of_statement(reference::MODEL, word);
        return match is_function(word) {
            true => reference::of_function(word),
            false => of_model(),
        };
    };
    let sections = match experiment.kind {
        ExperimentKind::Simulate => [reference::SIMULATE, reference::OPTIMIZE],
        ExperimentKind::Optimize => [reference::OPTIMIZE, reference::SIMULATE],
        ExperimentKind::Fit => [reference::FIT, reference::SIMULATE],
        ExperimentKind::Mpc => [reference::MPC, reference::SIMULATE],
    };
    let said = sections
        .iter()
        .chain(&reference::EXPERIMENTS)
        .find_map(|section| reference::of_statement(section, word));
    let said = said.or_else(|| reference::of_method(word).map(|(meaning, _)| meaning));
    said.or_else(|| reference::of_function(word))
}
