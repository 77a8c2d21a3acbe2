//! Values that only a run has: times of switches and events, the state at an instant.

use std::cell::{Cell, RefCell};

use rustc_hash::FxHashSet;

use super::error::ExpectError;
use super::{Subject, as_name, mode};
use crate::diagnostics::Diagnostics;
use crate::expr::{Expr, Var, variables_of};
use crate::model::Tensor;
use crate::model::hir::reserved::one_of;
use crate::report::{Event, EventKind, History, Trajectory};
use crate::syntax::{self, Arg, ExprKind};
use crate::system::Valuation;

/// A run, or none yet.
pub enum Run<'r, 'e> {
    /// Mistakes are looked for before the run.
    Unknown,
    /// It has been made.
    Known {
        /// What it gave.
        trajectory: &'r Trajectory,
        /// The order of convergence of its method, not a number where none was measured.
        order: f64,
        /// What its words are in expressions.
        symbols: &'r Symbols<'e>,
    },
}

/// A word that belongs to a run.
#[derive(Clone, Debug)]
enum Word {
    End,
    Order,
    Objective,
    Switches,
    /// The times of events of a kind, of some surfaces or of all.
    Events(EventKind, Option<Vec<String>>),
}

impl Word {
    /// Its numbers in a run that ends at the horizon of its subject.
    fn numbers(&self, subject: &Subject<'_, '_>, trajectory: &Trajectory, order: f64) -> Vec<f64> {
        let history = &trajectory.history;
        match self {
            Word::End => vec![subject.horizon],
            Word::Order => vec![order],
            Word::Objective => vec![trajectory.objective.unwrap_or(f64::NAN)],
            Word::Switches => history.switch_times(),
            Word::Events(kind, surfaces) => times(history, |event| {
                let mut surfaces = surfaces.iter();
                event.kind == *kind && surfaces.all(|known| known.contains(&event.surface))
            }),
        }
    }
}

/// Variables in the place of the numbers that words have in a run: expressions of them hold for all runs in which the words
/// have as many.
#[derive(Default)]
pub struct Symbols<'e> {
    variables: RefCell<Vec<Expr<'e>>>,
    known: RefCell<FxHashSet<Var>>,
    /// Words in the order of their variables, with how many numbers each has.
    words: RefCell<Vec<(Word, usize)>>,
}

impl<'e> Symbols<'e> {
    /// Forgets the words.
    pub fn clear(&mut self) {
        self.words.get_mut().clear();
    }

    /// The variables of so many numbers of another word.
    fn of(&self, subject: &Subject<'_, 'e>, word: Word, n: usize) -> Vec<Expr<'e>> {
        let mut words = self.words.borrow_mut();
        let first: usize = words.iter().map(|(_, n)| n).sum();
        words.push((word, n));
        let mut variables = self.variables.borrow_mut();
        while variables.len() < first + n {
            let variable = subject.model.exprs.variable("word");
            self.known.borrow_mut().extend(variable.as_variable());
            variables.push(variable);
        }
        variables[first..first + n].to_vec()
    }

    /// The numbers of all words in a run, by their variables; none where some word has more or fewer than it has had.
    pub fn numbers(
        &self,
        subject: &Subject<'_, 'e>,
        trajectory: &Trajectory,
        order: f64,
    ) -> Option<Vec<(Expr<'e>, f64)>> {
        let mut numbers = Vec::new();
        for (word, n) in self.words.borrow().iter() {
            let own = word.numbers(subject, trajectory, order);
            if own.len() != *n {
                return None;
            }
            numbers.extend(own);
        }
        let variables = self.variables.borrow();
        Some(variables.iter().copied().zip(numbers).collect())
    }

    /// Whether a variable is that of a word.
    fn has(&self, var: Var) -> bool {
        self.known.borrow().contains(&var)
    }
}

/// Entries that a list has as long as the run is unknown, so that any index is good.
const MANY: usize = 10_000;

/// Meanings of the words that belong to a run.
pub struct Words<'w, 's, 'e> {
    subject: &'w Subject<'s, 'e>,
    run: &'w Run<'w, 'e>,
    errors: RefCell<Vec<ExpectError>>,
    /// Whether a list was asked for, whose length only a run knows.
    pub has_list: Cell<bool>,
    /// Whether the order of convergence was asked for.
    pub has_order: Cell<bool>,
}

impl<'w, 's, 'e> Words<'w, 's, 'e> {
    /// The words of a run.
    pub fn new(subject: &'w Subject<'s, 'e>, run: &'w Run<'w, 'e>) -> Self {
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
            ExprKind::Name(name) if name == "switches" => Some(self.list(Word::Switches)),
            ExprKind::Name(name) if name == "end" => {
                Some(self.number(Word::End, self.subject.horizon))
            }
            ExprKind::Name(name) if name == "order" && self.is_free(name) => {
                self.has_order.set(true);
                if !self.subject.has_steps {
                    let span = expr.span;
                    self.errors.borrow_mut().push(ExpectError::NoOrder { span });
                }
                Some(self.number(Word::Order, 1.0))
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
                Some(self.number(Word::Objective, objective.unwrap_or(f64::NAN)))
            }
            ExprKind::Call(function, args) if as_name(function) == Some("events") => {
                Some(match self.events(args, expr) {
                    Ok(list) => list,
                    Err(error) => {
                        self.errors.borrow_mut().push(error);
                        Tensor::vector(Vec::new())
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
            return Ok(self.list(Word::Events(kind, None)));
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
        let names = names.into_iter().map(str::to_owned);
        Ok(self.list(Word::Events(kind, Some(names.collect()))))
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

    /// A variable of the expressions that is neither a parameter nor a word of the run.
    pub fn unknown(&self, params: &Valuation, exprs: &[Expr<'e>]) -> Option<Var> {
        let is_word = |var: Var| matches!(self.run, Run::Known { symbols, .. } if symbols.has(var));
        let mut variables = variables_of(exprs).into_iter();
        variables.find(|&var| params.get(var).is_none() && !is_word(var))
    }

    fn list(&self, word: Word) -> Tensor<'e> {
        self.has_list.set(true);
        Tensor::vector(match self.run {
            Run::Unknown => vec![self.constant(0.0); MANY],
            Run::Known { .. } => self.symbols(word),
        })
    }

    fn number(&self, word: Word, unknown: f64) -> Tensor<'e> {
        Tensor::scalar(match self.run {
            Run::Unknown => self.constant(unknown),
            Run::Known { .. } => self.symbols(word)[0],
        })
    }

    fn symbols(&self, word: Word) -> Vec<Expr<'e>> {
        match self.run {
            Run::Unknown => Vec::new(),
            Run::Known {
                trajectory,
                order,
                symbols,
            } => {
                let n = word.numbers(self.subject, trajectory, *order).len();
                symbols.of(self.subject, word, n)
            }
        }
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
