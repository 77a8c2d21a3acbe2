//! `integral(..)` and `final(..)`: values of a whole run as expressions.

use std::cell::RefCell;

use super::super::error::ExperimentError;
use super::super::reader::Reader;
use super::{At, Cost, Integral, Term};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Substitution, Var, variables_of};
use crate::model::{Comparison, Model, Tensor};
use crate::source::Span;
use crate::syntax::{self, Arg, BinaryOp, ExprKind, Row};

/// Gives `integral(..)` and `final(..)` their meaning, and keeps what they contain.
pub(crate) struct Words<'m, 'e> {
    model: &'m Model<'e>,
    found: RefCell<Found<'e>>,
}

#[derive(Default)]
struct Found<'e> {
    integrals: Vec<Integral<'e>>,
    /// Marks of values at the end, and the values.
    finals: Substitution<'e>,
    marks: Vec<Expr<'e>>,
    diags: Diagnostics,
}

impl<'m, 'e> Words<'m, 'e> {
    pub fn new(model: &'m Model<'e>) -> Self {
        Words {
            model,
            found: RefCell::default(),
        }
    }

    /// The integrals of all expressions so far.
    pub fn into_integrals(self) -> Vec<Integral<'e>> {
        self.found.into_inner().integrals
    }

    /// An expression as it is written, but for the order of its terms.
    pub fn text(&self, value: Expr<'e>) -> String {
        let found = self.found.borrow();
        let calls = found.integrals.iter().filter_map(|integral| {
            let call = format!("integral({})", integral.value);
            Some((
                integral.var.as_variable()?,
                self.model.exprs.variable(&call),
            ))
        });
        let calls: Substitution<'e> = calls.collect();
        value.substitute(&calls).to_string()
    }

    /// Whether some values of the whole run are in expressions.
    fn are_in(&self, exprs: &[Expr<'e>]) -> bool {
        let (known, exprs) = (self.of_run(), variables_of(exprs));
        exprs
            .into_iter()
            .any(|var| known.contains(&self.model.exprs.expr(var)))
    }

    /// The name of a quantity in expressions that is neither a value of the whole run nor a parameter.
    fn changing(&self, exprs: &[Expr<'e>]) -> Option<String> {
        let params = self.model.quantities.of_params();
        let mut known = self.of_run();
        known.extend(params.copied());
        let is_known = |var: &Var| known.contains(&self.model.exprs.expr(*var));
        let stranger = variables_of(exprs).into_iter().find(|var| !is_known(var))?;
        Some(self.model.exprs.name(stranger))
    }

    fn of_run(&self) -> Vec<Expr<'e>> {
        let found = self.found.borrow();
        let integrals = found.integrals.iter().map(|integral| integral.var);
        integrals.chain(found.marks.iter().copied()).collect()
    }

    fn meaning(&self, expr: &syntax::Expr) -> Option<Tensor<'e>> {
        let ExprKind::Call(function, args) = &expr.kind else {
            return None;
        };
        let ExprKind::Name(word) = &function.kind else {
            return None;
        };
        match word.as_str() {
            "integral" => Some(self.integral(word, args, expr.span)),
            "final" => Some(self.at_end(word, args, expr.span)),
            _ => None,
        }
    }

    /// The argument of a call; zero after a mistake, which is kept.
    fn argument(&self, word: &str, args: &[Arg], span: Span) -> Tensor<'e> {
        let zero = || Tensor::scalar(self.model.exprs.constant(0.0));
        let [Arg::Positional(argument, binders)] = args else {
            return self.arguments(word, span);
        };
        if !binders.is_empty() {
            return self.arguments(word, span);
        }
        let mut diags = Diagnostics::new();
        let value = self.model.scope.expr(argument, None, &mut diags);
        self.found.borrow_mut().diags.append(diags);
        value.unwrap_or_else(zero)
    }

    fn arguments(&self, word: &str, span: Span) -> Tensor<'e> {
        let word = word.to_owned();
        let error = ExperimentError::OneArgument { word, span };
        self.found.borrow_mut().diags.push(error);
        Tensor::scalar(self.model.exprs.constant(0.0))
    }

    fn integral(&self, word: &str, args: &[Arg], span: Span) -> Tensor<'e> {
        let values = self.argument(word, args, span);
        let mut found = self.found.borrow_mut();
        values.map(|value| {
            let known = found.integrals.iter().find(|known| known.value == value);
            if let Some(known) = known {
                return known.var;
            }
            let number = found.integrals.len() + 1;
            let var = self.model.exprs.variable(&format!("integral[{number}]"));
            found.integrals.push(Integral { var, value, span });
            var
        })
    }

    fn at_end(&self, word: &str, args: &[Arg], span: Span) -> Tensor<'e> {
        let values = self.argument(word, args, span);
        let mut found = self.found.borrow_mut();
        values.map(|value| {
            let mark = self.model.exprs.variable("final");
            if let Some(var) = mark.as_variable() {
                found.finals.insert(var, value);
            }
            found.marks.push(mark);
            mark
        })
    }
}

fn is_sum(rest: &[(BinaryOp, syntax::Expr)]) -> bool {
    let first = rest.first();
    first.is_some_and(|(op, _)| matches!(op, BinaryOp::Add | BinaryOp::Sub))
}

/// The terms of a sum, and whether they are taken off it.
fn summands(value: &syntax::Expr) -> Vec<(bool, &syntax::Expr)> {
    match &value.kind {
        ExprKind::Chain(first, rest) if is_sum(rest) => {
            let rest = rest.iter().map(|(op, e)| (*op == BinaryOp::Sub, e));
            [(false, &**first)].into_iter().chain(rest).collect()
        }
        _ => vec![(false, value)],
    }
}

impl<'e> Reader<'_, 'e> {
    /// Mistakes inside the words of a run.
    fn take_mistakes(&mut self, words: &Words<'_, 'e>) -> bool {
        let diags = std::mem::take(&mut words.found.borrow_mut().diags);
        let failed = diags.has_errors();
        self.failed |= failed;
        self.diags.append(diags);
        failed
    }

    /// `minimize integral(..) + final(..)`: in integrals and values at the end.
    pub(crate) fn cost(&mut self, words: &Words<'_, 'e>, value: &syntax::Expr) -> Option<Cost<'e>> {
        let hook = |e: &syntax::Expr| words.meaning(e);
        let tensor = self.model.scope.expr(value, Some(&hook), self.diags);
        let failed = self.take_mistakes(words);
        let Some(tensor) = tensor else {
            self.failed = true;
            return None;
        };
        let Some(cost) = tensor.as_scalar() else {
            self.error(ExperimentError::OutOfRange {
                what: "the cost".to_owned(),
                expected: "one number".to_owned(),
                found: tensor.shape.to_string(),
                span: value.span,
            });
            return None;
        };
        if let Some(name) = words.changing(&[cost]) {
            self.error(ExperimentError::NoInstant {
                name,
                span: value.span,
            });
            return None;
        }
        if failed {
            return None;
        }
        let cost = Cost {
            value: cost,
            terms: self.terms(words, value),
            span: value.span,
        };
        let finals = &words.found.borrow().finals;
        Some(cost.map(|e| e.substitute(finals)))
    }

    /// What a right cost adds up.
    fn terms(&self, words: &Words<'_, 'e>, value: &syntax::Expr) -> Vec<Term<'e>> {
        let hook = |e: &syntax::Expr| words.meaning(e);
        let term = |(is_less, term): (bool, &syntax::Expr)| {
            let negated = syntax::Expr {
                kind: ExprKind::Negate(Box::new(term.clone())),
                span: term.span,
            };
            let text = match &term.kind {
                _ if !is_less => term.to_string(),
                // A sign binds less than these.
                ExprKind::Chain(_, rest) if !is_sum(rest) => format!("-{term}"),
                _ => negated.to_string(),
            };
            let term = if is_less { &negated } else { term };
            // What is wrong, or to be warned of, has been told of the whole.
            let told = &mut Diagnostics::new();
            let value = self.model.scope.expr(term, Some(&hook), told)?;
            Some(Term {
                text,
                value: value.as_scalar()?,
                soft: Vec::new(),
            })
        };
        summands(value).into_iter().filter_map(term).collect()
    }

    /// Constraints and when they hold: `at`, or at the end where they are of values of the whole run.
    pub(crate) fn comparisons(
        &mut self,
        words: &Words<'_, 'e>,
        rows: &[Row],
        at: At,
    ) -> Vec<(At, Comparison<'e>)> {
        let hook = |e: &syntax::Expr| words.meaning(e);
        let rows = self.model.scope.rows(rows, Some(&hook), self.diags);
        let failed = self.take_mistakes(words);
        self.failed |= rows.is_none();
        let mut found = Vec::new();
        for mut row in rows.filter(|_| !failed).into_iter().flatten() {
            let is_of_run = words.are_in(&row.members);
            if is_of_run
                && at != At::End
                && let Some(name) = words.changing(&row.members)
            {
                let span = row.span;
                self.error(ExperimentError::TwoInstants { name, span });
                continue;
            }
            let finals = &words.found.borrow().finals;
            for member in &mut row.members {
                *member = member.substitute(finals);
            }
            found.push((if is_of_run { At::End } else { at }, row));
        }
        found
    }
}
