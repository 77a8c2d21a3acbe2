//! Values that only a run has: times of switches and events, the state at an instant.

use std::cell::{Cell, RefCell};

use super::error::ExpectError;
use super::{Subject, as_name, mode};
use crate::diagnostics::Diagnostics;
use crate::expr::Expr;
use crate::model::Tensor;
use crate::model::hir::reserved::one_of;
use crate::report::{Event, EventKind, History, Trajectory};
use crate::syntax::{self, Arg, ExprKind};
use crate::system::Valuation;

/// A run, or none yet.
pub enum Run<'r> {
    /// Mistakes are looked for before the run.
    Unknown,
    /// It has been made.
    Known {
        /// What it gave.
        trajectory: &'r Trajectory,
        /// The order of convergence of its method, not a number where none was measured.
        order: f64,
    },
}

/// Entries that a list has as long as the run is unknown, so that any index is good.
const MANY: usize = 10_000;

/// Meanings of the words that belong to a run.
pub struct Words<'w, 's, 'e> {
    subject: &'w Subject<'s, 'e>,
    run: &'w Run<'w>,
    errors: RefCell<Vec<ExpectError>>,
    /// Whether a list was asked for, whose length only a run knows.
    pub has_list: Cell<bool>,
    /// Whether the order of convergence was asked for.
    pub has_order: Cell<bool>,
}

impl<'w, 's, 'e> Words<'w, 's, 'e> {
    /// The words of a run.
    pub fn new(subject: &'w Subject<'s, 'e>, run: &'w Run<'w>) -> Self {
        Words {
            subject,
            run,
            errors: RefCell::default(),
            has_list: Cell::new(false),
            has_order: Cell::new(false),
        }
    }

    /// The value of an expression in the model and the run.
    pub fn value(&self, expr: &syntax::Expr, diags: &mut Diagnostics) -> Option<Tensor<'e>> {
        let value = self
            .subject
            .model
            .scope
            .expr(expr, Some(&|e| self.meaning(e)), diags);
        let errors = self.errors.take();
        let has_errors = !errors.is_empty();
        errors.into_iter().for_each(|error| diags.push(error));
        value.filter(|_| !has_errors)
    }

    /// What a name or call means, where it belongs to the run.
    fn meaning(&self, expr: &syntax::Expr) -> Option<Tensor<'e>> {
        match &expr.kind {
            ExprKind::Name(name) if name == "switches" => Some(self.list(History::switch_times)),
            ExprKind::Name(name) if name == "end" => Some(self.number(self.subject.horizon)),
            ExprKind::Name(name) if name == "order" && self.is_free(name) => {
                self.has_order.set(true);
                if !self.subject.has_steps {
                    let span = expr.span;
                    self.errors.borrow_mut().push(ExpectError::NoOrder { span });
                }
                Some(self.number(match self.run {
                    Run::Unknown => 1.0,
                    Run::Known { order, .. } => *order,
                }))
            }
            ExprKind::Name(name) if name == "objective" && self.is_free(name) => {
                // The task of a solved system is gone; then the run knows its objective.
                let objective = match self.run {
                    Run::Known { trajectory, .. } => trajectory.objective,
                    Run::Unknown => self.subject.system.task.as_ref().map(|_| 1.0),
                };
                if objective.is_none() && matches!(self.run, Run::Unknown) {
                    let span = expr.span;
                    self.errors
                        .borrow_mut()
                        .push(ExpectError::NoObjective { span });
                }
                Some(self.number(objective.unwrap_or(f64::NAN)))
            }
            ExprKind::Call(function, args) if as_name(function) == Some("events") => {
                Some(match self.events(args, expr) {
                    Ok(list) => list,
                    Err(error) => {
                        self.errors.borrow_mut().push(error);
                        self.list(|_| Vec::new())
                    }
                })
            }
            _ => None,
        }
    }

    /// Whether the model does not use a name.
    fn is_free(&self, name: &str) -> bool {
        !self.subject.model.scope.names().any(|known| known == name)
    }

    /// `events(kind)` or `events(kind, surface)`: the times.
    fn events(&self, args: &[Arg], call: &syntax::Expr) -> Result<Tensor<'e>, ExpectError> {
        let wrong = || ExpectError::EventArguments { span: call.span };
        let mut plain = Vec::new();
        for arg in args {
            match arg {
                Arg::Positional(expr, binders) if binders.is_empty() => plain.push(expr),
                _ => return Err(wrong()),
            }
        }
        let (kind, surface) = match plain[..] {
            [kind] => (kind, None),
            [kind, surface] => (kind, Some(surface)),
            _ => return Err(wrong()),
        };
        let kind = self.kind(kind)?;
        let Some(surface) = surface else {
            return Ok(self.list(|history| times(history, |event| event.kind == kind)));
        };
        let text = mode::plain(self.subject, surface);
        let system = self.subject.system;
        let laws = system.jumps.laws.iter().map(|law| law.name.as_str());
        let mut names: Vec<&str> = laws.filter(|name| *name == text).collect();
        names.extend(system.jumps.contacts_of(&text));
        if names.is_empty() {
            let switches = mode::switches_of(self.subject, surface)?.into_iter();
            names.extend(switches.map(|(k, _)| self.subject.system.switches[k].name.as_str()));
        }
        Ok(self.list(|history| {
            times(history, |event| {
                event.kind == kind && names.contains(&event.surface.as_str())
            })
        }))
    }

    fn kind(&self, expr: &syntax::Expr) -> Result<EventKind, ExpectError> {
        let text = as_name(expr).unwrap_or_default();
        let known = EventKind::ALL
            .into_iter()
            .find(|kind| kind.as_str() == text);
        let words = || EventKind::ALL.iter().map(|kind| kind.as_str());
        known.ok_or_else(|| ExpectError::UnknownEvent {
            name: self.subject.sources.text(expr.span).to_owned(),
            span: expr.span,
            help: one_of(text, "kinds are", words()),
        })
    }

    fn list(&self, of: impl Fn(&History) -> Vec<f64>) -> Tensor<'e> {
        self.has_list.set(true);
        let numbers = match self.run {
            Run::Unknown => vec![0.0; MANY],
            Run::Known { trajectory, .. } => of(&trajectory.history),
        };
        Tensor::vector(
            numbers
                .into_iter()
                .map(|number| self.constant(number))
                .collect(),
        )
    }

    fn number(&self, number: f64) -> Tensor<'e> {
        Tensor::scalar(self.constant(number))
    }

    fn constant(&self, number: f64) -> Expr<'e> {
        self.subject.model.exprs.constant(number)
    }
}

fn times(run: &History, is_wanted: impl Fn(&Event) -> bool) -> Vec<f64> {
    run.events
        .iter()
        .filter(|event| is_wanted(event))
        .map(|event| event.time)
        .collect()
}

/// All variables at an instant of a run; `None` where the run has no values.
pub fn at(subject: &Subject<'_, '_>, trajectory: &Trajectory, time: f64) -> Option<Valuation> {
    let system = subject.system;
    let mut row = trajectory.row_at(time)?;
    let n_states = system.states.len().min(row.len());
    let (x, alpha) = row.split_at_mut(n_states);
    system.see(time, x, alpha);
    Some(system.valuation(time, x, alpha))
}
