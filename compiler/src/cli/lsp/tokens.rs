//! What names are, for their colours; units, too. Words and numbers are told by their letters, and left to the editor.

use lsp_types::{
    SemanticToken, SemanticTokenModifier, SemanticTokenType, SemanticTokens, SemanticTokensLegend,
    SemanticTokensParams, SemanticTokensResult,
};

use super::Answer;
use super::world::World;
use crate::model::index::{Kind, Role};
use crate::source::Span;

/// Types of tokens, by their numbers.
const TYPES: [SemanticTokenType; 9] = [
    SemanticTokenType::NAMESPACE,
    SemanticTokenType::CLASS,
    SemanticTokenType::FUNCTION,
    SemanticTokenType::PARAMETER,
    SemanticTokenType::VARIABLE,
    SemanticTokenType::PROPERTY,
    SemanticTokenType::ENUM_MEMBER,
    SemanticTokenType::EVENT,
    SemanticTokenType::TYPE,
];

/// What is told besides, by their bits: of variables, what they are in the model, and whether they are switching functions
/// by themselves.
const MODIFIERS: [&str; 12] = [
    "declaration",
    "modification",
    "readonly",
    "state",
    "discrete",
    "control",
    "input",
    "algebraic",
    "output",
    "signal",
    "switch",
    "surface",
];

/// What the numbers mean.
pub fn legend() -> SemanticTokensLegend {
    SemanticTokensLegend {
        token_types: TYPES.to_vec(),
        token_modifiers: MODIFIERS.map(SemanticTokenModifier::from).to_vec(),
    }
}

fn type_of(kind: Kind) -> SemanticTokenType {
    match kind {
        Kind::File | Kind::Module | Kind::Alias | Kind::Region | Kind::Contact => {
            SemanticTokenType::NAMESPACE
        }
        Kind::Model => SemanticTokenType::CLASS,
        Kind::Function | Kind::Experiment => SemanticTokenType::FUNCTION,
        Kind::Index | Kind::Argument => SemanticTokenType::PARAMETER,
        Kind::Param | Kind::Constant => SemanticTokenType::PROPERTY,
        Kind::Switch => SemanticTokenType::ENUM_MEMBER,
        Kind::Jump => SemanticTokenType::EVENT,
        _ => SemanticTokenType::VARIABLE,
    }
}

fn modifiers(kind: Kind, role: Role) -> Vec<&'static str> {
    let of_kind = match kind {
        Kind::State => "state",
        Kind::Discrete => "discrete",
        Kind::Control => "control",
        Kind::Input => "input",
        Kind::Algebraic => "algebraic",
        Kind::Output => "output",
        Kind::Signal => "signal",
        Kind::Switch => "switch",
        Kind::Param | Kind::Constant => "readonly",
        _ => "",
    };
    let of_role = match role {
        Role::Declares => "declaration",
        Role::Sets => "modification",
        Role::Reads => "",
    };
    vec![of_kind, of_role]
}

/// All names and units of a text.
pub fn all(
    world: &mut World,
    params: &SemanticTokensParams,
) -> Answer<Option<SemanticTokensResult>> {
    let Some(analysis) = world.analysis(&params.text_document.uri) else {
        return Ok(None);
    };
    let places = analysis.index.occurrences().iter();
    let places = places.filter(|place| analysis.is_here(place.span));
    let names = places.filter_map(|place| {
        let known = analysis.index.definition(place.declared)?;
        let meant = analysis.index.meant(known);
        let mut told = modifiers(meant.kind, place.role);
        told.extend(analysis.index.is_surface(meant).then_some("surface"));
        Some((place.span, type_of(meant.kind), told))
    });
    let units = analysis.index.units().iter().copied();
    let units = units.filter(|span| analysis.is_here(*span));
    let units = units.map(|span| (span, SemanticTokenType::TYPE, vec![]));
    let mut all: Vec<_> = names.chain(units).collect();
    all.sort_by_key(|(span, ..)| *span);
    all.dedup_by_key(|(span, ..)| *span);
    let (mut line, mut column) = (0, 0);
    let lines = analysis.lines();
    let token = |(span, kind, modifiers): (Span, SemanticTokenType, Vec<&str>)| {
        let range = lines.range(analysis.source().bytes(span));
        let (from, to) = (range.start, range.end);
        let delta_line = from.line - line;
        let delta_start = from.character - if delta_line == 0 { column } else { 0 };
        (line, column) = (from.line, from.character);
        let bit = |word: &&str| MODIFIERS.iter().position(|known| known == word);
        let bits = modifiers.iter().filter_map(bit).map(|bit| 1 << bit);
        SemanticToken {
            delta_line,
            delta_start,
            length: to.character - from.character,
            token_type: super::text::number(
                TYPES.iter().position(|known| *known == kind).unwrap_or(0),
            ),
            token_modifiers_bitset: bits.sum(),
        }
    };
    let one_line = |span: &Span| !analysis.project.sources.text(*span).contains(['\n', '\r']);
    let data = all
        .into_iter()
        .filter(|(span, ..)| one_line(span))
        .map(token)
        .collect();
    Ok(Some(SemanticTokensResult::Tokens(SemanticTokens {
        result_id: None,
        data,
    })))
}
