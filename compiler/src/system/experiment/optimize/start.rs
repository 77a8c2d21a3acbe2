//! Reads where an optimization starts from.

use super::super::error::ExperimentError;
use super::super::reader::Reader;
use super::super::with;
use super::Starts;
use crate::expr::{Expr, Substitution, Var};
use crate::model::{Quantity, TargetKind};
use crate::syntax::{self, Arg, Bind, ExprKind};

const MOST_STARTS: f64 = 1e6;
/// Largest seed: all whole numbers up to it are numbers of the language.
pub(crate) const LARGEST_SEED: f64 = 9_007_199_254_740_992.0;

impl<'e> Reader<'_, 'e> {
    /// `x = linear([0, 0], [1, 1]);` or `u = sin(time);`: values as functions of time.
    pub(crate) fn guess(&mut self, bind: &Bind, horizon: f64) -> Option<Vec<(Var, Expr<'e>)>> {
        let model = self.model;
        let Some(target) = model.scope.target(&bind.target, self.diags) else {
            self.failed = true;
            return None;
        };
        let quantity: &Quantity<'e> = match target.kind {
            TargetKind::State(k) => &model.quantities.states[k],
            TargetKind::Algebraic(k) => &model.quantities.algebraics[k],
            TargetKind::Control(k) => &model.quantities.controls[k],
            TargetKind::Param(k) => &model.quantities.params[k],
            kind => {
                self.error(ExperimentError::NotFree {
                    name: with::path_text(model, &bind.target, &target),
                    kind: kind.word(),
                    expected: "state, control or param",
                    span: bind.target.span,
                });
                return None;
            }
        };
        let what = format!("the guess of {} `{}`", target.kind.word(), quantity.name);
        let shape = target.shape;
        let mut read = |value: &syntax::Expr| {
            let tensor = model.scope.expr_as(value, shape, &what, None, self.diags);
            self.failed |= tensor.is_none();
            tensor
        };
        let value = match ends(&bind.value) {
            Some((first, last)) => {
                let share = model.time / horizon;
                let (first, last) = (read(first)?, read(last)?);
                first.zip(&last, |first, last| first + (last - first) * share)?
            }
            None => read(&bind.value)?,
        };
        // Parameters have their numbers; only time may be left.
        let zero: Substitution<'e> = (model.time.as_variable())
            .map(|time| (time, model.exprs.constant(0.0)))
            .into_iter()
            .collect();
        let at_start = zero.apply(&value.data);
        if let Err(cause) = self.values.numbers_of(model, &at_start) {
            self.error(ExperimentError::NotANumber {
                what,
                cause,
                span: bind.value.span,
            });
            return None;
        }
        let vars = target
            .entries
            .iter()
            .map(|&entry| quantity.vars[entry].as_variable());
        let values = self.values.signals.apply(&value.data);
        let pairs = vars
            .zip(values)
            .filter_map(|(var, value)| Some((var?, value)));
        Some(pairs.collect())
    }

    /// `starts 40 by gauss(0.5) seed 1`
    pub(crate) fn starts(
        &mut self,
        count: &syntax::Expr,
        by: Option<&syntax::Expr>,
        seed: Option<&syntax::Expr>,
    ) -> Option<Starts> {
        let count = self.count("`starts`", count, MOST_STARTS)?;
        let deviation = match by {
            None => 0.1,
            Some(by) => match one_argument(by) {
                Some(("gauss", deviation)) => self.positive("the deviation", deviation)?,
                _ => {
                    self.error(ExperimentError::UnknownChoice {
                        what: "distribution".into(),
                        found: "..".into(),
                        span: by.span,
                        choices: "`gauss(deviation)`".into(),
                        help: Some("write for example `starts 40 by gauss(0.5) seed 1;`".into()),
                    });
                    return None;
                }
            },
        };
        let expected = "a whole number from 0 on";
        let whole = |x: f64| (0.0..=LARGEST_SEED).contains(&x) && x.fract() == 0.0;
        let seed = match seed {
            None => 1,
            Some(seed) => self.within("the seed", seed, expected, whole)? as u64,
        };
        Some(Starts {
            count,
            deviation,
            seed,
        })
    }
}

/// `name(argument)`
pub(crate) fn one_argument(expr: &syntax::Expr) -> Option<(&str, &syntax::Expr)> {
    let ExprKind::Call(function, args) = &expr.kind else {
        return None;
    };
    let (ExprKind::Name(name), [Arg::Positional(argument, binders)]) = (&function.kind, &args[..])
    else {
        return None;
    };
    binders.is_empty().then_some((name.as_str(), argument))
}

/// `linear(first, last)`
fn ends(expr: &syntax::Expr) -> Option<(&syntax::Expr, &syntax::Expr)> {
    let ExprKind::Call(function, args) = &expr.kind else {
        return None;
    };
    let ExprKind::Name(name) = &function.kind else {
        return None;
    };
    match &args[..] {
        [Arg::Positional(first, a), Arg::Positional(last, b)]
            if name == "linear" && a.is_empty() && b.is_empty() =>
        {
            Some((first, last))
        }
        _ => None,
    }
}
