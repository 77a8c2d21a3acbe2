//! Values in brackets, stacked.

use crate::diagnostics::counted;
use crate::model::expressions::Lowering;
use crate::model::names::scope::Reported;
use crate::model::{ModelError, Shape, Tensor};
use crate::source::Span;
use crate::syntax::Matrix;

/// `[a, b]` stacks into a column, `[a, b; c, d]` lays out blocks, `[a, b;]` is a row.
#[inline(never)]
pub(crate) fn matrix<'e>(
    lowering: &mut Lowering<'_, 'e>,
    matrix: &Matrix,
    span: Span,
) -> Result<Tensor<'e>, Reported> {
    if !matrix.semicolons {
        return stack(lowering, matrix);
    }
    let mut rows = vec![];
    let mut values = lowering
        .all_numbers(matrix.rows.iter().flatten())?
        .into_iter();
    for row in &matrix.rows {
        // The row first: the shorter side of a `zip` must be asked first.
        let blocks = row.iter().zip(values.by_ref());
        let blocks = blocks.map(|(entry, value)| (value, entry.span)).collect();
        let row_span = match (row.first(), row.last()) {
            (Some(first), Some(last)) => first.span.to(last.span),
            _ => span,
        };
        rows.push((beside(lowering, blocks)?, row_span));
    }
    let columns = rows.first().map_or(0, |(first, _)| first.shape.size().1);
    let mut data = vec![];
    for (row, row_span) in &rows {
        let found = row.shape.size().1;
        if found != columns {
            return lowering.error(ModelError::Ragged {
                expected: counted(columns, "column"),
                found: counted(found, "column"),
                span: *row_span,
            });
        }
        data.extend_from_slice(&row.data);
    }
    lowering.spend(data.len(), span)?;
    let n_rows = rows.iter().map(|(row, _)| row.shape.size().0).sum();
    Ok(Tensor::matrix(n_rows, columns, data))
}

#[inline(never)]
fn stack<'e>(lowering: &mut Lowering<'_, 'e>, matrix: &Matrix) -> Result<Tensor<'e>, Reported> {
    let mut data = vec![];
    let values = lowering.all_numbers(matrix.rows.iter().flatten())?;
    for (value, entry) in values.into_iter().zip(matrix.rows.iter().flatten()) {
        if let Shape::Matrix(rows, columns) = value.shape {
            return lowering.error(ModelError::ScalarExpected {
                what: "an entry of a column".to_owned(),
                found: value.shape.to_string(),
                span: entry.span,
                help: Some(if rows == 1 && columns > 0 {
                    "transpose the row, or separate rows by `;`".to_owned()
                } else {
                    "separate the rows of a matrix by `;`".to_owned()
                }),
            });
        }
        lowering.spend(value.data.len(), entry.span)?;
        data.extend(value.data);
    }
    Ok(Tensor::vector(data))
}

/// Blocks of one height side by side.
fn beside<'e>(
    lowering: &mut Lowering<'_, 'e>,
    mut blocks: Vec<(Tensor<'e>, Span)>,
) -> Result<Tensor<'e>, Reported> {
    if blocks.len() == 1 {
        return Ok(blocks.remove(0).0);
    }
    let height = blocks.first().map_or(1, |(block, _)| block.shape.size().0);
    for (block, span) in &blocks {
        let found = block.shape.size().0;
        if found != height {
            return lowering.error(ModelError::BlockHeight {
                expected: counted(height, "row"),
                found: counted(found, "row"),
                span: *span,
            });
        }
    }
    let columns: usize = blocks.iter().map(|(block, _)| block.shape.size().1).sum();
    let mut data = vec![];
    for row in 0..height {
        for (block, _) in &blocks {
            let width = block.shape.size().1;
            data.extend_from_slice(&block.data[row * width..(row + 1) * width]);
        }
    }
    Ok(Tensor {
        shape: Shape::Matrix(height, columns),
        data,
    })
}
