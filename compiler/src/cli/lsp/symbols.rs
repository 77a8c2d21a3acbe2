//! The outline of texts: what they declare, what can be folded and selected, and their standard layout.

use std::ops::Range;
use std::rc::Rc;

use lsp_types::{
    DocumentFormattingParams, DocumentRangeFormattingParams, DocumentSymbol, DocumentSymbolParams,
    DocumentSymbolResponse, FoldingRange, FoldingRangeKind, FoldingRangeParams, Position,
    SelectionRange, SelectionRangeParams, SymbolInformation, SymbolKind, TextEdit, Uri,
    WorkspaceSymbolParams, WorkspaceSymbolResponse,
};

use super::text::Lines;
use super::world::{Analysis, World};
use super::{Answer, Refused};
use crate::diagnostics::Diagnostics;
use crate::model::index::{Definition, Kind};
use crate::source::Span;
use crate::syntax;

fn symbol(kind: Kind) -> SymbolKind {
    match kind {
        Kind::File | Kind::Module | Kind::Alias => SymbolKind::MODULE,
        Kind::Constant => SymbolKind::CONSTANT,
        Kind::Function => SymbolKind::FUNCTION,
        Kind::Model => SymbolKind::CLASS,
        Kind::Experiment => SymbolKind::METHOD,
        Kind::Part => SymbolKind::OBJECT,
        Kind::Param => SymbolKind::PROPERTY,
        Kind::Region | Kind::Contact => SymbolKind::NAMESPACE,
        Kind::Jump => SymbolKind::EVENT,
        Kind::Switch => SymbolKind::BOOLEAN,
        Kind::Output => SymbolKind::FIELD,
        _ => SymbolKind::VARIABLE,
    }
}

/// What a text declares, members in what has them.
pub fn of_file(
    world: &mut World,
    params: &DocumentSymbolParams,
) -> Answer<Option<DocumentSymbolResponse>> {
    let Some(analysis) = world.analysis(&params.text_document.uri) else {
        return Ok(None);
    };
    let mut here: Vec<&Definition> = outline(&analysis).collect();
    here.sort_by_key(|known| (known.whole.start, std::cmp::Reverse(known.whole.end)));
    let mut roots = Vec::new();
    nest(
        &analysis,
        &mut here.into_iter().peekable(),
        None,
        &mut roots,
    );
    Ok(Some(DocumentSymbolResponse::Nested(roots)))
}

/// What a text declares but for indices and arguments, by position.
fn outline(analysis: &Analysis) -> impl Iterator<Item = &Definition> {
    let here = analysis.index.definitions().iter();
    let here = here.filter(|known| analysis.is_here(known.place));
    here.filter(|known| !matches!(known.kind, Kind::Index | Kind::Argument))
}

/// Symbols that lie in another one; they come by position, outer ones first.
fn nest<'d>(
    analysis: &Analysis,
    rest: &mut std::iter::Peekable<impl Iterator<Item = &'d Definition>>,
    around: Option<Span>,
    found: &mut Vec<DocumentSymbol>,
) {
    while let Some(next) =
        rest.next_if(|next| around.is_none_or(|around| next.whole.end <= around.end))
    {
        let mut children = Vec::new();
        nest(analysis, &mut *rest, Some(next.whole), &mut children);
        #[expect(deprecated, reason = "the type has the field")]
        found.push(DocumentSymbol {
            name: next.name.clone(),
            detail: Some(next.kind.word().to_owned()),
            kind: symbol(next.kind),
            tags: None,
            deprecated: None,
            range: analysis.range(next.whole.to(next.place)),
            selection_range: analysis.range(next.place),
            children: (!children.is_empty()).then_some(children),
        });
    }
}

/// What files declare whose name has the letters of a query, in order.
pub fn of_world(
    world: &mut World,
    params: &WorkspaceSymbolParams,
) -> Answer<Option<WorkspaceSymbolResponse>> {
    let query = params.query.to_lowercase();
    let mut found = Vec::new();
    for analysis in world.all().0 {
        let fits = |known: &&Definition| matches(&known.name.to_lowercase(), &query);
        for known in outline(&analysis).filter(fits) {
            let container = analysis.index.model_of(known);
            #[expect(deprecated, reason = "the type has the field")]
            found.extend(
                analysis
                    .location(known.place)
                    .map(|location| SymbolInformation {
                        name: known.name.clone(),
                        kind: symbol(known.kind),
                        tags: None,
                        deprecated: None,
                        location,
                        container_name: container.map(|outer| outer.name.clone()),
                    }),
            );
        }
    }
    Ok(Some(WorkspaceSymbolResponse::Flat(found)))
}

fn matches(name: &str, query: &str) -> bool {
    let mut letters = name.chars();
    query
        .chars()
        .all(|wanted| letters.any(|letter| letter == wanted))
}

/// Blocks in braces that are longer than a line, and comments that are.
pub fn folds(world: &mut World, params: &FoldingRangeParams) -> Answer<Option<Vec<FoldingRange>>> {
    let Some(analysis) = world.analysis(&params.text_document.uri) else {
        return Ok(None);
    };
    let text = &analysis.source().text;
    let lines = Lines::new(text);
    let mut found = Vec::new();
    let mut fold = |first: usize, last: usize, kind: Option<FoldingRangeKind>| {
        let (start_line, end_line) = (lines.position(first).line, lines.position(last).line);
        if start_line < end_line {
            found.push(FoldingRange {
                start_line,
                end_line,
                kind,
                ..FoldingRange::default()
            });
        }
    };
    for block in blocks(text) {
        fold(block.0, block.1, None);
    }
    let mut comment: Option<(usize, usize)> = None;
    let mut at = 0;
    for line in text.split_inclusive('\n') {
        let start = at + (line.len() - line.trim_start().len());
        at += line.len();
        match (line.trim_start().starts_with("//"), comment) {
            (true, Some((first, _))) => comment = Some((first, start)),
            (true, None) => comment = Some((start, start)),
            (false, Some((first, last))) => {
                fold(first, last, Some(FoldingRangeKind::Comment));
                comment = None;
            }
            (false, None) => {}
        }
    }
    Ok(Some(found))
}

/// The braces of a text, which open and close.
fn blocks(text: &str) -> Vec<(usize, usize)> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    for token in syntax::tokens(text) {
        match token.text {
            "{" => open.push(token.start),
            "}" => found.extend(open.pop().map(|first| (first, token.start))),
            _ => {}
        }
    }
    found
}

/// What is around positions: a word, the brackets around it, statements, items, the file.
pub fn selections(
    world: &mut World,
    params: &SelectionRangeParams,
) -> Answer<Option<Vec<SelectionRange>>> {
    let Some(analysis) = world.analysis(&params.text_document.uri) else {
        return Ok(None);
    };
    let around = |&position: &Position| around(&analysis, position);
    Ok(Some(params.positions.iter().map(around).collect()))
}

fn around(analysis: &Rc<Analysis>, position: Position) -> SelectionRange {
    let (text, lines) = (&analysis.source().text, analysis.lines());
    let at = lines.byte(position);
    let mut ranges: Vec<Range<usize>> = std::iter::once(0..text.len()).collect();
    let mut open = Vec::new();
    for token in syntax::tokens(text) {
        let holds = |first: usize, last: usize| first <= at && at <= last;
        match token.text {
            "{" | "(" | "[" => open.push(token.end()),
            "}" | ")" | "]" => {
                let first = open.pop().filter(|&first| holds(first, token.start));
                ranges.extend(first.map(|first| first..token.start));
                ranges.extend(first.map(|first| first - 1..token.end()));
            }
            _ if holds(token.start, token.end()) && !token.is_blank() => {
                ranges.push(token.start..token.end());
            }
            _ => {}
        }
    }
    let wholes = analysis.index.definitions().iter().map(|known| known.whole);
    let wholes = wholes.filter(|whole| analysis.is_here(*whole));
    let wholes = wholes.map(|whole| analysis.source().bytes(whole));
    ranges.extend(wholes.filter(|whole| whole.start <= at && at <= whole.end));
    ranges.sort_by_key(|range| std::cmp::Reverse((range.len(), std::cmp::Reverse(range.start))));
    ranges.dedup();
    let mut found: Option<SelectionRange> = None;
    let mut outer = 0..text.len();
    for range in ranges {
        // One lies in the other; what only overlaps is left out.
        if outer.start <= range.start && range.end <= outer.end {
            found = Some(SelectionRange {
                range: lines.range(range.clone()),
                parent: found.map(Box::new),
            });
            outer = range;
        }
    }
    found.unwrap_or(SelectionRange {
        range: lsp_types::Range::new(position, position),
        parent: None,
    })
}

/// The one layout of a text, as edits of the lines that have another one.
pub fn format(
    world: &mut World,
    params: &DocumentFormattingParams,
) -> Answer<Option<Vec<TextEdit>>> {
    laid_out(world, &params.text_document.uri, None)
}

/// The same for the lines of a range.
pub fn format_range(
    world: &mut World,
    params: &DocumentRangeFormattingParams,
) -> Answer<Option<Vec<TextEdit>>> {
    laid_out(world, &params.text_document.uri, Some(params.range))
}

fn laid_out(
    world: &mut World,
    uri: &Uri,
    range: Option<lsp_types::Range>,
) -> Answer<Option<Vec<TextEdit>>> {
    let Some(analysis) = world.analysis(uri) else {
        return Ok(None);
    };
    let source = analysis.source();
    let Some(formatted) = syntax::format(source, &mut Diagnostics::new()) else {
        return Err(Refused::new("what cannot be read has no layout"));
    };
    let (text, lines) = (&source.text, analysis.lines());
    let wanted = range.map_or(0..text.len(), |range| lines.bytes(range));
    let is_wanted = |piece: &Range<usize>| {
        piece.start < wanted.end.max(wanted.start + 1) && wanted.start < piece.end
    };
    let pieces = pieces(text, &formatted).into_iter();
    let changed = pieces.filter(|(piece, new)| text[piece.clone()] != *new && is_wanted(piece));
    let edit = |(piece, new_text): (Range<usize>, String)| TextEdit {
        range: lines.range(piece),
        new_text,
    };
    Ok(Some(changed.map(edit).collect()))
}

/// The lines of a text in pieces, each with what becomes of it: as short as they can be where nothing but blanks changes.
fn pieces(old: &str, new: &str) -> Vec<(Range<usize>, String)> {
    let mut behind = new.split_inclusive('\n');
    let mut found = Vec::new();
    let (mut start, mut at) = (0, 0);
    // Of a piece, and of its new layout, what a layout keeps: all but blanks, and `;` behind a block, which may have ended
    // with the piece before.
    let add = |kept: &mut String, last: &mut char, line: &str| {
        for c in line.chars().filter(|c| !c.is_whitespace()) {
            if c != ';' || *last != '}' {
                kept.push(c);
                *last = c;
            }
        }
    };
    let (mut has, mut gets, mut layout) = (String::new(), String::new(), String::new());
    let (mut last, mut last_behind) = (' ', ' ');
    for line in old.split_inclusive('\n') {
        at += line.len();
        add(&mut has, &mut last, line);
        while gets.len() < has.len()
            && let Some(line) = behind.next()
        {
            add(&mut gets, &mut last_behind, line);
            layout.push_str(line);
        }
        if has == gets && !has.is_empty() {
            found.push((start..at, std::mem::take(&mut layout)));
            start = at;
            has.clear();
            gets.clear();
        }
    }
    layout.extend(behind);
    found.push((start..at, layout));
    found
}
