//! How functions are called.

use lsp_types::{
    Documentation, MarkupContent, MarkupKind, ParameterInformation, ParameterLabel, SignatureHelp,
    SignatureHelpParams, SignatureInformation,
};

use super::super::text::number;
use super::super::world::{Analysis, World};
use super::super::{Answer, hover, reference};
use crate::model::hir::reserved::{arity, is_function};
use crate::model::index::Kind;
use crate::project::describe;
use crate::source::Span;
use crate::syntax::{self, Token, TokenKind};

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
    let at = good.source().span().start + number(good.then(text, called.start));
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
            .map(number),
        signatures,
        active_parameter: Some(number(argument)),
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
