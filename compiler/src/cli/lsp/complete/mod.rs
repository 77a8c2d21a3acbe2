//! What may stand at a position: words of the language where these begin statements, else names that are known there.

mod settings;
mod signature;
mod uses;

pub use signature::signature;

use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionParams, CompletionResponse, Documentation,
    MarkupContent, MarkupKind,
};

use nsd_grammar::Rule;

use super::around::Around;
use super::text::number;
use super::world::{Analysis, World};
use super::{Answer, reference};
use crate::diagnostics::explain;
use crate::model::hir::reserved::{VALUES, function_names};
use crate::model::index::{Definition, Kind};
use crate::model::unit_names;
use crate::project::describe;
use crate::syntax::{Place, Sliding, TokenKind, describe, starts};

fn item(label: &str, kind: CompletionItemKind, text: Option<String>) -> CompletionItem {
    let markdown = |value| {
        Documentation::MarkupContent(MarkupContent {
            kind: MarkupKind::Markdown,
            value,
        })
    };
    CompletionItem {
        label: label.to_owned(),
        kind: Some(kind),
        documentation: text.map(markdown),
        ..CompletionItem::default()
    }
}

/// The words and signs that a rule of the grammar is one of.
fn choices(rule: Rule) -> impl Iterator<Item = &'static str> {
    describe(rule).split('|').map(|word| word.trim_matches('`'))
}

fn words<'w>(words: impl IntoIterator<Item = &'w str>) -> Vec<CompletionItem> {
    let words = words.into_iter();
    words
        .map(|word| item(word, CompletionItemKind::KEYWORD, None))
        .collect()
}

/// What may stand at a position.
pub fn complete(
    world: &mut World,
    params: &CompletionParams,
) -> Answer<Option<CompletionResponse>> {
    let at = &params.text_document_position;
    let uri = &at.text_document.uri;
    let Some([now, good]) = world.states(uri) else {
        return Ok(None);
    };
    let text = &now.source().text;
    let byte = now.lines().byte(at.position);
    let Some(around) = Around::of(text, byte) else {
        return Ok(None);
    };
    let at = good.source().span().start + number(good.then(text, byte));
    let known = Known {
        world,
        now: &now,
        good: &good,
        at,
    };
    let mut items = known.complete(&around);
    items.sort_by(|a, b| a.label.cmp(&b.label));
    items.dedup_by(|a, b| a.label == b.label);
    Ok(Some(CompletionResponse::Array(items)))
}

struct Known<'k> {
    world: &'k World,
    now: &'k Analysis,
    good: &'k Analysis,
    /// The position in what was good.
    at: u32,
}

impl Known<'_> {
    fn complete(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        if around.word(0) == "use" || around.block() == "use" {
            return self.of_use(around);
        }
        if around.last() == "." {
            return self.members_before(around);
        }
        if around.heads.is_empty() {
            return self.of_file(around);
        }
        if around.is_in_experiment() {
            return self.of_experiment(around);
        }
        if let Some(words) = self.within(around) {
            return words;
        }
        match (around.before.is_empty(), around.block()) {
            (true, "part") => self.bound(around),
            (true, "contact" | "mechanics" | "project" | "argmin" | "variational") => self.values(),
            (true, _) => {
                let begin = starts(Place::Model).iter().map(|(word, _)| {
                    let said = reference::of_statement(reference::MODEL, word);
                    item(word, CompletionItemKind::KEYWORD, said)
                });
                begin.chain(self.names(|_| true)).collect()
            }
            (false, _) if around.word(0) == "part" && around.last() == "=" => self.names(|kind| {
                matches!(kind, Kind::Model | Kind::File | Kind::Module | Kind::Alias)
            }),
            _ => self.values(),
        }
    }

    /// What goes on in a statement of a model, where words or units do.
    fn within(&self, around: &Around<'_>) -> Option<Vec<CompletionItem>> {
        let (first, last) = (around.word(0), around.last());
        let has = |text: &str| around.before.iter().any(|token| token.text == text);
        match first {
            "switch" if last == "sliding" => Some(words(Sliding::ALL.map(Sliding::word))),
            "switch" if last == ")" && !around.is_open() => Some(words(["sliding"])),
            "param" | "state" | "discrete" | "control" | "input" | "algebraic" | "let"
            | "output" | "signal"
                if matches!(last, ":" | "*" | "/") && has(":") && !has("=") && !has("in") =>
            {
                let unit = |name: &str| item(name, CompletionItemKind::UNIT, None);
                Some(unit_names().map(unit).collect())
            }
            _ => None,
        }
    }

    /// What stands outside of models and experiments.
    fn of_file(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        match (around.word(0), around.last()) {
            ("", _) => words(starts(Place::File).iter().map(|(word, _)| *word)),
            ("simulate" | "optimize" | "fit" | "mpc", "of") => self.names(|kind| {
                matches!(kind, Kind::Model | Kind::File | Kind::Module | Kind::Alias)
            }),
            ("simulate" | "optimize" | "fit" | "mpc", _) if around.before.len() == 2 => {
                words(["of"])
            }
            ("expect", "expect") => words(choices(Rule::severity)),
            ("expect", "error") => codes('E'),
            ("expect", "warning") => codes('W'),
            ("const" | "fn", _) if around.before.len() > 1 => self.values(),
            _ => vec![],
        }
    }

    /// Names that are known at the position.
    fn names(&self, fits: impl Fn(Kind) -> bool) -> Vec<CompletionItem> {
        let known = self.good.index.in_scope(self.at);
        let known = known.into_iter().filter(|known| fits(known.kind));
        known.map(|known| self.of(known)).collect()
    }

    /// What may stand in an expression.
    fn values(&self) -> Vec<CompletionItem> {
        let mut items = self.names(|kind| kind != Kind::Model);
        items.extend(
            VALUES
                .iter()
                .map(|name| item(name, CompletionItemKind::CONSTANT, None)),
        );
        items.extend(function_names().map(|name| {
            item(
                name,
                CompletionItemKind::FUNCTION,
                reference::of_function(name),
            )
        }));
        items
    }

    fn of(&self, known: &Definition) -> CompletionItem {
        let kind = match known.kind {
            Kind::File | Kind::Module | Kind::Alias => CompletionItemKind::MODULE,
            Kind::Function => CompletionItemKind::FUNCTION,
            Kind::Model => CompletionItemKind::CLASS,
            Kind::Constant => CompletionItemKind::CONSTANT,
            Kind::Param => CompletionItemKind::PROPERTY,
            Kind::Part => CompletionItemKind::FIELD,
            Kind::Jump => CompletionItemKind::EVENT,
            _ => CompletionItemKind::VARIABLE,
        };
        let doc = describe::doc(known.whole, &self.good.project.sources);
        CompletionItem {
            detail: Some(known.kind.word().to_owned()),
            ..item(&known.name, kind, doc)
        }
    }

    /// Members of what stands in front of the last point.
    fn members_before(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        let before = &around.before;
        // `a.b[i, j].` from its end: names, and what is in brackets.
        let (mut path, mut depth) = (Vec::new(), 0);
        for token in before[..before.len() - 1].iter().rev() {
            match token.text {
                "]" => depth += 1,
                "[" => depth -= 1,
                "." if depth == 0 => {}
                _ if depth > 0 => {}
                word if token.kind == TokenKind::Word => {
                    path.push(word);
                    let at = before.iter().position(|known| known.start == token.start);
                    if at.is_none_or(|at| at == 0 || before[at - 1].text != ".") {
                        break;
                    }
                }
                _ => break,
            }
        }
        let mut path = path.into_iter().rev();
        let index = &self.good.index;
        let known = index.in_scope(self.at).into_iter();
        let Some(mut holder) = path.next().and_then(|first| {
            let mut known = known.filter(|known| known.name == first);
            known.next()
        }) else {
            return vec![];
        };
        for name in path {
            match self
                .members(holder)
                .into_iter()
                .find(|known| known.name == name)
            {
                Some(inner) => holder = inner,
                None => return vec![],
            }
        }
        if holder.kind == Kind::Switch && around.block() == "with" {
            return words(["sliding"]);
        }
        let members = self.members(holder).into_iter();
        members.map(|known| self.of(known)).collect()
    }

    /// What a part or a file has.
    fn members(&self, holder: &Definition) -> Vec<&Definition> {
        let index = &self.good.index;
        let scope = match holder.kind {
            Kind::File | Kind::Module => {
                let file = holder.of.and_then(|of| self.good.project.sources.file(of));
                file.map(|file| file.span())
            }
            Kind::Part => holder
                .of
                .and_then(|of| index.definition(of))
                .map(|model| model.whole),
            _ => None,
        };
        let members = scope.into_iter().flat_map(|scope| index.members(scope));
        let gives = |known: &&Definition| {
            holder.kind == Kind::Part
                || matches!(known.kind, Kind::Constant | Kind::Function | Kind::Model)
        };
        members.filter(gives).collect()
    }

    /// What a part may be given.
    fn bound(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        let name = around
            .heads
            .last()
            .and_then(|head| head.get(1))
            .map_or("", |token| token.text);
        let known = self.good.index.in_scope(self.at).into_iter();
        let mut parts = known.filter(|known| known.kind == Kind::Part && known.name == name);
        let members = parts.next().map_or(vec![], |part| self.members(part));
        let takes = |known: &&Definition| {
            matches!(
                known.kind,
                Kind::Param
                    | Kind::Constant
                    | Kind::State
                    | Kind::Discrete
                    | Kind::Input
                    | Kind::Control
                    | Kind::Algebraic
            )
        };
        members
            .into_iter()
            .filter(takes)
            .map(|known| self.of(known))
            .collect()
    }
}

/// Codes of diagnostics with their titles.
fn codes(letter: char) -> Vec<CompletionItem> {
    let pages = explain::PAGES
        .iter()
        .filter(|(code, _)| code.starts_with(letter));
    let code = |&(code, page): &(&str, &str)| CompletionItem {
        detail: Some(explain::title(page).to_owned()),
        ..item(code, CompletionItemKind::ENUM_MEMBER, None)
    };
    pages.map(code).collect()
}
