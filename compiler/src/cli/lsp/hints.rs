//! What the editor shows beside names: shapes, units and values that nobody has written.

use lsp_types::{InlayHint, InlayHintKind, InlayHintLabel, InlayHintParams, Position};

use super::hover::cache::Cache;
use super::hover::facts::{Facts, Shown, numbers};
use super::world::{Analysis, World};
use crate::model::index::{Definition, Kind};
use crate::model::inferred;
use crate::source::Span;
use crate::syntax::{self, Expr, ExprKind, Stmt};

/// Shapes of what is not a scalar, units that follow from others, and values of what is computed before a run; while a text
/// cannot be read, those of before, where their lines are as they were.
pub fn hints(world: &mut World, cache: &Cache<'_>, params: &InlayHintParams) -> Vec<InlayHint> {
    let Some([now, good]) = world.states(&params.text_document.uri) else {
        return vec![];
    };
    if good.project.diags.has_errors() {
        return vec![];
    }
    let mut found = Vec::new();
    for item in good.models() {
        let place = item.name.span;
        let mut seen: Vec<&Definition> = good.index.members(item.span).collect();
        seen.retain(|known| {
            let position = now_at(&now, &good, good.range(known.place).start);
            position.is_some_and(|at| {
                params.range.start.line <= at.line && at.line <= params.range.end.line
            })
        });
        if seen.is_empty() {
            continue;
        }
        let taken = Facts::taken(cache, &good, place, ("", None)).next();
        let Some(facts) = taken.or_else(|| Facts::alone(cache, &good, place)) else {
            continue;
        };
        let units = inferred(&good.project.file, item);
        for known in seen {
            if let Some(shown) = facts.shown(&known.name) {
                found.extend(hints_of(
                    &good,
                    item,
                    known,
                    (&shown, units.get(&known.place)),
                ));
            }
        }
    }
    found.retain_mut(|hint| match now_at(&now, &good, hint.position) {
        Some(position) => {
            hint.position = position;
            params.range.start <= position && position <= params.range.end
        }
        None => false,
    });
    found
}

/// Where a position of a text is in what has become of it, if its line is the same up to there.
fn now_at(now: &Analysis, then: &Analysis, position: Position) -> Option<Position> {
    if std::ptr::eq(now, then) {
        return Some(position);
    }
    let byte = then.lines().byte(position);
    let is = now.then(&then.source().text, byte);
    let [was, line] = [(then, byte), (now, is)].map(|(analysis, byte)| {
        let before = analysis.source().text.get(..byte)?;
        before.rsplit('\n').next()
    });
    (was? == line?).then(|| now.lines().position(is))
}

fn hints_of(
    analysis: &Analysis,
    model: &syntax::Model,
    known: &Definition,
    (shown, unit): (&Shown, Option<&String>),
) -> Vec<InlayHint> {
    let hint = |span: Span, text: String, padding_left: bool| InlayHint {
        position: analysis.range(span).end,
        label: InlayHintLabel::String(text),
        kind: Some(InlayHintKind::TYPE),
        text_edits: None,
        tooltip: None,
        padding_left: Some(padding_left),
        padding_right: None,
        data: None,
    };
    let mut hints = Vec::new();
    let infers = matches!(
        known.kind,
        Kind::Let | Kind::Output | Kind::Signal | Kind::Constant
    );
    if infers && !shown.shape.is_empty() {
        let sizes: Vec<String> = shown.shape.iter().map(usize::to_string).collect();
        hints.push(hint(known.place, format!("[{}]", sizes.join(", ")), false));
    }
    if let Some(unit) = unit {
        hints.push(hint(known.place, format!(": {unit}"), true));
    }
    let is_fixed = matches!(known.kind, Kind::Param | Kind::Constant);
    if let Some(value) = value_of(model, known).filter(|_| is_fixed && !shown.value.is_empty())
        && !is_literal(value)
    {
        hints.push(hint(
            value.span,
            format!("= {}", numbers(&shown.shape, &shown.value)),
            true,
        ));
    }
    hints
}

/// The expression of a declaration.
fn value_of<'m>(model: &'m syntax::Model, known: &Definition) -> Option<&'m Expr> {
    model.body.iter().find_map(|stmt| match stmt {
        Stmt::Const(item) if item.name.span == known.place => Some(&item.value),
        Stmt::Decl(decl) if decl.name.span == known.place => decl.value.as_ref(),
        _ => None,
    })
}

/// Numbers as they are shown.
fn is_literal(value: &Expr) -> bool {
    match &value.kind {
        ExprKind::Number(_) | ExprKind::Quantity(..) => true,
        ExprKind::Negate(inner) => is_literal(inner),
        ExprKind::Matrix(matrix) => matrix.rows.iter().flatten().all(is_literal),
        _ => false,
    }
}
