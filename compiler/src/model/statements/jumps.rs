//! `jump NAME when guard { x := ..; }`, `every T offset t { x := ..; }`: laws by which states jump.

use super::dynamics::{Walk, guard};
use crate::model::expressions::Lowering;
use crate::model::names::scope::{Meaning, Reported};
use crate::model::names::target;
use crate::model::{DynamicsError, Jump, Periodic, Reset, TargetKind, When};
use crate::source::Span;
use crate::syntax;
use crate::syntax::JumpWhen;

impl<'e> Walk<'e> {
    /// One law, with everything in it looked at.
    pub(crate) fn jump(
        &mut self,
        lowering: &mut Lowering<'_, 'e>,
        jump: &syntax::Jump,
    ) -> Result<(), Reported> {
        let when = when(lowering, &jump.when);
        let mut resets: Vec<Reset<'e>> = Vec::new();
        let mut result = Ok(());
        for bind in &jump.resets {
            match self.reset(lowering, bind) {
                Ok(found) => {
                    let known = |new: &Reset<'e>| resets.iter().find(|r| r.entry == new.entry);
                    if let Some(first) = found.iter().find_map(known) {
                        let name = lowering.names.written().path(&bind.target);
                        result = lowering.error(DynamicsError::ResetTwice {
                            name,
                            first: first.span,
                            span: bind.span,
                        });
                    }
                    resets.extend(found);
                }
                Err(Reported) => result = Err(Reported),
            }
        }
        let (when, when_span) = when?;
        result?;
        let name = match (&jump.name, &jump.when) {
            (Some(name), _) => name.name.clone(),
            (None, JumpWhen::Guard(_)) => String::new(),
            (None, JumpWhen::Every { period, .. }) => format!("every {period}"),
        };
        let name = self.indexed(&name);
        self.found.jumps.push(Jump {
            name: format!("{}{name}", lowering.names.scope.prefix),
            when,
            when_span,
            resets,
            span: jump.span,
        });
        Ok(())
    }

    /// `x[2] := ..;`
    fn reset(
        &self,
        lowering: &mut Lowering<'_, 'e>,
        bind: &syntax::Bind,
    ) -> Result<Vec<Reset<'e>>, Reported> {
        let path = &bind.target;
        let target = match lowering.names.scope.get(&path.head.name) {
            Some(Meaning::Part(_) | Meaning::Parts(_)) => {
                let (part, span) = (path.head.name.clone(), path.span);
                lowering.error(DynamicsError::OfAPart { part, span })
            }
            _ => target::resolve(lowering, path),
        };
        let target = match target {
            Ok(target) => target,
            Err(Reported) => {
                let _ = lowering.numbers(&bind.value);
                return Err(Reported);
            }
        };
        let TargetKind::State(state) = target.kind else {
            return lowering.error(DynamicsError::not_a_state(path, target.kind.word()));
        };
        let what = format!("`{}`", lowering.names.written().path(path));
        let value = lowering.numbers_as(&bind.value, target.shape, &what)?;
        let first = self.offsets[state];
        let reset = |(&entry, &value): (&usize, &_)| Reset {
            entry: first + entry,
            value,
            span: bind.span,
        };
        Ok(target.entries.iter().zip(&value.data).map(reset).collect())
    }
}

/// When a law jumps, and where that stands.
fn when<'e>(
    lowering: &mut Lowering<'_, 'e>,
    when: &JumpWhen,
) -> Result<(When<'e>, Span), Reported> {
    Ok(match when {
        JumpWhen::Guard(condition) => (When::Guard(guard(lowering, condition)?), condition.span),
        JumpWhen::Every { period, offset } => {
            let zero = lowering.constant(0.0);
            let span = offset
                .as_ref()
                .map_or(period.span, |offset| period.span.to(offset.span));
            let period = lowering.scalar(period, "a period");
            let offset = offset
                .as_ref()
                .map(|offset| lowering.scalar(offset, "an offset"));
            let (period, offset) = (period?, offset.unwrap_or(Ok(zero))?);
            (When::Every(Periodic { period, offset }), span)
        }
    })
}
