//! Indices in brackets: which entries of a shape they select.

use super::scope::Reported;
use crate::model::expressions::Lowering;
use crate::model::{ModelError, Shape};
use crate::source::Span;
use crate::syntax::Index;

/// Selected entries.
pub(crate) struct Places {
    pub positions: Vec<usize>,
    pub shape: Shape,
}

/// One index, counted from 0; a single index drops its dimension.
struct Selection {
    items: Vec<usize>,
    single: bool,
}

/// `x[2]`, `x[1..3]`, `A[1,2]`, `A[:,2]`
pub(crate) fn select(
    lowering: &mut Lowering<'_, '_>,
    shape: Shape,
    indices: &[Index],
    what: &str,
    span: Span,
) -> Result<Places, Reported> {
    let (rows, columns) = shape.size();
    match (shape, indices) {
        // A row is indexed like a vector.
        (Shape::Vector(len), [index]) | (Shape::Matrix(1, len), [index]) => {
            let chosen = selection(lowering, index, len, what)?;
            let shape = match shape {
                _ if chosen.single => Shape::Scalar,
                Shape::Matrix(..) => Shape::Matrix(1, chosen.items.len()),
                _ => Shape::Vector(chosen.items.len()),
            };
            Ok(Places {
                positions: chosen.items,
                shape,
            })
        }
        (Shape::Vector(_) | Shape::Matrix(..), [row, column]) => {
            let row = selection(lowering, row, rows, &format!("the rows of {what}"))?;
            let column = selection(lowering, column, columns, &format!("the columns of {what}"))?;
            let shape = match (row.single, column.single) {
                (true, true) => Shape::Scalar,
                (false, true) => Shape::Vector(row.items.len()),
                (true, false) => Shape::Matrix(1, column.items.len()),
                (false, false) => Shape::matrix(row.items.len(), column.items.len()),
            };
            lowering.spend(row.items.len().saturating_mul(column.items.len()), span)?;
            let across = |&i: &usize| column.items.iter().map(move |&j| i * columns + j);
            Ok(Places {
                positions: row.items.iter().flat_map(across).collect(),
                shape,
            })
        }
        _ => {
            let expected = match shape {
                Shape::Scalar => "no index",
                Shape::Vector(_) => "one index",
                Shape::Matrix(..) => "two indices",
            };
            let found = indices.len();
            lowering.error(ModelError::IndexCount {
                what: what.to_owned(),
                expected,
                found,
                span,
            })
        }
    }
}

fn selection(
    lowering: &mut Lowering<'_, '_>,
    index: &Index,
    len: usize,
    what: &str,
) -> Result<Selection, Reported> {
    match index {
        Index::All(_) => Ok(Selection {
            items: (0..len).collect(),
            single: false,
        }),
        Index::One(expr) => {
            let value = lowering.integer(expr, "an index")?;
            let position = in_range(lowering, value, len, what, expr.span)?;
            Ok(Selection {
                items: vec![position],
                single: true,
            })
        }
        Index::Range(first, last) => {
            let from = lowering.integer(first, "an index")?;
            let to = lowering.integer(last, "an index")?;
            if to < from {
                return Ok(Selection {
                    items: vec![],
                    single: false,
                });
            }
            let start = in_range(lowering, from, len, what, first.span)?;
            let end = in_range(lowering, to, len, what, last.span)?;
            Ok(Selection {
                items: (start..=end).collect(),
                single: false,
            })
        }
    }
}

fn in_range(
    lowering: &mut Lowering<'_, '_>,
    value: i64,
    len: usize,
    what: &str,
    span: Span,
) -> Result<usize, Reported> {
    match usize::try_from(value) {
        Ok(position) if (1..=len).contains(&position) => Ok(position - 1),
        _ => {
            let valid = if len == 0 {
                "none: it is empty".to_owned()
            } else {
                format!("1..{len}")
            };
            lowering.error(ModelError::OutOfRange {
                index: value.to_string(),
                what: what.to_owned(),
                valid,
                span,
            })
        }
    }
}
