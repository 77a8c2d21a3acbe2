//! Loops and reductions, unrolled; brackets stacked.

use super::check::plural;
use crate::model::expressions::{Local, Lowering};
use crate::model::names::scope::Reported;
use crate::model::{ModelError, Shape, Tensor};
use crate::source::Span;
use crate::syntax::{self, Binder, Matrix};

impl<'e> Lowering<'_, 'e> {
    /// Runs `body` with the indices set to each of their values, the last one fastest.
    pub fn for_each(
        &mut self,
        binders: &[Binder],
        span: Span,
        body: &mut dyn FnMut(&mut Self) -> Result<(), Reported>,
    ) -> Result<(), Reported> {
        if binders.len() > 1 {
            self.foresee(binders)?;
        }
        self.unroll(binders, span, body)
    }

    /// Refuses ranges that have more combinations than the model may cost, before any of them is made: those up to the
    /// first one that depends on an index.
    fn foresee(&mut self, binders: &[Binder]) -> Result<(), Reported> {
        let mut rounds = 1_usize;
        for (at, binder) in binders.iter().enumerate() {
            let depends = |outer: &Binder| {
                let name = &outer.name.name;
                binder.first.reads(name) || binder.last.reads(name)
            };
            if binders[..at].iter().any(depends) {
                break;
            }
            let first = self.integer(&binder.first, "a loop bound")?;
            let last = self.integer(&binder.last, "a loop bound")?;
            // Behind an empty range no other is looked at.
            let Some(count) = usize::try_from(last - first + 1).ok().filter(|n| *n > 0) else {
                break;
            };
            rounds = rounds.saturating_mul(count);
            if self.scope.budget.get().is_some_and(|left| rounds > left) {
                return self.spend(rounds, binders[0].name.span.to(binder.last.span));
            }
        }
        Ok(())
    }

    #[inline(never)]
    fn unroll(
        &mut self,
        binders: &[Binder],
        span: Span,
        body: &mut dyn FnMut(&mut Self) -> Result<(), Reported>,
    ) -> Result<(), Reported> {
        let Some((binder, inner)) = binders.split_first() else {
            self.spend(1, span)?;
            return body(self);
        };
        let first = self.integer(&binder.first, "a loop bound")?;
        let last = self.integer(&binder.last, "a loop bound")?;
        let base = self.locals.len();
        let mut result = Ok(());
        for index in first..=last {
            // The budget bounds even a loop whose inner ranges are empty.
            if self
                .spend(1, binder.first.span.to(binder.last.span))
                .is_err()
            {
                return Err(Reported);
            }
            let value = Tensor::scalar(self.constant(index as f64)).into();
            self.locals.push(Local::Value {
                name: binder.name.name.clone(),
                value,
                text: index.to_string(),
            });
            let once = self.unroll(inner, span, body);
            self.locals.truncate(base);
            if once.is_err() {
                // A mistake shows in the first round; the others would repeat it.
                result = once;
                break;
            }
        }
        result
    }

    /// `[a, b]` stacks into a column, `[a, b; c, d]` lays out blocks, `[a, b;]` is a row.
    #[inline(never)]
    pub fn matrix(&mut self, matrix: &Matrix, span: Span) -> Result<Tensor<'e>, Reported> {
        if !matrix.semicolons {
            return self.stack(matrix);
        }
        let mut rows = vec![];
        let mut values = self.all_numbers(matrix.rows.iter().flatten())?.into_iter();
        for row in &matrix.rows {
            // The row first: the shorter side of a `zip` must be asked first.
            let blocks = row.iter().zip(values.by_ref());
            let blocks = blocks.map(|(entry, value)| (value, entry.span)).collect();
            let row_span = match (row.first(), row.last()) {
                (Some(first), Some(last)) => first.span.to(last.span),
                _ => span,
            };
            rows.push((self.beside(blocks)?, row_span));
        }
        let columns = rows.first().map_or(0, |(first, _)| first.shape.size().1);
        let mut data = vec![];
        for (row, row_span) in &rows {
            let found = row.shape.size().1;
            if found != columns {
                return self.error(ModelError::Ragged {
                    expected: plural(columns, "column", "columns"),
                    found: plural(found, "column", "columns"),
                    span: *row_span,
                });
            }
            data.extend_from_slice(&row.data);
        }
        self.spend(data.len(), span)?;
        let n_rows = rows.iter().map(|(row, _)| row.shape.size().0).sum();
        Ok(Tensor::matrix(n_rows, columns, data))
    }

    /// Several values; mistakes in all of them are reported.
    pub fn all_numbers<'s>(
        &mut self,
        exprs: impl Iterator<Item = &'s syntax::Expr>,
    ) -> Result<Vec<Tensor<'e>>, Reported> {
        let values: Vec<_> = exprs.map(|expr| self.numbers(expr)).collect();
        values.into_iter().collect()
    }

    #[inline(never)]
    fn stack(&mut self, matrix: &Matrix) -> Result<Tensor<'e>, Reported> {
        let mut data = vec![];
        let values = self.all_numbers(matrix.rows.iter().flatten())?;
        for (value, entry) in values.into_iter().zip(matrix.rows.iter().flatten()) {
            if let Shape::Matrix(rows, columns) = value.shape {
                return self.error(ModelError::ScalarExpected {
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
            self.spend(value.data.len(), entry.span)?;
            data.extend(value.data);
        }
        Ok(Tensor::vector(data))
    }

    /// Blocks of one height side by side.
    fn beside(&mut self, mut blocks: Vec<(Tensor<'e>, Span)>) -> Result<Tensor<'e>, Reported> {
        if blocks.len() == 1 {
            return Ok(blocks.remove(0).0);
        }
        let height = blocks.first().map_or(1, |(block, _)| block.shape.size().0);
        for (block, span) in &blocks {
            let found = block.shape.size().0;
            if found != height {
                return self.error(ModelError::BlockHeight {
                    expected: plural(height, "row", "rows"),
                    found: plural(found, "row", "rows"),
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
}
