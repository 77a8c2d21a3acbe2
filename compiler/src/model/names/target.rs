//! Paths on the left of `=`: which entries of what they name.

use std::rc::Rc;

use super::places;
use super::scope::{Meaning, Reported};
use super::{fields, lookup};
use crate::model::expressions::Lowering;
use crate::model::hir::reserved::did_you_mean;
use crate::model::{ModelError, Shape, Target, TargetKind};
use crate::syntax::{Ident, Index, Path, Segment};

/// The declaration and the entries that a path names.
pub(crate) fn resolve(lowering: &mut Lowering<'_, '_>, path: &Path) -> Result<Target, Reported> {
    let (mut kind, mut shape, rest) = declaration(lowering, path)?;
    let name = &path.head.name;
    // All of them, as long as there is no index: a loop over entries must not list the others.
    let mut entries: Option<Vec<usize>> = None;
    for segment in rest {
        match segment {
            Segment::Field(field) => match (kind, field.name.as_str()) {
                (TargetKind::Switch(index), "sliding") => kind = TargetKind::Sliding(index),
                _ => return lowering.error(no_field(name, kind, field)),
            },
            Segment::Index(indices) => {
                let what = format!("`{name}`");
                let places = places::select(lowering, shape, indices, &what, path.span)?;
                let among = |entries: Vec<usize>| {
                    let chosen = places.positions.iter();
                    chosen.map(|&position| entries[position]).collect()
                };
                entries = Some(match entries {
                    Some(entries) => among(entries),
                    None => places.positions,
                });
                shape = places.shape;
            }
        }
    }
    Ok(Target {
        kind,
        entries: entries.unwrap_or_else(|| (0..shape.len()).collect()),
        shape,
    })
}

/// The declaration that a path leads to, through parts, with its shape, and what follows of the path.
fn declaration<'p>(
    lowering: &mut Lowering<'_, '_>,
    path: &'p Path,
) -> Result<(TargetKind, Shape, &'p [Segment]), Reported> {
    let mut scope = lowering.names.scope;
    let (mut name, mut span) = (&path.head.name, path.head.span);
    let mut rest = &path.rest[..];
    let mut meaning = scope.get(name);
    loop {
        let inner = match meaning {
            Some(Meaning::Value(value, kind)) => return Ok((*kind, value.tensor.shape, rest)),
            Some(Meaning::Family { binders, members }) => {
                let (indices, count) = (indices(&mut rest), binders.len());
                let member =
                    lookup::member(lowering, name, indices, members, count, "loop", path.span);
                let (value, kind) = member?;
                return Ok((*kind, value.tensor.shape, rest));
            }
            Some(Meaning::Part(inner)) => inner,
            Some(Meaning::Parts(members)) => {
                let indices = indices(&mut rest);
                lookup::member(lowering, name, indices, members, 1, "range", path.span)?
            }
            Some(other) => return lowering.refuse(other.no_value(name, span)),
            None if scope.forgiving => return Err(Reported),
            None => {
                let help = did_you_mean(name, scope.declared_names());
                return lowering.error(ModelError::UnknownName {
                    name: name.clone(),
                    span,
                    help,
                });
            }
        };
        let Some(Segment::Field(field)) = rest.first() else {
            let part = Meaning::Part(Rc::clone(inner));
            return lowering.refuse(part.no_value(name, span));
        };
        rest = &rest[1..];
        meaning = Some(fields::own(lowering, name, inner, field)?);
        (scope, name, span) = (inner, &field.name, field.span);
    }
}

/// The indices that come next, where there are any.
fn indices<'p>(rest: &mut &'p [Segment]) -> &'p [Index] {
    match *rest {
        [Segment::Index(indices), after @ ..] => {
            *rest = after;
            indices
        }
        _ => &[],
    }
}

fn no_field(name: &str, kind: TargetKind, field: &Ident) -> ModelError {
    let help = match kind {
        TargetKind::Switch(_) => did_you_mean(&field.name, ["sliding"].into_iter())
            .unwrap_or_else(|| "of a switch, `sliding` can be given".into()),
        _ => "only parts have fields".into(),
    };
    ModelError::NoField {
        name: name.to_owned(),
        field: field.name.clone(),
        span: field.span,
        help: Some(help),
    }
}
