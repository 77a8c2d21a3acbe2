//! What may stand at a position: words of the language where these begin statements, else names that are known there.

use lsp_types::{
    CompletionItem, CompletionItemKind, CompletionParams, CompletionResponse, Documentation,
    MarkupContent, MarkupKind, ParameterInformation, ParameterLabel, SignatureHelp,
    SignatureHelpParams, SignatureInformation,
};

use super::world::{Analysis, World};
use super::{Answer, hover, reference};
use crate::diagnostics::explain;
use crate::model::hir::reserved::{VALUES, arity, function_names, is_function};
use crate::model::index::{Definition, Kind};
use crate::project::describe;
use crate::report::Status;
use crate::source::Span;
use crate::source::imports::{STANDARD, standard_text};
use crate::syntax::{self, Item, Link, Place, Token, TokenKind, starts};
use crate::system::experiment::{Lowering, MethodKind, words_of};

/// What is around a position in a text: statements that are open, outermost first, each from its first word on.
struct Around<'t> {
    /// Statements in whose braces it is.
    heads: Vec<Vec<Token<'t>>>,
    /// The tokens of its own statement in front of the word that is written there.
    before: Vec<Token<'t>>,
}

impl<'t> Around<'t> {
    /// Nothing inside of comments, strings and numbers, where no name is meant.
    fn of(text: &'t str, byte: usize) -> Option<Self> {
        let mut around = Around {
            heads: vec![],
            before: vec![],
        };
        // Of braces that list values or names.
        let mut lists = 0;
        for token in syntax::tokens(text).take_while(|token| token.start < byte) {
            let reaches = token.end() >= byte;
            match token.kind {
                TokenKind::Comment if reaches => return None,
                TokenKind::BlockComment
                | TokenKind::String
                | TokenKind::OpenString
                | TokenKind::Number
                | TokenKind::BadNumber
                    if reaches && (token.end() > byte || token.kind != TokenKind::String) =>
                {
                    return None;
                }
                TokenKind::Word if reaches => break,
                _ if token.is_blank() => continue,
                _ => {}
            }
            match token.text {
                "{" => {
                    lists = 0;
                    around.heads.push(std::mem::take(&mut around.before));
                }
                "}" => {
                    around.heads.pop();
                    around.before.clear();
                }
                ";" if lists == 0 => around.before.clear(),
                "[" | "(" => {
                    lists += 1;
                    around.before.push(token);
                }
                "]" | ")" => {
                    lists = usize::saturating_sub(lists, 1);
                    around.before.push(token);
                }
                _ => around.before.push(token),
            }
        }
        Some(around)
    }

    fn word(&self, at: usize) -> &'t str {
        self.before.get(at).map_or("", |token| token.text)
    }

    /// The first word of the statement in whose braces it is.
    fn block(&self) -> &'t str {
        self.heads
            .last()
            .and_then(|head| head.first())
            .map_or("", |token| token.text)
    }

    fn is_in_experiment(&self) -> bool {
        let head = self.heads.first().and_then(|head| head.first());
        head.is_some_and(|token| matches!(token.text, "simulate" | "optimize" | "fit" | "mpc"))
    }

    fn last(&self) -> &'t str {
        self.before.last().map_or("", |token| token.text)
    }
}

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
    let at = good.source().span().start + super::text::number(good.then(text, byte));
    let known = Known {
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
            return self.members_before(&around.before);
        }
        if around.heads.is_empty() {
            return self.of_file(around);
        }
        if around.is_in_experiment() {
            return self.of_experiment(around);
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
            ("expect", "expect") => words(["error", "warning"]),
            ("expect", "error") => codes('E'),
            ("expect", "warning") => codes('W'),
            ("const" | "fn", _) if around.before.len() > 1 => self.values(),
            _ => vec![],
        }
    }

    fn of_experiment(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        if around.heads.len() > 1 {
            return match (around.block(), around.before.is_empty()) {
                ("method", true) => {
                    let method = around.heads.last().and_then(|head| head.get(1));
                    let said = method.and_then(|method| reference::of_method(method.text));
                    let options = said.map_or(vec![], |(_, options)| options);
                    let option = |name: &String| item(name, CompletionItemKind::PROPERTY, None);
                    options.iter().map(option).collect()
                }
                ("plot", true) => {
                    let begin = words(starts(Place::Plot).iter().map(|(word, _)| *word));
                    begin.into_iter().chain(self.values()).collect()
                }
                ("method", false) => self.choices(around.word(0)),
                _ => self.values(),
            };
        }
        let is_optimize = around.block() == "optimize";
        match (around.word(0), around.before.len()) {
            ("", _) => settings(around.block()),
            ("method", 1) if is_optimize => words(["mpcc"]),
            ("method", 1) => {
                let method = |word: &str| {
                    let said = reference::of_method(word).map(|(meaning, _)| meaning);
                    item(word, CompletionItemKind::ENUM_MEMBER, said)
                };
                MethodKind::words().into_iter().map(method).collect()
            }
            ("lower", _) => words(Lowering::ALL.map(Lowering::word)),
            ("on", 1) => words(["chattering slide"]),
            ("stop", 1) => words(["when"]),
            ("controls", 1) => words(["constant", "linear"]),
            ("loss", 1) => words(["squared", "huber"]),
            ("scheme", 1) => self.choices("scheme"),
            ("subject" | "sensitivity", 1) => words(["to"]),
            ("expect", 1) => {
                let begin = words([
                    "mode",
                    "status",
                    "warning",
                    "lowering",
                    "numbers",
                    "switches",
                    "events",
                    "order",
                    "objective",
                ]);
                begin.into_iter().chain(self.values()).collect()
            }
            ("expect", 2) if around.word(1) == "warning" => codes('W'),
            ("expect", 2) if matches!(around.word(1), "lowering" | "numbers") => words(["golden"]),
            ("expect", 2) if around.word(1) == "status" => words(["is"]),
            ("expect", 3) if around.word(1) == "status" => words(Status::ALL.map(Status::as_str)),
            _ => self.values(),
        }
    }

    /// Values of a setting that has words for them, or else any.
    fn choices(&self, setting: &str) -> Vec<CompletionItem> {
        let words = words_of(setting);
        let own = match setting {
            // A function of the file is one, too.
            "law" => self.names(|kind| kind == Kind::Function),
            _ if words.is_empty() => self.values(),
            _ => vec![],
        };
        let word = |word: &String| item(word, CompletionItemKind::ENUM_MEMBER, None);
        words.iter().map(word).chain(own).collect()
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
    fn members_before(&self, before: &[Token<'_>]) -> Vec<CompletionItem> {
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
        self.members(holder)
            .into_iter()
            .map(|known| self.of(known))
            .collect()
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

    /// Files of the standard library, and what is in a file.
    fn of_use(&self, around: &Around<'_>) -> Vec<CompletionItem> {
        if around.block() == "use" {
            let head = around.heads.last().map_or(&[][..], Vec::as_slice);
            let path: Vec<&str> = head[1..].iter().map(|token| token.text).collect();
            let is_it = |item: &&syntax::Use| {
                let start = self.good.source().span().start;
                item.span.start - start == super::text::number(head[0].start)
            };
            let items = self
                .now
                .project
                .file
                .items
                .iter()
                .chain(&self.good.project.file.items);
            let mut uses = items.filter_map(|item| match item {
                Item::Use(item) => Some(item),
                _ => None,
            });
            if let Some(Link::File(file)) = uses.find(is_it).map(|item| &item.link) {
                return gives(file);
            }
            let text = match path[..] {
                ["std", ".", name, "."] => standard_text(name),
                _ => None,
            };
            return text.map_or(vec![], |text| {
                gives(&crate::project::Project::from_text("std.nsd", text).file)
            });
        }
        match (around.before.len(), around.word(1)) {
            (1, _) => words(["std"]),
            (3, "std") => words(STANDARD.iter().map(|(name, _)| *name)),
            _ => vec![],
        }
    }
}

fn gives(file: &syntax::File) -> Vec<CompletionItem> {
    let name = |item: &Item| match item {
        Item::Const(known) => Some(item_of(&known.name.name, CompletionItemKind::CONSTANT)),
        Item::Fn(known) => Some(item_of(&known.name.name, CompletionItemKind::FUNCTION)),
        Item::Model(known) => Some(item_of(&known.name.name, CompletionItemKind::CLASS)),
        _ => None,
    };
    file.items.iter().filter_map(name).collect()
}

fn item_of(name: &str, kind: CompletionItemKind) -> CompletionItem {
    item(name, kind, None)
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

/// Settings of a kind of experiment with their meaning.
fn settings(kind: &str) -> Vec<CompletionItem> {
    let of_runs: &[&str] = match kind {
        "simulate" => &[],
        "mpc" => &["lower", "runs", "sensitivity"],
        _ => &["perturb", "on", "runs", "sensitivity", "stop"],
    };
    let sections = match kind {
        "optimize" => &[reference::OPTIMIZE, reference::SIMULATE][..],
        "fit" => &[reference::FIT, reference::SIMULATE],
        "mpc" => &[reference::MPC, reference::SIMULATE],
        _ => &[reference::SIMULATE],
    };
    let said = |word: &str| {
        let mut said = sections
            .iter()
            .filter_map(|section| reference::of_statement(section, word));
        said.next()
    };
    let all = starts(Place::Experiment).iter().map(|(word, _)| *word);
    let all =
        all.filter(|word| !of_runs.contains(word) && said(word).is_some() || *word == "expect");
    all.map(|word| item(word, CompletionItemKind::KEYWORD, said(word)))
        .collect()
}

/// How the function around a position is called.
pub fn signature(world: &mut World, params: &SignatureHelpParams) -> Answer<Option<SignatureHelp>> {
    let at = &params.text_document_position_params;
    let uri = &at.text_document.uri;
    let Some([now, good]) = world.states(uri) else {
        return Ok(None);
    };
    let text = &now.source().text;
    let byte = now.lines().byte(at.position);
    let tokens = syntax::tokens(text).take_while(|token| token.end() <= byte);
    let tokens: Vec<Token<'_>> = tokens.filter(|token| !token.is_blank()).collect();
    let (mut depth, mut argument) = (0, 0);
    let mut called = None;
    for (k, token) in tokens.iter().enumerate().rev() {
        match token.text {
            ")" | "]" => depth += 1,
            "(" | "[" if depth > 0 => depth -= 1,
            "(" => {
                let name = k.checked_sub(1).map(|k| tokens[k]);
                called = name.filter(|name| name.kind == TokenKind::Word);
                break;
            }
            "[" => argument = 0,
            "," if depth == 0 => argument += 1,
            ";" | "{" | "}" => break,
            _ => {}
        }
    }
    let Some(called) = called else {
        return Ok(None);
    };
    let at = good.source().span().start + super::text::number(good.then(text, called.start));
    let signatures = signatures(&good, at, called.text);
    Ok((!signatures.is_empty()).then(|| SignatureHelp {
        // The shortest that has the argument.
        active_signature: signatures
            .iter()
            .position(|known| {
                known
                    .parameters
                    .as_ref()
                    .is_some_and(|all| all.len() > argument)
            })
            .map(super::text::number),
        signatures,
        active_parameter: Some(super::text::number(argument)),
    }))
}

fn signatures(good: &Analysis, at: u32, name: &str) -> Vec<SignatureInformation> {
    let found = good.index.at(at);
    let text = |span: Span| good.project.sources.text(span);
    let of_place = found.filter(|found| text(found.span) == name);
    let of_place = of_place.and_then(|found| good.index.definition(found.declared));
    let by_name = || {
        good.index
            .in_scope(at)
            .into_iter()
            .find(|known| known.name == name)
    };
    let declared = of_place
        .or_else(by_name)
        .map(|known| good.index.meant(known));
    if let Some(known) = declared.filter(|known| known.kind == Kind::Function) {
        let whole = hover::declaration(good, known);
        let head = whole
            .split_once(" = ")
            .map_or(whole.as_str(), |(head, _)| head);
        let label = head.strip_prefix("fn ").unwrap_or(head).trim().to_owned();
        let doc = describe::doc(known.whole, &good.project.sources);
        return vec![signature_of(label, doc)];
    }
    if !is_function(name) {
        return vec![];
    }
    let said = reference::of_function(name);
    let mut calls = reference::calls_of(name);
    if calls.is_empty() {
        let (least, most) = arity(name);
        let count = if most == usize::MAX {
            least.max(2)
        } else {
            most
        };
        let names = ["x", "y", "z"]
            .into_iter()
            .take(count)
            .collect::<Vec<_>>()
            .join(", ");
        calls.push(format!("{name}({names})"));
    }
    calls
        .into_iter()
        .map(|call| signature_of(call, said.clone()))
        .collect()
}

fn signature_of(label: String, doc: Option<String>) -> SignatureInformation {
    let inside = label
        .split_once('(')
        .map_or("", |(_, rest)| rest.trim_end_matches(')'));
    let parameters = inside
        .split(',')
        .map(str::trim)
        .filter(|name| !name.is_empty());
    let parameters = parameters.map(|name| ParameterInformation {
        label: ParameterLabel::Simple(name.to_owned()),
        documentation: None,
    });
    SignatureInformation {
        parameters: Some(parameters.collect()),
        documentation: doc.map(|value| {
            Documentation::MarkupContent(MarkupContent {
                kind: MarkupKind::Markdown,
                value,
            })
        }),
        active_parameter: None,
        label,
    }
}
