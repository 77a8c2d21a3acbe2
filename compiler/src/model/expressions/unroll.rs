//! Loops and reductions, unrolled.

use crate::model::Tensor;
use crate::model::expressions::Lowering;
use crate::model::names::scope::Reported;
use crate::source::Span;
use crate::syntax::{self, Binder};

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
            if self
                .names
                .scope
                .budget
                .get()
                .is_some_and(|left| rounds > left)
            {
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
        let base = self.names.locals.len();
        let mut result = Ok(());
        for index in first..=last {
            // The budget bounds even a loop whose inner ranges are empty.
            if self
                .spend(1, binder.first.span.to(binder.last.span))
                .is_err()
            {
                return Err(Reported);
            }
            self.names.push_index(&binder.name.name, index);
            let once = self.unroll(inner, span, body);
            self.names.locals.truncate(base);
            if once.is_err() {
                // A mistake shows in the first round; the others would repeat it.
                result = once;
                break;
            }
        }
        result
    }

    /// Several values; mistakes in all of them are reported.
    pub fn all_numbers<'s>(
        &mut self,
        exprs: impl Iterator<Item = &'s syntax::Expr>,
    ) -> Result<Vec<Tensor<'e>>, Reported> {
        let values: Vec<_> = exprs.map(|expr| self.numbers(expr)).collect();
        values.into_iter().collect()
    }
}
